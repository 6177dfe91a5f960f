// Elementary functions with the same bits everywhere. C libraries round sin, exp and their like
// each in its own way; these are made of additions, products, quotients and square roots alone,
// which IEEE 754 defines to the last bit, and so give equal states and pictures with every
// compiler, C library and processor. They stand in for the functions of <math.h> of the same name:
// exp(x) in a file that includes this one is sonde_math_exp(x). The exact functions of <math.h>
// (sqrt, fabs, floor, round, fmod, ldexp, ...) stay; house_elementary refuses the others in every
// object of the library.
//
// Bounds, in units of the last place of the result (ulp), for every argument unless a domain is
// given; docs/elementary.md derives them, tests/base/test_elementary.c measures them:
//   log2, log10                                              0.51
//   atan2, atan, asin, acos                                  0.8
//   exp, log, log1p, pow, cbrt, sin, cos                     1
//   tan                                                      1.25
//   hypot    1.25, for sides between 1e-150 and 1e150, where it neither overflows nor vanishes
//   expm1                                                    2
//   lgamma   1e-14 of the larger of 1 and the result, for x > 0
//   floats   0.51, but hypotf: 1.25, for sides between 1e-18 and 1e18
// Angles beyond 2^20 are first taken modulo the double nearest to 2 pi, as if the angle were off by
// less than half its last place. Infinities, zeros, signs and NaN are those of Annex F of C17, but
// fmax and fmin of two zeros are the first one, and hypot of an infinity and a NaN is NaN.
#ifndef SONDE_SRC_ELEMENTARY_H
#define SONDE_SRC_ELEMENTARY_H

#include "base/link.h"

#include <math.h>

#define SONDE_PURE_MATHS __attribute__((const))
SONDE_LINK SONDE_PURE_MATHS double sonde_math_exp(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_expm1(double x); // exp(x) - 1
SONDE_LINK SONDE_PURE_MATHS double sonde_math_log(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_log1p(double x); // log(1 + x)
SONDE_LINK SONDE_PURE_MATHS double sonde_math_log2(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_log10(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_power(double x, double y);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_cbrt(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_sin(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_cos(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_tan(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_atan2(double y, double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_asin(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_acos(double x);
SONDE_LINK SONDE_PURE_MATHS double sonde_math_lgamma(double x); // log of the gamma function, x > 0

// Squares are one product.
static inline double sonde_math_pow(double x, double y) {
  return y == 2 ? x * x : sonde_math_power(x, y);
}
static inline double sonde_math_atan(double x) { return sonde_math_atan2(x, 1); }
static inline double sonde_math_hypot(double x, double y) { return sqrt(x * x + y * y); }
static inline double sonde_math_fmax(double a, double b) { return a >= b || isnan(b) ? a : b; }
static inline double sonde_math_fmin(double a, double b) { return a <= b || isnan(b) ? a : b; }

// Single precision: those in double precision, rounded.
static inline float sonde_math_expf(float x) { return (float)sonde_math_exp((double)x); }
static inline float sonde_math_exp2f(float x) {
  return (float)sonde_math_exp((double)x * 0x1.62e42fefa39efp-1);
}
static inline float sonde_math_log10f(float x) {
  return (float)(sonde_math_log((double)x) * 0x1.bcb7b1526e50ep-2);
}
static inline float sonde_math_sinf(float x) { return (float)sonde_math_sin((double)x); }
static inline float sonde_math_cosf(float x) { return (float)sonde_math_cos((double)x); }
static inline float sonde_math_atan2f(float y, float x) {
  return (float)sonde_math_atan2((double)y, (double)x);
}
static inline float sonde_math_hypotf(float x, float y) { return sqrtf(x * x + y * y); }
static inline float sonde_math_fmaxf(float a, float b) { return a >= b || isnan(b) ? a : b; }
static inline float sonde_math_fminf(float a, float b) { return a <= b || isnan(b) ? a : b; }

#define exp(x) sonde_math_exp(x)
#define expm1(x) sonde_math_expm1(x)
#define log(x) sonde_math_log(x)
#define log1p(x) sonde_math_log1p(x)
#define log2(x) sonde_math_log2(x)
#define log10(x) sonde_math_log10(x)
#define pow(x, y) sonde_math_pow(x, y)
#define cbrt(x) sonde_math_cbrt(x)
#define sin(x) sonde_math_sin(x)
#define cos(x) sonde_math_cos(x)
#define tan(x) sonde_math_tan(x)
#define atan(x) sonde_math_atan(x)
#define atan2(y, x) sonde_math_atan2(y, x)
#define asin(x) sonde_math_asin(x)
#define acos(x) sonde_math_acos(x)
#define lgamma(x) sonde_math_lgamma(x)
#define hypot(x, y) sonde_math_hypot(x, y)
#define fmax(a, b) sonde_math_fmax(a, b)
#define fmin(a, b) sonde_math_fmin(a, b)
#define expf(x) sonde_math_expf(x)
#define exp2f(x) sonde_math_exp2f(x)
#define log10f(x) sonde_math_log10f(x)
#define sinf(x) sonde_math_sinf(x)
#define cosf(x) sonde_math_cosf(x)
#define atan2f(y, x) sonde_math_atan2f(y, x)
#define hypotf(x, y) sonde_math_hypotf(x, y)
#define fmaxf(a, b) sonde_math_fmaxf(a, b)
#define fminf(a, b) sonde_math_fminf(a, b)

#endif
