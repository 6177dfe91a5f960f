// Profile of the cost over the stiffness of the shear layer.
#include "fit/nearby_refit.h"
#include "sonde/fit_confidence.h"

#include "base/maths.h"

#include <string.h>

enum { MIDDLE = SONDE_FIT_PROFILE / 2 };
static const double CHI2_95 = 3.841458820694124; // one degree of freedom
// Distances in standard deviations of ln G; the ends of the interval lie between the values.
static const double DISTANCE[MIDDLE] = {0.75, 1.5, 2.25, 3};
static const double ENOUGH = 2e-5; // rises of a few in a cost of many hundreds are asked for

typedef struct profiler {
  sonde_nearby_refit *again;
  const sonde_progress *progress;
  bool *fixed;
  double *optimum, *along; // [parameters] and their change per ln G with all else refitted
  double cost, sd;
} profiler;

static sonde_status walk(profiler *p, int side, sonde_fit_profile *profile, sonde_error *error) {
  uint32_t n = p->again->parameters;
  sonde_status status = SONDE_OK;
  memcpy(p->again->theta, p->optimum, n * sizeof *p->optimum);
  for (int k = 0; k < MIDDLE && !status; ++k) {
    double ln_shear = p->optimum[n - 2] + side * DISTANCE[k] * p->sd;
    double move = ln_shear - p->again->theta[n - 2];
    for (uint32_t i = 0; i < n; ++i) p->again->theta[i] += move * p->along[i];
    p->again->theta[n - 2] = ln_shear;
    sonde_refit_result found;
    status = sonde_nearby_refit_run(p->again, p->progress, &found, error);
    int at = MIDDLE + side * (k + 1);
    SONDE_ASSERT(at >= 0 && at < SONDE_FIT_PROFILE);
    profile->shear_n_m[at] = exp(ln_shear);
    profile->rise[at] = 2 * (found.cost - p->cost);
    profile->quadratic[at] = profile->variance * DISTANCE[k] * DISTANCE[k];
  }
  return status;
}

sonde_status sonde_fit_profile_shear(const sonde_model *model, const sonde_site_table *sites,
                                     const sonde_measurements *measurements,
                                     const sonde_fit_def *def, const sonde_fit_result *result,
                                     const sonde_progress *progress, sonde_fit_profile *profile,
                                     sonde_error *error) {
  sonde_nearby_refit again;
  *profile = (sonde_fit_profile){0};
  sonde_status status =
      sonde_nearby_refit_create(model, sites, measurements, def, result, &again, error);
  if (status) return status;
  profiler p = {.again = &again,
                .progress = progress,
                .fixed = SONDE_NEW(bool, again.parameters),
                .optimum = SONDE_NEW(double, again.parameters),
                .along = SONDE_NEW(double, again.parameters)};
  if (!p.fixed || !p.optimum || !p.along) status = sonde_fail_memory(error);

  // The optimum to the accuracy that differences of costs need, and the curvature there.
  uint32_t n = again.parameters, rows = again.plan.row_count;
  sonde_refit_result found;
  again.refit->near = true;
  again.refit->enough = ENOUGH;
  if (!status) status = sonde_nearby_refit_run(&again, progress, &found, error);
  if (!status && !sonde_nearby_refit_factor(&again))
    status = sonde_fail(error, SONDE_CONVERGENCE, "the parameters are not determined by the data");
  if (!status) {
    memcpy(p.optimum, again.theta, n * sizeof *p.optimum);
    p.along[n - 2] = 1;
    double variance = sonde_nearby_refit_spread(&again, p.along);
    for (uint32_t k = 0; k < n; ++k) p.along[k] = again.step[k] / variance;
    p.cost = found.cost;
    profile->count = SONDE_FIT_PROFILE;
    profile->variance = 2 * found.cost / (rows > n ? rows - n : 1);
    profile->threshold = CHI2_95 * profile->variance;
    p.sd = sqrt(variance * profile->variance);
    profile->estimate_n_m = profile->shear_n_m[MIDDLE] = exp(again.theta[n - 2]);
    p.fixed[n - 2] = true;
    again.refit->fixed = p.fixed;
    status = walk(&p, 1, profile, error);
  }
  if (!status) status = walk(&p, -1, profile, error);
  // The interval ends where the root of the rise, nearly straight in ln G, reaches the threshold.
  double goal = sqrt(profile->threshold);
  for (int side = -1; side < 2 && !status; side += 2) {
    double *end = &profile->interval_95[side > 0];
    *end = NAN;
    for (int k = 0; k < MIDDLE; ++k) {
      int in = MIDDLE + side * k, out = in + side;
      double inner = sqrt(fmax(profile->rise[in], 0)), outer = sqrt(fmax(profile->rise[out], 0));
      if (!(outer >= goal)) continue;
      double share = (goal - inner) / (outer - inner);
      *end = profile->shear_n_m[in] * pow(profile->shear_n_m[out] / profile->shear_n_m[in], share);
      break;
    }
  }
  sonde_free(p.fixed);
  sonde_free(p.optimum);
  sonde_free(p.along);
  sonde_nearby_refit_clear(&again);
  return status;
}
