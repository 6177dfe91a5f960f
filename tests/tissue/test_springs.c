// Laws of the single springs.
#define SONDE_REAL_SCALAR
#include "tissue/laws.h"

#include "../fixture.h"
#include "tissue/two_layer/linearise.h"

// Force q = m g of the shear layer at slope g, on an area of 1, and its slope.
static double shear_force(double shear_n_m, double limit, double g, double *slope) {
  double bend = 1 / (limit * limit), modulus, beyond;
  shear_modulus(shear_n_m, bend, g * g * bend, &modulus, &beyond);
  if (slope) *slope = modulus + beyond * g * g;
  return modulus * g;
}

static const double K0 = 180000, XM = 0.05, GUARD = 0.999;

// f = x/(a x + b) with b = 1/k0, a = -1/(k0 xm) is the same curve.
static void equals_the_papers_form(void **state) {
  (void)state;
  double a = -1 / (K0 * XM), b = 1 / K0;
  for (double x = -0.1; x < 0.0495; x += 0.0007) {
    double slope, p = sonde_normal_pressure(1, K0, XM, GUARD, x, &slope);
    assert_near(p, x / (a * x + b), 1e-9 * (1 + fabs(p)));
    assert_near(slope, b / ((a * x + b) * (a * x + b)), 1e-9 * slope);
  }
}

static void energy_is_the_integral(void **state) {
  (void)state;
  for (int n = 1; n <= 3; ++n)
    for (double x = -0.05; x < 0.06; x += 0.0011) {
      double h = 1e-7, p = sonde_normal_pressure(n, K0, XM, GUARD, x, NULL);
      if (fabs(x - GUARD * XM) < 1e-6) continue;
      double rise = (sonde_normal_energy(n, K0, XM, GUARD, x + h) -
                     sonde_normal_energy(n, K0, XM, GUARD, x - h)) /
                    (2 * h);
      assert_near(rise, p, 1e-5 * (1 + fabs(p)));
    }
}

// Every exponent: slope by differences, k0 at rest, the asymptote at xm, and the higher exponent
// below the lower one on the way.
static void exponents_share_stiffness_and_asymptote(void **state) {
  (void)state;
  for (int n = 1; n <= 3; ++n) {
    double slope, h = 1e-7;
    sonde_normal_pressure(n, K0, XM, GUARD, 0, &slope);
    assert_near(slope, K0, 1e-9 * K0);
    assert_true(sonde_normal_pressure(n, K0, XM, GUARD, 0.998 * XM, NULL) > 100 * K0 * XM);
    for (double x = -0.03; x < 0.048; x += 0.0013) {
      double p = sonde_normal_pressure(n, K0, XM, GUARD, x, &slope);
      double rise = sonde_normal_pressure(n, K0, XM, GUARD, x + h, NULL) -
                    sonde_normal_pressure(n, K0, XM, GUARD, x - h, NULL);
      assert_near(rise / (2 * h), slope, 1e-5 * slope);
      if (n > 1 && x > 0) assert_true(p < sonde_normal_pressure(n - 1, K0, XM, GUARD, x, NULL));
    }
  }
}

// Never attracts: the pressure has the sign of the indentation and grows with it, also past x_m.
static void no_sign_flip_and_monotone(void **state) {
  (void)state;
  double last = -INFINITY;
  for (double x = -0.2; x < 0.2; x += 1e-4) {
    double slope, p = sonde_normal_pressure(1, K0, XM, GUARD, x, &slope);
    assert_true(p * x >= 0);
    assert_true(p > last);
    assert_true(slope > 0);
    last = p;
  }
  assert_true(sonde_normal_pressure(1, K0, XM, GUARD, -1e6, NULL) > -K0 * XM);
}

static void guard_is_smooth(void **state) {
  (void)state;
  double x = GUARD * XM, below_slope, above_slope;
  double below = sonde_normal_pressure(1, K0, XM, GUARD, x * (1 - 1e-12), &below_slope);
  double above = sonde_normal_pressure(1, K0, XM, GUARD, x * (1 + 1e-12), &above_slope);
  assert_near(below, above, 1e-6 * below);
  assert_near(below_slope, above_slope, 1e-6 * below_slope);
}

static void shear_stiffens_and_has_an_energy(void **state) {
  (void)state;
  double slope0, slope1, h = 1e-6;
  for (double g = 0.01; g < 2; g += 0.05) {
    double rise = sonde_shear_energy(15, 1.0, g + h) - sonde_shear_energy(15, 1.0, g - h);
    assert_near(rise / (2 * h), shear_force(15, 1.0, g, NULL),
                1e-6 * shear_force(15, 1.0, g, NULL));
  }
  shear_force(15, 1.0, 0, &slope0);
  shear_force(15, 1.0, 0.9, &slope1);
  assert_near(slope0, 15, 1e-12);
  assert_true(slope1 > 30 * slope0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(equals_the_papers_form),
                                     cmocka_unit_test(energy_is_the_integral),
                                     cmocka_unit_test(no_sign_flip_and_monotone),
                                     cmocka_unit_test(guard_is_smooth),
                                     cmocka_unit_test(shear_stiffens_and_has_an_energy),
                                     cmocka_unit_test(exponents_share_stiffness_and_asymptote)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
