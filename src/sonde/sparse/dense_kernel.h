// Kernels of dense.h for one instruction set, included once for each. Every operation is one IEEE
// operation per number, in an order that does not depend on the width: all sets, and plain loops,
// give the same bits.
//
// multiply            a product
// factor_block        up to four columns against each other
// subtract            product of columns with themselves
// eliminate           blocks of four columns, then the update
// forward, backward   triangular solves with one piece
#include "sparse/product_kernel.h"

#include "base/base.h"

#include <math.h>

typedef float eight __attribute__((vector_size(32), aligned(4), may_alias));

static void multiply(const sonde_product *p) {
  SONDE_ASSERT(p->c && p->a && p->b);
  if (p->weight)
    all(p, p->subtract, true);
  else if (p->subtract)
    all(p, true, false);
  else
    all(p, false, false);
}

// ---- elimination --------------------------------------------------------------------------

// Columns [from, to) against each other.
INLINE bool factor_block(double *columns, uint32_t from, uint32_t to, uint32_t rows) {
  for (uint32_t j = from; j < to; ++j) {
    double *cj = columns + (size_t)j * rows;
    for (uint32_t p = from; p < j; ++p) {
      const double *cp = columns + (size_t)p * rows;
      double l = cp[j];
      for (uint32_t i = from; i < rows; i += V) *(lot *)(cj + i) -= l * *(const lot *)(cp + i);
    }
    double pivot = cj[j];
    if (!(pivot > 0) || !isfinite(pivot)) return false;
    double inverse = 1 / sqrt(pivot);
    for (uint32_t i = from; i < rows; i += V) *(lot *)(cj + i) *= inverse;
    for (uint32_t i = from; i < j; ++i) cj[i] = 0;
    cj[j] = inverse;
  }
  return true;
}

// c[width][count] -= the first `width` rows of `depth` columns times the first `count` of them.
// Columns of c and `from` are c_row and `stride` numbers apart.
INLINE void subtract(double *c, size_t c_row, const double *from, size_t stride, uint32_t width,
                     uint32_t count, uint32_t depth) {
  const sonde_product product = {.c = c,
                                 .c_row = c_row,
                                 .a = from,
                                 .a_row = 1,
                                 .a_step = stride,
                                 .b = from,
                                 .b_row = stride,
                                 .rows = width,
                                 .columns = count,
                                 .depth = depth};
  all(&product, true, false);
}

static bool eliminate(double *columns, uint32_t own, uint32_t rows, double *update, uint32_t size) {
  SONDE_ASSERT(rows % 4 == 0 && size % 4 == 0 && own + size <= rows);
  for (uint32_t j = 0; j < own; j += 4) {
    uint32_t width = own - j < 4 ? own - j : 4;
    subtract(columns + (size_t)j * rows + j, rows, columns + j, rows, width, rows - j, j);
    if (!factor_block(columns, j, j + width, rows)) return false;
  }
  for (uint32_t j = 0; j < size; j += 4)
    subtract(update + (size_t)j * size + j, size, columns + own + j, rows, 4, size - j, own);
  return true;
}

// ---- solution -----------------------------------------------------------------------------

static void forward(const float *columns, uint32_t own, uint32_t rows, float *x) {
  SONDE_ASSERT(rows % 8 == 0);
  for (uint32_t k = 0; k < own; ++k, columns += rows) {
    float y = x[k] * columns[k];
    for (uint32_t i = k / 8 * 8; i < rows; i += 8)
      *(eight *)(x + i) -= y * *(const eight *)(columns + i);
    x[k] = y;
  }
}

static void backward(const float *columns, uint32_t own, uint32_t rows, float *x) {
  SONDE_ASSERT(rows % 8 == 0);
  for (uint32_t k = own; k-- > 0;) {
    const float *c = columns + (size_t)k * rows;
    float own_x = x[k];
    x[k] = 0; // what stands above the diagonal is zero
    eight sum = {0};
    for (uint32_t i = k / 8 * 8; i < rows; i += 8)
      sum += *(const eight *)(c + i) * *(const eight *)(x + i);
    float rest = ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
    x[k] = (own_x - rest) * c[k];
  }
}

const sonde_dense_kernels DENSE_KERNELS = {DENSE_NAME, multiply, eliminate, forward, backward};
