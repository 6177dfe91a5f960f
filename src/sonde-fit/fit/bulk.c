// Fit of a volumetric model: mesh, moduli by Levenberg-Marquardt, scale by all measurements.
#include "sonde/fit_bulk.h"

#include "fit/fit_inside.h"
#include "fit/marquardt.h"
#include "fit/press.h"
#include "sparse/dense.h"
#include "tissue/bulk/bulk.h"

#include "base/clock.h"
#include "base/maths.h"
#include "base/parallel.h"

#include <string.h>

sonde_fit_bulk_def sonde_fit_bulk_def_default(void) {
  return (sonde_fit_bulk_def){.version = SONDE_DEF_VERSION,
                              .kind = SONDE_LINEAR_SOLID,
                              .fine_reach_m = 5e-3,
                              .growth = 1,
                              .poisson = 0.45,
                              .sites = 8,
                              .depths = 3,
                              .max_steps = 12};
}

// What is sought of a kind's law; each by its logarithm.
static uint32_t list_parameters(sonde_model_kind kind, sonde_bulk_law *law,
                                const char *name[SONDE_BULK_PARAMETERS],
                                double *value[SONDE_BULK_PARAMETERS]) {
  const struct {
    sonde_model_kind kind;
    const char *name;
    double *value;
  } list[] = {{SONDE_LATTICE, "spring_pa", &law->spring_pa[SONDE_LAYER_MUSCLE]},
              {SONDE_THREE_LAYER, "spring_fat_pa", &law->spring_pa[SONDE_LAYER_FAT]},
              {SONDE_THREE_LAYER, "spring_muscle_pa", &law->spring_pa[SONDE_LAYER_MUSCLE]},
              {SONDE_THREE_LAYER, "volume_pa", &law->volume_pa},
              {SONDE_THREE_LAYER, "steepening", &law->steepening},
              {SONDE_LINEAR_SOLID, "young_fat_pa", &law->young_pa[SONDE_LAYER_FAT]},
              {SONDE_LINEAR_SOLID, "young_muscle_pa", &law->young_pa[SONDE_LAYER_MUSCLE]},
              {SONDE_NEO_HOOKEAN_SOLID, "young_fat_pa", &law->young_pa[SONDE_LAYER_FAT]},
              {SONDE_NEO_HOOKEAN_SOLID, "young_muscle_pa", &law->young_pa[SONDE_LAYER_MUSCLE]}};
  uint32_t count = 0;
  for (size_t k = 0; k < SONDE_COUNT_OF(list); ++k)
    if (list[k].kind == (kind == SONDE_CONDENSED_SOLID ? SONDE_LINEAR_SOLID : kind))
      name[count] = list[k].name, value[count++] = list[k].value;
  SONDE_ASSERT(count > 0 && count <= SONDE_BULK_PARAMETERS);
  return count;
}

// A body that folds needs more and is given up: while moduli are sought, and in a prediction.
enum { MOST_SOUGHT = 25, MOST_NEWTON = 60 };

typedef struct search {
  sonde_model *model;
  const sonde_site_table *sites;
  sonde_measurements rows; // that the moduli are sought on
  sonde_fit_plan plan;     // of these rows
  sonde_model **local;     // [plan.site_count] the model with a fine mesh at each of their sites
  const sonde_fit_bulk_def *options;
  uint32_t count; // of parameters
  double theta[SONDE_BULK_PARAMETERS], trial[SONDE_BULK_PARAMETERS];
  double *force, *trial_force, *jacobian; // [rows], [rows], [count][rows]
  double *to;                             // [rows] forces of the prediction at hand
} search;

static sonde_status set_law(const search *s, const double *theta, sonde_model *model,
                            sonde_error *error) {
  sonde_bulk_law law = model->bulk->law;
  const char *name[SONDE_BULK_PARAMETERS];
  double *value[SONDE_BULK_PARAMETERS] = {NULL};
  list_parameters(model->kind, &law, name, value);
  for (uint32_t k = 0; k < s->count; ++k) *value[k] = exp(theta[k]);
  if (law.steepening < 1) law.steepening = 1;
  return sonde_model_set_bulk_law(model, &law, error);
}

static sonde_status make_local(void *user, uint32_t worker, uint32_t site, const atomic_bool *stop,
                               sonde_error *error) {
  (void)worker, (void)stop;
  search *s = user;
  SONDE_ASSERT(site < s->plan.site_count);
  const sonde_site *at = &s->sites->sites[s->plan.site_index[site]];
  return sonde_bulk_refine_at(s->model, at->position_m, &s->local[site], error);
}

static sonde_status press_curve(void *user, uint32_t worker, uint32_t curve,
                                const atomic_bool *stop, sonde_error *error) {
  (void)worker;
  search *s = user;
  const sonde_fit_plan *plan = &s->plan;
  uint32_t probe = plan->curve_probe[curve];
  sonde_bonded bonded;
  sonde_status status = sonde_bonded_create_on(
      s->local[sonde_plan_site_of(plan, curve)], &s->sites->sites[plan->curve_site[curve]],
      plan->half_u_m[probe], plan->half_v_m[probe], 1e-4, MOST_SOUGHT, &bonded, error);
  if (status) return status;
  status = sonde_bonded_curve(&bonded, plan, curve, s->rows.data, stop, s->to, error);
  sonde_bonded_clear(&bonded);
  return status;
}

static sonde_status predict(search *s, const double *theta, double *force, double *cost,
                            sonde_error *error) {
  sonde_status status = SONDE_OK;
  for (uint32_t k = 0; !status && k < s->plan.site_count; ++k)
    status = set_law(s, theta, s->local[k], error);
  s->to = force;
  uint32_t workers = sonde_parallel_workers(s->options->threads, s->plan.curve_count);
  if (!status)
    status =
        sonde_parallel_run(s->plan.curve_count, workers, press_curve, s, NULL, "pressing", error);
  *cost = 0;
  for (uint32_t r = 0; !status && r < s->rows.count; ++r) {
    if (!isfinite(force[r])) force[r] = 0; // no equilibrium counts as no force
    double residual = force[r] - s->rows.data[r].force_n;
    *cost += 0.5 * residual * residual;
  }
  return status;
}

// Normal equations by differences of the forces.
static sonde_status linearise(void *user, double *cost, bool *done, sonde_error *error) {
  search *s = user;
  const double by = 0.03; // of a modulus
  sonde_status status = predict(s, s->theta, s->force, cost, error);
  for (uint32_t k = 0; !status && k < s->count; ++k) {
    double moved[SONDE_BULK_PARAMETERS], unused;
    memcpy(moved, s->theta, sizeof moved);
    moved[k] += by;
    double *column = s->jacobian + (size_t)k * s->rows.count;
    status = predict(s, moved, column, &unused, error);
    for (uint32_t r = 0; r < s->rows.count; ++r) column[r] = (column[r] - s->force[r]) / by;
  }
  *done = false;
  return status;
}

static bool propose(void *user, double damping, double cost, bool *done) {
  search *s = user;
  uint32_t n = s->count, rows = s->rows.count;
  double a[SONDE_BULK_PARAMETERS * SONDE_BULK_PARAMETERS], step[SONDE_BULK_PARAMETERS] = {0};
  double longest = 0;
  (void)cost;
  for (uint32_t i = 0; i < n; ++i) {
    const double *p = s->jacobian + (size_t)i * rows;
    for (uint32_t r = 0; r < rows; ++r) step[i] -= p[r] * (s->force[r] - s->rows.data[r].force_n);
    for (uint32_t j = 0; j < n; ++j) {
      const double *q = s->jacobian + (size_t)j * rows;
      a[i * n + j] = 0;
      for (uint32_t r = 0; r < rows; ++r) a[i * n + j] += p[r] * q[r];
    }
    a[i * n + i] = a[i * n + i] * (1 + damping) + 1e-9;
  }
  if (!sonde_cholesky(a, n)) return false;
  sonde_cholesky_solve(a, n, step);
  for (uint32_t i = 0; i < n; ++i) {
    double move = clamp(step[i], -1, 1);
    s->trial[i] = s->theta[i] + move;
    longest = fmax(longest, fabs(move));
  }
  *done = longest < 1e-3;
  return true;
}

static sonde_status evaluate(void *user, double *cost, sonde_error *error) {
  search *s = user;
  return predict(s, s->trial, s->trial_force, cost, error);
}

static void accept(void *user, double cost, double fall, bool *done) {
  search *s = user;
  memcpy(s->theta, s->trial, sizeof s->theta);
  *done = fall < 1e-3 * cost;
}

static bool stall(void *user, double cost) {
  (void)user, (void)cost;
  return true;
}

// The rows of `count` sites that lie far from each other: each is the farthest from those before.
static sonde_status choose_rows(const sonde_site_table *sites, const sonde_measurements *m,
                                const sonde_fit_bulk_def *options, sonde_measurements *rows,
                                sonde_error *error) {
  sonde_fit_plan plan;
  sonde_status status = sonde_fit_plan_create(sites, m, &plan, error);
  if (status) return status;
  status = sonde_measurements_create(rows, plan.row_count, error);
  bool *taken = SONDE_NEW(bool, plan.site_count);
  if (!status && !taken) status = sonde_fail_memory(error);
  for (uint32_t n = 0; !status && n < options->sites && n < plan.site_count; ++n) {
    uint32_t best = 0;
    double farthest = -1;
    for (uint32_t a = 0; a < plan.site_count; ++a) {
      double nearest = INFINITY;
      for (uint32_t b = 0; b < plan.site_count; ++b)
        if (taken[b])
          nearest = fmin(nearest, v_distance(sites->sites[plan.site_index[a]].position_m,
                                             sites->sites[plan.site_index[b]].position_m));
      if (!taken[a] && nearest > farthest) farthest = nearest, best = a;
    }
    taken[best] = true;
  }
  for (uint32_t c = 0; !status && c < plan.curve_count; ++c) {
    uint32_t first = plan.curve_start[c], count = plan.curve_start[c + 1] - first;
    uint32_t depths = options->depths < count ? options->depths : count, before = UINT32_MAX;
    for (uint32_t k = 1; taken[sonde_plan_site_of(&plan, c)] && k <= depths; ++k) {
      uint32_t row = plan.row[first + count * k / depths - 1];
      if (row == before) continue;
      rows->data[rows->count] = m->data[row], rows->position_m[rows->count] = m->position_m[row];
      rows->normal[rows->count++] = m->normal[row];
      before = row;
    }
  }
  sonde_free(taken);
  sonde_fit_plan_clear(&plan);
  return status;
}

static sonde_status seek(search *s, const sonde_progress *progress, sonde_fit_bulk_result *result,
                         sonde_error *error) {
  sonde_bulk_law law = s->model->bulk->law;
  double *value[SONDE_BULK_PARAMETERS] = {NULL};
  s->count = list_parameters(s->model->kind, &law, result->parameter, value);
  // A single modulus is found by the scale of all measurements.
  result->converged = s->count == 1;
  if (result->converged) return SONDE_OK;
  for (uint32_t k = 0; k < s->count; ++k) s->theta[k] = log(*value[k]);
  sonde_status status = sonde_fit_plan_create_all(s->sites, &s->rows, &s->plan, error);
  if (status) return status;
  s->local = SONDE_NEW(sonde_model *, s->plan.site_count);
  s->force = SONDE_NEW(double, s->rows.count);
  s->trial_force = SONDE_NEW(double, s->rows.count);
  s->jacobian = SONDE_NEW(double, (size_t)s->count * s->rows.count);
  if (!s->local || !s->force || !s->trial_force || !s->jacobian) return sonde_fail_memory(error);
  uint32_t workers = sonde_parallel_workers(s->options->threads, s->plan.site_count);
  status = sonde_parallel_run(s->plan.site_count, workers, make_local, s, progress,
                              "filling the thigh with tetrahedra", error);
  if (status) return status;
  const sonde_marquardt m = {.user = s,
                             .linearise = linearise,
                             .propose = propose,
                             .evaluate = evaluate,
                             .accept = accept,
                             .stall = stall,
                             .damping = 1e-2,
                             .fall = 0.2,
                             .least = 1e-6,
                             .rise = 5,
                             .rise_least = 1e-3,
                             .most = 1e6,
                             .max_steps = s->options->max_steps,
                             .max_trials = 4 * s->options->max_steps,
                             .progress = progress};
  sonde_marquardt_result found;
  status = sonde_marquardt_minimise(&m, &found, error);
  if (!status && found.cancelled) status = sonde_fail(error, SONDE_CANCELLED, "cancelled");
  result->start_cost = found.start_cost, result->cost = found.cost;
  result->steps = found.steps, result->trials = found.trials;
  result->converged = found.converged;
  return status ? status : set_law(s, s->theta, s->model, error);
}

static sonde_status build(const sonde_model_def *def, const sonde_fit_bulk_def *options,
                          sonde_model **model, double *worst_rad, sonde_error *error) {
  sonde_bulk_law law = sonde_bulk_law_default(options->kind);
  law.poisson = options->poisson;
  // K* is dense: a condensed solid has a coarser mesh.
  bool condensed = options->kind == SONDE_CONDENSED_SOLID;
  double edge_m = options->edge_m, fine_edge_m = options->fine_edge_m;
  if (!(edge_m > 0)) edge_m = condensed ? 20e-3 : 15e-3;
  if (!(fine_edge_m > 0)) fine_edge_m = condensed ? 10e-3 : 5e-3;
  const sonde_bulk_mesh mesh = {.edge_m = edge_m,
                                .growth = options->growth,
                                .fine_edge_m = fine_edge_m,
                                .fine_reach_m = options->fine_reach_m};
  sonde_status status = sonde_def_check("fit_bulk", options->version, error);
  if (status) return status;
  return sonde_bulk_build(def, &mesh, options->layers, options->kind, &law, model, worst_rad,
                          error);
}

sonde_status sonde_bulk_model(const sonde_model_def *def, const sonde_fit_bulk_def *options,
                              sonde_model **model, sonde_error *error) {
  return build(def, options, model, NULL, error);
}

sonde_status sonde_fit_bulk(const sonde_model_def *def, const sonde_site_table *sites,
                            const sonde_measurements *measurements,
                            const sonde_fit_bulk_def *options, const sonde_progress *progress,
                            sonde_model **out, sonde_fit_bulk_result *result, double *predicted_n,
                            sonde_error *error) {
  *out = NULL;
  *result = (sonde_fit_bulk_result){0};
  sonde_model *model = NULL;
  double start = sonde_clock_now();
  sonde_status status = build(def, options, &model, &result->worst_dihedral_rad, error);
  if (!status) {
    result->node_count = model->bulk->node_count, result->skin_nodes = model->surface.vertex_count;
    result->element_count = model->bulk->element_count;
  }
  search s = {.model = model, .sites = sites, .options = options};
  result->mesh_s = sonde_clock_now() - start, start += result->mesh_s;
  if (!status) status = choose_rows(sites, measurements, options, &s.rows, error);
  if (!status) status = seek(&s, progress, result, error);
  result->fit_s = sonde_clock_now() - start, start += result->fit_s;

  // Forces are proportional to all moduli together: one scale by all measurements.
  sonde_predict_def predict_def = sonde_predict_def_default();
  predict_def.interaction = SONDE_INTERACTION_FULL;
  predict_def.relative_residual = 1e-4, predict_def.max_iterations = MOST_NEWTON;
  predict_def.threads = options->threads;
  if (!status)
    status = sonde_predict(model, sites, measurements, &predict_def, progress, predicted_n, error);
  result->predict_s = sonde_clock_now() - start;
  if (!status) {
    double product = 0, square = 0, *value[SONDE_BULK_PARAMETERS] = {NULL};
    for (uint32_t r = 0; r < measurements->count; ++r) {
      if (!isfinite(predicted_n[r])) continue;
      product += predicted_n[r] * measurements->data[r].force_n;
      square += predicted_n[r] * predicted_n[r];
    }
    double scale = square > 0 && product > 0 ? product / square : 1;
    for (uint32_t r = 0; r < measurements->count; ++r) predicted_n[r] *= scale;
    sonde_bulk_law law = model->bulk->law;
    law.skin_n_m *= scale, law.volume_pa *= scale;
    for (int k = 0; k < SONDE_LAYERS; ++k) law.spring_pa[k] *= scale, law.young_pa[k] *= scale;
    status = sonde_model_set_bulk_law(model, &law, error);
    result->parameter_count = list_parameters(model->kind, &law, result->parameter, value);
    for (uint32_t k = 0; k < result->parameter_count; ++k) result->value[k] = *value[k];
  }
  if (!status)
    status = sonde_error_report_of(measurements->data, predicted_n, measurements->count,
                                   &result->all, error);
  for (uint32_t k = 0; s.local && k < s.plan.site_count; ++k) sonde_model_destroy(s.local[k]);
  sonde_free(s.local);
  sonde_fit_plan_clear(&s.plan);
  sonde_measurements_clear(&s.rows);
  sonde_free(s.force);
  sonde_free(s.trial_force);
  sonde_free(s.jacobian);
  if (status)
    sonde_model_destroy(model);
  else
    *out = model;
  return status;
}
