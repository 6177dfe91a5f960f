// Stage 3 on the bundled measurements: the error that the model users press is allowed to have, and
// the independence of the result of the number of threads.
#include "fit_test.h"

#include "fit_plate.h"

static sonde_fit_result refit(const bundled *b, uint32_t threads) {
  sonde_fit_def def = sonde_fit_def_default();
  def.stages = 3;
  def.threads = threads;
  sonde_fit_result result;
  sonde_error error;
  assert_ok(sonde_fit(b->model, &b->sites, &b->m, &def, NULL, &result, &error), &error);
  assert_true(result.converged);
  return result;
}

static void bundled_measurements_are_followed(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 3.0);
  sonde_fit_result result = refit(&b, 0);
  print_message("stage 3: %.2f %% of the mean force, G %.2f N/m, limit %.3f\n",
                result.stage3.all.mae_percent, result.law.shear_stiffness_n_m,
                result.law.shear_limit);
  assert_int_equal(result.stage3.all.count, b.m.count);
  assert_true(result.stage3.all.mae_percent < 3.0);
  assert_true(result.stage3.all.mae_percent < 0.2 * result.stage2.all.mae_percent);
  for (uint32_t p = 0; p < result.stage3.probe_count; ++p)
    assert_true(result.stage3.probes[p].mae_percent < 3.5);
  for (uint32_t s = 0; s < result.site_count; ++s)
    assert_true(result.sites[s].xm_m > 0.03 && result.sites[s].xm_m < 0.15); // no oscillation
  sonde_fit_result_clear(&result);
  bundled_clear(&b);
}

static void threads_do_not_change_the_result(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 6.0);
  uint32_t rows = 0;
  for (uint32_t r = 0; r < b.m.count; ++r)
    if (b.m.data[r].site < 16) b.m.data[rows++] = b.m.data[r];
  b.m.count = rows;
  sonde_fit_result one = refit(&b, 1), three = refit(&b, 3);
  assert_near(one.law.shear_stiffness_n_m, three.law.shear_stiffness_n_m, 0);
  for (uint32_t s = 0; s < one.site_count; ++s) {
    assert_near(one.sites[s].k0_n_m3, three.sites[s].k0_n_m3, 0);
    assert_true(one.sites[s].k0_n_m3 > 0 && isfinite(one.sites[s].xm_m)); // also unmeasured ones
  }
  sonde_fit_result_clear(&one);
  sonde_fit_result_clear(&three);
  bundled_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bundled_measurements_are_followed),
      cmocka_unit_test(threads_do_not_change_the_result),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
