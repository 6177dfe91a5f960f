// Sheets of springs: thickness and bending.
//
// A sheet's nodes lie in its middle. Its surface is closed: a vertex half a thickness above and one
// below each node, and a rim. Bending follows the angles between faces: an edge of length e between
// faces of areas A1 and A2 has the stiffness B e^2/(A1 + A2), B the flexural rigidity (N m). On a
// grid of squares bent along its sides this is the energy B kappa^2/2 per area.
#include "scene/scene.h"

#include "base/base.h"
#include "base/maths.h"
#include "geometry/internal.h"

#include <string.h>

static void read_creases(sonde_reader *reader, sonde_place springs, sonde_body *body,
                         double bending_n_m, double damping_s) {
  sonde_topology topology = {0};
  sonde_error error = {0};
  sonde_status status = sonde_topology_build(&body->surface, &topology, &error);
  if (!status) {
    body->crease = SONDE_NEW(sonde_crease, topology.edge_count);
    if (!body->crease) status = sonde_fail_memory(&error);
  }
  for (uint32_t e = 0; e < topology.edge_count && !status; ++e) {
    const uint32_t *end = topology.edges[e], *side = topology.edge_faces[e];
    if (side[0] == UINT32_MAX || side[1] == UINT32_MAX) continue;
    // The corner across the edge in each face; the edge runs along the first face's order.
    uint32_t corner[2] = {0, 0};
    bool along = false;
    for (int s = 0; s < 2; ++s)
      for (int k = 0; k < 3; ++k) {
        const uint32_t *v = body->surface.faces[side[s]];
        if (v[k] != end[0] && v[k] != end[1]) corner[s] = v[k];
        if (s == 0 && v[k] == end[0]) along = v[(k + 1) % 3] == end[1];
      }
    sonde_crease *crease = &body->crease[body->crease_count++];
    *crease =
        (sonde_crease){.node = {end[along ? 0 : 1], end[along ? 1 : 0], corner[0], corner[1]}};
    sonde_vec3 gradient[4], edge = v_sub(body->node[end[1]], body->node[end[0]]);
    crease->rest_rad = sonde_crease_angle(crease, body->node, gradient);
    double twice_area = 0;
    for (int s = 0; s < 2; ++s)
      twice_area += v_norm(v_cross(edge, v_sub(body->node[corner[s]], body->node[end[0]])));
    crease->stiffness_n_m = bending_n_m * v_norm2(edge) / (0.5 * twice_area);
    crease->damper_n_m_s = crease->stiffness_n_m * damping_s;
  }
  sonde_topology_clear(&topology);
  if (status) sonde_reader_pass(reader, springs, &error);
}

// Both sides of the middle surface, and a rim along the edges of one face.
static sonde_status thicken(sonde_body *body, double thickness_m, sonde_error *error) {
  sonde_mesh middle = body->surface, *mesh = &body->surface;
  sonde_mesh_report report = {0};
  sonde_topology around = {0};
  sonde_status status = sonde_mesh_inspect(&middle, &report, error);
  if (status) return status;
  uint32_t n = middle.vertex_count, rim = report.boundary_edges;
  if (report.closed || rim == 0)
    return sonde_fail(error, SONDE_MESH, "thickness_mm needs an open surface, this one is closed");
  *mesh = (sonde_mesh){0};
  status = sonde_topology_build(&middle, &around, error);
  if (!status) status = sonde_mesh_create(mesh, 2 * n, 2 * middle.face_count + 2 * rim, error);
  body->surface_node = status ? NULL : SONDE_NEW(uint32_t, 2 * n);
  if (!status && !body->surface_node) status = sonde_fail_memory(error);
  uint32_t used = middle.face_count;
  for (uint32_t f = 0; f < middle.face_count && !status; ++f) {
    const uint32_t *v = middle.faces[f];
    memcpy(mesh->faces[f], v, sizeof mesh->faces[f]);
    memcpy(mesh->faces[used++], (uint32_t[3]){n + v[0], n + v[2], n + v[1]}, sizeof mesh->faces[0]);
    for (int k = 0; k < 3; ++k) {
      // An edge is on the rim when no face has it the other way round.
      uint32_t a = v[k], b = v[(k + 1) % 3];
      bool inner = false;
      for (uint32_t i = around.face_start[b]; i < around.face_start[b + 1]; ++i) {
        const uint32_t *w = middle.faces[around.face_list[i]];
        for (int j = 0; j < 3; ++j) inner |= w[j] == b && w[(j + 1) % 3] == a;
      }
      if (inner) continue;
      memcpy(mesh->faces[used++], (uint32_t[3]){b, a, n + a}, sizeof mesh->faces[0]);
      memcpy(mesh->faces[used++], (uint32_t[3]){b, n + a, n + b}, sizeof mesh->faces[0]);
    }
  }
  SONDE_ASSERT(status || used == mesh->face_count);
  for (uint32_t i = 0; i < 2 * n && !status; ++i) body->surface_node[i] = i % n;
  body->offset_m = 0.5 * thickness_m;
  body->middle_faces = middle.face_count;
  if (!status) sonde_sheet_surface(body, body->node, mesh->vertices);
  sonde_topology_clear(&around);
  sonde_mesh_clear(&middle);
  return status;
}

void sonde_read_sheet(sonde_reader *reader, sonde_place springs, sonde_body *body) {
  double bending = sonde_read_real(reader, springs, "bending_n_m", 0, 1e9, 0);
  double damping_s = sonde_read_real(reader, springs, "bending_damping_s", 0, 1e3, 0);
  double thickness_m =
      1e-3 * sonde_read_real(reader, springs, "thickness_mm", 0, SONDE_SCENE_FAR_MM, 0);
  if (!sonde_reader_good(reader)) return;
  if (bending > 0) read_creases(reader, springs, body, bending, damping_s);
  sonde_error error = {0};
  if (thickness_m > 0 && sonde_reader_good(reader) && thicken(body, thickness_m, &error))
    sonde_reader_pass(reader, springs, &error);
}

void sonde_read_self(sonde_reader *reader, sonde_place at, sonde_body *body) {
  // A sheet touches itself where its middle comes nearer to itself than it is thick; other bodies
  // do where the file gives a distance.
  sonde_place distance = sonde_read_find(reader, at, "self_contact_mm");
  body->self_m = 1e-3 * sonde_read_real(reader, at, "self_contact_mm", 0, SONDE_SCENE_FAR_MM,
                                        2e3 * body->offset_m);
  if (body->model && distance)
    sonde_reader_fail(reader, distance, SONDE_ARGUMENT,
                      "a two-layer tissue does not touch itself: its anchors hold it apart");
  if (body->self_m > 0) body->self_area_m2 = SONDE_NEW(double, body->node_count);
  sonde_error error = {0};
  if (body->self_m > 0 && !body->self_area_m2 && sonde_fail_memory(&error))
    sonde_reader_pass(reader, at, &error);
  if (!(body->offset_m > 0)) body->middle_faces = body->surface.face_count;
  for (uint32_t f = 0; f < body->middle_faces && body->self_area_m2; ++f) {
    const uint32_t node[3] = {sonde_body_corner(body, f, 0), sonde_body_corner(body, f, 1),
                              sonde_body_corner(body, f, 2)};
    sonde_vec3 x = body->node[node[0]];
    sonde_vec3 normal = v_cross(v_sub(body->node[node[1]], x), v_sub(body->node[node[2]], x));
    // A third of the face for each node, and half of that: a node meets faces, and the nodes of
    // those faces meet the node's own.
    for (int k = 0; k < 3; ++k) body->self_area_m2[node[k]] += 0.5 * 0.5 * v_norm(normal) / 3;
  }
}
