// A sheet every step: the angles of its creases, and its surface around its nodes.
#include "scene/scene.h"

#include "base/base.h"
#include "base/maths.h"

double sonde_crease_angle(const sonde_crease *crease, const sonde_vec3 *x, sonde_vec3 gradient[4]) {
  const uint32_t *node = crease->node;
  sonde_vec3 e = v_sub(x[node[1]], x[node[0]]);
  sonde_vec3 n1 = v_cross(e, v_sub(x[node[2]], x[node[0]]));
  sonde_vec3 n2 = v_cross(v_sub(x[node[3]], x[node[0]]), e);
  double length = v_norm(e), square1 = v_norm2(n1), square2 = v_norm2(n2);
  for (int k = 0; k < 4; ++k) gradient[k] = vec3(0, 0, 0);
  if (!(length > 0 && square1 > 0 && square2 > 0)) return crease->rest_rad;
  sonde_vec3 along = v_scale(e, 1 / length);
  double sine = v_dot(v_cross(n1, n2), along), cosine = v_dot(n1, n2);
  // A corner's move along its face's normal turns the face by the move over the face's height.
  sonde_vec3 u1 = v_scale(n1, 1 / square1), u2 = v_scale(n2, 1 / square2);
  for (int k = 0; k < 2; ++k) {
    sonde_vec3 other = x[node[1 - k]];
    double sign = k ? -1 : 1;
    double s1 = sign * v_dot(v_sub(x[node[2]], other), along);
    double s2 = sign * v_dot(v_sub(x[node[3]], other), along);
    gradient[k] = v_neg(v_add(v_scale(u1, s1), v_scale(u2, s2)));
  }
  gradient[2] = v_scale(u1, -length);
  gradient[3] = v_scale(u2, -length);
  return atan2(sine, cosine);
}

void sonde_sheet_surface(const sonde_body *body, const sonde_vec3 *node, sonde_vec3 *vertices) {
  uint32_t n = body->node_count;
  // The lower vertices hold the sums of the faces' areas while normals are made.
  for (uint32_t i = 0; i < n; ++i) vertices[n + i] = vec3(0, 0, 0);
  for (uint32_t f = 0; f < body->middle_faces; ++f) {
    const uint32_t *v = body->surface.faces[f];
    sonde_vec3 area = v_cross(v_sub(node[v[1]], node[v[0]]), v_sub(node[v[2]], node[v[0]]));
    for (int k = 0; k < 3; ++k) vertices[n + v[k]] = v_add(vertices[n + v[k]], area);
  }
  for (uint32_t i = 0; i < n; ++i) {
    sonde_vec3 normal = v_unit(vertices[n + i], vec3(0, 0, 1));
    vertices[i] = v_madd(node[i], body->offset_m, normal);
    vertices[n + i] = v_madd(node[i], -body->offset_m, normal);
  }
}
