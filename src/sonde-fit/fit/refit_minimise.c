// Stage 3's Levenberg-Marquardt: on few depths first, then on all, where the smoothness is chosen.
#include "fit/marquardt.h"
#include "fit/refit_inside.h"
#include "fit/refit_offset.h"

#include "base/maths.h"

#include <string.h>

static const double SMOOTHNESS_START = 0.03;
static const double LONGEST_STEP = 0.7;   // of a logarithm
static const double NOTHING = 1e-5;       // fall of an exact fit
static const double SMALL_DAMPING = 1e-3; // a nearly full Gauss-Newton step
static const double FLAT = 2e-2;          // rise of the cost that rough equilibria may cause
enum { MOST_ITERATIONS = 40 };

// stride: every so many depths; enough: relative fall of the cost that is not worth a step; choose:
// the smoothness at its first point.
typedef struct stage {
  uint32_t stride;
  double damping, enough;
  bool choose;
} stage;
static const stage COARSE = {4, 1, 1e-2, false}, WHOLE = {1, 1e-3, 1e-4, false};

// Cost at theta with the trial's forces.
static double cost_of(const sonde_refit *r, sonde_refit_workspace *w, const double *theta) {
  return sonde_refit_add_rows(r, 0, w->rows, w->force_n, NULL, NULL) +
         sonde_refit_add_prior(r, theta, r->smoothness, w->line, NULL) + sonde_offsets_cost(r);
}

// A minimisation on some of the depths.
typedef struct search {
  sonde_refit *r;
  sonde_refit_workspace *w;
  double *theta, *force_n; // at the accepted point
  double cost, enough;     // there; relative fall that is not worth a step
  const sonde_progress *progress;
  uint32_t evaluation;
} search;

// Tells the caller about the iteration too.
static bool report_step(double fraction, const char *what, void *user) {
  const search *s = user;
  char text[96];
  snprintf(text, sizeof text, "%s, evaluation %u, cost %.0f", what, s->evaluation, s->cost);
  return sonde_progress_report(s->progress, fraction, text);
}

// Forces, derivatives and cost at the trial; infinite where an equilibrium is not found.
static sonde_status evaluate(void *user, double *cost, sonde_error *error) {
  search *s = user;
  sonde_refit_workspace *w = s->w;
  const sonde_progress inner = {report_step, s};
  s->evaluation++;
  sonde_status status = sonde_refit_forces(s->r, w->trial, w->force_n, w->jacobian, &inner, error);
  *cost = status ? INFINITY : cost_of(s->r, w, w->trial);
  return status == SONDE_CONVERGENCE ? SONDE_OK : status;
}

static void accept(void *user, double cost, double fall, bool *done) {
  (void)fall, (void)done;
  search *s = user;
  sonde_refit_workspace *w = s->w;
  memcpy(s->theta, w->trial, w->n * sizeof *s->theta);
  memcpy(s->force_n, w->force_n, w->rows * sizeof *s->force_n);
  double *swap = w->kept_jacobian;
  w->kept_jacobian = w->jacobian;
  w->jacobian = swap;
  sonde_offsets_accept(s->r);
  s->cost = cost;
}

// The accepted point is evaluated, or evaluated again.
static sonde_status start(search *s, sonde_error *error) {
  double cost;
  bool done;
  memcpy(s->w->trial, s->theta, s->w->n * sizeof *s->theta);
  sonde_status status = evaluate(s, &cost, error);
  if (!status && !isfinite(cost)) status = SONDE_CONVERGENCE; // error says where
  if (!status) accept(s, cost, 0, &done);
  return status;
}

static sonde_status linearise(void *user, double *cost, bool *done, sonde_error *error) {
  (void)done, (void)error;
  search *s = user;
  const sonde_refit *r = s->r;
  sonde_refit_workspace *w = s->w;
  sonde_normal *normal = &w->normal;
  sonde_normal_clear(normal);
  sonde_refit_add_rows(r, 0, w->rows, s->force_n, w->kept_jacobian, normal);
  sonde_refit_add_prior(r, s->theta, r->smoothness, w->line, normal);
  sonde_offsets_eliminate(s->r, s->force_n, w->kept_jacobian, normal);
  // A fixed parameter gets an equation of its own, whose solution is no step.
  for (uint32_t k = 0; r->fixed && k < w->n; ++k) {
    if (!r->fixed[k]) continue;
    for (uint32_t j = 0; j < w->n; ++j)
      normal->matrix[(size_t)(j < k ? k : j) * w->n + (j < k ? j : k)] = j == k;
    normal->gradient[k] = 0;
  }
  *cost = s->cost;
  return SONDE_OK;
}

static double fall_worth(const search *s, double cost) { return s->enough * cost + NOTHING; }

static bool propose(void *user, double damping, double cost, bool *done) {
  search *s = user;
  sonde_refit_workspace *w = s->w;
  if (!sonde_normal_solve(&w->normal, damping, w->factor, w->step)) return false;
  // How far the cost of the quadratic falls along the step of its damped equations.
  double promised = s->r->offsets ? s->r->offsets->fall : 0, longest = 0;
  for (uint32_t i = 0; i < w->n; ++i) {
    double diagonal = w->normal.matrix[(size_t)i * w->n + i];
    promised += 0.5 * w->step[i] * (damping * diagonal * w->step[i] - w->normal.gradient[i]);
    longest = fmax(longest, fabs(w->step[i]));
  }
  *done = damping <= SMALL_DAMPING && promised <= fall_worth(s, cost);
  if (*done) return true;
  double share = longest > LONGEST_STEP ? LONGEST_STEP / longest : 1;
  for (uint32_t i = 0; i < w->n; ++i) w->trial[i] = s->theta[i] + share * w->step[i];
  sonde_offsets_try(s->r, w->step, share);
  return true;
}

// Where the cost is flat, equilibria that are settled roughly make it rise along steps that would
// lower it: from there on they are exact, and the accepted point is evaluated again.
static sonde_status refuse(void *user, double damping, double cost, double rise, bool *done,
                           bool *renew, sonde_error *error) {
  search *s = user;
  sonde_offsets_return(s->r);
  *done = damping <= SMALL_DAMPING && rise <= fall_worth(s, cost);
  *renew = !*done && s->r->rough && rise <= FLAT * cost;
  if (!*renew) return SONDE_OK;
  s->r->rough = false;
  return start(s, error);
}

static bool stall(void *user, double cost) {
  (void)user, (void)cost;
  return false;
}

// From and to theta, on the depths of a stage.
static sonde_status descend(search *s, stage goal, sonde_refit_result *result, sonde_error *error) {
  bool first = s->evaluation == 0;
  s->r->stride = goal.stride;
  s->enough = goal.enough;
  sonde_status status = start(s, error);
  if (!status && goal.choose) {
    status = sonde_refit_choose_smoothness(s->r, s->w, s->theta, s->force_n, error);
    if (!status) s->cost = cost_of(s->r, s->w, s->theta);
  }
  if (status) return status;
  SONDE_ASSERT(s->r->def->max_iterations > 0 && result->iterations <= MOST_ITERATIONS);
  uint32_t limit = s->r->def->max_iterations < MOST_ITERATIONS ? s->r->def->max_iterations
                                                               : (uint32_t)MOST_ITERATIONS;
  const sonde_marquardt marquardt = {.user = s,
                                     .linearise = linearise,
                                     .propose = propose,
                                     .evaluate = evaluate,
                                     .accept = accept,
                                     .refuse = refuse,
                                     .stall = stall,
                                     .damping = goal.damping,
                                     .fall = 0.1,
                                     .least = 1e-9,
                                     .rise = 10,
                                     .rise_least = 1e-6,
                                     .most = 1e9,
                                     .max_steps = UINT32_MAX,
                                     .max_trials = limit - result->iterations};
  sonde_marquardt_result found;
  status = sonde_marquardt_minimise(&marquardt, &found, error);
  if (first) result->start_cost = found.start_cost;
  result->cost = found.cost;
  result->iterations += found.trials;
  result->converged = found.converged;
  return status;
}

// The way from a far start to the neighbourhood of the optimum needs few depths. The smoothness is
// then chosen on all of them, and the end found with it.
sonde_status sonde_refit_minimise(sonde_refit *r, double *theta, double *force_n,
                                  const sonde_progress *progress, sonde_refit_result *result,
                                  sonde_error *error) {
  *result = (sonde_refit_result){0};
  SONDE_ASSERT(r->plan->row_count > 0);
  sonde_refit_workspace w = {.n = sonde_refit_parameters(r), .rows = r->plan->row_count};
  search s = {.r = r, .w = &w, .theta = theta, .force_n = force_n, .progress = progress};
  bool given = r->def->smoothness_sd > 0;
  double start_sd = given ? r->def->smoothness_sd : SMOOTHNESS_START;
  double shear_sd =
      given && r->def->shear_smoothness_sd > 0 ? r->def->shear_smoothness_sd : start_sd;
  r->smoothness = (sonde_smoothness){start_sd, shear_sd};
  size_t n = w.n;
  w.force_n = SONDE_NEW(double, w.rows);
  w.jacobian = SONDE_NEW(double, w.rows *n);
  w.kept_jacobian = SONDE_NEW(double, w.rows *n);
  w.factor = SONDE_NEW(double, n *n);
  w.step = SONDE_NEW(double, n);
  w.trial = SONDE_NEW(double, n);
  w.line = SONDE_NEW(double, n);
  bool ok = sonde_normal_create(&w.normal, w.n) && w.force_n && w.jacobian && w.kept_jacobian &&
            w.factor && w.step && w.trial && w.line;
  sonde_status status = ok ? SONDE_OK : sonde_fail_memory(error);
  r->rough = true;
  if (!status && !r->near) status = descend(&s, COARSE, result, error);
  stage whole = WHOLE;
  whole.choose = !given;
  if (r->enough > 0) whole.enough = r->enough;
  if (!status) status = descend(&s, whole, result, error);
  r->rough = false;
  if (!status && r->curvature) sonde_normal_copy(&w.normal, r->curvature);
  if (!status && r->confidence) status = sonde_refit_confidence(r, &w, theta, force_n, error);
  sonde_free(w.force_n);
  sonde_free(w.jacobian);
  sonde_free(w.kept_jacobian);
  sonde_normal_free(&w.normal);
  sonde_free(w.factor);
  sonde_free(w.step);
  sonde_free(w.trial);
  sonde_free(w.line);
  return status;
}
