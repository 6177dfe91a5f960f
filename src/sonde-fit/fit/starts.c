// Refits from random starts: how far their ends lie apart.
#include "fit/nearby_refit.h"
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

sonde_status sonde_fit_random_starts(const sonde_model *model, const sonde_site_table *sites,
                                     const sonde_measurements *measurements,
                                     const sonde_fit_def *def, const sonde_fit_result *result,
                                     uint32_t count, uint64_t seed, const sonde_progress *progress,
                                     sonde_fit_starts *starts, sonde_error *error) {
  sonde_nearby_refit again;
  *starts = (sonde_fit_starts){.least_cost = INFINITY, .most_cost = -INFINITY};
  sonde_status status =
      sonde_nearby_refit_create(model, sites, measurements, def, result, &again, error);
  if (status) return status;
  double *sd = SONDE_NEW(double, again.parameters), *row = SONDE_NEW(double, again.parameters);
  if (!sd || !row) status = sonde_fail_memory(error);

  // Standard deviations of the parameters by themselves, from the curvature at the optimum.
  sonde_refit_result found;
  again.refit->near = true;
  if (!status) status = sonde_nearby_refit_run(&again, progress, &found, error);
  if (!status && !sonde_nearby_refit_factor(&again))
    status = sonde_fail(error, SONDE_CONVERGENCE, "the parameters are not determined by the data");
  for (uint32_t k = 0; k < again.parameters && !status; ++k) {
    memset(row, 0, again.parameters * sizeof *row);
    row[k] = 1;
    sd[k] = sqrt(sonde_nearby_refit_spread(&again, row));
  }
  memcpy(again.optimum, again.theta, again.parameters * sizeof *again.theta);
  again.refit->near = false;
  for (uint32_t k = 0; k < count && !status; ++k) {
    sonde_refit_start(again.refit, result->curves, again.theta);
    // theta holds the generic start.
    uint32_t n = again.parameters, site_count = again.refit->sites->count;
    uint64_t counter = (uint64_t)k * (n + 2);
    double deepest = 0;
    for (uint32_t s = 0; s < again.plan.site_count; ++s)
      deepest = fmax(deepest, again.plan.site_deepest_m[s]);
    SONDE_ASSERT(deepest > 0);
    double least = log(1.1 * deepest);
    const range xm = {least, log(4 / 1.1) + least}, limit = {log(0.4), log(4.0)};
    const range k0 = {-log(3.0), log(3.0)}, shear = {-log(5.0), log(5.0)};
    const range by_site[2] = {{-0.25, 0.25}, {-0.1, 0.1}};
    double stiffer = draw(k0, seed, counter++), deeper = draw(xm, seed, counter++);
    for (uint32_t s = 0; s < site_count; ++s) {
      again.theta[s] += stiffer + 2 * draw(by_site[0], seed, counter++);
      again.theta[site_count + s] = fmax(least, deeper + 2 * draw(by_site[1], seed, counter++));
    }
    again.theta[n - 2] += draw(shear, seed, counter++);
    again.theta[n - 1] = draw(limit, seed, counter);
    sonde_refit_forget(again.refit);
    status = sonde_nearby_refit_run(&again, progress, &found, error);
    if (status && status != SONDE_CONVERGENCE) break;
    starts->count++;
    bool failed = status || !found.converged;
    status = SONDE_OK;
    starts->failed += failed;
    if (failed) continue;
    starts->least_cost = fmin(starts->least_cost, found.cost);
    starts->most_cost = fmax(starts->most_cost, found.cost);
    // The distance of the end from the optimum, in standard deviations of the parameters.
    double far = 0;
    for (uint32_t p = 0; p < again.parameters; ++p)
      far = fmax(far, fabs(again.theta[p] - again.optimum[p]) / sd[p]);
    if (far > SAME_SD) continue;
    starts->same++;
    starts->farthest_sd = fmax(starts->farthest_sd, far);
  }
  sonde_free(sd);
  sonde_free(row);
  sonde_nearby_refit_clear(&again);
  return status;
}
