// Coulomb friction with bonds, on every column of a contact (docs/scene_theory.md).
//
// A bond's displacement z is how far the two surfaces have moved past each other since they met,
// less what slipped. Its force is -P mu_s z/d for |z| up to d mu/mu_s, P the column's push and d
// the displacement before slip, so that z is not upset when P changes. Vertices carry z; columns
// come and go. The vertices receive increments, never means, so that bonds at rest stay as they
// are, bit by bit.
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static const double RESTING = -1; // the load of a bond that is left as it is

static sonde_vec3 across(sonde_vec3 a, sonde_vec3 n) { return v_madd(a, -v_dot(a, n), n); }

void sonde_grip_begin(sonde_scene_state *state, sonde_grip *grip) {
  const sonde_touch *touch = &state->scene->touches[grip->touch];
  if (!grip->bonded) return;
  sonde_vec3 displacement = vec3(0, 0, 0);
  double slip = 0;
  for (int k = 0; k < 3; ++k) {
    SONDE_ASSERT(grip->bond[k] < state->now.head->bond_count);
    const sonde_bond *bond = &state->now.bond[grip->bond[k]];
    displacement = v_madd(displacement, grip->bond_weight[k], bond->displacement);
    slip += grip->bond_weight[k] * bond->slip_m_s;
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
  if (!grip->bonded || !(push > 0)) return;
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

static uint32_t bonds_per_touch(const sonde_scene *scene, uint32_t t) {
  const sonde_touch *touch = &scene->touches[t];
  return scene->bodies[touch->bond_side ? touch->b : touch->a].surface.vertex_count;
}

uint32_t sonde_bonds_of(sonde_scene_state *state, uint32_t t) {
  sonde_scene_motion *now = &state->now;
  SONDE_ASSERT(t < state->scene->touch_count);
  if (now->bond_first[t]) return now->bond_first[t] - 1;
  uint32_t count = bonds_per_touch(state->scene, t);
  if (now->head->bond_count + count > state->bond_capacity) {
    state->report.flags |= SONDE_SCENE_CONTACT_FULL;
    return UINT32_MAX;
  }
  now->bond_first[t] = now->head->bond_count + 1;
  now->head->bond_count += count;
  return now->bond_first[t] - 1;
}

// Touches without a load lose their bonds; those of the others move together, in the order of the
// touches.
static void pack_bonds(sonde_scene_state *state) {
  sonde_scene_motion *now = &state->now;
  uint32_t used = 0, before = now->head->bond_count;
  bool saved = false; // once a touch has moved
  for (uint32_t t = 0; t < state->scene->touch_count; ++t) {
    if (!now->bond_first[t]) continue;
    uint32_t first = now->bond_first[t] - 1, count = bonds_per_touch(state->scene, t);
    bool held = false;
    for (uint32_t i = first; i < first + count && !held; ++i) held = state->bond_load[i] != 0;
    now->bond_first[t] = held ? used + 1 : 0;
    if (!held) continue;
    if (first != used) {
      if (!saved) memcpy(state->bond_sum, now->bond, before * sizeof *now->bond);
      saved = true;
      memcpy(now->bond + used, state->bond_sum + first, count * sizeof *now->bond);
    }
    used += count;
  }
  SONDE_ASSERT(used <= before);
  memset(now->bond + used, 0, (before - used) * sizeof *now->bond);
  now->head->bond_count = used;
}

void sonde_bonds_advance(sonde_scene_state *state, double h) {
  SONDE_ASSERT(h > 0);
  uint32_t count = state->now.head->bond_count;
  memset(state->bond_load, 0, count * sizeof *state->bond_load);
  memset(state->bond_sum, 0, count * sizeof *state->bond_sum);
  for (uint32_t k = 0; k < state->grip_count; ++k) {
    const sonde_grip *grip = &state->grips[k];
    double push = state->pushes[grip->push].end_force * grip->share;
    const sonde_touch *touch = &state->scene->touches[grip->touch];
    if (!grip->bonded || !(push > 0)) continue;
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
      sonde_bond *sum = &state->bond_sum[i];
      sum->slip_m_s += load * slipped / h;
      sum->displacement = v_madd(sum->displacement, load, gained);
    }
  }
  // Bonds between bodies that rest stay.
  for (uint32_t t = 0; t < state->scene->touch_count; ++t) {
    uint32_t first = state->now.bond_first[t];
    if (!first || !sonde_touch_rests(state, t)) continue;
    for (uint32_t i = 0; i < bonds_per_touch(state->scene, t); ++i)
      state->bond_load[first - 1 + i] = RESTING;
  }
  for (uint32_t i = 0; i < count; ++i) {
    double load = state->bond_load[i];
    sonde_bond *bond = &state->now.bond[i], *sum = &state->bond_sum[i];
    if (load == RESTING) continue;
    if (load > 0)
      *bond = (sonde_bond){v_madd(bond->displacement, 1 / load, sum->displacement),
                           sum->slip_m_s / load};
    else
      *bond = (sonde_bond){{0, 0, 0}, 0};
  }
  pack_bonds(state);
}
