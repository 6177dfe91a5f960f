// Fits eq. (1), F = A k0 s/(1 - s/xm), to one measured force curve.  usage: sample_fit_curve
#include "sonde/sonde.h"

#include <stdio.h>

int main(void) {
  // Site 0 of data/thigh/indentation.csv under the linear probe: 60 x 12 mm.
  static const double depth_m[] = {0.002, 0.004, 0.006, 0.008};
  static const double force_n[] = {0.8568, 1.7390, 2.7156, 3.8232};
  enum { COUNT = sizeof depth_m / sizeof depth_m[0] };
  const double area_m2 = 0.060 * 0.012, guard = 0.95;

  sonde_fit_def def = sonde_fit_def_default();
  sonde_curve_fit fit;
  sonde_error error;
  if (sonde_fit_curve(depth_m, force_n, COUNT, area_m2, guard, &def, NULL, &fit, &error) !=
      SONDE_OK) {
    fprintf(stderr, "%s\n", error.message);
    return 1;
  }
  printf("k0 = %.0f N/m^3, asymptote %.1f mm, mean absolute error %.4f N\n", fit.k0_n_m3,
         fit.xm_m * 1e3, fit.mae_n);
  for (int i = 0; i < COUNT; ++i) {
    double slope;
    double pressure = sonde_normal_pressure(1, fit.k0_n_m3, fit.xm_m, guard, depth_m[i], &slope);
    printf("%4.1f mm: measured %.4f N, fitted %.4f N\n", depth_m[i] * 1e3, force_n[i],
           pressure * area_m2);
  }
  return fit.converged ? 0 : 1;
}
