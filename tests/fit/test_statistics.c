// Error statistics on sets small enough to work out by hand.
#include "fit_test.h"

// e = -1, 0, 1, 4: mean 1, |e| mean 1.5, squares 18/4, deviations -2 -1 0 3 -> 14/4.
static void matches_hand_computation(void **state) {
  (void)state;
  const double model[] = {9, 10, 11, 14}, measured[] = {10, 10, 10, 10};
  sonde_error_statistics s;
  assert_ok(sonde_error_statistics_of(model, measured, 4, &s, NULL), NULL);
  assert_int_equal(s.count, 4);
  assert_near(s.mae_n, 1.5, 1e-15);
  assert_near(s.bias_n, 1.0, 1e-15);
  assert_near(s.sd_n, sqrt(3.5), 1e-15);
  assert_near(s.rmse_n, sqrt(4.5), 1e-15);
  assert_near(s.mean_force_n, 10.0, 1e-15);
  assert_near(s.mae_percent, 15.0, 1e-13);
  assert_near(s.sd_abs_n, 1.5, 1e-15); // |e| 1 0 1 4 about 1.5: .25 2.25 .25 6.25 -> 9/4
  assert_near(s.median_abs_n, 1.0, 1e-15);
  assert_near(s.p95_abs_n, 1 + 0.85 * 3, 1e-14); // rank 2.85 of 0 1 1 4
  assert_near(s.max_abs_n, 4.0, 0);
}

// rmse^2 = bias^2 + sd^2 holds for any data.
static void moments_agree(void **state) {
  (void)state;
  double model[101], measured[101];
  for (int i = 0; i < 101; ++i) {
    measured[i] = 1 + 0.1 * i;
    model[i] = measured[i] + sin(7.0 * i) + 0.01 * i;
  }
  sonde_error_statistics s;
  assert_ok(sonde_error_statistics_of(model, measured, 101, &s, NULL), NULL);
  assert_near(s.rmse_n * s.rmse_n, s.bias_n * s.bias_n + s.sd_n * s.sd_n, 1e-13);
  assert_true(s.median_abs_n <= s.p95_abs_n && s.p95_abs_n <= s.max_abs_n);
  assert_true(s.mae_n <= s.rmse_n);
}

static void reports_per_probe_and_skips_nan(void **state) {
  (void)state;
  const sonde_datum data[] = {{0, "point", 0.002, 1},
                              {0, "linear", 0.002, 10},
                              {1, "point", 0.002, 3},
                              {1, "linear", 0.002, 30}};
  const double model[] = {1.5, 12, 3.5, NAN};
  sonde_error_report r;
  assert_ok(sonde_error_report_of(data, model, 4, &r, NULL), NULL);
  assert_int_equal(r.probe_count, 2);
  assert_string_equal(r.probe[0], "point");
  assert_int_equal(r.all.count, 3);
  assert_int_equal(r.left_out, 1);
  assert_int_equal(r.probes[0].count, 2);
  assert_int_equal(r.probes[1].count, 1);
  assert_near(r.probes[0].mae_n, 0.5, 1e-15);
  assert_near(r.probes[0].mae_percent, 25.0, 1e-13);
  assert_near(r.probes[0].sd_n, 0.0, 1e-15);
  assert_near(r.probes[1].mae_percent, 20.0, 1e-13);
  assert_near(r.all.mae_n, 1.0, 1e-15);
}

static void empty_and_too_many_probes(void **state) {
  (void)state;
  sonde_error_statistics s;
  const double nothing = NAN;
  assert_ok(sonde_error_statistics_of(&nothing, &nothing, 1, &s, NULL), NULL);
  assert_int_equal(s.count, 0);
  sonde_datum data[SONDE_FIT_PROBES + 1] = {0};
  double model[SONDE_FIT_PROBES + 1] = {0};
  for (int i = 0; i <= SONDE_FIT_PROBES; ++i) snprintf(data[i].probe, 24, "p%d", i);
  sonde_error_report r;
  sonde_error error;
  assert_int_equal(sonde_error_report_of(data, model, SONDE_FIT_PROBES + 1, &r, &error),
                   SONDE_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(matches_hand_computation),
      cmocka_unit_test(moments_agree),
      cmocka_unit_test(reports_per_probe_and_skips_nan),
      cmocka_unit_test(empty_and_too_many_probes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
