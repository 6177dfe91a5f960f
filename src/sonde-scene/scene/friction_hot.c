// Coulomb friction with bonds, on every column of a contact (docs/scene_theory.md).
//
// A bond's displacement z is how far the two surfaces have moved past each other since they met,
// less what slipped. Its force is -P mu_s z/d for |z| up to d mu/mu_s, P the column's push and d
// the displacement before slip, so that z is not upset when P changes. Vertices carry z; columns
// come and go. The vertices receive increments, never means, so that bonds at rest stay as they
// are, bit by bit.
#include "scene/state.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static sonde_vec3 across(sonde_vec3 a, sonde_vec3 n) { return v_madd(a, -v_dot(a, n), n); }

void sonde_grip_begin(sonde_scene_state *state, sonde_grip *grip) {
  const sonde_touch *touch = &state->scene->touches[grip->touch];
  if (!(touch->mu_static > 0)) return;
  sonde_vec3 displacement = vec3(0, 0, 0);
  double slip = 0;
  for (int k = 0; k < 3; ++k) {
    SONDE_ASSERT(grip->bond[k] < state->bond_count);
    displacement = v_madd(displacement, grip->bond_weight[k], state->now.bond[grip->bond[k]]);
    slip += grip->bond_weight[k] * state->now.slip[grip->bond[k]];
  }
  grip->displacement = across(displacement, grip->normal);
  // The coefficient falls from static to kinetic along Stribeck's curve.
  SONDE_ASSERT(touch->stribeck_m_s > 0);
  double x = slip / touch->stribeck_m_s;
  grip->mu = touch->mu_kinetic + (touch->mu_static - touch->mu_kinetic) * exp(-x * x);
}

void sonde_grip_evaluate(sonde_scene_state *state, sonde_grip *grip, double moved_s) {
  const sonde_touch *touch = &state->scene->touches[grip->touch];
  grip->term_count = 0;
  grip->force = vec3(0, 0, 0);
  double push = state->pushes[grip->push].force * grip->share;
  if (!(touch->mu_static > 0) || !(push > 0)) return;
  double stiffness = push * touch->mu_static / touch->bond_m;
  double damper = stiffness * touch->bond_damping_s;
  sonde_vec3 slip = across(sonde_grip_slip(state, grip, state->stage_velocity), grip->normal);
  sonde_vec3 displacement = v_madd(grip->displacement, moved_s, slip);
  sonde_vec3 resisted = v_madd(v_scale(displacement, stiffness), damper, slip);
  double most = push * grip->mu;
  if (v_norm2(resisted) <= most * most) {
    // Two directions across the normal resist as long as the bond holds.
    sonde_vec3 n = grip->normal;
    sonde_vec3 axis = fabs(n.x) < 0.6 ? vec3(1, 0, 0) : vec3(0, 1, 0);
    grip->tangent[0] = v_unit(across(axis, n), axis);
    grip->tangent[1] = v_cross(n, grip->tangent[0]);
    grip->term_count = 2;
    grip->stiffness = stiffness;
    grip->damper = damper;
    grip->force = v_neg(resisted);
  } else {
    // The force keeps its size; across the slip its direction turns with the displacement.
    SONDE_ASSERT(most >= 0);
    double size = v_norm(resisted), share = most / size;
    sonde_vec3 along = v_scale(resisted, 1 / size);
    grip->tangent[0] = v_cross(grip->normal, along);
    grip->term_count = 1;
    grip->stiffness = stiffness * share;
    grip->damper = damper * share;
    grip->force = v_scale(resisted, -share);
  }
}

void sonde_grip_predict(sonde_scene_state *state, sonde_grip *grip) {
  grip->end_force = grip->force;
  if (!grip->term_count) return;
  sonde_vec3 displacement = sonde_grip_slip(state, grip, state->move);
  sonde_vec3 rate = sonde_grip_slip(state, grip, state->gain);
  for (uint32_t k = 0; k < grip->term_count; ++k) {
    sonde_vec3 t = grip->tangent[k];
    double more = grip->stiffness * v_dot(displacement, t) + grip->damper * v_dot(rate, t);
    grip->end_force = v_madd(grip->end_force, -more, t);
  }
}

void sonde_bonds_advance(sonde_scene_state *state, double h) {
  SONDE_ASSERT(h > 0);
  memset(state->bond_load, 0, state->bond_count * sizeof *state->bond_load);
  memset(state->slip_sum, 0, state->bond_count * sizeof *state->slip_sum);
  memset(state->bond_sum, 0, state->bond_count * sizeof *state->bond_sum);
  for (uint32_t k = 0; k < state->grip_count; ++k) {
    const sonde_grip *grip = &state->grips[k];
    double push = state->pushes[grip->push].end_force * grip->share;
    const sonde_touch *touch = &state->scene->touches[grip->touch];
    if (!(touch->mu_static > 0 && push > 0)) continue;
    // The displacement at the end of the step is returned to where the bond holds; the rest has
    // slipped.
    sonde_vec3 slip = across(sonde_grip_slip(state, grip, state->mean_velocity), grip->normal);
    sonde_vec3 displacement = v_madd(grip->displacement, h, slip);
    double limit = touch->bond_m * grip->mu / touch->mu_static, length = v_norm(displacement);
    double slipped = length > limit ? length - limit : 0;
    if (length > limit) displacement = v_scale(displacement, limit / length);
    sonde_vec3 gained = v_sub(displacement, grip->displacement);
    for (int c = 0; c < 3; ++c) {
      double load = push * fmax(grip->bond_weight[c], 0);
      uint32_t i = grip->bond[c];
      state->bond_load[i] += load;
      state->slip_sum[i] += load * slipped / h;
      state->bond_sum[i] = v_madd(state->bond_sum[i], load, gained);
    }
  }
  for (uint32_t i = 0; i < state->bond_count; ++i) {
    double load = state->bond_load[i];
    bool held = load > 0;
    state->now.slip[i] = held ? state->slip_sum[i] / load : 0;
    state->now.bond[i] =
        held ? v_madd(state->now.bond[i], 1 / load, state->bond_sum[i]) : vec3(0, 0, 0);
  }
}
