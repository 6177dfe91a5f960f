// What cannot be true of bodies, found every step: flags with the bodies they are about.
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"

void sonde_scene_note(sonde_scene_state *state, uint32_t flag, uint32_t body, uint32_t other) {
  uint32_t k = 0;
  while (k < SONDE_SCENE_FLAGS && flag != 1u << k) ++k;
  SONDE_ASSERT(k < SONDE_SCENE_FLAGS);
  if (!(state->report.flags & flag)) state->noted[k] = (sonde_scene_event){0, 1, body, other, 0};
  state->report.flags |= flag;
}

// Volume now over that at the start.
static double volume_ratio(const sonde_scene_state *state, uint32_t b) {
  const sonde_body *body = &state->scene->bodies[b];
  if (sonde_body_is_rigid(body) || body->model || body->offset_m > 0) return 1;
  SONDE_ASSERT(body->rest_volume_m3 > 0);
  return sonde_network_volume(body, state->stage_position + body->first_slot) /
         body->rest_volume_m3;
}

bool sonde_trouble_overlap(sonde_scene_state *state, uint32_t t, const sonde_overlap_result *found,
                           bool start) {
  static const double ROUNDING = 1e-9; // of the area times the thinner body's thickness
  const sonde_touch *touch = &state->scene->touches[t];
  double thickness = fmin(state->thickness_m[touch->a], state->thickness_m[touch->b]);
  double area = fmin(state->section_m2[touch->a], state->section_m2[touch->b]);
  double least = found->volume_m3;
  for (uint32_t r = 0; r < found->region_count; ++r)
    least = fmin(least, found->regions[r].volume_m3);
  if (least >= -ROUNDING * thickness * area) return true;
  if (!start) return false;
  double a = volume_ratio(state, touch->a), b = volume_ratio(state, touch->b);
  sonde_scene_note(state, SONDE_SCENE_INVERTED, a < b ? touch->a : touch->b, UINT32_MAX);
  return false;
}

// Mean of a field over what moves a body.
static sonde_vec3 mean_of(const sonde_scene_state *state, uint32_t b, const sonde_vec3 *field) {
  const sonde_body *body = &state->scene->bodies[b];
  uint32_t count = sonde_body_is_rigid(body) ? 1 : body->node_count;
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t s = body->first_slot; s < body->first_slot + count; ++s)
    sum = v_madd(sum, 1.0 / count, field[s]);
  return sum;
}

void sonde_trouble_direction(sonde_scene_state *state, uint32_t t) {
  static const double DEEP = 0.5, TURNED = -0.5; // thicknesses of the thinner body; cosine
  const sonde_touch *touch = &state->scene->touches[t];
  sonde_vec3 direction = state->found_hint[t], *entry = &state->now.entry[t];
  double thickness = fmin(state->thickness_m[touch->a], state->thickness_m[touch->b]);
  if (state->now.release[t] || !(v_norm2(direction) > 0)) return;
  bool deep = state->now.pair[t].depth_m > DEEP * thickness;
  if (deep && !(v_norm2(*entry) > 0)) {
    // Bodies that are deep when they meet first came against the direction of the motion.
    sonde_vec3 a = mean_of(state, touch->a, state->now.velocity);
    *entry = v_unit(v_sub(a, mean_of(state, touch->b, state->now.velocity)), direction);
    state->now.deep[t] = 1;
  }
  bool turned = state->now.deep[t] && v_dot(direction, *entry) < TURNED;
  if (turned) sonde_scene_note(state, SONDE_SCENE_PASSED, touch->b, touch->a);
  if (turned || !deep || !(v_norm2(*entry) > 0)) *entry = direction;
  state->now.deep[t] = deep;
}

void sonde_trouble_way(sonde_scene_state *state, uint32_t t, double h) {
  const sonde_touch *touch = &state->scene->touches[t];
  const sonde_body *a = &state->scene->bodies[touch->a], *b = &state->scene->bodies[touch->b];
  double margin = 1e-3 * fmin(state->thickness_m[touch->a], state->thickness_m[touch->b]);
  bool convex_a = sonde_body_is_convex(a), convex_b = sonde_body_is_convex(b), hit = false;
  if (state->now.pair[t].region_count || !(margin > 0) || !(convex_a || convex_b)) return;
  uint32_t one = convex_a ? touch->a : touch->b, other = convex_a ? touch->b : touch->a;
  const sonde_convex *convex = &state->scene->bodies[one].convex;
  sonde_motion way = sonde_cast_way(state, one, h);
  if (convex_a && convex_b) {
    sonde_motion way_b = sonde_cast_way(state, other, h);
    hit = sonde_convex_cast(convex, &way, &b->convex, &way_b, h, margin).hit;
  } else {
    // The other's faces are held where they end, and the convex body moves past them.
    sonde_vec3 move = v_sub(mean_of(state, other, state->now.position),
                            mean_of(state, other, state->undo.position));
    way.start.position = v_add(way.start.position, move);
    way.velocity_m_s = v_madd(way.velocity_m_s, -1 / h, move);
    sonde_vec3 *surface = state->surface + state->surface_first[other];
    sonde_surface_at(state, other, state->now.position, state->now.rotation, surface);
    sonde_face_tree_refit(state->tree[other], surface);
    hit = sonde_convex_cast_faces(convex, &way, state->tree[other], h, margin).hit;
  }
  // Bodies that met on the way and overlap at its end push each other in the next step.
  const uint32_t both[2] = {touch->a, touch->b};
  for (int s = 0; s < 2 && hit; ++s) {
    sonde_vec3 *surface = state->surface + state->surface_first[both[s]];
    sonde_surface_at(state, both[s], state->now.position, state->now.rotation, surface);
    sonde_face_tree_refit(state->tree[both[s]], surface);
  }
  if (!hit) return;
  bool large = sonde_body_is_rigid(a) && sonde_body_is_rigid(b);
  sonde_overlap *overlap = state->overlap[large && touch->law == SONDE_TOUCH_FOUNDATION];
  if (sonde_overlap_compute(overlap, state->tree[touch->a], state->tree[touch->b], vec3(0, 0, 0)))
    return;
  sonde_scene_note(state, SONDE_SCENE_PASSED, touch->b, touch->a);
}

enum { CROSSED_EVENT = 4 }; // the bit of SONDE_SCENE_INVERTED
void sonde_trouble_inspect(sonde_scene_state *state) {
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (sonde_body_is_rigid(body) || body->model || body->offset_m > 0 || !body->closed ||
        state->now.asleep[b])
      continue;
    double volume = sonde_network_volume(body, state->now.position + body->first_slot);
    if (!(volume > 0)) sonde_scene_note(state, SONDE_SCENE_INVERTED, b, UINT32_MAX);
  }
  // Whether a surface went through itself is looked at every tenth step, until it was found. Of a
  // sheet the middle is: where it is bent by less than its thickness its inner side crosses itself.
  enum { CROSSED_PERIOD = 10 };
  bool due = (state->now.head->tick + 1) % CROSSED_PERIOD == 0;
  for (uint32_t b = 0; due && b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    bool layers = body->model && !body->model->bulk;
    if (sonde_body_is_rigid(body) || layers || !state->tree[b] || state->now.asleep[b]) continue;
    if (state->now.head->event[CROSSED_EVENT].count) continue;
    uint32_t faces[2], count = body->surface.face_count;
    sonde_vec3 *surface = state->surface + state->surface_first[b];
    sonde_surface_at(state, b, state->now.position, state->now.rotation, surface);
    if (body->offset_m > 0) {
      for (uint32_t i = 0; i < body->surface.vertex_count; ++i)
        surface[i] = state->now.position[body->first_slot + body->surface_node[i]];
      count = body->middle_faces;
    }
    sonde_face_tree_refit(state->tree[b], surface);
    if (sonde_face_tree_crosses(state->tree[b], count, faces))
      sonde_scene_note(state, SONDE_SCENE_INVERTED, b, UINT32_MAX);
  }
}
