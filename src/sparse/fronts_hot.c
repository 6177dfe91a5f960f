// Kernels of the multifrontal factor: plain loops over contiguous memory.
//
// sonde_front_eliminate  one panel of columns and what it leaves in the rest
// factor_panel           columns of the panel against each other
// subtract_eight         eight columns of the panel from one column behind it
// sonde_front_subtract   one row of the backward pass
#include "base/base.h"
#include "sparse/fronts.h"

#include <math.h>

enum { WIDTH = 8 };

static bool factor_panel(double *f, size_t n, uint32_t from, uint32_t to) {
  for (size_t j = from; j < to; ++j) {
    double *cj = f + j * n;
    for (size_t p = from; p < j; ++p) {
      const double *cp = f + p * n;
      double l = cp[j];
      for (size_t i = j; i < n; ++i) cj[i] -= l * cp[i];
    }
    if (!(cj[j] > 0) || !isfinite(cj[j])) return false;
    double root = 1 / sqrt(cj[j]);
    for (size_t i = j; i < n; ++i) cj[i] *= root;
  }
  return true;
}

// p: [8][n]; cj: [n].
SONDE_UNWATCHED static void subtract_eight(double *restrict cj, const double *restrict p, size_t n,
                                           size_t j) {
  double l[WIDTH];
  for (size_t k = 0; k < WIDTH; ++k) l[k] = p[k * n + j];
  for (size_t i = j; i < n; ++i)
    cj[i] -=
        ((l[0] * p[i] + l[1] * p[n + i]) + (l[2] * p[2 * n + i] + l[3] * p[3 * n + i])) +
        ((l[4] * p[4 * n + i] + l[5] * p[5 * n + i]) + (l[6] * p[6 * n + i] + l[7] * p[7 * n + i]));
}

bool sonde_front_eliminate(double *f, uint32_t n, uint32_t from, uint32_t to) {
  SONDE_ASSERT(f != NULL && from <= to && to <= n);
  if (!factor_panel(f, n, from, to)) return false;
  size_t order = n;
  if (order > 0) (void)*(volatile double *)(f + order * order - 1); // the end of what loops reach
  for (size_t j = to; j < order; ++j) {
    double *cj = f + j * order;
    size_t p = from;
    for (; p + WIDTH <= to; p += WIDTH) subtract_eight(cj, f + p * order, order, j);
    for (; p < to; ++p) {
      const double *cp = f + p * order;
      double l = cp[j];
      for (size_t i = j; i < order; ++i) cj[i] -= l * cp[i];
    }
  }
  return true;
}

void sonde_front_subtract(float *restrict y, const float *restrict row, float scale,
                          uint32_t count) {
  SONDE_ASSERT(y != NULL && row != NULL);
  for (uint32_t i = 0; i < count; ++i) y[i] -= scale * row[i];
}
