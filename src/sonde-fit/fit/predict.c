// Forces of a fitted model on the rows of a table.
#include "base/maths.h"
#include "fit/fit_inside.h"
#include "base/parallel.h"
#include "fit/press.h"

sonde_predict_def sonde_predict_def_default(void) {
  return (sonde_predict_def){.relative_residual = 1e-6, .max_iterations = 200};
}

typedef struct prediction {
  const sonde_model *model;
  const sonde_site_table *sites;
  const sonde_measurements *m;
  const sonde_fit_plan *plan;
  const sonde_predict_def *def;
  double *predicted_n;
} prediction;

static sonde_status predict_curve(void *user, uint32_t worker, uint32_t curve,
                                  const atomic_bool *stop, sonde_error *error) {
  (void)worker;
  const prediction *p = user;
  const sonde_fit_plan *plan = p->plan;
  SONDE_ASSERT(curve < plan->curve_count);
  uint32_t probe = plan->curve_probe[curve], first = plan->curve_start[curve];
  const sonde_site *site = &p->sites->sites[plan->curve_site[curve]];
  uint32_t end = plan->curve_start[curve + 1];

  // A depth without equilibrium leaves the rest of the curve NaN.
  if (p->def->interaction == SONDE_INTERACTION_FULL) {
    sonde_bonded bonded;
    sonde_status status =
        sonde_bonded_create(p->model, site, plan->half_u_m[probe], plan->half_v_m[probe],
                            p->def->relative_residual, p->def->max_iterations, &bonded, error);
    if (status) return status;
    status = sonde_bonded_curve(&bonded, plan, curve, p->m->data, stop, p->predicted_n, error);
    sonde_bonded_clear(&bonded);
    return status;
  }

  sonde_footprint footprint;
  sonde_status status =
      sonde_footprint_create(p->model, site, plan->half_u_m[probe], plan->half_v_m[probe],
                             SONDE_COVERAGE_CLIPPED, &footprint, error);
  if (status) return status;
  for (uint32_t r = first; r < end; ++r) {
    uint32_t row = plan->row[r];
    p->predicted_n[row] =
        sonde_footprint_force(&footprint, p->model, p->m->data[row].penetration_m);
  }
  sonde_footprint_clear(&footprint);
  return SONDE_OK;
}

sonde_status sonde_predict(const sonde_model *model, const sonde_site_table *sites,
                           const sonde_measurements *measurements, const sonde_predict_def *def,
                           const sonde_progress *progress, double *predicted_n,
                           sonde_error *error) {
  if (!(def->relative_residual > 0) || def->max_iterations < 1)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "relative_residual is %g and max_iterations %u, expected > 0 and >= 1",
                      def->relative_residual, def->max_iterations);
  if (model->bulk && def->interaction != SONDE_INTERACTION_FULL)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a volumetric model has no simplified interaction, expected the full one");
  sonde_fit_plan plan;
  sonde_status status = sonde_sites_check_on_surface(model, sites, SONDE_SITE_TOLERANCE_M, error);
  if (!status) status = sonde_fit_plan_create_all(sites, measurements, &plan, error);
  if (status) return status;
  prediction p = {model, sites, measurements, &plan, def, predicted_n};
  uint32_t workers = sonde_parallel_workers(def->threads, plan.curve_count);
  for (uint32_t i = 0; i < measurements->count; ++i) predicted_n[i] = NAN;
  status = sonde_parallel_run(plan.curve_count, workers, predict_curve, &p, progress, "predicting",
                              error);
  sonde_fit_plan_clear(&plan);
  return status;
}
