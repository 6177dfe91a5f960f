// A matrix with its multifrontal factor.
#include "sparse/direct.h"

#include "base/base.h"

#include <string.h>

enum { POLISHING_STEPS = 5, VECTORS = 5 };
static const double ACCURACY = 1e-14; // of the residual

struct sonde_direct {
  uint32_t n, *row_start, *column;
  double *value, *vectors; // [VECTORS][n] right-hand side and those of the conjugate gradients
  sonde_symbolic *symbolic;
  sonde_numeric numeric;
};

void sonde_rows_multiply(uint32_t n, const uint32_t *row_start, const uint32_t *column,
                         const double *value, const double *x, double *y) {
  SONDE_ASSERT(x != y);
  for (uint32_t i = 0; i < n; ++i) {
    double sum = 0;
    for (uint32_t k = row_start[i]; k < row_start[i + 1]; ++k) sum += value[k] * x[column[k]];
    y[i] = sum;
  }
}

sonde_status sonde_direct_create(uint32_t n, const uint32_t *row_start, const uint32_t *column,
                                 const double *value, const sonde_vec3 *points,
                                 sonde_direct **direct, sonde_error *error) {
  SONDE_ASSERT(direct != NULL && value != NULL);
  *direct = NULL;
  const sonde_symbolic_def def = {
      .node_count = n, .block = 1, .points = points, .row_start = row_start, .column = column};
  sonde_direct *d = SONDE_NEW(sonde_direct, 1);
  if (!d) return sonde_fail_memory(error);
  sonde_status status = sonde_symbolic_create(&def, &d->symbolic, error);
  if (!status) status = sonde_numeric_reserve(&d->numeric, d->symbolic, error);
  if (!status) {
    d->n = n;
    d->row_start = SONDE_NEW(uint32_t, n + 1);
    d->column = SONDE_NEW(uint32_t, row_start[n]);
    d->value = SONDE_NEW(double, row_start[n]);
    d->vectors = SONDE_NEW(double, (size_t)VECTORS *n);
    if (!d->row_start || !d->column || !d->value || !d->vectors) status = sonde_fail_memory(error);
  }
  if (!status) {
    memcpy(d->row_start, row_start, (n + 1) * sizeof *row_start);
    memcpy(d->column, column, row_start[n] * sizeof *column);
    status = sonde_direct_refactor(d, value, error);
  }
  if (status)
    sonde_direct_destroy(d);
  else
    *direct = d;
  return status;
}

void sonde_direct_destroy(sonde_direct *d) {
  if (!d) return;
  sonde_numeric_clear(&d->numeric);
  sonde_symbolic_destroy(d->symbolic);
  sonde_free(d->row_start);
  sonde_free(d->column);
  sonde_free(d->value);
  sonde_free(d->vectors);
  sonde_free(d);
}

sonde_status sonde_direct_refactor(sonde_direct *d, const double *value, sonde_error *error) {
  SONDE_ASSERT(d != NULL && value != NULL);
  memcpy(d->value, value, d->row_start[d->n] * sizeof *value);
  const sonde_matrix_source source = {.value = d->value};
  if (sonde_numeric_factor(&d->numeric, d->symbolic, &source)) return SONDE_OK;
  return sonde_fail(error, SONDE_CONVERGENCE,
                    "a pivot is not positive: the matrix is not positive definite");
}

static void multiply(const void *user, const double *x, double *y) {
  const sonde_direct *d = user;
  sonde_rows_multiply(d->n, d->row_start, d->column, d->value, x, y);
}

static double precondition(const void *user, const double *r, double *z) {
  const sonde_direct *d = user;
  memcpy(z, r, d->n * sizeof *z);
  sonde_numeric_solve(&d->numeric, z);
  return sonde_dot(r, z, d->n);
}

void sonde_direct_solve(sonde_direct *d, double *x) {
  SONDE_ASSERT(d != NULL && x != NULL);
  double *b = d->vectors;
  const sonde_pcg_vectors vectors = {b + d->n, b + 2 * (size_t)d->n, b + 3 * (size_t)d->n,
                                     b + 4 * (size_t)d->n};
  const sonde_operator a = {
      .count = d->n, .width = 1, .multiply = multiply, .precondition = precondition, .user = d};
  const sonde_pcg_goal goal = {
      .relative = ACCURACY, .max_iterations = POLISHING_STEPS, .from_zero = true};
  memcpy(b, x, d->n * sizeof *b);
  memset(x, 0, d->n * sizeof *x);
  (void)sonde_pcg(&a, b, x, &vectors, &goal);
}
