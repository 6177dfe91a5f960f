// A body's surface as VTK XML polydata, which ParaView opens: points, triangles, and per point the
// velocity and the displacement from the start.
#include "scene/state.h"

#include "base/base.h"
#include "base/maths.h"

// Three numbers per point.
static void put_array(sonde_file *file, const char *name, const sonde_vec3 *values,
                      uint32_t count) {
  sonde_file_printf(file,
                    "<DataArray type=\"Float32\" Name=\"%s\" NumberOfComponents=\"3\" "
                    "format=\"ascii\">\n",
                    name);
  for (uint32_t i = 0; i < count; ++i)
    sonde_file_printf(file, "%.7g %.7g %.7g\n", values[i].x, values[i].y, values[i].z);
  sonde_file_printf(file, "</DataArray>\n");
}

sonde_status sonde_scene_save_vtp(const sonde_scene_state *state, uint32_t b, const char *path,
                                  sonde_error *error) {
  SONDE_ASSERT(b < state->scene->body_count);
  const sonde_body *body = &state->scene->bodies[b];
  const sonde_mesh *mesh = &body->surface;
  const sonde_vec3 *node_velocity = state->now.velocity + body->first_slot;
  uint32_t count = mesh->vertex_count;
  bool rigid = sonde_body_is_rigid(body);
  SONDE_ASSERT(mesh->face_count > 0);
  sonde_vec3 *place = SONDE_NEW(sonde_vec3, 3 * (size_t)count);
  if (!place) return sonde_fail_memory(error);
  sonde_vec3 *velocity = place + count, *displacement = velocity + count;
  sonde_scene_surface(state, b, place);
  for (uint32_t i = 0; i < count; ++i) {
    sonde_vec3 start = mesh->vertices[i];
    if (rigid) {
      sonde_vec3 arm = v_sub(place[i], state->now.position[body->first_slot]);
      velocity[i] = v_add(node_velocity[0], v_cross(node_velocity[1], arm));
      start = pose_apply(body->start, v_add(start, body->mass.centre_m));
    } else
      velocity[i] = node_velocity[body->surface_node ? body->surface_node[i] : i];
    displacement[i] = v_sub(place[i], start);
  }
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_printf(file,
                      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
                      "byte_order=\"LittleEndian\">\n<PolyData>\n<Piece NumberOfPoints=\"%u\" "
                      "NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
                      "NumberOfPolys=\"%u\">\n<PointData Vectors=\"velocity_m_s\">\n",
                      count, mesh->face_count);
    put_array(file, "velocity_m_s", velocity, count);
    put_array(file, "displacement_m", displacement, count);
    sonde_file_printf(file, "</PointData>\n<Points>\n");
    put_array(file, "points_m", place, count);
    sonde_file_printf(file, "</Points>\n<Polys>\n<DataArray type=\"Int32\" "
                            "Name=\"connectivity\" format=\"ascii\">\n");
    for (uint32_t f = 0; f < mesh->face_count; ++f)
      sonde_file_printf(file, "%u %u %u\n", mesh->faces[f][0], mesh->faces[f][1],
                        mesh->faces[f][2]);
    sonde_file_printf(file, "</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" "
                            "format=\"ascii\">\n");
    for (uint32_t f = 0; f < mesh->face_count; ++f) sonde_file_printf(file, "%u\n", 3 * (f + 1));
    sonde_file_printf(file, "</DataArray>\n</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n");
    status = sonde_file_commit(file, error);
  }
  sonde_free(place);
  return status;
}
