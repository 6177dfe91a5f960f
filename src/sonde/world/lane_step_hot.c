// One step of the fast engine (docs/world.md): Newton's method on
//   M (v1 - v0) = h F(x0 + h v1, v1)
// from v1 = v0 in single precision, its linear systems by sweeps, or by conjugate gradients where
// these are faster.
// list_slices, list_near: slices that take part; mark_near: those around the probe.
// couple_friction: forces and blocks found in double precision.
// sweep_all, finish, solve: the rest of a linear system that a first sweep began; conjugate.
// touch, linearise, iterate: one Newton iteration; is_bent: whether it needs another.
// rest:      slices that stopped moving fall asleep, movers wake their neighbours.
#include "world/contact.h"
#include "world/lane_parts.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"

#include <string.h>

// Lists the slices that `take` marks.
static void list_slices(sonde_lanes *lanes, const uint8_t *take) {
  uint32_t count = 0;
  for (uint32_t part = 0; part < SONDE_PARTS; ++part) {
    for (uint32_t s = lanes->part_slice[part]; s < lanes->part_slice[part + 1]; ++s) {
      lanes->awake[count] = s;
      count += take[s];
    }
    lanes->part_awake[part + 1] = count;
  }
  lanes->awake_count = count;
}

static void list_awake(sonde_lanes *lanes) { list_slices(lanes, lanes->is_awake); }

// Adds the slices beside the marked ones to the list of `count`; returns the new count.
static uint32_t add_ring(sonde_lanes *lanes, uint32_t count) {
  uint32_t end = count;
  for (uint32_t k = 0; k < count; ++k) {
    const sonde_slice_model *fixed = &lanes->model[lanes->near_list[k]];
    const uint32_t *near = lanes->near + fixed->first_near;
    for (uint32_t n = 0; n < fixed->near_count; ++n) {
      if (lanes->is_near[near[n]] || !lanes->is_awake[near[n]]) continue;
      lanes->is_near[near[n]] = 1;
      lanes->near_list[end++] = near[n];
    }
  }
  SONDE_ASSERT(end <= lanes->slice_count);
  return end;
}

// Marks the touched slices and NEAR_RINGS of those around them that are awake. With one ring the
// skin beside the probe gave way too little, and deep presses went over into a fold.
enum { NEAR_RINGS = 2 };
static void mark_near(sonde_lanes *lanes) {
  memset(lanes->is_near, 0, lanes->slice_count);
  for (uint32_t k = 0; k < lanes->press_count; ++k) {
    lanes->near_list[k] = lanes->pressed[k];
    lanes->is_near[lanes->pressed[k]] = 1;
  }
  lanes->near_count = lanes->press_count;
  for (int ring = 0; ring < NEAR_RINGS; ++ring)
    lanes->near_count = add_ring(lanes, lanes->near_count);
}

// Lists these; the others stand still for now.
static void list_near(sonde_lanes *lanes) {
  for (uint32_t s = 0; s < lanes->slice_count; ++s)
    if (lanes->is_awake[s] && !lanes->is_near[s]) sonde_lanes_still(lanes, s, 1);
  list_slices(lanes, lanes->is_near);
}

static void wake(sonde_lanes *lanes, uint32_t s) {
  lanes->is_awake[s] = 1;
  lanes->calm[s] = 0;
}

// Wakes the slices that the probe touches; true when one slept.
static bool wake_touched(sonde_state *state) {
  bool woke = false;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t s = state->touched[k] / SONDE_LANES;
    woke |= !state->lanes->is_awake[s];
    wake(state->lanes, s);
  }
  return woke;
}

// Clears what the contact adds to.
static void clear_touched(sonde_state *state) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    state->matrix->diagonal[i] = m_zero();
    state->force[i] = state->product[i] = vec3(0, 0, 0);
  }
}

// Adds friction, found in double precision, to what the contact gathered.
static void couple_friction(sonde_state *state) {
  sonde_lanes *lanes = state->lanes;
  SONDE_ASSERT(state->touched_count <= lanes->node_count);
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k], l = i % SONDE_LANES;
    sonde_slice_press *at = &lanes->press[lanes->press_of[i / SONDE_LANES] - 1];
    const double(*d)[3] = (const double(*)[3])state->matrix->diagonal[i].m;
    sonde_vec3 f = state->force[i];
    at->force[0][l] += (float)f.x, at->force[1][l] += (float)f.y, at->force[2][l] += (float)f.z;
    at->block[0][l] += (float)d[0][0], at->block[1][l] += (float)d[0][1];
    at->block[2][l] += (float)d[0][2], at->block[3][l] += (float)d[1][1];
    at->block[4][l] += (float)d[1][2], at->block[5][l] += (float)d[2][2];
  }
}

// Vectors that the kernels read and write at least once, per slice and per slot: those of one
// evaluation (linearise, the records of accept or update), of one sweep and of one iteration
// (multiply, advance). Records of neighbours count once per slot; the contact does not count.
enum {
  EVALUATED_PER_SLICE = 39,
  EVALUATED_PER_SPRING = 16,
  EVALUATED_PER_LAYERED = 12,
  SWEPT_PER_SLICE = 19,
  ITERATED_PER_SLICE = 44,
  MULTIPLIED_PER_SPRING = 10,
  MULTIPLIED_PER_LAYERED = 7,
  UPDATED_PER_SLICE = 29
};

static void count_bytes(sonde_lanes *lanes, uint64_t sweeps, uint64_t iterations) {
  uint64_t slices = lanes->awake_count, slots = lanes->slot_total;
  uint64_t springs = lanes->law.springs ? slots : 0, layered = lanes->law.layered ? slots : 0;
  uint64_t evaluated = EVALUATED_PER_SLICE * slices + EVALUATED_PER_SPRING * springs +
                       EVALUATED_PER_LAYERED * layered;
  uint64_t multiplied = MULTIPLIED_PER_SPRING * springs + MULTIPLIED_PER_LAYERED * layered;
  lanes->bytes_moved +=
      sizeof(sonde_lane) * (evaluated + sweeps * (SWEPT_PER_SLICE * slices + multiplied) +
                            iterations * (ITERATED_PER_SLICE * slices + multiplied));
}

// Whether Gauss-Seidel needs more than seven sweeps more at the pace of the last one: then
// conjugate gradients are faster.
static bool is_slow(double before, double now, double target) {
  double pace = now / before, sixth = pace * pace * pace;
  return now > target && !(now * sixth * sixth <= target);
}

// Conjugate gradients from r and z, whose products are r.z and r.r. They begin at x = 0 when no
// sweep went before: each of their steps then is one downhill, however early they end, while a
// first sweep may overshoot where springs are stiff.
static void conjugate(sonde_state *state, double target, sonde_lane_sums sums,
                      sonde_pcg_result *result) {
  sonde_lanes *lanes = state->lanes;
  double alpha = 0, beta = 0;
  result->residual = sqrt(sums.left2);
  uint32_t most = state->def.pcg.max_iterations;
  for (bool first = true; result->residual > target && result->iterations < most; first = false) {
    if (lanes->tied) lanes->kernels->carry(lanes, lanes->direction);
    double curvature = sonde_parts_multiply(lanes, first);
    if (!first) curvature -= beta * sums.product / alpha;
    if (!(curvature > 0)) break;
    alpha = sums.product / curvature;
    sonde_lane_sums next = sonde_parts_advance(lanes, first, (float)alpha, (float)beta);
    beta = next.product / sums.product;
    sums = next;
    result->residual = sqrt(next.left2);
    result->iterations++;
  }
}

// How a Newton iteration is made.
typedef struct iteration {
  uint32_t number; // from 1
  bool last;       // none may follow
  bool local;      // touched slices and those beside them only
  bool left;       // something was left to the next, local iteration
  double force2;   // (h F)^2 of the last one of all slices: extrapolation makes the first large
} iteration;

// A sweep of all slices for the sake of a few costs more than the next iteration of these alone.
enum { FEW = 2 };
static const double FAR_SHARE = 0.5; // of the square of what the solver may leave
// So far above what the solver may leave they stay above it after a sweep; and a local iteration
// has touched nodes to gain or to lose, so that the next one begins anew.
static const double HOPELESS = 30;
static const double ROUGH = 0.1; // of its first residual is what such an iteration may leave

// Sweeps until little is left, or little beside what the next iteration does; returns their number.
static uint32_t sweep_all(sonde_state *state, iteration *now, sonde_lane_sums sums, double target,
                          sonde_pcg_result *result) {
  sonde_lanes *lanes = state->lanes;
  bool may_leave = !now->last && now->number == 1 && lanes->awake_count > FEW * lanes->near_count;
  double found = result->residual;
  bool slow = false;
  uint32_t sweeps = 0, most = state->def.pcg.max_iterations;
  now->left = may_leave && sums.far2 <= FAR_SHARE * target * target && found > HOPELESS * target;
  while (result->residual > target && sweeps < most && !slow && !now->left) {
    double before = found;
    sums = sonde_parts_sweep(lanes);
    found = sqrt(sums.left2);
    sweeps++;
    result->residual = found * fmin(found / before, 1);
    slow = is_slow(before, found, target);
    now->left = result->residual > target && may_leave && sums.far2 <= FAR_SHARE * target * target;
  }
  return sweeps;
}

// Conjugate gradients for what is left.
static void finish(sonde_state *state, iteration *now, double target, sonde_lane_sums sums,
                   sonde_pcg_result *result) {
  double rough = ROUGH * result->residual;
  bool may_leave = now->local && !now->last && result->residual > HOPELESS * target;
  conjugate(state, may_leave ? rough : target, sums, result);
  now->left = may_leave && result->residual > target && result->residual <= rough;
}

// sums: of the linearisation. From the residual that the first sweep found on; what a sweep leaves
// is what it found times the pace. Without sweeps by conjugate gradients at once. False when there
// was nothing left to solve.
static bool solve(sonde_state *state, iteration *now, bool sweep, sonde_lane_sums sums,
                  double reference) {
  sonde_lanes *lanes = state->lanes;
  const sonde_pcg_options *options = &state->def.pcg;
  sonde_pcg_result result = {.reference = reference, .residual = sqrt(sums.left2)};
  double target = fmax(options->relative_residual * reference, options->absolute_residual);
  bool solved = result.residual > target;
  now->left = false;
  uint32_t sweeps = sweep ? sweep_all(state, now, sums, target, &result) : 0;
  result.iterations = sweeps;
  if (result.residual > target && !now->left) {
    if (sweep) sums = sonde_parts_restart(lanes);
    finish(state, now, target, sums, &result);
  }
  result.converged = result.residual <= target || now->left;
  if (!result.converged) state->flags |= SONDE_FLAG_NOT_CONVERGED;
  count_bytes(lanes, sweeps, result.iterations - sweeps);
  result.iterations += state->solver.iterations;
  state->solver = result;
  return solved;
}

// The solution of touched nodes, for the pushes at the end of the step.
static void publish_increments(sonde_state *state, bool clear) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k], l = i % SONDE_LANES;
    const sonde_slice *at = &state->lanes->slice[i / SONDE_LANES];
    sonde_vec3 x = sonde_lane_vector(at->x, l);
    state->increment[i] = clear ? vec3(0, 0, 0) : x;
    if (clear) state->velocity[i] = v_add(state->velocity[i], x);
  }
}

// Of what the linear solver may leave: what is not seen adds up from step to step.
static const double BENT_SHARE = 0.1;

// Square of what a solution without ties left out.
static double untied2(sonde_state *state) {
  sonde_lanes *lanes = state->lanes;
  double sum = 0;
  lanes->kernels->carry(lanes, lanes->probe_way);
  for (uint32_t k = 0; k < lanes->press_count; ++k)
    for (int c = 0; c < 3; ++c)
      for (int l = 0; l < SONDE_LANES; ++l) {
        double carry = (double)lanes->press[k].carry[l][c];
        sum += carry * carry;
      }
  return sum;
}

// Whether what the linear system did not see of its solution is more than a share of what the
// solver may leave, or what it left out is more than that; the next iteration is local when the
// contact is all of it.
static bool is_bent(sonde_state *state, double surprise2, iteration *now) {
  double h = state->def.dt_s, rest2 = state->def.pcg.absolute_residual;
  double share = state->def.pcg.relative_residual * state->def.pcg.relative_residual;
  double contact2 = h * h * surprise2;
  double bent2 = sonde_parts_bend(state->lanes);
  rest2 *= rest2;
  double limit2 = fmax(BENT_SHARE * BENT_SHARE * share * now->force2, rest2);
  now->local = bent2 <= limit2 && !state->lanes->stiff;
  if (contact2 + bent2 > limit2) return true;
  return !state->lanes->tied && untied2(state) > fmax(share * now->force2, rest2);
}

// Finds the contact where the nodes are expected.
static void touch(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                  const sonde_motion *motion) {
  double h = state->def.dt_s;
  const sonde_contact_scales scales = {h, h * h};
  sonde_press_detect(state, probe, pose, motion);
  if (wake_touched(state)) list_awake(state->lanes);
  if (!probe || !(state->def.friction.mu_static > 0)) return;
  clear_touched(state);
  sonde_friction_apply(state, motion, &scales, h);
  couple_friction(state);
}

// Forces and matrix, the first sweep and the rest of the solution. False when there was nothing
// left to solve.
static bool linearise(sonde_state *state, iteration *now) {
  sonde_lanes *lanes = state->lanes;
  double start = sonde_clock_now();
  sonde_vec3 reaction = lanes->reaction_n;
  bool sweep = !lanes->tied && !lanes->stiff;
  sonde_lane_sums sums = sonde_parts_linearise(lanes, sweep);
  if (now->local)
    lanes->reaction_n = reaction;
  else
    now->force2 = sums.force2;
  double assembled = sonde_clock_now();
  bool solved = solve(state, now, sweep, sums, sqrt(now->force2));
  state->times.assembly_s += assembled - start;
  state->times.solve_s += sonde_clock_now() - assembled;
  return solved;
}

// One Newton iteration: forces and matrix where the nodes are expected, solution, pushes after it.
// True when another one is needed; `last`: there will be none. The first one makes do without ties.
static bool iterate(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                    const sonde_motion *motion, iteration *now, bool last) {
  double start = sonde_clock_now();
  state->lanes->tied = now->number > 1 && state->def.contact_law == SONDE_CONTACT_FOUNDATION;
  touch(state, probe, pose, motion);
  mark_near(state->lanes);
  if (now->local) list_near(state->lanes);
  double detected = sonde_clock_now();
  now->last = last;
  bool solved = linearise(state, now);
  double left = sonde_clock_now();
  publish_increments(state, false);
  bool open = solved && !last;
  double surprise2 = sonde_press_meet(state, open);
  bool again = open && (is_bent(state, surprise2, now) || now->left);
  publish_increments(state, true);
  state->times.contact_s += detected - start + (sonde_clock_now() - left);
  return again;
}

static void fall_asleep(sonde_state *state, uint32_t s) {
  sonde_lanes *lanes = state->lanes;
  SONDE_ASSERT(lanes->is_awake[s]);
  sonde_slice *at = &lanes->slice[s];
  lanes->is_awake[s] = 0;
  lanes->speed2[s] = 0;
  lanes->published[s] = 1;
  for (int c = 0; c < 3; ++c) at->v[c] = at->ve[c] = at->x[c] = (sonde_lane){0};
  sonde_lanes_still(lanes, s, 1);
  for (uint32_t l = 0; l < lanes->model[s].used; ++l) {
    uint32_t i = s * SONDE_LANES + l;
    sonde_lanes_record(lanes, i);
    state->velocity[i] = vec3(0, 0, 0);
    state->position[i] = state->probed[i] =
        v_add(state->model->surface.vertices[i], sonde_lane_vector(at->u, l));
  }
}

static bool has_waking_neighbour(const sonde_lanes *lanes, uint32_t s) {
  const uint32_t *near = lanes->near + lanes->model[s].first_near;
  for (uint32_t k = 0; k < lanes->model[s].near_count; ++k)
    if (lanes->is_awake[near[k]]) return true;
  return false;
}

static void wake_neighbours(sonde_lanes *lanes, uint32_t s) {
  const uint32_t *near = lanes->near + lanes->model[s].first_near;
  for (uint32_t k = 0; k < lanes->model[s].near_count; ++k)
    if (!lanes->is_awake[near[k]]) wake(lanes, near[k]);
}

// Slices at the border of the waking ones are tried for one step in turn: their neighbours may have
// crept away from the place where they found balance.
static void try_sleepers(sonde_state *state) {
  sonde_lanes *lanes = state->lanes;
  uint32_t turn = (uint32_t)(state->tick % SONDE_TRIAL_PERIOD);
  for (uint32_t s = turn; s < lanes->slice_count; s += SONDE_TRIAL_PERIOD)
    if (!lanes->is_awake[s] && has_waking_neighbour(lanes, s)) {
      lanes->is_awake[s] = 1;
      lanes->calm[s] = SONDE_CALM_TICKS - 1;
    }
}

// A slice sleeps when for SONDE_CALM_TICKS its nodes were slow and their unbalanced forces could
// not move them by more than the sleep displacement: the anchors alone would stop them earlier.
static void rest(sonde_state *state) {
  sonde_lanes *lanes = state->lanes;
  float way = (float)state->def.sleep_displacement_m, still = way / 10e-3f;
  if (!(way > 0)) return;
  for (uint32_t k = 0; k < state->touched_count; ++k)
    lanes->calm[state->touched[k] / SONDE_LANES] = 0;
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    uint32_t s = lanes->awake[a];
    if (lanes->speed2[s] > 4 * still * still) wake_neighbours(lanes, s);
    if (lanes->speed2[s] > still * still || lanes->unrest2[s] > way * way)
      lanes->calm[s] = 0;
    else if (++lanes->calm[s] >= SONDE_CALM_TICKS)
      fall_asleep(state, s);
  }
  try_sleepers(state);
}

// What the probe touched may have bounced: its change of velocity says nothing about the next.
static void hold_touched(sonde_state *state) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k], l = i % SONDE_LANES;
    sonde_slice *at = &state->lanes->slice[i / SONDE_LANES];
    for (int c = 0; c < 3; ++c) at->ve[c][l] = at->v[c][l];
    sonde_lanes_record(state->lanes, i);
  }
}

bool sonde_lane_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                     const sonde_motion *motion) {
  sonde_lanes *lanes = state->lanes;
  SONDE_ASSERT(lanes->node_count == state->model->surface.vertex_count);
  if (lanes->stale)
    sonde_lanes_import(lanes, state->model->surface.vertices, state->position, state->velocity,
                       true);
  state->times = (sonde_stage_times){0};
  state->solver = (sonde_pcg_result){0};
  lanes->bytes_moved = 0;
  list_awake(lanes);
  hold_touched(state);
  iteration now = {.number = 1};
  uint32_t most = state->def.newton_iterations;
  for (; iterate(state, probe, pose, motion, &now, now.number >= most); now.number++) {
    sonde_parts_accept(lanes);
    list_awake(lanes);
  }
  list_awake(lanes);
  double solved = sonde_clock_now();
  if (probe) sonde_friction_advance(state, motion);
  sonde_contact_wrench(state, pose.position);
  state->contact.reaction_n = lanes->reaction_n;
  double size = sonde_parts_update(lanes);
  lanes->bytes_moved += sizeof(sonde_lane) * UPDATED_PER_SLICE * lanes->awake_count;
  bool finite = isfinite(size) && v_finite(state->contact.force_n);
  if (finite) rest(state);
  state->row_count = 0;
  for (uint32_t a = 0; a < lanes->awake_count; ++a)
    state->row_count += lanes->model[lanes->awake[a]].used;
  state->times.update_s = sonde_clock_now() - solved;
  return finite;
}
