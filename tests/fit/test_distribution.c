// Maximum-likelihood fits: known parameters come back, no neighbour is more likely, densities are
// densities, and the better description wins.
#include "base/random.h"
#include "fixture.h"
#include "sonde/fit_distribution.h"

enum { COUNT = 20000 };
static double sample[COUNT];

static int compare(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double laplace(uint64_t i) {
  double u = sonde_random_uniform(5, i) - 0.5;
  return (u < 0 ? 1 : -1) * log(1 - 2 * fabs(u));
}

// A normal over the root of a chi-square per degree of freedom.
static double student(uint64_t i, int freedom) {
  double squares = 0;
  for (int k = 0; k < freedom; ++k) squares += pow(sonde_random_normal(7, i * 16 + (uint64_t)k), 2);
  return sonde_random_normal(8, i) / sqrt(squares / freedom);
}

static void draw(sonde_distribution_kind kind, double place, double scale, int freedom) {
  for (uint64_t i = 0; i < COUNT; ++i) {
    double z = kind == SONDE_NORMAL    ? sonde_random_normal(4, i)
               : kind == SONDE_LAPLACE ? laplace(i)
                                       : student(i, freedom);
    sample[i] = place + scale * z;
  }
  qsort(sample, COUNT, sizeof *sample, compare);
}

static sonde_distribution fit(sonde_distribution_kind kind) {
  sonde_distribution d;
  assert_true(sonde_distribution_fit(kind, sample, COUNT, &d));
  return d;
}

// Standard errors are scale/sqrt(n) times about 1: 0.7 %; four of them are allowed.
static void known_parameters_come_back(void **state) {
  (void)state;
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k) {
    draw((sonde_distribution_kind)k, 0.3, 0.02, 4);
    sonde_distribution d = fit((sonde_distribution_kind)k);
    assert_near(d.place, 0.3, 0.03 * 0.02);
    assert_near(d.scale, 0.02, 0.03 * 0.02);
    if (k == SONDE_STUDENT) assert_near(d.freedom, 4, 0.5);
  }
}

static double likelihood_of(const sonde_distribution *d) {
  double sum = 0;
  for (int i = 0; i < COUNT; ++i) sum += log(sonde_distribution_density(d, sample[i]));
  return sum;
}

static void no_neighbour_is_more_likely(void **state) {
  (void)state;
  draw(SONDE_STUDENT, -1, 2, 3);
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k) {
    sonde_distribution best = fit((sonde_distribution_kind)k);
    assert_near(likelihood_of(&best), best.log_likelihood, 1e-6 * COUNT);
    for (int i = 0; i < 6; ++i) {
      sonde_distribution other = best;
      double change = i % 2 ? 0.02 : -0.02;
      if (i / 2 == 0) other.place += change * best.scale;
      if (i / 2 == 1) other.scale *= 1 + change;
      if (i / 2 == 2) other.freedom *= 1 + 2 * change;
      if (i / 2 == 2 && k != SONDE_STUDENT) continue;
      assert_true(likelihood_of(&other) < best.log_likelihood);
    }
  }
}

static void densities_integrate_to_one(void **state) {
  (void)state;
  const sonde_distribution all[] = {{SONDE_NORMAL, 0.1, 0.5, 0, 0, 0},
                                    {SONDE_LAPLACE, 0.1, 0.5, 0, 0, 0},
                                    {SONDE_STUDENT, 0.1, 0.5, 5, 0, 0}};
  for (size_t k = 0; k < SONDE_COUNT_OF(all); ++k) {
    double sum = 0, step = 1e-3;
    for (int i = -60000; i <= 60000; ++i)
      sum += step * sonde_distribution_density(&all[k], 0.1 + step * i);
    assert_near(sum, 1, 1e-5);
  }
}

// The sample's own kind has the lowest AIC; a normal sample asks for many degrees of freedom.
static void own_kind_wins(void **state) {
  (void)state;
  for (int own = 0; own < SONDE_DISTRIBUTIONS; ++own) {
    draw((sonde_distribution_kind)own, 0, 1, 3);
    for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k)
      if (k != own)
        assert_true(fit((sonde_distribution_kind)own).aic < fit((sonde_distribution_kind)k).aic);
    if (own == SONDE_NORMAL) assert_true(fit(SONDE_STUDENT).freedom > 50);
  }
}

static void nothing_to_fit_is_said(void **state) {
  (void)state;
  const double same[10] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1}, few[3] = {1, 2, 3};
  const double nearly[10] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 2};
  sonde_distribution d;
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k) {
    assert_false(sonde_distribution_fit((sonde_distribution_kind)k, same, 10, &d));
    assert_false(sonde_distribution_fit((sonde_distribution_kind)k, few, 3, &d));
    if (sonde_distribution_fit((sonde_distribution_kind)k, nearly, 10, &d))
      assert_true(isfinite(d.aic) && d.scale > 0);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(known_parameters_come_back), cmocka_unit_test(no_neighbour_is_more_likely),
      cmocka_unit_test(densities_integrate_to_one), cmocka_unit_test(own_kind_wins),
      cmocka_unit_test(nothing_to_fit_is_said),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
