// Convex polyhedra: checked, with their distinct face planes.
#include "geometry/internal.h"

// Vertices this close to a plane, as a part of the body's radius, lie in it.
#define COPLANAR 1e-9
// A vertex may stand out of a plane by this part of the radius (rounding of the patch's normal).
#define CONVEX_SLACK 1e-8

typedef struct sized_face {
  double area;
  uint32_t face;
} sized_face;

static int compare_sizes(const void *a, const void *b) {
  const sized_face *x = a, *y = b;
  if (x->area != y->area) return x->area > y->area ? -1 : 1;
  return x->face < y->face ? -1 : x->face > y->face;
}

// Faces from large to small, so that a plane is taken from its best face; a plane has the faces of
// the coplanar patch around its first one.
static void find_planes(sonde_convex *convex, double tolerance_m, sized_face *order, bool *done,
                        uint32_t *patch) {
  const sonde_mesh *hull = &convex->hull;
  const sonde_topology *t = &convex->topology;
  SONDE_ASSERT(hull->vertex_count >= 4 && convex->plane_count == 0);
  for (uint32_t f = 0; f < hull->face_count; ++f)
    order[f] = (sized_face){v_norm(sonde_face_cross(hull, f)), f};
  qsort(order, hull->face_count, sizeof *order, compare_sizes);
  for (uint32_t i = 0; i < hull->face_count; ++i) {
    uint32_t seed = order[i].face, count = 0;
    if (done[seed]) continue;
    sonde_vec3 normal = v_unit(sonde_face_cross(hull, seed), vec3(0, 0, 1));
    double offset = v_dot(normal, hull->vertices[hull->faces[seed][0]]);
    patch[count++] = seed;
    done[seed] = true;
    for (uint32_t p = 0; p < 3 * count; ++p) {
      uint32_t v = hull->faces[patch[p / 3]][p % 3];
      for (uint32_t j = t->face_start[v]; j < t->face_start[v + 1]; ++j) {
        uint32_t other = t->face_list[j];
        if (done[other]) continue;
        bool lies_in = true;
        for (int k = 0; k < 3; ++k) {
          sonde_vec3 corner = hull->vertices[hull->faces[other][k]];
          lies_in = lies_in && !(fabs(v_dot(normal, corner) - offset) > tolerance_m);
        }
        if (!lies_in) continue;
        done[other] = true;
        patch[count++] = other;
      }
    }

    // Plane of the patch: its mean normal, the offset of its outermost vertex.
    SONDE_ASSERT(count > 0 && convex->plane_count < hull->face_count);
    sonde_vec3 sum = vec3(0, 0, 0);
    for (uint32_t p = 0; p < count; ++p) sum = v_add(sum, sonde_face_cross(hull, patch[p]));
    normal = v_unit(sum, vec3(0, 0, 1));
    offset = -INFINITY;
    for (uint32_t p = 0; p < count; ++p)
      for (int k = 0; k < 3; ++k)
        offset = fmax(offset, v_dot(normal, hull->vertices[hull->faces[patch[p]][k]]));
    convex->plane_normal[convex->plane_count] = normal;
    convex->plane_offset_m[convex->plane_count++] = offset;
  }
}

sonde_status sonde_convex_create(const sonde_mesh *mesh, sonde_convex *convex, sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && convex != NULL);
  *convex = (sonde_convex){0};
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

  status = sonde_mesh_copy(mesh, &convex->hull, error);
  if (!status) status = sonde_topology_build(&convex->hull, &convex->topology, error);
  // Hill climbing starts anywhere, so every vertex must belong to the surface.
  const uint32_t *start = convex->topology.start;
  for (uint32_t v = 0; v < convex->topology.vertex_count && !status; ++v)
    if (start[v] == start[v + 1])
      status = sonde_fail(error, SONDE_MESH, "vertex %u of the convex body belongs to no face", v);
  if (!status) {
    const sonde_mesh *hull = &convex->hull;
    sonde_vec3 low = hull->vertices[0], high = low;
    for (uint32_t v = 0; v < hull->vertex_count; ++v) {
      low = v_min(low, hull->vertices[v]);
      high = v_max(high, hull->vertices[v]);
    }
    double extent = v_distance(low, high) / 2;

    sized_face *order = SONDE_NEW(sized_face, hull->face_count);
    bool *done = SONDE_NEW(bool, hull->face_count);
    uint32_t *patch = SONDE_NEW(uint32_t, hull->face_count);
    convex->plane_normal = SONDE_NEW(sonde_vec3, hull->face_count);
    convex->plane_offset_m = SONDE_NEW(double, hull->face_count);
    if (order && done && patch && convex->plane_normal && convex->plane_offset_m)
      find_planes(convex, COPLANAR * extent, order, done, patch);
    else
      status = sonde_fail_memory(error);
    sonde_free(order);
    sonde_free(done);
    sonde_free(patch);

    // every vertex behind every plane
    for (uint32_t i = 0; i < convex->plane_count && !status; ++i)
      for (uint32_t v = 0; v < hull->vertex_count && !status; ++v) {
        double height =
            v_dot(convex->plane_normal[i], hull->vertices[v]) - convex->plane_offset_m[i];
        if (!(height <= CONVEX_SLACK * extent))
          status = sonde_fail(error, SONDE_MESH,
                              "the mesh is not convex: vertex %u stands %g m out of a face plane",
                              v, height);
      }
  }
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
