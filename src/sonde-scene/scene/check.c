// Flaws of meshes that have to bound a solid.
#include "scene/scene.h"

#include "base/base.h"
#include "base/maths.h"
#include "contact/contact.h"

double sonde_mesh_thickness(const sonde_mesh *surface, double *area_m2) {
  double volume = 0, area = 0;
  SONDE_ASSERT(surface->vertex_count > 0);
  sonde_vec3 origin = surface->vertices[0];
  for (uint32_t f = 0; f < surface->face_count; ++f) {
    sonde_vec3 p[3];
    for (int k = 0; k < 3; ++k) p[k] = v_sub(surface->vertices[surface->faces[f][k]], origin);
    volume += v_dot(p[0], v_cross(p[1], p[2])) / 6;
    area += 0.5 * v_norm(v_cross(v_sub(p[1], p[0]), v_sub(p[2], p[0])));
  }
  *area_m2 = area;
  return area > 0 && volume > 0 ? volume / area : 0;
}

sonde_status sonde_mesh_check_areas(const sonde_mesh *mesh, sonde_error *error) {
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    const uint32_t *v = mesh->faces[f];
    sonde_vec3 a = v_sub(mesh->vertices[v[1]], mesh->vertices[v[0]]);
    sonde_vec3 b = v_sub(mesh->vertices[v[2]], mesh->vertices[v[0]]);
    double longest2 = fmax(v_norm2(a), fmax(v_norm2(b), v_norm2(v_sub(a, b))));
    if (v_norm(v_cross(a, b)) <= 1e-9 * longest2)
      return sonde_fail(error, SONDE_MESH, "triangle %u (vertices %u %u %u) has no area", f, v[0],
                        v[1], v[2]);
  }
  return SONDE_OK;
}

// Whether an edge of a passes through the inside of b, by signs of volumes: its ends lie on
// different sides, and its line passes within the three edges of b.
static bool edges_cross(const sonde_mesh *mesh, const uint32_t a[3], const uint32_t b[3]) {
  const sonde_vec3 *x = mesh->vertices;
  const sonde_vec3 t[3] = {x[b[0]], x[b[1]], x[b[2]]};
  for (int k = 0; k < 3; ++k) {
    uint32_t p = a[k], q = a[(k + 1) % 3];
    bool touches = p == b[0] || p == b[1] || p == b[2] || q == b[0] || q == b[1] || q == b[2];
    if (touches) continue;
    sonde_vec3 d = v_sub(x[q], x[p]), n = v_cross(v_sub(t[1], t[0]), v_sub(t[2], t[0]));
    if (!(v_dot(n, v_sub(x[p], t[0])) * v_dot(n, v_sub(x[q], t[0])) < 0)) continue;
    int left = 0, right = 0;
    for (int i = 0; i < 3; ++i) {
      double side = v_dot(d, v_cross(v_sub(t[i], x[p]), v_sub(t[(i + 1) % 3], x[p])));
      left += side > 0;
      right += side < 0;
    }
    if (left == 3 || right == 3) return true;
  }
  return false;
}

sonde_status sonde_mesh_check_solid(const sonde_mesh *mesh, sonde_error *error) {
  sonde_mesh_report report;
  sonde_status status = sonde_mesh_inspect(mesh, &report, error);
  if (status) return status;
  if (!report.closed)
    return sonde_fail(error, SONDE_MESH,
                      "the mesh is open (%u boundary edges), expected a closed one",
                      report.boundary_edges);
  if (!report.outward)
    return sonde_fail(error, SONDE_MESH, "the mesh is inside out: its volume is %g mm3",
                      report.volume_m3 * 1e9);
  status = sonde_mesh_check_areas(mesh, error);
  if (status) return status;
  // Pairs of triangles with less than two corners in common must not cross.
  sonde_face_tree *tree = NULL;
  uint32_t count = 0, (*pairs)[2] = NULL;
  status = sonde_face_tree_create(mesh, &tree, error);
  if (!status) {
    count = sonde_face_tree_pairs(tree, tree, 0, NULL, 0, NULL);
    pairs = sonde_calloc(count, sizeof *pairs);
    if (pairs)
      sonde_face_tree_pairs(tree, tree, 0, pairs, count, NULL);
    else
      status = sonde_fail_memory(error);
  }
  for (uint32_t k = 0; k < count && !status; ++k) {
    if (pairs[k][0] >= pairs[k][1]) continue;
    const uint32_t *a = mesh->faces[pairs[k][0]], *b = mesh->faces[pairs[k][1]];
    int common = 0;
    for (int i = 0; i < 9; ++i) common += a[i / 3] == b[i % 3];
    if (common < 2 && (edges_cross(mesh, a, b) || edges_cross(mesh, b, a)))
      status = sonde_fail(error, SONDE_MESH, "the surface cuts itself: triangles %u and %u",
                          pairs[k][0], pairs[k][1]);
  }
  sonde_free(pairs);
  sonde_face_tree_destroy(tree);
  SONDE_ASSERT(status == SONDE_OK || !error || error->message[0]);
  return status;
}
