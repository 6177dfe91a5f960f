// What records say without a model: exponentials put in come out, so do ratios of forces.
#include "identify_test.h"

enum { HOLD_SAMPLES = 3200, SLIDE_SAMPLES = 4000 };

static const double NOISE_N = 0.05, NOISE_M = 5e-5;

static void add_noise(sonde_motion_record *r, uint64_t seed) {
  for (uint32_t k = 0; k < r->count; ++k) {
    sonde_motion_sample *s = &r->samples[k];
    s->penetration_m += NOISE_M * sonde_random_normal(seed, 4 * (uint64_t)k);
    s->slide_m += NOISE_M * sonde_random_normal(seed, 4 * (uint64_t)k + 1);
    s->normal_n += NOISE_N * sonde_random_normal(seed, 4 * (uint64_t)k + 2);
    s->tangential_n += NOISE_N * sonde_random_normal(seed, 4 * (uint64_t)k + 3);
  }
}

// Ramp of 10 mm in 0.2 s, then 3 s of 8 + 3 e^(-t/0.05) + 2 e^(-t/0.6) N.
static void both_relaxation_times_are_found(void **unused) {
  (void)unused;
  static sonde_motion_sample samples[HOLD_SAMPLES];
  sonde_motion_record r = {.count = HOLD_SAMPLES, .samples = samples};
  for (int k = 0; k < HOLD_SAMPLES; ++k) {
    double t = 1e-3 * k - 0.2;
    double f = t < 0 ? 65 * (t + 0.2) : 8 + 3 * exp(-t / 0.05) + 2 * exp(-t / 0.6);
    samples[k] = (sonde_motion_sample){1e-3 * k, t < 0 ? 0.05 * (t + 0.2) : 0.01, 0, f, 0};
  }
  add_noise(&r, 7);
  sonde_relaxation hold[SONDE_HOLDS];
  uint32_t count;
  sonde_error error = {0};
  assert_ok(sonde_relaxation_read(&r, hold, &count, &error), &error);
  assert_int_equal(count, 1);
  assert_near(hold->depth_m, 0.01, 2e-5);
  assert_near(hold->speed_m_s, 0.05, 5e-4);
  assert_near(hold->start_s, 0.2, 2e-3);
  assert_near(hold->peak_n, 13, 0.15);
  assert_near(hold->static_n, 8, 0.05);
  assert_near(hold->tau_s[0], 0.05, 0.005);
  assert_near(hold->tau_s[1], 0.6, 0.06);
  assert_near(hold->rms_n, NOISE_N, 0.005);
  // 3 e^(-t/0.05) + 2 e^(-t/0.6) = 5/e at t = 0.1292 s
  assert_near(hold->relaxation_s, 0.1292, 0.01);
}

static void a_hold_without_relaxation_has_none(void **unused) {
  (void)unused;
  static sonde_motion_sample samples[HOLD_SAMPLES];
  sonde_motion_record r = {.count = HOLD_SAMPLES, .samples = samples};
  for (int k = 0; k < HOLD_SAMPLES; ++k) {
    double depth = k < 200 ? 5e-5 * k : 0.01;
    samples[k] = (sonde_motion_sample){1e-3 * k, depth, 0, 800 * depth, 0};
  }
  sonde_relaxation hold[SONDE_HOLDS];
  uint32_t count;
  assert_int_equal(sonde_relaxation_read(&r, hold, &count, NULL), SONDE_OK);
  assert_near(hold->ratio, 1, 1e-3);
  assert_near(hold->static_n, 8, 1e-3);
}

// To and fro at 10 and 40 mm/s on skin that leans by 0.05, while the push swings by a fifth.
static void ratios_do_not_depend_on_the_push(void **unused) {
  (void)unused;
  static sonde_motion_sample samples[SLIDE_SAMPLES];
  sonde_motion_record r = {.count = SLIDE_SAMPLES, .samples = samples};
  double at = 0;
  for (int k = 0; k < SLIDE_SAMPLES; ++k) {
    double t = 1e-3 * k, speed = 0, push = 5 + sin(9 * t);
    if (t > 0.1 && t < 1.1) speed = 0.01;
    if (t > 1.3 && t < 2.3) speed = -0.01;
    if (t > 2.5 && t < 2.8) speed = 0.04;
    if (t > 3.0 && t < 3.3) speed = -0.04;
    double mu = fabs(speed) > 0.02 ? 0.3 : 0.4, sign = speed > 0 ? 1 : speed < 0 ? -1 : 0;
    at += 1e-3 * speed;
    samples[k] = (sonde_motion_sample){t, 5e-3, at, push, push * (mu * sign + 0.05)};
  }
  add_noise(&r, 11);
  sonde_slide slide[SONDE_HOLDS];
  uint32_t count;
  sonde_error error = {0};
  assert_ok(sonde_slide_read(&r, slide, &count, &error), &error);
  assert_int_equal(count, 2);
  assert_near(slide[0].speed_m_s, 0.01, 2e-4);
  assert_near(slide[0].ratio, 0.4, 0.004);
  assert_near(slide[1].speed_m_s, 0.04, 8e-4);
  assert_near(slide[1].ratio, 0.3, 0.004);
  assert_near(slide[0].lean, 0.05, 0.004);
  assert_int_equal(slide[1].moves, 2);
}

static void records_without_moves_are_refused(void **unused) {
  (void)unused;
  sonde_motion_sample samples[100];
  sonde_motion_record r = {.count = 100, .samples = samples};
  for (int k = 0; k < 100; ++k) samples[k] = (sonde_motion_sample){0.01 * k, 5e-3, 0, 3, 0};
  sonde_slide slide[SONDE_HOLDS];
  sonde_relaxation hold[SONDE_HOLDS];
  uint32_t count;
  sonde_error error = {0};
  assert_int_equal(sonde_slide_read(&r, slide, &count, &error), SONDE_FORMAT);
  assert_says(&error, "no slide");
  assert_int_equal(sonde_relaxation_read(&r, hold, &count, &error), SONDE_FORMAT);
  assert_says(&error, "no ramp");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(both_relaxation_times_are_found),
                                     cmocka_unit_test(a_hold_without_relaxation_has_none),
                                     cmocka_unit_test(ratios_do_not_depend_on_the_push),
                                     cmocka_unit_test(records_without_moves_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
