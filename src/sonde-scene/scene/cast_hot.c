// Conservative advancement inside a step: no pair moves past its first touch by more than a share
// of the thinner body's thickness at once, so that nothing passes through (docs/scene_theory.md).
//
// Thickness V/A is a third of a ball's radius, a sixth of a cube's edge and half of a sheet's
// thickness. A column that grows by less than that per step never reaches the far side of either
// body before its push has been felt. Boxes that move by less than their gap do not meet: their
// pairs may go that far and a thickness further.
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"
#include "contact/tree.h"

#include <string.h>

// The most that a pair may move as announced, and as made, in thicknesses.
static const double PLANNED = 0.5, MADE = 1;
static const double MARGIN = 1e-3; // of a thickness: closer bodies have met
enum { CUTS = 12 };                // no step is cut below h/2^CUTS

static sonde_bounds widen(sonde_vec3 displacement, double by) {
  sonde_vec3 more = vec3(by, by, by);
  return (sonde_bounds){v_sub(displacement, more), v_add(displacement, more)};
}

// A rotation moves a vertex by no more than reach times angle, and no more than twice the reach.
static sonde_bounds guess(const sonde_scene_state *state, uint32_t b, double h) {
  const sonde_body *body = &state->scene->bodies[b];
  const sonde_vec3 *v = state->now.velocity + body->first_slot;
  sonde_vec3 fall = v_scale(state->scene->gravity_m_s2, h * h);
  if (sonde_body_rests(state, b)) return (sonde_bounds){vec3(0, 0, 0), vec3(0, 0, 0)};
  if (body->motion == SONDE_BODY_DRIVEN) fall = vec3(0, 0, 0);
  if (sonde_body_is_rigid(body))
    return widen(v_madd(fall, h, v[0]), state->reach_m[b] * fmin(2, h * v_norm(v[1])));
  // Sleeping nodes of a tissue stand still.
  bool all = !body->model || state->part[b].row_count == body->node_count;
  uint32_t count = all ? body->node_count : state->part[b].row_count;
  sonde_vec3 first = all ? v_scale(v[0], h) : vec3(0, 0, 0);
  sonde_bounds displacements = {first, first};
  for (uint32_t r = 0; r < count; ++r) {
    sonde_vec3 displacement = v_scale(v[all ? r : state->part[b].rows[r]], h);
    displacements = bounds_add(displacements, displacement);
  }
  return (sonde_bounds){v_low(displacements.low, v_add(displacements.low, fall)),
                        v_high(displacements.high, v_add(displacements.high, fall))};
}

static sonde_bounds made(const sonde_scene_state *state, uint32_t b) {
  const sonde_body *body = &state->scene->bodies[b];
  const sonde_vec3 *to = state->now.position + body->first_slot;
  const sonde_vec3 *from = state->undo.position + body->first_slot;
  sonde_vec3 displacement = v_sub(to[0], from[0]);
  if (sonde_body_rests(state, b)) return (sonde_bounds){vec3(0, 0, 0), vec3(0, 0, 0)};
  if (sonde_body_is_rigid(body)) {
    sonde_quat change = q_mul(state->now.rotation[b], q_conj(state->undo.rotation[b]));
    return widen(displacement, 2 * state->reach_m[b] * v_norm(vec3(change.x, change.y, change.z)));
  }
  bool all = !body->model || state->part[b].row_count == body->node_count;
  uint32_t count = all ? body->node_count : state->part[b].row_count;
  if (!all) displacement = vec3(0, 0, 0);
  sonde_bounds displacements = {displacement, displacement};
  for (uint32_t r = 0; r < count; ++r) {
    uint32_t i = all ? r : state->part[b].rows[r];
    displacement = v_sub(to[i], from[i]);
    displacements = bounds_add(displacements, displacement);
  }
  return displacements;
}

// Made at the first question after cast_known was cleared.
static sonde_bounds bounds_of(sonde_scene_state *state, const sonde_scene_motion *at, uint32_t b) {
  const sonde_mesh *mesh = &state->scene->bodies[b].surface;
  if (state->cast_known[b]) return state->cast_box[b];
  sonde_vec3 *surface = state->surface + state->surface_first[b];
  SONDE_ASSERT(mesh->vertex_count > 0);
  if (state->scene->bodies[b].motion != SONDE_BODY_FIXED)
    sonde_touch_surface(state, b, at->position, at->rotation);
  sonde_bounds box = {surface[0], surface[0]};
  for (uint32_t i = 1; i < mesh->vertex_count; ++i) box = bounds_add(box, surface[i]);
  state->cast_known[b] = true;
  return state->cast_box[b] = box;
}

sonde_motion sonde_cast_way(const sonde_scene_state *state, uint32_t b, double h) {
  uint32_t s = state->scene->bodies[b].first_slot;
  sonde_quat from = state->undo.rotation[b];
  sonde_vec3 moved = v_sub(state->now.position[s], state->undo.position[s]);
  return (sonde_motion){{state->undo.position[s], from},
                        v_scale(moved, 1 / h),
                        sonde_spin_between(from, state->now.rotation[b], h)};
}

// Share of a step after which the boxes of a pair meet.
static double boxes_meet(sonde_scene_state *state, const sonde_scene_motion *from, uint32_t t,
                         sonde_vec3 p, sonde_vec3 q) {
  const sonde_touch *touch = &state->scene->touches[t];
  sonde_bounds box_a = bounds_of(state, from, touch->a), box_b = bounds_of(state, from, touch->b);
  // The displacements close the gap along each axis, from either side, by p and q.
  sonde_vec3 ab = v_sub(box_b.low, box_a.high), ba = v_sub(box_a.low, box_b.high);
  const double gap[6] = {ab.x, ab.y, ab.z, ba.x, ba.y, ba.z};
  const double closing[6] = {p.x, p.y, p.z, q.x, q.y, q.z};
  double apart = 0;
  for (int k = 0; k < 6; ++k)
    if (gap[k] > 0) apart = fmax(apart, closing[k] > gap[k] ? gap[k] / closing[k] : 1);
  return apart;
}

// Share of the displacements that a pair may make: to where the bodies meet and a thickness
// further. Where convex bodies meet is known; of others it is where their boxes do.
static double share_of(sonde_scene_state *state, uint32_t t, const sonde_scene_motion *from,
                       double h) {
  const sonde_touch *touch = &state->scene->touches[t];
  const sonde_body *a = &state->scene->bodies[touch->a], *b = &state->scene->bodies[touch->b];
  bool planned = from == &state->now;
  // The longest displacement is that of a point of a as a point of b sees it.
  const sonde_bounds *displacement_a = &state->displacement[touch->a],
                     *displacement_b = &state->displacement[touch->b];
  sonde_vec3 p = v_sub(displacement_a->high, displacement_b->low),
             q = v_sub(displacement_b->high, displacement_a->low);
  double displacement = v_norm(vec3(fmax(p.x, q.x), fmax(p.y, q.y), fmax(p.z, q.z)));
  double thickness = fmin(state->thickness_m[touch->a], state->thickness_m[touch->b]);
  double most = (planned ? PLANNED : MADE) * thickness;
  if (!(displacement > most)) return 1;
  double apart = boxes_meet(state, from, t, p, q);
  if (apart < 1 && sonde_body_is_convex(a) && sonde_body_is_convex(b)) {
    sonde_motion way[2];
    const uint32_t both[2] = {touch->a, touch->b};
    for (int s = 0; s < 2; ++s) {
      way[s] = sonde_cast_way(state, both[s], h);
      if (!planned) continue;
      // As the velocities at the start of the step announce it.
      const sonde_body *body = &state->scene->bodies[both[s]];
      const uint32_t slot = body->first_slot;
      const bool falls = body->motion == SONDE_BODY_FREE;
      way[s] = (sonde_motion){
          {state->now.position[slot], state->now.rotation[both[s]]},
          v_madd(state->now.velocity[slot], falls ? h : 0, state->scene->gravity_m_s2),
          state->now.velocity[slot + 1]};
    }
    sonde_cast_result met =
        sonde_convex_cast(&a->convex, &way[0], &b->convex, &way[1], h, MARGIN * thickness);
    apart = met.hit ? met.time_s / h : 1;
  }
  return apart + most / displacement;
}

static double safe_share(sonde_scene_state *state, const sonde_scene_motion *from, double h) {
  double share = 1;
  SONDE_ASSERT(h > 0);
  memset(state->cast_known, 0, state->scene->body_count * sizeof *state->cast_known);
  for (uint32_t t = 0; t < state->scene->touch_count; ++t)
    share = fmin(share, share_of(state, t, from, h));
  return share;
}

void sonde_step_guarded(sonde_scene_state *state, double h) {
  SONDE_ASSERT(h > 0);
  if (!state->scene->touch_count) {
    sonde_step_once(state, h);
    return;
  }
  uint32_t bodies = state->scene->body_count;
  bool cast = state->scene->step.cast;
  double start = state->now.head->time_s, done = 0, least = cast ? ldexp(h, -CUTS) : h;
  while (done < h) {
    double left = h - done, part = left;
    if (cast) {
      sonde_rigid_begin(state, left); // velocities of driven bodies
      for (uint32_t b = 0; b < bodies; ++b) state->displacement[b] = guess(state, b, left);
      // The parts are equal: a short one after a deep one would throw the bodies apart.
      double parts = ceil(1 / fmax(safe_share(state, &state->now, left), least / left));
      part = parts > 1 ? left / parts : left;
    }
    for (;;) {
      sonde_step_once(state, part);
      for (uint32_t b = 0; b < bodies; ++b) state->displacement[b] = made(state, b);
      bool far = safe_share(state, &state->undo, part) < 1;
      // A step that went further than it should: bodies may have passed through others.
      for (uint32_t t = 0; t < state->scene->touch_count && far && !(part > least); ++t)
        if (share_of(state, t, &state->undo, part) < 1) sonde_trouble_way(state, t, part);
      if (!(far && part > least)) break;
      sonde_scene_motion_copy(&state->now, &state->undo);
      state->listed = false;
      part *= 0.5;
    }
    if (part < h) state->report.cuts++;
    done = left - part > least ? done + part : h;
    state->now.head->time_s = start + done;
  }
}
