// Order statistics of reals.
#ifndef SONDE_SRC_ORDER_H
#define SONDE_SRC_ORDER_H

#include "base/base.h"

// Ascending order for qsort.
static inline int sonde_compare_reals(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
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
