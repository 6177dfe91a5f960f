// Kernels of the multifrontal factor; fronts_*_hot.c include this file once per instruction set.
// Every entry is made by the same operations in the same order: all sets give the same bits.
//
// reduce          rows times shares from a row
// factor_panel    columns of the panel against each other
// trail           what the panel leaves in four columns, or one, behind it
// trail_rows      the same for a band of rows that stays in the cache with its part of the panel
// eliminate       one panel
// subtract        one row of the backward pass
// invert          a symmetric matrix, all columns of the unit matrix at once
#include "base/base.h"
#include "sparse/fronts.h"
#include "sparse/product_kernel.h"

#include <math.h>
#include <string.h>

// WIDTH columns of the panel are added up as a tree; MOST of them are taken in one go.
enum { WIDTH = 8, MOST = 32, COLUMNS = 4, BAND = 96 };

// to[width] -= sum over k < count of share[k * share_step] from[k * step].
static void reduce(double *to, size_t width, const double *from, size_t step, const double *share,
                   size_t share_step, size_t count) {
  const sonde_product product = {.c = to,
                                 .a = share,
                                 .a_step = share_step,
                                 .b = from,
                                 .b_row = step,
                                 .rows = 1,
                                 .columns = (uint32_t)width,
                                 .depth = (uint32_t)count};
  strip(&product, 0, 1, true, false);
}

// ---- elimination --------------------------------------------------------------------------

static bool factor_panel(double *f, size_t n, size_t from, size_t to) {
  for (size_t j = from; j < to; ++j) {
    double *column = f + j * n;
    const double *first = f + from * n + j;
    reduce(column + j, n - j, first, n, first, n, j - from);
    if (!(column[j] > 0) || !isfinite(column[j])) return false;
    double root = 1 / sqrt(column[j]);
    for (size_t i = j; i < n; ++i) column[i] *= root;
  }
  return true;
}

#define TREE(l, p)                                                                                 \
  ((((l)[0] * (p)[0] + (l)[1] * (p)[1]) + ((l)[2] * (p)[2] + (l)[3] * (p)[3])) +                   \
   (((l)[4] * (p)[4] + (l)[5] * (p)[5]) + ((l)[6] * (p)[6] + (l)[7] * (p)[7])))

// Rows i .. of `columns` columns from f[j*n]; `panel` is row i of the panel's first column.
INLINE void trail(double *f, size_t n, const double *panel, size_t count, size_t j, size_t i,
                  const double *share, size_t columns) {
  lot sum[COLUMNS], p[WIDTH];
  size_t k = 0;
  for (size_t c = 0; c < columns; ++c) sum[c] = *(const lot *)(f + (j + c) * n + i);
  for (; k + WIDTH <= count; k += WIDTH) {
    for (size_t q = 0; q < WIDTH; ++q) p[q] = *(const lot *)(panel + (k + q) * n);
    for (size_t c = 0; c < columns; ++c) sum[c] -= TREE(share + c * MOST + k, p);
  }
  for (; k < count; ++k)
    for (size_t c = 0; c < columns; ++c)
      sum[c] -= share[c * MOST + k] * *(const lot *)(panel + k * n);
  for (size_t c = 0; c < columns; ++c) *(lot *)(f + (j + c) * n + i) = sum[c];
}

INLINE double trail_one(double value, size_t n, const double *panel, size_t count,
                        const double *share) {
  double p[WIDTH];
  size_t k = 0;
  for (; k + WIDTH <= count; k += WIDTH) {
    for (size_t q = 0; q < WIDTH; ++q) p[q] = panel[(k + q) * n];
    value -= TREE(share + k, p);
  }
  for (; k < count; ++k) value -= share[k] * panel[k * n];
  return value;
}

// Only the lower triangle: a column begins at its own row.
INLINE void trail_columns(double *f, size_t n, size_t from, size_t count, size_t j, size_t columns,
                          size_t first, size_t end) {
  double share[COLUMNS * MOST]; // of column c from c*MOST
  const double *panel = f + from * n;
  SONDE_ASSERT(count <= MOST);
  for (size_t k = 0; k < count; ++k)
    for (size_t c = 0; c < columns; ++c) share[c * MOST + k] = panel[k * n + j + c];
  size_t whole = first > j + columns - 1 ? first : j + columns - 1, i = whole;
  for (; i + V <= end; i += V) trail(f, n, panel + i, count, j, i, share, columns);
  for (size_t c = 0; c < columns; ++c) {
    double *column = f + (j + c) * n;
    for (size_t r = first > j + c ? first : j + c; r < whole && r < end; ++r)
      column[r] = trail_one(column[r], n, panel + r, count, share + c * MOST);
    for (size_t r = i; r < end; ++r)
      column[r] = trail_one(column[r], n, panel + r, count, share + c * MOST);
  }
}

static void trail_rows(double *f, size_t n, size_t from, size_t count, size_t behind, size_t first,
                       size_t end) {
  size_t j = behind;
  for (; j + COLUMNS <= end; j += COLUMNS) trail_columns(f, n, from, count, j, COLUMNS, first, end);
  for (; j < end; ++j) trail_columns(f, n, from, count, j, 1, first, end);
}

static bool eliminate(double *f, uint32_t n, uint32_t from, uint32_t to) {
  SONDE_ASSERT(f != NULL && from <= to && to <= n);
  if (!factor_panel(f, n, from, to)) return false;
  for (size_t part = from; part < to; part += MOST) {
    size_t count = to - part < MOST ? to - part : MOST;
    for (size_t first = to; first < n; first += BAND)
      trail_rows(f, n, part, count, to, first, first + BAND < n ? first + BAND : n);
  }
  return true;
}

// ---- the rest -----------------------------------------------------------------------------

static void subtract(float *restrict y, const float *restrict row, float scale, uint32_t count) {
  SONDE_ASSERT(y != NULL && row != NULL);
  for (uint32_t i = 0; i < count; ++i) y[i] -= scale * row[i];
}

// Cholesky, column by column.
static bool factor_whole(double *f, size_t n) {
  for (size_t j = 0; j < n; ++j) {
    double *column = f + j * n;
    reduce(column + j, n - j, f + j, n, f + j, n, j);
    if (!(column[j] > 0) || !isfinite(column[j])) return false;
    column[j] = sqrt(column[j]);
    for (size_t i = j + 1; i < n; ++i) column[i] /= column[j];
  }
  return true;
}

// Row i of x holds entry i of every solution; those of L are zero behind the diagonal.
static bool invert(double *f, uint32_t n, double *x) {
  SONDE_ASSERT(f != NULL && x != NULL && n > 0);
  if (!factor_whole(f, n)) return false;
  memset(x, 0, (size_t)n * n * sizeof *x);
  for (size_t i = 0; i < n; ++i) {
    x[i * n + i] = 1;
    reduce(x + i * n, i, x, n, f + i, n, i);
    for (size_t c = 0; c <= i; ++c) x[i * n + c] /= f[i * n + i];
  }
  for (size_t i = n; i-- > 0;) {
    reduce(x + i * n, n, x + (i + 1) * n, n, f + i * n + i + 1, 1, n - 1 - i);
    for (size_t c = 0; c < n; ++c) x[i * n + c] /= f[i * n + i];
  }
  return true;
}

const sonde_front_kernels FRONT_KERNELS = {FRONT_NAME, eliminate, subtract, invert};
