// First touch of moving bodies by conservative advancement.
//
// At a moment with distance s along the unit n from A to B, the planes across n through the closest
// points part the bodies. A point of A nears B's plane at most with
//
//     (v_a - v_b).n + |w_a x n| r_a + |w_b x n| r_b
//
// for the rest of the motion, r the largest distance of a body's points from its origin, so that s
// divided by this speed may pass without a touch.
#include "contact/difference.h"
#include "contact/tree.h"
#include "geometry/internal.h"

enum { MAX_ADVANCES = 512 };

sonde_pose sonde_motion_pose(const sonde_motion *motion, double time_s) {
  sonde_pose pose = motion->start;
  SONDE_ASSERT(time_s >= 0);
  double spin = v_norm(motion->spin_rad_s), half = 0.5 * spin * time_s;
  pose.position = v_madd(pose.position, time_s, motion->velocity_m_s);
  if (!(spin > 0)) return pose;
  sonde_vec3 axis = v_scale(motion->spin_rad_s, sin(half) / spin);
  pose.rotation = q_mul((sonde_quat){cos(half), axis.x, axis.y, axis.z}, pose.rotation);
  return pose;
}

sonde_cast_result sonde_convex_cast(const sonde_convex *a, const sonde_motion *motion_a,
                                    const sonde_convex *b, const sonde_motion *motion_b,
                                    double duration_s, double margin_m) {
  SONDE_ASSERT(margin_m > 0 && duration_s >= 0);
  sonde_cast_result r = {0};
  sonde_gjk_cache cache = {0};
  for (;;) {
    sonde_pose at_a = sonde_motion_pose(motion_a, r.time_s);
    sonde_pose at_b = sonde_motion_pose(motion_b, r.time_s);
    sonde_gjk_result g = sonde_gjk_distance(a, at_a, b, at_b, &cache);
    ++r.iterations;
    r.support_calls += g.support_calls;
    r.distance_m = g.distance_m;
    r.point_m = g.point_a_m;
    if (!g.overlap) r.direction = v_unit(v_sub(g.point_b_m, g.point_a_m), vec3(0, 0, 0));
    r.hit = g.distance_m <= margin_m || r.iterations == MAX_ADVANCES;
    if (r.hit || r.time_s >= duration_s) return r;
    // No point of A nears B faster than this speed.
    double speed = v_dot(v_sub(motion_a->velocity_m_s, motion_b->velocity_m_s), r.direction);
    speed += v_norm(v_cross(motion_a->spin_rad_s, r.direction)) * a->radius_m;
    speed += v_norm(v_cross(motion_b->spin_rad_s, r.direction)) * b->radius_m;
    double gap = g.distance_m - 0.5 * margin_m, left = duration_s - r.time_s;
    r.time_s = gap < speed * left ? r.time_s + gap / speed : duration_s;
  }
}

// ---- faces --------------------------------------------------------------------------------

typedef struct face_body {
  sonde_vec3 vertices[3];
  uint32_t start[4], neighbour[6];
  sonde_convex convex;
  sonde_motion rest; // at its first corner
} face_body;

sonde_cast_result sonde_convex_cast_faces(const sonde_convex *a, const sonde_motion *motion_a,
                                          const sonde_face_tree *b, double duration_s,
                                          double margin_m) {
  SONDE_ASSERT(b != NULL && margin_m > 0 && duration_s >= 0);
  sonde_cast_result best = {.time_s = duration_s, .distance_m = INFINITY};
  // The box holds all that the body passes.
  sonde_bounds box = bounds_none();
  double radius = a->radius_m;
  sonde_vec3 reach = vec3(radius, radius, radius), margin = vec3(margin_m, margin_m, margin_m);
  sonde_vec3 shift = v_scale(motion_a->velocity_m_s, duration_s);
  if (v_norm2(motion_a->spin_rad_s) > 0) {
    box = (sonde_bounds){v_sub(motion_a->start.position, reach),
                         v_add(motion_a->start.position, reach)};
  } else {
    sonde_mat3 rotation = q_matrix(motion_a->start.rotation);
    for (uint32_t v = 0; v < a->hull.vertex_count; ++v)
      box =
          bounds_add(box, v_add(m_mul_v(rotation, a->hull.vertices[v]), motion_a->start.position));
  }
  box = bounds_join(box, (sonde_bounds){v_add(box.low, shift), v_add(box.high, shift)});
  box = (sonde_bounds){v_sub(box.low, margin), v_add(box.high, margin)};
  uint32_t stack[TREE_STACK], depth = 0;
  stack[depth++] = 0;
  while (depth) {
    uint32_t at = stack[--depth];
    const tree_node *node = &b->nodes[at];
    if (!bounds_meet(&node->box, &box, 0)) continue;
    if (!node->count) {
      SONDE_ASSERT(depth + 2 <= TREE_STACK);
      stack[depth++] = node->first;
      stack[depth++] = at + 1;
      continue;
    }
    for (uint32_t i = node->first; i < node->first + node->count; ++i) {
      face_body face;
      // A face is a convex body without inside, at rest at its first corner.
      face = (face_body){.start = {0, 2, 4, 6}, .neighbour = {1, 2, 0, 2, 0, 1}};
      sonde_vec3 origin = b->vertices[b->corners[i][0]];
      for (int k = 0; k < 3; ++k) face.vertices[k] = v_sub(b->vertices[b->corners[i][k]], origin);
      face.convex.hull.vertex_count = 3;
      face.convex.hull.vertices = face.vertices;
      face.convex.topology.vertex_count = 3;
      face.convex.topology.start = face.start;
      face.convex.topology.neighbour = face.neighbour;
      face.rest.start = (sonde_pose){origin, {1, 0, 0, 0}};
      sonde_cast_result r =
          sonde_convex_cast(a, motion_a, &face.convex, &face.rest, best.time_s, margin_m);
      // The earliest touch of all faces remains, with the sum of the work.
      r.iterations += best.iterations;
      r.support_calls += best.support_calls;
      if (r.hit && (!best.hit || r.time_s < best.time_s)) best = r;
      best.iterations = r.iterations;
      best.support_calls = r.support_calls;
    }
  }
  return best;
}
