// Dense symmetric systems, lower triangles in row order, and products of matrices. Every number is
// summed in the order of plain loops.
#ifndef SONDE_SRC_FIT_DENSE_H
#define SONDE_SRC_FIT_DENSE_H

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
void sonde_multiply(const sonde_product *product);

typedef struct sonde_dense_kernels {
  const char *name;
  void (*multiply)(const sonde_product *product);
} sonde_dense_kernels;
extern const sonde_dense_kernels sonde_dense_kernels_base, sonde_dense_kernels_avx2;

// Cholesky factor in the lower triangle of a [n * n], in place; the upper one is scratch. @return
// false: not positive definite
bool sonde_cholesky(double *a, uint32_t n);
// Solves L x = b in place.
void sonde_cholesky_forward(const double *factor, uint32_t n, double *x);
// Solves L L^T x = b in place.
void sonde_cholesky_solve(const double *factor, uint32_t n, double *x);
// The same for many right-hand sides x [n][columns].
void sonde_cholesky_forward_many(const double *factor, uint32_t n, double *x, uint32_t columns);
void sonde_cholesky_solve_many(const double *factor, uint32_t n, double *x, uint32_t columns);
// Adds weight[k] row row^T of rows [count][n] to the lower triangle of a.
void sonde_add_outers(double *a, uint32_t n, const double *rows, uint32_t count,
                      const double *weight);
// to [columns][rows] = from [rows][columns]
void sonde_transpose(const double *from, uint32_t rows, uint32_t columns, double *to);

#endif
