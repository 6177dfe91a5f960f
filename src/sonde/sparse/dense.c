// Dense symmetric systems by blocks of rows, whose products the vector kernels make.
#include "sparse/dense.h"

#include "base/base.h"
#include "base/vector.h"

#include <math.h>
#include <string.h>

enum { BLOCK = 16, STRIP = 32, SUMS = 8 };

const sonde_dense_kernels *sonde_dense_kernels_find(const char *name) {
  const sonde_dense_kernels *known[] = {
#ifdef __x86_64__
      &sonde_dense_kernels_avx512, &sonde_dense_kernels_avx2,
#endif
      &sonde_dense_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (sonde_vectors_serve(known[k]->name, name)) return known[k];
  return NULL;
}

void sonde_multiply(const sonde_product *product) {
  sonde_dense_kernels_find(NULL)->multiply(product);
}

void sonde_front_forward(const float *front, uint32_t n, uint32_t own, double *x) {
  SONDE_ASSERT(front != NULL && own <= n);
  for (size_t j = 0; j < own; ++j) {
    const float *column = front + j * sonde_front_stride(n);
    const double y = x[j] /= (double)column[j];
    for (size_t i = j + 1; i < n; ++i) x[i] -= (double)column[i] * y;
  }
}

void sonde_front_backward(const float *front, uint32_t n, uint32_t own, double *x) {
  SONDE_ASSERT(front != NULL && own <= n);
  for (size_t j = own; j-- > 0;) {
    const float *column = front + j * sonde_front_stride(n);
    double sum[SUMS] = {0};
    size_t i = j + 1;
    for (; i + SUMS <= n; i += SUMS)
      for (size_t k = 0; k < SUMS; ++k) sum[k] += (double)column[i + k] * x[i + k];
    for (; i < n; ++i) sum[0] += (double)column[i] * x[i];
    for (size_t k = 1; k < SUMS; ++k) sum[0] += sum[k];
    x[j] = (x[j] - sum[0]) / (double)column[j];
  }
}

static void mirror(double *a, uint32_t n, bool to_upper) {
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < i; ++j)
      if (to_upper)
        a[(size_t)j * n + i] = a[(size_t)i * n + j];
      else
        a[(size_t)i * n + j] = a[(size_t)j * n + i];
}

bool sonde_cholesky(double *a, uint32_t n) {
  SONDE_ASSERT(n > 0);
  mirror(a, n, true);
  for (uint32_t i = 0; i < n; i += BLOCK) {
    uint32_t end = n - i < BLOCK ? n : i + BLOCK;
    const sonde_product product = {.c = a + (size_t)i * n + i,
                                   .c_row = n,
                                   .a = a + i,
                                   .a_row = 1,
                                   .a_step = n,
                                   .b = a + i,
                                   .b_row = n,
                                   .rows = end - i,
                                   .columns = n - i,
                                   .depth = i,
                                   .subtract = true};
    sonde_multiply(&product);
    // Rows of the block against each other; all earlier ones have been taken from them.
    for (uint32_t r = i; r < end; ++r) {
      double *row = a + (size_t)r * n;
      for (uint32_t k = i; k < r; ++k) {
        const double *above = a + (size_t)k * n;
        double l = above[r];
        for (uint32_t j = r; j < n; ++j) row[j] -= l * above[j];
      }
      if (!(row[r] > 0)) return false;
      double root = row[r] = sqrt(row[r]);
      for (uint32_t j = r + 1; j < n; ++j) row[j] /= root;
    }
  }
  mirror(a, n, false);
  return true;
}

void sonde_cholesky_forward(const double *factor, uint32_t n, double *x) {
  SONDE_ASSERT(n > 0);
  for (uint32_t i = 0; i < n; ++i) {
    double sum = x[i];
    for (uint32_t k = 0; k < i; ++k) sum -= factor[(size_t)i * n + k] * x[k];
    x[i] = sum / factor[(size_t)i * n + i];
  }
}

void sonde_cholesky_solve(const double *factor, uint32_t n, double *x) {
  sonde_cholesky_forward(factor, n, x);
  for (uint32_t i = n; i-- > 0;) {
    double sum = x[i];
    for (uint32_t k = i + 1; k < n; ++k) sum -= factor[(size_t)k * n + i] * x[k];
    x[i] = sum / factor[(size_t)i * n + i];
  }
}

// x[i] -= sum over rows [from, to) of the coefficient times x[k]; along rows of L or of L^T.
static void subtract_rows(const double *factor, uint32_t n, double *x, uint32_t columns, uint32_t i,
                          uint32_t end, uint32_t from, uint32_t to, bool transposed) {
  size_t row = transposed ? 1 : n, step = transposed ? n : 1;
  const sonde_product product = {.c = x + (size_t)i * columns,
                                 .c_row = columns,
                                 .a = factor + i * row + from * step,
                                 .a_row = row,
                                 .a_step = step,
                                 .b = x + (size_t)from * columns,
                                 .b_row = columns,
                                 .rows = end - i,
                                 .columns = columns,
                                 .depth = to - from,
                                 .subtract = true};
  sonde_multiply(&product);
}

static void divide_row(double *x, uint32_t columns, double by) {
  for (uint32_t c = 0; c < columns; ++c) x[c] /= by;
}

void sonde_cholesky_forward_many(const double *factor, uint32_t n, double *x, uint32_t columns) {
  SONDE_ASSERT(n > 0 && columns > 0);
  for (uint32_t i = 0; i < n; i += BLOCK) {
    uint32_t end = n - i < BLOCK ? n : i + BLOCK;
    subtract_rows(factor, n, x, columns, i, end, 0, i, false);
    for (uint32_t k = i; k < end; ++k) {
      subtract_rows(factor, n, x, columns, k, k + 1, i, k, false);
      divide_row(x + (size_t)k * columns, columns, factor[(size_t)k * n + k]);
    }
  }
}

void sonde_cholesky_solve_many(const double *factor, uint32_t n, double *x, uint32_t columns) {
  sonde_cholesky_forward_many(factor, n, x, columns);
  for (uint32_t k = n; k-- > 0;) {
    subtract_rows(factor, n, x, columns, k, k + 1, k + 1, n, true);
    divide_row(x + (size_t)k * columns, columns, factor[(size_t)k * n + k]);
  }
}

void sonde_cholesky_invert(const double *factor, uint32_t n, double *inverse) {
  SONDE_ASSERT(n > 0 && factor != inverse);
  memset(inverse, 0, (size_t)n * n * sizeof *inverse);
  // Row i of L^-1 ends at column i.
  for (uint32_t i = 0; i < n; ++i) {
    const sonde_product product = {.c = inverse + (size_t)i * n,
                                   .c_row = n,
                                   .a = factor + (size_t)i * n,
                                   .a_row = n,
                                   .a_step = 1,
                                   .b = inverse,
                                   .b_row = n,
                                   .rows = 1,
                                   .columns = i,
                                   .depth = i,
                                   .subtract = true};
    inverse[(size_t)i * n + i] = 1;
    sonde_multiply(&product);
    divide_row(inverse + (size_t)i * n, i + 1, factor[(size_t)i * n + i]);
  }
  for (uint32_t i = n; i-- > 0;) {
    subtract_rows(factor, n, inverse, n, i, i + 1, i + 1, n, true);
    divide_row(inverse + (size_t)i * n, n, factor[(size_t)i * n + i]);
  }
}

void sonde_add_outers(double *a, uint32_t n, const double *rows, uint32_t count,
                      const double *weight) {
  SONDE_ASSERT(n > 0);
  for (uint32_t i = 0; i < n; i += STRIP) {
    uint32_t end = n - i < STRIP ? n : i + STRIP;
    const sonde_product product = {.c = a + (size_t)i * n,
                                   .c_row = n,
                                   .a = rows + i,
                                   .a_row = 1,
                                   .a_step = n,
                                   .b = rows,
                                   .b_row = n,
                                   .rows = end - i,
                                   .columns = end,
                                   .depth = count,
                                   .weight = weight};
    sonde_multiply(&product);
  }
}

void sonde_transpose(const double *from, uint32_t rows, uint32_t columns, double *to) {
  for (uint32_t i = 0; i < rows; ++i)
    for (uint32_t j = 0; j < columns; ++j) to[(size_t)j * rows + i] = from[(size_t)i * columns + j];
}
