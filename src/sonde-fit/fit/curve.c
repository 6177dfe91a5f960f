// Stage 1: eq. (1) on one curve by bordered Levenberg-Marquardt from a closed-form start.
#include "fit/bordered.h"
#include "fit/law.h"

#include "base/maths.h"

double sonde_law_pressure(double k0, double xm_m, double s_m, double *by_xm) {
  double gap = xm_m - s_m;
  SONDE_ASSERT(gap > 0);
  *by_xm = -k0 * s_m * s_m / (gap * gap);
  return k0 * s_m * xm_m / gap;
}

sonde_law sonde_law_of(const double theta[2], double floor_m) {
  double above = exp(theta[1]);
  SONDE_ASSERT(above > 0 && floor_m > 0);
  return (sonde_law){exp(theta[0]), floor_m + above, above};
}

void sonde_law_log(double k0, double xm_m, double floor_m, double theta[2]) {
  SONDE_ASSERT(k0 > 0 && xm_m > 0);
  theta[0] = clamp(log(k0), LAW_LOW[0], LAW_HIGH[0]);
  theta[1] = clamp(log(fmax(xm_m - floor_m, 1e-12)), LAW_LOW[1], LAW_HIGH[1]);
}

typedef struct curve_data {
  const double *depth_m, *force_n;
  double area_m2, floor_m;
} curve_data;

static void curve_row(const void *user, uint32_t block, uint32_t row, const double theta[2],
                      const double *border, double *residual, double *jacobian) {
  (void)block;
  (void)border;
  const curve_data *c = user;
  sonde_law law = sonde_law_of(theta, c->floor_m);
  double by_xm, p = sonde_law_pressure(law.k0_n_m3, law.xm_m, c->depth_m[row], &by_xm);
  *residual = c->area_m2 * p - c->force_n[row];
  jacobian[0] = c->area_m2 * p;
  jacobian[1] = c->area_m2 * by_xm * law.above_m;
}

sonde_status sonde_fit_curve(const double *penetration_m, const double *force_n, uint32_t count,
                             double area_m2, double guard, const sonde_fit_def *def,
                             const double start[2], sonde_curve_fit *fit, sonde_error *error) {
  *fit = (sonde_curve_fit){0};
  double deepest_m = 0.0;
  for (uint32_t i = 0; i < count; ++i) {
    if (!(penetration_m[i] >= 0 && penetration_m[i] <= 1 && fabs(force_n[i]) <= 1e6))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "point %u: %g m and %g N, expected 0 to 1 m and at most 1e6 N", i,
                        penetration_m[i], force_n[i]);
    deepest_m = fmax(deepest_m, penetration_m[i]);
  }
  if (count < 3)
    return sonde_fail(error, SONDE_ARGUMENT, "a curve of %u points, expected at least 3", count);
  if (!(deepest_m > 0) || !(area_m2 > 0))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a curve without positive penetration or area, expected both > 0");
  SONDE_ASSERT(guard > 0 && guard <= 1);
  curve_data data = {penetration_m, force_n, area_m2, deepest_m / guard};
  double k0, xm_m, theta[1][2];
  // Least squares of x = b f + a (x f), which eq. (1) satisfies exactly; b = 1/k, a = -1/(k xm).
  double ff = 0, fq = 0, qq = 0, xf = 0, xq = 0, xx = 0;
  for (uint32_t i = 0; i < count; ++i) {
    double x = data.depth_m[i], f = data.force_n[i], q = x * f;
    ff += f * f, fq += f * q, qq += q * q;
    xf += x * f, xq += x * q, xx += x * x;
  }
  double determinant = ff * qq - fq * fq;
  double b = (xf * qq - xq * fq) / determinant, a = (xq * ff - xf * fq) / determinant;
  SONDE_ASSERT(xx > 0);
  bool usable = determinant > 1e-12 * ff * qq && b > 0 && a < 0 && -b / a > 1.0005 * data.floor_m;
  k0 = usable ? 1.0 / (b * data.area_m2) : fmax(0.5 * xf / xx, 1e-3) / data.area_m2;
  xm_m = usable ? -b / a : 2.0 * deepest_m;
  sonde_law_log(start ? start[0] : k0, start ? start[1] : xm_m, data.floor_m, theta[0]);
  const uint32_t rows[2] = {0, count};
  sonde_bordered_problem problem = {.block_count = 1,
                                    .row_start = rows,
                                    .row = curve_row,
                                    .user = &data,
                                    .low = {LAW_LOW[0], LAW_LOW[1]},
                                    .high = {LAW_HIGH[0], LAW_HIGH[1]},
                                    .loss = def->loss,
                                    .loss_scale = def->loss_scale > 0 ? def->loss_scale : 0.5,
                                    .max_iterations = def->max_iterations};
  sonde_bordered_result result;
  sonde_status status = sonde_bordered_minimise(&problem, theta, NULL, &result, error);
  if (status) return status;
  sonde_law law = sonde_law_of(theta[0], data.floor_m);
  fit->count = count;
  fit->k0_n_m3 = law.k0_n_m3;
  fit->xm_m = law.xm_m;
  fit->iterations = result.iterations;
  fit->converged = result.converged;
  for (uint32_t i = 0; i < count; ++i) {
    double residual, jacobian[4];
    curve_row(&data, 0, i, theta[0], NULL, &residual, jacobian);
    fit->mae_n += fabs(residual) / count;
  }
  return SONDE_OK;
}
