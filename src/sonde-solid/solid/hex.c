// Strain energies and their stress and tangent in principal axes; the element with a mean volume
// ratio. docs/solid_theory.md derives what stands here.
#include "hex.h"

#include "base/base.h"
#include "elements/hexahedron.h"

#include <string.h>

// ---- laws ---------------------------------------------------------------------------------

sonde_hyperelastic sonde_hyperelastic_default(sonde_solid_layer layer) {
  static const double shear_pa[SONDE_SOLID_LAYERS] = {3.6e3, 1.1e3, 40e3};
  static const double exponent[SONDE_SOLID_LAYERS] = {9, 8, 9};
  SONDE_ASSERT(layer < SONDE_SOLID_LAYERS);
  return (sonde_hyperelastic){SONDE_ENERGY_OGDEN, shear_pa[layer], exponent[layer],
                              24 * shear_pa[layer]};
}

// Every law is a function of one sum of powers, w = w(S): the chain rule does the rest.
void sonde_hyperelastic_shape(const sonde_hyperelastic *m, const double stretch2[3], double ratio,
                              sonde_shape_energy *e) {
  SONDE_ASSERT(ratio > 0);
  const bool ogden = m->energy == SONDE_ENERGY_OGDEN;
  const double a = ogden ? m->exponent : 2, isochoric = 1 / cbrt(ratio * ratio);
  double power[3], sum = 0;
  for (int i = 0; i < 3; ++i) {
    double c = stretch2[i] * isochoric;
    power[i] = a == 2 ? c : pow(c, 0.5 * a);
    sum += power[i];
  }
  double slope = 2 * m->shear_pa / (a * a), curvature = 0;
  e->w_pa = slope * (sum - 3);
  if (m->energy == SONDE_ENERGY_FUNG) {
    const double q = m->exponent;
    slope = 0.5 * m->shear_pa * exp(q * (sum - 3));
    curvature = q * slope;
    e->w_pa = 0.5 * m->shear_pa * expm1(q * (sum - 3)) / q;
  }
  double grow[3]; // of the sum with the logarithm of each stretch
  for (int i = 0; i < 3; ++i) grow[i] = a * (power[i] - sum / 3);
  for (int i = 0; i < 3; ++i) {
    e->first_pa[i] = slope * grow[i];
    for (int j = 0; j < 3; ++j) {
      double second = (i == j ? power[i] : 0) - (power[i] + power[j]) / 3 + sum / 9;
      e->second_pa[i][j] = curvature * grow[i] * grow[j] + slope * a * a * second;
    }
  }
}

void sonde_hyperelastic_by_exponent(const sonde_hyperelastic *m, const double stretch2[3],
                                    double ratio, double by_exponent_pa[3]) {
  SONDE_ASSERT(ratio > 0);
  sonde_shape_energy e;
  const double isochoric = 1 / cbrt(ratio * ratio), a = m->exponent;
  double change[3] = {0, 0, 0}, sum = 0;
  // Ogden: t_i = 2 mu/a (b_i - S/3); with a the powers b_i change by b_i ln of their base. Fung:
  // t_i = exp(a (S - 3)) (..).
  sonde_hyperelastic_shape(m, stretch2, ratio, &e);
  for (int i = 0; i < 3; ++i) {
    const double c = stretch2[i] * isochoric;
    if (m->energy == SONDE_ENERGY_OGDEN) change[i] = pow(c, 0.5 * a) * 0.5 * log(c);
    sum += m->energy == SONDE_ENERGY_OGDEN ? change[i] : c;
  }
  for (int i = 0; i < 3; ++i)
    by_exponent_pa[i] = m->energy == SONDE_ENERGY_OGDEN
                            ? 2 * m->shear_pa / a * (change[i] - sum / 3) - e.first_pa[i] / a
                        : m->energy == SONDE_ENERGY_FUNG ? (sum - 3) * e.first_pa[i]
                                                         : 0;
}

void sonde_principal(sonde_mat3 a, double value[3], double vector[3][3]) {
  static const int pair[3][2] = {{0, 1}, {0, 2}, {1, 2}};
  SONDE_ASSERT(value != NULL && vector != NULL);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) vector[i][j] = i == j;
  for (int sweep = 0; sweep < 30; ++sweep) {
    double off = fabs(a.m[0][1]) + fabs(a.m[0][2]) + fabs(a.m[1][2]);
    if (off <= 1e-17 * (fabs(a.m[0][0]) + fabs(a.m[1][1]) + fabs(a.m[2][2]))) break;
    for (int k = 0; k < 3; ++k) {
      const int p = pair[k][0], q = pair[k][1];
      if (a.m[p][q] == 0) continue;
      // The rotation in the plane of p and q that takes their product away.
      double half = (a.m[q][q] - a.m[p][p]) / (2 * a.m[p][q]);
      double t = copysign(1, half) / (fabs(half) + sqrt(half * half + 1));
      double c = 1 / sqrt(t * t + 1), s = t * c;
      for (int i = 0; i < 3; ++i) {
        double x = a.m[i][p], y = a.m[i][q], u = vector[i][p], v = vector[i][q];
        a.m[i][p] = c * x - s * y, a.m[i][q] = s * x + c * y;
        vector[i][p] = c * u - s * v, vector[i][q] = s * u + c * v;
      }
      for (int i = 0; i < 3; ++i) {
        double x = a.m[p][i], y = a.m[q][i];
        a.m[p][i] = c * x - s * y, a.m[q][i] = s * x + c * y;
      }
      a.m[p][q] = a.m[q][p] = 0;
    }
  }
  for (int i = 0; i < 3; ++i) value[i] = a.m[i][i];
}

// ---- element ------------------------------------------------------------------------------

// What one integration point knows: gradients in the moved element, F F^T, rest volume, J.
typedef struct hex_point {
  double g[8][3];
  sonde_mat3 left;
  double volume, ratio;
} hex_point;

// Adds the stiffness of the change of shape at a point, block by block in principal axes q.
static void add_shape_stiffness(const hex_point *p, const sonde_shape_energy *e, const double s2[3],
                                double q[3][3], double (*k)[24]) {
  double g[8][3], normal[3][3], shear[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      // Of a shear in the plane of two axes; its limit where the stretches are equal.
      const double *t = e->first_pa, apart = s2[i] - s2[j];
      normal[i][j] = e->second_pa[i][j] - (i == j ? 2 * t[i] : 0);
      if (fabs(apart) > 1e-6 * (s2[i] + s2[j]))
        shear[i][j] = (t[i] * s2[j] - t[j] * s2[i]) / apart;
      else
        shear[i][j] = 0.25 * (e->second_pa[i][i] + e->second_pa[j][j]) -
                      0.5 * (e->second_pa[i][j] + t[i] + t[j]);
      if (i == j) shear[i][j] = 0;
    }
  for (int n = 0; n < 8; ++n)
    for (int i = 0; i < 3; ++i)
      g[n][i] = p->g[n][0] * q[0][i] + p->g[n][1] * q[1][i] + p->g[n][2] * q[2][i];
  for (int a = 0; a < 8; ++a)
    for (int b = a; b < 8; ++b) {
      double block[3][3], half[3][3], initial = 0;
      for (int m = 0; m < 3; ++m) initial += e->first_pa[m] * g[a][m] * g[b][m];
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          block[i][j] = g[a][i] * normal[i][j] * g[b][j] + shear[i][j] * g[a][j] * g[b][i];
      for (int i = 0; i < 3; ++i) {
        block[i][i] += initial;
        for (int m = 0; m < 3; ++m) block[i][i] += shear[i][m] * g[a][m] * g[b][m];
      }
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          half[i][j] =
              p->volume * (q[i][0] * block[0][j] + q[i][1] * block[1][j] + q[i][2] * block[2][j]);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          k[3 * a + i][3 * b + j] +=
              half[i][0] * q[j][0] + half[i][1] * q[j][1] + half[i][2] * q[j][2];
    }
}

// The integration points of an element; @return false: turned inside out at one of them.
static bool find_points(const sonde_vec3 rest[8], const sonde_vec3 now[8], hex_point point[8]) {
  for (int at = 0; at < 8; ++at) {
    hex_point *p = &point[at];
    const double *sign = sonde_hexahedron_sign[at], gauss = sonde_hexahedron_gauss;
    const double a = gauss * sign[0], b = gauss * sign[1], c = gauss * sign[2];
    sonde_vec3 g[8], there[8];
    sonde_mat3 gradient = m_zero();
    p->volume = sonde_hexahedron_gradients(rest, a, b, c, g);
    SONDE_ASSERT(p->volume > 0);
    p->ratio = sonde_hexahedron_gradients(now, a, b, c, there) / p->volume;
    if (!(p->ratio > 1e-3)) return false;
    for (int n = 0; n < 8; ++n) {
      const double x[3] = {now[n].x, now[n].y, now[n].z}, r[3] = {g[n].x, g[n].y, g[n].z};
      p->g[n][0] = there[n].x, p->g[n][1] = there[n].y, p->g[n][2] = there[n].z;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) gradient.m[i][j] += x[i] * r[j];
    }
    p->left = m_mul(gradient, m_transpose(gradient));
  }
  return true;
}

// Adds the forces of principal Kirchhoff stresses at a point.
static void add_stress(const hex_point *p, double q[3][3], const double principal_pa[3],
                       double f[24]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double stress = 0;
      for (int m = 0; m < 3; ++m) stress += q[i][m] * principal_pa[m] * q[j][m];
      stress *= p->volume;
      for (int n = 0; n < 8; ++n) f[3 * n + i] += stress * p->g[n][j];
    }
}

bool sonde_hex_evaluate(const sonde_hyperelastic *material, const sonde_vec3 rest[8],
                        const sonde_vec3 now[8], double *energy_j, double f[24], double (*k)[24]) {
  SONDE_ASSERT(material != NULL && material->shear_pa > 0 && material->bulk_pa > 0);
  hex_point point[8];
  double volume = 0, moved = 0, mean[24] = {0};
  if (!find_points(rest, now, point)) return false;
  for (int p = 0; p < 8; ++p) {
    const double w = point[p].volume * point[p].ratio;
    volume += point[p].volume, moved += w;
    for (int i = 0; i < 24; ++i) mean[i] += w * point[p].g[i / 3][i % 3];
  }
  const double growth = moved / volume - 1, pressure = material->bulk_pa * growth;
  *energy_j = 0.5 * pressure * growth * volume;
  for (int n = 0; n < 24; ++n) f[n] = pressure * mean[n];
  if (k) memset(k, 0, 24 * sizeof *k);
  for (int p = 0; p < 8; ++p) {
    double s2[3], q[3][3];
    sonde_shape_energy e;
    sonde_principal(point[p].left, s2, q);
    sonde_hyperelastic_shape(material, s2, point[p].ratio, &e);
    *energy_j += point[p].volume * e.w_pa;
    add_stress(&point[p], q, e.first_pa, f);
    if (k) add_shape_stiffness(&point[p], &e, s2, q, k);
  }
  if (!isfinite(*energy_j)) return false;
  if (!k) return true;
  // The volume's second change under the pressure, and what the change of the pressure adds.
  const double per_mean = material->bulk_pa / volume;
  for (int i = 0; i < 24; ++i)
    for (int j = i / 3 * 3; j < 24; ++j) {
      double turn = 0;
      for (int p = 0; p < 8; ++p) {
        const double *x = point[p].g[i / 3], *y = point[p].g[j / 3];
        turn += point[p].volume * point[p].ratio * (x[i % 3] * y[j % 3] - x[j % 3] * y[i % 3]);
      }
      k[i][j] += pressure * turn + per_mean * mean[i] * mean[j];
    }
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < i; ++j) k[i][j] = k[j][i];
  return true;
}

bool sonde_hex_by_exponent(const sonde_hyperelastic *material, const sonde_vec3 rest[8],
                           const sonde_vec3 now[8], double f[24]) {
  SONDE_ASSERT(material != NULL && f != NULL);
  hex_point point[8];
  if (!find_points(rest, now, point)) return false;
  memset(f, 0, 24 * sizeof *f);
  for (int p = 0; p < 8; ++p) {
    double s2[3], q[3][3], by_exponent_pa[3];
    sonde_principal(point[p].left, s2, q);
    sonde_hyperelastic_by_exponent(material, s2, point[p].ratio, by_exponent_pa);
    add_stress(&point[p], q, by_exponent_pa, f);
  }
  return true;
}
