// Laws of the multifrontal factor. Condensed on the last nodes of elements with three unknowns: the
// matrix is the dense Schur complement, recovered displacements solve the whole system, shares of
// work change no bit. Of patterns with one or three unknowns per node: residuals, new numbers on an
// old analysis. The same bits from all instruction sets; what is not positive definite is reported.
#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"
#include "sparse/multifrontal.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "grid.h"

enum { SIDE = 5, LAST = 4, CORNERS = 8, OWN = 3 * CORNERS };

// A block of SIDE^3 nodes; the bottom face is held, some nodes of the top are numbered last.
typedef struct block {
  uint32_t nodes, elements;
  uint32_t (*corner)[CORNERS];
  sonde_vec3 *point;
  double sign; // of the element matrices: 1 positive definite
} block;

static uint32_t grid_index(uint32_t x, uint32_t y, uint32_t z) { return (z * SIDE + y) * SIDE + x; }

// Numbers of the nodes above the held layer: those in the middle of the top come last.
static void number_nodes(block *b, uint32_t *number) {
  uint32_t next = 0, last = 0, held = SIDE * SIDE, all = SIDE * SIDE * SIDE;
  b->nodes = all - held;
  for (uint32_t z = 0; z < SIDE; ++z)
    for (uint32_t y = 0; y < SIDE; ++y)
      for (uint32_t x = 0; x < SIDE; ++x) {
        bool is_last = z == SIDE - 1 && x / 2 == 1 && y / 2 == 1;
        uint32_t *to = &number[grid_index(x, y, z)];
        *to = z == 0 ? SONDE_HELD_CORNER : is_last ? b->nodes - LAST + last++ : next++;
        if (z > 0) b->point[*to] = vec3(x, y, z);
      }
  assert_int_equal(last, LAST);
}

static block make(void) {
  block b = {.sign = 1};
  b.point = SONDE_NEW(sonde_vec3, SIDE * SIDE * SIDE);
  b.corner = sonde_calloc((SIDE - 1) * (SIDE - 1) * (SIDE - 1), sizeof *b.corner);
  uint32_t number[SIDE * SIDE * SIDE];
  number_nodes(&b, number);
  for (uint32_t z = 0; z + 1 < SIDE; ++z)
    for (uint32_t y = 0; y + 1 < SIDE; ++y)
      for (uint32_t x = 0; x + 1 < SIDE; ++x, ++b.elements)
        for (uint32_t k = 0; k < CORNERS; ++k)
          b.corner[b.elements][k] = number[grid_index(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2))];
  return b;
}

static void clear(block *b) {
  sonde_free(b->point);
  sonde_free(b->corner);
}

// B B^T plus a little on the diagonal, B random: symmetric, positive definite.
static void element_matrix(const void *user, uint32_t element, double (*k)[OWN]) {
  const block *b = user;
  double random[OWN][OWN];
  for (uint32_t i = 0; i < OWN; ++i)
    for (uint32_t j = 0; j < OWN; ++j)
      random[i][j] = sonde_random_uniform(7, ((uint64_t)element * OWN + i) * OWN + j) - 0.5;
  for (int i = 0; i < OWN; ++i)
    for (int j = 0; j < OWN; ++j) {
      double sum = i == j ? 0.5 : 0;
      for (int m = 0; m < OWN; ++m) sum += random[i][m] * random[j][m];
      k[i][j] = b->sign * sum;
    }
}

static double *dense_of(const block *b) {
  uint32_t n = 3 * b->nodes;
  double *a = SONDE_NEW(double, (size_t)n *n), k[OWN][OWN];
  for (uint32_t e = 0; e < b->elements; ++e) {
    element_matrix(b, e, k);
    for (uint32_t i = 0; i < OWN; ++i)
      for (uint32_t j = 0; j < OWN; ++j) {
        uint32_t p = b->corner[e][i / 3], q = b->corner[e][j / 3];
        if (p == SONDE_HELD_CORNER || q == SONDE_HELD_CORNER) continue;
        a[(size_t)(3 * p + i % 3) * n + 3 * q + j % 3] += k[i][j];
      }
  }
  return a;
}

// Gauss without pivoting on all but the last `keep` rows and columns; they are left with the Schur
// complement.
static void eliminate(double *a, uint32_t n, uint32_t keep) {
  for (uint32_t p = 0; p < n - keep; ++p)
    for (uint32_t i = p + 1; i < n; ++i) {
      double factor = a[(size_t)i * n + p] / a[(size_t)p * n + p];
      for (uint32_t j = p; j < n; ++j) a[(size_t)i * n + j] -= factor * a[(size_t)p * n + j];
    }
}

typedef struct factored {
  sonde_symbolic *symbolic;
  sonde_numeric numeric;
} factored;

static factored factored_of(const sonde_symbolic_def *def) {
  factored f = {0};
  sonde_error error = {0};
  sonde_status status = sonde_symbolic_create(def, &f.symbolic, &error);
  if (!status) status = sonde_numeric_reserve(&f.numeric, f.symbolic, &error);
  if (status) fail_msg("%s", error.message);
  return f;
}

static void factored_clear(factored *f) {
  sonde_numeric_clear(&f->numeric);
  sonde_symbolic_destroy(f->symbolic);
}

// ---- elements -----------------------------------------------------------------------------

static sonde_symbolic_def def_of(const block *b) {
  return (sonde_symbolic_def){.node_count = b->nodes,
                              .last_count = LAST,
                              .block = 3,
                              .points = b->point,
                              .element_count = b->elements,
                              .elements = (const uint32_t(*)[CORNERS])b->corner};
}

static factored factored_block(const block *b) {
  const sonde_symbolic_def def = def_of(b);
  return factored_of(&def);
}

static uint32_t factor(factored *f, const block *b, uint64_t budget) {
  uint32_t steps = 1;
  const sonde_matrix_source source = {.element = element_matrix, .user = b};
  sonde_numeric_begin(&f->numeric, f->symbolic, &source);
  while (!sonde_numeric_step(&f->numeric, budget)) ++steps;
  return steps;
}

static void condensed_is_the_schur_complement(void **state) {
  (void)state;
  block b = make();
  factored f = factored_block(&b);
  factor(&f, &b, UINT64_MAX);
  assert_false(f.numeric.failed);
  const double *got = sonde_numeric_condensed(&f.numeric);
  uint32_t n = 3 * b.nodes, side = 3 * LAST;
  double *a = dense_of(&b), most = 0, off = 0;
  eliminate(a, n, side);
  for (uint32_t i = 0; i < side; ++i)
    for (uint32_t j = 0; j <= i; ++j) {
      double want = a[(size_t)(n - side + i) * n + n - side + j];
      most = fmax(most, fabs(want));
      off = fmax(off, fabs(got[j * side + i] - want));
    }
  assert_true(most > 0 && off < 1e-11 * most);
  sonde_free(a);
  factored_clear(&f);
  clear(&b);
}

// With the last nodes given, no force remains on any other; two at once give what each gives alone.
static void recovered_nodes_are_in_equilibrium(void **state) {
  (void)state;
  block b = make();
  factored f = factored_block(&b);
  factor(&f, &b, UINT64_MAX);
  uint32_t n = 3 * b.nodes, side = 3 * LAST;
  float *x = SONDE_NEW(float, n), *other = SONDE_NEW(float, n), *again = SONDE_NEW(float, n);
  for (uint32_t i = n - side; i < n; ++i) {
    again[i] = x[i] = (float)sonde_random_uniform(9, i);
    other[i] = (float)sonde_random_uniform(10, i);
  }
  sonde_numeric_recover(&f.numeric, &x, 1);
  float *const both[] = {other, again};
  sonde_numeric_recover(&f.numeric, both, 2);
  assert_memory_equal(again, x, n * sizeof *x);
  assert_memory_not_equal(other, x, n * sizeof *x);
  double *a = dense_of(&b), load = 0, rest = 0;
  for (uint32_t i = 0; i < n; ++i) {
    double sum = 0;
    for (uint32_t j = 0; j < n; ++j) sum += a[(size_t)i * n + j] * (double)x[j];
    double *to = i < n - side ? &rest : &load;
    *to = fmax(*to, fabs(sum));
  }
  assert_true(load > 0 && rest < 1e-5 * load); // single precision
  sonde_free(a);
  sonde_free(x);
  sonde_free(other);
  sonde_free(again);
  factored_clear(&f);
  clear(&b);
}

// In single precision, by all instruction sets alike.
static void single_fronts_condense_to_single_precision(void **state) {
  (void)state;
  static const char *const SETS[] = {"base", "avx2", "avx512"};
  block b = make();
  factored exact = factored_block(&b), single = {.symbolic = exact.symbolic};
  single.numeric.single = true;
  assert_int_equal(sonde_numeric_reserve(&single.numeric, single.symbolic, NULL), SONDE_OK);
  factor(&exact, &b, UINT64_MAX);
  const double *want = sonde_numeric_condensed(&exact.numeric);
  const uint32_t side = 3 * LAST;
  float first[9 * LAST * LAST];
  for (size_t k = 0; k < sizeof SETS / sizeof SETS[0]; ++k) {
    double most = 0, off = 0;
    single.numeric.kernels = sonde_dense_kernels_find(SETS[k]);
    if (!single.numeric.kernels) continue;
    factor(&single, &b, k == 0 ? UINT64_MAX : 2000);
    assert_false(single.numeric.failed);
    const float *got = sonde_numeric_condensed_single(&single.numeric);
    for (uint32_t j = 0; j < side; ++j)
      for (uint32_t i = j; i < side; ++i) {
        most = fmax(most, fabs(want[j * side + i]));
        off = fmax(off, fabs((double)got[j * side + i] - want[j * side + i]));
        if (k == 0) first[j * side + i] = got[j * side + i];
        assert_memory_equal(&got[j * side + i], &first[j * side + i], sizeof *got);
      }
    assert_true(most > 0 && off < 3e-6 * most);
    if (k == 0) print_message("condensed in single precision: off by %.1e\n", off / most);
  }
  sonde_numeric_clear(&single.numeric);
  factored_clear(&exact);
  clear(&b);
}

static void shares_of_work_change_nothing(void **state) {
  (void)state;
  block b = make();
  factored whole = factored_block(&b), shared = factored_block(&b);
  assert_int_equal(factor(&whole, &b, UINT64_MAX), 1);
  uint32_t steps = factor(&shared, &b, 2000);
  assert_true(steps > 10);
  assert_int_equal(sonde_symbolic_steps(shared.symbolic, 2000), steps);
  assert_int_equal(sonde_symbolic_steps(whole.symbolic, UINT64_MAX), 1);
  const double *want = sonde_numeric_condensed(&whole.numeric);
  size_t bytes = 9 * LAST * LAST * sizeof(double);
  assert_memory_equal(want, sonde_numeric_condensed(&shared.numeric), bytes);
  factor(&shared, &b, 500); // again on the same pattern
  assert_memory_equal(want, sonde_numeric_condensed(&shared.numeric), bytes);
  assert_true(whole.symbolic->factor_size > 0 && whole.symbolic->macs > 0);
  factored_clear(&whole);
  factored_clear(&shared);
  clear(&b);
}

static void a_bad_pivot_is_reported(void **state) {
  (void)state;
  block b = make();
  factored f = factored_block(&b);
  b.sign = -1;
  factor(&f, &b, UINT64_MAX);
  assert_true(f.numeric.failed);
  b.sign = 1;
  factor(&f, &b, UINT64_MAX);
  assert_false(f.numeric.failed);
  factored_clear(&f);
  clear(&b);
}

static void bad_numbers_are_refused(void **state) {
  (void)state;
  block b = make();
  sonde_symbolic *symbolic = NULL;
  const sonde_symbolic_def def = def_of(&b);
  b.corner[3][5] = b.nodes;
  sonde_error error = {0};
  assert_int_equal(sonde_symbolic_create(&def, &symbolic, &error), SONDE_ARGUMENT);
  assert_null(symbolic);
  assert_true(strlen(error.message) > 0);
  clear(&b);
  const uint32_t start[] = {0, 2, 4}, column[] = {1, 0, 0, 1};
  const sonde_vec3 points[2] = {{0}};
  const sonde_symbolic_def unordered = {
      .node_count = 2, .block = 1, .points = points, .row_start = start, .column = column};
  assert_int_equal(sonde_symbolic_create(&unordered, &symbolic, NULL), SONDE_ARGUMENT);
  assert_null(symbolic);
}

// ---- patterns -----------------------------------------------------------------------------

static factored factored_grid(const csr *a, uint32_t width) {
  const sonde_symbolic_def def = {.node_count = a->n,
                                  .block = width,
                                  .points = a->points,
                                  .row_start = a->start,
                                  .column = a->column};
  return factored_of(&def);
}

static void solve(factored *f, const double *value, double *x) {
  const sonde_matrix_source source = {.value = value};
  assert_true(sonde_numeric_factor(&f->numeric, f->symbolic, &source));
  sonde_numeric_solve(&f->numeric, x);
}

static double *random_vector(uint32_t n) {
  double *b = SONDE_NEW(double, n);
  for (uint32_t i = 0; i < n; ++i) b[i] = sonde_random_normal(1, i);
  return b;
}

// What single precision leaves is taken back by solving for the residual.
static void every_size_is_solved(void **state) {
  (void)state;
  for (uint32_t side = 1; side <= 40; side += side < 12 ? 1 : 7) {
    csr a = grid_matrix(side, 1e-2);
    factored f = factored_grid(&a, 1);
    double *b = random_vector(a.n), *x = random_vector(a.n), *rest = SONDE_NEW(double, a.n);
    solve(&f, a.value, x);
    assert_true(residual(&a, x, b) < 1e-3);
    for (int round = 0; round < 2; ++round) {
      for (uint32_t r = 0; r < a.n; ++r) {
        rest[r] = b[r];
        for (uint32_t p = a.start[r]; p < a.start[r + 1]; ++p)
          rest[r] -= a.value[p] * x[a.column[p]];
      }
      sonde_numeric_solve(&f.numeric, rest);
      for (uint32_t r = 0; r < a.n; ++r) x[r] += rest[r];
    }
    assert_true(residual(&a, x, b) < 1e-10);
    factored_clear(&f);
    sonde_free(b);
    sonde_free(x);
    sonde_free(rest);
    csr_clear(&a);
  }
}

// Each number of a grid's matrix times one block B B^T + 1 makes a system of three unknowns per
// node; its solution is that of the grid with the block's inverse applied to the right-hand side.
static void three_unknowns_per_node_are_solved(void **state) {
  (void)state;
  static const double block3[3][3] = {{2, 0.5, -0.3}, {0.5, 1.5, 0.2}, {-0.3, 0.2, 1}};
  csr a = grid_matrix(17, 1e-2);
  double *value = SONDE_NEW(double, 9 * (size_t)a.start[a.n]), *x = SONDE_NEW(double, 3 * a.n);
  double *plain[3];
  factored wide = factored_grid(&a, 3), narrow = factored_grid(&a, 1);
  for (uint32_t p = 0; p < a.start[a.n]; ++p)
    for (int i = 0; i < 9; ++i)
      value[9 * (size_t)p + (size_t)i] = a.value[p] * block3[i / 3][i % 3];
  for (uint32_t c = 0; c < 3; ++c) {
    plain[c] = SONDE_NEW(double, a.n);
    for (uint32_t i = 0; i < a.n; ++i) plain[c][i] = sonde_random_normal(c, i);
    solve(&narrow, a.value, plain[c]);
  }
  for (uint32_t i = 0; i < a.n; ++i)
    for (uint32_t r = 0; r < 3; ++r)
      for (uint32_t c = 0; c < 3; ++c) x[3 * i + r] += block3[r][c] * sonde_random_normal(c, i);
  solve(&wide, value, x);
  for (uint32_t i = 0; i < a.n; ++i)
    for (uint32_t c = 0; c < 3; ++c) assert_true(fabs(x[3 * i + c] - plain[c][i]) < 1e-4);
  for (uint32_t c = 0; c < 3; ++c) sonde_free(plain[c]);
  factored_clear(&wide);
  factored_clear(&narrow);
  sonde_free(value);
  sonde_free(x);
  csr_clear(&a);
}

// Without the couplings of one line of the grid the matrix falls into two.
static void new_numbers_need_no_new_analysis(void **state) {
  (void)state;
  csr a = grid_matrix(20, 0.3);
  factored f = factored_grid(&a, 1);
  double *b = random_vector(a.n), *x = random_vector(a.n);
  solve(&f, a.value, x);
  for (uint32_t r = 0; r < a.n; ++r)
    for (uint32_t p = a.start[r]; p < a.start[r + 1]; ++p)
      if ((r / 20 < 9) != (a.column[p] / 20 < 9)) a.value[p] = 0;
  memcpy(x, b, a.n * sizeof *x);
  solve(&f, a.value, x);
  assert_true(residual(&a, x, b) < 1e-4);
  factored_clear(&f);
  sonde_free(b);
  sonde_free(x);
  csr_clear(&a);
}

// One store of numbers serves several analyses, one after another.
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
  csr grid = grid_matrix(9, 1e-2), apart = {COUNT, start, column, value, points};
  factored f = factored_grid(&apart, 1), other = factored_grid(&grid, 1);
  assert_int_equal(sonde_numeric_reserve(&f.numeric, other.symbolic, NULL), SONDE_OK);
  solve(&f, value, x);
  for (uint32_t i = 0; i < COUNT; ++i) assert_true(fabs(x[i] - 2) < 1e-6);
  sonde_matrix_source source = {.value = grid.value};
  double *b = random_vector(grid.n), *y = random_vector(grid.n);
  assert_true(sonde_numeric_factor(&f.numeric, other.symbolic, &source));
  sonde_numeric_solve(&f.numeric, y);
  assert_true(residual(&grid, y, b) < 1e-3);
  value[41] = -1;
  source.value = value;
  assert_false(sonde_numeric_factor(&f.numeric, f.symbolic, &source));
  factored_clear(&f);
  factored_clear(&other);
  sonde_free(b);
  sonde_free(y);
  csr_clear(&grid);
}

// ---- instruction sets ---------------------------------------------------------------------

static double noise(uint64_t *x) {
  *x = *x * 6364136223846793005u + 1442695040888963407u;
  return (double)(*x >> 40) / (double)(1 << 24) - 0.5;
}

// Symmetric, diagonally dominant: lower triangle by columns, zero rows behind.
static double *matrix_of(uint32_t n) {
  uint64_t x = n;
  double *f = calloc((size_t)n * sonde_front_stride(n), sizeof *f);
  assert_non_null(f);
  for (size_t j = 0; j < n; ++j)
    for (size_t i = j; i < n; ++i) f[j * sonde_front_stride(n) + i] = noise(&x) + (i == j ? n : 0);
  return f;
}

static float *single_of(const double *f, uint32_t n) {
  float *g = calloc((size_t)n * sonde_front_stride(n), sizeof *g);
  assert_non_null(g);
  for (size_t k = 0; k < n * sonde_front_stride(n); ++k) g[k] = (float)f[k];
  return g;
}

static void eliminated(const sonde_dense_kernels *set, double *f, float *g, uint32_t n) {
  uint32_t own = 2 * n / 3;
  for (uint32_t from = 0; from < own; from += 45) {
    const uint32_t to = from + 45 < own ? from + 45 : own;
    assert_true(set->eliminate(f, n, from, to));
    assert_true(set->eliminate_single(g, n, from, to));
  }
}

// Fewer rows than a vector has, more than a band, and what divides by nothing.
static void every_instruction_set_gives_the_same_bits(void **state) {
  (void)state;
  static const uint32_t SIZES[] = {1, 3, 7, 40, 101, 263};
  static const char *const SETS[] = {"avx2", "avx512"};
  for (size_t k = 0; k < sizeof SETS / sizeof SETS[0]; ++k) {
    const sonde_dense_kernels *wide = sonde_dense_kernels_find(SETS[k]);
    if (!wide) continue;
    for (size_t q = 0; q < sizeof SIZES / sizeof SIZES[0]; ++q) {
      uint32_t n = SIZES[q];
      double *a = matrix_of(n), *b = matrix_of(n);
      float *c = single_of(a, n), *d = single_of(a, n);
      eliminated(&sonde_dense_kernels_base, a, c, n);
      eliminated(wide, b, d, n);
      for (size_t j = 0; j < n; ++j) {
        size_t at = j * sonde_front_stride(n) + j;
        assert_memory_equal(a + at, b + at, (n - j) * sizeof *a);
        assert_memory_equal(c + at, d + at, (n - j) * sizeof *c);
        for (size_t i = j; i < n; ++i)
          assert_true(fabs((double)c[at + i - j] - a[at + i - j]) < 3e-6 * n);
      }
      free(c);
      free(d);
      free(a);
      free(b);
    }
    csr grid = grid_matrix(37, 1e-2);
    factored f = factored_grid(&grid, 1);
    double *x = random_vector(grid.n), *y = random_vector(grid.n);
    f.numeric.kernels = wide;
    solve(&f, grid.value, x);
    f.numeric.kernels = &sonde_dense_kernels_base;
    solve(&f, grid.value, y);
    assert_memory_equal(x, y, grid.n * sizeof *x);
    factored_clear(&f);
    sonde_free(x);
    sonde_free(y);
    csr_clear(&grid);
  }
  assert_null(sonde_dense_kernels_find("no such set"));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(condensed_is_the_schur_complement),
                                     cmocka_unit_test(recovered_nodes_are_in_equilibrium),
                                     cmocka_unit_test(single_fronts_condense_to_single_precision),
                                     cmocka_unit_test(shares_of_work_change_nothing),
                                     cmocka_unit_test(a_bad_pivot_is_reported),
                                     cmocka_unit_test(bad_numbers_are_refused),
                                     cmocka_unit_test(every_size_is_solved),
                                     cmocka_unit_test(three_unknowns_per_node_are_solved),
                                     cmocka_unit_test(new_numbers_need_no_new_analysis),
                                     cmocka_unit_test(pieces_may_be_apart),
                                     cmocka_unit_test(every_instruction_set_gives_the_same_bits)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
