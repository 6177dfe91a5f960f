// Elements of the solid: eight nodes, mean dilatation, a membrane for the skin.
//
// The shape change is integrated at 2x2x2 points, the volume change once per element (Nagtegaal,
// Parks and Rice 1974): with both at all points eight incompressibility conditions per element
// would leave no motion.
#include "interior/solid.h"

#include "base/base.h"
#include "elements/hexahedron.h"

#include <string.h>

static const double (*const sign)[3] = sonde_hexahedron_sign;

sonde_status sonde_solid_allocate(sonde_solid *s, uint32_t nodes, uint32_t hexes,
                                  sonde_error *error) {
  SONDE_ASSERT(s != NULL && nodes > 0 && hexes > 0);
  *s = (sonde_solid){.node_count = nodes, .hex_count = hexes};
  s->node = SONDE_NEW(sonde_vec3, nodes);
  s->hex = SONDE_NEW(sonde_solid_hex, hexes);
  s->unknown = SONDE_NEW(uint32_t, nodes);
  s->held = SONDE_NEW(unsigned char, nodes);
  s->corner = (uint32_t(*)[8])sonde_calloc(hexes, sizeof *s->corner);
  s->x = SONDE_NEW(float, 3 * (size_t)nodes);
  bool all = s->node && s->hex && s->unknown && s->held && s->corner && s->x;
  return all ? SONDE_OK : sonde_fail_memory(error);
}

void sonde_solid_clear(sonde_solid *s) {
  void *parts[] = {s->node, s->hex, s->unknown, s->held, s->corner, s->x};
  for (size_t i = 0; i < SONDE_COUNT_OF(parts); ++i) sonde_free(parts[i]);
  sonde_numeric_clear(&s->numeric);
  sonde_symbolic_destroy(s->symbolic);
  *s = (sonde_solid){0};
}

sonde_status sonde_solid_connect(sonde_solid *s, const unsigned char *last,
                                 const sonde_vec3 *points, sonde_error *error) {
  SONDE_ASSERT(s->symbolic == NULL && last != NULL);
  uint32_t count = 0, free_count = 0;
  for (int pass = 0; pass < 2; ++pass) {
    for (uint32_t i = 0; i < s->node_count; ++i)
      if (s->held[i] == 7)
        s->unknown[i] = SONDE_HELD_CORNER;
      else if ((last[i] != 0) == (pass == 1))
        s->unknown[i] = count++;
    if (pass == 0) free_count = count;
  }
  s->unknown_count = count, s->last_count = count - free_count;
  for (uint32_t h = 0; h < s->hex_count; ++h)
    for (int c = 0; c < 8; ++c) s->corner[h][c] = s->unknown[s->hex[h].node[c]];
  sonde_vec3 *footprint = SONDE_NEW(sonde_vec3, count + 1);
  if (!footprint) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < s->node_count; ++i)
    if (s->unknown[i] != SONDE_HELD_CORNER)
      footprint[s->unknown[i]] = (points ? points : s->node)[i];
  const sonde_symbolic_def def = {.node_count = count,
                                  .last_count = s->last_count,
                                  .block = 3,
                                  .points = footprint,
                                  .element_count = s->hex_count,
                                  .elements = (const uint32_t(*)[8])s->corner};
  sonde_status status = sonde_symbolic_create(&def, &s->symbolic, error);
  if (!status) status = sonde_numeric_reserve(&s->numeric, s->symbolic, error);
  sonde_free(footprint);
  return status;
}

// ---- element ------------------------------------------------------------------------------

// Gradients of the shape functions at local (a, b, c); returns |det J|.
static double gradients(const sonde_solid *s, const sonde_solid_hex *h, double a, double b,
                        double c, sonde_vec3 g[8]) {
  sonde_vec3 corner[8];
  for (int n = 0; n < 8; ++n) corner[n] = s->node[h->node[n]];
  return fabs(sonde_hexahedron_gradients(corner, a, b, c, g));
}

// Plane stress of an incompressible sheet on the outer face: energy mu t (e:e + (tr e)^2).
static void add_skin(const sonde_solid *s, const sonde_solid_hex *h, double a, double b,
                     double (*k)[24]) {
  // Gradients of the four corner functions in the plane of the face.
  sonde_vec3 g[4], t[2] = {{0, 0, 0}, {0, 0, 0}};
  double local[4][2], d[4][3];
  for (int n = 0; n < 4; ++n) {
    local[n][0] = sign[n][0] * (1 + sign[n][1] * b) / 4;
    local[n][1] = (1 + sign[n][0] * a) * sign[n][1] / 4;
    for (int c = 0; c < 2; ++c) t[c] = v_madd(t[c], local[n][c], s->node[h->node[n]]);
  }
  sonde_vec3 cross = v_cross(t[0], t[1]);
  double area = v_norm(cross), weight = h->skin_n_m * area;
  sonde_vec3 normal = v_scale(cross, 1 / area);
  sonde_vec3 dual[2] = {v_scale(v_cross(t[1], normal), 1 / area),
                        v_scale(v_cross(normal, t[0]), 1 / area)};
  for (int n = 0; n < 4; ++n) {
    g[n] = v_madd(v_scale(dual[0], local[n][0]), local[n][1], dual[1]);
    d[n][0] = g[n].x, d[n][1] = g[n].y, d[n][2] = g[n].z;
  }
  sonde_mat3 plane = m_rank1(normal, -1, 1);
  for (int p = 0; p < 4; ++p)
    for (int q = 0; q < 4; ++q)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          k[3 * p + i][3 * q + j] += weight * (v_dot(g[p], g[q]) * plane.m[i][j] +
                                               d[p][j] * d[q][i] + 2 * d[p][i] * d[q][j]);
}

void sonde_solid_matrix(const void *user, uint32_t hex, double (*k)[24]) {
  const sonde_solid *s = user;
  SONDE_ASSERT(hex < s->hex_count);
  const sonde_solid_hex *h = &s->hex[hex];
  sonde_vec3 g[8], mean[8];
  double volume = 0;
  memset(k, 0, 24 * sizeof *k);
  memset(mean, 0, sizeof mean);
  // Shape change at one integration point after the other.
  for (int p = 0; p < 8; ++p) {
    double w =
        gradients(s, h, sonde_hexahedron_gauss * sign[p][0], sonde_hexahedron_gauss * sign[p][1],
                  sonde_hexahedron_gauss * sign[p][2], g);
    double shear = w * h->shear_pa, bulk = s->plain ? w * h->bulk_pa : 0, d[8][3];
    for (int n = 0; n < 8; ++n) d[n][0] = g[n].x, d[n][1] = g[n].y, d[n][2] = g[n].z;
    for (int a = 0; a < 8; ++a)
      for (int b = 0; b < 8; ++b) {
        double dot = shear * v_dot(g[a], g[b]);
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j)
            k[3 * a + i][3 * b + j] +=
                shear * d[a][j] * d[b][i] + (bulk - 2 * shear / 3) * d[a][i] * d[b][j];
          k[3 * a + i][3 * b + i] += dot;
        }
      }
    for (int n = 0; n < 8; ++n) mean[n] = v_madd(mean[n], w, g[n]);
    volume += w;
  }
  // Mean dilatation.
  double e[24];
  const double bulk = h->bulk_pa / volume;
  for (int n = 0; n < 8; ++n)
    e[3 * n] = mean[n].x, e[3 * n + 1] = mean[n].y, e[3 * n + 2] = mean[n].z;
  for (int i = 0; i < 24 && !s->plain; ++i)
    for (int j = 0; j < 24; ++j) k[i][j] += bulk * e[i] * e[j];
  for (int p = 0; p < 4 && h->skin_n_m > 0; ++p)
    add_skin(s, h, sonde_hexahedron_gauss * sign[p][0], sonde_hexahedron_gauss * sign[p][1], k);
  // Nodes that stay where they are answer to nothing.
  for (int row = 0; row < 24; ++row)
    for (int i = 0; i < 24 && (s->held[h->node[row / 3]] >> row % 3 & 1); ++i)
      if (i != row) k[row][i] = k[i][row] = 0;
}

void sonde_solid_begin(sonde_solid *s) {
  SONDE_ASSERT(s->symbolic != NULL);
  const sonde_matrix_source source = {.element = sonde_solid_matrix, .user = s};
  sonde_numeric_begin(&s->numeric, s->symbolic, &source);
}

bool sonde_solid_factor(sonde_solid *s) {
  sonde_solid_begin(s);
  while (!sonde_numeric_step(&s->numeric, UINT64_MAX)) {
  }
  return !s->numeric.failed;
}

// ---- reading ------------------------------------------------------------------------------

static sonde_vec3 moved_in(const sonde_solid *s, const float *x, uint32_t node) {
  uint32_t at = s->unknown[node];
  if (at == SONDE_HELD_CORNER) return vec3(0, 0, 0);
  x += 3 * (size_t)at;
  return vec3((double)x[0], (double)x[1], (double)x[2]);
}

sonde_vec3 sonde_solid_moved(const sonde_solid *s, uint32_t node) {
  SONDE_ASSERT(node < s->node_count);
  return moved_in(s, s->x, node);
}

sonde_mat3 sonde_solid_stress(const sonde_solid *s, const float *x, uint32_t hex) {
  SONDE_ASSERT(hex < s->hex_count);
  const sonde_solid_hex *h = &s->hex[hex];
  sonde_vec3 g[8];
  (void)gradients(s, h, 0, 0, 0, g);
  sonde_mat3 grad = m_zero();
  for (int n = 0; n < 8; ++n) {
    sonde_vec3 u = moved_in(s, x, h->node[n]);
    double ua[3] = {u.x, u.y, u.z}, ga[3] = {g[n].x, g[n].y, g[n].z};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) grad.m[i][j] += ua[i] * ga[j];
  }
  double trace = grad.m[0][0] + grad.m[1][1] + grad.m[2][2];
  sonde_mat3 stress = m_scale(m_add(grad, m_transpose(grad)), h->shear_pa);
  for (int i = 0; i < 3; ++i) stress.m[i][i] += (h->bulk_pa - 2 * h->shear_pa / 3) * trace;
  return stress;
}

// Six tetrahedra about the diagonal 0-6.
static double volume_of(const sonde_vec3 p[8]) {
  static const int round[6][2] = {{1, 2}, {2, 3}, {3, 7}, {7, 4}, {4, 5}, {5, 1}};
  double sum = 0;
  sonde_vec3 d = v_sub(p[6], p[0]);
  for (int k = 0; k < 6; ++k)
    sum += v_dot(d, v_cross(v_sub(p[round[k][0]], p[0]), v_sub(p[round[k][1]], p[0])));
  return sum / 6;
}

double sonde_solid_dilatation(const sonde_solid *s, uint32_t hex, double *rest_m3) {
  SONDE_ASSERT(hex < s->hex_count);
  sonde_vec3 rest[8], now[8];
  for (int n = 0; n < 8; ++n) {
    rest[n] = s->node[s->hex[hex].node[n]];
    now[n] = v_add(rest[n], sonde_solid_moved(s, s->hex[hex].node[n]));
  }
  double volume = volume_of(rest);
  if (rest_m3 != NULL) *rest_m3 = fabs(volume);
  return volume_of(now) / volume - 1;
}
