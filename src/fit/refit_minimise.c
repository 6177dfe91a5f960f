// add_data / add_prior: cost and normal equations of measurements and of smoothness.
// solve:     Cholesky of the damped normal matrix.
// evaluate:  forces, derivatives and cost at a set of parameters.
// sonde_refit_minimise: Levenberg-Marquardt with Marquardt's scaling.
#include "fit/arrow.h"
#include "fit/dense.h"
#include "fit/refit_inside.h"

#include "base/maths.h"

#include <string.h>

static const double SMOOTHNESS_START = 0.03;
static const double LONGEST_STEP = 0.7;   // of a logarithm
static const double ENOUGH = 1e-3;        // relative fall of the cost that counts as none
static const double NOTHING = 1e-5;       // fall of an exact fit
static const double SMALL_DAMPING = 1e-3; // a nearly full Gauss-Newton step
static const double DAMPING_START = 0.1, DAMPING_LEAST = 1e-9, DAMPING_MOST = 1e9;
enum { MOST_ITERATIONS = 40, COARSE_STRIDE = 4 };

// Scale of a robust loss in newtons.
static double loss_scale(const sonde_refit *r, uint32_t row) {
  double mean_n = r->plan->mean_force_n[r->plan->row_probe[row]], scale = r->def->loss_scale;
  return r->def->weights == SONDE_WEIGHTS_RELATIVE ? scale * mean_n : scale;
}

static void add_row(workspace *w, const double *row, double residual, double weight) {
  sonde_add_outer(w->matrix, w->n, row, weight);
  for (uint32_t a = 0; a < w->n; ++a) w->gradient[a] += weight * row[a] * residual;
}

static double add_data(const sonde_refit *r, workspace *w, bool normal) {
  double cost = 0;
  for (uint32_t k = 0; k < w->rows; ++k) {
    if (!sonde_refit_uses(r, k)) continue;
    double sd_n = sonde_refit_sd_n(r, k), weight;
    double error_n = w->force_n[k] - r->m->data[r->plan->row[k]].force_n;
    cost += sonde_loss(r->def->loss, loss_scale(r, k) / sd_n, error_n / sd_n, &weight);
    if (normal) add_row(w, w->jacobian + (size_t)k * w->n, error_n, weight / (sd_n * sd_n));
  }
  return cost;
}

static double add_prior(const sonde_refit *r, workspace *w, const double *theta, bool normal) {
  uint32_t count = r->sites->count;
  double cost = 0, weight = 1 / (r->smoothness_sd * r->smoothness_sd);
  for (uint32_t field = 0; field < 2; ++field)
    for (uint32_t s = 0; s < count; ++s) {
      const double *rough = &r->roughness[(size_t)s * count];
      double residual = 0;
      for (uint32_t t = 0; t < count; ++t) residual += rough[t] * theta[field * count + t];
      cost += 0.5 * weight * residual * residual;
      if (!normal) continue;
      memset(w->scaled, 0, w->n * sizeof *w->scaled);
      memcpy(w->scaled + field * count, rough, count * sizeof *rough);
      add_row(w, w->scaled, residual, weight);
    }
  return cost;
}

// Forces and cost at theta; fills the normal equations, which the caller wants after acceptance.
static double assemble(const sonde_refit *r, workspace *w, const double *theta, bool normal) {
  if (normal) {
    memset(w->matrix, 0, (size_t)w->n * w->n * sizeof *w->matrix);
    memset(w->gradient, 0, w->n * sizeof *w->gradient);
  }
  double data = add_data(r, w, normal);
  return data + add_prior(r, w, theta, normal);
}

// Step of (H + damping diag H) d = -g by Cholesky in the lower triangle.
static bool solve(workspace *w, double damping) {
  uint32_t n = w->n;
  SONDE_ASSERT(n > 2 && damping >= 0);
  double *a = w->factor, *x = w->step;
  memcpy(a, w->matrix, (size_t)n * n * sizeof *a);
  for (uint32_t j = 0; j < n; ++j) a[(size_t)j * n + j] *= 1 + damping;
  if (!sonde_cholesky(a, n)) return false;
  for (uint32_t i = 0; i < n; ++i) x[i] = -w->gradient[i];
  sonde_cholesky_solve(a, n, x);
  return true;
}

static double longest(const double *x, uint32_t n) {
  double most = 0;
  for (uint32_t i = 0; i < n; ++i) most = fmax(most, fabs(x[i]));
  return most;
}

static bool allocate(workspace *w) {
  size_t n = w->n;
  w->force_n = SONDE_NEW(double, w->rows);
  w->jacobian = SONDE_NEW(double, w->rows *n);
  w->kept_jacobian = SONDE_NEW(double, w->rows *n);
  w->matrix = SONDE_NEW(double, n *n);
  w->factor = SONDE_NEW(double, n *n);
  w->gradient = SONDE_NEW(double, n);
  w->step = SONDE_NEW(double, n);
  w->trial = SONDE_NEW(double, n);
  w->scaled = SONDE_NEW(double, n);
  return w->force_n && w->jacobian && w->kept_jacobian && w->matrix && w->factor && w->gradient &&
         w->step && w->trial && w->scaled;
}

static void release(workspace *w) {
  sonde_free(w->force_n);
  sonde_free(w->jacobian);
  sonde_free(w->kept_jacobian);
  sonde_free(w->matrix);
  sonde_free(w->factor);
  sonde_free(w->gradient);
  sonde_free(w->step);
  sonde_free(w->trial);
  sonde_free(w->scaled);
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
static sonde_status try_point(sonde_refit *r, workspace *w, stepwise *at, double *cost,
                              sonde_error *error) {
  const sonde_progress inner = {report_step, at};
  at->evaluation++;
  sonde_status status = sonde_refit_forces(r, w->trial, w->force_n, w->jacobian, &inner, error);
  *cost = status ? INFINITY : assemble(r, w, w->trial, false);
  return status == SONDE_CONVERGENCE ? SONDE_OK : status;
}

static void accept(const sonde_refit *r, workspace *w, double *theta, double *force_n) {
  memcpy(theta, w->trial, w->n * sizeof *theta);
  memcpy(force_n, w->force_n, w->rows * sizeof *force_n);
  (void)assemble(r, w, theta, true);
  double *swap = w->kept_jacobian;
  w->kept_jacobian = w->jacobian;
  w->jacobian = swap;
}

static sonde_status iterate(sonde_refit *r, workspace *w, double *theta, double *force_n,
                            stepwise *at, sonde_refit_result *result, sonde_error *error) {
  double damping = DAMPING_START;
  SONDE_ASSERT(isfinite(result->cost) && r->def->max_iterations > 0);
  uint32_t limit =
      r->def->max_iterations < MOST_ITERATIONS ? r->def->max_iterations : (uint32_t)MOST_ITERATIONS;
  while (result->iterations < limit && damping < DAMPING_MOST) {
    if (!solve(w, damping)) {
      damping *= 10;
      continue;
    }
    double size = longest(w->step, w->n), share = size > LONGEST_STEP ? LONGEST_STEP / size : 1;
    for (uint32_t i = 0; i < w->n; ++i) w->trial[i] = theta[i] + share * w->step[i];
    double cost;
    sonde_status status = try_point(r, w, at, &cost, error);
    if (status) return status;
    result->iterations++;
    if (!(cost < result->cost)) {
      bool level = share >= 1 && damping <= SMALL_DAMPING &&
                   cost - result->cost <= ENOUGH * result->cost + NOTHING;
      result->converged = size < 1e-6 || level;
      if (result->converged) break;
      damping = fmax(10 * damping, 1e-6);
      continue;
    }
    double fall = result->cost - cost;
    result->cost = at->cost = cost;
    accept(r, w, theta, force_n);
    damping = fmax(0.1 * damping, DAMPING_LEAST);
    result->converged = share >= 1 && fall <= ENOUGH * cost + NOTHING;
    if (result->converged) break;
  }
  return SONDE_OK;
}

// Levenberg-Marquardt on every stride-th depth, from and to theta.
static sonde_status descend(sonde_refit *r, workspace *w, uint32_t stride, double *theta,
                            double *force_n, stepwise *at, sonde_refit_result *result,
                            sonde_error *error) {
  uint32_t before = result->iterations;
  r->stride = stride;
  memcpy(w->trial, theta, w->n * sizeof *theta);
  sonde_status status = try_point(r, w, at, &result->cost, error);
  if (!status && !isfinite(result->cost)) status = SONDE_CONVERGENCE; // error says where
  if (status) return status;
  accept(r, w, theta, force_n);
  at->cost = result->cost;
  if (!before) result->start_cost = result->cost;
  return iterate(r, w, theta, force_n, at, result, error);
}

// The way from the generic start to the neighbourhood of the optimum needs few depths. The
// smoothness is then chosen and the end found again with it.
sonde_status sonde_refit_minimise(sonde_refit *r, double *theta, double *force_n,
                                  const sonde_progress *progress, sonde_refit_result *result,
                                  sonde_error *error) {
  *result = (sonde_refit_result){0};
  SONDE_ASSERT(r->plan->row_count > 0);
  workspace w = {.n = sonde_refit_parameters(r), .rows = r->plan->row_count};
  stepwise at = {.outer = progress};
  bool given = r->def->smoothness_sd > 0;
  r->smoothness_sd = given ? r->def->smoothness_sd : SMOOTHNESS_START;
  sonde_status status = allocate(&w) ? SONDE_OK : sonde_fail_memory(error);
  r->rough = true;
  if (!status) status = descend(r, &w, COARSE_STRIDE, theta, force_n, &at, result, error);
  if (!status && !given) status = sonde_refit_choose_smoothness(r, &w, theta, force_n, error);
  if (!status) status = descend(r, &w, 1, theta, force_n, &at, result, error);
  r->rough = false;
  if (!status) {
    memcpy(w.trial, theta, w.n * sizeof *theta);
    status = try_point(r, &w, &at, &result->cost, error);
    if (!status) accept(r, &w, theta, force_n);
  }
  if (!status && r->confidence) status = sonde_refit_confidence(r, &w, theta, force_n, error);
  release(&w);
  return status;
}
