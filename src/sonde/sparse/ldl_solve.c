// Hot half of the factor-once solver.
//
// sonde_ldl_solve   permutes, runs L, D and L^T over one or several right-hand sides, permutes back
// solve_one         one right-hand side
// solve_many        several, interleaved per row
#include "sparse/ldl.h"

#include "base/base.h"

static void solve_one(const sonde_ldl *ldl, double *y) {
  const size_t *start = ldl->start;
  for (uint32_t k = 0; k < ldl->n; ++k) {
    double yk = y[k];
    for (size_t p = start[k]; p < start[k + 1]; ++p) y[ldl->row[p]] -= ldl->lower[p] * yk;
  }
  for (uint32_t k = ldl->n; k-- > 0;) {
    double sum = y[k] / ldl->diagonal[k];
    for (size_t p = start[k]; p < start[k + 1]; ++p) sum -= ldl->lower[p] * y[ldl->row[p]];
    y[k] = sum;
  }
}

static void solve_many(const sonde_ldl *ldl, uint32_t columns, double *y) {
  const size_t *start = ldl->start;
  for (uint32_t k = 0; k < ldl->n; ++k) {
    const double *yk = y + (size_t)k * columns;
    for (size_t p = start[k]; p < start[k + 1]; ++p) {
      double *yi = y + (size_t)ldl->row[p] * columns;
      for (uint32_t c = 0; c < columns; ++c) yi[c] -= ldl->lower[p] * yk[c];
    }
  }
  for (uint32_t k = ldl->n; k-- > 0;) {
    double *yk = y + (size_t)k * columns;
    for (uint32_t c = 0; c < columns; ++c) yk[c] /= ldl->diagonal[k];
    for (size_t p = start[k]; p < start[k + 1]; ++p) {
      const double *yi = y + (size_t)ldl->row[p] * columns;
      for (uint32_t c = 0; c < columns; ++c) yk[c] -= ldl->lower[p] * yi[c];
    }
  }
}

void sonde_ldl_solve(const sonde_ldl *ldl, uint32_t columns, double *x, double *scratch) {
  SONDE_ASSERT(columns >= 1 && x != NULL && scratch != NULL);
  for (uint32_t k = 0; k < ldl->n; ++k)
    for (uint32_t c = 0; c < columns; ++c)
      scratch[(size_t)k * columns + c] = x[(size_t)ldl->order[k] * columns + c];
  if (columns == 1)
    solve_one(ldl, scratch);
  else
    solve_many(ldl, columns, scratch);
  for (uint32_t k = 0; k < ldl->n; ++k)
    for (uint32_t c = 0; c < columns; ++c)
      x[(size_t)ldl->order[k] * columns + c] = scratch[(size_t)k * columns + c];
}

size_t sonde_ldl_scratch(const sonde_ldl *ldl, uint32_t columns) {
  return (size_t)ldl->n * columns;
}

size_t sonde_ldl_nonzeros(const sonde_ldl *ldl) { return ldl->start[ldl->n] + ldl->n; }
