// Dense symmetric systems, lower triangles in row order, products of matrices, and what the pieces
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

// For one instruction set. Columns of a piece: `own` of them with `rows` numbers each, the triangle
// at the top; rows are a multiple of 8, those behind the last used one zero.
typedef struct sonde_dense_kernels {
  const char *name;
  void (*multiply)(const sonde_product *product);
  // Factors the columns and subtracts their product from the update [size x size], lower triangle
  // by columns, size a multiple of 4; the diagonal receives its inverse, what is above it zero.
  // False: a pivot is not positive.
  bool (*eliminate)(double *columns, uint32_t own, uint32_t rows, double *update, uint32_t size);
  // Triangular solves with such columns, x [rows].
  void (*forward)(const float *columns, uint32_t own, uint32_t rows, float *x);
  void (*backward)(const float *columns, uint32_t own, uint32_t rows, float *x);
} sonde_dense_kernels;

// The widest that this processor runs, or those called `name`; NULL: none of that name.
const sonde_dense_kernels *sonde_dense_kernels_find(const char *name);
extern const sonde_dense_kernels sonde_dense_kernels_base;
#ifdef __x86_64__
extern const sonde_dense_kernels sonde_dense_kernels_avx2;
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
// Adds weight[k] row row^T of rows [count][n] to the lower triangle of a.
SONDE_LINK void sonde_add_outers(double *a, uint32_t n, const double *rows, uint32_t count,
                                 const double *weight);
// to [columns][rows] = from [rows][columns]
SONDE_LINK void sonde_transpose(const double *from, uint32_t rows, uint32_t columns, double *to);

#endif
