// The three stages of an estimation and their errors.
#include "base/clock.h"
#include "base/random.h"
#include "fit/bordered.h"
#include "fit/fit_inside.h"
#include "fit/law.h"
#include "fit/refit.h"
#include "fit/simplified.h"

#include "base/maths.h"

#include <string.h>

static const double COLD_K0 = 1.8e5, COLD_ABOVE_M = 0.02;
static const double EDGE_START_N_M = 50.0, TENSION_START_N = 1e-3;
static const double LN_EDGE_LOW = -11.5, LN_EDGE_HIGH = 18.4; // 1e-5 .. 1e8 N/m
static const double LN_TENSION_LOW = -13.8, LN_TENSION_HIGH = 6.9;

sonde_fit_def sonde_fit_def_default(void) {
  return (sonde_fit_def){.stages = 2, .max_iterations = 400, .normal_exponent = 2};
}

sonde_fit_def sonde_fit_def_complete(const sonde_fit_def *def) {
  sonde_fit_def full = *def;
  if (!(full.loss_scale > 0)) full.loss_scale = full.weights == SONDE_WEIGHTS_RELATIVE ? 0.05 : 0.5;
  return full;
}

// ---- stage 1 ------------------------------------------------------------------------------

typedef struct curve_buffer {
  double *depth_m, *force_n;
} curve_buffer;

static sonde_status fit_one_curve(const sonde_model *model, const sonde_site_table *sites,
                                  const sonde_measurements *m, const sonde_fit_plan *plan,
                                  const sonde_fit_def *def, uint32_t c, curve_buffer buffer,
                                  sonde_fit_result *result, sonde_error *error) {
  uint32_t first = plan->curve_start[c], count = plan->curve_start[c + 1] - first;
  uint32_t probe = plan->curve_probe[c];
  SONDE_ASSERT(c < plan->curve_count && count > 0);
  for (uint32_t k = 0; k < count; ++k) {
    const sonde_datum *d = &m->data[plan->row[first + k]];
    buffer.depth_m[k] = d->penetration_m;
    buffer.force_n[k] = d->force_n;
  }
  double area_m2 = 4.0 * plan->half_u_m[probe] * plan->half_v_m[probe];
  sonde_curve_fit *fit = &result->curves[c];
  sonde_fit_def scaled = *def;
  if (def->weights == SONDE_WEIGHTS_RELATIVE) scaled.loss_scale *= plan->mean_force_n[probe];
  sonde_error inner;
  sonde_status status = sonde_fit_curve(buffer.depth_m, buffer.force_n, count, area_m2,
                                        model->law.guard, &scaled, NULL, fit, &inner);
  fit->site = sites->sites[plan->curve_site[c]].id;
  snprintf(fit->probe, sizeof fit->probe, "%s", plan->probe[probe]);
  if (status)
    return sonde_fail(error, status, "site %u, probe %s: %s", fit->site, fit->probe, inner.message);
  for (uint32_t k = 0; k < count; ++k) {
    double by_xm;
    double p = sonde_law_pressure(fit->k0_n_m3, fit->xm_m, buffer.depth_m[k], &by_xm);
    result->model_n[plan->row[first + k]] = area_m2 * p;
  }
  return SONDE_OK;
}

// ---- stage 2 ------------------------------------------------------------------------------

static sonde_bordered_problem bordered_problem(const sonde_site_problem *p,
                                               const sonde_fit_def *def,
                                               const sonde_progress *progress) {
  return (sonde_bordered_problem){.block_count = p->plan->site_count,
                                  .border_count = p->edges ? (p->tension ? 2u : 1u) : 0u,
                                  .row_start = p->plan->site_start,
                                  .row = sonde_site_row,
                                  .user = p,
                                  .low = {LAW_LOW[0], LAW_LOW[1]},
                                  .high = {LAW_HIGH[0], LAW_HIGH[1]},
                                  .border_low = {LN_EDGE_LOW, LN_TENSION_LOW},
                                  .border_high = {LN_EDGE_HIGH, LN_TENSION_HIGH},
                                  .loss = def->loss,
                                  .loss_scale = def->loss_scale,
                                  .max_iterations = def->max_iterations,
                                  .progress = progress};
}

// ---- results ------------------------------------------------------------------------------

static sonde_status finish(const sonde_site_problem *p, const double (*theta)[2],
                           const double *border, const sonde_bordered_result *found,
                           sonde_fit_result *result, sonde_error *error) {
  const sonde_fit_plan *plan = p->plan;
  sonde_site *sites = result->sites;
  double ln_k0 = 0.0, ln_xm = 0.0;
  SONDE_ASSERT(result->site_count >= plan->site_count);
  for (uint32_t i = 0; i < result->site_count; ++i) sites[i].k0_n_m3 = sites[i].xm_m = 0.0;
  for (uint32_t s = 0; s < plan->site_count; ++s) {
    sonde_law law = sonde_law_of(theta[s], p->floor_m[s]);
    sites[plan->site_index[s]].k0_n_m3 = law.k0_n_m3;
    sites[plan->site_index[s]].xm_m = law.xm_m;
    ln_k0 += theta[s][0] / plan->site_count;
    ln_xm += log(law.xm_m) / plan->site_count;
  }
  // Sites without measurements get the geometric mean of the others.
  uint32_t filled = 0;
  for (uint32_t i = 0; i < result->site_count; ++i) {
    if (sites[i].k0_n_m3 > 0) continue;
    sites[i].k0_n_m3 = exp(ln_k0);
    sites[i].xm_m = exp(ln_xm);
    ++filled;
  }
  if (filled)
    sonde_log(SONDE_LOG_WARNING, "%u sites have no measurement and get the mean parameters",
              filled);
  result->parameters = result->stage1_parameters;
  if (!p->edges) return SONDE_OK;
  result->parameters = result->stage2_parameters = 2 * plan->site_count + (p->tension ? 2 : 1);
  result->law.edge_stiffness_n_m = result->stage2_edge_n_m = exp(border[0]);
  if (p->tension) result->law.edge_pretension_n = exp(border[1]);
  result->iterations = result->stage2_iterations = found->iterations;
  result->converged = result->stage2_converged = found->converged;
  result->cost = found->cost;
  result->start_cost = found->start_cost;
  if (plan->row_count > result->parameters) {
    double variance = 2.0 * found->cost / (plan->row_count - result->parameters);
    result->edge_sd_log = sqrt(variance * found->border_variance[0]);
  }
  for (uint32_t s = 0; s < plan->site_count; ++s)
    for (uint32_t r = plan->site_start[s]; r < plan->site_start[s + 1]; ++r) {
      double jacobian[4];
      result->model_n[plan->row[r]] = sonde_site_force(p, s, r, theta[s], border, jacobian);
    }
  return sonde_error_report_of(p->m->data, result->model_n, p->m->count, &result->stage2, error);
}

// Of number k of a cold start: 1, or random with the logarithm's standard deviation.
static double cold_factor(const sonde_fit_def *def, uint32_t k) {
  const double LN_SD = 1.5;
  return def->cold_start && def->cold_seed ? exp(LN_SD * sonde_random_normal(def->cold_seed, k))
                                           : 1;
}

static sonde_status fit_model(const sonde_model *model, const sonde_site_table *sites,
                              sonde_site_problem *p, const sonde_fit_def *def,
                              const sonde_progress *progress, sonde_fit_result *result,
                              sonde_error *error) {
  double border[BORDER_MOST] = {log(EDGE_START_N_M), log(TENSION_START_N)};
  sonde_bordered_result found = {0};
  double(*theta)[2] = sonde_calloc(p->plan->site_count, sizeof *theta);
  sonde_status status = theta ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_site_problem_create(model, sites, def, p, error);
  // Every site starts at the geometric mean of its curves, or cold.
  const sonde_fit_plan *plan = p->plan;
  for (uint32_t s = 0, c = 0; s < plan->site_count && !status; ++s) {
    double ln_k0 = 0.0, ln_xm = 0.0, curves = 0.0;
    for (; c < plan->curve_count && plan->curve_site[c] == plan->site_index[s]; ++c, ++curves) {
      ln_k0 += log(result->curves[c].k0_n_m3);
      ln_xm += log(result->curves[c].xm_m);
    }
    SONDE_ASSERT(curves > 0);
    double above_m = COLD_ABOVE_M * cold_factor(def, 2 * s);
    double xm_m = def->cold_start ? p->floor_m[s] + above_m : exp(ln_xm / curves);
    double k0_n_m3 = def->cold_start ? COLD_K0 * cold_factor(def, 2 * s + 1) : exp(ln_k0 / curves);
    sonde_law_log(k0_n_m3, xm_m, p->floor_m[s], theta[s]);
  }
  border[0] += log(cold_factor(def, UINT32_MAX));
  // Sites without edges first: the solution is the model of stage 1 and the start of stage 2.
  if (!status && (!def->cold_start || def->stages == 1)) {
    sonde_bordered_problem problem = bordered_problem(p, def, NULL);
    status = sonde_bordered_minimise(&problem, theta, border, &found, error);
  }
  if (!status && def->stages > 1) {
    p->edges = true;
    p->tension = def->fit_pretension;
    sonde_bordered_problem problem = bordered_problem(p, def, progress);
    status = sonde_bordered_minimise(&problem, theta, border, &found, error);
    if (!status && found.cancelled)
      status = sonde_fail(error, SONDE_CANCELLED, "the fit was cancelled; nothing is kept");
  }
  if (!status) status = finish(p, (const double(*)[2])theta, border, &found, result, error);
  sonde_free(theta);
  return status;
}

// ---- stage 3 ------------------------------------------------------------------------------

// The paper's skin has surface springs and no in-plane layer.
static void use_springs_only(sonde_surface_law *law) {
  law->inplane_stiffness_n_m = 0;
  law->tangential_stiffness_n_m3 = sonde_surface_law_default().tangential_stiffness_n_m3;
}

static sonde_status refit_sites(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *m, const sonde_fit_plan *plan,
                                const sonde_fit_def *def, const sonde_progress *progress,
                                sonde_fit_result *result, sonde_error *error) {
  // Stage 2's sites and law stay in the result beside stage 3's.
  SONDE_ASSERT(result->stage2_parameters > 0 && !result->stage2_sites);
  result->stage2_law = result->law;
  result->stage2_law.normal_exponent = 1;
  result->stage2_law.shear_stiffness_n_m = 0;
  use_springs_only(&result->stage2_law);
  result->stage2_sites = SONDE_NEW(sonde_site, result->site_count);
  if (!result->stage2_sites) return sonde_fail_memory(error);
  memcpy(result->stage2_sites, result->sites, result->site_count * sizeof *result->sites);
  sonde_refit *refit = NULL;
  sonde_refit_result found = {0};
  double *theta = SONDE_NEW(double, 4 * (size_t)sites->count + 2);
  double *force_n = SONDE_NEW(double, plan->row_count);
  sonde_status status = theta && force_n ? SONDE_OK : sonde_fail_memory(error);
  if (!status)
    status = sonde_refit_create(model, sites, m, plan, def, REFIT_REACH_M, &refit, error);
  if (!status) sonde_refit_start(refit, result->curves, theta);
  if (!status) sonde_refit_want_confidence(refit, &result->confidence);
  if (!status) status = sonde_refit_minimise(refit, theta, force_n, progress, &found, error);
  if (!status) {
    uint32_t count = result->site_count, fields = def->uniform_shear ? 2 : 4,
             n = fields * count + 2;
    for (uint32_t s = 0; s < count; ++s) {
      sonde_site *site = &result->sites[s];
      site->k0_n_m3 = exp(theta[s]);
      site->xm_m = exp(theta[count + s]);
      site->shear_share = fields > 2 ? exp(theta[2 * count + s]) : 1;
      site->limit_share = fields > 2 ? exp(theta[3 * count + s]) : 1;
    }
    result->law.shear_stiffness_n_m = exp(theta[n - 2]);
    result->law.shear_limit = exp(theta[n - 1]);
    result->law.normal_exponent = def->normal_exponent;
    result->law.edge_stiffness_n_m = def->kept_edge_n_m;
    result->law.edge_pretension_n = 0;
    result->parameters = n;
    result->iterations = found.iterations;
    result->converged = found.converged;
    result->cost = found.cost;
    result->start_cost = found.start_cost;
    sonde_refit_offsets(refit, result->curves);
    for (uint32_t r = 0; r < plan->row_count; ++r)
      result->model_n[plan->row[r]] = force_n[r] + result->curves[plan->row_curve[r]].tare_n;
    status = sonde_error_report_of(m->data, result->model_n, m->count, &result->stage3, error);
  }
  sonde_refit_destroy(refit);
  sonde_free(theta);
  sonde_free(force_n);
  return status;
}

// Keeps a stage's forces and time.
static sonde_status end_stage(sonde_fit_result *result, int stage, uint32_t count, double *start,
                              sonde_error *error) {
  double now = sonde_clock_now();
  SONDE_ASSERT(stage >= 0 && stage < 3 && now >= *start);
  result->seconds[stage] = now - *start;
  *start = now;
  double *copy = result->stage_n[stage] = SONDE_NEW(double, count);
  if (!copy) return sonde_fail_memory(error);
  memcpy(copy, result->model_n, count * sizeof *copy);
  return SONDE_OK;
}

sonde_status sonde_fit(const sonde_model *model, const sonde_site_table *sites,
                       const sonde_measurements *measurements, const sonde_fit_def *def,
                       const sonde_progress *progress, sonde_fit_result *result,
                       sonde_error *error) {
  *result = (sonde_fit_result){0};
  if (def->stages < 1 || def->stages > 3)
    return sonde_fail(error, SONDE_ARGUMENT, "stages is %u, expected 1, 2 or 3", def->stages);
  if (!(def->kept_edge_n_m >= 0))
    return sonde_fail(error, SONDE_ARGUMENT, "kept_edge_n_m is %g, expected >= 0",
                      def->kept_edge_n_m);
  if ((unsigned)def->weights > SONDE_WEIGHTS_RELATIVE || (unsigned)def->loss > SONDE_LOSS_STUDENT)
    return sonde_fail(error, SONDE_ARGUMENT, "unknown weights or loss");
  if (!(def->zero_sd_m >= 0 && def->zero_sd_m <= 0.1 && def->tare_sd_n >= 0 &&
        def->tare_sd_n <= 100))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "zero_sd_m is %g and tare_sd_n %g, expected 0 to 0.1 m and 0 to 100 N",
                      def->zero_sd_m, def->tare_sd_n);
  if (!(def->loss_scale >= 0) || def->max_iterations < 1)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "loss_scale is %g and max_iterations %u, expected >= 0 and >= 1",
                      def->loss_scale, def->max_iterations);
  const sonde_fit_def full = sonde_fit_def_complete(def);
  sonde_status status = sonde_sites_check_on_surface(model, sites, SONDE_SITE_TOLERANCE_M, error);
  if (status) return status;
  sonde_fit_plan plan;
  status = sonde_fit_plan_create(sites, measurements, &plan, error);
  if (status) return status;
  sonde_site_problem problem = {.plan = &plan, .m = measurements};
  *result = (sonde_fit_result){.law = model->law,
                               .site_count = sites->count,
                               .sites = SONDE_NEW(sonde_site, sites->count),
                               .model_n = SONDE_NEW(double, measurements->count),
                               .converged = true};
  if (!result->sites || !result->model_n) status = sonde_fail_memory(error);
  for (uint32_t i = 0; i < measurements->count && !status; ++i) result->model_n[i] = NAN;
  if (!status) memcpy(result->sites, sites->sites, sites->count * sizeof *result->sites);
  if (full.stages < 3) use_springs_only(&result->law);
  double start = sonde_clock_now();
  if (!status) {
    curve_buffer buffer = {SONDE_NEW(double, measurements->count),
                           SONDE_NEW(double, measurements->count)};
    result->curves = SONDE_NEW(sonde_curve_fit, plan.curve_count);
    if (!buffer.depth_m || !buffer.force_n || !result->curves) status = sonde_fail_memory(error);
    for (uint32_t c = 0; c < plan.curve_count && !status; ++c)
      status = fit_one_curve(model, sites, measurements, &plan, &full, c, buffer, result, error);
    result->curve_count = plan.curve_count;
    result->stage1_parameters = 2 * plan.curve_count;
    if (!status)
      status = sonde_error_report_of(measurements->data, result->model_n, measurements->count,
                                     &result->stage1, error);
    sonde_free(buffer.depth_m);
    sonde_free(buffer.force_n);
  }
  if (!status) status = end_stage(result, 0, measurements->count, &start, error);
  if (!status) status = fit_model(model, sites, &problem, &full, progress, result, error);
  if (!status && full.stages > 1) status = end_stage(result, 1, measurements->count, &start, error);
  if (!status && full.stages == 3)
    status = refit_sites(model, sites, measurements, &plan, &full, progress, result, error);
  if (!status && full.stages == 3)
    status = end_stage(result, 2, measurements->count, &start, error);
  sonde_site_problem_clear(&problem);
  sonde_fit_plan_clear(&plan);
  if (status) sonde_fit_result_clear(result);
  return status;
}

void sonde_fit_confidence_clear(sonde_fit_confidence *c) {
  sonde_free(c->ln_k0_sd);
  sonde_free(c->ln_xm_sd);
  sonde_free(c->ln_site_shear_sd);
  sonde_free(c->ln_site_limit_sd);
  sonde_free(c->band_n);
  sonde_free(c->one_out_n);
  *c = (sonde_fit_confidence){0};
}

void sonde_fit_result_clear(sonde_fit_result *result) {
  if (!result) return;
  for (int k = 0; k < 3; ++k) sonde_free(result->stage_n[k]);
  sonde_fit_confidence_clear(&result->confidence);
  sonde_free(result->curves);
  sonde_free(result->sites);
  sonde_free(result->stage2_sites);
  sonde_free(result->model_n);
  *result = (sonde_fit_result){0};
}
