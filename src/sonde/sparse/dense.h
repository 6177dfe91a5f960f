// Dense symmetric systems, lower triangles in row order, products of matrices, and what the fronts
// of a multifrontal factor need. Every number is the same whatever the instruction set; products
// sum in the order of plain loops.
#ifndef SONDE_SRC_DENSE_H
#define SONDE_SRC_DENSE_H

#include "base/link.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// c[rows][columns] += or -= sum over k of weight[k] a(row, k) b[k][columns].
typedef struct sonde_product {
  double *c;
  size_t c_row; // step from row to row
  const double *a;
  size_t a_row, a_step; // steps from row to row, and along k
  const double *b;
  size_t b_row; // step along k
  uint32_t rows, columns, depth;
  const double *weight; // [depth]; NULL: all one
  bool subtract;
} sonde_product;
SONDE_LINK void sonde_multiply(const sonde_product *product);

// Numbers in a row of a factor of `own` columns: a multiple of 8.
static inline uint32_t sonde_front_width(uint32_t own) { return (own + 7) / 8 * 8; }

// Numbers from column to column of a front of order n: zero ones let vectors end behind the last
// row.
static inline size_t sonde_front_stride(uint32_t n) { return (size_t)n + 15; }

// For one instruction set. A front is a lower triangle by columns; what lies above it is nobody's.
// Its factor of `own`
// columns has rows of sonde_front_width(own), zero behind the used ones: L21 (`behind` rows), then
// L11 with its transpose above the diagonal and zero on it, then the inverse of the diagonal.
typedef struct sonde_dense_kernels {
  const char *name;
  void (*multiply)(const sonde_product *product);
  // Cholesky of the columns [from, to); what lies behind receives the Schur complement. False at a
  // pivot that is not positive.
  bool (*eliminate)(double *front, uint32_t n, uint32_t from, uint32_t to);
  // The same in single precision.
  bool (*eliminate_single)(float *front, uint32_t n, uint32_t from, uint32_t to);
  // x = L11^-1 right, then rest[behind] -= L21 x; right is scratch. Vectors of the width.
  void (*forward)(const float *factor, uint32_t own, uint32_t behind, float *right, float *x,
                  float *rest);
  // x = L11^-T (right - L21^T rest); right is scratch.
  void (*backward)(const float *factor, uint32_t own, uint32_t behind, float *right, float *x,
                   const float *rest);
} sonde_dense_kernels;

// With the first `own` columns of a front of order n that eliminate_single() has eliminated, on
// x[n], in place: x = L11^-1 x, the rest -= L21 x; then x = L11^-T (x - L21^T rest).
SONDE_LINK void sonde_front_forward(const float *front, uint32_t n, uint32_t own, double *x);
SONDE_LINK void sonde_front_backward(const float *front, uint32_t n, uint32_t own, double *x);

// The widest that this processor runs, or those called `name`; NULL: none of that name.
const sonde_dense_kernels *sonde_dense_kernels_find(const char *name);
extern const sonde_dense_kernels sonde_dense_kernels_base;
#ifdef __x86_64__
extern const sonde_dense_kernels sonde_dense_kernels_avx2, sonde_dense_kernels_avx512;
#endif

// Cholesky factor in the lower triangle of a [n * n], in place; the upper one is scratch. @return
// false: not positive definite
SONDE_LINK bool sonde_cholesky(double *a, uint32_t n);
// Solves L x = b in place.
void sonde_cholesky_forward(const double *factor, uint32_t n, double *x);
// Solves L L^T x = b in place.
SONDE_LINK void sonde_cholesky_solve(const double *factor, uint32_t n, double *x);
// The same for many right-hand sides x [n][columns].
SONDE_LINK void sonde_cholesky_forward_many(const double *factor, uint32_t n, double *x,
                                            uint32_t columns);
SONDE_LINK void sonde_cholesky_solve_many(const double *factor, uint32_t n, double *x,
                                          uint32_t columns);
// inverse [n * n] of L L^T, symmetric but for rounding.
SONDE_LINK void sonde_cholesky_invert(const double *factor, uint32_t n, double *inverse);
// Adds weight[k] row row^T of rows [count][n] to the lower triangle of a.
SONDE_LINK void sonde_add_outers(double *a, uint32_t n, const double *rows, uint32_t count,
                                 const double *weight);
// to [columns][rows] = from [rows][columns]
SONDE_LINK void sonde_transpose(const double *from, uint32_t rows, uint32_t columns, double *to);

#endif
