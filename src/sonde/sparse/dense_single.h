// Elimination in a front in single precision, for one instruction set: part of dense_kernel.h.
#include "base/base.h"
#include "base/vector.h"
#include "sparse/dense.h"

#include <math.h>

// BLOCK columns are eliminated among themselves, DEPTH of them then taken from what lies behind,
// COLUMNS at a time, in bands of rows that stay in the cache with their part of the panel.
enum { BLOCK = 8, COLUMNS_SINGLE = 4, BAND_SINGLE = 192, DEPTH_SINGLE = 32 };

// What `count` columns from `panel` on leave in rows [first, end) of `columns` columns from j,
// `high` vectors of rows at a time. Sums run over the columns in their order.
INLINE void update_rows_single(float *front, size_t stride, const float *panel, size_t count,
                               const float *shares, size_t j, size_t columns, size_t i,
                               size_t high) {
  floats sum[2 * COLUMNS_SINGLE], row[2];
  for (size_t c = 0; c < columns; ++c)
    for (size_t h = 0; h < high; ++h)
      sum[2 * c + h] = vload(front + (j + c) * stride + i + h * FLOATS);
  for (size_t k = 0; k < count; ++k) {
    for (size_t h = 0; h < high; ++h) row[h] = vload(panel + k * stride + i + h * FLOATS);
    for (size_t c = 0; c < columns; ++c)
      for (size_t h = 0; h < high; ++h) sum[2 * c + h] -= shares[k * COLUMNS_SINGLE + c] * row[h];
  }
  for (size_t c = 0; c < columns; ++c)
    for (size_t h = 0; h < high; ++h)
      *(floats_near *)(front + (j + c) * stride + i + h * FLOATS) = sum[2 * c + h];
}

// The same for rows from about the diagonal of column j, or `first`, to `end`. Numbers above the
// diagonal that vectors meet are nobody's.
INLINE void update_columns_single(float *front, size_t stride, const float *panel, size_t count,
                                  size_t j, size_t columns, size_t first, size_t end) {
  float shares[COLUMNS_SINGLE * DEPTH_SINGLE];
  for (size_t k = 0; k < count; ++k)
    for (size_t c = 0; c < columns; ++c) shares[k * COLUMNS_SINGLE + c] = panel[k * stride + j + c];
  size_t i = first < j ? first + (j - first) / FLOATS * FLOATS : first;
  for (; i + FLOATS < end; i += 2 * FLOATS)
    update_rows_single(front, stride, panel, count, shares, j, columns, i, 2);
  for (; i < end; i += FLOATS)
    update_rows_single(front, stride, panel, count, shares, j, columns, i, 1);
}

// Subtracts from columns [to, end) what columns [from, to) leave in them.
static void update_single(float *front, size_t n, size_t stride, size_t from, size_t to,
                          size_t end) {
  const float *panel = front + from * stride;
  SONDE_ASSERT(to - from <= DEPTH_SINGLE);
  for (size_t first = to; first < n; first += BAND_SINGLE) {
    const size_t last = first + BAND_SINGLE < n ? first + BAND_SINGLE : n;
    size_t j = to;
    for (; j + COLUMNS_SINGLE <= end && j < last; j += COLUMNS_SINGLE)
      update_columns_single(front, stride, panel, to - from, j, COLUMNS_SINGLE, first, last);
    for (; j < end && j < last; ++j)
      update_columns_single(front, stride, panel, to - from, j, 1, first, last);
  }
}

// Cholesky of `count` columns from j: their own block, then the rows behind it.
INLINE bool factor_block_single(float *front, size_t n, size_t stride, size_t j, size_t count) {
  float *own = front + j * stride + j, inverse[BLOCK];
  for (size_t c = 0; c < count; ++c) {
    for (size_t k = 0; k < c; ++k)
      for (size_t r = c; r < count; ++r)
        own[c * stride + r] -= own[k * stride + c] * own[k * stride + r];
    const float pivot = own[c * stride + c];
    if (!(pivot > 0) || !isfinite(pivot)) return false;
    inverse[c] = 1 / sqrtf(pivot);
    for (size_t r = c; r < count; ++r) own[c * stride + r] *= inverse[c];
  }
  for (size_t i = count; i < n - j; i += FLOATS) {
    floats x[BLOCK];
    for (size_t c = 0; c < count; ++c) {
      x[c] = vload(own + c * stride + i);
      for (size_t k = 0; k < c; ++k) x[c] -= own[k * stride + c] * x[k];
      x[c] *= inverse[c];
      *(floats_near *)(own + c * stride + i) = x[c];
    }
  }
  return true;
}

static bool eliminate_single(float *front, uint32_t order, uint32_t from, uint32_t to) {
  SONDE_ASSERT(front != NULL && from <= to && to <= order);
  const size_t n = order, stride = sonde_front_stride(order);
  for (size_t part = from; part < to; part += DEPTH_SINGLE) {
    const size_t end = part + DEPTH_SINGLE < to ? part + DEPTH_SINGLE : to;
    for (size_t j = part, next; j < end; j = next) {
      next = j + BLOCK < end ? j + BLOCK : end;
      if (!(next - j == BLOCK ? factor_block_single(front, n, stride, j, BLOCK)
                              : factor_block_single(front, n, stride, j, next - j)))
        return false;
      update_single(front, n, stride, j, next, end);
    }
    update_single(front, n, stride, part, end, n);
  }
  return true;
}
