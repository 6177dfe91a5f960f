// Static equilibrium by pseudo-transient continuation: (M/tau^2 + K) d = F with growing tau, so
// that far from the solution the mass damps the move and near it the iteration is Newton's. Rows
// that the press does not reach are in balance and stay. Always in double precision, on the kernels
// of the engine.
#define SONDE_REAL_DOUBLE
#include "world/batches.h"
#include "world/contact.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

typedef struct problem {
  sonde_state *state;
  sonde_batches *body;
  const sonde_probe *probe; // NULL for a bonded footprint
  sonde_pose pose;
  double tau_s;
} problem;

// What an evaluation finds: |F| over the free nodes, the size of the force that causes the
// deformation, and sums for the solver.
typedef struct balance {
  double residual, load;
  sonde_batch_sums sums;
} balance;

// Of the batches that `is_awake` marks, which move, near_list holds the first `count`: those around
// them move too.
static void list_around(sonde_batches *body, uint32_t count) {
  enum { RINGS = 2 };
  uint8_t *moves = body->common.is_awake;
  uint32_t from = 0;
  for (int ring = 0; ring < RINGS; ++ring) {
    const uint32_t to = count;
    for (; from < to; ++from) {
      const sonde_rows *rows = &body->rows[body->near_list[from]];
      const uint32_t *near = body->near + rows->first_near;
      for (uint32_t n = 0; n < rows->near_count; ++n) {
        if (moves[near[n]]) continue;
        moves[near[n]] = 1, body->near_list[count++] = near[n];
      }
    }
  }
  SONDE_ASSERT(count <= body->common.batch_count);
  sonde_batches_list(body, moves);
}

// Forces, contact and matrix at the displacements u, of the rows that move.
static balance evaluate(const problem *p) {
  sonde_state *state = p->state;
  sonde_batches *body = p->body;
  const sonde_motion still = {.origin = p->pose.position};
  body->step.mass_scale = 1 / (p->tau_s * p->tau_s);
  body->corners_coupled = state->def.contact_law != SONDE_CONTACT_NODES;
  for (uint32_t a = 0; a < body->awake_count; ++a) body->kernels->record(body, body->awake[a]);
  sonde_batches_detect(state, body, p->probe, p->pose, &still);
  balance at = {.sums = sonde_parts_linearise(body, false)};
  sonde_batches_advance_contact(state, body, false); // of no move: the pushes themselves
  sonde_contact_wrench(state, p->pose.position);
  state->contact.reaction_n = body->reaction_n;
  at.residual = sqrt(at.sums.residual2);
  at.load = v_norm(p->probe ? state->contact.force_n : body->holder_n);
  return at;
}

// Lists the rows that move: displaced ones, those whose forces are out of balance by more than
// their share of `residual_n`, and what is around them. Of a volumetric body all move, since its
// inside hands forces on at once.
static void choose(const problem *p, double residual_n) {
  const double displaced_m = 1e-4;
  sonde_batches *body = p->body;
  const uint32_t batches = body->common.batch_count;
  uint8_t *moves = body->common.is_awake;
  uint32_t count = 0;
  const double least2 = residual_n * residual_n / batches;
  for (uint32_t s = 0; s < batches; ++s) {
    moves[s] = body->moved2[s] > displaced_m * displaced_m || p->state->model->bulk ||
               total(dot(body->batch[s].r, body->batch[s].r)) > least2;
    if (moves[s]) body->near_list[count++] = s;
  }
  list_around(body, count);
  for (uint32_t s = 0; s < batches; ++s)
    if (!moves[s]) sonde_batches_still(body, s, 1);
}

// From the base along the solution, each node at most as far as its model lets it, and 5 mm.
static void move(const problem *p, double share) {
  const double longest = 5e-3;
  SONDE_ASSERT(share > 0);
  for (uint32_t a = 0; a < p->body->awake_count; ++a) {
    const uint32_t s = p->body->awake[a];
    const sonde_batch *base = &p->body->base[s];
    sonde_batch *at = &p->body->batch[s];
    double moved2 = 0;
    for (uint32_t l = 0; l < p->body->rows[s].used; ++l) {
      sonde_vec3 d = v_scale(sonde_batch_vector(base->x, l), share);
      sonde_vec3 u = sonde_batch_vector(base->u, l);
      double size = v_norm(d);
      if (size > longest) d = v_scale(d, longest / size);
      u = v_add(u, sonde_model_bounded_move(p->state->tissue, s * SONDE_BATCH + l, u, d));
      at->u[0][l] = u.x, at->u[1][l] = u.y, at->u[2][l] = u.z;
      moved2 = fmax(moved2, v_norm2(u));
    }
    p->body->moved2[s] = moved2;
  }
}

// Shortens the step until the energy does not rise at its end by more than it fell at its start:
// F.d there may be negative, but not larger than half of what it was. Secant on F.d.
static bool line_search(const problem *p, double share, double first_slope, balance *now) {
  for (int tries = 0; tries < 8; ++tries) {
    move(p, share);
    balance next = evaluate(p);
    // r.d over the free nodes, d the way from the base: with F there minus the slope of the energy.
    wide_sum sum = {0};
    for (uint32_t a = 0; a < p->body->awake_count; ++a) {
      const uint32_t s = p->body->awake[a];
      const sonde_batch *base = &p->body->base[s], *at = &p->body->batch[s];
      for (int c = 0; c < 3; ++c) sum += at->r[c] * (at->u[c] - base->u[c]);
    }
    double end = total(sum) / share;
    if (isfinite(next.residual) &&
        (end >= -0.5 * first_slope || next.residual < 0.5 * now->residual)) {
      *now = next;
      return true;
    }
    share *= isfinite(end) ? clamp(first_slope / (first_slope - end), 0.1, 0.7) : 0.1;
  }
  return false;
}

static const double SLOWED_S = 1; // tau of volumetric bodies at first

// The solution goes to the base with the displacements it starts from; returns F.d of the whole
// step.
static double solve(const problem *p, const balance *now, double goal) {
  sonde_batches *body = p->body;
  sonde_pcg_result *solver = &p->state->solver;
  const sonde_pcg_options options = {1e-2, 1e-14, 600};
  wide_sum descent = {0};
  double target = fmax(options.relative_residual * now->residual, 0.1 * goal);
  target = fmax(target, options.absolute_residual);
  for (uint32_t a = 0; a < body->awake_count; ++a) {
    const uint32_t s = body->awake[a];
    memcpy(body->base[s].u, body->batch[s].u, sizeof body->base[s].u);
    memcpy(body->base[s].r, body->batch[s].r, sizeof body->base[s].r);
  }
  *solver = (sonde_pcg_result){.reference = now->residual};
  // A search that failed from here is slowed down by masses.
  double force2;
  bool responds = body->tissue->compliance && p->probe && p->tau_s >= SLOWED_S;
  if (!responds || !sonde_batches_respond(p->state, body, &force2)) {
    solver->residual = sonde_batches_conjugate(body, target, options.max_iterations, now->sums,
                                               &solver->iterations);
    solver->converged = solver->residual <= target;
  }
  for (uint32_t a = 0; a < body->awake_count; ++a) {
    const uint32_t s = body->awake[a];
    memcpy(body->base[s].x, body->batch[s].x, sizeof body->base[s].x);
    descent += dot(body->base[s].r, body->base[s].x);
  }
  return total(descent);
}

// Newton's iterations on the rows that move, until these are in balance within half of what may be
// left; then all rows are looked at, and those that are not in balance move as well.
static sonde_settle_result iterate(problem *p, double relative, uint32_t limit) {
  const double least_n = 1e-12;
  sonde_settle_result result = {0};
  const sonde_contact *contact = &p->state->contact;
  choose(p, INFINITY);
  balance now = evaluate(p);
  for (uint32_t r = 0; p->probe && r < contact->region_count; ++r)
    result.start_depth_m = fmax(result.start_depth_m, contact->region[r].depth_max_m);
  // Contact that opens and closes in turn makes a cycle, which shorter steps break: the share falls
  // when eight iterations bring no progress and recovers with progress.
  double share = 1, best = now.residual;
  uint32_t stalled = 0;
  for (;;) {
    // Rows that the probe touches and that stand still join those that move.
    sonde_batches *body = p->body;
    uint32_t joined = 0;
    for (uint32_t k = 0; k < body->contact_count; ++k) {
      const uint32_t s = body->contact_batch[k];
      if (body->common.is_awake[s]) continue;
      body->common.is_awake[s] = 1, body->near_list[joined++] = s;
    }
    if (joined > 0) list_around(body, joined), now = evaluate(p);
    const double goal = fmax(0.5 * relative * now.load, least_n);
    if (now.residual <= goal || result.iterations >= limit) {
      memset(p->body->common.is_awake, 1, p->body->common.batch_count);
      sonde_batches_list(p->body, p->body->common.is_awake);
      now = evaluate(p); // of all rows
      result.converged = now.residual <= fmax(relative * now.load, least_n);
      if (result.converged || result.iterations >= limit) break;
      choose(p, goal);
      now = evaluate(p);
    }
    double descent = solve(p, &now, goal);
    result.iterations++;
    if (!line_search(p, share, descent, &now)) {
      p->tau_s *= 0.05;
      for (uint32_t a = 0; a < p->body->awake_count; ++a) {
        const uint32_t s = p->body->awake[a];
        memcpy(p->body->batch[s].u, p->body->base[s].u, sizeof p->body->base[s].u);
      }
      now = evaluate(p);
      continue;
    }
    p->tau_s = fmin(4 * p->tau_s, 1e3);
    if (now.residual < 0.8 * best) {
      best = now.residual, stalled = 0;
      share = fmin(1, 1.2 * share);
    } else if (++stalled >= 8) {
      best = now.residual, stalled = 0;
      share = fmax(0.1, 0.5 * share);
    }
  }
  result.residual = now.load > 0 ? now.residual / now.load : 0;
  result.contact_n = now.load;
  result.reaction_n = v_norm(contact->reaction_n);
  return result;
}

// The problem at the state's positions, at rest and without a probe; false when memory is out. A
// state of floats gets its doubles when they are asked for first.
static bool begin(sonde_state *state, problem *p) {
  sonde_state_publish(state);
  if (!state->precise && sonde_engine_double.create(state->tissue, &state->def, state->face_order,
                                                    &state->precise, NULL))
    return false;
  sonde_batches *body = (sonde_batches *)(void *)state->precise;
  memset(state->velocity, 0, state->nodes.count * sizeof *state->velocity);
  sonde_contact_clear(state);
  body->common.calls->import(&body->common, state->nodes.rest, state->position, state->velocity,
                             true);
  memset(body->is_near, 0, body->common.batch_count);
  body->step.reach = body->step.force_scale = body->step.stiffness_scale = 1;
  body->step.damping_scale = 0;
  *p = (problem){.state = state,
                 .body = body,
                 .pose = {.rotation = quat_identity()},
                 .tau_s = state->model->bulk ? 1 : 0.02};
  return true;
}

// The state takes over the displacements, at rest.
static void end(problem *p) {
  sonde_state *state = p->state;
  sonde_batches *body = p->body;
  sonde_batches_set_step(body, &state->def);
  memset(body->common.published, 0, body->common.batch_count);
  body->common.calls->publish(&body->common, state->nodes.rest, state->position, state->velocity);
  sonde_state_wake_all(state);
}

sonde_settle_result sonde_settle(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                                 double relative_residual, uint32_t max_iterations) {
  problem p;
  SONDE_ASSERT(probe && v_finite(pose.position));
  if (!begin(state, &p)) return (sonde_settle_result){0};
  p.probe = probe, p.pose = pose;
  sonde_settle_result result = iterate(&p, relative_residual, max_iterations);
  end(&p);
  state->probe_pose = pose;
  state->has_probe_pose = true;
  return result;
}

sonde_settle_result sonde_settle_bonded(sonde_state *state, const uint32_t *nodes,
                                        const sonde_vec3 *positions_m, uint32_t count,
                                        double relative_residual, uint32_t max_iterations,
                                        sonde_vec3 *force_n) {
  problem p;
  sonde_state_publish(state);
  for (uint32_t k = 0; k < count; ++k) {
    SONDE_ASSERT(nodes[k] < state->nodes.count);
    state->position[nodes[k]] = positions_m[k];
  }
  state->engine->stale = true; // the positions are newer
  if (!begin(state, &p)) return (sonde_settle_result){0};
  for (uint32_t s = 0; s < p.body->common.batch_count; ++s) p.body->free[s] = all(1);
  for (uint32_t k = 0; k < count; ++k)
    p.body->free[nodes[k] / SONDE_BATCH][nodes[k] % SONDE_BATCH] = 0;
  p.body->holds = true;
  sonde_settle_result result = iterate(&p, relative_residual, max_iterations);
  if (force_n) *force_n = p.body->holder_n;
  p.body->holds = false;
  end(&p);
  for (uint32_t k = 0; k < count; ++k) state->position[nodes[k]] = positions_m[k];
  return result;
}
