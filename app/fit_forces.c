// Forces of models that an estimation is compared with: lines, and stage 2 at rest.
#include "fit_forces.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

void fit_linear_forces(const sonde_measurements *data, double *model_n) {
  assert(data && model_n);
  for (uint32_t i = 0; i < data->count; ++i) {
    double xf = 0, xx = 0;
    for (uint32_t k = 0; k < data->count; ++k) {
      if (data->data[k].site != data->data[i].site ||
          strcmp(data->data[k].probe, data->data[i].probe) != 0)
        continue;
      xf += data->data[k].penetration_m * data->data[k].force_n;
      xx += data->data[k].penetration_m * data->data[k].penetration_m;
    }
    model_n[i] = xx > 0 ? xf / xx * data->data[i].penetration_m : NAN;
  }
}

sonde_status fit_stage2_in_full(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *data, const sonde_fit_result *result,
                                const sonde_progress *progress, double *full_n,
                                sonde_error *error) {
  enum { EVERY = 8, FIRST = 3 };
  assert(result->site_count == sites->count);
  static const sonde_mesh NO_BONE = {0}; // equilibria of the skin need none
  sonde_model *settled = NULL;
  sonde_model_def md = sonde_model_def_default();
  md.skin = &model->surface;
  md.sites = sites->sites;
  md.site_count = sites->count;
  md.fine_edge_m = 1; // the skin is refined already
  md.femur = &NO_BONE;
  bool three = result->stage2_sites != NULL;
  sonde_status status = sonde_model_build(&md, &settled, error);
  if (!status)
    status = sonde_model_set_parameters(settled, three ? &result->stage2_law : &result->law,
                                        three ? result->stage2_sites : result->sites,
                                        result->site_count, error);

  // The rows of every eighth site, settled, and put back to their places.
  sonde_measurements some = *data;
  some.data = calloc(data->count, sizeof *some.data);
  uint32_t *row = calloc(data->count, sizeof *row);
  double *some_n = calloc(data->count, sizeof *some_n);
  if (!status && !(some.data && row && some_n)) status = error->status = SONDE_MEMORY;
  some.count = 0;
  for (uint32_t i = 0; i < data->count && !status; ++i) {
    uint32_t s = 0;
    while (s < sites->count && sites->sites[s].id != data->data[i].site) ++s;
    full_n[i] = NAN;
    if (s % EVERY != FIRST % sites->count) continue;
    row[some.count] = i;
    some.data[some.count++] = data->data[i];
  }
  sonde_predict_def def = sonde_predict_def_default();
  def.interaction = SONDE_INTERACTION_FULL;
  def.relative_residual = 1e-4;
  if (!status && some.count)
    status = sonde_predict(settled, sites, &some, &def, progress, some_n, error);
  for (uint32_t k = 0; k < some.count && !status; ++k) full_n[row[k]] = some_n[k];
  free(some.data);
  free(row);
  free(some_n);
  sonde_model_destroy(settled);
  return status;
}
