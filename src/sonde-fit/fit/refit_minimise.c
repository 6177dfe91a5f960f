// cost_of:   of measurements and smoothness.
// fix:       takes fixed parameters out of the normal equations.
// promised:  fall of the cost that a step promises.
// try_point: forces, derivatives and cost at a set of parameters.
// linearise: normal equations at the accepted point. accept: moves there.
// iterate:   Levenberg-Marquardt with Marquardt's scaling. descend: the same from its first point.
// sonde_refit_minimise: on few depths, then on all.
#include "fit/refit_inside.h"
#include "fit/refit_offset.h"

#include "base/maths.h"

#include <string.h>

static const double SMOOTHNESS_START = 0.03;
static const double LONGEST_STEP = 0.7;   // of a logarithm
static const double NOTHING = 1e-5;       // fall of an exact fit
static const double SMALL_DAMPING = 1e-3; // a nearly full Gauss-Newton step
static const double DAMPING_FALL = 0.1, DAMPING_LEAST = 1e-9, DAMPING_MOST = 1e9;
static const double FLAT = 2e-2; // rise of the cost that rough equilibria may cause
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

// A fixed parameter gets an equation of its own, whose solution is no step.
static void fix(const sonde_refit *r, sonde_normal *normal) {
  uint32_t n = normal->n;
  for (uint32_t k = 0; r->fixed && k < n; ++k) {
    if (!r->fixed[k]) continue;
    for (uint32_t j = 0; j < n; ++j)
      normal->matrix[(size_t)(j < k ? k : j) * n + (j < k ? j : k)] = j == k;
    normal->gradient[k] = 0;
  }
}

// How far the cost of the quadratic falls along the step of its damped equations.
static double promised(const sonde_refit *r, const sonde_refit_workspace *w, double damping) {
  double fall = r->offsets ? r->offsets->fall : 0;
  for (uint32_t i = 0; i < w->n; ++i) {
    double diagonal = w->normal.matrix[(size_t)i * w->n + i];
    fall += 0.5 * w->step[i] * (damping * diagonal * w->step[i] - w->normal.gradient[i]);
  }
  return fall;
}

static double longest(const double *x, uint32_t n) {
  double most = 0;
  for (uint32_t i = 0; i < n; ++i) most = fmax(most, fabs(x[i]));
  return most;
}

static bool allocate(sonde_refit_workspace *w) {
  size_t n = w->n;
  w->force_n = SONDE_NEW(double, w->rows);
  w->jacobian = SONDE_NEW(double, w->rows *n);
  w->kept_jacobian = SONDE_NEW(double, w->rows *n);
  w->factor = SONDE_NEW(double, n *n);
  w->step = SONDE_NEW(double, n);
  w->trial = SONDE_NEW(double, n);
  w->line = SONDE_NEW(double, n);
  return sonde_normal_create(&w->normal, w->n) && w->force_n && w->jacobian && w->kept_jacobian &&
         w->factor && w->step && w->trial && w->line;
}

static void release(sonde_refit_workspace *w) {
  sonde_free(w->force_n);
  sonde_free(w->jacobian);
  sonde_free(w->kept_jacobian);
  sonde_normal_free(&w->normal);
  sonde_free(w->factor);
  sonde_free(w->step);
  sonde_free(w->trial);
  sonde_free(w->line);
}

// Tells the caller about the iteration too.
typedef struct stepwise {
  const sonde_progress *outer;
  uint32_t evaluation;
  double cost;
} stepwise;

static bool report_step(double fraction, const char *what, void *user) {
  const stepwise *at = user;
  char text[96];
  snprintf(text, sizeof text, "%s, evaluation %u, cost %.0f", what, at->evaluation, at->cost);
  return sonde_progress_report(at->outer, fraction, text);
}

// Cost at the trial; infinite where an equilibrium is not found.
static sonde_status try_point(sonde_refit *r, sonde_refit_workspace *w, stepwise *at, double *cost,
                              sonde_error *error) {
  const sonde_progress inner = {report_step, at};
  at->evaluation++;
  sonde_status status = sonde_refit_forces(r, w->trial, w->force_n, w->jacobian, &inner, error);
  *cost = status ? INFINITY : cost_of(r, w, w->trial);
  return status == SONDE_CONVERGENCE ? SONDE_OK : status;
}

// The normal equations at the accepted point.
static void linearise(sonde_refit *r, sonde_refit_workspace *w, const double *theta,
                      const double *force_n) {
  sonde_normal_clear(&w->normal);
  sonde_refit_add_rows(r, 0, w->rows, force_n, w->kept_jacobian, &w->normal);
  sonde_refit_add_prior(r, theta, r->smoothness, w->line, &w->normal);
  sonde_offsets_eliminate(r, force_n, w->kept_jacobian, &w->normal);
  fix(r, &w->normal);
}

static void accept(sonde_refit *r, sonde_refit_workspace *w, double *theta, double *force_n) {
  memcpy(theta, w->trial, w->n * sizeof *theta);
  memcpy(force_n, w->force_n, w->rows * sizeof *force_n);
  double *swap = w->kept_jacobian;
  w->kept_jacobian = w->jacobian;
  w->jacobian = swap;
  sonde_offsets_accept(r);
  linearise(r, w, theta, force_n);
}

// Where the cost is flat, equilibria that are settled roughly make it rise along steps that would
// lower it: from there on they are exact, and the accepted point is evaluated again.
static sonde_status sharpen(sonde_refit *r, sonde_refit_workspace *w, double *theta,
                            double *force_n, stepwise *at, double *cost, sonde_error *error) {
  SONDE_ASSERT(r->rough && cost);
  r->rough = false;
  memcpy(w->trial, theta, w->n * sizeof *theta);
  sonde_status status = try_point(r, w, at, cost, error);
  if (!status && !isfinite(*cost)) status = SONDE_CONVERGENCE; // error says where
  if (!status) accept(r, w, theta, force_n);
  return status;
}

static sonde_status iterate(sonde_refit *r, sonde_refit_workspace *w, stage goal, double *theta,
                            double *force_n, stepwise *at, sonde_refit_result *result,
                            sonde_error *error) {
  double damping = goal.damping;
  SONDE_ASSERT(isfinite(result->cost) && r->def->max_iterations > 0);
  uint32_t limit =
      r->def->max_iterations < MOST_ITERATIONS ? r->def->max_iterations : (uint32_t)MOST_ITERATIONS;
  result->converged = false;
  while (result->iterations < limit && damping < DAMPING_MOST) {
    if (!sonde_normal_solve(&w->normal, damping, w->factor, w->step)) {
      damping *= 10;
      continue;
    }
    double size = longest(w->step, w->n), share = size > LONGEST_STEP ? LONGEST_STEP / size : 1;
    double enough = goal.enough * result->cost + NOTHING;
    result->converged = damping <= SMALL_DAMPING && promised(r, w, damping) <= enough;
    if (result->converged) break;
    for (uint32_t i = 0; i < w->n; ++i) w->trial[i] = theta[i] + share * w->step[i];
    sonde_offsets_try(r, w->step, share);
    double cost;
    sonde_status status = try_point(r, w, at, &cost, error);
    if (status) return status;
    result->iterations++;
    if (!(cost < result->cost)) {
      sonde_offsets_return(r);
      result->converged = damping <= SMALL_DAMPING && cost - result->cost <= enough;
      if (result->converged) break;
      if (r->rough && cost - result->cost <= FLAT * result->cost) {
        status = sharpen(r, w, theta, force_n, at, &result->cost, error);
        if (status) return status;
        continue;
      }
      damping = fmax(10 * damping, 1e-6);
      continue;
    }
    result->cost = at->cost = cost;
    accept(r, w, theta, force_n);
    damping = fmax(DAMPING_FALL * damping, DAMPING_LEAST);
  }
  return SONDE_OK;
}

// Levenberg-Marquardt on some depths, from and to theta.
static sonde_status descend(sonde_refit *r, sonde_refit_workspace *w, stage goal, double *theta,
                            double *force_n, stepwise *at, sonde_refit_result *result,
                            sonde_error *error) {
  bool first = at->evaluation == 0;
  r->stride = goal.stride;
  memcpy(w->trial, theta, w->n * sizeof *theta);
  sonde_status status = try_point(r, w, at, &result->cost, error);
  if (!status && !isfinite(result->cost)) status = SONDE_CONVERGENCE; // error says where
  if (status) return status;
  accept(r, w, theta, force_n);
  if (goal.choose) {
    status = sonde_refit_choose_smoothness(r, w, theta, force_n, error);
    if (status) return status;
    linearise(r, w, theta, force_n);
    result->cost = cost_of(r, w, theta);
  }
  at->cost = result->cost;
  if (first) result->start_cost = result->cost;
  return iterate(r, w, goal, theta, force_n, at, result, error);
}

// The way from a far start to the neighbourhood of the optimum needs few depths. The smoothness is
// then chosen on all of them, and the end found with it.
sonde_status sonde_refit_minimise(sonde_refit *r, double *theta, double *force_n,
                                  const sonde_progress *progress, sonde_refit_result *result,
                                  sonde_error *error) {
  *result = (sonde_refit_result){0};
  SONDE_ASSERT(r->plan->row_count > 0);
  sonde_refit_workspace w = {.n = sonde_refit_parameters(r), .rows = r->plan->row_count};
  stepwise at = {.outer = progress};
  bool given = r->def->smoothness_sd > 0;
  double start_sd = given ? r->def->smoothness_sd : SMOOTHNESS_START;
  double shear_sd =
      given && r->def->shear_smoothness_sd > 0 ? r->def->shear_smoothness_sd : start_sd;
  r->smoothness = (sonde_smoothness){start_sd, shear_sd};
  sonde_status status = allocate(&w) ? SONDE_OK : sonde_fail_memory(error);
  r->rough = true;
  if (!status && !r->near) status = descend(r, &w, COARSE, theta, force_n, &at, result, error);
  stage whole = WHOLE;
  whole.choose = !given;
  if (r->enough > 0) whole.enough = r->enough;
  if (!status) status = descend(r, &w, whole, theta, force_n, &at, result, error);
  r->rough = false;
  if (!status && r->curvature) sonde_normal_copy(&w.normal, r->curvature);
  if (!status && r->confidence) status = sonde_refit_confidence(r, &w, theta, force_n, error);
  release(&w);
  return status;
}
