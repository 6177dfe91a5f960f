// Each function takes its argument to a short interval by exact steps, sums a polynomial that lies
// closest to the rest there, and adds the largest term last and with its rounding error, so that
// one rounding decides (docs/elementary.md).
#include "base/elementary.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

// A number as the sum of two, the second within a rounding of the first.
typedef struct pair {
  double high, low;
} pair;

#define INVERSE_LN2 0x1.71547652b82fep+0
static const double to_whole = 0x1.8p52; // added and taken away again it leaves a whole number
static const pair ln2 = {0x1.62e42fefa3800p-1, 0x1.ef35793c76730p-45}; // 42 bits, and the rest
static const pair half_pi = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54};
static const pair pi = {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53};

static inline uint64_t bits_of(double x) {
  uint64_t bits;
  memcpy(&bits, &x, sizeof bits);
  return bits;
}
static inline double of_bits(uint64_t bits) {
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

// Sums with their rounding errors: for |a| >= |b| or a = 0, and for any two (Dekker, Knuth).
static inline pair quick_sum(double a, double b) {
  double sum = a + b;
  return (pair){sum, b - (sum - a)};
}
static inline pair exact_sum(double a, double b) {
  double sum = a + b, of_b = sum - a;
  return (pair){sum, (a - (sum - of_b)) + (b - of_b)};
}
// The product and its rounding error from halves of 26 bits (Veltkamp, Dekker).
static inline pair exact_product(double a, double b) {
  double p = a * b, ca = 0x1.0000002p27 * a, cb = 0x1.0000002p27 * b;
  double a1 = ca - (ca - a), a2 = a - a1, b1 = cb - (cb - b), b2 = b - b1;
  return (pair){p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2};
}
static inline pair pair_product(pair a, pair b) {
  pair p = exact_product(a.high, b.high);
  return quick_sum(p.high, p.low + (a.high * b.low + a.low * b.high));
}
// a - b, for |a.high| >= |b.high|.
static inline pair pair_less(pair a, pair b) {
  pair d = quick_sum(a.high, -b.high);
  return quick_sum(d.high, d.low + (a.low - b.low));
}

// exp(x) = 2^power (1 + r.high + r.low + rest), |r| <= ln(2)/2; |x| <= 800.
static inline double exp_rest(pair x, int *power, pair *r) {
  double shifted = x.high * INVERSE_LN2 + to_whole, k = shifted - to_whole;
  double left = x.high - k * ln2.high, less = k * ln2.low, high = left - less;
  *power = (int)k;
  *r = quick_sum(high, ((left - high) - less) + x.low);
  double t = r->high, t2 = t * t, t4 = t2 * t2;
  double p =
      (0x1.5555555555555p-3 + t * 0x1.5555555554cb7p-5) +
      t2 * (0x1.1111111110e6ap-7 + t * 0x1.6c16c1738ff55p-10) +
      t4 * ((0x1.a01a01a4b322fp-13 + t * 0x1.a019c9a5652d3p-16) +
            t2 * (0x1.71de17e40edfep-19 + t * 0x1.2880411bad1aap-22) + t4 * 0x1.af236aac51d05p-26);
  return t2 * (0.5 + t * p);
}

static inline double exp_pair(pair x) {
  if (x.high > 710) return INFINITY;
  if (x.high < -746) return 0;
  int power;
  pair r;
  double rest = exp_rest(x, &power, &r);
  pair one = quick_sum(1, r.high);
  // The power of two in two factors: the first, 2^power or near it, may be no normal number.
  const int first = power / 2;
  return (one.high + (one.low + (r.low + rest))) * of_bits((uint64_t)(first + 1023) << 52) *
         of_bits((uint64_t)(power - first + 1023) << 52);
}

double sonde_math_exp(double x) { return isnan(x) ? x : exp_pair((pair){x, 0}); }

double sonde_math_expm1(double x) {
  if (!(fabs(x) >= 0x1p-54)) return x; // also NaN
  if (x > 40) return sonde_math_exp(x);
  if (x < -40) return -1;
  int power;
  pair r;
  double rest = exp_rest((pair){x, 0}, &power, &r);
  if (power == 0) return r.high + (r.low + rest);
  double two_power = of_bits((uint64_t)(power + 1023) << 52);
  pair s = exact_sum(two_power - 1, two_power * r.high);
  return s.high + (s.low + two_power * (r.low + rest));
}

// x = 2^power (1 + f), sqrt(1/2) <= 1 + f < sqrt(2); x > 0 and finite.
static inline double log_mantissa(double x, double *power) {
  double subnormal = x < 0x1p-1022 ? 54 : 0;
  uint64_t bits = bits_of(subnormal > 0 ? x * 0x1p54 : x), from_root = bits - 0x3fe6a09e00000000u;
  *power = (double)((int64_t)from_root >> 52) - subnormal;
  return of_bits(bits - (from_root & 0xfff0000000000000u)) - 1;
}

// What a logarithm is where there is none to compute: log(0), of infinity, of what is not above 0.
static inline double log_edge(double x) { return x == 0 ? -INFINITY : x > 0 ? x : NAN; }

// log(x) + more, |more| below a rounding of x: with s = f/(2 + f), log(1 + f) = 2 atanh(s)
// = f - s (f - R(s^2)).
static inline double log_with(double x, double more) {
  double power, f = log_mantissa(x, &power), s = f / (2 + f), z = s * s, z2 = z * z;
  double r =
      z *
      ((0x1.5555555555558p-1 + z * 0x1.9999999995273p-2) +
       z2 * ((0x1.2492492dfd879p-2 + z * 0x1.c71c62d5e43dfp-3) +
             z2 * ((0x1.7462b91bd6c45p-3 + z * 0x1.39fdcce1da1aep-3) + z2 * 0x1.2b5f6919aa514p-3)));
  pair sum = quick_sum(power * ln2.high, f);
  return sum.high + (sum.low + ((more + power * ln2.low) - s * (f - r)));
}

double sonde_math_log(double x) { return x > 0 && x < INFINITY ? log_with(x, 0) : log_edge(x); }

double sonde_math_log1p(double x) {
  if (fabs(x) < 0x1p-53) return x;
  double one = 1 + x;
  if (!(one > 0 && one < INFINITY)) return log_edge(one);
  return log_with(one, (x >= 1 ? 1 - (one - x) : x - (one - 1)) / one);
}

// log(x) within 2^-65 of itself: 2 s + s z (2/3 + z Q(z)), z = s^2, the large terms as pairs.
static inline pair log_pair(double x) {
  double power, f = log_mantissa(x, &power);
  pair below = exact_sum(2, f), s, z, two_thirds = {0x1.5555555555555p-1, 0x1.5555555555555p-55};
  s.high = f / below.high;
  pair back = exact_product(s.high, below.high);
  s.low = (((f - back.high) - back.low) - s.high * below.low) / below.high;
  z = pair_product(s, s);
  double t = z.high, t2 = t * t;
  double q = ((0x1.999999999999ap-2 + t * 0x1.2492492492522p-2) +
              t2 * (0x1.c71c71c6ea5acp-3 + t * 0x1.745d177ad43b0p-3)) +
             t2 * t2 *
                 ((0x1.3b1395b82528ep-3 + t * 0x1.1118cd6789817p-3) +
                  t2 * (0x1.df7ba1df849a2p-4 + t * 0x1.e03a7baa4425ep-4));
  pair inner = quick_sum(two_thirds.high, t * q);
  inner.low += two_thirds.low;
  pair cubic = pair_product(pair_product(s, z), inner);
  pair sum = quick_sum(power * ln2.high, 2 * s.high), all = quick_sum(sum.high, cubic.high);
  return quick_sum(all.high, ((sum.low + all.low) + power * ln2.low) + (2 * s.low + cubic.low));
}

static inline double log_times(double x, pair factor) {
  if (!(x > 0 && x < INFINITY)) return log_edge(x);
  pair product = pair_product(log_pair(x), factor);
  return product.high + product.low;
}
double sonde_math_log2(double x) {
  return log_times(x, (pair){INVERSE_LN2, 0x1.777d0ffda0d24p-56});
}
double sonde_math_log10(double x) {
  return log_times(x, (pair){0x1.bcb7b1526e50ep-2, 0x1.95355baaafad3p-57});
}

double sonde_math_power(double x, double y) {
  if (y == 0 || x == 1) return 1;
  if (isnan(x) || isnan(y)) return x + y;
  const double size = fabs(x);
  bool negative = false;
  if (signbit(x)) {
    bool whole = y == floor(y);
    if (!whole && size > 0 && size < INFINITY) return NAN;
    negative = whole && fabs(y) < 0x1p53 && ((int64_t)y & 1);
  }
  double result;
  if (size == 0 || size == INFINITY) {
    result = (size == 0) == (y > 0) ? 0 : INFINITY;
  } else {
    // A larger exponent overflows or vanishes all the same.
    pair power = {y < -0x1p65 ? -0x1p65 : y > 0x1p65 ? 0x1p65 : y, 0};
    result = exp_pair(pair_product(log_pair(size), power));
  }
  return negative ? -result : result;
}

double sonde_math_cbrt(double x) {
  if (!(fabs(x) > 0 && fabs(x) < INFINITY)) return x;
  double root = exp_pair(
      pair_product(log_pair(fabs(x)), (pair){0x1.5555555555555p-2, 0x1.5555555555555p-56}));
  return x < 0 ? -root : root;
}

// x = quarter pi/2 + r, |r| <= pi/4; pi/2 in three parts of 33 bits, whose products with `quarter`
// are exact, and the rest.
static inline int quarter_turns(double x, pair *r) {
  if (fabs(x) <= 0x1.921fb54442d18p-1) {
    *r = (pair){x, 0};
    return 0;
  }
  if (!(fabs(x) <= 0x1p20)) x = fmod(x, 0x1.921fb54442d18p+2);
  double k = (x * 0x1.45f306dc9c883p-1 + to_whole) - to_whole;
  pair a = exact_sum(x - k * 0x1.921fb54400000p+0, -k * 0x1.0b4611a600000p-34);
  pair b = exact_sum(a.high, -k * 0x1.3198a2e000000p-69);
  *r = quick_sum(b.high, (a.low + b.low) - k * 0x1.b839a252049c1p-104);
  return isnan(x) ? 0 : (int)k & 3;
}

// sin(r) - r.high and cos(r) - first, the leading term of the cosine.
static inline double sine_rest(pair r) {
  double z = r.high * r.high, z2 = z * z;
  double p = (-0x1.5555555555555p-3 + z * 0x1.1111111110bb1p-7) +
             z2 * ((-0x1.a01a019e8357dp-13 + z * 0x1.71de37961e4c6p-19) +
                   z2 * (-0x1.ae600a926c89ap-26 + z * 0x1.5e0af186af739p-33));
  return z * r.high * p + r.low * (1 - 0.5 * z);
}
static inline double cosine_rest(pair r, double *first) {
  double z = r.high * r.high, z2 = z * z, half = 0.5 * z;
  double p = (0x1.5555555555555p-5 - z * 0x1.6c16c16c16966p-10) +
             z2 * ((0x1.a01a019f4e867p-16 - z * 0x1.27e4fa17a41b4p-22) +
                   z2 * (0x1.1eeb68b109173p-29 - z * 0x1.907d7aebd5e3dp-37));
  *first = 1 - half;
  return ((1 - *first) - half) + (z2 * p - r.high * r.low);
}
static inline double sine_of(pair r) { return r.high + sine_rest(r); }
static inline double cosine_of(pair r) {
  double first, rest = cosine_rest(r, &first);
  return first + rest;
}

double sonde_math_sin(double x) {
  pair r;
  int quarter = quarter_turns(x, &r);
  if (fabs(x) < 0x1p-27) return x;
  double value = quarter & 1 ? cosine_of(r) : sine_of(r);
  return quarter & 2 ? -value : value;
}

double sonde_math_cos(double x) {
  pair r;
  int quarter = quarter_turns(x, &r);
  double value = quarter & 1 ? sine_of(r) : cosine_of(r);
  return (quarter + 1) & 2 ? -value : value;
}

double sonde_math_tan(double x) {
  if (fabs(x) < 0x1p-27) return x;
  pair r;
  int quarter = quarter_turns(x, &r);
  double first, rest = cosine_rest(r, &first);
  pair over = quick_sum(r.high, sine_rest(r)), below = quick_sum(first, rest);
  if (quarter & 1) {
    pair other = over;
    over = (pair){-below.high, -below.low}, below = other;
  }
  double t = over.high / below.high;
  pair back = exact_product(t, below.high);
  return t + (((over.high - back.high) - back.low) + (over.low - t * below.low)) / below.high;
}

// Angle of the point (x, y), y >= 0, x of any sign, neither both 0. The smaller side over the
// larger, turned back by atan(c) for c = 0, 1/2 or 1: t = (a - c b)/(b + c a), |t| < 1/4.
static inline double angle_of(pair y, pair x) {
  const bool left = x.high < 0;
  if (left) x = (pair){-x.high, -x.low};
  const bool steep = y.high > x.high;
  const pair a = steep ? x : y, b = steep ? y : x;
  const double c = a.high < 0.24 * b.high ? 0 : a.high < 0.73 * b.high ? 0.5 : 1;
  pair over = exact_sum(a.high, -c * b.high), below = exact_sum(b.high, c * a.high);
  over.low += a.low - c * b.low, below.low += b.low + c * a.low;
  double t = over.high / below.high;
  pair back = exact_product(t, below.high);
  double more = (((over.high - back.high) - back.low) + (over.low - t * below.low)) / below.high;
  double z = t * t, z2 = z * z, z4 = z2 * z2;
  double p =
      ((-0x1.5555555555555p-2 + z * 0x1.9999999999819p-3) +
       z2 * (-0x1.249249246a320p-3 + z * 0x1.c71c71937c71bp-4)) +
      z4 * ((-0x1.745d069641c85p-4 + z * 0x1.3b10a743ad56dp-4) +
            z2 * (-0x1.10bd65ecddbdbp-4 + z * 0x1.d7490973936c1p-5) - z4 * 0x1.50271856f7796p-5);
  double rest = more + z * t * p;
  static const pair turned_back[3] = {{0, 0},
                                      {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                      {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}};
  pair base = turned_back[(int)(2 * c)];
  if (steep) base = pair_less(half_pi, base);
  if (left) base = pair_less(pi, base);
  if (steep != left) t = -t, rest = -rest;
  pair sum = quick_sum(base.high, t);
  return sum.high + (sum.low + (base.low + rest));
}

double sonde_math_atan2(double y, double x) {
  if (isnan(x) || isnan(y)) return x + y;
  double high = fabs(y), wide = fabs(x), angle;
  if (high == INFINITY && wide == INFINITY) high = wide = 1;
  if (high == 0 || wide == INFINITY) {
    angle = signbit(x) ? pi.high : 0;
  } else if (wide < high * 0x1p-60) {
    angle = half_pi.high;
  } else if (high < wide * 0x1p-60) {
    angle = x < 0 ? pi.high : high / wide;
  } else {
    double factor = high > 0x1p400 || wide > 0x1p400 ? 0x1p-600 : high < 0x1p-400 ? 0x1p600 : 1;
    angle = angle_of((pair){high * factor, 0}, (pair){copysign(wide * factor, x), 0});
  }
  return copysign(angle, y);
}

// sqrt(1 - x^2), |x| <= 1.
static inline pair other_side(double x) {
  pair square = exact_product(x, x), left = exact_sum(1, -square.high);
  double root = sqrt(left.high);
  if (root == 0) return (pair){0, 0};
  pair back = exact_product(root, root);
  return (pair){root,
                (((left.high - back.high) - back.low) + (left.low - square.low)) / (2 * root)};
}
double sonde_math_asin(double x) {
  if (!(fabs(x) <= 1)) return NAN;
  if (fabs(x) < 0x1p-27) return x;
  return copysign(angle_of((pair){fabs(x), 0}, other_side(x)), x);
}
double sonde_math_acos(double x) {
  if (!(fabs(x) <= 1)) return NAN;
  return angle_of(other_side(x), (pair){x, 0});
}

// Stirling's series behind x = 10, which the recurrence gamma(x + 1) = x gamma(x) reaches.
double sonde_math_lgamma(double x) {
  if (!(x > 0 && x < INFINITY)) return x > 0 ? x : x == 0 ? INFINITY : NAN;
  double product = 1;
  for (; x < 10; ++x) product *= x;
  double z = 1 / (x * x);
  double series =
      (1.0 / 12 -
       z * (1.0 / 360 - z * (1.0 / 1260 - z * (1.0 / 1680 - z * (1.0 / 1188 - z * (691.0 / 360360 -
                                                                                   z / 156)))))) /
      x;
  return (x - 0.5) * sonde_math_log(x) - x + 0.91893853320467274178 + series -
         sonde_math_log(product);
}
