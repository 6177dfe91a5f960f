// Depth in a convex probe and the contact's quadrature over a face.
#include "touch.h"

#include "base/base.h"

#include <string.h>

// ---- depth --------------------------------------------------------------------------------

bool sonde_touch_depth(const sonde_touch_shape *s, sonde_vec3 point, double margin_m,
                       double *depth_m, sonde_vec3 *out, sonde_mat3 *bend) {
  SONDE_ASSERT(s != NULL && s->probe != NULL && s->rounding_m >= 0 && margin_m >= 0);
  const double ball = s->probe->ball_radius_m, round = s->rounding_m;
  if (ball > 0) {
    sonde_vec3 from = v_sub(point, vec3(0, 0, -ball - round));
    double way = v_norm(from);
    *depth_m = ball + round - way;
    if (*depth_m <= -margin_m) return false;
    *out = v_unit(from, vec3(0, 0, 1));
    *bend = way > 1e-9 ? m_rank1(*out, -1 / way, 1 / way) : m_zero();
    return true;
  }
  // The core stands back by the rounding, so that the tip stays where it is.
  const sonde_convex *body = &s->probe->body;
  const sonde_vec3 core = v_madd(point, round, vec3(0, 0, 1));
  double beyond = -INFINITY;
  uint32_t plane = 0;
  const double reach = round + margin_m, most = body->radius_m + reach;
  if (v_norm2(core) > most * most) return false;
  for (uint32_t k = 0; k < body->plane_count; ++k) {
    double d = v_dot(body->plane_normal[k], core) - body->plane_offset_m[k];
    if (d >= reach) return false;
    if (d > beyond) beyond = d, plane = k;
  }
  *out = body->plane_normal[plane], *bend = m_zero();
  *depth_m = round - beyond;
  if (beyond <= 0) return *depth_m > -margin_m;
  // A point whose foot on the farthest plane lies in the core is opposite the inside of that face.
  bool inside = true;
  const sonde_vec3 foot = v_madd(core, -beyond, *out);
  for (uint32_t k = 0; k < body->plane_count && inside; ++k)
    inside = k == plane || v_dot(body->plane_normal[k], foot) <= body->plane_offset_m[k];
  if (inside) return true;
  // Outside of the core: the nearest of its faces, edges or corners.
  SONDE_ASSERT(s->hull != NULL);
  const sonde_surface_point near = sonde_surface_closest(s->hull, core);
  *depth_m = round - near.distance_m;
  if (*depth_m <= -margin_m) return false;
  if (near.distance_m < 1e-9) return true;
  const sonde_vec3 normal = *out;
  *out = v_scale(v_sub(core, near.point_m), 1 / near.distance_m);
  if (v_dot(*out, normal) > 1 - 1e-12) return true; // opposite the inside of a face
  *bend = m_rank1(*out, -1 / near.distance_m, 1 / near.distance_m);
  // Along an edge the way out stays the same.
  int corners = 0, at[3];
  for (int k = 0; k < 3; ++k)
    if (near.weight[k] > 1e-12) at[corners++] = k;
  if (corners != 2) return true;
  const uint32_t *v = body->hull.faces[near.face];
  const sonde_vec3 edge =
      v_unit(v_sub(body->hull.vertices[v[at[1]]], body->hull.vertices[v[at[0]]]), vec3(0, 0, 0));
  *bend = m_add(*bend, m_rank1(edge, -1 / near.distance_m, 0));
  return true;
}

// ---- a face -------------------------------------------------------------------------------

double sonde_touch_point(const sonde_vec3 rest[4], int point, double shape[4]) {
  static const double gauss[3] = {-0.77459666924148338, 0, 0.77459666924148338};
  static const double part[3] = {5.0 / 9, 8.0 / 9, 5.0 / 9};
  static const double sign[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  SONDE_ASSERT(point >= 0 && point < SONDE_TOUCH_POINTS);
  sonde_vec3 t[2] = {vec3(0, 0, 0), vec3(0, 0, 0)};
  for (int c = 0; c < 4; ++c) {
    const double *g = sign[c], u = 1 + g[0] * gauss[point % 3], v = 1 + g[1] * gauss[point / 3];
    shape[c] = 0.25 * u * v;
    t[0] = v_madd(t[0], 0.25 * g[0] * v, rest[c]);
    t[1] = v_madd(t[1], 0.25 * g[1] * u, rest[c]);
  }
  return part[point % 3] * part[point / 3] * v_norm(v_cross(t[0], t[1]));
}

bool sonde_touch_face(const sonde_touch_shape *s, sonde_pose pose, double stiffness_n_m3,
                      const sonde_stick *stick, const sonde_vec3 rest[4], const sonde_vec3 now[4],
                      bool bend, sonde_touch *sum, double f[12], double (*k)[12]) {
  SONDE_ASSERT(sum != NULL && f != NULL && stiffness_n_m3 > 0);
  const sonde_mat3 turn = q_matrix(pose.rotation), back = m_transpose(turn);
  bool touches = false;
  for (int p = 0; p < SONDE_TOUCH_POINTS; ++p) {
    double shape[4], depth;
    sonde_vec3 x = vec3(0, 0, 0), out;
    sonde_mat3 change;
    const double area = sonde_touch_point(rest, p, shape), w = stiffness_n_m3 * area;
    for (int c = 0; c < 4; ++c) x = v_madd(x, shape[c], now[c]);
    const sonde_vec3 local = m_mul_v(back, v_sub(x, pose.position));
    const bool in = sonde_touch_depth(s, local, 0, &depth, &out, &change);
    const bool held = stick && stick[p].limit_pa > 0;
    if (!in && !held) continue;
    if (!touches) {
      touches = true;
      memset(f, 0, 12 * sizeof *f);
      if (k) memset(k, 0, 12 * sizeof *k);
    }
    sonde_vec3 push = vec3(0, 0, 0); // in the probe's frame, as is the stiffness
    sonde_mat3 stiff = m_zero();
    if (in) {
      push = v_scale(out, w * depth);
      stiff = m_rank1(out, w, 0);
      if (bend) stiff = m_add(stiff, m_scale(change, -w * depth));
      sum->energy_j += 0.5 * w * depth * depth;
      sum->area_m2 += area;
      sum->deepest_m = fmax(sum->deepest_m, depth);
    }
    if (held) {
      const sonde_vec3 pull = sonde_stick_pull(&stick[p], local);
      const double way = v_norm(pull), most = stick[p].limit_pa / stiffness_n_m3;
      const double share = way > most ? most / way : 1; // of the pull that sticks
      const sonde_vec3 along = v_scale(pull, way > most ? 1 / way : 0);
      push = v_madd(push, -w * share, pull);
      sum->energy_j += w * (0.5 * share * way * share * way + most * (1 - share) * way);
      sum->slipped_j += w * most * (1 - share) * way;
      stiff = m_add(stiff, m_rank1(stick[p].out, -w * share, w * share));
      stiff = m_add(stiff, m_rank1(along, -w * share, 0));
    }
    push = m_mul_v(turn, push);
    sum->force_n = v_sub(sum->force_n, push);
    sum->torque_nm = v_sub(sum->torque_nm, v_cross(v_sub(x, pose.position), push));
    for (int c = 0; c < 4; ++c) {
      f[3 * c] += shape[c] * push.x, f[3 * c + 1] += shape[c] * push.y;
      f[3 * c + 2] += shape[c] * push.z;
    }
    if (!k) continue;
    stiff = m_mul(turn, m_mul(stiff, back));
    for (int c = 0; c < 12; ++c)
      for (int d = 0; d < 12; ++d) k[c][d] += shape[c / 3] * shape[d / 3] * stiff.m[c % 3][d % 3];
  }
  return touches;
}
