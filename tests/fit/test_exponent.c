// Stage 3 for n = 1, 2, 3: forces of a model with one n, with errors of the sensor, lead back to
// that n by the held-out error.
#include "fit_plate.h"
#include "fit_test.h"

#include "sonde/fit_confidence.h"

#include "base/random.h"

static void law_of_a_model_is_found_again(double n) {
  bundled b = bundled_load("indentation.csv", 6.0);
  keep_nine_sites(&b);
  sonde_fit_def def = sonde_fit_def_default();
  def.stages = 3;
  def.smoothness_sd = 0.03; // sites alike, so that leaving one out shows the law
  def.normal_exponent = n;
  sonde_fit_result truth, found;
  sonde_fit_exponent tried[SONDE_FIT_EXPONENTS];
  sonde_error error;
  assert_ok(sonde_fit(b.model, &b.sites, &b.m, &def, NULL, &truth, &error), &error);
  for (uint32_t k = 0; k < b.m.count; ++k)
    b.m.data[k].force_n = truth.model_n[k] + 0.03 * sonde_random_normal(31, k);
  def.normal_exponent = 2;
  assert_ok(sonde_fit_exponents(b.model, &b.sites, &b.m, &def, NULL, tried, &found, &error),
            &error);
  for (int k = 0; k < SONDE_FIT_EXPONENTS; ++k) {
    print_message("model n = %g, springs n = %g: fit %.2f %%, left out %.2f %%\n", n,
                  tried[k].exponent, tried[k].mae_percent, tried[k].held_out_percent);
    assert_near(tried[k].exponent, k + 1, 0);
    assert_true(tried[k].held_out_percent >= tried[k].mae_percent);
  }
  for (int k = 0; k < SONDE_FIT_EXPONENTS; ++k)
    if (tried[k].exponent != n)
      assert_true(tried[k].held_out_percent > 1.1 * tried[(int)n - 1].held_out_percent);
  assert_near(found.law.normal_exponent, n, 0);
  assert_near(found.law.shear_stiffness_n_m, truth.law.shear_stiffness_n_m,
              0.1 * truth.law.shear_stiffness_n_m);
  sonde_fit_result_clear(&truth);
  sonde_fit_result_clear(&found);
  bundled_clear(&b);
}

static void first_exponent_is_found(void **state) {
  (void)state;
  law_of_a_model_is_found_again(1);
}

static void third_exponent_is_found(void **state) {
  (void)state;
  law_of_a_model_is_found_again(3);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(first_exponent_is_found),
      cmocka_unit_test(third_exponent_is_found),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
