// Static equilibrium by pseudo-transient continuation: (M/dt^2 + K) dx = F with growing dt, so that
// far from the solution the mass damps the move and near it the iteration is Newton's.
// evaluate: forces, contact and residual at the current positions.
// line_search: shortens the step until the energy no longer rises at its end.
// adapt:    shorter steps when nothing improves.
// iterate:  the loop shared by the free and the bonded problem.
#include "world/state.h"

#include "base/base.h"
#include "base/maths.h"
#include "tissue/two_layer.h"

#include <string.h>

typedef struct problem {
  sonde_state *state;
  const sonde_probe *probe; // NULL for a bonded footprint
  sonde_pose pose;
  double dt_s;
  const uint32_t *held; // bonded nodes
  uint32_t held_count;
} problem;

static sonde_vec3 holder_force(const problem *p) {
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t k = 0; k < p->held_count; ++k) sum = v_add(sum, p->state->force[p->held[k]]);
  return sum;
}

// Residual |F| over the free nodes; *load is the size of the force that causes the deformation.
static double evaluate(const problem *p, double *load) {
  sonde_state *state = p->state;
  const sonde_tissue_scales scales = {1 / (p->dt_s * p->dt_s), 0, 1};
  sonde_tissue_linearise(state->tissue, NULL, state->position, state->velocity, &scales,
                         state->force, state->product, state->matrix, state->scratch_nodes);
  memcpy(state->probed, state->position,
         state->model->surface.vertex_count * sizeof *state->probed);
  sonde_contact_clear(state); // nodes may have moved far since the last evaluation: refit every box
  sonde_contact_detect(state, p->probe, p->pose);
  if (p->probe) {
    const sonde_motion still = {.origin = p->pose.position};
    const sonde_contact_scales contact = {0, 1};
    sonde_contact_apply(state, &still, &contact);
    sonde_contact_wrench(state, p->pose.position);
  }
  double sum = 0;
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    state->right[i] = v_add(state->force[i], state->contact_force[i]);
    sum += v_norm2(state->right[i]);
  }
  sonde_vec3 reaction = vec3(0, 0, 0);
  for (uint32_t i = 0; i < state->model->surface.vertex_count; ++i)
    reaction = v_add(reaction, state->force[i]);
  state->contact.reaction_n = reaction;
  *load = p->probe ? v_norm(state->contact.force_n) : v_norm(holder_force(p));
  return sqrt(sum);
}

// From the kept positions along the solution, each node at most 95 % of the gap to its asymptote
// and 5 mm.
static void move(sonde_state *state, double share) {
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    sonde_vec3 d = v_scale(state->increment[i], share);
    double size = v_norm(d);
    if (size > 5e-3) d = v_scale(d, 5e-3 / size);
    d = sonde_bounded_move(state->model, i, state->trial[i], d);
    state->position[i] = v_add(state->trial[i], d);
  }
}

static void solve(sonde_state *state) {
  const sonde_pcg_options options = {1e-4, 1e-14, 600};
  sonde_active_set active = {state->rows, state->row_count, state->pairs, state->pair_count};
  for (uint32_t r = 0; r < state->row_count; ++r) state->increment[state->rows[r]] = vec3(0, 0, 0);
  sonde_block_invert_diagonal(state->matrix, &active);
  state->solver = sonde_pcg_solve(state->matrix, &active, state->term, state->term_count,
                                  state->right, state->increment, &state->scratch, &options);
}

static void keep_positions(sonde_state *state, sonde_vec3 *from, sonde_vec3 *to) {
  memcpy(to, from, state->model->surface.vertex_count * sizeof *to);
}

// F.d over the free nodes: minus the slope of the energy along the step.
static double slope(const sonde_state *state) {
  double sum = 0;
  for (uint32_t r = 0; r < state->row_count; ++r) {
    uint32_t i = state->rows[r];
    sum += v_dot(state->right[i], v_sub(state->position[i], state->trial[i]));
  }
  return sum;
}

// Shortens the step until the energy does not rise at its end by more than it fell at its start:
// F.d there may be negative, but not larger than half of what it was. Secant on F.d.
static bool line_search(const problem *p, double share, double first_slope, double *residual,
                        double *load) {
  for (int tries = 0; tries < 8; ++tries) {
    double next_load;
    move(p->state, share);
    double next = evaluate(p, &next_load), end = slope(p->state) / share;
    if (isfinite(next) && (end >= -0.5 * first_slope || next < 0.5 * *residual)) {
      *residual = next;
      *load = next_load;
      return true;
    }
    share *= isfinite(end) ? clamp(first_slope / (first_slope - end), 0.1, 0.7) : 0.1;
  }
  return false;
}

// Contact that opens and closes in turn makes a cycle, which shorter steps break: the share falls
// when eight iterations bring no progress and recovers with progress.
typedef struct pace {
  double share, best;
  uint32_t stalled;
} pace;

static void adapt(pace *at, double residual) {
  if (residual < 0.8 * at->best) {
    at->best = residual;
    at->stalled = 0;
    at->share = fmin(1, 1.2 * at->share);
  } else if (++at->stalled >= 8) {
    at->stalled = 0;
    at->best = residual;
    at->share = fmax(0.1, 0.5 * at->share);
  }
}

// F.d of the whole step before it is taken.
static double descent(const sonde_state *state) {
  double sum = 0;
  for (uint32_t r = 0; r < state->row_count; ++r)
    sum += v_dot(state->right[state->rows[r]], state->increment[state->rows[r]]);
  return sum;
}

static sonde_settle_result iterate(problem *p, double relative, uint32_t limit) {
  sonde_state *state = p->state;
  sonde_settle_result result = {0};
  double load, residual = evaluate(p, &load);
  for (uint32_t r = 0; p->probe && r < state->contact.region_count; ++r)
    result.start_depth_m = fmax(result.start_depth_m, state->contact.region[r].depth_max_m);
  pace at = {1, residual, 0};
  while (result.iterations < limit) {
    result.converged = residual <= relative * load || residual <= 1e-12;
    if (result.converged) break;
    solve(state);
    keep_positions(state, state->position, state->trial);
    result.iterations++;
    if (line_search(p, at.share, descent(state), &residual, &load)) {
      p->dt_s = fmin(4 * p->dt_s, 1e3);
      adapt(&at, residual);
      continue;
    }
    p->dt_s *= 0.05;
    keep_positions(state, state->trial, state->position);
    residual = evaluate(p, &load);
  }
  result.residual = load > 0 ? residual / load : 0;
  result.contact_n = load;
  result.reaction_n = v_norm(state->contact.reaction_n);
  return result;
}

static void quieten(sonde_state *state) {
  size_t bytes = state->model->surface.vertex_count * sizeof *state->velocity;
  memset(state->velocity, 0, bytes);
  memset(state->increment, 0, bytes);
}

sonde_settle_result sonde_settle(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                                 double relative_residual, uint32_t max_iterations) {
  SONDE_ASSERT(probe && v_finite(pose.position));
  sonde_state_publish(state);
  quieten(state);
  sonde_state_wake_all(state);
  problem p = {state, probe, pose, 0.02, NULL, 0};
  sonde_settle_result result = iterate(&p, relative_residual, max_iterations);
  quieten(state);
  state->probe_pose = pose;
  state->has_probe_pose = true;
  return result;
}

sonde_settle_result sonde_settle_bonded(sonde_state *state, const uint32_t *nodes,
                                        const sonde_vec3 *positions_m, uint32_t count,
                                        double relative_residual, uint32_t max_iterations,
                                        sonde_vec3 *force_n) {
  sonde_state_publish(state);
  quieten(state);
  sonde_state_wake_all(state);
  for (uint32_t k = 0; k < count; ++k) {
    SONDE_ASSERT(nodes[k] < state->model->surface.vertex_count);
    state->position[nodes[k]] = positions_m[k];
    state->awake[nodes[k]] = 0;
  }
  sonde_state_list_awake(state);
  problem p = {state, NULL, {.rotation = quat_identity()}, 0.02, nodes, count};
  sonde_settle_result result = iterate(&p, relative_residual, max_iterations);
  if (force_n) *force_n = holder_force(&p);
  quieten(state);
  sonde_state_wake_all(state);
  return result;
}
