// The block matrix against dense arithmetic, and the conjugate gradients against elimination.
#include "../fixture.h"
#include "sparse/block.h"

enum { N = 24, PAIRS = 60 };

typedef struct system {
  sonde_block_matrix *matrix;
  uint32_t pairs[PAIRS][2];
  double dense[3 * N][3 * N];
} system_t;

// Random symmetric positive definite matrix: a Laplacian of random blocks plus mass.
static void make(system_t *s) {
  uint64_t seed = 11;
  uint32_t count = 0;
  for (uint32_t i = 0; i < N; ++i)
    for (uint32_t step = 1; step < 4 && count < PAIRS; ++step)
      if (i + step * step < N) {
        s->pairs[count][0] = i;
        s->pairs[count++][1] = i + step * step;
      }
  assert_int_equal(
      sonde_block_matrix_create(N, count, (const uint32_t(*)[2])s->pairs, &s->matrix, NULL),
      SONDE_OK);
  for (uint32_t i = 0; i < N; ++i) s->matrix->diagonal[i] = m_diag(0.1);
  for (uint32_t e = 0; e < count; ++e) {
    // u u^T on the pair (u_i, u_j): positive semidefinite and with an unsymmetric block u_i u_j^T.
    sonde_vec3 a = fixture_vector(&seed, 1), b = fixture_vector(&seed, 1);
    for (uint32_t r = 0; r < 3; ++r)
      for (uint32_t c = 0; c < 3; ++c) {
        const double x[3] = {a.x, a.y, a.z}, y[3] = {b.x, b.y, b.z};
        s->matrix->diagonal[s->pairs[e][0]].m[r][c] += x[r] * x[c];
        s->matrix->diagonal[s->pairs[e][1]].m[r][c] += y[r] * y[c];
        s->matrix->upper[e].m[r][c] = x[r] * y[c];
      }
  }
  memset(s->dense, 0, sizeof s->dense);
  for (uint32_t i = 0; i < N; ++i)
    for (uint32_t r = 0; r < 3; ++r)
      for (uint32_t c = 0; c < 3; ++c)
        s->dense[3 * i + r][3 * i + c] = s->matrix->diagonal[i].m[r][c];
  for (uint32_t e = 0; e < count; ++e)
    for (uint32_t r = 0; r < 3; ++r)
      for (uint32_t c = 0; c < 3; ++c) {
        uint32_t i = s->pairs[e][0], j = s->pairs[e][1];
        s->dense[3 * i + r][3 * j + c] = s->dense[3 * j + c][3 * i + r] =
            s->matrix->upper[e].m[r][c];
      }
}

static void fill(sonde_vec3 *x, uint64_t seed) {
  for (uint32_t i = 0; i < N; ++i) x[i] = fixture_vector(&seed, 1);
}

static void dense_multiply(const system_t *s, const double *x, double *y) {
  for (uint32_t r = 0; r < 3 * N; ++r) {
    y[r] = 0;
    for (uint32_t c = 0; c < 3 * N; ++c) y[r] += s->dense[r][c] * x[c];
  }
}

static void dense_solve(const system_t *s, const double *b, double *x) {
  static double a[3 * N][3 * N + 1];
  for (uint32_t r = 0; r < 3 * N; ++r) {
    memcpy(a[r], s->dense[r], sizeof s->dense[r]);
    a[r][3 * N] = b[r];
  }
  for (uint32_t k = 0; k < 3 * N; ++k)
    for (uint32_t r = k + 1; r < 3 * N; ++r)
      for (uint32_t c = 3 * N + 1; c-- > k;) a[r][c] -= a[r][k] / a[k][k] * a[k][c];
  for (uint32_t k = 3 * N; k-- > 0;) {
    x[k] = a[k][3 * N];
    for (uint32_t c = k + 1; c < 3 * N; ++c) x[k] -= a[k][c] * x[c];
    x[k] /= a[k][k];
  }
}

static double difference(const sonde_vec3 *x, const double *y) {
  double worst = 0;
  for (uint32_t k = 0; k < 3 * N; ++k) worst = fmax(worst, fabs((&x[0].x)[k] - y[k]));
  return worst;
}

static void product_equals_dense(void **state) {
  (void)state;
  static system_t s;
  sonde_vec3 x[N], y[N];
  double expected[3 * N];
  make(&s);
  fill(x, 5);
  sonde_block_multiply(s.matrix, NULL, NULL, 0, x, y);
  dense_multiply(&s, &x[0].x, expected);
  assert_true(difference(y, expected) < 1e-13);
  sonde_block_matrix_destroy(s.matrix);
}

static void rank_one_term_is_added(void **state) {
  (void)state;
  static system_t s;
  make(&s);
  const uint32_t rows[3] = {2, 7, 19};
  sonde_vec3 g[3], x[N], y[N];
  uint64_t seed = 3;
  for (uint32_t k = 0; k < 3; ++k) g[k] = fixture_vector(&seed, 1);
  sonde_rank_one term = {2.5, 3, rows, g};
  for (uint32_t a = 0; a < 3; ++a)
    for (uint32_t b = 0; b < 3; ++b)
      for (uint32_t r = 0; r < 3; ++r)
        for (uint32_t c = 0; c < 3; ++c)
          s.dense[3 * rows[a] + r][3 * rows[b] + c] += 2.5 * (&g[a].x)[r] * (&g[b].x)[c];
  double expected[3 * N];
  fill(x, 6);
  sonde_block_multiply(s.matrix, NULL, &term, 1, x, y);
  dense_multiply(&s, &x[0].x, expected);
  assert_true(difference(y, expected) < 1e-13);
  sonde_block_matrix_destroy(s.matrix);
}

// On a subset of rows the product is that of the submatrix: outside entries count as zero.
static void active_rows_are_the_submatrix(void **state) {
  (void)state;
  static system_t s;
  make(&s);
  uint32_t rows[N], pairs[PAIRS], row_count = 0, pair_count = 0;
  for (uint32_t i = 0; i < N; ++i)
    if (i % 3 != 1) rows[row_count++] = i;
  for (uint32_t e = 0; e < s.matrix->pair_count; ++e)
    if (s.pairs[e][0] % 3 != 1 && s.pairs[e][1] % 3 != 1) pairs[pair_count++] = e;
  sonde_active_set active = {rows, row_count, pairs, pair_count};
  sonde_vec3 x[N], y[N];
  fill(x, 7);
  for (uint32_t i = 1; i < N; i += 3) x[i] = vec3(0, 0, 0);
  sonde_block_multiply(s.matrix, &active, NULL, 0, x, y);
  double expected[3 * N];
  dense_multiply(&s, &x[0].x, expected);
  for (uint32_t r = 0; r < row_count; ++r)
    for (uint32_t k = 0; k < 3; ++k)
      assert_near((&y[rows[r]].x)[k], expected[3 * rows[r] + k], 1e-13);
  sonde_block_matrix_destroy(s.matrix);
}

static void gradients_equal_elimination(void **state) {
  (void)state;
  static system_t s;
  make(&s);
  sonde_vec3 b[N], x[N] = {{0}}, scratch[4][N];
  double expected[3 * N];
  fill(b, 8);
  dense_solve(&s, &b[0].x, expected);
  sonde_block_invert_diagonal(s.matrix, NULL);
  const sonde_pcg_scratch work = {scratch[0], scratch[1], scratch[2], scratch[3]};
  const sonde_pcg_options options = {1e-13, 0, 1000};
  sonde_pcg_result result = sonde_pcg_solve(s.matrix, NULL, NULL, 0, b, x, &work, &options);
  assert_true(result.converged);
  assert_true(result.iterations > 3);
  assert_true(difference(x, expected) < 1e-8);
  // Warm start at the solution: nothing is left to do.
  const sonde_pcg_options loose = {1e-10, 0, 1000};
  result = sonde_pcg_solve(s.matrix, NULL, NULL, 0, b, x, &work, &loose);
  assert_int_equal(result.iterations, 0);
  sonde_block_matrix_destroy(s.matrix);
}

// Stiff along one direction alone, beyond what numbers resolve: the preconditioner stays positive.
static void block_without_volume_is_inverted(void **state) {
  (void)state;
  static system_t s;
  make(&s);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) s.matrix->diagonal[0].m[i][k] = 1e20;
  sonde_block_invert_diagonal(s.matrix, NULL);
  static const int diagonal[] = {0, 3, 5};
  for (int k = 0; k < 3; ++k)
    assert_true((double)s.matrix->inverse[0][diagonal[k]] > 0 &&
                (double)s.matrix->inverse[0][diagonal[k]] < 1);
  sonde_block_matrix_destroy(s.matrix);
}

static void limit_of_iterations_is_reported(void **state) {
  (void)state;
  static system_t s;
  make(&s);
  sonde_vec3 b[N], x[N] = {{0}}, scratch[4][N];
  fill(b, 9);
  sonde_block_invert_diagonal(s.matrix, NULL);
  const sonde_pcg_scratch work = {scratch[0], scratch[1], scratch[2], scratch[3]};
  const sonde_pcg_options options = {1e-13, 0, 2};
  sonde_pcg_result result = sonde_pcg_solve(s.matrix, NULL, NULL, 0, b, x, &work, &options);
  assert_false(result.converged);
  assert_int_equal(result.iterations, 2);
  assert_true(result.residual > 1e-13 * result.reference);
  sonde_block_matrix_destroy(s.matrix);
}

// The stored numbers grow with rows and pairs, far below the square of a dense matrix.
static void memory_is_linear(void **state) {
  (void)state;
  static system_t s;
  make(&s);
  size_t bytes = sonde_block_matrix_bytes(s.matrix);
  assert_true(bytes <= N * (9 + 6) * 8 + s.matrix->pair_count * (9 * 8 + 8));
  assert_true(bytes < sizeof s.dense);
  sonde_block_matrix_destroy(s.matrix);
}

static void unordered_pairs_are_refused(void **state) {
  (void)state;
  const uint32_t pairs[1][2] = {{3, 1}};
  sonde_block_matrix *matrix;
  sonde_error error;
  assert_int_equal(sonde_block_matrix_create(4, 1, pairs, &matrix, &error), SONDE_ARGUMENT);
  assert_null(matrix);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(product_equals_dense),
                                     cmocka_unit_test(rank_one_term_is_added),
                                     cmocka_unit_test(active_rows_are_the_submatrix),
                                     cmocka_unit_test(gradients_equal_elimination),
                                     cmocka_unit_test(block_without_volume_is_inverted),
                                     cmocka_unit_test(limit_of_iterations_is_reported),
                                     cmocka_unit_test(memory_is_linear),
                                     cmocka_unit_test(unordered_pairs_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
