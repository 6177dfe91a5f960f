// Least squares over blocks of two parameters that share a border: losses, normal equations as
// blocks and border, damped steps by the Schur complement of the border, bounds.
#include "fit/bordered.h"
#include "fit/marquardt.h"

#include "base/maths.h"

#include <string.h>

static const double STUDENT_NU = 3.0;
static const double LONGEST_STEP = 2.0; // in log parameters
static const double OPTIMALITY = 1e-9, STALLED_OPTIMALITY = 1e-5, STEP_SMALL = 1e-13;

double sonde_loss(sonde_fit_loss loss, double scale, double residual, double *weight) {
  double size = fabs(residual);
  SONDE_ASSERT(loss == SONDE_LOSS_SQUARES || scale > 0);
  *weight = 1.0;
  switch (loss) {
  case SONDE_LOSS_SQUARES: break;
  case SONDE_LOSS_HUBER:
    if (size <= scale) break;
    *weight = scale / size;
    return scale * (size - 0.5 * scale);
  case SONDE_LOSS_STUDENT: {
    double ratio = residual * residual / (STUDENT_NU * scale * scale);
    *weight = (STUDENT_NU + 1.0) / STUDENT_NU / (1.0 + ratio);
    return 0.5 * (STUDENT_NU + 1.0) * scale * scale * log1p(ratio);
  }
  }
  return 0.5 * residual * residual;
}

double sonde_bordered_assemble(const sonde_bordered_problem *problem, const double (*theta)[2],
                               const double *border, sonde_bordered_block *blocks,
                               sonde_bordered_border *normal) {
  SONDE_ASSERT(problem->border_count <= BORDER_MOST);
  SONDE_ASSERT(!blocks || normal);
  double cost = 0.0;
  if (normal) *normal = (sonde_bordered_border){0};
  for (uint32_t b = 0; b < problem->block_count; ++b) {
    SONDE_ASSERT(problem->row_start[b] <= problem->row_start[b + 1]);
    if (blocks) blocks[b] = (sonde_bordered_block){0};
    for (uint32_t r = problem->row_start[b]; r < problem->row_start[b + 1]; ++r) {
      double residual, weight, jacobian[2 + BORDER_MOST] = {0};
      problem->row(problem->user, b, r, theta[b], border, &residual, jacobian);
      cost += sonde_loss(problem->loss, problem->loss_scale, residual, &weight);
      if (!blocks) continue;
      const double *j = jacobian;
      sonde_bordered_block *block = &blocks[b];
      block->h[0] += weight * j[0] * j[0];
      block->h[1] += weight * j[0] * j[1];
      block->h[2] += weight * j[1] * j[1];
      block->g[0] += weight * j[0] * residual;
      block->g[1] += weight * j[1] * residual;
      for (uint32_t k = 0; k < problem->border_count; ++k) {
        block->c[0][k] += weight * j[0] * j[2 + k];
        block->c[1][k] += weight * j[1] * j[2 + k];
        normal->g[k] += weight * j[2 + k] * residual;
        for (uint32_t l = 0; l < problem->border_count; ++l)
          normal->d[k][l] += weight * j[2 + k] * j[2 + l];
      }
    }
  }
  return cost;
}

// Inverse of the damped 2x2 block as xx, xy, yy.
static bool invert_block(const double h[3], double damping, double inverse[3]) {
  double a = h[0] * (1.0 + damping), c = h[2] * (1.0 + damping), b = h[1];
  double determinant = a * c - b * b;
  if (!(a > 0 && c > 0 && determinant > 1e-15 * a * c)) return false;
  inverse[0] = c / determinant;
  inverse[1] = -b / determinant;
  inverse[2] = a / determinant;
  return true;
}

static void multiply(const double m[3], const double x[2], double y[2]) {
  y[0] = m[0] * x[0] + m[1] * x[1];
  y[1] = m[1] * x[0] + m[2] * x[1];
}

// S = D - sum C^T H^-1 C and its right-hand side; H^-1 is kept in inverse.
static bool reduce(const sonde_bordered_block *blocks, uint32_t block_count, uint32_t border_count,
                   double damping, double s[BORDER_MOST][BORDER_MOST], double rhs[BORDER_MOST]) {
  for (uint32_t b = 0; b < block_count; ++b) {
    double inverse[3], hg[2];
    if (!invert_block(blocks[b].h, damping, inverse)) return false;
    multiply(inverse, blocks[b].g, hg);
    for (uint32_t k = 0; k < border_count; ++k) {
      const double column[2] = {blocks[b].c[0][k], blocks[b].c[1][k]};
      double hc[2];
      multiply(inverse, column, hc);
      rhs[k] += column[0] * hg[0] + column[1] * hg[1];
      for (uint32_t l = 0; l < border_count; ++l)
        s[k][l] -= hc[0] * blocks[b].c[0][l] + hc[1] * blocks[b].c[1][l];
    }
  }
  return true;
}

// Solves the border's system of 0, 1 or 2 unknowns.
static bool solve_border(const double s[BORDER_MOST][BORDER_MOST], const double *rhs,
                         uint32_t count, double *x) {
  if (count == 0) return true;
  if (!(s[0][0] > 0)) return false;
  if (count == 1) {
    x[0] = rhs[0] / s[0][0];
    return true;
  }
  double determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
  if (!(determinant > 1e-15 * s[0][0] * s[1][1])) return false;
  x[0] = (s[1][1] * rhs[0] - s[0][1] * rhs[1]) / determinant;
  x[1] = (s[0][0] * rhs[1] - s[1][0] * rhs[0]) / determinant;
  return true;
}

bool sonde_bordered_solve(const sonde_bordered_block *blocks, uint32_t block_count,
                          const sonde_bordered_border *normal, uint32_t border_count,
                          double damping, double (*step)[2], double *border_step) {
  SONDE_ASSERT(border_count <= BORDER_MOST && damping >= 0);
  double s[BORDER_MOST][BORDER_MOST] = {{0}}, rhs[BORDER_MOST] = {0};
  for (uint32_t k = 0; k < border_count; ++k) {
    memcpy(s[k], normal->d[k], sizeof s[k]);
    s[k][k] *= 1.0 + damping;
    rhs[k] = -normal->g[k];
  }
  if (!reduce(blocks, block_count, border_count, damping, s, rhs)) return false;
  if (!solve_border((const double(*)[BORDER_MOST])s, rhs, border_count, border_step)) return false;
  for (uint32_t b = 0; b < block_count; ++b) {
    double inverse[3] = {0}, right[2];
    if (!invert_block(blocks[b].h, damping, inverse)) return false;
    for (int i = 0; i < 2; ++i) {
      right[i] = -blocks[b].g[i];
      for (uint32_t k = 0; k < border_count; ++k) right[i] -= blocks[b].c[i][k] * border_step[k];
    }
    multiply(inverse, right, step[b]);
  }
  return true;
}

// ---- minimisation -------------------------------------------------------------------------

typedef struct search {
  const sonde_bordered_problem *problem;
  double (*theta)[2], *border;
  sonde_bordered_block *blocks;
  double (*step)[2], (*trial)[2];
  double border_step[BORDER_MOST], border_trial[BORDER_MOST];
  double longest; // of the trial's moves
  sonde_bordered_border normal;
} search;

static bool pushes(double value, double low, double high, double gradient) {
  return (value <= low && gradient > 0) || (value >= high && gradient < 0);
}

// Largest cosine between the residuals and a free column of the Jacobian.
static double optimality(const search *s, double cost) {
  double largest = 0.0, length = sqrt(2.0 * cost);
  if (!(length > 0)) return 0.0;
  for (uint32_t b = 0; b < s->problem->block_count; ++b)
    for (int i = 0; i < 2; ++i)
      largest = fmax(largest, fabs(s->blocks[b].g[i]) / (sqrt(s->blocks[b].h[2 * i]) * length));
  for (uint32_t k = 0; k < s->problem->border_count; ++k)
    largest = fmax(largest, fabs(s->normal.g[k]) / (sqrt(s->normal.d[k][k]) * length));
  return largest;
}

static sonde_status linearise(void *user, double *cost, bool *done, sonde_error *error) {
  (void)error;
  search *s = user;
  *cost = sonde_bordered_assemble(s->problem, (const double(*)[2])s->theta, s->border, s->blocks,
                                  &s->normal);
  // Takes parameters that push against a bound, or have no influence, out of the normal equations.
  const sonde_bordered_problem *problem = s->problem;
  for (uint32_t b = 0; b < problem->block_count; ++b)
    for (int i = 0; i < 2; ++i) {
      sonde_bordered_block *block = &s->blocks[b];
      double *diagonal = &block->h[2 * i];
      if (*diagonal > 1e-200 &&
          !pushes(s->theta[b][i], problem->low[i], problem->high[i], block->g[i]))
        continue;
      *diagonal = 1.0;
      block->h[1] = block->g[i] = 0.0;
      memset(block->c[i], 0, sizeof block->c[i]);
    }
  for (uint32_t k = 0; k < problem->border_count; ++k) {
    if (s->normal.d[k][k] > 1e-200 &&
        !pushes(s->border[k], problem->border_low[k], problem->border_high[k], s->normal.g[k]))
      continue;
    for (uint32_t l = 0; l < BORDER_MOST; ++l) s->normal.d[k][l] = s->normal.d[l][k] = 0.0;
    s->normal.d[k][k] = 1.0;
    s->normal.g[k] = 0.0;
    for (uint32_t b = 0; b < problem->block_count; ++b)
      s->blocks[b].c[0][k] = s->blocks[b].c[1][k] = 0.0;
  }
  *done = optimality(s, *cost) < OPTIMALITY;
  return SONDE_OK;
}

static double limited(double value, double step, double low, double high, double *longest) {
  SONDE_ASSERT(low <= high && isfinite(step));
  double to = clamp(value + clamp(step, -LONGEST_STEP, LONGEST_STEP), low, high);
  *longest = fmax(*longest, fabs(to - value));
  return to;
}

static bool propose(void *user, double damping, double cost, bool *done) {
  (void)cost, (void)done;
  search *s = user;
  const sonde_bordered_problem *p = s->problem;
  if (!sonde_bordered_solve(s->blocks, p->block_count, &s->normal, p->border_count, damping,
                            s->step, s->border_step))
    return false;
  s->longest = 0.0;
  for (uint32_t b = 0; b < p->block_count; ++b)
    for (int i = 0; i < 2; ++i)
      s->trial[b][i] = limited(s->theta[b][i], s->step[b][i], p->low[i], p->high[i], &s->longest);
  for (uint32_t k = 0; k < p->border_count; ++k)
    s->border_trial[k] =
        limited(s->border[k], s->border_step[k], p->border_low[k], p->border_high[k], &s->longest);
  return true;
}

static sonde_status evaluate(void *user, double *cost, sonde_error *error) {
  (void)error;
  search *s = user;
  *cost = sonde_bordered_assemble(s->problem, (const double(*)[2])s->trial, s->border_trial, NULL,
                                  NULL);
  return SONDE_OK;
}

static void accept(void *user, double cost, double fall, bool *done) {
  search *s = user;
  memcpy(s->theta, s->trial, s->problem->block_count * sizeof *s->theta);
  for (uint32_t k = 0; k < s->problem->border_count; ++k) s->border[k] = s->border_trial[k];
  *done = fall <= 1e-16 * cost && s->longest < 1e-6;
}

static sonde_status refuse(void *user, double damping, double cost, double rise, bool *done,
                           bool *renew, sonde_error *error) {
  (void)damping, (void)cost, (void)rise, (void)renew, (void)error;
  *done = ((const search *)user)->longest < STEP_SMALL;
  return SONDE_OK;
}

// No step along any damped direction lowers the cost: rounding hides the rest.
static bool stall(void *user, double cost) { return optimality(user, cost) < STALLED_OPTIMALITY; }

sonde_status sonde_bordered_minimise(const sonde_bordered_problem *problem, double (*theta)[2],
                                     double *border, sonde_bordered_result *result,
                                     sonde_error *error) {
  SONDE_ASSERT(problem->row && problem->row_start && problem->block_count > 0);
  SONDE_ASSERT(problem->max_iterations > 0);
  *result = (sonde_bordered_result){0};
  search s = {.problem = problem,
              .theta = theta,
              .border = border,
              .blocks = SONDE_NEW(sonde_bordered_block, problem->block_count),
              .step = sonde_calloc(problem->block_count, sizeof *s.step),
              .trial = sonde_calloc(problem->block_count, sizeof *s.trial)};
  const sonde_marquardt marquardt = {.user = &s,
                                     .linearise = linearise,
                                     .propose = propose,
                                     .evaluate = evaluate,
                                     .accept = accept,
                                     .refuse = refuse,
                                     .stall = stall,
                                     .damping = 1e-3,
                                     .fall = 0.125,
                                     .least = 1e-12,
                                     .rise = 4,
                                     .most = 1e14,
                                     .max_steps = problem->max_iterations,
                                     .max_trials = UINT32_MAX,
                                     .progress = problem->progress};
  sonde_marquardt_result found = {0};
  sonde_status status = s.blocks && s.step && s.trial
                            ? sonde_marquardt_minimise(&marquardt, &found, error)
                            : sonde_fail_memory(error);
  if (!status) {
    result->iterations = found.steps;
    result->converged = found.converged, result->cancelled = found.cancelled;
    result->start_cost = found.start_cost, result->cost = found.cost;
    // Variances of the border from the Schur complement at the end.
    double schur[BORDER_MOST][BORDER_MOST], rhs[BORDER_MOST] = {0};
    memcpy(schur, s.normal.d, sizeof schur);
    bool definite = reduce(s.blocks, problem->block_count, problem->border_count, 0.0, schur, rhs);
    for (uint32_t k = 0; k < problem->border_count && definite; ++k) {
      double unit[BORDER_MOST] = {0}, column[BORDER_MOST] = {0};
      unit[k] = 1.0;
      if (solve_border((const double(*)[BORDER_MOST])schur, unit, problem->border_count, column))
        result->border_variance[k] = column[k];
    }
  }
  sonde_free(s.blocks);
  sonde_free(s.step);
  sonde_free(s.trial);
  return status;
}
