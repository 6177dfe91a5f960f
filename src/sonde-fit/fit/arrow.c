// sonde_loss: squares, Huber or Student-t of a residual and its weight.
// add_row: one residual into the normal equations.
// sonde_arrow_assemble: cost, and normal equations as blocks and border.
// invert_block / sonde_arrow_solve: damped step by the Schur complement of the border.
// hold_bounds: parameters that push against a bound do not move in this step.
// optimality: largest cosine between the residuals and a free column of the Jacobian.
// try_step: clamped trial point and its cost.
// sonde_arrow_minimise: Levenberg-Marquardt with Marquardt's scaling.
#include "fit/arrow.h"

#include "base/maths.h"

#include <string.h>

static const double STUDENT_NU = 3.0;
static const double LONGEST_STEP = 2.0; // in log parameters
static const double DAMPING_START = 1e-3, DAMPING_LEAST = 1e-12, DAMPING_MOST = 1e14;
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

static void add_row(const double jacobian[2 + ARROW_BORDER], double residual, double weight,
                    uint32_t border_count, sonde_arrow_block *block, sonde_arrow_border *normal) {
  const double *j = jacobian;
  block->h[0] += weight * j[0] * j[0];
  block->h[1] += weight * j[0] * j[1];
  block->h[2] += weight * j[1] * j[1];
  block->g[0] += weight * j[0] * residual;
  block->g[1] += weight * j[1] * residual;
  for (uint32_t k = 0; k < border_count; ++k) {
    block->c[0][k] += weight * j[0] * j[2 + k];
    block->c[1][k] += weight * j[1] * j[2 + k];
    normal->g[k] += weight * j[2 + k] * residual;
    for (uint32_t l = 0; l < border_count; ++l) normal->d[k][l] += weight * j[2 + k] * j[2 + l];
  }
}

double sonde_arrow_assemble(const sonde_arrow_problem *problem, const double (*theta)[2],
                            const double *border, sonde_arrow_block *blocks,
                            sonde_arrow_border *normal) {
  SONDE_ASSERT(problem->border_count <= ARROW_BORDER);
  SONDE_ASSERT(!blocks || normal);
  double cost = 0.0;
  if (normal) *normal = (sonde_arrow_border){0};
  for (uint32_t b = 0; b < problem->block_count; ++b) {
    SONDE_ASSERT(problem->row_start[b] <= problem->row_start[b + 1]);
    if (blocks) blocks[b] = (sonde_arrow_block){0};
    for (uint32_t r = problem->row_start[b]; r < problem->row_start[b + 1]; ++r) {
      double residual, weight, jacobian[2 + ARROW_BORDER] = {0};
      problem->row(problem->user, b, r, theta[b], border, &residual, jacobian);
      cost += sonde_loss(problem->loss, problem->loss_scale, residual, &weight);
      if (blocks) add_row(jacobian, residual, weight, problem->border_count, &blocks[b], normal);
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
static bool reduce(const sonde_arrow_block *blocks, uint32_t block_count, uint32_t border_count,
                   double damping, double s[ARROW_BORDER][ARROW_BORDER], double rhs[ARROW_BORDER]) {
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
static bool solve_border(const double s[ARROW_BORDER][ARROW_BORDER], const double *rhs,
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

bool sonde_arrow_solve(const sonde_arrow_block *blocks, uint32_t block_count,
                       const sonde_arrow_border *normal, uint32_t border_count, double damping,
                       double (*step)[2], double *border_step) {
  SONDE_ASSERT(border_count <= ARROW_BORDER && damping >= 0);
  double s[ARROW_BORDER][ARROW_BORDER] = {{0}}, rhs[ARROW_BORDER] = {0};
  for (uint32_t k = 0; k < border_count; ++k) {
    memcpy(s[k], normal->d[k], sizeof s[k]);
    s[k][k] *= 1.0 + damping;
    rhs[k] = -normal->g[k];
  }
  if (!reduce(blocks, block_count, border_count, damping, s, rhs)) return false;
  if (!solve_border((const double(*)[ARROW_BORDER])s, rhs, border_count, border_step)) return false;
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

static bool pushes(double value, double low, double high, double gradient) {
  return (value <= low && gradient > 0) || (value >= high && gradient < 0);
}

// Also holds parameters without any influence, whose column is zero.
static void hold_bounds(const sonde_arrow_problem *problem, const double (*theta)[2],
                        const double *border, sonde_arrow_block *blocks,
                        sonde_arrow_border *normal) {
  for (uint32_t b = 0; b < problem->block_count; ++b)
    for (int i = 0; i < 2; ++i) {
      sonde_arrow_block *block = &blocks[b];
      double *diagonal = &block->h[2 * i];
      if (*diagonal > 1e-200 &&
          !pushes(theta[b][i], problem->low[i], problem->high[i], block->g[i]))
        continue;
      *diagonal = 1.0;
      block->h[1] = block->g[i] = 0.0;
      memset(block->c[i], 0, sizeof block->c[i]);
    }
  for (uint32_t k = 0; k < problem->border_count; ++k) {
    if (normal->d[k][k] > 1e-200 &&
        !pushes(border[k], problem->border_low[k], problem->border_high[k], normal->g[k]))
      continue;
    for (uint32_t l = 0; l < ARROW_BORDER; ++l) normal->d[k][l] = normal->d[l][k] = 0.0;
    normal->d[k][k] = 1.0;
    normal->g[k] = 0.0;
    for (uint32_t b = 0; b < problem->block_count; ++b) blocks[b].c[0][k] = blocks[b].c[1][k] = 0.0;
  }
}

static double optimality(const sonde_arrow_problem *problem, const sonde_arrow_block *blocks,
                         const sonde_arrow_border *normal, double cost) {
  double largest = 0.0, length = sqrt(2.0 * cost);
  if (!(length > 0)) return 0.0;
  for (uint32_t b = 0; b < problem->block_count; ++b)
    for (int i = 0; i < 2; ++i)
      largest = fmax(largest, fabs(blocks[b].g[i]) / (sqrt(blocks[b].h[2 * i]) * length));
  for (uint32_t k = 0; k < problem->border_count; ++k)
    largest = fmax(largest, fabs(normal->g[k]) / (sqrt(normal->d[k][k]) * length));
  return largest;
}

// Work arrays of the minimisation.
typedef struct workspace {
  sonde_arrow_block *blocks;
  double (*step)[2], (*trial)[2];
  double border_step[ARROW_BORDER], border_trial[ARROW_BORDER];
  sonde_arrow_border normal;
} workspace;

static double limited(double value, double step, double low, double high) {
  SONDE_ASSERT(low <= high && isfinite(step));
  return clamp(value + clamp(step, -LONGEST_STEP, LONGEST_STEP), low, high);
}

// Moves to the clamped trial point; returns its cost and the largest move.
static double try_step(const sonde_arrow_problem *problem, const double (*theta)[2],
                       const double *border, workspace *w, double *longest) {
  *longest = 0.0;
  for (uint32_t b = 0; b < problem->block_count; ++b)
    for (int i = 0; i < 2; ++i) {
      w->trial[b][i] = limited(theta[b][i], w->step[b][i], problem->low[i], problem->high[i]);
      *longest = fmax(*longest, fabs(w->trial[b][i] - theta[b][i]));
    }
  for (uint32_t k = 0; k < problem->border_count; ++k) {
    w->border_trial[k] =
        limited(border[k], w->border_step[k], problem->border_low[k], problem->border_high[k]);
    *longest = fmax(*longest, fabs(w->border_trial[k] - border[k]));
  }
  return sonde_arrow_assemble(problem, (const double(*)[2])w->trial, w->border_trial, NULL, NULL);
}

static void border_variance(const sonde_arrow_problem *problem, const workspace *w,
                            sonde_arrow_result *result) {
  double s[ARROW_BORDER][ARROW_BORDER], rhs[ARROW_BORDER] = {0};
  memcpy(s, w->normal.d, sizeof s);
  if (!reduce(w->blocks, problem->block_count, problem->border_count, 0.0, s, rhs)) return;
  for (uint32_t k = 0; k < problem->border_count; ++k) {
    double unit[ARROW_BORDER] = {0}, column[ARROW_BORDER] = {0};
    unit[k] = 1.0;
    if (solve_border((const double(*)[ARROW_BORDER])s, unit, problem->border_count, column))
      result->border_variance[k] = column[k];
  }
}

// One iteration: damps until the cost falls. Returns false when the search is over.
static bool iterate(const sonde_arrow_problem *problem, double (*theta)[2], double *border,
                    workspace *w, double *damping, sonde_arrow_result *result) {
  for (; *damping < DAMPING_MOST; *damping *= 4.0) {
    if (!sonde_arrow_solve(w->blocks, problem->block_count, &w->normal, problem->border_count,
                           *damping, w->step, w->border_step))
      continue;
    double longest, cost = try_step(problem, (const double(*)[2])theta, border, w, &longest);
    if (cost < result->cost) {
      double fall = result->cost - cost;
      memcpy(theta, w->trial, problem->block_count * sizeof *theta);
      for (uint32_t k = 0; k < problem->border_count; ++k) border[k] = w->border_trial[k];
      result->cost = cost;
      *damping = fmax(*damping / 8.0, DAMPING_LEAST);
      if (fall <= 1e-16 * cost && longest < 1e-6) result->converged = true;
      return !result->converged;
    }
    if (longest < STEP_SMALL) {
      result->converged = true;
      return false;
    }
  }
  // No step along any damped direction lowers the cost: rounding hides what is left.
  result->converged = optimality(problem, w->blocks, &w->normal, result->cost) < STALLED_OPTIMALITY;
  return false;
}

static void minimise(const sonde_arrow_problem *problem, double (*theta)[2], double *border,
                     workspace *w, sonde_arrow_result *result) {
  double damping = DAMPING_START;
  for (bool going = true; going;) {
    result->cost =
        sonde_arrow_assemble(problem, (const double(*)[2])theta, border, w->blocks, &w->normal);
    if (!result->iterations) result->start_cost = result->cost;
    SONDE_ASSERT(isfinite(result->cost) && result->cost >= 0);
    hold_bounds(problem, (const double(*)[2])theta, border, w->blocks, &w->normal);
    if (optimality(problem, w->blocks, &w->normal, result->cost) < OPTIMALITY)
      result->converged = true;
    if (result->converged || result->iterations >= problem->max_iterations) break;
    double fraction = (double)result->iterations / problem->max_iterations;
    result->cancelled = !sonde_progress_report(problem->progress, fraction, "fitting");
    if (result->cancelled) break;
    ++result->iterations;
    going = iterate(problem, theta, border, w, &damping, result);
  }
  border_variance(problem, w, result);
}

sonde_status sonde_arrow_minimise(const sonde_arrow_problem *problem, double (*theta)[2],
                                  double *border, sonde_arrow_result *result, sonde_error *error) {
  SONDE_ASSERT(problem->row && problem->row_start && problem->block_count > 0);
  SONDE_ASSERT(problem->max_iterations > 0);
  *result = (sonde_arrow_result){0};
  workspace w = {.blocks = SONDE_NEW(sonde_arrow_block, problem->block_count),
                 .step = sonde_calloc(problem->block_count, sizeof *w.step),
                 .trial = sonde_calloc(problem->block_count, sizeof *w.trial)};
  sonde_status status = SONDE_OK;
  if (!w.blocks || !w.step || !w.trial)
    status = sonde_fail_memory(error);
  else
    minimise(problem, theta, border, &w, result);
  sonde_free(w.blocks);
  sonde_free(w.step);
  sonde_free(w.trial);
  return status;
}
