// Kernels of dense.h for one instruction set, included once for each. Every number is made by the
// same IEEE operations in the same order: all sets, and plain loops, give the same bits.
#include "base/base.h"
#include "base/vector.h"
#include "sparse/dense.h"
#include "sparse/dense_single.h"

#include <math.h>
#include <string.h>

enum { HIGH = 4, SUMS = 8 }; // the sums of a block stay in registers
// PAIRED columns of a panel are added up as a tree; MOST of them are taken in one go, for COLUMNS
// of what lies behind, in bands of rows that stay in the cache with their part of the panel.
enum { PAIRED = 8, MOST = 32, COLUMNS = 4, BAND = 96 };

// ---- products -----------------------------------------------------------------------------

// What a(row, k) counts in the sum.
INLINE double share(const sonde_product *p, const double *a, int row, uint32_t k, bool weighted) {
  double x = a[(size_t)row * p->a_row + k * p->a_step];
  return weighted ? p->weight[k] * x : x;
}

// `high` rows and DOUBLES `wide` columns of c.
INLINE void multiply_block(const sonde_product *p, double *c, const double *a, const double *b,
                           int high, int wide, bool subtract, bool weighted) {
  doubles sum[SUMS];
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < wide; ++w)
      sum[r * wide + w] = ((const doubles_near *)(c + (size_t)r * p->c_row))[w];
  for (uint32_t k = 0; k < p->depth; ++k, b += p->b_row)
    for (int r = 0; r < high; ++r) {
      double x = share(p, a, r, k, weighted);
      for (int w = 0; w < wide; ++w) {
        doubles part = x * ((const doubles_near *)b)[w];
        sum[r * wide + w] = subtract ? sum[r * wide + w] - part : sum[r * wide + w] + part;
      }
    }
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < wide; ++w)
      ((doubles_near *)(c + (size_t)r * p->c_row))[w] = sum[r * wide + w];
}

// `high` rows of c from one on: blocks, vectors, then single numbers.
INLINE void multiply_rows(const sonde_product *p, uint32_t row, int high, bool subtract,
                          bool weighted) {
  double *c = p->c + row * p->c_row;
  const double *a = p->a + row * p->a_row;
  uint32_t j = 0, wide = SUMS / (uint32_t)high;
  for (; j + DOUBLES * wide <= p->columns; j += DOUBLES * wide)
    multiply_block(p, c + j, a, p->b + j, high, (int)wide, subtract, weighted);
  for (; j + DOUBLES <= p->columns; j += DOUBLES)
    multiply_block(p, c + j, a, p->b + j, high, 1, subtract, weighted);
  for (; j < p->columns; ++j)
    for (int r = 0; r < high; ++r) {
      double sum = c[(size_t)r * p->c_row + j];
      for (uint32_t k = 0; k < p->depth; ++k) {
        double part = share(p, a, r, k, weighted) * p->b[k * p->b_row + j];
        sum = subtract ? sum - part : sum + part;
      }
      c[(size_t)r * p->c_row + j] = sum;
    }
}

INLINE void multiply_all(const sonde_product *p, bool subtract, bool weighted) {
  uint32_t i = 0;
  for (; i + HIGH <= p->rows; i += HIGH) multiply_rows(p, i, HIGH, subtract, weighted);
  for (; i < p->rows; ++i) multiply_rows(p, i, 1, subtract, weighted);
}

static void multiply(const sonde_product *p) {
  SONDE_ASSERT(p->c && p->a && p->b);
  if (p->weight)
    multiply_all(p, p->subtract, true);
  else if (p->subtract)
    multiply_all(p, true, false);
  else
    multiply_all(p, false, false);
}

// ---- elimination in a front ---------------------------------------------------------------

#define TREE(l, p)                                                                                 \
  ((((l)[0] * (p)[0] + (l)[1] * (p)[1]) + ((l)[2] * (p)[2] + (l)[3] * (p)[3])) +                   \
   (((l)[4] * (p)[4] + (l)[5] * (p)[5]) + ((l)[6] * (p)[6] + (l)[7] * (p)[7])))

// Columns [from, to) of the panel against each other, HIGH at a time. Vectors may reach into the
// zero rows behind the last one.
static bool factor_panel(double *front, size_t n, size_t stride, size_t from, size_t to) {
  for (size_t block = from; block < to; block += HIGH) {
    size_t end = to - block < HIGH ? to : block + HIGH;
    const double *first = front + from * stride + block;
    const sonde_product product = {.c = front + block * stride + block,
                                   .c_row = stride,
                                   .a = first,
                                   .a_row = 1,
                                   .a_step = stride,
                                   .b = first,
                                   .b_row = stride,
                                   .rows = (uint32_t)(end - block),
                                   .columns =
                                       (uint32_t)(n - block + DOUBLES - 1) / DOUBLES * DOUBLES,
                                   .depth = (uint32_t)(block - from)};
    multiply_all(&product, true, false);
    for (size_t j = block; j < end; ++j) {
      double *column = front + j * stride;
      for (size_t k = block; k < j; ++k) {
        const double *before = front + k * stride;
        double l = before[j];
        for (size_t i = j; i < n; i += DOUBLES)
          *(doubles_near *)(column + i) -= l * *(const doubles_near *)(before + i);
      }
      if (!(column[j] > 0) || !isfinite(column[j])) return false;
      double root = 1 / sqrt(column[j]);
      for (size_t i = j; i < n; i += DOUBLES) *(doubles_near *)(column + i) *= root;
    }
  }
  return true;
}

// What `count` columns of the panel leave in rows [first, end) of `columns` columns from j. Numbers
// above the diagonal that vectors meet are nobody's.
INLINE void update_columns(double *front, size_t stride, const double *panel, size_t count,
                           size_t j, size_t columns, size_t first, size_t end) {
  double shares[COLUMNS * MOST]; // of column c from c*MOST
  SONDE_ASSERT(count <= MOST);
  for (size_t k = 0; k < count; ++k)
    for (size_t c = 0; c < columns; ++c) shares[c * MOST + k] = panel[k * stride + j + c];
  for (size_t i = first < j ? first + (j - first) / DOUBLES * DOUBLES : first; i < end;
       i += DOUBLES) {
    const double *from = panel + i;
    doubles sum[COLUMNS], p[PAIRED];
    size_t k = 0;
    for (size_t c = 0; c < columns; ++c)
      sum[c] = *(const doubles_near *)(front + (j + c) * stride + i);
    for (; k + PAIRED <= count; k += PAIRED) {
      for (size_t q = 0; q < PAIRED; ++q) p[q] = *(const doubles_near *)(from + (k + q) * stride);
      for (size_t c = 0; c < columns; ++c) sum[c] -= TREE(shares + c * MOST + k, p);
    }
    for (; k < count; ++k)
      for (size_t c = 0; c < columns; ++c)
        sum[c] -= shares[c * MOST + k] * *(const doubles_near *)(from + k * stride);
    for (size_t c = 0; c < columns; ++c) *(doubles_near *)(front + (j + c) * stride + i) = sum[c];
  }
}

static bool eliminate(double *front, uint32_t order, uint32_t from, uint32_t to) {
  SONDE_ASSERT(front != NULL && from <= to && to <= order);
  size_t n = order, stride = sonde_front_stride(order);
  if (!factor_panel(front, n, stride, from, to)) return false;
  for (size_t part = from; part < to; part += MOST) {
    const double *panel = front + part * stride;
    size_t count = to - part < MOST ? to - part : MOST;
    for (size_t first = to; first < n; first += BAND) {
      size_t end = first + BAND < n ? first + BAND : n, j = to;
      for (; j + COLUMNS <= end; j += COLUMNS)
        update_columns(front, stride, panel, count, j, COLUMNS, first, end);
      for (; j < end; ++j) update_columns(front, stride, panel, count, j, 1, first, end);
    }
  }
  return true;
}

// ---- solution with the factor of a front --------------------------------------------------

// y[first..end) -= scale * row[first..end), in vectors of eight.
INLINE void subtract_row(float *y, const float *row, float scale, uint32_t first, uint32_t end) {
  for (uint32_t i = first / 8 * 8; i < end; i += 8)
    *(float_x8_near *)(y + i) -= scale * *(const float_x8_near *)(row + i);
}

#define MIXED(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)

// The sums of eight vectors.
INLINE float_x8 sum_each(const float_x8 a[8]) {
  float_x8 b[4], c[2];
  for (int i = 0; i < 4; ++i)
    b[i] = MIXED(a[2 * i], a[2 * i + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
           MIXED(a[2 * i], a[2 * i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  for (int i = 0; i < 2; ++i)
    c[i] = MIXED(b[2 * i], b[2 * i + 1], 0, 1, 8, 9, 4, 5, 12, 13) +
           MIXED(b[2 * i], b[2 * i + 1], 2, 3, 10, 11, 6, 7, 14, 15);
  return MIXED(c[0], c[1], 0, 1, 2, 3, 8, 9, 10, 11) +
         MIXED(c[0], c[1], 4, 5, 6, 7, 12, 13, 14, 15);
}

static void forward(const float *factor, uint32_t own, uint32_t behind, float *right, float *x,
                    float *rest) {
  const uint32_t width = sonde_front_width(own);
  const float *l11 = factor + (size_t)behind * width, *inverse = l11 + (size_t)own * width;
  SONDE_ASSERT(own > 0 && right != x);
  for (uint32_t k = 0; k < own; ++k) {
    x[k] = right[k] * inverse[k];
    subtract_row(right, l11 + (size_t)k * width, x[k], k, width); // right[..k] has been used
  }
  for (uint32_t k = own; k < width; ++k) x[k] = 0;
  for (uint32_t i = 0; i < behind; i += 8) {
    float_x8 sum[8] = {{0}};
    const float *row[8];
    for (uint32_t r = 0; r < 8; ++r)
      row[r] = factor + (size_t)(i + r < behind ? i + r : behind - 1) * width;
    for (uint32_t k = 0; k < width; k += 8)
      for (int r = 0; r < 8; ++r)
        sum[r] += *(const float_x8_near *)(row[r] + k) * *(const float_x8_near *)(x + k);
    float_x8 sums = sum_each(sum);
    for (uint32_t r = 0; r < 8 && i + r < behind; ++r) rest[i + r] -= sums[r];
  }
}

static void backward(const float *factor, uint32_t own, uint32_t behind, float *right, float *x,
                     const float *rest) {
  const uint32_t width = sonde_front_width(own);
  const float *l11 = factor + (size_t)behind * width, *inverse = l11 + (size_t)own * width;
  SONDE_ASSERT(own > 0 && right != x);
  uint32_t i = 0;
  for (; i + 4 <= behind; i += 4) {
    const float *row = factor + (size_t)i * width, *s = rest + i;
    for (uint32_t k = 0; k < width; k += 8) {
      float_x8 y = *(const float_x8_near *)(right + k);
      for (uint32_t r = 0; r < 4; ++r) y -= s[r] * *(const float_x8_near *)(row + r * width + k);
      *(float_x8_near *)(right + k) = y;
    }
  }
  for (; i < behind; ++i) subtract_row(right, factor + (size_t)i * width, rest[i], 0, width);
  for (uint32_t k = own; k-- > 0;) {
    x[k] = right[k] * inverse[k];
    subtract_row(right, l11 + (size_t)k * width, x[k], 0, k); // right[k..] has been used
  }
}

const sonde_dense_kernels DENSE_KERNELS = {DENSE_NAME,       multiply, eliminate,
                                           eliminate_single, forward,  backward};
