// Preconditioned conjugate gradients of any symmetric positive definite operator.
#ifndef SONDE_SRC_PCG_H
#define SONDE_SRC_PCG_H

#include "base/link.h"
#include "sonde/sparse.h"

// The operator and its preconditioner over vectors of `count` rows with `width` numbers each, 1 or
// 3. With a list only its rows take part; the operator leaves the others alone.
typedef struct sonde_operator {
  uint32_t count, width;
  const uint32_t *rows; // [count] NULL: all
  void (*multiply)(const void *user, const double *x, double *y);
  // Returns r.z, which sums the rows in their order.
  double (*precondition)(const void *user, const double *r, double *z);
  const void *user;
} sonde_operator;

// Four vectors.
typedef struct sonde_pcg_vectors {
  double *r, *z, *p, *q;
} sonde_pcg_vectors;

typedef struct sonde_pcg_goal {
  double relative, absolute; // ends at |r| <= the larger of relative |b| and absolute
  uint32_t max_iterations;
  bool from_zero; // x is zero
  bool foresee;   // also ends when the residual at its last pace will not get there
} sonde_pcg_goal;

// Sum over all numbers in their order. @thread any
SONDE_LINK double sonde_dot(const double *x, const double *y, uint32_t count);

// Solves A x = b by the iteration of Hestenes and Stiefel (1952) from x; b NULL is zero, and the
// goal then relative to the first residual. Sums run in the order of the rows.
// @thread any; no allocation
SONDE_LINK sonde_pcg_result sonde_pcg(const sonde_operator *a, const double *b, double *x,
                                      const sonde_pcg_vectors *vectors, const sonde_pcg_goal *goal);

#endif
