// Straight moves are found again behind noise, with their corners where they were.
#include "identify/track.h"

#include "identify_test.h"

enum { SAMPLES = 1500 };

// Out, in at 40 mm/s, hold, back at 20 mm/s; samples every millisecond.
static double wanted(double t) {
  if (t < 0.2) return -1e-3;
  if (t < 0.45) return -1e-3 + 0.04 * (t - 0.2);
  if (t < 0.9) return 9e-3;
  if (t < 1.4) return 9e-3 - 0.02 * (t - 0.9);
  return -1e-3;
}

static sonde_track fitted(double noise_m, uint64_t seed) {
  static double time[SAMPLES], value[SAMPLES];
  for (uint32_t k = 0; k < SAMPLES; ++k) {
    time[k] = 5 + 1e-3 * k; // clocks start anywhere
    value[k] = wanted(1e-3 * k) + noise_m * sonde_random_normal(seed, k);
  }
  sonde_track track;
  sonde_error error = {0};
  assert_ok(sonde_track_fit(time, value, 1, SAMPLES, &track, &error), &error);
  return track;
}

static void finds_the_corners(void **unused) {
  (void)unused;
  const double corner_s[] = {0.2, 0.45, 0.9, 1.4};
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    sonde_track track = fitted(5e-5, seed);
    assert_int_equal(track.count, 6);
    for (int k = 0; k < 4; ++k) assert_near(track.time_s[k + 1], 5 + corner_s[k], 2e-3);
    for (int k = 0; k < SAMPLES; ++k)
      assert_near(sonde_track_at(&track, 5 + 1e-3 * k), wanted(1e-3 * k), 4e-5);
    sonde_track_clear(&track);
  }
}

static void is_exact_without_noise(void **unused) {
  (void)unused;
  sonde_track track = fitted(0, 1);
  for (int k = 0; k < SAMPLES; ++k)
    assert_near(sonde_track_at(&track, 5 + 1e-3 * k), wanted(1e-3 * k), 4e-6);
  sonde_track_clear(&track);
}

static void a_still_probe_is_one_piece(void **unused) {
  (void)unused;
  double time[60], value[60];
  for (uint32_t k = 0; k < 60; ++k) {
    time[k] = 0.01 * k;
    value[k] = 2e-3 + 5e-5 * sonde_random_normal(3, k);
  }
  sonde_track track;
  assert_int_equal(sonde_track_fit(time, value, 1, 60, &track, NULL), SONDE_OK);
  assert_int_equal(track.count, 2);
  assert_near(sonde_track_at(&track, -1), sonde_track_at(&track, 0), 0); // constant outside
  assert_near(sonde_track_at(&track, 0.3), 2e-3, 3e-5);
  sonde_track_clear(&track);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(finds_the_corners),
                                     cmocka_unit_test(is_exact_without_noise),
                                     cmocka_unit_test(a_still_probe_is_one_piece)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
