// Contact of a body with itself (docs/scene_theory.md): nodes are pushed away from the faces that
// come near to them and lie elsewhere in the body at rest.
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"
#include "geometry/triangle.h"

#include <float.h>

// Parts that lie so many contact distances apart at rest, or farther, may touch each other.
static const double NEIGHBOUR = 1.5;
enum { NEAR_FACES = 256 };

// A face beside a node: the corners' nodes, the nearest point's weights, and the way from it.
typedef struct beside {
  uint32_t corner[3];
  double weight[3], distance_m;
  sonde_vec3 away;
} beside;

static void push_away(sonde_scene_state *state, uint32_t b, uint32_t node, const beside *from) {
  const sonde_body *body = &state->scene->bodies[b];
  sonde_push *push = sonde_push_new(state, UINT32_MAX);
  if (!push) return;
  SONDE_ASSERT(state->row_count + 4 <= state->row_capacity);
  // Two foundations of the body's material in series.
  double stiffness = 0.5 * body->material.stiffness_n_m3 * body->self_area_m2[node];
  push->pulls = false;
  push->body = b;
  push->value = body->self_m - from->distance_m;
  push->stiffness = stiffness;
  push->damper = stiffness * body->material.damping_s;
  push->row_count = 4;
  state->rows[state->row_count] = body->first_slot + node;
  state->g[state->row_count++] = v_neg(from->away);
  for (int k = 0; k < 3; ++k) {
    state->rows[state->row_count] = body->first_slot + from->corner[k];
    state->g[state->row_count++] = v_scale(from->away, from->weight[k]);
  }
}

void sonde_selves_push(sonde_scene_state *state) {
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (!(body->self_m > 0) || state->now.asleep[b]) continue;
    const sonde_vec3 *x = state->stage_position + body->first_slot, *rest = body->node;
    for (uint32_t i = 0; i < body->node_count; ++i) {
      uint32_t faces[NEAR_FACES], found = 0;
      beside near[NEAR_FACES];
      if (!(body->self_area_m2[i] > 0)) continue;
      uint32_t count = sonde_face_tree_within(state->tree[b], x[i], body->self_m + body->offset_m,
                                              faces, NEAR_FACES);
      if (count > NEAR_FACES) state->report.flags |= SONDE_SCENE_CONTACT_FULL, count = NEAR_FACES;
      // Faces within the contact distance that are no neighbours at rest.
      for (uint32_t k = 0; k < count; ++k) {
        if (faces[k] >= body->middle_faces) continue;
        beside *now = &near[found];
        uint32_t v[3];
        for (int c = 0; c < 3; ++c) v[c] = now->corner[c] = sonde_body_corner(body, faces[k], c);
        if (v[0] == i || v[1] == i || v[2] == i) continue;
        sonde_triangle_closest(rest[i], rest[v[0]], rest[v[1]], rest[v[2]], now->weight);
        sonde_vec3 start = vec3(0, 0, 0), point = start;
        for (int c = 0; c < 3; ++c) start = v_madd(start, now->weight[c], rest[v[c]]);
        if (v_distance(rest[i], start) < NEIGHBOUR * body->self_m) continue;
        sonde_triangle_closest(x[i], x[v[0]], x[v[1]], x[v[2]], now->weight);
        for (int c = 0; c < 3; ++c) point = v_madd(point, now->weight[c], x[v[c]]);
        now->distance_m = v_distance(x[i], point);
        now->away = v_scale(v_sub(x[i], point), 1 / fmax(now->distance_m, DBL_MIN));
        found += now->distance_m < body->self_m && now->distance_m > 0;
      }
      // The nearest face pushes, and the nearest on the other side of the node: it may lie between
      // two layers.
      const beside *nearest = NULL, *other = NULL;
      for (uint32_t k = 0; k < found; ++k)
        if (!nearest || near[k].distance_m < nearest->distance_m) nearest = &near[k];
      for (uint32_t k = 0; k < found; ++k)
        if (v_dot(near[k].away, nearest->away) < 0 &&
            (!other || near[k].distance_m < other->distance_m))
          other = &near[k];
      if (nearest) push_away(state, b, i, nearest);
      if (other) push_away(state, b, i, other);
    }
  }
}
