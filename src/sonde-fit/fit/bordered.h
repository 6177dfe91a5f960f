// Levenberg-Marquardt for blocks of two parameters that share a border of up to two.
#ifndef SONDE_SRC_FIT_BORDERED_H
#define SONDE_SRC_FIT_BORDERED_H

#include "base/base.h"
#include "sonde/fit.h"

enum { BORDER_MOST = 2 };

// Normal equations of one block: H (2x2: xx, xy, yy), gradient, coupling to the border.
typedef struct sonde_bordered_block {
  double h[3];
  double g[2];
  double c[2][BORDER_MOST];
} sonde_bordered_block;

// Normal equations of the border.
typedef struct sonde_bordered_border {
  double d[BORDER_MOST][BORDER_MOST];
  double g[BORDER_MOST];
} sonde_bordered_border;

// A least squares problem; row r of block b depends on that block's parameters and the border.
typedef struct sonde_bordered_problem {
  uint32_t block_count, border_count;
  const uint32_t *row_start; // [block_count + 1]
  // Weighted residual and its derivatives: jacobian[0..1] block, [2..3] border.
  void (*row)(const void *user, uint32_t block, uint32_t row, const double theta[2],
              const double *border, double *residual, double jacobian[2 + BORDER_MOST]);
  const void *user;
  double low[2], high[2]; // bounds of the block parameters
  double border_low[BORDER_MOST], border_high[BORDER_MOST];
  sonde_fit_loss loss;
  double loss_scale;
  uint32_t max_iterations;
  const sonde_progress *progress; // may be NULL
} sonde_bordered_problem;

typedef struct sonde_bordered_result {
  uint32_t iterations;
  bool converged, cancelled;
  double start_cost, cost;             // half the sum of the losses
  double border_variance[BORDER_MOST]; // diagonal of the inverse Schur complement at the end
} sonde_bordered_result;

// Loss of a residual (half of r^2 for squares) and its weight loss'(r)/r.
double sonde_loss(sonde_fit_loss loss, double scale, double residual, double *weight);

// Cost; fills the normal equations when blocks is not NULL.
double sonde_bordered_assemble(const sonde_bordered_problem *problem, const double (*theta)[2],
                               const double *border, sonde_bordered_block *blocks,
                               sonde_bordered_border *normal);

// Step of (H + damping diag H) d = -g. @return false when the matrix is not positive definite
bool sonde_bordered_solve(const sonde_bordered_block *blocks, uint32_t block_count,
                          const sonde_bordered_border *normal, uint32_t border_count,
                          double damping, double (*step)[2], double *border_step);

// Minimises from theta and border, in place.
sonde_status sonde_bordered_minimise(const sonde_bordered_problem *problem, double (*theta)[2],
                                     double *border, sonde_bordered_result *result,
                                     sonde_error *error);

#endif
