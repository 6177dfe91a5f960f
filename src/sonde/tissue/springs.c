// Laws of the single springs as functions of numbers, their energies, and their scaling.
#define SONDE_REAL_SCALAR
#include "tissue/laws.h"
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"
#include "tissue/two_layer/linearise.h"

// Integral of x/(1 - x^n) from 0; n = 3 by partial fractions.
static double barrier_energy(double n, double x) {
  if (x < 0 && n > 1) return 0.5 * x * x;
  if (n < 2) return -x - log1p(-x);
  if (n < 3) return -0.5 * log1p(-x * x);
  const double root = sqrt(3.0);
  return -log1p(-x) / 3 + log1p(x + x * x) / 6 - (atan((2 * x + 1) / root) - atan(1 / root)) / root;
}

double sonde_normal_pressure(double exponent, double k0_n_m3, double xm_m, double guard, double s_m,
                             double *slope_n_m3) {
  SONDE_ASSERT(exponent >= 1 && xm_m > 0 && guard < 1);
  double slope, pressure = normal_pressure((int)exponent, k0_n_m3, xm_m, guard * xm_m, s_m, &slope);
  if (slope_n_m3) *slope_n_m3 = slope;
  return pressure;
}

double sonde_normal_energy(double exponent, double k0_n_m3, double xm_m, double guard, double s_m) {
  double limit = guard * xm_m, slope;
  double s = s_m < limit ? s_m : limit, over = s_m - s;
  double pressure = sonde_normal_pressure(exponent, k0_n_m3, xm_m, guard, s, &slope);
  return k0_n_m3 * xm_m * xm_m * barrier_energy(exponent, s / xm_m) +
         over * (pressure + 0.5 * slope * over);
}

double sonde_shear_energy(double shear_n_m, double limit, double g) {
  return sonde_normal_energy(2, shear_n_m, limit, SONDE_SHEAR_GUARD, g);
}

void sonde_law_scale(sonde_surface_law *law, double scale) {
  SONDE_ASSERT(scale > 0);
  law->edge_stiffness_n_m *= scale;
  law->edge_pretension_n *= scale;
  law->tangential_stiffness_n_m3 *= scale;
  law->inplane_stiffness_n_m *= scale;
  law->shear_stiffness_n_m *= scale;
}
