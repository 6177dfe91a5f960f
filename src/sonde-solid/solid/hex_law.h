// Batches of integration points, the laws and principal axes, for one instruction set: the first
// half of hex_kernel.h. A lane is an integration point: DOUBLES of them go together, GROUPS of
// those are an element. Sums over the points run in one order, so that all sets give the same bits.
// docs/solid_theory.md.
#include "base/base.h"
#include "base/vector.h"
#include "hex.h"

#include <string.h>

enum { POINTS = 8, GROUPS = POINTS / DOUBLES, SWEEPS_MOST = 30, PAIRS = 36 };
typedef vector_long longs __attribute__((vector_size(VECTOR_BYTES)));

// Components of symmetric matrices: xx yy zz xy yz zx.
static const int SIX[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};

// Numbers of all integration points.
typedef struct batch {
  doubles of[GROUPS];
} batch;

INLINE doubles lay(double a) { return a - (doubles){0}; }
INLINE doubles choose(longs mask, doubles yes, doubles no) {
  return (doubles)((mask & (longs)yes) | (~mask & (longs)no));
}

INLINE double total(batch a) {
  double x[POINTS];
  memcpy(x, &a, sizeof x);
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

// to[n] = total(from[n]) of `count` numbers, a multiple of 4.
INLINE void total_each(const batch *from, int count, double *to) {
  for (int n = 0; n < count; n += 4) {
    double_x4 half[4];
    for (int k = 0; k < 4; ++k) {
      const double *x = (const double *)&from[n + k];
      half[k] = *(const double_x4_near *)x + *(const double_x4_near *)(x + 4);
    }
    const double_x4 even = __builtin_shufflevector(half[0], half[2], 0, 1, 4, 5) +
                           __builtin_shufflevector(half[0], half[2], 2, 3, 6, 7);
    const double_x4 odd = __builtin_shufflevector(half[1], half[3], 0, 1, 4, 5) +
                          __builtin_shufflevector(half[1], half[3], 2, 3, 6, 7);
    *(double_x4_near *)(to + n) = __builtin_shufflevector(even, odd, 0, 4, 2, 6) +
                                  __builtin_shufflevector(even, odd, 1, 5, 3, 7);
  }
}

// ---- logarithm and power --------------------------------------------------------------------

// Natural logarithm of a normal number: x = 2^k m with m near 1, ln m = 2 artanh((m - 1)/(m + 1)).
INLINE doubles logarithm(doubles x) {
  const longs bits = (longs)x;
  // Moves the exponent where the mantissa would exceed the root of 2.
  const longs k = (bits - 0x3fe6a09e667f3bcd) >> 52;
  const doubles m = (doubles)(bits - (k << 52)), whole = 0x1.8p52 - (doubles){0};
  const doubles s = (m - 1) / (m + 1), q = s * s;
  doubles sum = lay(1.0 / 23);
  for (int n = 21; n >= 1; n -= 2) sum = 1.0 / n + q * sum;
  const doubles exponent = (doubles)(k + (longs)whole) - whole;
  return exponent * 0x1.62e42fee00000p-1 + (2 * s * sum + exponent * 0x1.a39ef35793c76p-33);
}

// exp(x) - 1, for |x| < 700; elsewhere no number.
INLINE doubles exponential_less_1(doubles x) {
  const doubles whole = 0x1.8p52 - (doubles){0}, shifted = x * 0x1.71547652b82fep0 + whole;
  const doubles k = shifted - whole;
  const doubles r = (x - k * 0x1.62e42fee00000p-1) - k * 0x1.a39ef35793c76p-33;
  doubles sum = lay(1.0 / 14);
  for (int n = 13; n >= 1; --n) sum = 1.0 / n * (1 + r * sum);
  const doubles power = (doubles)(((longs)shifted + 1023) << 52);
  const doubles result = power * (r * sum) + (power - 1);
  return choose((x < 700) & (x > -700), result, lay((double)NAN));
}

// ---- laws -----------------------------------------------------------------------------------

// sonde_shape_energy of a group; second_pa as six.
typedef struct shape_batch {
  doubles w_pa, first_pa[3], second_pa[6], by_exponent_pa[3];
} shape_batch;

// Every law is a function of one sum of powers, w = w(S): the chain rule does the rest.
INLINE void find_shape(const sonde_hyperelastic *m, const doubles stretch2[3], bool by_exponent,
                       shape_batch *e) {
  const bool ogden = m->energy == SONDE_ENERGY_OGDEN, fung = m->energy == SONDE_ENERGY_FUNG;
  const double a = ogden ? m->exponent : 2, q = m->exponent;
  doubles isochoric[3], excess[3]; // logarithms of the bases, powers - 1
  for (int i = 0; i < 3; ++i) isochoric[i] = logarithm(stretch2[i]);
  const doubles mean = (isochoric[0] + isochoric[1] + isochoric[2]) / 3;
  for (int i = 0; i < 3; ++i) {
    isochoric[i] -= mean;
    excess[i] = exponential_less_1(0.5 * a * isochoric[i]);
  }
  const doubles sum = excess[0] + excess[1] + excess[2]; // less 3
  doubles slope = lay(2 * m->shear_pa / (a * a)), curvature = lay(0);
  e->w_pa = slope * sum;
  if (fung) {
    const doubles growth = exponential_less_1(q * sum);
    slope = 0.5 * m->shear_pa * (growth + 1);
    curvature = q * slope;
    e->w_pa = 0.5 * m->shear_pa * growth / q;
  }
  doubles grow[3]; // of the sum with the logarithm of each stretch
  for (int i = 0; i < 3; ++i) {
    grow[i] = a * (excess[i] - sum / 3);
    e->first_pa[i] = slope * grow[i];
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j) {
      const doubles second =
          (i == j ? excess[i] + 1 : lay(0)) - (excess[i] + excess[j] + 2) / 3 + (sum + 3) / 9;
      e->second_pa[SIX[i][j]] = curvature * grow[i] * grow[j] + slope * a * a * second;
    }
  if (!by_exponent) return;
  // Ogden: t_i = 2 mu/a (b_i - S/3); with a the powers b_i change by b_i ln of their base. Fung:
  // t_i = exp(a (S - 3)) (..).
  doubles change[3];
  for (int i = 0; i < 3; ++i) change[i] = 0.5 * (excess[i] + 1) * isochoric[i];
  const doubles third = (change[0] + change[1] + change[2]) / 3;
  for (int i = 0; i < 3; ++i)
    e->by_exponent_pa[i] = ogden  ? 2 * m->shear_pa / a * (change[i] - third) - e->first_pa[i] / a
                           : fung ? sum * e->first_pa[i]
                                  : lay(0);
}

// Eigenvalues and eigenvectors, q[axis][number], of symmetric matrices by Jacobi's rotations. A
// point whose matrix is diagonal is not turned any more, whatever the others need.
INLINE void find_principal(batch a[6], batch q[3][3]) {
  static const int pair[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  for (int i = 0; i < 9; ++i)
    for (int g = 0; g < GROUPS; ++g) q[i / 3][i % 3].of[g] = lay(i % 4 == 0);
  for (int sweep = 0; sweep < SWEEPS_MOST; ++sweep) {
    longs turns[GROUPS], any = {0};
    UNROLL for (int g = 0; g < GROUPS; ++g) {
      const doubles off =
                        a[3].of[g] * a[3].of[g] + a[4].of[g] * a[4].of[g] + a[5].of[g] * a[5].of[g],
                    trace = a[0].of[g] + a[1].of[g] + a[2].of[g];
      turns[g] = off > 1e-32 * (trace * trace);
      any |= turns[g];
    }
    int64_t more = 0;
    for (int k = 0; k < DOUBLES; ++k) more |= any[k];
    if (!more) break;
    for (int k = 0; k < 3; ++k) {
      const int p = pair[k][0], r = pair[k][1], o = pair[k][2];
      batch *app = &a[p], *arr = &a[r], *apr = &a[SIX[p][r]], *aop = &a[SIX[o][p]],
            *aor = &a[SIX[o][r]];
      UNROLL for (int g = 0; g < GROUPS; ++g) {
        // The rotation in the plane of p and r that takes their product away.
        const doubles half = 0.5 * (arr->of[g] - app->of[g]), between = apr->of[g];
        const doubles root = vsqrt(half * half + between * between + 1e-300);
        const doubles size = choose(half < 0, -half, half);
        const doubles turn = choose(half < 0, -between, between) / (size + root);
        const doubles t = (doubles)(turns[g] & (longs)turn);
        const doubles c = 1 / vsqrt(t * t + 1), s = t * c;
        app->of[g] -= t * between, arr->of[g] += t * between;
        apr->of[g] = choose(turns[g], lay(0), between);
        const doubles x = aop->of[g], y = aor->of[g];
        aop->of[g] = c * x - s * y, aor->of[g] = s * x + c * y;
        for (int i = 0; i < 3; ++i) {
          const doubles u = q[i][p].of[g], v = q[i][r].of[g];
          q[i][p].of[g] = c * u - s * v, q[i][r].of[g] = s * u + c * v;
        }
      }
    }
  }
}
