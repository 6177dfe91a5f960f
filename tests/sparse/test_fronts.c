// Laws of the multifrontal factor: the condensed matrix is the dense Schur complement, recovered
// displacements solve the whole system, slices of work change no bit, a bad pivot is reported.
#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"
#include "sparse/fronts.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

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
        *to = z == 0 ? SONDE_FRONT_NONE : is_last ? b->nodes - LAST + last++ : next++;
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
        if (p == SONDE_FRONT_NONE || q == SONDE_FRONT_NONE) continue;
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

static sonde_fronts *fronts_of(const block *b) {
  sonde_fronts_def def = {b->nodes, LAST, b->point, b->elements,
                          (const uint32_t(*)[CORNERS])b->corner};
  sonde_fronts *fronts = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_fronts_create(&def, &fronts, &error);
  if (status) fail_msg("%s", error.message);
  return fronts;
}

static uint32_t factor(sonde_fronts *fronts, const block *b, uint64_t budget) {
  uint32_t steps = 1;
  sonde_fronts_begin(fronts);
  while (!sonde_fronts_step(fronts, element_matrix, b, budget)) ++steps;
  return steps;
}

static void condensed_is_the_schur_complement(void **state) {
  (void)state;
  block b = make();
  sonde_fronts *fronts = fronts_of(&b);
  factor(fronts, &b, UINT64_MAX);
  assert_false(sonde_fronts_failed(fronts));
  const double *got = sonde_fronts_condensed(fronts);
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
  sonde_fronts_destroy(fronts);
  clear(&b);
}

// With the last nodes given, no force is left on any other; two at once give what each gives alone.
static void recovered_nodes_are_in_equilibrium(void **state) {
  (void)state;
  block b = make();
  sonde_fronts *fronts = fronts_of(&b);
  factor(fronts, &b, UINT64_MAX);
  uint32_t n = 3 * b.nodes, side = 3 * LAST;
  float *x = SONDE_NEW(float, n), *other = SONDE_NEW(float, n), *again = SONDE_NEW(float, n);
  for (uint32_t i = n - side; i < n; ++i) {
    again[i] = x[i] = (float)sonde_random_uniform(9, i);
    other[i] = (float)sonde_random_uniform(10, i);
  }
  sonde_fronts_recover(fronts, &x, 1);
  float *const both[] = {other, again};
  sonde_fronts_recover(fronts, both, 2);
  assert_memory_equal(again, x, n * sizeof *x);
  assert_memory_not_equal(other, x, n * sizeof *x);
  double *a = dense_of(&b), load = 0, left = 0;
  for (uint32_t i = 0; i < n; ++i) {
    double sum = 0;
    for (uint32_t j = 0; j < n; ++j) sum += a[(size_t)i * n + j] * (double)x[j];
    double *to = i < n - side ? &left : &load;
    *to = fmax(*to, fabs(sum));
  }
  assert_true(load > 0 && left < 1e-5 * load); // single precision
  sonde_free(a);
  sonde_free(x);
  sonde_free(other);
  sonde_free(again);
  sonde_fronts_destroy(fronts);
  clear(&b);
}

static void slices_change_nothing(void **state) {
  (void)state;
  block b = make();
  sonde_fronts *whole = fronts_of(&b), *sliced = fronts_of(&b);
  assert_int_equal(factor(whole, &b, UINT64_MAX), 1);
  uint32_t steps = factor(sliced, &b, 2000);
  assert_true(steps > 10);
  assert_int_equal(sonde_fronts_steps(sliced, 2000), steps);
  assert_int_equal(sonde_fronts_steps(whole, UINT64_MAX), 1);
  size_t bytes = 9 * LAST * LAST * sizeof(double);
  assert_memory_equal(sonde_fronts_condensed(whole), sonde_fronts_condensed(sliced), bytes);
  factor(sliced, &b, 500); // again on the same pattern
  assert_memory_equal(sonde_fronts_condensed(whole), sonde_fronts_condensed(sliced), bytes);
  assert_true(sonde_fronts_nonzeros(whole) > 0 && sonde_fronts_work(whole) > 0);
  sonde_fronts_destroy(whole);
  sonde_fronts_destroy(sliced);
  clear(&b);
}

static void a_bad_pivot_is_reported(void **state) {
  (void)state;
  block b = make();
  sonde_fronts *fronts = fronts_of(&b);
  b.sign = -1;
  factor(fronts, &b, UINT64_MAX);
  assert_true(sonde_fronts_failed(fronts));
  b.sign = 1;
  factor(fronts, &b, UINT64_MAX);
  assert_false(sonde_fronts_failed(fronts));
  sonde_fronts_destroy(fronts);
  clear(&b);
}

static void bad_numbers_are_refused(void **state) {
  (void)state;
  block b = make();
  sonde_fronts *fronts = NULL;
  sonde_fronts_def def = {b.nodes, LAST, b.point, b.elements, (const uint32_t(*)[CORNERS])b.corner};
  b.corner[3][5] = b.nodes;
  sonde_error error = {0};
  assert_int_equal(sonde_fronts_create(&def, &fronts, &error), SONDE_ARGUMENT);
  assert_null(fronts);
  assert_true(strlen(error.message) > 0);
  clear(&b);
}

static double noise(uint64_t *x) {
  *x = *x * 6364136223846793005u + 1442695040888963407u;
  return (double)(*x >> 40) / (double)(1 << 24) - 0.5;
}

// Symmetric, diagonally dominant: lower triangle by columns.
static double *matrix_of(uint32_t n) {
  uint64_t x = n;
  double *f = calloc((size_t)n * n, sizeof *f);
  assert_non_null(f);
  for (size_t j = 0; j < n; ++j)
    for (size_t i = j; i < n; ++i) f[j * n + i] = noise(&x) + (i == j ? n : 0);
  return f;
}

static double entry(const double *f, uint32_t n, size_t i, size_t j) {
  return i >= j ? f[j * n + i] : f[i * n + j];
}

static void eliminated(const sonde_front_kernels *set, double *f, uint32_t n) {
  uint32_t own = 2 * n / 3;
  for (uint32_t from = 0; from < own; from += 45)
    assert_true(set->eliminate(f, n, from, from + 45 < own ? from + 45 : own));
}

// Fewer rows than a vector has, more than a band, and what divides by nothing.
static void every_instruction_set_gives_the_same_bits(void **state) {
  (void)state;
  static const uint32_t SIZES[] = {1, 3, 7, 40, 101, 263};
  static const char *const SETS[] = {"avx2", "avx512"};
  for (size_t k = 0; k < sizeof SETS / sizeof SETS[0]; ++k) {
    const sonde_front_kernels *wide = sonde_front_kernels_find(SETS[k]);
    if (!wide) continue;
    for (size_t q = 0; q < sizeof SIZES / sizeof SIZES[0]; ++q) {
      uint32_t n = SIZES[q];
      size_t bytes = (size_t)n * n * sizeof(double);
      double *a = matrix_of(n), *b = matrix_of(n), *x = malloc(bytes), *y = malloc(bytes);
      eliminated(&sonde_front_kernels_base, a, n);
      eliminated(wide, b, n);
      assert_memory_equal(a, b, bytes);
      free(a);
      free(b);
      a = matrix_of(n), b = matrix_of(n);
      assert_true(sonde_front_kernels_base.invert(a, n, x) && wide->invert(b, n, y));
      assert_memory_equal(x, y, bytes);
      float from[263], one[263] = {0}, other[263] = {0};
      for (uint32_t i = 0; i < n; ++i) from[i] = (float)x[i];
      sonde_front_kernels_base.subtract(one, from, 0.3f, n);
      wide->subtract(other, from, 0.3f, n);
      assert_memory_equal(one, other, n * sizeof *one);
      free(a), free(b), free(x), free(y);
    }
  }
}

static void the_inverse_undoes_the_matrix(void **state) {
  (void)state;
  const uint32_t n = 70;
  double *a = matrix_of(n), *f = matrix_of(n), *x = malloc(n * n * sizeof *x);
  assert_true(sonde_front_kernels_find(NULL)->invert(f, n, x));
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j) {
      double sum = 0;
      for (size_t k = 0; k < n; ++k) sum += entry(a, n, i, k) * x[k * n + j];
      assert_true(fabs(sum - (i == j)) < 1e-12);
    }
  a[0] = -1;
  assert_false(sonde_front_kernels_find(NULL)->invert(a, n, x));
  assert_null(sonde_front_kernels_find("none"));
  free(a), free(f), free(x);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(condensed_is_the_schur_complement),
                                     cmocka_unit_test(recovered_nodes_are_in_equilibrium),
                                     cmocka_unit_test(slices_change_nothing),
                                     cmocka_unit_test(a_bad_pivot_is_reported),
                                     cmocka_unit_test(bad_numbers_are_refused),
                                     cmocka_unit_test(every_instruction_set_gives_the_same_bits),
                                     cmocka_unit_test(the_inverse_undoes_the_matrix)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
