// Area of the vertex cells that a rectangular footprint covers.
//
// The cell of a vertex in a face is the quadrilateral (vertex, middle of one side, centroid, middle
// of the other side): the medians cut the face into three such cells of equal area. Each cell is
// clipped in space by the four planes of the rectangle's prism, so the area is that of the skin and
// not of its projection.
//
//   footprint_frame   coordinates (a, b) seen along the normal, also for slightly skewed axes
//   clip              one half-space against a convex polygon
//   covered_area      area of one clipped cell
#include "geometry/internal.h"

enum { MAX_CORNERS = 12 };

// a = along_u . (x - centre), b = along_v . (x - centre).
typedef struct frame {
  sonde_vec3 centre, normal, along_u, along_v;
  double hu, hv, reach;
} frame;

// The axes as they are seen along the normal, then the vectors dual to them.
static frame footprint_frame(sonde_vec3 centre, sonde_vec3 normal, sonde_vec3 u, sonde_vec3 v) {
  frame f = {.centre = centre, .normal = v_unit(normal, vec3(0, 0, 1))};
  u = v_unit(v_madd(u, -v_dot(u, f.normal), f.normal), u);
  v = v_unit(v_madd(v, -v_dot(v, f.normal), f.normal), v);
  double det = v_dot(u, v_cross(v, f.normal));
  SONDE_ASSERT(fabs(det) > 1e-6);
  f.along_u = v_scale(v_cross(v, f.normal), 1 / det);
  f.along_v = v_scale(v_cross(f.normal, u), 1 / det);
  return f;
}

// Keeps the part with direction . (x - centre) <= limit; returns the corner count.
static uint32_t clip(const sonde_vec3 *in, uint32_t count, sonde_vec3 *out, sonde_vec3 centre,
                     sonde_vec3 direction, double limit) {
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

static double polygon_area(const sonde_vec3 *p, uint32_t count) {
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t k = 2; k < count; ++k)
    sum = v_add(sum, v_cross(v_sub(p[k - 1], p[0]), v_sub(p[k], p[0])));
  return 0.5 * v_norm(sum);
}

static double covered_area(const frame *f, const sonde_vec3 cell[4]) {
  sonde_vec3 one[MAX_CORNERS], two[MAX_CORNERS];
  uint32_t n = clip(cell, 4, one, f->centre, f->along_u, f->hu);
  n = clip(one, n, two, f->centre, v_neg(f->along_u), f->hu);
  n = clip(two, n, one, f->centre, f->along_v, f->hv);
  n = clip(one, n, two, f->centre, v_neg(f->along_v), f->hv);
  return polygon_area(two, n);
}

// Whether the face looks along the normal, lies within reach and may touch the rectangle.
static bool counts(const frame *f, const sonde_mesh *mesh, uint32_t face, sonde_vec3 centroid) {
  if (!(v_dot(sonde_face_cross(mesh, face), f->normal) > 0)) return false;
  if (fabs(v_dot(v_sub(centroid, f->centre), f->normal)) > f->reach) return false;
  double low_a = INFINITY, high_a = -INFINITY, low_b = INFINITY, high_b = -INFINITY;
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 d = v_sub(mesh->vertices[mesh->faces[face][k]], f->centre);
    double a = v_dot(f->along_u, d), b = v_dot(f->along_v, d);
    low_a = fmin(low_a, a);
    high_a = fmax(high_a, a);
    low_b = fmin(low_b, b);
    high_b = fmax(high_b, b);
  }
  return low_a < f->hu && high_a > -f->hu && low_b < f->hv && high_b > -f->hv;
}

void sonde_mesh_footprint(const sonde_mesh *mesh, sonde_vec3 centre, sonde_vec3 normal,
                          sonde_vec3 u, sonde_vec3 v, double hu_m, double hv_m, double reach_m,
                          double *covered_m2) {
  SONDE_ASSERT(hu_m >= 0 && hv_m >= 0);
  frame f = footprint_frame(centre, normal, u, v);
  f.hu = hu_m;
  f.hv = hv_m;
  f.reach = reach_m;
  for (uint32_t i = 0; i < mesh->vertex_count; ++i) covered_m2[i] = 0;
  for (uint32_t face = 0; face < mesh->face_count; ++face) {
    sonde_vec3 corner[3], sum = vec3(0, 0, 0);
    for (int k = 0; k < 3; ++k) {
      corner[k] = mesh->vertices[mesh->faces[face][k]];
      sum = v_add(sum, corner[k]);
    }
    sonde_vec3 centroid = v_scale(sum, 1.0 / 3.0);
    if (!counts(&f, mesh, face, centroid)) continue;
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 cell[4] = {corner[k], v_lerp(corner[k], corner[(k + 1) % 3], 0.5), centroid,
                            v_lerp(corner[k], corner[(k + 2) % 3], 0.5)};
      covered_m2[mesh->faces[face][k]] += covered_area(&f, cell);
    }
  }
}
