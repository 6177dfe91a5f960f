// Laws of systems that are factored once: residual in double precision, fill, equality with dense
// elimination.
#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"
#include "sparse/direct.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>
#include <cmocka.h>

#include "grid.h"

static sonde_direct *direct_of(const csr *a) {
  sonde_direct *direct;
  sonde_error error;
  assert_int_equal(
      sonde_direct_create(a->n, a->start, a->column, a->value, a->points, &direct, &error),
      SONDE_OK);
  return direct;
}

static void solves_to_double_precision(void **state) {
  (void)state;
  csr a = grid_matrix(60, 1e-3);
  double *b = SONDE_NEW(double, a.n), *x = SONDE_NEW(double, a.n);
  for (uint32_t i = 0; i < a.n; ++i) b[i] = x[i] = sonde_random_normal(1, i);
  sonde_direct *direct = direct_of(&a);
  sonde_direct_solve(direct, x);
  assert_true(residual(&a, x, b) < 1e-11);
  sonde_direct_destroy(direct);
  sonde_free(b);
  sonde_free(x);
  csr_clear(&a);
}

// Dissection keeps the fill near n log n.
static void fill_is_small(void **state) {
  (void)state;
  csr a = grid_matrix(60, 1e-3);
  const sonde_symbolic_def def = {
      .node_count = a.n, .block = 1, .points = a.points, .row_start = a.start, .column = a.column};
  sonde_symbolic *symbolic;
  assert_int_equal(sonde_symbolic_create(&def, &symbolic, NULL), SONDE_OK);
  assert_true(symbolic->factor_size < 80u * a.n); // rows padded to vectors of eight
  sonde_symbolic_destroy(symbolic);
  csr_clear(&a);
}

// Gauss elimination on a full matrix.
static void dense_solve(uint32_t n, double *m, double *x) {
  for (uint32_t k = 0; k < n; ++k)
    for (uint32_t i = k + 1; i < n; ++i) {
      double f = m[i * n + k] / m[k * n + k];
      for (uint32_t j = k; j < n; ++j) m[i * n + j] -= f * m[k * n + j];
      x[i] -= f * x[k];
    }
  for (uint32_t k = n; k-- > 0;) {
    for (uint32_t j = k + 1; j < n; ++j) x[k] -= m[k * n + j] * x[j];
    x[k] /= m[k * n + k];
  }
}

static void equals_dense_elimination_also_after_refactor(void **state) {
  (void)state;
  csr a = grid_matrix(7, 0.2);
  sonde_direct *direct = direct_of(&a);
  for (int round = 0; round < 2; ++round) {
    double dense[49 * 49] = {0}, x[49], y[49];
    for (uint32_t r = 0; r < a.n; ++r) {
      x[r] = y[r] = sonde_random_normal(5, r);
      for (uint32_t p = a.start[r]; p < a.start[r + 1]; ++p)
        dense[r * a.n + a.column[p]] = a.value[p];
    }
    dense_solve(a.n, dense, y);
    sonde_direct_solve(direct, x);
    for (uint32_t r = 0; r < a.n; ++r) assert_true(fabs(x[r] - y[r]) < 1e-12);
    for (uint32_t r = 0; r < a.n; ++r)
      for (uint32_t p = a.start[r]; p < a.start[r + 1]; ++p)
        if (a.column[p] == r) a.value[p] += 0.7;
    assert_int_equal(sonde_direct_refactor(direct, a.value, NULL), SONDE_OK);
  }
  sonde_direct_destroy(direct);
  csr_clear(&a);
}

static void refuses_what_is_not_positive_definite(void **state) {
  (void)state;
  uint32_t start[] = {0, 2, 4}, column[] = {0, 1, 0, 1};
  double value[] = {1, 2, 2, 1};
  const sonde_vec3 points[] = {{0, 0, 0}, {1, 0, 0}};
  sonde_direct *direct;
  sonde_error error;
  assert_int_equal(sonde_direct_create(2, start, column, value, points, &direct, &error),
                   SONDE_CONVERGENCE);
  assert_null(direct);
  assert_non_null(strstr(error.message, "not positive definite"));
  uint32_t bad[] = {0, 7, 0, 1};
  assert_int_equal(sonde_direct_create(2, start, bad, value, points, &direct, &error),
                   SONDE_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(solves_to_double_precision),
      cmocka_unit_test(fill_is_small),
      cmocka_unit_test(equals_dense_elimination_also_after_refactor),
      cmocka_unit_test(refuses_what_is_not_positive_definite),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
