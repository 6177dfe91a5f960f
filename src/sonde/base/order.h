// Orders and order statistics.
#ifndef SONDE_SRC_ORDER_H
#define SONDE_SRC_ORDER_H

#include "base/base.h"
#include "base/maths.h"

#include <stdlib.h>

// Ascending order for qsort.
static inline int sonde_compare_reals(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

typedef struct sonde_ranked {
  double value;
  uint32_t index;
} sonde_ranked;

// Ascending by value, equal ones by index.
static inline int sonde_compare_ranked(const void *a, const void *b) {
  const sonde_ranked *x = a, *y = b;
  if (x->value != y->value) return x->value < y->value ? -1 : 1;
  return (x->index > y->index) - (x->index < y->index);
}

// Sorts list[count] of places in points[] along an axis; scratch [count].
static inline void sonde_sort_along(const sonde_vec3 *points, int axis, uint32_t *list,
                                    uint32_t count, sonde_ranked *scratch) {
  for (uint32_t i = 0; i < count; ++i)
    scratch[i] = (sonde_ranked){v_coordinate(points[list[i]], axis), list[i]};
  qsort(scratch, count, sizeof *scratch, sonde_compare_ranked);
  for (uint32_t i = 0; i < count; ++i) list[i] = scratch[i].index;
}

// Puts the lower half of list[count] along an axis first, count / 2 places; scratch [count]. Halves
// of up to `leaf` places are in order, longer ones are not: ranges shrink round the middle, and the
// last one, or one that does not shrink, is sorted.
static inline void sonde_halve_along(const sonde_vec3 *points, int axis, uint32_t *list,
                                     uint32_t count, uint32_t leaf, sonde_ranked *scratch) {
  const int64_t middle = count / 2, most = count <= 2 * leaf + 1 ? count : 32;
  for (uint32_t i = 0; i < count; ++i)
    scratch[i] = (sonde_ranked){v_coordinate(points[list[i]], axis), list[i]};
  int64_t first = 0, last = count; // the middle lies within
  for (int round = 0; round < 64 && last - first > most; ++round) {
    sonde_ranked three[3] = {scratch[first], scratch[first + (last - first) / 2],
                             scratch[last - 1]};
    qsort(three, 3, sizeof *three, sonde_compare_ranked);
    int64_t low = first, high = last - 1;
    while (low <= high) {
      while (sonde_compare_ranked(&scratch[low], &three[1]) < 0) ++low;
      while (sonde_compare_ranked(&scratch[high], &three[1]) > 0) --high;
      if (low > high) break;
      const sonde_ranked other = scratch[low];
      scratch[low++] = scratch[high], scratch[high--] = other;
    }
    // Up to `high` none is above the median of three, from `low` on none below.
    if (middle <= high)
      last = high + 1;
    else if (middle >= low)
      first = low;
    else
      first = middle, last = middle + 1;
  }
  qsort(scratch + first, (size_t)(last - first), sizeof *scratch, sonde_compare_ranked);
  for (uint32_t i = 0; i < count; ++i) list[i] = scratch[i].index;
}

// Value at a fraction of the way through ascending reals, linear between ranks.
static inline double sonde_percentile(const double *sorted, uint32_t count, double fraction) {
  SONDE_ASSERT(count > 0 && fraction >= 0 && fraction <= 1);
  double place = fraction * (count - 1);
  uint32_t below = (uint32_t)place;
  if (below + 1 >= count) return sorted[count - 1];
  return sorted[below] + (place - below) * (sorted[below + 1] - sorted[below]);
}

#endif
