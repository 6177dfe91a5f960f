// The laws of tissue and contact, each written once over a batch of numbers (base/batch.h) and used
// by every engine: formulas and symbols in docs/tissue.md and docs/world.md.
#ifndef SONDE_SRC_LAWS_H
#define SONDE_SRC_LAWS_H

#include "base/batch.h"

// Slope of the skin, as a share of gm, and beyond it the shear layer's law goes on straight.
#define SONDE_SHEAR_GUARD 0.95
// A surface spring is not taken to be shorter than this share of its length at rest.
#define SONDE_SHORTEST_EDGE 0.05

// Pressure of the normal spring, eq. (1), at indentation s, and its slope. It goes on straight
// beyond `limit` = theta xm, so that a step that jumps past the asymptote is pushed back and never
// attracted, and with exponents above 1 below zero.
INLINE reals normal_pressure(int exponent, reals k0, reals xm, reals limit, reals s, reals *slope) {
  reals held = smaller(s, limit), x = held / xm;
  if (exponent > 1) x = larger(x, all(0));
  reals power = exponent > 2 ? x * x * x : exponent > 1 ? x * x : x;
  reals inverse = 1 / (1 - power);
  reals bend = (1 + ((real)exponent - 1) * power) * inverse * inverse;
  *slope = k0 * bend;
  reals pressure = k0 * xm * (x * inverse);
  // Straight parts: beyond the guard, and below zero where x was cut.
  reals straight = exponent > 1 ? s - pick(held < 0, all(0), held) : s - held;
  return pressure + *slope * straight;
}

// What the springs that anchor a node do to it.
typedef struct anchor_law {
  int exponent;
  real tangential;       // g_t, N/m^3
  real normal_damping_s; // of both dampers
} anchor_law;
typedef struct anchor_push {
  reals push;                    // along N: normal spring and its damper
  reals slope;                   // of the pressure by indentation
  reals damper;                  // of the push by rate
  reals tangent, tangent_damper; // stiffness and damping along the skin
} anchor_push;

// s: indentation; rate: N.v.
INLINE anchor_push push_anchor(const anchor_law *law, reals k0, reals xm, reals limit, reals area,
                               reals s, reals rate) {
  anchor_push at;
  reals pressure = normal_pressure(law->exponent, k0, xm, limit, s, &at.slope);
  at.damper = law->normal_damping_s * k0 * area;
  at.tangent = law->tangential * area;
  at.tangent_damper = law->normal_damping_s * at.tangent;
  at.push = pressure * area - at.damper * rate;
  return at;
}

// The surface spring-damper of an edge.
typedef struct edge_law {
  real stiffness, damper, compression, pretension;
} edge_law;
typedef struct edge_pull {
  reals n[3], closing; // direction, rate at which the ends part
  reals pull;          // tension and damper, > 0 draws the ends together
  reals along, lateral,
      damper; // H = along n n^T + lateral I by displacement, damper n n^T by velocity
} edge_pull;

// Spring stiffness of an edge that is longer than at rest by `stretch`, or shorter.
INLINE reals edge_stiffness(const edge_law *law, reals share, reals stretch) {
  return share * pick(stretch < 0, all(law->stiffness * law->compression), all(law->stiffness));
}

// d, w: from the first end to the second, and how fast that changes; share: what a cut left of it.
// The geometric part `lateral` is dropped in compression, which keeps H positive semidefinite while
// the force stays exact; the unsymmetric part of the damping is dropped.
INLINE edge_pull pull_edge(const edge_law *law, reals share, reals rest, const reals d[3],
                           const reals w[3]) {
  edge_pull at;
  reals least = (real)SONDE_SHORTEST_EDGE * rest, length2 = larger(dot(d, d), least * least);
  reals inverse, length = root_and_inverse(length2, &inverse);
  for (int c = 0; c < 3; ++c) at.n[c] = d[c] * inverse;
  reals stretch = length - rest, stiffness = edge_stiffness(law, share, stretch);
  reals tension = share * law->pretension + stiffness * stretch;
  at.lateral = larger(tension, all(0)) * inverse;
  at.damper = share * law->damper;
  at.along = stiffness - at.lateral;
  at.closing = dot(at.n, w);
  at.pull = tension + at.damper * at.closing;
  return at;
}

// A spring whose stiffness becomes another one beyond the stretch `knee` (Lee, Terzopoulos and
// Waters 1995); where both are equal, a linear spring.
typedef struct biphasic_law {
  reals stiffness, steep, knee;
} biphasic_law;

// d: from the first end to the second. The geometric part is dropped in compression.
INLINE edge_pull pull_biphasic(const biphasic_law *law, reals rest, const reals d[3]) {
  edge_pull at = {0};
  reals least = (real)SONDE_SHORTEST_EDGE * rest, length2 = larger(dot(d, d), least * least);
  reals inverse, length = root_and_inverse(length2, &inverse);
  for (int c = 0; c < 3; ++c) at.n[c] = d[c] * inverse;
  reals stretch = length - rest, beyond = larger(stretch - law->knee, all(0));
  at.pull = law->stiffness * stretch + (law->steep - law->stiffness) * beyond;
  at.lateral = larger(at.pull, all(0)) * inverse;
  at.along = pick(beyond > 0, law->steep, law->stiffness) - at.lateral;
  return at;
}

// Its energy at a length.
INLINE reals biphasic_energy(const biphasic_law *law, reals rest, reals length) {
  reals stretch = length - rest, beyond = larger(stretch - law->knee, all(0));
  return (law->stiffness * stretch * stretch + (law->steep - law->stiffness) * beyond * beyond) / 2;
}

// A |grad s|^2 over a face with indentations s at its corners and half the cotangents there;
// across[] makes half the cotangent Laplacian of s at corner k, across[k + 2] - across[k + 1].
INLINE reals square_slope(const reals half_cotangent[3], const reals s[3], reals across[3]) {
  const reals d[3] = {s[1] - s[2], s[2] - s[0], s[0] - s[1]};
  for (int k = 0; k < 3; ++k) across[k] = half_cotangent[k] * d[k];
  return across[0] * d[0] + across[1] * d[1] + across[2] * d[2];
}

// Shear layer of a face below its straight part, from x2 = (g/gm)^2: the secant modulus m = q/g and
// (q' - m)/(g^2 A), without a root and without the cancellation of q' - m. bend: 1/(gm^2 A).
INLINE void shear_modulus_below(reals shear, reals bend, reals x2, reals *modulus, reals *beyond) {
  reals inverse = 1 / (1 - x2);
  *modulus = shear * inverse;
  *beyond = 2 * *modulus * inverse * bend;
}

// The same with the straight part.
INLINE void shear_modulus(reals shear, reals bend, reals x2, reals *modulus, reals *beyond) {
  const real most = (real)SONDE_SHEAR_GUARD, most2 = most * most;
  reals steep, secant;
  shear_modulus_below(shear, all(1), smaller(x2, all(most2)), &secant, &steep);
  *modulus = secant;
  *beyond = steep * bend;
  wholes past = x2 > most2;
  if (bits(past) == 0) return;
  reals inverse_x, safe = larger(x2, all(most2)), x = root_and_inverse(safe, &inverse_x);
  reals slope = secant + steep * most2;
  reals mean = (secant * most + slope * (x - most)) / x;
  *modulus = pick(past, mean, secant);
  *beyond = pick(past, (slope - mean) / safe, steep) * bend;
}

// Push of the probe on a point of the skin: kappa depth + mu rate per area, never a pull.
INLINE reals contact_push(real stiffness, real damping, reals area, reals depth, reals rate,
                          wholes inside) {
  reals push = area * (stiffness * depth + damping * rate);
  return pick(inside & (push > 0), push, all(0));
}

// The part of a across the unit vector n, in place.
INLINE void project(const reals n[3], reals a[3]) {
  reals along = dot(n, a);
  for (int c = 0; c < 3; ++c) a[c] -= along * n[c];
}

#endif
