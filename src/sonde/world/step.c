// One implicit step (docs/world.md) and the sleeping of nodes at rest.
// assemble:  tissue, contact and right-hand side at a state.
// solve:     warm-started PCG over the awake rows.
// update:    positions and velocities, with the bound that keeps s below x_m.
// rest:      nodes that stopped moving fall asleep, movers wake their neighbours.
#include "world/state.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"
#include "tissue/two_layer.h"

#include <string.h>

// Speed below which a node counts as still: it would take 10 ms to creep the sleep displacement.
static double still_speed(const sonde_state *state) {
  return state->def.sleep_displacement_m / 10e-3;
}

static sonde_motion probe_motion(const sonde_state *state, sonde_pose pose) {
  sonde_motion motion = {.origin = pose.position};
  if (!state->has_probe_pose) return motion;
  double rate = 1.0 / state->def.dt_s;
  motion.velocity = v_scale(v_sub(pose.position, state->probe_pose.position), rate);
  sonde_quat turn = q_mul(pose.rotation, q_conj(state->probe_pose.rotation));
  double sign = turn.w < 0 ? -2 * rate : 2 * rate; // small angles: vector part is half the angle
  motion.spin = v_scale(vec3(turn.x, turn.y, turn.z), sign);
  return motion;
}

// Forces and matrix at (position, velocity), which the nodes have reached after moving for moved_s
// at that velocity; the reaction is the sum of the tissue's own forces.
static void assemble(sonde_state *state, const sonde_probe *probe, const sonde_motion *motion,
                     double moved_s) {
  double h = state->def.dt_s, lambda = state->def.implicitness;
  sonde_tissue_scales scales = {1, lambda * h, lambda * lambda * h * h};
  sonde_tissue_part part = {state->rows,  state->row_count,  state->rim,   state->rim_count,
                            state->edges, state->edge_count, state->faces, state->face_count};
  sonde_tissue_linearise(state->tissue, &part, state->position, state->velocity, &scales,
                         state->force, state->product, state->matrix, state->scratch_nodes);
  sonde_contact_scales contact = {scales.damping, scales.stiffness};
  if (probe) sonde_contact_apply(state, motion, &contact);
  sonde_vec3 reaction = vec3(0, 0, 0);
  for (uint32_t r = 0; r < state->row_count; ++r)
    reaction = v_add(reaction, state->force[state->rows[r]]);
  state->contact.reaction_n = reaction;
  if (probe) sonde_friction_apply(state, motion, &contact, moved_s);
}

static void solve(sonde_state *state) {
  sonde_active_set active = {state->rows, state->row_count, state->pairs, state->pair_count};
  sonde_block_invert_diagonal(state->matrix, &active);
  uint32_t before = state->solver.iterations;
  state->solver = sonde_pcg_solve(state->matrix, &active, state->term, state->term_count,
                                  state->right, state->increment, &state->scratch, &state->def.pcg);
  state->solver.iterations += before;
  if (!state->solver.converged) state->flags |= SONDE_FLAG_NOT_CONVERGED;
}

// b = h (F0 - lambda h K v0)
static void first_right_side(sonde_state *state) {
  double h = state->def.dt_s, scale = -h * h * state->def.implicitness;
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    sonde_vec3 f = v_add(state->force[i], state->contact_force[i]);
    state->right[i] = v_madd(v_scale(f, h), scale, state->product[i]);
  }
}

// Keeps the indentation below x_m: at most 95 % of the remaining gap per step.
sonde_vec3 sonde_bounded_move(const sonde_model *model, uint32_t i, sonde_vec3 from,
                              sonde_vec3 move) {
  sonde_vec3 n = model->normal[i];
  double advance = -v_dot(n, move);
  if (!(advance > 0)) return move;
  double s = v_dot(n, v_sub(model->surface.vertices[i], from));
  double gap = 0.95 * (model->xm_m[i] - s);
  if (advance <= gap) return move;
  if (gap < 0) gap = 0;
  return v_madd(move, advance - gap, n);
}

// x += h (v0 + lambda dv), v += dv; false when something is not finite.
static bool update(sonde_state *state) {
  double h = state->def.dt_s, lambda = state->def.implicitness;
  double sum = 0;
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    sonde_vec3 dv = state->increment[i], v0 = state->velocity[i];
    sonde_vec3 move = v_scale(v_madd(v0, lambda, dv), h);
    sonde_vec3 bounded = sonde_bounded_move(state->model, i, state->position[i], move);
    state->velocity[i] = v_madd(v_add(v0, dv), 1 / h, v_sub(bounded, move));
    state->position[i] = v_add(state->position[i], bounded);
    sum += v_norm2(state->position[i]) + v_norm2(state->velocity[i]);
  }
  return isfinite(sum);
}

static bool wake_neighbours(sonde_state *state, uint32_t i) {
  const sonde_topology *topology = &state->model->topology;
  bool woke = false;
  for (uint32_t k = topology->start[i]; k < topology->start[i + 1]; ++k) {
    uint32_t j = topology->neighbour[k];
    if (state->awake[j]) continue;
    state->awake[j] = 1;
    state->calm[j] = 0;
    woke = true;
  }
  return woke;
}

// A node sleeps after SONDE_CALM_TICKS still ticks; a mover wakes its neighbours.
static void rest(sonde_state *state) {
  double still = still_speed(state);
  if (!(still > 0)) return;
  bool changed = false;
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    double speed2 = v_norm2(state->velocity[i]);
    if (speed2 > still * still) {
      state->calm[i] = 0;
      if (speed2 > 4 * still * still) changed |= wake_neighbours(state, i);
    } else if (state->share_m3[i] == 0 && ++state->calm[i] >= SONDE_CALM_TICKS) {
      state->awake[i] = 0;
      state->velocity[i] = state->increment[i] = vec3(0, 0, 0);
      state->probed[i] = state->position[i];
      changed = true;
    }
  }
  if (changed) sonde_state_list_awake(state);
}

// Contact where the nodes go when their velocities change by `share` of the increment at hand, and
// the lists of awake rows with the nodes that it wakes.
static void touch(sonde_state *state, const sonde_probe *probe, sonde_pose pose, double share) {
  double moved_s = state->def.implicitness * state->def.dt_s;
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    sonde_vec3 v = v_madd(state->velocity[i], share, state->increment[i]);
    state->probed[i] = v_madd(state->position[i], moved_s, v);
  }
  sonde_contact_detect(state, probe, pose);
  if (state->lists_stale) sonde_state_list_awake(state);
}

static void add_times(sonde_state *state, double contact_s, double assembly_s, double solve_s) {
  state->times.contact_s += contact_s;
  state->times.assembly_s += assembly_s;
  state->times.solve_s += solve_s;
}

// One Newton iteration from the increment dv at hand: the residual h F - M dv at the point
// x0 + lambda dx, v0 + lambda dv that the scheme evaluates forces at. trial[] keeps the start of
// the step, then dv until the solution is added to it.
static void newton(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                   const sonde_motion *motion) {
  double h = state->def.dt_s, lambda = state->def.implicitness, start = sonde_clock_now();
  touch(state, probe, pose, lambda);
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    state->trial[i] = state->position[i];
    state->position[i] = state->probed[i];
    state->velocity[i] = v_madd(state->velocity[i], lambda, state->increment[i]);
  }
  double detected = sonde_clock_now();
  assemble(state, probe, motion, lambda * h);
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    sonde_vec3 dv = state->increment[i];
    sonde_vec3 f = v_add(state->force[i], state->contact_force[i]);
    state->right[i] = v_madd(v_scale(f, h), -state->model->mass_kg[i], dv);
    state->position[i] = state->trial[i];
    state->trial[i] = dv;
    state->increment[i] = vec3(0, 0, 0);
  }
  double assembled = sonde_clock_now();
  solve(state);
  sonde_contact_advance(state, motion, lambda, h);
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    state->velocity[i] = v_madd(state->velocity[i], -lambda, state->trial[i]);
    state->increment[i] = v_add(state->increment[i], state->trial[i]);
  }
  add_times(state, detected - start, assembled - detected, sonde_clock_now() - assembled);
}

// Eq. (4) as the paper has it: one linearisation at the start of the step.
static void linear_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                        const sonde_motion *motion) {
  double start = sonde_clock_now();
  touch(state, probe, pose, 0);
  double detected = sonde_clock_now();
  assemble(state, probe, motion, 0);
  first_right_side(state);
  double assembled = sonde_clock_now();
  solve(state);
  sonde_contact_advance(state, motion, state->def.implicitness, state->def.dt_s);
  add_times(state, detected - start, assembled - detected, sonde_clock_now() - assembled);
}

static void recover(sonde_state *state) {
  sonde_state_relax(state);
  state->flags = SONDE_FLAG_NON_FINITE;
}

static void finish(sonde_state *state, const sonde_probe *probe, sonde_pose pose, bool finite) {
  if (!finite)
    recover(state);
  else if (!state->lanes)
    rest(state);
  if (finite && probe && sonde_contact_carries(state, probe, pose))
    state->flags |= SONDE_FLAG_INSIDE_OUT;
  state->tick++;
  state->flag_count += state->flags != 0;
  state->probe_pose = pose;
  state->has_probe_pose = probe != NULL;
}

static void double_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                        const sonde_motion *motion) {
  state->solver = (sonde_pcg_result){0};
  // What the probe touched may have bounced: its change of velocity says nothing about the next.
  for (uint32_t k = 0; k < state->touched_count; ++k)
    state->increment[state->touched[k]] = vec3(0, 0, 0);
  if (state->def.newton_iterations == 0) linear_step(state, probe, pose, motion);
  for (uint32_t k = 0; k < state->def.newton_iterations; ++k) newton(state, probe, pose, motion);
  double solved = sonde_clock_now();
  if (probe) sonde_friction_advance(state, motion);
  sonde_contact_wrench(state, pose.position);
  bool finite = update(state) && v_finite(state->contact.force_n);
  finish(state, probe, pose, finite);
  state->times.update_s = sonde_clock_now() - solved;
}

void sonde_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose) {
  state->flags = 0;
  state->times = (sonde_stage_times){0};
  if (!v_finite(pose.position)) probe = NULL;
  sonde_motion motion = probe_motion(state, pose);
  if (!state->lanes)
    double_step(state, probe, pose, &motion);
  else
    finish(state, probe, pose, sonde_lane_step(state, probe, pose, &motion));
}
