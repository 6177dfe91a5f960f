// Laws of the single springs.
// barrier:         x/(1 - x^n), its slope and its integral for n = 1, 2, 3.
// normal_pressure: eq. (1) per area with a straight continuation beyond the guard.
// normal_energy:   its integral, a log barrier below the guard and a parabola beyond.
// shear_force:     the even law (n = 2) applied to the slope of the skin.
// sonde_law_scale: all stiffnesses of a law.
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"
#include "tissue/two_layer.h"

static const double SHEAR_GUARD = 0.95;

// x/(1 - x^n); slope (1 + (n-1) x^n)/(1 - x^n)^2. n = 1 keeps its branch for x < 0, where it
// saturates; the others go on straight there, with the same slope and curvature.
static inline double barrier(double n, double x, double *slope) {
  if (x < 0 && n > 1) {
    *slope = 1;
    return x;
  }
  double power = n > 2 ? x * x * x : n > 1 ? x * x : x;
  double inverse = 1.0 / (1.0 - power);
  *slope = (1.0 + (n - 1.0) * power) * inverse * inverse;
  return x * inverse;
}

// Integral of x/(1 - x^n) from 0; n = 3 by partial fractions.
static double barrier_energy(double n, double x) {
  if (x < 0 && n > 1) return 0.5 * x * x;
  if (n < 2) return -x - log1p(-x);
  if (n < 3) return -0.5 * log1p(-x * x);
  const double root = sqrt(3.0);
  return -log1p(-x) / 3 + log1p(x + x * x) / 6 - (atan((2 * x + 1) / root) - atan(1 / root)) / root;
}

// p(s) = k0 s/(1 - (s/xm)^n). Beyond theta*xm the tangent continues, so that a step that jumps past
// the asymptote is pushed back and never attracted.
double sonde_normal_pressure(double exponent, double k0_n_m3, double xm_m, double guard, double s_m,
                             double *slope_n_m3) {
  double limit = guard * xm_m, slope;
  double s = s_m < limit ? s_m : limit;
  double pressure = k0_n_m3 * xm_m * barrier(exponent, s / xm_m, &slope);
  if (slope_n_m3) *slope_n_m3 = k0_n_m3 * slope;
  return pressure + k0_n_m3 * slope * (s_m - s);
}

double sonde_normal_energy(double exponent, double k0_n_m3, double xm_m, double guard, double s_m) {
  double limit = guard * xm_m, slope;
  double s = s_m < limit ? s_m : limit, over = s_m - s;
  double pressure = sonde_normal_pressure(exponent, k0_n_m3, xm_m, guard, s, &slope);
  return k0_n_m3 * xm_m * xm_m * barrier_energy(exponent, s / xm_m) +
         over * (pressure + 0.5 * slope * over);
}

// q = G g/(1 - (g/gm)^2), straight beyond 0.95 gm (docs/fit.md); g >= 0.
double sonde_shear_force(double shear_n_m, double limit, double g, double *slope) {
  SONDE_ASSERT(g >= 0);
  return sonde_normal_pressure(2, shear_n_m, limit, SHEAR_GUARD, g, slope);
}

double sonde_shear_energy(double shear_n_m, double limit, double g) {
  return sonde_normal_energy(2, shear_n_m, limit, SHEAR_GUARD, g);
}

void sonde_law_scale(sonde_surface_law *law, double scale) {
  SONDE_ASSERT(scale > 0);
  law->edge_stiffness_n_m *= scale;
  law->edge_pretension_n *= scale;
  law->tangential_stiffness_n_m3 *= scale;
  law->inplane_stiffness_n_m *= scale;
  law->shear_stiffness_n_m *= scale;
}
