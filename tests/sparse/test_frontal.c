// The multifrontal solver: residuals, equality with the other direct solver, the same bits from all
// instruction sets, new numbers on an old analysis, what is not positive definite.
#include "base/base.h"
#include "sparse/ldl.h"
#include "sparse/frontal.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>
#include <cmocka.h>

#include "grid.h"

typedef struct bench {
  csr a;
  sonde_frontal *frontal;
  float *factor, *scratch;
  double *work, *b, *x;
} bench;

static bench bench_of(uint32_t side, double mass) {
  bench t = {.a = grid_matrix(side, mass)};
  const sonde_pattern pattern = {t.a.n, t.a.start, t.a.column, t.a.points};
  sonde_error error;
  assert_int_equal(sonde_frontal_create(&pattern, &t.frontal, &error), SONDE_OK);
  t.factor = SONDE_NEW(float, sonde_frontal_factor_size(t.frontal));
  t.work = SONDE_NEW(double, sonde_frontal_work_size(t.frontal));
  t.scratch = SONDE_NEW(float, sonde_frontal_scratch_size(t.frontal));
  t.b = SONDE_NEW(double, t.a.n);
  t.x = SONDE_NEW(double, t.a.n);
  for (uint32_t i = 0; i < t.a.n; ++i) t.b[i] = t.x[i] = sonde_random_normal(1, i);
  return t;
}

static void bench_clear(bench *t) {
  sonde_frontal_destroy(t->frontal);
  sonde_free(t->factor);
  sonde_free(t->work);
  sonde_free(t->scratch);
  sonde_free(t->b);
  sonde_free(t->x);
  csr_clear(&t->a);
}

static void solve(bench *t) {
  memcpy(t->x, t->b, t->a.n * sizeof *t->x);
  assert_true(sonde_frontal_factor(t->frontal, t->a.value, t->factor, t->work));
  sonde_frontal_solve(t->frontal, t->factor, t->x, t->scratch);
}

// What single precision left is taken back by solving for the residual.
static void refine(bench *t) {
  const csr *a = &t->a;
  double *rest = SONDE_NEW(double, a->n);
  for (uint32_t r = 0; r < a->n; ++r) {
    rest[r] = t->b[r];
    for (uint32_t p = a->start[r]; p < a->start[r + 1]; ++p)
      rest[r] -= a->value[p] * t->x[a->column[p]];
  }
  sonde_frontal_solve(t->frontal, t->factor, rest, t->scratch);
  for (uint32_t r = 0; r < a->n; ++r) t->x[r] += rest[r];
  sonde_free(rest);
}

static void every_size_is_solved(void **state) {
  (void)state;
  for (uint32_t side = 1; side <= 40; side += side < 12 ? 1 : 7) {
    bench t = bench_of(side, 1e-2);
    solve(&t);
    assert_true(residual(&t.a, t.x, t.b) < 1e-3);
    refine(&t), refine(&t);
    assert_true(residual(&t.a, t.x, t.b) < 1e-10);
    bench_clear(&t);
  }
}

static void equals_the_other_solver(void **state) {
  (void)state;
  bench t = bench_of(33, 1e-2);
  sonde_ldl *ldl;
  assert_int_equal(
      sonde_ldl_create(t.a.n, t.a.start, t.a.column, t.a.value, t.a.points, &ldl, NULL), SONDE_OK);
  double *y = SONDE_NEW(double, t.a.n), *scratch = SONDE_NEW(double, sonde_ldl_scratch(ldl, 1));
  memcpy(y, t.b, t.a.n * sizeof *y);
  sonde_ldl_solve(ldl, 1, y, scratch);
  solve(&t);
  refine(&t), refine(&t);
  for (uint32_t i = 0; i < t.a.n; ++i) assert_true(fabs(t.x[i] - y[i]) < 1e-10);
  sonde_free(y);
  sonde_free(scratch);
  sonde_ldl_destroy(ldl);
  bench_clear(&t);
}

// A narrower set changes no bit.
static void instruction_sets_agree(void **state) {
  (void)state;
  bench t = bench_of(37, 1e-2);
  solve(&t);
  double *y = SONDE_NEW(double, t.a.n);
  memcpy(y, t.x, t.a.n * sizeof *y);
  sonde_frontal_use(t.frontal, sonde_dense_kernels_find("base"));
  solve(&t);
  assert_memory_equal(y, t.x, t.a.n * sizeof *y);
  assert_null(sonde_dense_kernels_find("no such set"));
  sonde_free(y);
  bench_clear(&t);
}

// Without the couplings of one line of the grid the matrix falls into two.
static void new_numbers_need_no_new_analysis(void **state) {
  (void)state;
  bench t = bench_of(20, 0.3);
  solve(&t);
  for (uint32_t r = 0; r < t.a.n; ++r)
    for (uint32_t p = t.a.start[r]; p < t.a.start[r + 1]; ++p)
      if ((r / 20 < 9) != (t.a.column[p] / 20 < 9)) t.a.value[p] = 0;
  solve(&t);
  assert_true(residual(&t.a, t.x, t.b) < 1e-4);
  bench_clear(&t);
}

static void pieces_may_be_apart(void **state) {
  (void)state;
  enum { COUNT = 60 };
  uint32_t start[COUNT + 1], column[COUNT];
  double value[COUNT], x[COUNT];
  sonde_vec3 points[COUNT];
  for (uint32_t i = 0; i < COUNT; ++i) {
    start[i] = column[i] = i;
    value[i] = 1 + i;
    x[i] = 2 * value[i];
    points[i] = vec3(i, 0, 0);
  }
  start[COUNT] = COUNT;
  const sonde_pattern pattern = {COUNT, start, column, points};
  sonde_frontal *frontal;
  assert_int_equal(sonde_frontal_create(&pattern, &frontal, NULL), SONDE_OK);
  float *factor = SONDE_NEW(float, sonde_frontal_factor_size(frontal));
  float *scratch = SONDE_NEW(float, sonde_frontal_scratch_size(frontal));
  double *work = SONDE_NEW(double, sonde_frontal_work_size(frontal));
  assert_true(sonde_frontal_factor(frontal, value, factor, work));
  sonde_frontal_solve(frontal, factor, x, scratch);
  for (uint32_t i = 0; i < COUNT; ++i) assert_true(fabs(x[i] - 2) < 1e-6);
  value[41] = -1;
  assert_false(sonde_frontal_factor(frontal, value, factor, work));
  sonde_free(factor);
  sonde_free(scratch);
  sonde_free(work);
  sonde_frontal_destroy(frontal);
}

static void bad_patterns_are_refused(void **state) {
  (void)state;
  const uint32_t start[] = {0, 2, 4}, column[] = {1, 0, 0, 1};
  const sonde_vec3 points[2] = {{0}};
  const sonde_pattern pattern = {2, start, column, points};
  sonde_frontal *frontal;
  assert_int_equal(sonde_frontal_create(&pattern, &frontal, NULL), SONDE_ARGUMENT);
  assert_null(frontal);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_size_is_solved),   cmocka_unit_test(equals_the_other_solver),
      cmocka_unit_test(instruction_sets_agree), cmocka_unit_test(new_numbers_need_no_new_analysis),
      cmocka_unit_test(pieces_may_be_apart),    cmocka_unit_test(bad_patterns_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
