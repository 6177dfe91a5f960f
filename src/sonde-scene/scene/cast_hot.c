// Conservative advancement inside a step: no pair moves past its first touch by more than a share
// of the thinner body's thickness at once, so that nothing passes through (docs/scene_theory.md).
//
// Thickness V/A is a third of a ball's radius, a sixth of a cube's edge and half of a sheet's
// thickness. A column that grows by less than that per step never reaches the far side of either
// body before its push has been felt. Boxes that move by less than their gap do not meet: their
// pairs may go that far and a thickness further.
#include "scene/state.h"

#include "base/base.h"
#include "base/maths.h"
#include "contact/tree.h"

#include <string.h>

// The most that a pair may move as announced, and as made, in thicknesses.
static const double PLANNED = 0.5, MADE = 1;
enum { CUTS = 12 }; // no step is cut below h/2^CUTS

double sonde_scene_thickness(const sonde_mesh *surface) {
  double volume = 0, area = 0;
  SONDE_ASSERT(surface->vertex_count > 0);
  sonde_vec3 origin = surface->vertices[0];
  for (uint32_t f = 0; f < surface->face_count; ++f) {
    sonde_vec3 p[3];
    for (int k = 0; k < 3; ++k) p[k] = v_sub(surface->vertices[surface->faces[f][k]], origin);
    volume += v_dot(p[0], v_cross(p[1], p[2])) / 6;
    area += 0.5 * v_norm(v_cross(v_sub(p[1], p[0]), v_sub(p[2], p[0])));
  }
  return area > 0 && volume > 0 ? volume / area : 0;
}

static sonde_bounds widen(sonde_vec3 displacement, double by) {
  sonde_vec3 more = vec3(by, by, by);
  return (sonde_bounds){v_sub(displacement, more), v_add(displacement, more)};
}

// A rotation moves a vertex by no more than reach times angle, and no more than twice the reach.
static sonde_bounds guess(const sonde_scene_state *state, uint32_t b, double h) {
  const sonde_body *body = &state->scene->bodies[b];
  const sonde_vec3 *v = state->now.velocity + body->first_slot;
  sonde_vec3 fall = v_scale(state->scene->gravity_m_s2, h * h);
  if (body->motion == SONDE_BODY_FIXED) return (sonde_bounds){vec3(0, 0, 0), vec3(0, 0, 0)};
  if (body->motion == SONDE_BODY_DRIVEN) fall = vec3(0, 0, 0);
  if (sonde_body_is_rigid(body))
    return widen(v_madd(fall, h, v[0]), state->reach_m[b] * fmin(2, h * v_norm(v[1])));
  sonde_bounds displacements = {v_scale(v[0], h), v_scale(v[0], h)};
  for (uint32_t i = 1; i < body->node_count; ++i) {
    sonde_vec3 displacement = v_scale(v[i], h);
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
  if (sonde_body_is_rigid(body)) {
    sonde_quat change = q_mul(state->now.rotation[b], q_conj(state->undo.rotation[b]));
    return widen(displacement, 2 * state->reach_m[b] * v_norm(vec3(change.x, change.y, change.z)));
  }
  sonde_bounds displacements = {displacement, displacement};
  for (uint32_t i = 1; i < body->node_count; ++i) {
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
    sonde_surface_at(state, b, at->position, at->rotation, surface);
  sonde_bounds box = {surface[0], surface[0]};
  for (uint32_t i = 1; i < mesh->vertex_count; ++i) box = bounds_add(box, surface[i]);
  state->cast_known[b] = true;
  return state->cast_box[b] = box;
}

// Share of the displacements that all pairs may make: to where their boxes meet and a thickness
// further.
static double safe_share(sonde_scene_state *state, const sonde_scene_motion *from, double allowed) {
  const sonde_scene *scene = state->scene;
  double share = 1;
  memset(state->cast_known, 0, scene->body_count * sizeof *state->cast_known);
  for (uint32_t t = 0; t < scene->touch_count; ++t) {
    uint32_t a = scene->touches[t].a, b = scene->touches[t].b;
    // The longest displacement is that of a point of a as a point of b sees it.
    const sonde_bounds *displacement_a = &state->displacement[a],
                       *displacement_b = &state->displacement[b];
    sonde_vec3 p = v_sub(displacement_a->high, displacement_b->low),
               q = v_sub(displacement_b->high, displacement_a->low);
    double displacement = v_norm(vec3(fmax(p.x, q.x), fmax(p.y, q.y), fmax(p.z, q.z)));
    double most = allowed * fmin(state->thickness_m[a], state->thickness_m[b]);
    if (!(displacement > share * most)) continue;
    sonde_bounds box_a = bounds_of(state, from, a), box_b = bounds_of(state, from, b);
    // The displacements close the gap along each axis, from either side, by p and q.
    sonde_vec3 ab = v_sub(box_b.low, box_a.high), ba = v_sub(box_a.low, box_b.high);
    const double gap[6] = {ab.x, ab.y, ab.z, ba.x, ba.y, ba.z};
    const double closing[6] = {p.x, p.y, p.z, q.x, q.y, q.z};
    double apart = 0;
    for (int k = 0; k < 6; ++k)
      if (gap[k] > 0) apart = fmax(apart, closing[k] > gap[k] ? gap[k] / closing[k] : 1);
    share = fmin(share, apart + most / displacement);
  }
  return share;
}

void sonde_step_guarded(sonde_scene_state *state, double h) {
  SONDE_ASSERT(h > 0);
  if (!state->scene->step.cast || !state->scene->touch_count) {
    sonde_step_once(state, h);
    return;
  }
  uint32_t bodies = state->scene->body_count;
  double start = state->now.head->time_s, done = 0, least = ldexp(h, -CUTS);
  while (done < h) {
    double left = h - done;
    sonde_rigid_begin(state, left); // velocities of driven bodies
    for (uint32_t b = 0; b < bodies; ++b) state->displacement[b] = guess(state, b, left);
    // The parts are equal: a short one after a deep one would throw the bodies apart.
    double parts = ceil(1 / fmax(safe_share(state, &state->now, PLANNED), least / left));
    double part = parts > 1 ? left / parts : left;
    for (;;) {
      sonde_step_once(state, part);
      for (uint32_t b = 0; b < bodies; ++b) state->displacement[b] = made(state, b);
      if (!(safe_share(state, &state->undo, MADE) < 1 && part > least)) break;
      sonde_scene_motion_copy(&state->now, &state->undo);
      part *= 0.5;
    }
    if (part < h) state->report.cuts++;
    done = left - part > least ? done + part : h;
    state->now.head->time_s = start + done;
  }
}
