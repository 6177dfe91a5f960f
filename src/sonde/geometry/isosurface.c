// Marching tetrahedra on a grid: a closed surface around the points above a level. (Doi and Koide
// 1991; the six tetrahedra of a cell share its diagonal, so that neighbouring cells split their
// common side alike.)
#include "geometry/isosurface.h"

#include "geometry/internal.h"

#include <string.h>

// Corners of a cell have the bits x, y, z. The corners of a tetrahedron are nested, 0 in a in b in
// 7, and positively oriented.
static const uint8_t TETRAHEDRA[6][4] = {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7},
                                         {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 6, 4, 7}};
// A vertex keeps this share of its edge from either end, so that no face has equal corners.
static const double LEAST_SHARE = 1.0 / 64;

// The grid with one more point on each side, and the vertices of the edges that begin in the two
// layers of points around a layer of cells: seven directions for each point, the vertex + 1 or 0.
typedef struct march {
  float level;
  uint32_t points[3]; // size + 2
  uint32_t (*layer[2])[7];
  sonde_mesh_builder builder;
} march;

// The part of the surface in one tetrahedron: its corners above the level against the others. False
// when out of memory.
static bool cross_tetrahedron(march *m, const uint32_t cell[3], const float value[8],
                              const uint8_t corner[4]) {
  // Corners above the level first; `odd` when that order turns the orientation.
  uint32_t c[4], above = 0, count = 0;
  for (uint32_t k = 0; k < 4; ++k) above += value[corner[k]] > m->level;
  if (above == 0 || above == 4) return true;
  bool odd = false;
  for (uint32_t k = 0, skipped = 0; k < 4; ++k) {
    if (value[corner[k]] > m->level) {
      c[count++] = corner[k];
      odd ^= skipped & 1;
    } else {
      c[above + skipped++] = corner[k];
    }
  }
  // Edges that the surface crosses, around the tetrahedron, seen from the corners below the level.
  static const uint8_t EDGES[4][4][2] = {
      [1] = {{0, 1}, {0, 2}, {0, 3}},
      [2] = {{0, 2}, {0, 3}, {1, 3}, {1, 2}},
      [3] = {{0, 3}, {1, 3}, {2, 3}},
  };
  uint32_t v[4], sides = above == 2 ? 4 : 3;
  for (uint32_t k = 0; k < sides; ++k) {
    uint32_t a = c[EDGES[above][k][0]], b = c[EDGES[above][k][1]], low = a & b, along = a ^ b;
    SONDE_ASSERT((low == a || low == b) && along > 0 && along < 8);
    size_t point = (size_t)(cell[1] + (low >> 1 & 1)) * m->points[0] + cell[0] + (low & 1);
    uint32_t *slot = &m->layer[low >> 2][point][along - 1];
    if (*slot == 0) {
      double t = ((double)m->level - value[low]) / ((double)value[a | b] - value[low]);
      t = clamp(t, LEAST_SHARE, 1 - LEAST_SHARE);
      // Index 0 of a point is index -1 of the values.
      sonde_vec3 p = vec3((double)cell[0] + (low & 1) + t * (along & 1) - 1,
                          (double)cell[1] + (low >> 1 & 1) + t * (along >> 1 & 1) - 1,
                          (double)cell[2] + (low >> 2) + t * (along >> 2) - 1);
      if (!sonde_builder_vertex(&m->builder, p)) return false;
      *slot = m->builder.mesh.vertex_count;
    }
    v[k] = *slot - 1;
  }
  for (uint32_t k = 2; k < sides; ++k)
    if (!sonde_builder_face(&m->builder, v[0], v[odd ? k : k - 1], v[odd ? k - 1 : k]))
      return false;
  return true;
}

sonde_status sonde_isosurface_create(const float *value, const uint32_t size[3], float level,
                                     sonde_mesh *mesh, sonde_error *error) {
  SONDE_ASSERT(value && mesh && level > 0 && size[0] > 0 && size[1] > 0 && size[2] > 0);
  *mesh = (sonde_mesh){0};
  march m = {.level = level, .builder = {.scale = 1}};
  for (int a = 0; a < 3; ++a) m.points[a] = size[a] + 2;
  size_t count = (size_t)m.points[0] * m.points[1];
  void *layers[2] = {sonde_calloc(count, sizeof *m.layer[0]),
                     sonde_calloc(count, sizeof *m.layer[0])};
  bool room = layers[0] && layers[1];
  for (int k = 0; k < 2; ++k) m.layer[k] = layers[k];

  uint32_t cell[3];
  for (cell[2] = 0; room && cell[2] + 1 < m.points[2]; ++cell[2]) {
    for (cell[1] = 0; room && cell[1] + 1 < m.points[1]; ++cell[1])
      for (cell[0] = 0; room && cell[0] + 1 < m.points[0]; ++cell[0]) {
        float corner[8];
        uint32_t above = 0;
        for (uint32_t k = 0; k < 8; ++k) {
          const uint32_t x = cell[0] + (k & 1) - 1, y = cell[1] + (k >> 1 & 1) - 1;
          const uint32_t z = cell[2] + (k >> 2) - 1;
          bool inside = x < size[0] && y < size[1] && z < size[2];
          corner[k] = inside ? value[((size_t)z * size[1] + y) * size[0] + x] : 0;
          above += corner[k] > level;
        }
        if (above == 0 || above == 8) continue;
        for (int t = 0; room && t < 6; ++t)
          room = cross_tetrahedron(&m, cell, corner, TETRAHEDRA[t]);
      }
    // The upper layer of points becomes the lower one of the next layer of cells.
    uint32_t(*lower)[7] = m.layer[0];
    m.layer[0] = m.layer[1], m.layer[1] = lower;
    if (room) memset(lower, 0, count * sizeof *lower);
  }
  sonde_free(layers[0]);
  sonde_free(layers[1]);
  sonde_status status = room ? SONDE_OK : sonde_fail_memory(error);
  if (!status && m.builder.mesh.face_count == 0)
    status = sonde_fail(error, SONDE_MESH, "no value of the grid exceeds %g", (double)level);
  if (status)
    sonde_mesh_clear(&m.builder.mesh);
  else
    *mesh = m.builder.mesh;
  return status;
}
