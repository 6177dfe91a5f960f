// Convex polyhedra: checked, with their distinct face planes.
//
//   order_faces    faces from large to small, so that a plane is taken from its best face
//   flood_plane    the coplanar patch around a face
//   fit_plane      mean normal of a patch, offset of its outermost vertex
//   check_convex   every vertex behind every plane
#include "geometry/internal.h"

// Vertices this close to a plane, as a part of the body's radius, lie in it.
#define COPLANAR 1e-9
// A vertex may stand out of a plane by this part of the radius (rounding of the patch's normal).
#define CONVEX_SLACK 1e-8

typedef struct sized_face {
  double area;
  uint32_t face;
} sized_face;

typedef struct planes {
  sonde_convex *convex;
  sized_face *order;
  uint32_t *plane_of; // [face_count] SONDE_NONE while without plane
  uint32_t *patch;    // faces of the present patch
  uint32_t patch_count;
  double tolerance_m;
} planes;

static int compare_sizes(const void *a, const void *b) {
  const sized_face *x = a, *y = b;
  if (x->area != y->area) return x->area > y->area ? -1 : 1;
  return x->face < y->face ? -1 : x->face > y->face;
}

static void order_faces(planes *p) {
  const sonde_mesh *hull = &p->convex->hull;
  for (uint32_t f = 0; f < hull->face_count; ++f) {
    p->order[f] = (sized_face){v_norm(sonde_face_cross(hull, f)), f};
    p->plane_of[f] = SONDE_NONE;
  }
  qsort(p->order, hull->face_count, sizeof *p->order, compare_sizes);
}

static bool lies_in(const planes *p, uint32_t face, sonde_vec3 normal, double offset) {
  const sonde_mesh *hull = &p->convex->hull;
  for (int k = 0; k < 3; ++k)
    if (fabs(v_dot(normal, hull->vertices[hull->faces[face][k]]) - offset) > p->tolerance_m)
      return false;
  return true;
}

// Spreads from a face over its coplanar neighbours.
static void flood_plane(planes *p, uint32_t seed, sonde_vec3 normal, uint32_t plane) {
  const sonde_mesh *hull = &p->convex->hull;
  const sonde_topology *t = &p->convex->topology;
  double offset = v_dot(normal, hull->vertices[hull->faces[seed][0]]);
  SONDE_ASSERT(p->plane_of[seed] == SONDE_NONE);
  p->patch_count = 0;
  p->patch[p->patch_count++] = seed;
  p->plane_of[seed] = plane;
  for (uint32_t i = 0; i < p->patch_count; ++i)
    for (int k = 0; k < 3; ++k) {
      uint32_t v = hull->faces[p->patch[i]][k];
      for (uint32_t j = t->face_start[v]; j < t->face_start[v + 1]; ++j) {
        uint32_t other = t->face_list[j];
        if (p->plane_of[other] != SONDE_NONE || !lies_in(p, other, normal, offset)) continue;
        p->plane_of[other] = plane;
        p->patch[p->patch_count++] = other;
      }
    }
}

static void fit_plane(const planes *p, uint32_t plane) {
  const sonde_mesh *hull = &p->convex->hull;
  SONDE_ASSERT(p->patch_count > 0 && plane < hull->face_count);
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t i = 0; i < p->patch_count; ++i)
    sum = v_add(sum, sonde_face_cross(hull, p->patch[i]));
  sonde_vec3 normal = v_unit(sum, vec3(0, 0, 1));
  double offset = -INFINITY;
  for (uint32_t i = 0; i < p->patch_count; ++i)
    for (int k = 0; k < 3; ++k)
      offset = fmax(offset, v_dot(normal, hull->vertices[hull->faces[p->patch[i]][k]]));
  p->convex->plane_normal[plane] = normal;
  p->convex->plane_offset_m[plane] = offset;
}

static sonde_status check_convex(const sonde_convex *convex, double slack_m, sonde_error *error) {
  for (uint32_t i = 0; i < convex->plane_count; ++i)
    for (uint32_t v = 0; v < convex->hull.vertex_count; ++v) {
      double height =
          v_dot(convex->plane_normal[i], convex->hull.vertices[v]) - convex->plane_offset_m[i];
      if (!(height <= slack_m))
        return sonde_fail(error, SONDE_MESH,
                          "the mesh is not convex: vertex %u stands %g m out of a face plane", v,
                          height);
    }
  return SONDE_OK;
}

static sonde_status find_planes(sonde_convex *convex, sonde_error *error) {
  const sonde_mesh *hull = &convex->hull;
  SONDE_ASSERT(hull->vertex_count >= 4 && convex->plane_count == 0);
  sonde_vec3 low = hull->vertices[0], high = low;
  for (uint32_t v = 0; v < hull->vertex_count; ++v) {
    sonde_vec3 x = hull->vertices[v];
    low = vec3(fmin(low.x, x.x), fmin(low.y, x.y), fmin(low.z, x.z));
    high = vec3(fmax(high.x, x.x), fmax(high.y, x.y), fmax(high.z, x.z));
  }
  double extent = v_distance(low, high) / 2;
  planes p = {.convex = convex, .tolerance_m = COPLANAR * extent};
  p.order = SONDE_NEW(sized_face, hull->face_count);
  p.plane_of = SONDE_NEW(uint32_t, hull->face_count);
  p.patch = SONDE_NEW(uint32_t, hull->face_count);
  convex->plane_normal = SONDE_NEW(sonde_vec3, hull->face_count);
  convex->plane_offset_m = SONDE_NEW(double, hull->face_count);
  sonde_status status = SONDE_OK;
  if (p.order && p.plane_of && p.patch && convex->plane_normal && convex->plane_offset_m) {
    order_faces(&p);
    for (uint32_t i = 0; i < hull->face_count; ++i) {
      uint32_t seed = p.order[i].face;
      if (p.plane_of[seed] != SONDE_NONE) continue;
      sonde_vec3 normal = v_unit(sonde_face_cross(hull, seed), vec3(0, 0, 1));
      flood_plane(&p, seed, normal, convex->plane_count);
      fit_plane(&p, convex->plane_count++);
    }
    status = check_convex(convex, CONVEX_SLACK * extent, error);
  } else {
    status = sonde_fail_memory(error);
  }
  sonde_free(p.order);
  sonde_free(p.plane_of);
  sonde_free(p.patch);
  return status;
}

static sonde_status check_mesh(const sonde_mesh *mesh, sonde_error *error) {
  sonde_mesh_report report;
  sonde_status status = sonde_mesh_inspect(mesh, &report, error);
  if (status) return status;
  for (uint32_t v = 0; v < mesh->vertex_count; ++v)
    if (!v_finite(mesh->vertices[v]))
      return sonde_fail(error, SONDE_MESH, "vertex %u of the convex body is not finite", v);
  if (!report.closed)
    return sonde_fail(error, SONDE_MESH,
                      "the convex body is not closed (%u boundary edges), expected a closed mesh",
                      report.boundary_edges);
  if (!report.outward)
    return sonde_fail(error, SONDE_MESH,
                      "the convex body encloses no positive volume, expected "
                      "faces counter-clockwise seen from outside");
  return SONDE_OK;
}

// Hill climbing starts anywhere, so every vertex must belong to the surface.
static sonde_status check_vertices(const sonde_convex *convex, sonde_error *error) {
  for (uint32_t v = 0; v < convex->topology.vertex_count; ++v)
    if (convex->topology.start[v] == convex->topology.start[v + 1])
      return sonde_fail(error, SONDE_MESH, "vertex %u of the convex body belongs to no face", v);
  return SONDE_OK;
}

sonde_status sonde_convex_create(const sonde_mesh *mesh, sonde_convex *convex, sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && convex != NULL);
  *convex = (sonde_convex){0};
  sonde_status status = check_mesh(mesh, error);
  if (!status) status = sonde_mesh_copy(mesh, &convex->hull, error);
  if (!status) status = sonde_topology_build(&convex->hull, &convex->topology, error);
  if (!status) status = check_vertices(convex, error);
  if (!status) status = find_planes(convex, error);
  for (uint32_t v = 0; v < convex->hull.vertex_count; ++v)
    convex->radius_m = fmax(convex->radius_m, v_norm(convex->hull.vertices[v]));
  if (status) sonde_convex_clear(convex);
  return status;
}

sonde_status sonde_convex_hull_within(const sonde_vec3 *points, uint32_t count, double tolerance_m,
                                      sonde_convex *convex, sonde_error *error) {
  SONDE_ASSERT(points != NULL && convex != NULL);
  *convex = (sonde_convex){0};
  sonde_mesh hull = {0};
  sonde_status status = sonde_hull_mesh(points, count, tolerance_m, &hull, error);
  if (!status) status = sonde_convex_create(&hull, convex, error);
  sonde_mesh_clear(&hull);
  return status;
}

sonde_status sonde_convex_hull(const sonde_vec3 *points, uint32_t count, sonde_convex *convex,
                               sonde_error *error) {
  return sonde_convex_hull_within(points, count, 0.0, convex, error);
}

void sonde_convex_clear(sonde_convex *convex) {
  if (!convex) return;
  sonde_mesh_clear(&convex->hull);
  sonde_topology_clear(&convex->topology);
  sonde_free(convex->plane_normal);
  sonde_free(convex->plane_offset_m);
  *convex = (sonde_convex){0};
}
