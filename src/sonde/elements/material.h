// Elastic materials over batches of numbers (base/batch.h): energy density, first Piola stress and
// its change, as functions of the deformation gradient F = I + grad u in rows f[9]. With shear
// modulus mu and lambda, per rest volume:
//
//   linear        W = mu e:e + lambda/2 (tr e)^2 with e = (F + F^T)/2 - I
//   neo-Hookean   W = mu/2 (F:F - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2 with J = det F
//
// Both have the same stiffness at rest. The second has no singularity: it stays defined for a
// tetrahedron that is turned inside out (Smith, de Goes and Kim 2018). docs/elements.md.
#ifndef SONDE_SRC_MATERIAL_H
#define SONDE_SRC_MATERIAL_H

#include "base/batch.h"
#include "elements/kinds.h"

// Cofactors of F: dJ = C : dF; returns J.
INLINE reals cofactors(const reals f[9], reals c[9]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      c[3 * i + j] = f[3 * i1 + j1] * f[3 * i2 + j2] - f[3 * i1 + j2] * f[3 * i2 + j1];
    }
  return f[0] * c[0] + f[1] * c[1] + f[2] * c[2];
}

// Change of the cofactors under a change df of F, added to dc with a weight.
INLINE void add_cofactor_change(const reals f[9], const reals df[9], reals weight, reals dc[9]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      int i1 = 3 * ((i + 1) % 3), i2 = 3 * ((i + 2) % 3), j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      dc[3 * i + j] += weight * (df[i1 + j1] * f[i2 + j2] + f[i1 + j1] * df[i2 + j2] -
                                 df[i1 + j2] * f[i2 + j1] - f[i1 + j2] * df[i2 + j1]);
    }
}

INLINE reals product_of(const reals a[9], const reals b[9]) {
  reals sum = a[0] * b[0];
  for (int k = 1; k < 9; ++k) sum += a[k] * b[k];
  return sum;
}

// W at F, J/m3.
INLINE reals material_energy(sonde_elastic_material law, reals mu, reals lambda, const reals f[9]) {
  if (law == SONDE_LINEAR) {
    reals squares = all(0), trace = f[0] + f[4] + f[8] - 3;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        reals e = (f[3 * i + j] + f[3 * j + i]) / 2 - all((real)(i == j));
        squares += e * e;
      }
    return mu * squares + lambda / 2 * trace * trace;
  }
  reals c[9], growth = cofactors(f, c) - 1;
  return mu / 2 * (product_of(f, f) - 3) - mu * growth + (lambda + mu) / 2 * growth * growth;
}

// P = dW/dF, Pa.
INLINE void material_stress(sonde_elastic_material law, reals mu, reals lambda, const reals f[9],
                            reals p[9]) {
  if (law == SONDE_LINEAR) {
    reals pressure = lambda * (f[0] + f[4] + f[8] - 3);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) p[3 * i + j] = mu * (f[3 * i + j] + f[3 * j + i]);
    for (int i = 0; i < 9; i += 4) p[i] = p[i] - 2 * mu + pressure;
    return;
  }
  reals c[9], growth = cofactors(f, c) - 1, pressure = (lambda + mu) * growth - mu;
  for (int k = 0; k < 9; ++k) p[k] = mu * f[k] + pressure * c[k];
}

// Change of P under a change df of F.
INLINE void material_tangent(sonde_elastic_material law, reals mu, reals lambda, const reals f[9],
                             const reals df[9], reals dp[9]) {
  if (law == SONDE_LINEAR) {
    reals pressure = lambda * (df[0] + df[4] + df[8]);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) dp[3 * i + j] = mu * (df[3 * i + j] + df[3 * j + i]);
    for (int i = 0; i < 9; i += 4) dp[i] += pressure;
    return;
  }
  reals c[9], growth = cofactors(f, c) - 1, change = (lambda + mu) * product_of(c, df);
  for (int k = 0; k < 9; ++k) dp[k] = mu * df[k] + change * c[k];
  add_cofactor_change(f, df, (lambda + mu) * growth - mu, dp);
}

// ---- the linear tetrahedron ---------------------------------------------------------------

// Stiffness k[3 node + axis][...] of a tetrahedron of `volume` with the gradients g[4][3] of its
// shape functions, at F.
INLINE void tetrahedron_stiffness(sonde_elastic_material law, reals mu, reals lambda,
                                  const reals f[9], const reals g[4][3], reals volume,
                                  reals k[12][12]) {
  for (int b = 0; b < 4; ++b)
    for (int j = 0; j < 3; ++j) {
      reals df[9], dp[9];
      for (int c = 0; c < 9; ++c) df[c] = all(0);
      for (int c = 0; c < 3; ++c) df[3 * j + c] = g[b][c];
      material_tangent(law, mu, lambda, f, df, dp);
      for (int a = 0; a < 4; ++a)
        for (int i = 0; i < 3; ++i) k[3 * a + i][3 * b + j] = volume * dot(&dp[3 * i], g[a]);
    }
}

#endif
