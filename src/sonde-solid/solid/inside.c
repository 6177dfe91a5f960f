// What a state of the solid does to points of the leg: displacement and stress anywhere, for the
// interior. Points beside the hexahedra take what the nearest skin or bone has.
#include "inside.h"

#include "base/base.h"
#include "elements/hexahedron.h"

#include <string.h>

enum { BINS = 24 }; // along an axis

typedef struct solid_tissue {
  sonde_interior_tissue tissue;
  const sonde_hexes *mesh;
  sonde_vec3 *moved;        // [nodes] displacements
  sonde_mat3 (*stress)[8];  // [hexes] at the corners, of the hexahedron's layer
  sonde_mat3 *middle, *sum; // [hexes] stress in their middles, [nodes]
  uint32_t *beside;         // [nodes] hexahedra of a layer
  sonde_vec3 (*box)[2];     // [hexes] lowest and highest coordinates
  sonde_vec3 low, step;     // of the bins
  uint32_t *first, *listed; // [BINS^3 + 1], hexahedra of a bin
  sonde_mesh border;        // skin and bone: triangles over the mesh's nodes
  uint32_t (*owner)[3];     // [border faces] 8 hexahedron + corner of the triangle's vertices
  sonde_surface_index *nearest;
} solid_tissue;

// Local coordinates of a point in a hexahedron; false: it lies outside.
static bool locate(const sonde_vec3 corner[8], sonde_vec3 p, double shape[8]) {
  double at[3] = {0, 0, 0};
  for (int step = 0; step < 20; ++step) {
    sonde_vec3 g[8], x = vec3(0, 0, 0);
    (void)sonde_hexahedron_gradients(corner, at[0], at[1], at[2], g);
    double move[3] = {0, 0, 0};
    for (int n = 0; n < 8; ++n) {
      const double *s = sonde_hexahedron_sign[n];
      shape[n] = (1 + s[0] * at[0]) * (1 + s[1] * at[1]) * (1 + s[2] * at[2]) / 8;
      x = v_madd(x, shape[n], corner[n]);
    }
    // Local coordinates are functions of place with gradients sum of sign g.
    for (int n = 0; n < 8; ++n)
      for (int k = 0; k < 3; ++k) move[k] += sonde_hexahedron_sign[n][k] * v_dot(g[n], v_sub(p, x));
    double most = 0;
    for (int k = 0; k < 3; ++k) at[k] += move[k], most = fmax(most, fabs(move[k]));
    if (most < 1e-12) break;
    if (fabs(at[0]) > 3 || fabs(at[1]) > 3 || fabs(at[2]) > 3) return false;
  }
  const double edge = 1 + 1e-6;
  return fabs(at[0]) <= edge && fabs(at[1]) <= edge && fabs(at[2]) <= edge;
}

static void corners_of(const sonde_hexes *mesh, uint32_t hex, sonde_vec3 corner[8],
                       sonde_vec3 box[2]) {
  const double slack = 1e-9;
  for (int c = 0; c < 8; ++c) {
    corner[c] = mesh->node[mesh->corner[hex][c]];
    box[0] = c ? v_min(box[0], corner[c]) : corner[c];
    box[1] = c ? v_max(box[1], corner[c]) : corner[c];
  }
  box[0] = v_sub(box[0], vec3(slack, slack, slack));
  box[1] = v_add(box[1], vec3(slack, slack, slack));
}

static bool in_box(const sonde_vec3 box[2], sonde_vec3 p) {
  return p.x >= box[0].x && p.y >= box[0].y && p.z >= box[0].z && p.x <= box[1].x &&
         p.y <= box[1].y && p.z <= box[1].z;
}

bool sonde_equilibrium_at(const sonde_equilibrium *e, sonde_vec3 rest_m,
                          sonde_vec3 *displacement_m) {
  SONDE_ASSERT(e != NULL && displacement_m != NULL);
  for (uint32_t h = 0; h < e->mesh->count; ++h) {
    sonde_vec3 corner[8], box[2];
    double shape[8];
    corners_of(e->mesh, h, corner, box);
    if (!in_box(box, rest_m) || !locate(corner, rest_m, shape)) continue;
    *displacement_m = vec3(0, 0, 0);
    for (int c = 0; c < 8; ++c)
      *displacement_m = v_madd(*displacement_m, shape[c], e->moved[e->mesh->corner[h][c]]);
    return true;
  }
  return false;
}

// ---- reading ------------------------------------------------------------------------------

static uint32_t bin_of(const solid_tissue *t, sonde_vec3 p, int axis) {
  const double at = (v_coordinate(p, axis) - v_coordinate(t->low, axis));
  return (uint32_t)clamp(floor(at / v_coordinate(t->step, axis)), 0, BINS - 1);
}

sonde_tissue_shares sonde_solid_tissue_shares(const sonde_interior_tissue *tissue, sonde_vec3 p) {
  const solid_tissue *t = (const solid_tissue *)tissue;
  sonde_tissue_shares s = {.count = 8};
  const uint32_t bin = (bin_of(t, p, 0) * BINS + bin_of(t, p, 1)) * BINS + bin_of(t, p, 2);
  for (uint32_t k = t->first[bin]; k < t->first[bin + 1]; ++k) {
    const uint32_t hex = t->listed[k];
    sonde_vec3 corner[8];
    if (!in_box(t->box[hex], p)) continue;
    for (int c = 0; c < 8; ++c) corner[c] = t->mesh->node[t->mesh->corner[hex][c]];
    if (!locate(corner, p, s.weight)) continue;
    for (uint32_t c = 0; c < 8; ++c) s.corner[c] = 8 * hex + c;
    return s;
  }
  const sonde_surface_point at = sonde_surface_closest(t->nearest, p);
  s.count = 3;
  memcpy(s.corner, t->owner[at.face], sizeof t->owner[at.face]);
  memcpy(s.weight, at.weight, sizeof at.weight);
  return s;
}

sonde_vec3 sonde_solid_tissue_moved(const sonde_interior_tissue *tissue,
                                    const sonde_tissue_shares *s) {
  const solid_tissue *t = (const solid_tissue *)tissue;
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t k = 0; k < s->count; ++k)
    sum = v_madd(sum, s->weight[k], t->moved[t->mesh->corner[s->corner[k] / 8][s->corner[k] % 8]]);
  return sum;
}

static sonde_vec3 moved_at(const sonde_interior_tissue *self, sonde_vec3 rest_m) {
  const sonde_tissue_shares s = sonde_solid_tissue_shares(self, rest_m);
  return sonde_solid_tissue_moved(self, &s);
}

static sonde_mat3 stress_at(const sonde_interior_tissue *self, sonde_vec3 rest_m) {
  const solid_tissue *t = (const solid_tissue *)self;
  const sonde_tissue_shares s = sonde_solid_tissue_shares(self, rest_m);
  sonde_mat3 sum = m_zero();
  for (uint32_t k = 0; k < s.count; ++k)
    sum = m_add(sum, m_scale(t->stress[s.corner[k] / 8][s.corner[k] % 8], s.weight[k]));
  return sum;
}

// ---- making -------------------------------------------------------------------------------

// Cauchy stress in the middle of a hexahedron, its pressure by the mean ratio of its volume.
static sonde_mat3 stress_of(const sonde_equilibrium *e, const sonde_vec3 *moved, uint32_t hex) {
  const sonde_hyperelastic *material = &e->def.layer[e->mesh->layer[hex]];
  sonde_vec3 rest[8], now[8], g[8];
  sonde_mat3 f = m_zero(), stress = m_zero();
  double volume[2] = {0, 0}, stretch2[3], vector[3][3];
  for (int c = 0; c < 8; ++c) {
    rest[c] = e->mesh->node[e->mesh->corner[hex][c]];
    now[c] = v_add(rest[c], moved[e->mesh->corner[hex][c]]);
  }
  for (int p = 0; p < 8; ++p) {
    const sonde_vec3 at = v_scale(
        vec3(sonde_hexahedron_sign[p][0], sonde_hexahedron_sign[p][1], sonde_hexahedron_sign[p][2]),
        sonde_hexahedron_gauss);
    volume[0] += sonde_hexahedron_gradients(rest, at.x, at.y, at.z, g);
    volume[1] += sonde_hexahedron_gradients(now, at.x, at.y, at.z, g);
  }
  (void)sonde_hexahedron_gradients(rest, 0, 0, 0, g);
  for (int c = 0; c < 8; ++c)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) f.m[i][j] += v_coordinate(now[c], i) * v_coordinate(g[c], j);
  sonde_shape_energy shape;
  e->kernels->principal(m_mul(f, m_transpose(f)), stretch2, vector);
  e->kernels->shape(material, stretch2, &shape);
  const double ratio = volume[1] / volume[0];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k)
        stress.m[i][j] += vector[i][k] * shape.first_pa[k] * vector[j][k] / ratio;
      if (i == j) stress.m[i][j] += material->bulk_pa * (ratio - 1);
    }
  return stress;
}

// Stress: means at the nodes, each layer for itself: hexahedra of constant pressure carry a
// chequered one.
void sonde_solid_tissue_fill(sonde_interior_tissue *tissue, const sonde_equilibrium *e,
                             const sonde_vec3 *moved) {
  solid_tissue *t = (solid_tissue *)tissue;
  const sonde_hexes *mesh = t->mesh;
  SONDE_ASSERT(mesh == e->mesh && moved != NULL);
  memcpy(t->moved, moved, mesh->node_count * sizeof *t->moved);
  for (uint32_t h = 0; h < mesh->count; ++h) t->middle[h] = stress_of(e, moved, h);
  for (int layer = 0; layer < SONDE_SOLID_LAYERS; ++layer) {
    memset(t->sum, 0, mesh->node_count * sizeof *t->sum);
    memset(t->beside, 0, mesh->node_count * sizeof *t->beside);
    for (uint32_t k = 0; k < 8 * mesh->count; ++k) {
      if (mesh->layer[k / 8] != layer) continue;
      const uint32_t node = mesh->corner[k / 8][k % 8];
      t->sum[node] = m_add(t->sum[node], t->middle[k / 8]), ++t->beside[node];
    }
    for (uint32_t k = 0; k < 8 * mesh->count; ++k) {
      const uint32_t node = mesh->corner[k / 8][k % 8];
      if (mesh->layer[k / 8] == layer)
        t->stress[k / 8][k % 8] = m_scale(t->sum[node], 1.0 / t->beside[node]);
    }
  }
}

static sonde_status fill_bins(solid_tissue *t, sonde_error *error) {
  const sonde_hexes *mesh = t->mesh;
  sonde_vec3 corner[8], high = mesh->node[0];
  t->low = high;
  for (uint32_t h = 0; h < mesh->count; ++h) {
    corners_of(mesh, h, corner, t->box[h]);
    t->low = v_min(t->low, t->box[h][0]), high = v_max(high, t->box[h][1]);
  }
  t->step = v_scale(v_sub(high, t->low), 1.0 / BINS);
  // Counted first, then listed from the end of each bin.
  for (int pass = 0; pass < 2; ++pass) {
    for (uint32_t h = 0; h < mesh->count; ++h) {
      uint32_t from[3], to[3], at[3];
      for (int axis = 0; axis < 3; ++axis)
        from[axis] = bin_of(t, t->box[h][0], axis), to[axis] = bin_of(t, t->box[h][1], axis);
      for (at[0] = from[0]; at[0] <= to[0]; ++at[0])
        for (at[1] = from[1]; at[1] <= to[1]; ++at[1])
          for (at[2] = from[2]; at[2] <= to[2]; ++at[2]) {
            const uint32_t bin = (at[0] * BINS + at[1]) * BINS + at[2];
            if (pass == 0)
              ++t->first[bin];
            else
              t->listed[--t->first[bin]] = h;
          }
    }
    if (pass == 1) break;
    for (uint32_t bin = 0; bin < BINS * BINS * BINS; ++bin) t->first[bin + 1] += t->first[bin];
    t->listed = SONDE_NEW(uint32_t, t->first[BINS * BINS * BINS]);
    if (t->listed == NULL) return sonde_fail_memory(error);
  }
  return SONDE_OK;
}

// Faces of hexahedra on the skin and on what holds the solid, as triangles.
static sonde_status find_border(solid_tissue *t, sonde_error *error) {
  static const uint32_t side[6][4] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                      {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
  enum { SKIN = 1, HELD = 2, ALL = 7 };
  const sonde_hexes *mesh = t->mesh;
  uint8_t *on = SONDE_NEW(uint8_t, mesh->node_count);
  uint32_t count = 0;
  sonde_status status = on ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t n = 0; n < mesh->node_count && !status; ++n)
    on[n] = mesh->held[n] == ALL ? HELD : 0;
  for (uint32_t k = 0; k < 4 * mesh->face_count && !status; ++k)
    on[mesh->face[k / 4][k % 4]] |= SKIN;
  for (int pass = 0; pass < 2 && !status; ++pass) {
    count = 0;
    for (uint32_t k = 0; k < 6 * mesh->count; ++k) {
      const uint32_t *corner = mesh->corner[k / 6], *way = side[k % 6];
      if (!(on[corner[way[0]]] & on[corner[way[1]]] & on[corner[way[2]]] & on[corner[way[3]]]))
        continue;
      for (uint32_t v = 0; v < 6 && pass == 1; ++v) {
        const uint32_t at = way[v < 3 ? v : v % 3 + (v > 3)];
        t->owner[count + v / 3][v % 3] = 8 * (k / 6) + at;
        t->border.faces[count + v / 3][v % 3] = corner[at];
      }
      count += 2;
    }
    if (pass == 0) status = sonde_mesh_create(&t->border, mesh->node_count, count, error);
    if (pass == 0 && !status) {
      memcpy(t->border.vertices, mesh->node, mesh->node_count * sizeof *mesh->node);
      t->owner = (uint32_t(*)[3])sonde_calloc(count, sizeof *t->owner);
      if (t->owner == NULL) status = sonde_fail_memory(error);
    }
  }
  sonde_free(on);
  return status ? status : sonde_surface_index_create(&t->border, &t->nearest, error);
}

sonde_status sonde_equilibrium_tissue(const sonde_equilibrium *e, sonde_interior_tissue **tissue,
                                      sonde_error *error) {
  SONDE_ASSERT(e != NULL && tissue != NULL);
  *tissue = NULL;
  const sonde_hexes *mesh = e->mesh;
  solid_tissue *t = SONDE_NEW(solid_tissue, 1);
  if (t == NULL) return sonde_fail_memory(error);
  *t = (solid_tissue){.tissue = {moved_at, stress_at}, .mesh = mesh};
  t->moved = SONDE_NEW(sonde_vec3, mesh->node_count);
  t->stress = (sonde_mat3(*)[8])sonde_calloc(mesh->count, sizeof *t->stress);
  t->middle = SONDE_NEW(sonde_mat3, mesh->count);
  t->sum = SONDE_NEW(sonde_mat3, mesh->node_count);
  t->beside = SONDE_NEW(uint32_t, mesh->node_count);
  t->box = (sonde_vec3(*)[2])sonde_calloc(mesh->count, sizeof *t->box);
  t->first = SONDE_NEW(uint32_t, BINS * BINS * BINS + 1);
  const bool all = t->moved && t->stress && t->middle && t->sum && t->beside && t->box && t->first;
  sonde_status status = all ? SONDE_OK : sonde_fail_memory(error);
  if (!status) sonde_solid_tissue_fill(&t->tissue, e, e->moved);
  if (!status) status = fill_bins(t, error);
  if (!status) status = find_border(t, error);
  if (status)
    sonde_solid_tissue_destroy(&t->tissue);
  else
    *tissue = &t->tissue;
  return status;
}

void sonde_solid_tissue_destroy(sonde_interior_tissue *tissue) {
  if (tissue == NULL) return;
  solid_tissue *t = (solid_tissue *)tissue;
  void *parts[] = {t->moved, t->stress, t->middle, t->sum,  t->beside,
                   t->box,   t->first,  t->listed, t->owner};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  sonde_surface_index_destroy(t->nearest);
  sonde_mesh_clear(&t->border);
  sonde_free(t);
}
