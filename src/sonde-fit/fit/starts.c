// Refits from random starts: how far their ends lie apart.
#include "fit/again.h"
#include "sonde/fit_confidence.h"

#include "base/maths.h"
#include "base/random.h"

#include <string.h>

static const double SAME_SD = 0.5;

typedef struct range {
  double low, high;
} range;

static double draw(range r, uint64_t seed, uint64_t counter) {
  return r.low + (r.high - r.low) * sonde_random_uniform(seed, counter);
}

static double deepest_of(const sonde_fit_plan *plan) {
  double deepest = 0;
  for (uint32_t s = 0; s < plan->site_count; ++s) deepest = fmax(deepest, plan->site_deepest_m[s]);
  SONDE_ASSERT(deepest > 0);
  return deepest;
}

// theta holds the generic start.
static void draw_start(const sonde_again *a, uint64_t seed, uint32_t number, double *theta) {
  uint32_t n = a->parameters, sites = a->refit->sites->count;
  uint64_t counter = (uint64_t)number * (n + 2);
  double least = log(1.1 * deepest_of(&a->plan));
  const range xm = {least, log(4 / 1.1) + least}, limit = {log(0.4), log(4.0)};
  const range k0 = {-log(3.0), log(3.0)}, shear = {-log(5.0), log(5.0)};
  const range by_site[2] = {{-0.25, 0.25}, {-0.1, 0.1}};
  double stiffer = draw(k0, seed, counter++), deeper = draw(xm, seed, counter++);
  for (uint32_t s = 0; s < sites; ++s) {
    theta[s] += stiffer + 2 * draw(by_site[0], seed, counter++);
    theta[sites + s] = fmax(least, deeper + 2 * draw(by_site[1], seed, counter++));
  }
  theta[n - 2] += draw(shear, seed, counter++);
  theta[n - 1] = draw(limit, seed, counter);
}

static double distance_sd(const sonde_again *a, const double *sd) {
  double most = 0;
  for (uint32_t k = 0; k < a->parameters; ++k)
    most = fmax(most, fabs(a->theta[k] - a->optimum[k]) / sd[k]);
  return most;
}

// Standard deviations of the parameters by themselves, from the curvature at the optimum.
static sonde_status find_sd(sonde_again *a, const sonde_progress *progress, double *row, double *sd,
                            sonde_error *error) {
  sonde_refit_result found;
  a->refit->near = true;
  sonde_status status = sonde_again_run(a, progress, &found, error);
  if (status) return status;
  if (!sonde_again_factor(a))
    return sonde_fail(error, SONDE_CONVERGENCE, "the parameters are not determined by the data");
  for (uint32_t k = 0; k < a->parameters; ++k) {
    memset(row, 0, a->parameters * sizeof *row);
    row[k] = 1;
    sd[k] = sqrt(sonde_again_spread(a, row));
  }
  memcpy(a->optimum, a->theta, a->parameters * sizeof *a->theta);
  a->refit->near = false;
  return SONDE_OK;
}

static sonde_status run_start(sonde_again *a, const sonde_fit_result *result, uint64_t seed,
                              uint32_t number, const double *sd, const sonde_progress *progress,
                              sonde_fit_starts *starts, sonde_error *error) {
  sonde_refit_start(a->refit, result->curves, a->theta);
  draw_start(a, seed, number, a->theta);
  sonde_refit_forget(a->refit);
  sonde_refit_result found;
  sonde_status status = sonde_again_run(a, progress, &found, error);
  if (status && status != SONDE_CONVERGENCE) return status;
  starts->count++;
  if (status || !found.converged) {
    starts->failed++;
    return SONDE_OK;
  }
  starts->least_cost = fmin(starts->least_cost, found.cost);
  starts->most_cost = fmax(starts->most_cost, found.cost);
  double far = distance_sd(a, sd);
  if (far > SAME_SD) return SONDE_OK;
  starts->same++;
  starts->farthest_sd = fmax(starts->farthest_sd, far);
  return SONDE_OK;
}

sonde_status sonde_fit_random_starts(const sonde_model *model, const sonde_site_table *sites,
                                     const sonde_measurements *measurements,
                                     const sonde_fit_def *def, const sonde_fit_result *result,
                                     uint32_t count, uint64_t seed, const sonde_progress *progress,
                                     sonde_fit_starts *starts, sonde_error *error) {
  sonde_again again;
  *starts = (sonde_fit_starts){.least_cost = INFINITY, .most_cost = -INFINITY};
  sonde_status status = sonde_again_create(model, sites, measurements, def, result, &again, error);
  if (status) return status;
  double *sd = SONDE_NEW(double, again.parameters), *row = SONDE_NEW(double, again.parameters);
  if (!sd || !row) status = sonde_fail_memory(error);
  if (!status) status = find_sd(&again, progress, row, sd, error);
  for (uint32_t k = 0; k < count && !status; ++k)
    status = run_start(&again, result, seed, k, sd, progress, starts, error);
  sonde_free(sd);
  sonde_free(row);
  sonde_again_clear(&again);
  return status;
}
