// Left-out parts of the measurements, predicted by a refit of the rest.
#include "fit/nearby_refit.h"
#include "sonde/fit_confidence.h"

#include "base/maths.h"

#include <string.h>

enum { SITE_FOLDS = 8 };
static const double DEEP = 0.75; // of a curve's deepest row: what is left out by depth

static uint32_t fold_count(const sonde_fit_plan *plan, sonde_hold_out kind) {
  if (kind == SONDE_HOLD_OUT_PROBE) return plan->probe_count;
  if (kind == SONDE_HOLD_OUT_DEPTH) return 1;
  return plan->site_count < SITE_FOLDS ? plan->site_count : SITE_FOLDS;
}

// Scattered over an 8 x 8 grid; UINT32_MAX for rows that stay in every fold.
static uint32_t fold_of(const sonde_refit *r, sonde_hold_out kind, uint32_t row) {
  const sonde_fit_plan *plan = r->plan;
  uint32_t curve = plan->row_curve[row], site = plan->curve_site[curve];
  if (kind == SONDE_HOLD_OUT_PROBE) return plan->row_probe[row];
  if (kind == SONDE_HOLD_OUT_SITES) {
    uint32_t folds = fold_count(plan, kind);
    return (site + 3 * (site / SITE_FOLDS)) % folds;
  }
  uint32_t last = plan->row[plan->curve_start[curve + 1] - 1];
  bool deep = r->m->data[plan->row[row]].penetration_m > DEEP * r->m->data[last].penetration_m;
  return deep ? 0 : UINT32_MAX;
}

// fitted: measurements from this one on are predicted with their part, but never fitted.
static sonde_status run_folds(const sonde_model *model, const sonde_site_table *sites,
                              const sonde_measurements *m, uint32_t fitted,
                              const sonde_fit_def *def, const sonde_fit_result *result,
                              sonde_hold_out kind, const sonde_progress *progress,
                              double *predicted_n, sonde_error *error) {
  for (uint32_t i = 0; i < m->count; ++i) predicted_n[i] = NAN;
  sonde_nearby_refit again;
  sonde_status status = sonde_nearby_refit_create(model, sites, m, def, result, &again, error);
  if (status) return status;
  if (kind == SONDE_HOLD_OUT_PROBE && again.plan.probe_count < 2)
    status = sonde_fail(error, SONDE_ARGUMENT, "one probe only: none can be left out");
  sonde_refit *r = again.refit;
  uint32_t folds = fold_count(&again.plan, kind), rows = again.plan.row_count;
  for (uint32_t fold = 0; !status && fold < folds; ++fold) {
    for (uint32_t k = 0; k < rows; ++k)
      again.left_out[k] = fold_of(r, kind, k) == fold || again.plan.row[k] >= fitted;
    // A refit without a probe starts far from the result, and so needs the path on few depths.
    r->near = kind != SONDE_HOLD_OUT_PROBE;
    if (r->near)
      memcpy(again.theta, again.optimum, again.parameters * sizeof *again.theta);
    else
      sonde_refit_start(r, result->curves, again.theta);
    sonde_refit_result found;
    r->left_out = again.left_out;
    status = sonde_nearby_refit_run(&again, progress, &found, error);
    // The refitted parameters predict the rows of the fold.
    for (uint32_t k = 0; k < rows; ++k) again.left_out[k] = fold_of(r, kind, k) != fold;
    r->stride = 1;
    if (!status) status = sonde_refit_forces(r, again.theta, again.force_n, NULL, progress, error);
    for (uint32_t k = 0; k < rows && !status; ++k)
      if (!again.left_out[k]) predicted_n[again.plan.row[k]] = again.force_n[k];
  }
  sonde_nearby_refit_clear(&again);
  return status;
}

sonde_status sonde_fit_hold_out(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *m, const sonde_fit_def *def,
                                const sonde_fit_result *result, sonde_hold_out kind,
                                const sonde_progress *progress, double *predicted_n,
                                sonde_error *error) {
  return run_folds(model, sites, m, m->count, def, result, kind, progress, predicted_n, error);
}

sonde_status sonde_measurements_join(const sonde_measurements *m, const sonde_measurements *also,
                                     sonde_measurements *both, sonde_error *error) {
  for (uint32_t k = 0; k < also->count; ++k)
    for (uint32_t i = 0; i < m->count; ++i)
      if (strcmp(also->data[k].probe, m->data[i].probe) == 0)
        return sonde_fail(error, SONDE_ARGUMENT,
                          "probe %s was fitted, expected one that was not, to be predicted only",
                          also->data[k].probe);
  *both = (sonde_measurements){.count = m->count + also->count};
  both->data = SONDE_NEW(sonde_datum, both->count);
  if (!both->data) return sonde_fail_memory(error);
  memcpy(both->data, m->data, m->count * sizeof *m->data);
  memcpy(both->data + m->count, also->data, also->count * sizeof *also->data);
  return SONDE_OK;
}

sonde_status sonde_fit_hold_out_also(const sonde_model *model, const sonde_site_table *sites,
                                     const sonde_measurements *m, const sonde_measurements *also,
                                     const sonde_fit_def *def, const sonde_fit_result *result,
                                     const sonde_progress *progress, double *predicted_n,
                                     sonde_error *error) {
  sonde_measurements both;
  sonde_status status = sonde_measurements_join(m, also, &both, error);
  if (status) return status;
  status = run_folds(model, sites, &both, m->count, def, result, SONDE_HOLD_OUT_SITES, progress,
                     predicted_n, error);
  sonde_free(both.data);
  return status;
}
