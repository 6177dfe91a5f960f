// A sparse positive definite matrix for the tests of the direct solvers.
#ifndef SONDE_TESTS_SPARSE_GRID_H
#define SONDE_TESTS_SPARSE_GRID_H

#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"

typedef struct csr {
  uint32_t n, *start, *column;
  double *value;
  sonde_vec3 *points;
} csr;

// Laplacian of a side x side grid, random conductances, a little mass.
static csr grid_matrix(uint32_t side, double mass) {
  uint32_t n = side * side;
  csr a = {n, SONDE_NEW(uint32_t, n + 1), SONDE_NEW(uint32_t, 5 * (size_t)n),
           SONDE_NEW(double, 5 * (size_t)n), SONDE_NEW(sonde_vec3, n)};
  for (uint32_t r = 0; r < n; ++r) {
    uint32_t x = r % side, y = r / side, p = a.start[r], diagonal = 0;
    double sum = mass;
    int step[5][2] = {{0, -1}, {-1, 0}, {0, 0}, {1, 0}, {0, 1}};
    for (int s = 0; s < 5; ++s) {
      int64_t nx = (int64_t)x + step[s][0], ny = (int64_t)y + step[s][1];
      if (nx < 0 || ny < 0 || nx >= side || ny >= side) continue;
      uint32_t c = (uint32_t)ny * side + (uint32_t)nx;
      if (c == r) diagonal = p;
      double g = 0.5 + sonde_random_uniform(3, (uint64_t)(r + c) * n + (r > c ? r - c : c - r));
      a.column[p] = c;
      a.value[p++] = c == r ? 0 : -g;
      if (c != r) sum += g;
    }
    a.value[diagonal] = sum;
    a.start[r + 1] = p;
    a.points[r] = vec3(x, y, 0);
  }
  return a;
}

static void csr_clear(csr *a) {
  sonde_free(a->start);
  sonde_free(a->column);
  sonde_free(a->value);
  sonde_free(a->points);
}

static double residual(const csr *a, const double *x, const double *b) {
  double worst = 0;
  for (uint32_t r = 0; r < a->n; ++r) {
    double sum = -b[r];
    for (uint32_t p = a->start[r]; p < a->start[r + 1]; ++p) sum += a->value[p] * x[a->column[p]];
    worst = fmax(worst, fabs(sum));
  }
  return worst;
}

#endif
