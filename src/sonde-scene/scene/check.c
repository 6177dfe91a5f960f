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
  sonde_face_tree *tree = NULL;
  uint32_t faces[2];
  status = sonde_face_tree_create(mesh, &tree, error);
  if (!status && sonde_face_tree_crosses(tree, mesh->face_count, faces))
    status = sonde_fail(error, SONDE_MESH, "the surface cuts itself: triangles %u and %u", faces[0],
                        faces[1]);
  sonde_face_tree_destroy(tree);
  SONDE_ASSERT(status == SONDE_OK || !error || error->message[0]);
  return status;
}
