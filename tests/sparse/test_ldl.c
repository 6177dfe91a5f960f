// Laws of the factor-once solver: residual, order independence, equality with dense elimination.
#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"
#include "sparse/ldl.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>
#include <cmocka.h>

#include "grid.h"

static void solves_with_and_without_points(void **state) {
  (void)state;
  csr a = grid_matrix(60, 1e-3);
  double *b = SONDE_NEW(double, a.n), *x = SONDE_NEW(double, a.n), *y = SONDE_NEW(double, a.n);
  for (uint32_t i = 0; i < a.n; ++i) b[i] = sonde_random_normal(1, i);
  sonde_ldl *by_points, *by_degree;
  sonde_error error;
  assert_int_equal(sonde_ldl_create(a.n, a.start, a.column, a.value, a.points, &by_points, &error),
                   SONDE_OK);
  assert_int_equal(sonde_ldl_create(a.n, a.start, a.column, a.value, NULL, &by_degree, &error),
                   SONDE_OK);
  double *scratch = SONDE_NEW(double, sonde_ldl_scratch(by_points, 1));
  memcpy(x, b, a.n * sizeof *b);
  memcpy(y, b, a.n * sizeof *b);
  sonde_ldl_solve(by_points, 1, x, scratch);
  sonde_ldl_solve(by_degree, 1, y, scratch);
  assert_true(residual(&a, x, b) < 1e-9);
  assert_true(residual(&a, y, b) < 1e-9);
  for (uint32_t i = 0; i < a.n; ++i) assert_true(fabs(x[i] - y[i]) < 1e-7);
  // Dissection keeps the fill near n log n; the band of a 60 x 60 grid holds n * 60.
  assert_true(sonde_ldl_nonzeros(by_points) < 30u * a.n);
  assert_true(sonde_ldl_nonzeros(by_degree) < 65u * a.n);
  sonde_ldl_destroy(by_points);
  sonde_ldl_destroy(by_degree);
  sonde_free(scratch);
  sonde_free(b);
  sonde_free(x);
  sonde_free(y);
  csr_clear(&a);
}

static void several_columns_equal_single_ones(void **state) {
  (void)state;
  csr a = grid_matrix(13, 0.1);
  sonde_ldl *ldl;
  assert_int_equal(sonde_ldl_create(a.n, a.start, a.column, a.value, a.points, &ldl, NULL),
                   SONDE_OK);
  double *scratch = SONDE_NEW(double, sonde_ldl_scratch(ldl, 3));
  double *many = SONDE_NEW(double, 3 * (size_t)a.n), *one = SONDE_NEW(double, a.n);
  for (uint32_t i = 0; i < 3 * a.n; ++i) many[i] = sonde_random_normal(2, i);
  for (uint32_t c = 0; c < 3; ++c) {
    double *copy = SONDE_NEW(double, 3 * (size_t)a.n);
    memcpy(copy, many, 3 * a.n * sizeof *many);
    for (uint32_t i = 0; i < a.n; ++i) one[i] = many[3 * i + c];
    sonde_ldl_solve(ldl, 3, copy, scratch);
    sonde_ldl_solve(ldl, 1, one, scratch);
    for (uint32_t i = 0; i < a.n; ++i) assert_true(fabs(copy[3 * i + c] - one[i]) < 1e-12);
    sonde_free(copy);
  }
  sonde_free(scratch);
  sonde_free(many);
  sonde_free(one);
  sonde_ldl_destroy(ldl);
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
  sonde_ldl *ldl;
  assert_int_equal(sonde_ldl_create(a.n, a.start, a.column, a.value, a.points, &ldl, NULL),
                   SONDE_OK);
  for (int round = 0; round < 2; ++round) {
    double dense[49 * 49] = {0}, x[49], y[49], scratch[49];
    for (uint32_t r = 0; r < a.n; ++r) {
      x[r] = y[r] = sonde_random_normal(5, r);
      for (uint32_t p = a.start[r]; p < a.start[r + 1]; ++p)
        dense[r * a.n + a.column[p]] = a.value[p];
    }
    dense_solve(a.n, dense, y);
    sonde_ldl_solve(ldl, 1, x, scratch);
    for (uint32_t r = 0; r < a.n; ++r) assert_true(fabs(x[r] - y[r]) < 1e-12);
    for (uint32_t r = 0; r < a.n; ++r)
      for (uint32_t p = a.start[r]; p < a.start[r + 1]; ++p)
        if (a.column[p] == r) a.value[p] += 0.7;
    assert_int_equal(sonde_ldl_refactor(ldl, a.value, NULL), SONDE_OK);
  }
  sonde_ldl_destroy(ldl);
  csr_clear(&a);
}

static void refuses_what_is_not_positive_definite(void **state) {
  (void)state;
  uint32_t start[] = {0, 2, 4}, column[] = {0, 1, 0, 1};
  double value[] = {1, 2, 2, 1};
  sonde_ldl *ldl;
  sonde_error error;
  assert_int_equal(sonde_ldl_create(2, start, column, value, NULL, &ldl, &error),
                   SONDE_CONVERGENCE);
  assert_null(ldl);
  assert_non_null(strstr(error.message, "not positive definite"));
  uint32_t bad[] = {0, 7, 0, 1};
  assert_int_equal(sonde_ldl_create(2, start, bad, value, NULL, &ldl, &error), SONDE_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(solves_with_and_without_points),
      cmocka_unit_test(several_columns_equal_single_ones),
      cmocka_unit_test(equals_dense_elimination_also_after_refactor),
      cmocka_unit_test(refuses_what_is_not_positive_definite),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
