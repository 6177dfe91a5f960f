// Elementary functions: every one within its stated bound of long double, the special values of
// C17, and the same bits everywhere, as one hash of them all.
#include "test.h"

#include "base/elementary.h"

#include <float.h>
#include <inttypes.h>
#include <stdlib.h>

enum { SAMPLES = 20000 };

// Own functions behind pointers, beside the ones of the C library in long double.
#define OWN(name)                                                                                  \
  static double own_##name(double x, double y) {                                                   \
    (void)y;                                                                                       \
    return name(x);                                                                                \
  }                                                                                                \
  static long double wide_##name(long double x, long double y) {                                   \
    (void)y;                                                                                       \
    return name##l(x);                                                                             \
  }
#define OWN_OF_TWO(name)                                                                           \
  static double own_##name(double x, double y) { return name(x, y); }                              \
  static long double wide_##name(long double x, long double y) { return name##l(x, y); }
#define OWN_SINGLE(name, wide)                                                                     \
  static double own_##name(double x, double y) {                                                   \
    (void)y;                                                                                       \
    return (double)name((float)x);                                                                 \
  }                                                                                                \
  static long double wide_##name(long double x, long double y) {                                   \
    (void)y;                                                                                       \
    return wide((long double)(float)x);                                                            \
  }
OWN(exp)
OWN(expm1)
OWN(log)
OWN(log1p)
OWN(log2)
OWN(log10)
OWN(cbrt)
OWN(sin)
OWN(cos)
OWN(tan)
OWN(atan)
OWN(asin)
OWN(acos)
OWN_OF_TWO(pow)
OWN_OF_TWO(atan2)
OWN_OF_TWO(hypot)
OWN_SINGLE(expf, expl)
OWN_SINGLE(exp2f, exp2l)
OWN_SINGLE(log10f, log10l)
OWN_SINGLE(sinf, sinl)
OWN_SINGLE(cosf, cosl)

typedef struct law {
  const char *name;
  double (*own)(double x, double y);
  long double (*wide)(long double x, long double y);
  double low, high; // of x, even in its size where `sizes`
  bool sizes;
  double y_low, y_high;
  double bound_ulp;
} law;

#define LAW(name, low, high, sizes, y_low, y_high, bound)                                          \
  { #name, own_##name, wide_##name, low, high, sizes, y_low, y_high, bound }
static const law LAWS[] = {
    LAW(exp, -2, 2, false, 0, 0, 1),
    LAW(exp, -745, 709.7, false, 0, 0, 1),
    LAW(expm1, -3, 3, false, 0, 0, 2),
    LAW(expm1, 1e-18, 700, true, 0, 0, 2),
    LAW(log, 0.4, 3, false, 0, 0, 1),
    LAW(log, 1e-310, 1e308, true, 0, 0, 1),
    LAW(log1p, -0.999, 3, false, 0, 0, 1),
    LAW(log1p, 1e-18, 1e18, true, 0, 0, 1),
    LAW(log2, 0.4, 3, false, 0, 0, 0.51),
    LAW(log2, 1e-310, 1e308, true, 0, 0, 0.51),
    LAW(log10, 0.4, 3, false, 0, 0, 0.51),
    LAW(log10, 1e-310, 1e308, true, 0, 0, 0.51),
    LAW(cbrt, 1e-310, 1e308, true, 0, 0, 1),
    LAW(pow, 1e-3, 1e3, true, -3, 3, 1),
    LAW(pow, 1e-10, 1e10, true, -30, 30, 1),
    LAW(pow, 0.99, 1.01, false, -70000, 70000, 1),
    LAW(sin, -7, 7, false, 0, 0, 1),
    LAW(sin, -1e6, 1e6, false, 0, 0, 1),
    LAW(sin, 1e-310, 1, true, 0, 0, 1),
    LAW(cos, -7, 7, false, 0, 0, 1),
    LAW(cos, -1e6, 1e6, false, 0, 0, 1),
    LAW(tan, -7, 7, false, 0, 0, 1.25),
    LAW(tan, -1e6, 1e6, false, 0, 0, 1.25),
    LAW(atan, -3, 3, false, 0, 0, 0.8),
    LAW(atan, 1e-310, 1e308, true, 0, 0, 0.8),
    LAW(atan2, -1, 1, false, -1, 1, 0.8), // y is the second argument
    LAW(atan2, 1e-310, 1e308, true, -1, 1, 0.8),
    LAW(asin, -1, 1, false, 0, 0, 0.8),
    LAW(asin, 1e-310, 1, true, 0, 0, 0.8),
    LAW(acos, -1, 1, false, 0, 0, 0.8),
    LAW(acos, 0.999999999, 1, false, 0, 0, 0.8),
    LAW(hypot, -1, 1, false, -1, 1, 1.25),
    LAW(hypot, 1e-149, 1e149, true, -1, 1, 1.25),
    LAW(expf, -87, 88, false, 0, 0, 0.51),
    LAW(exp2f, -126, 127.9, false, 0, 0, 0.51),
    LAW(log10f, 1e-37, 1e38, true, 0, 0, 0.51),
    LAW(sinf, -100, 100, false, 0, 0, 0.51),
    LAW(cosf, -100, 100, false, 0, 0, 0.51),
};

static double uniform(uint64_t *seed) {
  *seed = *seed * 6364136223846793005u + 1442695040888963407u;
  return (double)(*seed >> 11) * 0x1p-53;
}

// Draws the next arguments of a law.
static void draw(const law *l, uint64_t *seed, double *x, double *y) {
  const double part = uniform(seed);
  const double from = l->sizes ? log2(l->low) : l->low, to = l->sizes ? log2(l->high) : l->high;
  *x = from + part * (to - from);
  if (l->sizes) *x = pow(2, *x);
  *y = l->y_low + uniform(seed) * (l->y_high - l->y_low);
}

// Distance of two numbers in units of the last place of the second, of `digits` bits.
static double ulp_of(double got, long double want, int digits) {
  int power;
  frexpl(want, &power);
  const int least = digits == DBL_MANT_DIG ? DBL_MIN_EXP : FLT_MIN_EXP;
  return (double)(fabsl((long double)got - want) /
                  ldexpl(1, (power < least ? least : power) - digits));
}

static void functions_keep_their_bounds(void **state) {
  (void)state;
  if (LDBL_MANT_DIG < 64) skip();
  for (size_t k = 0; k < SONDE_COUNT_OF(LAWS); ++k) {
    const law *l = &LAWS[k];
    const bool single = l->name[strlen(l->name) - 1] == 'f';
    uint64_t seed = k + 1;
    double worst = 0;
    for (int i = 0; i < SAMPLES; ++i) {
      double x, y;
      draw(l, &seed, &x, &y);
      const long double want = l->wide((long double)x, (long double)y);
      const double off = ulp_of(l->own(x, y), want, single ? FLT_MANT_DIG : DBL_MANT_DIG);
      if (!(off <= l->bound_ulp))
        fail_msg("%s(%a, %a) is off by %.3f ulp, its bound is %g", l->name, x, y, off,
                 l->bound_ulp);
      worst = fmax(worst, off);
    }
    if (getenv("SONDE_TEST_LONG"))
      print_message("%-7s %g to %g: %.4f ulp\n", l->name, l->low, l->high, worst);
  }
  uint64_t seed = 1;
  for (int i = 0; i < SAMPLES; ++i) {
    double x = 0.01 * pow(1e4, uniform(&seed));
    long double want = lgammal((long double)x);
    assert_true(fabsl((long double)lgamma(x) - want) <= 1e-14L * fmaxl(1, fabsl(want)));
  }
}

// Beyond 2^20 the angle itself is off by at most half of its last place.
static void large_angles_are_rounded_angles(void **state) {
  (void)state;
  if (LDBL_MANT_DIG < 64) skip();
  uint64_t seed = 1;
  for (int i = 0; i < 1000; ++i) {
    const double x = 0x1p20 * pow(1e9, uniform(&seed)), off = x * 0x1p-53;
    assert_true(fabsl((long double)sin(x) - sinl((long double)x)) <= (long double)off + 1e-15L);
    assert_true(fabsl((long double)cos(x) - cosl((long double)x)) <= (long double)off + 1e-15L);
  }
}

static void check_same(const char *what, double got, double want) {
  if (isnan(want) ? isnan(got) : got == want && !signbit(got) == !signbit(want)) return;
  fail_msg("%s is %a, expected %a", what, got, want);
}
#define assert_same(got, want) check_same(#got, got, want)

static void special_values_are_those_of_c(void **state) {
  (void)state;
  assert_same(exp(0), 1), assert_same(exp(-INFINITY), 0), assert_same(exp(INFINITY), INFINITY);
  assert_same(exp(709.8), INFINITY), assert_same(exp(-746), 0), assert_same(exp(NAN), NAN);
  assert_same(exp(-745.13), 0x1p-1074);
  assert_same(expm1(-0.0), -0.0), assert_same(expm1(-INFINITY), -1);
  assert_same(expm1(INFINITY), INFINITY), assert_same(expm1(NAN), NAN);
  assert_same(log(1), 0), assert_same(log(-0.0), -INFINITY), assert_same(log(-1), NAN);
  assert_same(log(INFINITY), INFINITY), assert_same(log(NAN), NAN);
  assert_same(log1p(-0.0), -0.0), assert_same(log1p(-1), -INFINITY), assert_same(log1p(-2), NAN);
  assert_same(log1p(INFINITY), INFINITY);
  for (int k = -300; k <= 300; ++k) assert_same(log2(ldexp(1, k)), k);
  for (int k = 0; k <= 22; ++k) assert_same(log10(pow(10, k)), k);
  for (int k = 1; k < 200; ++k) assert_same(cbrt((double)k * k * k), k);
  assert_same(cbrt(-27), -3), assert_same(cbrt(-0.0), -0.0),
      assert_same(cbrt(-INFINITY), -INFINITY);
  assert_same(pow(NAN, 0), 1), assert_same(pow(1, NAN), 1), assert_same(pow(NAN, 1), NAN);
  assert_same(pow(-2, 3), -8), assert_same(pow(-2, -3), -0.125), assert_same(pow(-2, 0.5), NAN);
  assert_same(pow(-0.0, 3), -0.0), assert_same(pow(-0.0, -3), -INFINITY);
  assert_same(pow(0, -0.5), INFINITY), assert_same(pow(-INFINITY, 3), -INFINITY);
  assert_same(pow(-INFINITY, 0.5), INFINITY), assert_same(pow(INFINITY, -1), 0);
  assert_same(pow(-1, INFINITY), 1), assert_same(pow(0.5, INFINITY), 0);
  assert_same(pow(2, -INFINITY), 0), assert_same(pow(2, 1e300), INFINITY);
  assert_same(pow(2, -1074), 0x1p-1074), assert_same(pow(2, 1023), 0x1p1023);
  assert_same(sin(-0.0), -0.0), assert_same(sin(INFINITY), NAN), assert_same(cos(NAN), NAN);
  assert_same(cos(0), 1), assert_same(tan(-0.0), -0.0), assert_same(tan(INFINITY), NAN);
  assert_same(atan2(0, -1), 0x1.921fb54442d18p+1),
      assert_same(atan2(-0.0, -1), -0x1.921fb54442d18p+1);
  assert_same(atan2(-0.0, 1), -0.0), assert_same(atan2(0, -0.0), 0x1.921fb54442d18p+1);
  assert_same(atan2(1, 0), 0x1.921fb54442d18p+0), assert_same(atan2(1, INFINITY), 0);
  assert_same(atan2(INFINITY, INFINITY), 0x1.921fb54442d18p-1);
  assert_same(atan2(INFINITY, -INFINITY), 0x1.2d97c7f3321d2p+1);
  assert_same(atan2(-INFINITY, 1), -0x1.921fb54442d18p+0), assert_same(atan2(NAN, 1), NAN);
  assert_same(asin(1), 0x1.921fb54442d18p+0), assert_same(asin(-0.0), -0.0);
  assert_same(asin(1.1), NAN), assert_same(acos(1), 0), assert_same(acos(-1), 0x1.921fb54442d18p+1);
  assert_same(acos(NAN), NAN), assert_same(lgamma(0), INFINITY), assert_same(lgamma(-1), NAN);
  assert_same(fmax(0, -0.0), 0), assert_same(fmax(-0.0, 0), -0.0), assert_same(fmin(0, -0.0), 0);
  assert_same(fmax(NAN, 1), 1), assert_same(fmax(1, NAN), 1), assert_same(fmin(NAN, NAN), NAN);
}

static void bits_are_golden(void **state) {
  (void)state;
  uint64_t hash = 0;
  for (size_t k = 0; k < SONDE_COUNT_OF(LAWS); ++k) {
    uint64_t seed = k + 1;
    for (int i = 0; i < SAMPLES / 10; ++i) {
      double x, y;
      draw(&LAWS[k], &seed, &x, &y);
      const double value = LAWS[k].own(x, y);
      hash = sonde_hash(hash, &value, sizeof value);
    }
  }
  if (hash != 0x4a2a50257af397a9u) fail_msg("the hash is 0x%016" PRIx64 "u", hash);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(functions_keep_their_bounds),
      cmocka_unit_test(large_angles_are_rounded_angles),
      cmocka_unit_test(special_values_are_those_of_c),
      cmocka_unit_test(bits_are_golden),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
