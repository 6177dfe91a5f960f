// What integration points know and their part in the stiffness, for one instruction set: between
// hex_law.h and hex_kernel.h.
#include "hex_law.h"

// What the integration points know: gradients in the moved element, F F^T and then its eigenvalues,
// eigenvectors, rest volume, J.
typedef struct points {
  batch g[8][3], left[6], q[3][3], volume, ratio;
} points;

// The spatial tangent times rest volume of a group, as six by six: what the principal stresses
// give, and the second change of the volume under the pressure.
INLINE void find_tangent(const points *p, int g, const shape_batch *e, doubles pressure,
                         doubles d[6][6]) {
  static const int first[6] = {0, 1, 2, 0, 1, 2}, second[6] = {0, 1, 2, 1, 2, 0};
  doubles v[3][6];
  memset(d, 0, 36 * sizeof **d);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 6; ++k) v[i][k] = p->q[first[k]][i].of[g] * p->q[second[k]][i].of[g];
  for (int i = 0; i < 3; ++i) {
    doubles row[6]; // of the normal parts with the axis i
    for (int k = 0; k < 6; ++k) row[k] = lay(0);
    for (int j = 0; j < 3; ++j) {
      const doubles c = e->second_pa[SIX[i][j]] - (i == j ? 2 * e->first_pa[i] : lay(0));
      for (int k = 0; k < 6; ++k) row[k] += c * v[j][k];
    }
    for (int k = 0; k < 6; ++k)
      for (int l = k; l < 6; ++l) d[k][l] += v[i][k] * row[l];
    // Of a shear in the plane of two axes; its limit where the stretches are equal.
    const int j = (i + 1) % 3;
    const doubles *t = e->first_pa, x = p->left[i].of[g], y = p->left[j].of[g], apart = x - y;
    const doubles size = choose(apart < 0, -apart, apart);
    const doubles limit =
        0.25 * (e->second_pa[i] + e->second_pa[j]) - 0.5 * (e->second_pa[SIX[i][j]] + t[i] + t[j]);
    const longs differ = size > 1e-6 * (x + y);
    const doubles shear =
        choose(differ, (t[i] * y - t[j] * x) / choose(differ, apart, lay(1)), limit);
    doubles w[6];
    for (int k = 0; k < 6; ++k)
      w[k] = p->q[first[k]][i].of[g] * p->q[second[k]][j].of[g] +
             p->q[second[k]][i].of[g] * p->q[first[k]][j].of[g];
    for (int k = 0; k < 6; ++k)
      for (int l = k; l < 6; ++l) d[k][l] += shear * w[k] * w[l];
  }
  const doubles volume = p->volume.of[g], bulk = pressure * p->ratio.of[g];
  for (int k = 0; k < 3; ++k) {
    d[k][k] -= 2 * bulk, d[k + 3][k + 3] -= bulk;
    for (int l = k; l < 3; ++l) d[k][l] += bulk;
  }
  for (int k = 0; k < 6; ++k)
    for (int l = k; l < 6; ++l) d[k][l] = d[l][k] = volume * d[k][l];
}

// The part of a group in the stiffness: blocks (a, b), a <= b, of 3x3 in their order. `stress`
// includes the pressure's.
INLINE void find_stiffness(const points *p, int g, doubles d[6][6], const doubles stress[6],
                           batch *k) {
  static const int with[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}}; // strains of a motion along axis
  for (int a = 0; a < 8; ++a) {
    doubles row[3][6], pull[3];
    for (int i = 0; i < 3; ++i) {
      for (int l = 0; l < 6; ++l)
        row[i][l] = p->g[a][0].of[g] * d[with[i][0]][l] + p->g[a][1].of[g] * d[with[i][1]][l] +
                    p->g[a][2].of[g] * d[with[i][2]][l];
      pull[i] = stress[SIX[i][0]] * p->g[a][0].of[g] + stress[SIX[i][1]] * p->g[a][1].of[g] +
                stress[SIX[i][2]] * p->g[a][2].of[g];
    }
    for (int b = a; b < 8; ++b) {
      const doubles x = p->g[b][0].of[g], y = p->g[b][1].of[g], z = p->g[b][2].of[g];
      const doubles initial = pull[0] * x + pull[1] * y + pull[2] * z;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const doubles c =
              row[i][with[j][0]] * x + row[i][with[j][1]] * y + row[i][with[j][2]] * z;
          k[3 * i + j].of[g] = i == j ? c + initial : c;
        }
      k += 9;
    }
  }
}
