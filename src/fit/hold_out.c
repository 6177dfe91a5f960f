// fold_of:       which part of the measurements a row belongs to.
// start:         parameters at which a refit begins.
// run_fold:      refit without that part, then its forces.
// sonde_fit_hold_out: all parts in turn.
#include "fit/again.h"
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

// A refit without a probe starts far from the result, and so needs the way on few depths.
static void start(sonde_again *a, const sonde_fit_result *result, sonde_hold_out kind) {
  a->refit->near = kind != SONDE_HOLD_OUT_PROBE;
  if (a->refit->near)
    memcpy(a->theta, a->optimum, a->parameters * sizeof *a->theta);
  else
    sonde_refit_start(a->refit, result->curves, a->theta);
}

static sonde_status run_fold(sonde_again *a, const sonde_fit_result *result, sonde_hold_out kind,
                             uint32_t fold, const sonde_progress *progress, double *predicted_n,
                             sonde_error *error) {
  sonde_refit *r = a->refit;
  uint32_t rows = a->plan.row_count;
  SONDE_ASSERT(fold < fold_count(&a->plan, kind));
  for (uint32_t k = 0; k < rows; ++k) a->left_out[k] = fold_of(r, kind, k) == fold;
  start(a, result, kind);
  sonde_refit_result found;
  r->left_out = a->left_out;
  sonde_status status = sonde_again_run(a, progress, &found, error);
  for (uint32_t k = 0; k < rows; ++k) a->left_out[k] = !a->left_out[k]; // now only that part
  r->stride = 1;
  if (!status) status = sonde_refit_forces(r, a->theta, a->force_n, NULL, progress, error);
  for (uint32_t k = 0; k < rows && !status; ++k)
    if (!a->left_out[k]) predicted_n[a->plan.row[k]] = a->force_n[k];
  return status;
}

sonde_status sonde_fit_hold_out(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *m, const sonde_fit_def *def,
                                const sonde_fit_result *result, sonde_hold_out kind,
                                const sonde_progress *progress, double *predicted_n,
                                sonde_error *error) {
  for (uint32_t i = 0; i < m->count; ++i) predicted_n[i] = NAN;
  sonde_again again;
  sonde_status status = sonde_again_create(model, sites, m, def, result, &again, error);
  if (status) return status;
  if (kind == SONDE_HOLD_OUT_PROBE && again.plan.probe_count < 2)
    status = sonde_fail(error, SONDE_ARGUMENT, "one probe only: none can be left out");
  uint32_t folds = fold_count(&again.plan, kind);
  for (uint32_t fold = 0; !status && fold < folds; ++fold)
    status = run_fold(&again, result, kind, fold, progress, predicted_n, error);
  sonde_again_clear(&again);
  return status;
}
