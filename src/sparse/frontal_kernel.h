// Kernels of frontal.h for one instruction set, included once for each. Every operation is one IEEE
// operation per number, in an order that does not depend on the width: all sets give the same bits.
//
// subtract:   a block of up to four columns minus a product of earlier ones
// eliminate:  blocks of four columns, then the update
// forward, backward: triangular solves with one piece
#include "sparse/frontal.h"

#include "base/base.h"

#include <math.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
typedef double four __attribute__((vector_size(32)));

INLINE four load(const double *from) {
  four v;
  memcpy(&v, from, sizeof v);
  return v;
}

INLINE void store(double *to, four v) { memcpy(to, &v, sizeof v); }

typedef float eight __attribute__((vector_size(32)));

INLINE eight load_eight(const float *from) {
  eight v;
  memcpy(&v, from, sizeof v);
  return v;
}

INLINE void store_eight(float *to, eight v) { memcpy(to, &v, sizeof v); }

// c[4 rows * high][width] -= a[rows][depth] b[width][depth]^T, all by columns of length `stride`
// (c: c_stride).
INLINE void subtract_block(double *c, size_t c_stride, const double *a, const double *b,
                           size_t stride, uint32_t depth, int high, int width) {
  four sum[2][4];
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < width; ++w) sum[r][w] = load(c + (size_t)w * c_stride + 4 * r);
  for (uint32_t k = 0; k < depth; ++k, a += stride, b += stride)
    for (int r = 0; r < high; ++r) {
      four x = load(a + 4 * r);
      for (int w = 0; w < width; ++w) sum[r][w] -= x * b[w];
    }
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < width; ++w) store(c + (size_t)w * c_stride + 4 * r, sum[r][w]);
}

#ifdef __AVX2__
enum { HIGH = 2 };
#else
enum { HIGH = 1 };
#endif

INLINE void subtract(double *c, size_t c_stride, const double *a, const double *b, size_t stride,
                     uint32_t rows, uint32_t depth, int width) {
  uint32_t i = 0;
  for (; i + 4 * HIGH <= rows; i += 4 * HIGH)
    subtract_block(c + i, c_stride, a + i, b, stride, depth, HIGH, width);
  for (; i < rows; i += 4) subtract_block(c + i, c_stride, a + i, b, stride, depth, 1, width);
}

// Columns [from, to) against each other.
INLINE bool factor_block(double *columns, uint32_t from, uint32_t to, uint32_t rows) {
  for (uint32_t j = from; j < to; ++j) {
    double *cj = columns + (size_t)j * rows;
    for (uint32_t p = from; p < j; ++p) {
      const double *cp = columns + (size_t)p * rows;
      double l = cp[j];
      for (uint32_t i = from; i < rows; i += 4) store(cj + i, load(cj + i) - l * load(cp + i));
    }
    double pivot = cj[j];
    if (!(pivot > 0) || !isfinite(pivot)) return false;
    double inverse = 1 / sqrt(pivot);
    for (uint32_t i = from; i < rows; i += 4) store(cj + i, load(cj + i) * inverse);
    for (uint32_t i = from; i < j; ++i) cj[i] = 0;
    cj[j] = inverse;
  }
  return true;
}

static bool eliminate(double *columns, uint32_t own, uint32_t rows, double *update, uint32_t size) {
  SONDE_ASSERT(rows % 4 == 0 && size % 4 == 0 && own + size <= rows);
  for (uint32_t j = 0; j < own; j += 4) {
    double *to = columns + (size_t)j * rows + j;
    if (own - j >= 4)
      subtract(to, rows, columns + j, columns + j, rows, rows - j, j, 4);
    else
      for (uint32_t w = 0; w < own - j; ++w)
        subtract(to + (size_t)w * rows, rows, columns + j, columns + j + w, rows, rows - j, j, 1);
    if (!factor_block(columns, j, own - j < 4 ? own : j + 4, rows)) return false;
  }
  for (uint32_t j = 0; j < size; j += 4)
    subtract(update + (size_t)j * size + j, size, columns + own + j, columns + own + j, rows,
             size - j, own, 4);
  return true;
}

static void forward(const float *columns, uint32_t own, uint32_t rows, float *x) {
  SONDE_ASSERT(rows % 8 == 0);
  for (uint32_t k = 0; k < own; ++k, columns += rows) {
    float y = x[k] * columns[k];
    for (uint32_t i = k / 8 * 8; i < rows; i += 8)
      store_eight(x + i, load_eight(x + i) - y * load_eight(columns + i));
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
    for (uint32_t i = k / 8 * 8; i < rows; i += 8) sum += load_eight(c + i) * load_eight(x + i);
    float rest = ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
    x[k] = (own_x - rest) * c[k];
  }
}

const sonde_frontal_kernels FRONTAL_KERNELS = {FRONTAL_NAME, eliminate, forward, backward};
