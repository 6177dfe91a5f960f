// Element of hex.h for one instruction set, included once for each. docs/solid_theory.md.
#include "elements/hexahedron.h"
#include "hex_tangent.h"

// Rows of the Jacobian at a group, from the corners' sums with the signs of their local
// coordinates; receives the duals; returns the determinant.
INLINE doubles find_duals(double mode[7][3], const doubles at[3], doubles dual[3][3]) {
  doubles j[3][3];
  for (int i = 0; i < 3; ++i) {
    const double *m[7] = {mode[0], mode[1], mode[2], mode[3], mode[4], mode[5], mode[6]};
    j[0][i] = m[0][i] + m[3][i] * at[1] + (m[5][i] + m[6][i] * at[1]) * at[2];
    j[1][i] = m[1][i] + m[3][i] * at[0] + (m[4][i] + m[6][i] * at[0]) * at[2];
    j[2][i] = m[2][i] + m[5][i] * at[0] + (m[4][i] + m[6][i] * at[0]) * at[1];
  }
  for (int d = 0; d < 3; ++d)
    for (int i = 0; i < 3; ++i) {
      const doubles *x = j[(d + 1) % 3], *y = j[(d + 2) % 3];
      dual[d][i] = x[(i + 1) % 3] * y[(i + 2) % 3] - x[(i + 2) % 3] * y[(i + 1) % 3];
    }
  const doubles det = j[0][0] * dual[0][0] + j[0][1] * dual[0][1] + j[0][2] * dual[0][2];
  const doubles by = 1 / det;
  for (int k = 0; k < 9; ++k) dual[k / 3][k % 3] *= by;
  return det;
}

// Sums over the corners of a, b, c, ab, bc, ca, abc times their place, over 8.
INLINE void find_modes(const sonde_vec3 corner[8], double mode[7][3]) {
  memset(mode, 0, 7 * sizeof *mode);
  for (int n = 0; n < 8; ++n) {
    const double *s = sonde_hexahedron_sign[n], x[3] = {corner[n].x, corner[n].y, corner[n].z};
    const double with[7] = {
        s[0], s[1], s[2], s[0] * s[1], s[1] * s[2], s[2] * s[0], s[0] * s[1] * s[2]};
    for (int k = 0; k < 7; ++k)
      for (int i = 0; i < 3; ++i) mode[k][i] += 0.125 * with[k] * x[i];
  }
}

// @return false: turned inside out at one of the points
INLINE bool find_points(const sonde_vec3 rest[8], const sonde_vec3 now[8], points *p) {
  double at_rest[7][3], moved[7][3];
  longs whole = (longs){0} - 1;
  find_modes(rest, at_rest);
  find_modes(now, moved);
  for (int g = 0; g < GROUPS; ++g) {
    doubles at[3], dual[3][3], to[3][3], f[3][3], low[3], high[3];
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < DOUBLES; ++k)
        at[i][k] = sonde_hexahedron_gauss * sonde_hexahedron_sign[g * DOUBLES + k][i];
    p->volume.of[g] = find_duals(at_rest, at, dual);
    p->ratio.of[g] = find_duals(moved, at, to) / p->volume.of[g];
    whole &= (p->ratio.of[g] > 1e-3) & (p->volume.of[g] > 0);
    for (int i = 0; i < 3; ++i) low[i] = 1 - at[i], high[i] = 1 + at[i];
    memset(f, 0, sizeof f);
    for (int n = 0; n < 8; ++n) {
      const double *s = sonde_hexahedron_sign[n], x[3] = {now[n].x, now[n].y, now[n].z};
      doubles local[3], side[3];
      for (int i = 0; i < 3; ++i) side[i] = s[i] < 0 ? low[i] : high[i];
      for (int i = 0; i < 3; ++i) local[i] = 0.125 * s[i] * (side[(i + 1) % 3] * side[(i + 2) % 3]);
      for (int i = 0; i < 3; ++i) {
        p->g[n][i].of[g] = local[0] * to[0][i] + local[1] * to[1][i] + local[2] * to[2][i];
        const doubles r = local[0] * dual[0][i] + local[1] * dual[1][i] + local[2] * dual[2][i];
        for (int j = 0; j < 3; ++j) f[j][i] += x[j] * r;
      }
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j)
        p->left[SIX[i][j]].of[g] = f[i][0] * f[j][0] + f[i][1] * f[j][1] + f[i][2] * f[j][2];
  }
  for (int k = 0; k < DOUBLES; ++k)
    if (!whole[k]) return false;
  find_principal(p->left, p->q);
  return true;
}

// Kirchhoff stress times rest volume of a group, of principal stresses.
INLINE void find_stress(const points *p, int g, const doubles principal_pa[3], doubles stress[6]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j) {
      doubles sum = lay(0);
      for (int m = 0; m < 3; ++m) sum += p->q[i][m].of[g] * principal_pa[m] * p->q[j][m].of[g];
      stress[SIX[i][j]] = p->volume.of[g] * sum;
    }
}

// The part of a group in the forces: stress times gradients.
INLINE void find_forces(const points *p, int g, const doubles stress[6], batch f[24]) {
  for (int n = 0; n < 8; ++n)
    for (int i = 0; i < 3; ++i)
      f[3 * n + i].of[g] = stress[SIX[i][0]] * p->g[n][0].of[g] +
                           stress[SIX[i][1]] * p->g[n][1].of[g] +
                           stress[SIX[i][2]] * p->g[n][2].of[g];
}

static bool evaluate(const sonde_hyperelastic *material, const sonde_vec3 rest[8],
                     const sonde_vec3 now[8], double *energy_j, double f[24], double (*k)[24]) {
  SONDE_ASSERT(material->shear_pa > 0 && material->bulk_pa > 0);
  points p;
  batch part[9 * PAIRS], w;
  double mean[24];
  if (!find_points(rest, now, &p)) return false;
  for (int g = 0; g < GROUPS; ++g) {
    w.of[g] = p.volume.of[g] * p.ratio.of[g];
    for (int i = 0; i < 24; ++i) part[i].of[g] = w.of[g] * p.g[i / 3][i % 3].of[g];
  }
  total_each(part, 24, mean);
  const double volume = total(p.volume), growth = total(w) / volume - 1;
  const double pressure = material->bulk_pa * growth, per_mean = material->bulk_pa / volume;
  shape_batch e[GROUPS];
  doubles stress[GROUPS][6];
  for (int g = 0; g < GROUPS; ++g) {
    const doubles stretch2[3] = {p.left[0].of[g], p.left[1].of[g], p.left[2].of[g]};
    find_shape(material, stretch2, false, &e[g]);
    w.of[g] = p.volume.of[g] * e[g].w_pa;
    find_stress(&p, g, e[g].first_pa, stress[g]);
    find_forces(&p, g, stress[g], part);
  }
  total_each(part, 24, f);
  for (int i = 0; i < 24; ++i) f[i] += pressure * mean[i];
  *energy_j = 0.5 * pressure * growth * volume + total(w);
  if (!isfinite(*energy_j)) return false;
  if (!k) return true;
  for (int g = 0; g < GROUPS; ++g) {
    doubles d[6][6];
    find_tangent(&p, g, &e[g], lay(pressure), d);
    for (int i = 0; i < 3; ++i) stress[g][i] += pressure * p.volume.of[g] * p.ratio.of[g];
    find_stiffness(&p, g, d, stress[g], part);
  }
  double block[9 * PAIRS];
  const double *from = block;
  total_each(part, 9 * PAIRS, block);
  for (int a = 0; a < 8; ++a)
    for (int b = a; b < 8; ++b, from += 9)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const int row = 3 * a + i, column = 3 * b + j;
          k[row][column] = from[3 * i + j] + per_mean * mean[row] * mean[column];
          k[column][row] = k[row][column];
        }
  return true;
}

static bool by_exponent(const sonde_hyperelastic *material, const sonde_vec3 rest[8],
                        const sonde_vec3 now[8], double f[24]) {
  points p;
  batch part[24];
  if (!find_points(rest, now, &p)) return false;
  for (int g = 0; g < GROUPS; ++g) {
    const doubles stretch2[3] = {p.left[0].of[g], p.left[1].of[g], p.left[2].of[g]};
    shape_batch e;
    doubles stress[6];
    find_shape(material, stretch2, true, &e);
    find_stress(&p, g, e.by_exponent_pa, stress);
    find_forces(&p, g, stress, part);
  }
  total_each(part, 24, f);
  return true;
}

static void shape(const sonde_hyperelastic *material, const double stretch2[3],
                  sonde_shape_energy *energy) {
  const doubles s2[3] = {lay(stretch2[0]), lay(stretch2[1]), lay(stretch2[2])};
  shape_batch e;
  find_shape(material, s2, false, &e);
  energy->w_pa = e.w_pa[0];
  for (int i = 0; i < 3; ++i) energy->first_pa[i] = e.first_pa[i][0];
  for (int i = 0; i < 9; ++i) energy->second_pa[i / 3][i % 3] = e.second_pa[SIX[i / 3][i % 3]][0];
}

static void principal(sonde_mat3 matrix, double value[3], double vector[3][3]) {
  batch a[6], q[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j)
      for (int g = 0; g < GROUPS; ++g) a[SIX[i][j]].of[g] = lay(matrix.m[i][j]);
  find_principal(a, q);
  for (int i = 0; i < 3; ++i) value[i] = a[i].of[0][0];
  for (int i = 0; i < 9; ++i) vector[i / 3][i % 3] = q[i / 3][i % 3].of[0][0];
}

const sonde_hex_kernels HEX_KERNELS = {HEX_NAME, evaluate, by_exponent, shape, principal};
