// Laws of the single springs.
// normal_pressure: eq. (1) per area with a straight continuation beyond the guard.
// normal_energy:   its integral, a log barrier below the guard and a parabola beyond.
// shear_force:     the same law applied to the slope between two neighbours.
#include "sonde/tissue.h"

#include "base/base.h"
#include "base/maths.h"

// p(s) = k0 s/(1 - s/xm); slope k0/(1 - s/xm)^2. The same branch holds for pull (s < 0), where it
// saturates at -k0 xm. Beyond theta*xm the tangent continues, so that a step that jumps past the
// asymptote is pushed back and never attracted.
double sonde_normal_pressure(double k0_n_m3, double xm_m, double guard, double s_m,
                             double *slope_n_m3) {
  double limit = guard * xm_m;
  double s = s_m < limit ? s_m : limit;
  double gap = 1.0 - s / xm_m;
  double slope = k0_n_m3 / (gap * gap);
  if (slope_n_m3) *slope_n_m3 = slope;
  return k0_n_m3 * s / gap + slope * (s_m - s);
}

// U = k0 xm^2 (-x - ln(1-x)), x = s/xm; beyond the guard the tangent's parabola.
double sonde_normal_energy(double k0_n_m3, double xm_m, double guard, double s_m) {
  double limit = guard * xm_m;
  double s = s_m < limit ? s_m : limit, over = s_m - s;
  double x = s / xm_m, slope;
  double pressure = sonde_normal_pressure(k0_n_m3, xm_m, guard, s, &slope);
  return k0_n_m3 * xm_m * xm_m * (-x - log1p(-x)) + over * (pressure + 0.5 * slope * over);
}

// q = G g/(1 - |g|/gm), odd in g, straight beyond 0.95 gm (docs/fit.md).
double sonde_shear_force(double shear_n_m, double limit, double g, double *slope) {
  double magnitude = fabs(g);
  double force = sonde_normal_pressure(shear_n_m, limit, 0.95, magnitude, slope);
  return g < 0 ? -force : force;
}
