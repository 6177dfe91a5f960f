// Vectors: every operation is the scalar one in each lane, and all instruction sets give the same
// bits.
#include "test.h"

#include "base/random.h"
#include "base/vector.h"
#include "test_vector.h"

#include <math.h>

static void assert_same(double a, double b) { assert_true(a >= b && a <= b); }

static void draw_input(vector_input *in) {
  for (uint32_t k = 0; k < 16; ++k) {
    in->a[k] = (float)(40 * sonde_random_uniform(3, k) - 20);
    in->b[k] = k % 5 ? (float)(40 * sonde_random_uniform(4, k) - 20) : in->a[k];
    in->index[k] = (int32_t)(7 * k % 32);
  }
  for (uint32_t k = 0; k < 8 * 32; ++k) in->record[k] = (float)sonde_random_uniform(5, k);
}

static void lanes_are_scalars(void **state) {
  (void)state;
  vector_input in;
  vector_output out;
  draw_input(&in);
  vectors_of_base(&in, &out);
  double sum = 0;
  uint32_t kept = 0;
  for (int k = 0; k < 16; ++k) {
    const float a = in.a[k], b = in.b[k], positive = fabsf(a) + 1e-3f;
    const float larger = a > b ? a : b, smaller = a < b ? a : b;
    const float due[] = {larger,           smaller,   sqrtf(positive),
                         out.result[3][k], floorf(a), larger,
                         a > b ? a : 0,    truncf(a), a * b + b * a + positive * a};
    for (size_t i = 0; i < sizeof due / sizeof *due; ++i)
      assert_same((double)out.result[i][k], (double)due[i]);
    assert_float_equal(out.result[3][k] * sqrtf(positive), 1, 1e-6);
    assert_int_equal(out.bits >> k & 1, a > b);
    assert_same((double)out.gathered[k], (double)in.record[in.index[k]]);
    for (int c = 0; c < 10; ++c) {
      const float number = in.record[8 * in.index[k] + (c < 4 ? c : c - 4)];
      assert_same((double)out.column[c][k], (double)number);
      if (c < 4) assert_same((double)out.record[4 * k + c], (double)number);
    }
    if (a > 0) assert_same((double)out.kept[kept++], (double)a);
    if (k < 8) {
      assert_same(out.wide[0][k], fmax((double)a, 0.25));
      assert_same(out.wide[1][k], 1 / sqrt((double)positive));
      assert_int_equal(out.wide_bits >> k & 1, a < 0);
    }
    sum += (double)a;
  }
  assert_true(out.some && kept > 3 && kept < 13);
  assert_same(out.sum, sum);
}

static void sets_give_the_same_bits(void **state) {
  (void)state;
  vector_input in;
  vector_output base;
  draw_input(&in);
  vectors_of_base(&in, &base);
#ifdef __x86_64__
  vector_output other;
  if (sonde_vectors_serve("avx2", NULL)) {
    vectors_of_avx2(&in, &other);
    assert_memory_equal(&other, &base, sizeof base);
  }
  if (sonde_vectors_serve("avx512", NULL)) {
    vectors_of_avx512(&in, &other);
    assert_memory_equal(&other, &base, sizeof base);
  }
#endif
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(lanes_are_scalars),
      cmocka_unit_test(sets_give_the_same_bits),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
