// Counter-based random numbers: moments, independence of seed and counter, no collisions.
#include "test.h"

#include "base/random.h"

enum { DRAWS = 200000, BINS = 64 };

static void same_key_gives_same_value(void **state) {
  (void)state;
  for (uint64_t i = 0; i < 100; ++i) {
    assert_int_equal(sonde_random_bits(7, i), sonde_random_bits(7, i));
    assert_true(sonde_random_bits(7, i) != sonde_random_bits(8, i));
    assert_true(sonde_random_bits(7, i) != sonde_random_bits(7, i + 1));
    assert_true(sonde_random_bits(i, i + 1) != sonde_random_bits(i + 1, i));
  }
}

static void uniform_fills_its_bins(void **state) {
  (void)state;
  unsigned count[BINS] = {0};
  for (uint64_t i = 0; i < DRAWS; ++i) {
    double u = sonde_random_uniform(3, i);
    assert_true(u >= 0.0 && u < 1.0);
    count[(unsigned)(u * BINS)]++;
  }
  double expected = (double)DRAWS / BINS, chi2 = 0;
  for (int b = 0; b < BINS; ++b) {
    double d = count[b] - expected;
    chi2 += d * d / expected;
  }
  // 63 degrees of freedom: mean 63, sd 11.2; five sd either way.
  assert_true(chi2 > 7.0 && chi2 < 119.0);
}

static void normal_has_the_moments_of_a_gaussian(void **state) {
  (void)state;
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0, lag = 0, before = 0;
  for (uint64_t i = 0; i < DRAWS; ++i) {
    double x = sonde_random_normal(11, i);
    assert_true(isfinite(x));
    m1 += x, m2 += x * x, m3 += x * x * x, m4 += x * x * x * x, lag += x * before;
    before = x;
  }
  double n = DRAWS, sd = 1.0 / sqrt(n);
  assert_true(fabs(m1 / n) < 5 * sd);
  assert_true(fabs(m2 / n - 1.0) < 5 * sqrt(2.0) * sd);
  assert_true(fabs(m3 / n) < 5 * sqrt(15.0) * sd);
  assert_true(fabs(m4 / n - 3.0) < 5 * sqrt(96.0) * sd);
  assert_true(fabs(lag / n) < 5 * sd);
}

// Flipping one bit of the counter or of the seed flips half of the output bits.
static void each_input_bit_moves_half_of_the_output(void **state) {
  (void)state;
  for (unsigned bit = 0; bit < 64; ++bit) {
    unsigned by_counter = 0, by_seed = 0;
    for (uint64_t i = 0; i < 256; ++i) {
      uint64_t base = sonde_random_bits(i, 3 * i), flip = (uint64_t)1 << bit;
      by_counter += (unsigned)__builtin_popcountll(base ^ sonde_random_bits(i, (3 * i) ^ flip));
      by_seed += (unsigned)__builtin_popcountll(base ^ sonde_random_bits(i ^ flip, 3 * i));
    }
    assert_in_range(by_counter, 256 * 29, 256 * 35);
    assert_in_range(by_seed, 256 * 29, 256 * 35);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(same_key_gives_same_value),
      cmocka_unit_test(uniform_fills_its_bins),
      cmocka_unit_test(normal_has_the_moments_of_a_gaussian),
      cmocka_unit_test(each_input_bit_moves_half_of_the_output),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
