// Numbers of an elastic solid: assembly, solutions, sensitivities.
#define SONDE_REAL_SCALAR
#include "elements/elastic.h"
#include "elements/material.h"
#include "base/base.h"
#include "base/maths.h"

#include <string.h>

// ---- assembly -----------------------------------------------------------------------------

// Adds weight * k to the block of two unknowns. Held axes keep nothing but their diagonal.
static void add_block(sonde_elastic *e, uint32_t row, uint32_t column, double weight,
                      const double k[3][3]) {
  uint32_t low = e->row_start[row], high = e->row_start[row + 1] - 1;
  while (low < high) {
    uint32_t middle = (low + high) / 2;
    if (e->column[middle] < column)
      low = middle + 1;
    else
      high = middle;
  }
  SONDE_ASSERT(e->column[low] == column);
  double *to = e->value + 9 * (size_t)low;
  uint8_t held_i = e->held[e->node[row]], held_j = e->held[e->node[column]];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      bool held = (held_i >> i & 1) || (held_j >> j & 1);
      if (!held || (row == column && i == j)) to[3 * i + j] += weight * k[i][j];
    }
}

// Mean volume change of a patch per displacement of the nodes listed: b[count]. Returns count.
// place [node_count] is UINT32_MAX throughout, before and after.
static uint32_t mean_dilatation(const sonde_elastic *e, uint32_t patch, uint32_t *place,
                                uint32_t *list, sonde_vec3 *b) {
  const sonde_tetrahedra *m = e->mesh;
  const sonde_patches *p = &e->patches;
  uint32_t count = 0;
  for (uint32_t k = p->start[patch]; k < p->start[patch + 1]; ++k) {
    uint32_t t = p->list[k];
    double share = p->share * e->volume[t] / p->volume[patch];
    for (int c = 0; c < 4; ++c) {
      uint32_t other = m->corner[t][c];
      if (place[other] == UINT32_MAX) {
        b[count] = vec3(0, 0, 0);
        list[place[other] = count++] = other;
      }
      const double *g = e->gradient[t][c];
      b[place[other]] = v_madd(b[place[other]], share, vec3(g[0], g[1], g[2]));
    }
  }
  for (uint32_t k = 0; k < count; ++k) place[list[k]] = UINT32_MAX;
  return count;
}

// Stiffness of the membrane on one outer face: plane stress of an incompressible sheet, energy
// skin (e:e + (tr e)^2) per area. Rows and columns 3 corner + axis.
static void membrane_matrix(const sonde_elastic *e, uint32_t face, double skin_n_m,
                            double k[9][9]) {
  const uint32_t *v = e->mesh->boundary.faces[face];
  const sonde_vec3 *x = e->mesh->node;
  sonde_vec3 cross = v_cross(v_sub(x[v[1]], x[v[0]]), v_sub(x[v[2]], x[v[0]]));
  double twice = v_norm(cross), g[3][3];
  sonde_vec3 normal = v_scale(cross, 1 / twice);
  for (int c = 0; c < 3; ++c) {
    sonde_vec3 d = v_scale(v_cross(normal, v_sub(x[v[(c + 2) % 3]], x[v[(c + 1) % 3]])), 1 / twice);
    g[c][0] = d.x, g[c][1] = d.y, g[c][2] = d.z;
  }
  sonde_mat3 plane = m_rank1(normal, -1, 1);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          k[3 * a + i][3 * b + j] =
              skin_n_m * twice / 2 *
              (dot(g[a], g[b]) * plane.m[i][j] + g[a][j] * g[b][i] + 2 * g[a][i] * g[b][j]);
}

static void add_pair(sonde_elastic *e, uint32_t node_a, uint32_t node_b, const double *from,
                     size_t stride) {
  uint32_t row = e->unknown[node_a], column = e->unknown[node_b];
  if (row == UINT32_MAX || column == UINT32_MAX) return;
  double block[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) block[i][j] = from[(size_t)i * stride + (size_t)j];
  add_block(e, row, column, 1, (const double(*)[3])block);
}

static sonde_status assemble(sonde_elastic *e, sonde_error *error) {
  const sonde_tetrahedra *m = e->mesh;
  memset(e->value, 0, 9 * (size_t)e->row_start[e->count] * sizeof *e->value);
  // Tetrahedra at rest without what lambda adds.
  static const double rest[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (uint32_t t = 0; t < m->count; ++t) {
    double k[12][12];
    tetrahedron_stiffness(SONDE_LINEAR, sonde_shear_modulus(e->young_pa[t], e->poisson), 0, rest,
                          (const double(*)[3])e->gradient[t], e->volume[t], k);
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b)
        add_pair(e, m->corner[t][a], m->corner[t][b], &k[3 * a][3 * b], 12);
  }
  for (uint32_t f = 0; f < m->outer_face_count && e->skin_n_m > 0; ++f) {
    double k[9][9];
    membrane_matrix(e, f, e->skin_n_m, k);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        add_pair(e, m->boundary.faces[f][a], m->boundary.faces[f][b], &k[3 * a][3 * b], 9);
  }
  // One condition on the volume per patch.
  uint32_t *place = SONDE_NEW(uint32_t, m->node_count), *list = SONDE_NEW(uint32_t, m->node_count);
  sonde_vec3 *b = SONDE_NEW(sonde_vec3, m->node_count);
  sonde_status status = place && list && b ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t i = 0; i < m->node_count && !status; ++i) place[i] = UINT32_MAX;
  const sonde_patches *patches = &e->patches;
  sonde_patches_lambda(patches, e->volume, e->young_pa, e->poisson, e->patch_lambda);
  for (uint32_t i = 0; i < patches->count && e->poisson > 0 && !status; ++i) {
    uint32_t count = mean_dilatation(e, i, place, list, b);
    for (uint32_t p = 0; p < count; ++p)
      for (uint32_t q = 0; q < count; ++q) {
        if (e->unknown[list[p]] == UINT32_MAX || e->unknown[list[q]] == UINT32_MAX) continue;
        const double x[3] = {b[p].x, b[p].y, b[p].z}, y[3] = {b[q].x, b[q].y, b[q].z};
        double block[3][3];
        for (int r = 0; r < 3; ++r)
          for (int c = 0; c < 3; ++c) block[r][c] = x[r] * y[c];
        add_block(e, e->unknown[list[p]], e->unknown[list[q]],
                  e->patch_lambda[i] * patches->volume[i], (const double(*)[3])block);
      }
  }
  sonde_free(place);
  sonde_free(list);
  sonde_free(b);
  return status;
}

sonde_status sonde_elastic_set(sonde_elastic *e, const double *young_pa, double poisson,
                               double skin_n_m, sonde_error *error) {
  SONDE_ASSERT(e != NULL && young_pa != NULL);
  if (!(poisson >= 0 && poisson < 0.5) || !(skin_n_m >= 0))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "Poisson ratio %g, skin %g N/m: expected 0 to below 0.5, and not negative",
                      poisson, skin_n_m);
  for (uint32_t t = 0; t < e->mesh->count; ++t) {
    if (!(young_pa[t] > 0) || !isfinite(young_pa[t]))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "Young's modulus %g Pa of tetrahedron %u: expected a "
                        "positive number",
                        young_pa[t], t);
    e->young_pa[t] = young_pa[t];
  }
  e->poisson = poisson, e->skin_n_m = skin_n_m;
  sonde_status status = assemble(e, error);
  if (status) return status;
  const sonde_matrix_source source = {.value = e->value};
  if (sonde_numeric_factor(&e->numeric, e->symbolic, &source)) return SONDE_OK;
  return sonde_fail(error, SONDE_CONVERGENCE,
                    "the stiffness is not positive definite: is the solid held in all directions?");
}

void sonde_elastic_multiply(const sonde_elastic *e, const double *u, double *f) {
  SONDE_ASSERT(u != f);
  for (uint32_t i = 0; i < e->count; ++i) {
    double sum[3] = {0, 0, 0};
    for (uint32_t k = e->row_start[i]; k < e->row_start[i + 1]; ++k) {
      const double *a = e->value + 9 * (size_t)k, *x = u + 3 * (size_t)e->column[k];
      for (int r = 0; r < 3; ++r)
        sum[r] += a[3 * r] * x[0] + a[3 * r + 1] * x[1] + a[3 * r + 2] * x[2];
    }
    memcpy(f + 3 * (size_t)i, sum, sizeof sum);
  }
}

// ---- solutions ----------------------------------------------------------------------------

struct sonde_elastic_scratch {
  const sonde_elastic *elastic;
  float *gathered, *part; // vectors that the factor works with
  sonde_numeric numeric;  // the solid's factor with these
  double *vectors;        // [6][3 count] of the conjugate gradients, right-hand side, one more
  uint32_t *rows;         // [count] that are not imposed
  uint8_t *imposed;       // [count]
  bool some_imposed;
};

sonde_status sonde_elastic_scratch_create(const sonde_elastic *e, sonde_elastic_scratch **scratch,
                                          sonde_error *error) {
  SONDE_ASSERT(e != NULL && scratch != NULL);
  sonde_elastic_scratch *s = *scratch = SONDE_NEW(sonde_elastic_scratch, 1);
  if (!s) return sonde_fail_memory(error);
  s->elastic = e;
  s->gathered = SONDE_NEW(float, e->numeric.gathered_room);
  s->part = SONDE_NEW(float, e->numeric.part_room);
  s->vectors = SONDE_NEW(double, 18 * (size_t)e->count);
  s->rows = SONDE_NEW(uint32_t, e->count);
  s->imposed = SONDE_NEW(uint8_t, e->count);
  if (s->gathered && s->part && s->vectors && s->rows && s->imposed) return SONDE_OK;
  sonde_elastic_scratch_destroy(s);
  *scratch = NULL;
  return sonde_fail_memory(error);
}

void sonde_elastic_scratch_destroy(sonde_elastic_scratch *s) {
  if (!s) return;
  sonde_free(s->gathered);
  sonde_free(s->part);
  sonde_free(s->vectors);
  sonde_free(s->rows);
  sonde_free(s->imposed);
  sonde_free(s);
}

// K among the rows that are not imposed: the others of x are zero.
static void multiply(const void *user, const double *x, double *y) {
  const sonde_elastic_scratch *s = user;
  sonde_elastic_multiply(s->elastic, x, y);
}

// The factor of all of K, where imposed rows are zero before and after: symmetric and positive.
static double precondition(const void *user, const double *r, double *z) {
  const sonde_elastic_scratch *s = user;
  const size_t n = 3 * (size_t)s->elastic->count;
  for (size_t k = 0; k < n; ++k) z[k] = s->imposed[k / 3] ? 0 : r[k];
  sonde_numeric_solve(&s->numeric, z);
  for (size_t k = 0; k < n && s->some_imposed; ++k)
    if (s->imposed[k / 3]) z[k] = 0;
  double sum = 0;
  for (size_t k = 0; k < n; ++k)
    if (!s->imposed[k / 3]) sum += r[k] * z[k];
  return sum;
}

sonde_status sonde_elastic_solve(const sonde_elastic *e, sonde_elastic_scratch *s,
                                 const uint32_t *imposed, uint32_t imposed_count, double *f,
                                 double *u, sonde_error *error) {
  SONDE_ASSERT(s != NULL && s->elastic == e && f != u);
  const size_t n = 3 * (size_t)e->count;
  double *v = s->vectors, *right = v + 4 * n, *start = v + 5 * n;
  s->numeric = e->numeric; // the numbers may be new
  s->numeric.gathered = s->gathered, s->numeric.part = s->part;
  memset(s->imposed, 0, e->count);
  for (uint32_t k = 0; k < imposed_count; ++k) {
    SONDE_ASSERT(imposed[k] < e->mesh->node_count);
    uint32_t row = e->unknown[imposed[k]];
    if (row == UINT32_MAX)
      return sonde_fail(error, SONDE_ARGUMENT, "node %u is held and cannot be moved", imposed[k]);
    s->imposed[row] = 1;
  }
  s->some_imposed = imposed_count > 0;
  // What the imposed displacements exert on the others goes to the right-hand side.
  uint32_t rows = 0;
  for (size_t k = 0; k < n; ++k) start[k] = s->imposed[k / 3] ? u[k] : 0;
  sonde_elastic_multiply(e, start, right);
  for (size_t k = 0; k < n; ++k) {
    bool held = e->held[e->node[k / 3]] >> k % 3 & 1;
    right[k] = held || s->imposed[k / 3] ? 0 : f[k] - right[k];
    u[k] = 0;
  }
  for (uint32_t k = 0; k < e->count; ++k)
    if (!s->imposed[k]) s->rows[rows++] = k;
  memset(v, 0, 4 * n * sizeof *v);
  const sonde_operator a = {.count = rows,
                            .width = 3,
                            .rows = s->rows,
                            .multiply = multiply,
                            .precondition = precondition,
                            .user = s};
  const sonde_pcg_vectors vectors = {v, v + n, v + 2 * n, v + 3 * n};
  const sonde_pcg_goal goal = {.relative = e->accuracy, .max_iterations = 300, .from_zero = true};
  sonde_pcg_result result = sonde_pcg(&a, right, u, &vectors, &goal);
  for (size_t k = 0; k < n; ++k)
    if (s->imposed[k / 3]) u[k] = start[k];
  if (!(result.residual <= fmax(1e-10, e->accuracy) * result.reference))
    return sonde_fail(error, SONDE_CONVERGENCE,
                      "the residual stays at %.2g of the load after %u steps",
                      result.residual / result.reference, result.iterations);
  if (!imposed_count) return SONDE_OK;
  sonde_elastic_multiply(e, u, right);
  for (size_t k = 0; k < n; ++k)
    if (s->imposed[k / 3]) f[k] = right[k];
  return SONDE_OK;
}
