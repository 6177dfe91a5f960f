// Laws of the single springs.
#include "../fixture.h"

static const double K0 = 180000, XM = 0.05, GUARD = 0.999;

// f = x/(a x + b) with b = 1/k0, a = -1/(k0 xm) is the same curve.
static void equals_the_papers_form(void **state) {
  (void)state;
  double a = -1 / (K0 * XM), b = 1 / K0;
  for (double x = -0.1; x < 0.0495; x += 0.0007) {
    double slope, p = sonde_normal_pressure(K0, XM, GUARD, x, &slope);
    assert_near(p, x / (a * x + b), 1e-9 * (1 + fabs(p)));
    assert_near(slope, b / ((a * x + b) * (a * x + b)), 1e-9 * slope);
  }
}

static void energy_is_the_integral(void **state) {
  (void)state;
  for (double x = -0.05; x < 0.06; x += 0.0011) {
    double h = 1e-7, p = sonde_normal_pressure(K0, XM, GUARD, x, NULL);
    if (fabs(x - GUARD * XM) < 1e-6) continue;
    double rise =
        (sonde_normal_energy(K0, XM, GUARD, x + h) - sonde_normal_energy(K0, XM, GUARD, x - h)) /
        (2 * h);
    assert_near(rise, p, 1e-5 * (1 + fabs(p)));
  }
}

// Never attracts: the pressure has the sign of the indentation and grows with it, also past x_m.
static void no_sign_flip_and_monotone(void **state) {
  (void)state;
  double last = -INFINITY;
  for (double x = -0.2; x < 0.2; x += 1e-4) {
    double slope, p = sonde_normal_pressure(K0, XM, GUARD, x, &slope);
    assert_true(p * x >= 0);
    assert_true(p > last);
    assert_true(slope > 0);
    last = p;
  }
  assert_true(sonde_normal_pressure(K0, XM, GUARD, -1e6, NULL) > -K0 * XM);
}

static void guard_is_smooth(void **state) {
  (void)state;
  double x = GUARD * XM, below_slope, above_slope;
  double below = sonde_normal_pressure(K0, XM, GUARD, x * (1 - 1e-12), &below_slope);
  double above = sonde_normal_pressure(K0, XM, GUARD, x * (1 + 1e-12), &above_slope);
  assert_near(below, above, 1e-6 * below);
  assert_near(below_slope, above_slope, 1e-6 * below_slope);
}

static void shear_is_odd_and_stiffens(void **state) {
  (void)state;
  double slope0, slope1;
  for (double g = 0; g < 2; g += 0.05) {
    double plus = sonde_shear_force(15, 1.0, g, NULL), minus = sonde_shear_force(15, 1.0, -g, NULL);
    assert_near(plus, -minus, 1e-12);
  }
  sonde_shear_force(15, 1.0, 0, &slope0);
  sonde_shear_force(15, 1.0, 0.9, &slope1);
  assert_near(slope0, 15, 1e-12);
  assert_true(slope1 > 50 * slope0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(equals_the_papers_form), cmocka_unit_test(energy_is_the_integral),
      cmocka_unit_test(no_sign_flip_and_monotone), cmocka_unit_test(guard_is_smooth),
      cmocka_unit_test(shear_is_odd_and_stiffens)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
