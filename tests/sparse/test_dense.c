// Dense products and triangular systems: the same bits as plain loops, whatever the instruction
// set.
#include "../fixture.h"
#include "base/random.h"
#include "sparse/dense.h"

static double *random_matrix(uint32_t rows, uint32_t columns, uint64_t seed) {
  double *a = SONDE_NEW(double, (size_t)rows *columns);
  for (uint32_t k = 0; k < rows * columns; ++k) a[k] = sonde_random_normal(seed, k);
  return a;
}

// Positive definite: B B^T + 1.
static double *definite_matrix(uint32_t n) {
  double *a = SONDE_NEW(double, (size_t)n *n), *b = random_matrix(n, n, 7);
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < n; ++j) {
      a[i * n + j] = i == j;
      for (uint32_t k = 0; k < n; ++k) a[i * n + j] += b[i * n + k] * b[j * n + k];
    }
  sonde_free(b);
  return a;
}

// Every shape, by every set of instructions.
static void products_are_those_of_plain_loops(void **state) {
  (void)state;
  const sonde_dense_kernels *sets[] = {&sonde_dense_kernels_base, sonde_dense_kernels_find(NULL)};
  for (uint32_t rows = 1; rows < 7; ++rows)
    for (uint32_t columns = 1; columns < 20; columns += 3)
      for (int kind = 0; kind < 3; ++kind) {
        enum { DEPTH = 9 };
        double *a = random_matrix(DEPTH, rows, 1), *b = random_matrix(DEPTH, columns, 2);
        double weight[DEPTH];
        for (int k = 0; k < DEPTH; ++k) weight[k] = 0.3 * k;
        for (size_t set = 0; set < SONDE_COUNT_OF(sets); ++set) {
          double *c = random_matrix(rows, columns, 3), *plain = random_matrix(rows, columns, 3);
          const sonde_product p = {.c = c,
                                   .c_row = columns,
                                   .a = a,
                                   .a_row = 1,
                                   .a_step = rows,
                                   .b = b,
                                   .b_row = columns,
                                   .rows = rows,
                                   .columns = columns,
                                   .depth = DEPTH,
                                   .weight = kind == 1 ? weight : NULL,
                                   .subtract = kind == 2};
          sets[set]->multiply(&p);
          for (uint32_t i = 0; i < rows; ++i)
            for (uint32_t j = 0; j < columns; ++j)
              for (uint32_t k = 0; k < DEPTH; ++k) {
                double x = kind == 1 ? weight[k] * a[k * rows + i] : a[k * rows + i];
                double part = x * b[k * columns + j];
                plain[i * columns + j] += kind == 2 ? -part : part;
              }
          assert_memory_equal(c, plain, (size_t)rows * columns * sizeof *c);
          sonde_free(c);
          sonde_free(plain);
        }
        sonde_free(a);
        sonde_free(b);
      }
}

// L L^T is the matrix again; many right-hand sides give the bits of single ones.
static void factors_solve(void **state) {
  (void)state;
  const uint32_t sizes[] = {1, 3, 16, 17, 45};
  for (size_t s = 0; s < SONDE_COUNT_OF(sizes); ++s) {
    enum { COLUMNS = 5 };
    uint32_t n = sizes[s];
    double *a = definite_matrix(n), *l = definite_matrix(n), *x = random_matrix(n, COLUMNS, 5);
    double *many = random_matrix(n, COLUMNS, 5), *one = SONDE_NEW(double, n);
    assert_true(sonde_cholesky(l, n));
    sonde_cholesky_solve_many(l, n, many, COLUMNS);
    for (uint32_t c = 0; c < COLUMNS; ++c) {
      for (uint32_t i = 0; i < n; ++i) one[i] = x[i * COLUMNS + c];
      sonde_cholesky_solve(l, n, one);
      for (uint32_t i = 0; i < n; ++i) assert_near(many[i * COLUMNS + c], one[i], 0);
      for (uint32_t i = 0; i < n; ++i) {
        double sum = -x[i * COLUMNS + c];
        for (uint32_t j = 0; j < n; ++j) sum += a[i * n + j] * one[j];
        assert_near(sum, 0, 1e-8);
      }
    }
    l[0] = -1;
    assert_false(sonde_cholesky(l, n));
    sonde_free(a);
    sonde_free(l);
    sonde_free(x);
    sonde_free(many);
    sonde_free(one);
  }
}

static void outer_products_add_up(void **state) {
  (void)state;
  enum { N = 37, COUNT = 6 };
  double *rows = random_matrix(COUNT, N, 1), *a = SONDE_NEW(double, (size_t)N *N);
  double *turned = SONDE_NEW(double, (size_t)N *COUNT);
  const double weight[COUNT] = {1, 2, 0, 0.5, 3, 1};
  sonde_add_outers(a, N, rows, COUNT, weight);
  sonde_transpose(rows, COUNT, N, turned);
  for (uint32_t i = 0; i < N; ++i)
    for (uint32_t j = 0; j <= i; ++j) {
      double sum = 0;
      for (uint32_t k = 0; k < COUNT; ++k)
        sum += weight[k] * turned[i * COUNT + k] * rows[k * N + j];
      assert_near(a[i * N + j], sum, 1e-12);
    }
  sonde_free(rows);
  sonde_free(turned);
  sonde_free(a);
}

static void the_inverse_undoes_the_matrix(void **state) {
  (void)state;
  enum { N = 70 };
  double *a = definite_matrix(N), *f = definite_matrix(N), *x = SONDE_NEW(double, N *N);
  assert_true(sonde_cholesky(f, N));
  sonde_cholesky_invert(f, N, x);
  for (size_t i = 0; i < N; ++i)
    for (size_t j = 0; j < N; ++j) {
      double sum = 0;
      for (size_t k = 0; k < N; ++k) sum += a[i * N + k] * x[k * N + j];
      assert_true(fabs(sum - (i == j)) < 1e-9);
    }
  a[0] = -1;
  assert_false(sonde_cholesky(a, N));
  sonde_free(a);
  sonde_free(f);
  sonde_free(x);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(products_are_those_of_plain_loops),
      cmocka_unit_test(factors_solve),
      cmocka_unit_test(outer_products_add_up),
      cmocka_unit_test(the_inverse_undoes_the_matrix),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
