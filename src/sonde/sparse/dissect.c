// Nested dissection: every piece is split along its widest side into halves and what separates
// them, with an explicit stack.
#include "sparse/dissect.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/order.h"

#include <string.h>

enum { STACK = 128 };

typedef struct dissection {
  const sonde_pattern *pattern;
  sonde_ranked *keys;
  uint32_t *side, *scratch;
  uint32_t mark; // of the current piece in side
} dissection;

sonde_status sonde_dissect(const sonde_pattern *pattern, uint32_t rows, uint32_t leaf,
                           uint32_t *order, uint32_t *above, sonde_error *error) {
  SONDE_ASSERT(rows > 0 && rows <= pattern->n && leaf > 0 && pattern->points != NULL);
  dissection d = {pattern, SONDE_NEW(sonde_ranked, rows), SONDE_NEW(uint32_t, pattern->n),
                  SONDE_NEW(uint32_t, rows), 0};
  sonde_status status = d.keys && d.side && d.scratch ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    struct {
      uint32_t first, count, above;
    } stack[STACK];
    const sonde_pattern *a = d.pattern;
    uint32_t depth = 0, n = a->n;
    for (uint32_t i = 0; i < n; ++i) order[i] = i;
    for (uint32_t i = 0; i < n && above; ++i) above[i] = UINT32_MAX;
    stack[depth].first = 0, stack[depth].count = rows, stack[depth++].above = rows;
    while (depth > 0) {
      --depth;
      uint32_t first = stack[depth].first, count = stack[depth].count, up = stack[depth].above;
      if (count <= leaf) {
        if (above) above[first] = up;
        continue;
      }
      // The lower half gets the current mark; rows of the upper half that touch it are the
      // separator.
      uint32_t half = count / 2, keep = 0, parted = 0, *upper = order + first + half;
      uint32_t *piece = order + first;
      const sonde_vec3 *points = d.pattern->points;
      double spread = -1;
      int widest = 0;
      for (int axis = 0; axis < 3; ++axis) {
        double low = INFINITY, high = -INFINITY;
        for (uint32_t i = 0; i < count; ++i) {
          double c = v_coordinate(points[piece[i]], axis);
          low = fmin(low, c), high = fmax(high, c);
        }
        // Sides that differ by rounding only count as equal: grids are cut alike.
        if (high - low > spread * (1 + 1e-9)) spread = high - low, widest = axis;
      }
      sonde_sort_along(points, widest, piece, count, d.keys);
      ++d.mark;
      for (uint32_t i = 0; i < half; ++i) d.side[order[first + i]] = d.mark;
      for (uint32_t i = 0; i < count - half; ++i) {
        uint32_t row = upper[i];
        bool touches = false;
        for (uint32_t p = a->start[row]; p < a->start[row + 1] && !touches; ++p)
          touches = d.side[a->column[p]] == d.mark;
        if (touches)
          d.scratch[parted++] = row;
        else
          upper[keep++] = row;
      }
      memcpy(upper + keep, d.scratch, parted * sizeof *d.scratch);
      // The separator goes behind both halves and above them.
      uint32_t last = first + half + keep;
      if (half + keep < count) {
        if (above) above[last] = up;
        up = last;
      }
      SONDE_ASSERT(depth + 2 <= SONDE_COUNT_OF(stack));
      stack[depth].first = first, stack[depth].count = half, stack[depth++].above = up;
      if (keep == 0) continue;
      stack[depth].first = first + half, stack[depth].count = keep, stack[depth++].above = up;
    }
  }
  sonde_free(d.keys);
  sonde_free(d.side);
  sonde_free(d.scratch);
  return status;
}

sonde_status sonde_pattern_check(const sonde_pattern *a, sonde_error *error) {
  if (a->n == 0 || a->n >= UINT32_MAX / 2 || a->start == NULL || a->column == NULL)
    return sonde_fail(error, SONDE_ARGUMENT, "expected a matrix with at least one row");
  for (uint32_t i = 0; i < a->n; ++i)
    for (uint32_t p = a->start[i]; p < a->start[i + 1]; ++p)
      if (a->column[p] >= a->n || (p > a->start[i] && a->column[p] <= a->column[p - 1]))
        return sonde_fail(error, SONDE_ARGUMENT, "columns of row %u are not ascending below %u", i,
                          a->n);
  return SONDE_OK;
}
