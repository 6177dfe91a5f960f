// A body's surface as VTK XML polydata, which ParaView opens: points, triangles, and per point the
// velocity and the displacement from the start.
#include "scene/state.h"

#include "base/base.h"
#include "base/maths.h"

// Velocity of a surface vertex.
static sonde_vec3 velocity_of(const sonde_scene_state *state, uint32_t b, uint32_t vertex,
                              sonde_vec3 place) {
  const sonde_body *body = &state->scene->bodies[b];
  const sonde_vec3 *v = state->now.velocity + body->first_slot;
  if (!sonde_body_is_rigid(body))
    return v[body->surface_node ? body->surface_node[vertex] : vertex];
  sonde_vec3 arm = v_sub(place, state->now.position[body->first_slot]);
  return v_add(v[0], v_cross(v[1], arm));
}

static sonde_vec3 start_of(const sonde_body *body, uint32_t vertex) {
  sonde_vec3 p = body->surface.vertices[vertex];
  return sonde_body_is_rigid(body) ? pose_apply(body->start, v_add(p, body->mass.centre_m)) : p;
}

static void begin_array(sonde_file *file, const char *name) {
  sonde_file_printf(file,
                    "<DataArray type=\"Float32\" Name=\"%s\" NumberOfComponents=\"3\" "
                    "format=\"ascii\">\n",
                    name);
}

static void put(sonde_file *file, sonde_vec3 p) {
  sonde_file_printf(file, "%.7g %.7g %.7g\n", p.x, p.y, p.z);
}

static void put_points(sonde_file *file, const sonde_scene_state *state, uint32_t b,
                       const sonde_vec3 *place) {
  const sonde_body *body = &state->scene->bodies[b];
  uint32_t count = body->surface.vertex_count;
  sonde_file_printf(file, "<PointData Vectors=\"velocity_m_s\">\n");
  begin_array(file, "velocity_m_s");
  for (uint32_t i = 0; i < count; ++i) put(file, velocity_of(state, b, i, place[i]));
  sonde_file_printf(file, "</DataArray>\n");
  begin_array(file, "displacement_m");
  for (uint32_t i = 0; i < count; ++i) put(file, v_sub(place[i], start_of(body, i)));
  sonde_file_printf(file, "</DataArray>\n</PointData>\n<Points>\n");
  begin_array(file, "points_m");
  for (uint32_t i = 0; i < count; ++i) put(file, place[i]);
  sonde_file_printf(file, "</DataArray>\n</Points>\n");
}

static void put_faces(sonde_file *file, const sonde_mesh *mesh) {
  SONDE_ASSERT(mesh->face_count > 0);
  sonde_file_printf(file, "<Polys>\n<DataArray type=\"Int32\" Name=\"connectivity\" "
                          "format=\"ascii\">\n");
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    sonde_file_printf(file, "%u %u %u\n", mesh->faces[f][0], mesh->faces[f][1], mesh->faces[f][2]);
  sonde_file_printf(file, "</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" "
                          "format=\"ascii\">\n");
  for (uint32_t f = 0; f < mesh->face_count; ++f) sonde_file_printf(file, "%u\n", 3 * (f + 1));
  sonde_file_printf(file, "</DataArray>\n</Polys>\n");
}

sonde_status sonde_scene_save_vtp(const sonde_scene_state *state, uint32_t b, const char *path,
                                  sonde_error *error) {
  SONDE_ASSERT(b < state->scene->body_count);
  const sonde_mesh *mesh = &state->scene->bodies[b].surface;
  sonde_vec3 *place = SONDE_NEW(sonde_vec3, mesh->vertex_count);
  if (!place) return sonde_fail_memory(error);
  sonde_scene_surface(state, b, place);
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_printf(file,
                      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
                      "byte_order=\"LittleEndian\">\n<PolyData>\n<Piece NumberOfPoints=\"%u\" "
                      "NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
                      "NumberOfPolys=\"%u\">\n",
                      mesh->vertex_count, mesh->face_count);
    put_points(file, state, b, place);
    put_faces(file, mesh);
    sonde_file_printf(file, "</Piece>\n</PolyData>\n</VTKFile>\n");
    status = sonde_file_commit(file, error);
  }
  sonde_free(place);
  return status;
}
