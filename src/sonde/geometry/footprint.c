// Area of the vertex cells that a rectangular footprint covers.
//
// The cell of a vertex in a face is the quadrilateral (vertex, middle of one side, centroid, middle
// of the other side): the medians divide the face into three such cells of equal area. Each cell is
// clipped in space by the four planes of the rectangle's prism, so the area is that of the skin and
// not of its projection.
#include "geometry/internal.h"

enum { MAX_CORNERS = 12 };

// Keeps the part with direction . (x - centre) <= limit; returns the corner count.
static uint32_t clip_half_space(const sonde_vec3 *in, uint32_t count, sonde_vec3 *out,
                                sonde_vec3 centre, sonde_vec3 direction, double limit) {
  uint32_t kept = 0;
  for (uint32_t k = 0; k < count; ++k) {
    sonde_vec3 p = in[k], q = in[(k + 1) % count];
    double sp = v_dot(direction, v_sub(p, centre)) - limit;
    double sq = v_dot(direction, v_sub(q, centre)) - limit;
    SONDE_ASSERT(kept + 2 <= MAX_CORNERS);
    if (sp <= 0) out[kept++] = p;
    if ((sp < 0 && sq > 0) || (sp > 0 && sq < 0)) out[kept++] = v_lerp(p, q, sp / (sp - sq));
  }
  return kept;
}

void sonde_mesh_footprint(const sonde_mesh *mesh, sonde_vec3 centre, sonde_vec3 normal,
                          sonde_vec3 u, sonde_vec3 v, double hu_m, double hv_m, double reach_m,
                          double *covered_m2) {
  SONDE_ASSERT(hu_m >= 0 && hv_m >= 0);
  // The axes as they are seen along the normal, then the vectors dual to them, also for slightly
  // skewed axes: a point has the coordinates a = along_u . (x - centre), b = along_v . (x -
  // centre).
  sonde_vec3 up = v_unit(normal, vec3(0, 0, 1));
  u = v_unit(v_madd(u, -v_dot(u, up), up), u);
  v = v_unit(v_madd(v, -v_dot(v, up), up), v);
  double det = v_dot(u, v_cross(v, up));
  SONDE_ASSERT(fabs(det) > 1e-6);
  sonde_vec3 along_u = v_scale(v_cross(v, up), 1 / det);
  sonde_vec3 along_v = v_scale(v_cross(up, u), 1 / det);

  for (uint32_t i = 0; i < mesh->vertex_count; ++i) covered_m2[i] = 0;
  for (uint32_t face = 0; face < mesh->face_count; ++face) {
    // faces that look along the normal and lie within reach
    sonde_vec3 corner[3], sum = vec3(0, 0, 0);
    for (int k = 0; k < 3; ++k) {
      corner[k] = mesh->vertices[mesh->faces[face][k]];
      sum = v_add(sum, corner[k]);
    }
    sonde_vec3 centroid = v_scale(sum, 1.0 / 3.0);
    if (!(v_dot(sonde_face_cross(mesh, face), up) > 0)) continue;
    if (fabs(v_dot(v_sub(centroid, centre), up)) > reach_m) continue;

    // whose coordinates overlap the rectangle's
    sonde_vec3 low = vec3(INFINITY, INFINITY, 0), high = vec3(-INFINITY, -INFINITY, 0);
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 d = v_sub(corner[k], centre);
      sonde_vec3 seen = vec3(v_dot(along_u, d), v_dot(along_v, d), 0);
      low = v_min(low, seen);
      high = v_max(high, seen);
    }
    if (!(low.x < hu_m && high.x > -hu_m && low.y < hv_m && high.y > -hv_m)) continue;

    // area of each vertex cell inside the rectangle
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 cell[4] = {corner[k], v_lerp(corner[k], corner[(k + 1) % 3], 0.5), centroid,
                            v_lerp(corner[k], corner[(k + 2) % 3], 0.5)};
      sonde_vec3 one[MAX_CORNERS], two[MAX_CORNERS], twice = vec3(0, 0, 0);
      uint32_t n = clip_half_space(cell, 4, one, centre, along_u, hu_m);
      n = clip_half_space(one, n, two, centre, v_neg(along_u), hu_m);
      n = clip_half_space(two, n, one, centre, along_v, hv_m);
      n = clip_half_space(one, n, two, centre, v_neg(along_v), hv_m);
      for (uint32_t i = 2; i < n; ++i)
        twice = v_add(twice, v_cross(v_sub(two[i - 1], two[0]), v_sub(two[i], two[0])));
      covered_m2[mesh->faces[face][k]] += 0.5 * v_norm(twice);
    }
  }
}
