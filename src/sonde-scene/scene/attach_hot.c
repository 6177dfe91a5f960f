// Attachments: springs without length between points of two bodies (docs/scene_theory.md).
//
// A pin with stretch d = x_a - x_b pulls with k d + c dd/dt, along three axes of the world: three
// pushes that may pull. One pin of rigid bodies is a ball joint, two are a hinge, three a weld.
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"

// A point of an end at given positions, and its arm from a rigid body's centre.
static sonde_vec3 point_of(const sonde_scene_state *state, const sonde_pin_end *end,
                           const sonde_vec3 *position, const sonde_quat *rotation,
                           sonde_vec3 *arm) {
  *arm = vec3(0, 0, 0);
  if (end->body == UINT32_MAX) return end->local;
  const sonde_body *body = &state->scene->bodies[end->body];
  if (end->node != UINT32_MAX) return position[body->first_slot + end->node];
  *arm = q_rotate(rotation[end->body], end->local);
  return v_add(position[body->first_slot], *arm);
}

static void add_end(sonde_scene_state *state, const sonde_pin_end *end, sonde_vec3 arm,
                    sonde_vec3 along) {
  if (end->body == UINT32_MAX) return;
  const sonde_body *body = &state->scene->bodies[end->body];
  SONDE_ASSERT(state->row_count + 2 <= state->row_capacity);
  bool rigid = end->node == UINT32_MAX;
  state->rows[state->row_count] = body->first_slot + (rigid ? 0 : end->node);
  state->g[state->row_count++] = along;
  if (!rigid) return;
  state->rows[state->row_count] = body->first_slot + 1;
  state->g[state->row_count++] = v_cross(arm, along);
}

static bool end_rests(const sonde_scene_state *state, const sonde_pin_end *end) {
  return end->body == UINT32_MAX || sonde_body_rests(state, end->body);
}

// A crease's push grows with the angle between its faces.
void sonde_creases_push(sonde_scene_state *state) {
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    for (uint32_t k = 0; k < body->crease_count && !state->now.asleep[b]; ++k) {
      const sonde_crease *crease = &body->crease[k];
      sonde_vec3 gradient[4];
      double angle = sonde_crease_angle(crease, state->stage_position + body->first_slot, gradient);
      sonde_push *push = sonde_push_new(state, UINT32_MAX);
      if (!push) return;
      push->value = angle - crease->rest_rad;
      push->stiffness = crease->stiffness_n_m;
      push->damper = crease->damper_n_m_s;
      for (int i = 0; i < 4; ++i) {
        SONDE_ASSERT(state->row_count < state->row_capacity);
        state->rows[state->row_count] = body->first_slot + crease->node[i];
        state->g[state->row_count++] = gradient[i];
      }
      push->row_count = 4;
    }
  }
}

void sonde_pins_push(sonde_scene_state *state) {
  for (uint32_t k = 0; k < state->scene->pin_count; ++k) {
    const sonde_pin *pin = &state->scene->pins[k];
    if (end_rests(state, &pin->end[0]) && end_rests(state, &pin->end[1])) continue;
    sonde_vec3 arm[2], at[2];
    for (int s = 0; s < 2; ++s)
      at[s] = point_of(state, &pin->end[s], state->stage_position, state->stage_rotation, &arm[s]);
    sonde_vec3 stretch = v_sub(at[0], at[1]);
    for (int axis = 0; axis < 3; ++axis) {
      sonde_vec3 along = vec3(axis == 0, axis == 1, axis == 2);
      sonde_push *push = sonde_push_new(state, UINT32_MAX);
      if (!push) return;
      push->value = v_dot(stretch, along);
      push->stiffness = pin->stiffness_n_m;
      push->damper = pin->damping_n_s_m;
      add_end(state, &pin->end[0], arm[0], along);
      add_end(state, &pin->end[1], arm[1], v_neg(along));
      push->row_count = state->row_count - push->first_row;
    }
  }
}

sonde_attachment_measure sonde_scene_attachment(const sonde_scene_state *state,
                                                uint32_t attachment) {
  SONDE_ASSERT(attachment < state->scene->attachment_count);
  sonde_attachment_measure m = {.a = UINT32_MAX, .b = UINT32_MAX};
  for (uint32_t k = 0; k < state->scene->pin_count; ++k) {
    const sonde_pin *pin = &state->scene->pins[k];
    if (pin->attachment != attachment) continue;
    sonde_vec3 at[2], v[2], arm;
    for (int s = 0; s < 2; ++s) {
      const sonde_pin_end *end = &pin->end[s];
      at[s] = point_of(state, end, state->now.position, state->now.rotation, &arm);
      v[s] = vec3(0, 0, 0);
      if (end->body == UINT32_MAX) continue;
      const sonde_vec3 *slot = state->now.velocity + state->scene->bodies[end->body].first_slot;
      v[s] = end->node == UINT32_MAX ? v_add(slot[0], v_cross(slot[1], arm)) : slot[end->node];
    }
    sonde_vec3 stretch = v_sub(at[0], at[1]);
    m.a = pin->end[0].body;
    m.b = pin->end[1].body;
    m.force_n = v_madd(m.force_n, -pin->stiffness_n_m, stretch);
    m.force_n = v_madd(m.force_n, -pin->damping_n_s_m, v_sub(v[0], v[1]));
    m.stretch_m = fmax(m.stretch_m, v_norm(stretch));
    m.energy_j += 0.5 * pin->stiffness_n_m * v_norm2(stretch);
  }
  return m;
}

uint32_t sonde_scene_attachment_count(const sonde_scene *scene) { return scene->attachment_count; }
