// Moduli of the hyperelastic solid from forces: every curve is pressed with its derivatives, the
// logarithms of the moduli follow by Levenberg-Marquardt. docs/solid_theory.md.
#include "sonde/fit_solid.h"

#include "base/maths.h"
#include "base/parallel.h"
#include "fit/fit_inside.h"
#include "fit/marquardt.h"
#include "sparse/dense.h"

#include <string.h>

enum { MODULI = 2 * SONDE_SOLID_LAYERS, CHANGES = MODULI + 1 }; // of a force: and with depth
static const double longest_step = 0.7;                         // of a logarithm
static const double short_enough = 2e-3; // step of a logarithm that ends the search

sonde_fit_solid_def sonde_fit_solid_def_default(void) {
  static const double shear_pa[SONDE_SOLID_LAYERS] = {3e3, 1.6e3, 30e3};
  static const double exponent[SONDE_SOLID_LAYERS] = {8, 9, 8};
  sonde_fit_solid_def def = {.version = SONDE_DEF_VERSION,
                             .contact = sonde_equilibrium_def_default(),
                             .mesh = sonde_hexes_def_default(),
                             .ln_shear_sd = 1,
                             .ln_exponent_sd = 0.3,
                             .relative_sd = 0.02,
                             .force_sd_n = 0.01,
                             .max_steps = 12};
  def.contact.bonded = true, def.contact.tolerance = 1e-6;
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k)
    def.contact.layer[k] =
        (sonde_hyperelastic){SONDE_ENERGY_OGDEN, shear_pa[k], exponent[k], 24 * shear_pa[k]};
  return def;
}

void sonde_fit_solid_result_clear(sonde_fit_solid_result *result) {
  if (!result) return;
  sonde_free(result->curves);
  *result = (sonde_fit_solid_result){0};
}

// Where the search stands: parameters, forces and their changes, states of the solid by row.
typedef struct standing {
  double *theta; // ln mu, ln exponent by layer, then contact zero and tare by curve
  double *force_n;
  double (*change)[CHANGES];
  sonde_vec3 **state;
} standing;

typedef struct search {
  const sonde_fit_solid_def *def;
  const sonde_site_table *sites;
  const sonde_measurements *m;
  sonde_fit_plan plan;
  sonde_probe probe[SONDE_FIT_PROBES];
  sonde_hexes *mesh; // [curves]
  const sonde_model *model;
  sonde_equilibrium_def solid; // with the layers of the parameters at work
  standing now, trial;         // of a prediction: trial only
  double (*offset)[2];         // [curves] zero and tare at work
  uint32_t count;              // of parameters
  uint32_t *used;              // [curves] rows that count: the first so many
  double *matrix, *gradient;   // [count * count], [count]
  uint32_t evaluations;
  double start_rms;
  const sonde_progress *progress;
  char what[64];
} search;

// ---- pressing -----------------------------------------------------------------------------

static sonde_status make_mesh(void *user, uint32_t worker, uint32_t curve, const atomic_bool *stop,
                              sonde_error *error) {
  (void)worker, (void)stop;
  search *s = user;
  const sonde_probe *probe = &s->probe[s->plan.curve_probe[curve]];
  sonde_hexes_def def = s->def->mesh;
  def.half_u_m = probe->half_x_m, def.half_v_m = probe->half_y_m;
  SONDE_ASSERT(curve < s->plan.curve_count);
  return sonde_hexes_ring(s->model, &s->sites->sites[s->plan.curve_site[curve]], &def,
                          &s->mesh[curve], error);
}

// Forces of the trial along one curve. A row begins at its state with the accepted parameters, or
// where that finds nothing, and at first, at the row before; rows from the first failure on are
// NaN.
static sonde_status press_curve(void *user, uint32_t worker, uint32_t curve,
                                const atomic_bool *stop, sonde_error *error) {
  (void)worker;
  search *s = user;
  const sonde_fit_plan *plan = &s->plan;
  const sonde_site *site = &s->sites->sites[plan->curve_site[curve]];
  const sonde_vec3 way = v_scale(site->normal, -1);
  const size_t bytes = s->mesh[curve].node_count * sizeof(sonde_vec3);
  uint32_t r = plan->curve_start[curve];
  const uint32_t end = s->now.theta ? r + s->used[curve] : plan->curve_start[curve + 1];
  for (uint32_t k = r; k < plan->curve_start[curve + 1]; ++k) s->trial.force_n[k] = NAN;
  sonde_equilibrium *e;
  sonde_status status =
      sonde_equilibrium_create(&s->mesh[curve], &s->probe[plan->curve_probe[curve]],
                               sonde_site_pose(site, 0), &s->solid, &e, error);
  sonde_vec3 *before = SONDE_NEW(sonde_vec3, s->mesh[curve].node_count);
  if (!status && !before) status = sonde_fail_memory(error);
  sonde_pose at = sonde_site_pose(site, 0);
  for (; r < end && !status; ++r) {
    if (atomic_load(stop)) status = sonde_fail(error, SONDE_CANCELLED, "cancelled");
    if (status) break;
    const double depth = s->m->data[plan->row[r]].penetration_m - s->offset[curve][0];
    const sonde_pose pose = sonde_site_pose(site, depth);
    sonde_equilibrium_result found;
    status = SONDE_CONVERGENCE;
    if (s->now.state && s->now.state[r]) {
      sonde_equilibrium_restore(e, pose, s->now.state[r]);
      status = sonde_equilibrium_find(e, pose, &found, NULL);
      if (status) sonde_equilibrium_restore(e, at, before);
    }
    if (status == SONDE_CONVERGENCE) status = sonde_equilibrium_find(e, pose, &found, error);
    if (!status && s->trial.change) {
      sonde_force_change c;
      status = sonde_equilibrium_change(e, way, &c, error);
      double *change = s->trial.change[r];
      for (int k = 0; k < SONDE_SOLID_LAYERS; ++k)
        change[2 * k] = c.ln_shear_n[k],
                   change[2 * k + 1] = c.exponent_n[k] * s->solid.layer[k].exponent;
      change[MODULI] = c.way_n_m;
    }
    if (status) break;
    at = pose, memcpy(before, sonde_equilibrium_state(e), bytes);
    s->trial.force_n[r] = -v_dot(found.force_n, way);
    if (!s->trial.state) continue;
    if (!s->trial.state[r]) s->trial.state[r] = SONDE_NEW(sonde_vec3, s->mesh[curve].node_count);
    if (!s->trial.state[r]) status = sonde_fail_memory(error);
    if (!status) memcpy(s->trial.state[r], before, bytes);
  }
  sonde_free(before);
  sonde_equilibrium_destroy(e);
  return status == SONDE_CONVERGENCE ? SONDE_OK : status; // its rows are NaN
}

// Progress of one evaluation as a share of all that are expected.
static bool report_part(double fraction, const char *what, void *user) {
  const search *s = user;
  (void)what;
  const double part = (s->evaluations - 1 + fraction) / (1 + s->def->max_steps / 2);
  return sonde_progress_report(s->progress, fmin(part, 0.99), s->what);
}

// Layers of parameters; those that were believed beforehand give laws and ratios K/mu.
static void layers_of(const search *s, const double *theta,
                      sonde_hyperelastic layer[SONDE_SOLID_LAYERS]) {
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    const sonde_hyperelastic *prior = &s->def->contact.layer[k];
    const double shear_pa = exp(theta[2 * k]);
    layer[k] = (sonde_hyperelastic){prior->energy, shear_pa, exp(theta[2 * k + 1]),
                                    prior->bulk_pa / prior->shear_pa * shear_pa};
  }
}

static void close_search(search *s) {
  standing *both[2] = {&s->now, &s->trial};
  for (int k = 0; k < 2; ++k) {
    for (uint32_t r = 0; both[k]->state && r < s->plan.row_count; ++r)
      sonde_free(both[k]->state[r]);
    sonde_free(both[k]->state);
    sonde_free(both[k]->theta);
    sonde_free(both[k]->force_n);
    sonde_free(both[k]->change);
  }
  for (uint32_t c = 0; s->mesh && c < s->plan.curve_count; ++c) sonde_hexes_clear(&s->mesh[c]);
  for (uint32_t p = 0; p < s->plan.probe_count; ++p) sonde_probe_clear(&s->probe[p]);
  void *parts[] = {s->mesh, s->offset, s->used, s->matrix, s->gradient};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  sonde_fit_plan_clear(&s->plan);
}

// Plan, probes and meshes of the curves; a prediction's or a fit's.
static sonde_status open_search(search *s, bool fit, sonde_error *error) {
  sonde_status status = sonde_def_check("a fit of the solid", s->def->version, error);
  const sonde_bounded range[] = {{"ln_shear_sd", s->def->ln_shear_sd, 1e-3, 10},
                                 {"ln_exponent_sd", s->def->ln_exponent_sd, 1e-3, 2},
                                 {"relative_sd", s->def->relative_sd, 1e-4, 1},
                                 {"force_sd_n", s->def->force_sd_n, 1e-6, 100},
                                 {"zero_sd_m", s->def->zero_sd_m, 0, 0.05},
                                 {"tare_sd_n", s->def->tare_sd_n, 0, 100},
                                 {"contact.friction", s->def->contact.friction, 0, 0}};
  if (!status) status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  // What is sought are logarithms.
  for (int k = 0; k < SONDE_SOLID_LAYERS && !status && fit; ++k) {
    const sonde_hyperelastic *m = &s->def->contact.layer[k];
    if (!(m->shear_pa > 0 && m->exponent > 0))
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "a fit begins with positive moduli and exponents, not %g Pa and %g",
                          m->shear_pa, m->exponent);
  }
  if (!status)
    status = sonde_sites_check_on_surface(s->model, s->sites, SONDE_SITE_TOLERANCE_M, error);
  if (!status)
    status =
        (fit ? sonde_fit_plan_create : sonde_fit_plan_create_all)(s->sites, s->m, &s->plan, error);
  if (status) return status;
  for (uint32_t p = 0; p < s->plan.probe_count && !status; ++p)
    status = sonde_probe_create(s->plan.probe[p], &s->probe[p], error);
  const uint32_t curves = s->plan.curve_count, rows = s->plan.row_count;
  s->solid = s->def->contact;
  s->mesh = SONDE_NEW(sonde_hexes, curves);
  s->offset = (double(*)[2])sonde_calloc(curves, sizeof *s->offset);
  s->used = SONDE_NEW(uint32_t, curves);
  s->trial.force_n = SONDE_NEW(double, rows);
  if (!s->mesh || !s->offset || !s->used || !s->trial.force_n) return sonde_fail_memory(error);
  snprintf(s->what, sizeof s->what, "making %u meshes", curves);
  const uint32_t workers = sonde_parallel_workers(s->def->threads, curves);
  if (!status)
    status = sonde_parallel_run(curves, workers, make_mesh, s, s->progress, s->what, error);
  return status;
}

// ---- searching ----------------------------------------------------------------------------

static double variance_of(const search *s, double measured_n) {
  const double share = s->def->relative_sd * measured_n;
  return share * share + s->def->force_sd_n * s->def->force_sd_n;
}

// Unknowns of a curve: index of its contact zero and of its tare; UINT32_MAX: none.
static void offsets_of(const search *s, uint32_t curve, uint32_t at[2]) {
  const uint32_t zero = s->def->zero_sd_m > 0, tare = s->def->tare_sd_n > 0;
  at[0] = zero ? MODULI + curve * (zero + tare) : UINT32_MAX;
  at[1] = tare ? MODULI + curve * (zero + tare) + zero : UINT32_MAX;
}

// What is believed of a parameter beforehand: mean and 1/sd^2.
static double prior_of(const search *s, uint32_t k, double *precision) {
  const sonde_fit_solid_def *def = s->def;
  const bool zero = def->zero_sd_m > 0 && (def->tare_sd_n > 0 ? (k - MODULI) % 2 == 0 : true);
  const double sd = k >= MODULI ? (zero ? def->zero_sd_m : def->tare_sd_n)
                    : k % 2     ? def->ln_exponent_sd
                                : def->ln_shear_sd;
  *precision = 1 / (sd * sd);
  if (k >= MODULI) return 0;
  const sonde_hyperelastic *m = &def->contact.layer[k / 2];
  return log(k % 2 ? m->exponent : m->shear_pa);
}

// Cost of a standing: half of the curves' mean squares and of the squares of what was believed.
static double cost_of(const search *s, const standing *at, double *misfit) {
  const sonde_fit_plan *plan = &s->plan;
  double cost = 0;
  for (uint32_t c = 0; c < plan->curve_count; ++c)
    for (uint32_t k = 0; k < s->used[c]; ++k) {
      const uint32_t r = plan->curve_start[c] + k;
      const double measured = s->m->data[plan->row[r]].force_n;
      const double off = at->force_n[r] + s->offset[c][1] - measured;
      if (!isfinite(off)) return INFINITY;
      cost += 0.5 * off * off / variance_of(s, measured) / s->used[c];
    }
  if (misfit) *misfit = cost;
  for (uint32_t k = 0; k < s->count; ++k) {
    double precision;
    const double off = at->theta[k] - prior_of(s, k, &precision);
    cost += 0.5 * precision * off * off;
  }
  return cost;
}

double sonde_ln_rms(const sonde_datum *data, const double *model_n, uint32_t count) {
  double sum = 0;
  uint32_t used = 0;
  for (uint32_t k = 0; k < count; ++k) {
    if (!(model_n[k] > 0 && data[k].force_n > 0)) continue;
    const double off = log(model_n[k] / data[k].force_n);
    sum += off * off, ++used;
  }
  return used ? sqrt(sum / used) : NAN;
}

// Root mean square of ln(model/measured) where the search stands.
static double rms_of(const search *s, const standing *at) {
  double sum = 0;
  uint32_t used = 0;
  for (uint32_t c = 0; c < s->plan.curve_count; ++c)
    for (uint32_t k = 0; k < s->used[c]; ++k, ++used) {
      const uint32_t r = s->plan.curve_start[c] + k;
      const sonde_datum *d = &s->m->data[s->plan.row[r]];
      const double model = at->force_n[r] + s->offset[c][1];
      const double ln = sonde_ln_rms(d, &model, 1);
      sum += isnan(ln) ? 0 : ln * ln;
    }
  return used ? sqrt(sum / used) : NAN;
}

static sonde_status evaluate(void *user, double *cost, sonde_error *error) {
  search *s = user;
  for (uint32_t c = 0; c < s->plan.curve_count; ++c) {
    uint32_t at[2];
    offsets_of(s, c, at);
    for (int k = 0; k < 2; ++k) s->offset[c][k] = at[k] < s->count ? s->trial.theta[at[k]] : 0;
  }
  const sonde_progress progress = {.report = report_part, .user = s};
  ++s->evaluations;
  layers_of(s, s->trial.theta, s->solid.layer);
  const uint32_t workers = sonde_parallel_workers(s->def->threads, s->plan.curve_count);
  const sonde_status status =
      sonde_parallel_run(s->plan.curve_count, workers, press_curve, s, &progress, s->what, error);
  if (!status) *cost = cost_of(s, &s->trial, NULL);
  return status;
}

static void take_trial(search *s) {
  const standing other = s->now;
  s->now = s->trial, s->trial = other;
}

static void accept(void *user, double cost, double fall, bool *done) {
  take_trial(user);
  *done = fall < 1e-3 * cost;
}

// At the start the rows that have an equilibrium are those that count. Afterwards the accepted
// trial has brought its derivatives along.
static sonde_status linearise(void *user, double *cost, bool *done, sonde_error *error) {
  search *s = user;
  const sonde_fit_plan *plan = &s->plan;
  *done = false;
  if (s->evaluations) {
    *cost = cost_of(s, &s->now, NULL);
    return SONDE_OK;
  }
  uint32_t all = 0;
  for (uint32_t c = 0; c < plan->curve_count; ++c)
    s->used[c] = plan->curve_start[c + 1] - plan->curve_start[c];
  for (uint32_t k = 0; k < s->count; ++k) {
    double precision;
    s->trial.theta[k] = prior_of(s, k, &precision);
  }
  const sonde_status status = evaluate(s, cost, error);
  if (status) return status;
  for (uint32_t c = 0; c < plan->curve_count; ++c) {
    uint32_t good = 0;
    while (good < s->used[c] && isfinite(s->trial.force_n[plan->curve_start[c] + good])) ++good;
    all += s->used[c] = good;
  }
  if (all == 0)
    return sonde_fail(error, SONDE_CONVERGENCE,
                      "no measurement has an equilibrium with the moduli at the start");
  *cost = cost_of(s, &s->trial, NULL), s->start_rms = rms_of(s, &s->trial);
  take_trial(s);
  return SONDE_OK;
}

// Normal equations at the accepted point: matrix without damping, minus the gradient.
static void assemble(search *s, double scale) {
  const sonde_fit_plan *plan = &s->plan;
  const uint32_t n = s->count;
  memset(s->matrix, 0, (size_t)n * n * sizeof *s->matrix);
  for (uint32_t k = 0; k < n; ++k) {
    double precision;
    const double mean = prior_of(s, k, &precision);
    s->matrix[(size_t)k * n + k] = precision;
    s->gradient[k] = precision * (mean - s->now.theta[k]);
  }
  for (uint32_t c = 0; c < plan->curve_count; ++c) {
    uint32_t at[MODULI + 2] = {0};
    for (uint32_t k = 0; k < MODULI; ++k) at[k] = k;
    offsets_of(s, c, at + MODULI);
    const double tare = at[MODULI + 1] < n ? s->now.theta[at[MODULI + 1]] : 0;
    for (uint32_t k = 0; k < s->used[c]; ++k) {
      const uint32_t r = plan->curve_start[c] + k;
      const double measured = s->m->data[plan->row[r]].force_n;
      const double w = 1 / (variance_of(s, measured) * s->used[c] * scale);
      const double off = s->now.force_n[r] + tare - measured;
      double row[MODULI + 2];
      memcpy(row, s->now.change[r], MODULI * sizeof *row);
      row[MODULI] = -s->now.change[r][MODULI], row[MODULI + 1] = 1;
      for (uint32_t i = 0; i < MODULI + 2; ++i) {
        if (at[i] >= n) continue;
        s->gradient[at[i]] -= w * row[i] * off;
        for (uint32_t j = 0; j < MODULI + 2; ++j)
          if (at[j] < n) s->matrix[(size_t)at[i] * n + at[j]] += w * row[i] * row[j];
      }
    }
  }
}

static bool propose(void *user, double damping, double cost, bool *done) {
  search *s = user;
  const uint32_t n = s->count;
  double longest = 0;
  assemble(s, 1);
  for (uint32_t k = 0; k < n; ++k) s->matrix[(size_t)k * n + k] *= 1 + damping;
  if (!sonde_cholesky(s->matrix, n)) return false;
  sonde_cholesky_solve(s->matrix, n, s->gradient);
  for (uint32_t k = 0; k < n; ++k) {
    const double step =
        k < MODULI ? clamp(s->gradient[k], -longest_step, longest_step) : s->gradient[k];
    s->trial.theta[k] = s->now.theta[k] + step;
    if (k < MODULI) longest = fmax(longest, fabs(step));
  }
  *done = longest < short_enough;
  snprintf(s->what, sizeof s->what, "step %u, cost %.3g", s->evaluations, cost);
  return true;
}

static bool stall(void *user, double cost) {
  (void)user, (void)cost;
  return true;
}

// Moduli, intervals and offsets at the accepted point.
static sonde_status conclude(search *s, sonde_fit_solid_result *result, sonde_error *error) {
  const uint32_t n = s->count;
  double *inverse = SONDE_NEW(double, (size_t)n *n), misfit;
  result->curves = SONDE_NEW(sonde_curve_fit, s->plan.curve_count);
  if (!inverse || !result->curves) {
    sonde_free(inverse);
    return sonde_fail_memory(error);
  }
  // A misfit beyond the standard deviation that was assumed widens all intervals.
  for (uint32_t c = 0; c < s->plan.curve_count; ++c) {
    uint32_t at[2];
    offsets_of(s, c, at);
    sonde_curve_fit *curve = &result->curves[result->curve_count++];
    *curve =
        (sonde_curve_fit){.site = s->sites->sites[s->plan.curve_site[c]].id, .count = s->used[c]};
    memcpy(curve->probe, s->plan.probe[s->plan.curve_probe[c]], sizeof curve->probe);
    if (at[0] < n) curve->zero_m = s->now.theta[at[0]];
    if (at[1] < n) curve->tare_n = s->now.theta[at[1]];
    s->offset[c][0] = curve->zero_m, s->offset[c][1] = curve->tare_n;
    result->row_count += s->used[c];
  }
  (void)cost_of(s, &s->now, &misfit);
  assemble(s, fmax(1, 2 * misfit / s->plan.curve_count));
  const bool definite = sonde_cholesky(s->matrix, n);
  if (definite) sonde_cholesky_invert(s->matrix, n, inverse);
  for (uint32_t k = 0; k < MODULI && definite; ++k) {
    double precision;
    (void)prior_of(s, k, &precision);
    const double sd = sqrt(inverse[(size_t)k * n + k]);
    result->certainty.ln_sd[k / 2][k % 2] = sd;
    result->certainty.measured[k / 2][k % 2] = sd * sd * precision < 0.25;
  }
  layers_of(s, s->now.theta, result->layer);
  sonde_free(inverse);
  if (!definite) return sonde_fail(error, SONDE_CONVERGENCE, "the moduli have no finite variance");
  return SONDE_OK;
}

sonde_status sonde_fit_solid(const sonde_model *model, const sonde_site_table *sites,
                             const sonde_measurements *measurements, const sonde_fit_solid_def *def,
                             const sonde_progress *progress, sonde_fit_solid_result *result,
                             double *fitted_n, sonde_error *error) {
  SONDE_ASSERT(fitted_n != NULL && model != NULL && sites != NULL && measurements != NULL &&
               def != NULL);
  *result = (sonde_fit_solid_result){0};
  search s = {.def = def, .sites = sites, .m = measurements, .model = model, .progress = progress};
  sonde_status status = open_search(&s, true, error);
  const uint32_t rows = s.plan.row_count;
  s.count = MODULI + s.plan.curve_count * (uint32_t)((def->zero_sd_m > 0) + (def->tare_sd_n > 0));
  s.matrix = SONDE_NEW(double, (size_t)s.count *s.count);
  s.gradient = SONDE_NEW(double, s.count);
  standing *both[2] = {&s.now, &s.trial};
  bool all = s.matrix && s.gradient;
  for (int k = 0; k < 2; ++k) {
    if (k == 0) both[k]->force_n = SONDE_NEW(double, rows);
    both[k]->theta = SONDE_NEW(double, s.count);
    both[k]->change = (double(*)[CHANGES])sonde_calloc(rows, sizeof *both[k]->change);
    both[k]->state = SONDE_NEW(sonde_vec3 *, rows);
    all &= both[k]->force_n && both[k]->theta && both[k]->change && both[k]->state;
  }
  if (!status && !all) status = sonde_fail_memory(error);
  snprintf(s.what, sizeof s.what, "pressing with the moduli at the start");
  const sonde_marquardt m = {.user = &s,
                             .linearise = linearise,
                             .propose = propose,
                             .evaluate = evaluate,
                             .accept = accept,
                             .stall = stall,
                             .damping = 1e-3,
                             .fall = 0.2,
                             .least = 1e-6,
                             .rise = 10,
                             .rise_least = 1e-2,
                             .most = 1e6,
                             .max_steps = def->max_steps,
                             .max_trials = 3 * def->max_steps};
  sonde_marquardt_result found;
  if (!status) status = sonde_marquardt_minimise(&m, &found, error);
  if (!status) status = conclude(&s, result, error);
  if (!status) {
    result->start_rms = s.start_rms, result->rms = rms_of(&s, &s.now);
    result->steps = found.steps, result->trials = found.trials, result->converged = found.converged;
  }
  for (uint32_t i = 0; i < measurements->count && !status; ++i) fitted_n[i] = NAN;
  for (uint32_t r = 0; r < rows && !status; ++r)
    fitted_n[s.plan.row[r]] = s.now.force_n[r] + s.offset[s.plan.row_curve[r]][1];
  close_search(&s);
  if (status) sonde_fit_solid_result_clear(result);
  return status;
}

sonde_status sonde_predict_solid(const sonde_model *model, const sonde_site_table *sites,
                                 const sonde_measurements *measurements,
                                 const sonde_fit_solid_def *def, const sonde_progress *progress,
                                 double *predicted_n, sonde_error *error) {
  SONDE_ASSERT(model != NULL && measurements != NULL && def != NULL && predicted_n != NULL);
  search s = {.def = def, .sites = sites, .m = measurements, .model = model, .progress = progress};
  sonde_status status = open_search(&s, false, error);
  snprintf(s.what, sizeof s.what, "predicting %u curves", s.plan.curve_count);
  const uint32_t workers = sonde_parallel_workers(def->threads, s.plan.curve_count);
  if (!status)
    status =
        sonde_parallel_run(s.plan.curve_count, workers, press_curve, &s, progress, s.what, error);
  for (uint32_t r = 0; r < s.plan.row_count && !status; ++r)
    predicted_n[s.plan.row[r]] = s.trial.force_n[r];
  close_search(&s);
  return status;
}

sonde_status sonde_measurements_select(const sonde_measurements *m, const sonde_site_table *sites,
                                       const uint32_t *site, uint32_t site_count, uint32_t depths,
                                       sonde_measurements *some, sonde_error *error) {
  SONDE_ASSERT(m != NULL && sites != NULL && some != NULL);
  sonde_fit_plan plan;
  *some = (sonde_measurements){0};
  sonde_status status = sonde_fit_plan_create_all(sites, m, &plan, error);
  if (!status) status = sonde_measurements_create(some, m->count, error);
  bool *wanted = SONDE_NEW(bool, sites->count);
  if (!status && !wanted) status = sonde_fail_memory(error);
  for (uint32_t k = 0; k < site_count && !status; ++k) {
    const uint32_t at = site ? sonde_site_find(sites, site[k]) : UINT32_MAX;
    bool measured = false;
    for (uint32_t c = 0; c < plan.curve_count && at != UINT32_MAX; ++c)
      measured |= plan.curve_site[c] == at;
    if (!measured)
      status = sonde_fail(error, SONDE_ARGUMENT, "site %u has no measurements", site[k]);
    if (measured) wanted[at] = true;
  }
  for (uint32_t c = 0; c < plan.curve_count && !status; ++c) {
    const uint32_t first = plan.curve_start[c], count = plan.curve_start[c + 1] - first;
    const uint32_t most = depths && depths < count ? depths : count;
    for (uint32_t k = 1; k <= most && (!site || wanted[plan.curve_site[c]]); ++k) {
      const uint32_t row = plan.row[first + count * k / most - 1], to = some->count++;
      some->data[to] = m->data[row];
      some->position_m[to] = m->position_m[row], some->normal[to] = m->normal[row];
      if (m->line) some->line[to] = m->line[row];
    }
  }
  sonde_free(wanted);
  sonde_fit_plan_clear(&plan);
  if (status) sonde_measurements_clear(some);
  return status;
}
