// sonde_cholesky: factor by rows. sonde_cholesky_forward, _solve: forward, then backward.
#include "fit/dense.h"

#include "base/base.h"

#include <math.h>

bool sonde_cholesky(double *a, uint32_t n) {
  SONDE_ASSERT(n > 0);
  for (uint32_t i = 0; i < n; ++i) {
    double *row = a + (size_t)i * n;
    for (uint32_t j = 0; j <= i; ++j) {
      const double *other = a + (size_t)j * n;
      double sum = row[j];
      for (uint32_t k = 0; k < j; ++k) sum -= row[k] * other[k];
      if (i == j && !(sum > 0)) return false;
      row[j] = i == j ? sqrt(sum) : sum / other[j];
    }
  }
  return true;
}

void sonde_cholesky_forward(const double *factor, uint32_t n, double *x) {
  SONDE_ASSERT(n > 0);
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t k = 0; k < i; ++k) x[i] -= factor[(size_t)i * n + k] * x[k];
    x[i] /= factor[(size_t)i * n + i];
  }
}

void sonde_cholesky_solve(const double *factor, uint32_t n, double *x) {
  sonde_cholesky_forward(factor, n, x);
  for (uint32_t i = n; i-- > 0;) {
    for (uint32_t k = i + 1; k < n; ++k) x[i] -= factor[(size_t)k * n + i] * x[k];
    x[i] /= factor[(size_t)i * n + i];
  }
}

void sonde_add_outer(double *a, uint32_t n, const double *row, double weight) {
  for (uint32_t i = 0; i < n; ++i) {
    double scaled = weight * row[i], *to = a + (size_t)i * n;
    if (fpclassify(scaled) == FP_ZERO) continue;
    for (uint32_t j = 0; j <= i; ++j) to[j] += scaled * row[j];
  }
}
