// fold_of:       which part of the measurements a row belongs to.
// run_fold:      refit without that part, then its forces.
// sonde_fit_hold_out: all parts in turn.
#include "fit/refit.h"
#include "fit/refit_inside.h"

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

static void start(const sonde_refit *r, const sonde_fit_result *result, sonde_hold_out kind,
                  double *theta) {
  uint32_t count = r->sites->count;
  if (kind == SONDE_HOLD_OUT_PROBE) {
    sonde_refit_start(r, result->curves, theta);
    return;
  }
  SONDE_ASSERT(result->site_count == count);
  for (uint32_t s = 0; s < count; ++s) {
    theta[s] = log(result->sites[s].k0_n_m3);
    theta[count + s] = log(result->sites[s].xm_m);
  }
  theta[2 * count] = log(result->law.shear_stiffness_n_m);
  theta[2 * count + 1] = log(result->law.shear_limit);
}

typedef struct fold_scratch {
  bool *left_out;
  double *theta, *force_n;
} fold_scratch;

static sonde_status run_fold(sonde_refit *r, const sonde_fit_result *result, sonde_hold_out kind,
                             uint32_t fold, fold_scratch *s, const sonde_progress *progress,
                             double *predicted_n, sonde_error *error) {
  for (uint32_t k = 0; k < r->plan->row_count; ++k) s->left_out[k] = fold_of(r, kind, k) == fold;
  start(r, result, kind, s->theta);
  sonde_refit_result found;
  r->left_out = s->left_out;
  sonde_status status = sonde_refit_minimise(r, s->theta, s->force_n, progress, &found, error);
  r->left_out = NULL;
  r->stride = 1;
  if (!status) status = sonde_refit_forces(r, s->theta, s->force_n, NULL, progress, error);
  for (uint32_t k = 0; k < r->plan->row_count && !status; ++k)
    if (s->left_out[k]) predicted_n[r->plan->row[k]] = s->force_n[k];
  return status;
}

sonde_status sonde_fit_hold_out(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *m, const sonde_fit_def *def,
                                const sonde_fit_result *result, sonde_hold_out kind,
                                const sonde_progress *progress, double *predicted_n,
                                sonde_error *error) {
  for (uint32_t i = 0; i < m->count; ++i) predicted_n[i] = NAN;
  if (!(result->law.shear_stiffness_n_m > 0))
    return sonde_fail(error, SONDE_ARGUMENT, "hold-out needs the result of stage 3");
  sonde_fit_def fixed = *def;
  fixed.smoothness_sd = result->confidence.smoothness_sd;
  if (!(fixed.loss_scale > 0)) fixed.loss_scale = 0.05;
  sonde_fit_plan plan;
  sonde_status status = sonde_fit_plan_create(sites, m, &plan, error);
  if (status) return status;
  sonde_refit *refit = NULL;
  fold_scratch s = {SONDE_NEW(bool, plan.row_count),
                    SONDE_NEW(double, 2 * (size_t)sites->count + 2),
                    SONDE_NEW(double, plan.row_count)};
  if (!s.left_out || !s.theta || !s.force_n) status = sonde_fail_memory(error);
  if (!status && kind == SONDE_HOLD_OUT_PROBE && plan.probe_count < 2)
    status = sonde_fail(error, SONDE_ARGUMENT, "one probe only: none can be left out");
  if (!status)
    status = sonde_refit_create(model, sites, m, &plan, &fixed, REFIT_REACH_M, &refit, error);
  for (uint32_t fold = 0; !status && fold < fold_count(&plan, kind); ++fold)
    status = run_fold(refit, result, kind, fold, &s, progress, predicted_n, error);
  sonde_refit_destroy(refit);
  sonde_fit_plan_clear(&plan);
  sonde_free(s.left_out);
  sonde_free(s.theta);
  sonde_free(s.force_n);
  return status;
}
