// A refit that runs again from another point, and the variances at its end.
#include "fit/nearby_refit.h"
#include "fit/refit_offset.h"
#include "sparse/dense.h"

#include "base/maths.h"

#include <string.h>

sonde_status sonde_nearby_refit_create(const sonde_model *model, const sonde_site_table *sites,
                                       const sonde_measurements *m, const sonde_fit_def *def,
                                       const sonde_fit_result *result, sonde_nearby_refit *a,
                                       sonde_error *error) {
  *a = (sonde_nearby_refit){.def = sonde_fit_def_complete(def)};
  if (!(result->law.shear_stiffness_n_m > 0) || !(result->confidence.smoothness_sd > 0))
    return sonde_fail(error, SONDE_ARGUMENT, "expected the result of stage 3");
  SONDE_ASSERT(result->site_count == sites->count);
  a->def.smoothness_sd = result->confidence.smoothness_sd;
  a->def.shear_smoothness_sd = result->confidence.shear_smoothness_sd;
  sonde_status status = sonde_fit_plan_create(sites, m, &a->plan, error);
  if (status) return status;
  status = sonde_refit_create(model, sites, m, &a->plan, &a->def, REFIT_REACH_M, &a->refit, error);
  if (!status) {
    a->parameters = sonde_refit_parameters(a->refit);
    a->optimum = SONDE_NEW(double, a->parameters);
    a->theta = SONDE_NEW(double, a->parameters);
    a->step = SONDE_NEW(double, a->parameters);
    a->force_n = SONDE_NEW(double, a->plan.row_count);
    a->left_out = SONDE_NEW(bool, a->plan.row_count);
    a->factor = SONDE_NEW(double, (size_t)a->parameters * a->parameters);
    if (!sonde_normal_create(&a->curvature, a->parameters) || !a->optimum || !a->theta ||
        !a->step || !a->force_n || !a->left_out || !a->factor)
      status = sonde_fail_memory(error);
  }
  if (status) {
    sonde_nearby_refit_clear(a);
    return status;
  }
  // The result is the optimum, in logarithms, and the start.
  sonde_offsets_set(a->refit, result->curves);
  uint32_t count = result->site_count, n = a->parameters;
  for (uint32_t s = 0; s < count; ++s) {
    a->optimum[s] = log(result->sites[s].k0_n_m3);
    a->optimum[count + s] = log(result->sites[s].xm_m);
    if (a->refit->fields == 2) continue;
    a->optimum[2 * count + s] = log(result->sites[s].shear_share);
    a->optimum[3 * count + s] = log(result->sites[s].limit_share);
  }
  a->optimum[n - 2] = log(result->law.shear_stiffness_n_m);
  a->optimum[n - 1] = log(result->law.shear_limit);
  memcpy(a->theta, a->optimum, n * sizeof *a->theta);
  return SONDE_OK;
}

void sonde_nearby_refit_clear(sonde_nearby_refit *a) {
  sonde_refit_destroy(a->refit);
  sonde_fit_plan_clear(&a->plan);
  sonde_normal_free(&a->curvature);
  sonde_free(a->optimum);
  sonde_free(a->theta);
  sonde_free(a->step);
  sonde_free(a->force_n);
  sonde_free(a->left_out);
  sonde_free(a->factor);
  *a = (sonde_nearby_refit){0};
}

sonde_status sonde_nearby_refit_run(sonde_nearby_refit *a, const sonde_progress *progress,
                                    sonde_refit_result *found, sonde_error *error) {
  a->refit->curvature = &a->curvature;
  return sonde_refit_minimise(a->refit, a->theta, a->force_n, progress, found, error);
}

bool sonde_nearby_refit_factor(sonde_nearby_refit *a) {
  memcpy(a->factor, a->curvature.matrix, (size_t)a->parameters * a->parameters * sizeof *a->factor);
  return sonde_cholesky(a->factor, a->parameters);
}

double sonde_nearby_refit_spread(sonde_nearby_refit *a, const double *row) {
  double variance = 0;
  memcpy(a->step, row, a->parameters * sizeof *row);
  sonde_cholesky_solve(a->factor, a->parameters, a->step);
  for (uint32_t k = 0; k < a->parameters; ++k) variance += row[k] * a->step[k];
  SONDE_ASSERT(variance >= 0);
  return variance;
}
