// One step of an engine (docs/world.md): Newton's method on
//   M (v1 - v0) = h F(x0 + lambda h ve, ve),  ve = v0 + lambda (v1 - v0)
// its linear systems by sweeps, or by conjugate gradients where these are faster or doubles are
// wanted; afterwards batches that stopped moving fall asleep and movers wake their neighbours.
#include "world/batches.h"
#include "world/contact.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"

#include <string.h>

void sonde_batches_list(sonde_batches *body, const uint8_t *take) {
  uint32_t count = 0;
  for (uint32_t part = 0; part < SONDE_PARTS; ++part) {
    for (uint32_t s = body->part_batch[part]; s < body->part_batch[part + 1]; ++s) {
      body->awake[count] = s;
      count += take[s];
    }
    body->part_awake[part + 1] = count;
  }
  body->awake_count = count;
}

static void list_awake(sonde_batches *body) { sonde_batches_list(body, body->common.is_awake); }

// Marks the touched batches and NEAR_RINGS of those around them that are awake. With one ring the
// skin beside the probe gave way too little, and deep presses went over into a fold.
enum { NEAR_RINGS = 2 };
static void mark_near(sonde_batches *body) {
  memset(body->is_near, 0, body->common.batch_count);
  for (uint32_t k = 0; k < body->contact_count; ++k) {
    body->near_list[k] = body->contact_batch[k];
    body->is_near[body->contact_batch[k]] = 1;
  }
  uint32_t count = body->contact_count;
  for (int ring = 0; ring < NEAR_RINGS; ++ring) {
    uint32_t before = count;
    for (uint32_t k = 0; k < before; ++k) {
      const sonde_rows *rows = &body->rows[body->near_list[k]];
      const uint32_t *near = body->near + rows->first_near;
      for (uint32_t n = 0; n < rows->near_count; ++n) {
        if (body->is_near[near[n]] || !body->common.is_awake[near[n]]) continue;
        body->is_near[near[n]] = 1;
        body->near_list[count++] = near[n];
      }
    }
  }
  SONDE_ASSERT(count <= body->common.batch_count);
  body->near_count = count;
}

static void wake(sonde_batches *body, uint32_t s) {
  body->common.is_awake[s] = 1;
  body->common.calm[s] = 0;
}

// Adds friction, found in double precision, to what the contact gathered.
static void add_friction(sonde_state *state, sonde_batches *body, const sonde_motion *motion) {
  double h = state->def.dt_s, lambda = state->def.implicitness;
  const sonde_contact_scales scales = {lambda > 0 ? h : 0, lambda * h * h};
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k], l = i % SONDE_BATCH;
    sonde_vec3 f;
    sonde_mat3 block;
    if (!sonde_friction_at(state, i, motion, &scales, &f, &block)) continue;
    sonde_batch_contact *at = &body->contact[body->contact_of[i / SONDE_BATCH] - 1];
    const double(*d)[3] = (const double(*)[3])block.m;
    at->force[0][l] += (real)f.x, at->force[1][l] += (real)f.y, at->force[2][l] += (real)f.z;
    at->block[0][l] += (real)d[0][0], at->block[1][l] += (real)d[0][1];
    at->block[2][l] += (real)d[0][2], at->block[3][l] += (real)d[1][1];
    at->block[4][l] += (real)d[1][2], at->block[5][l] += (real)d[2][2];
  }
}

// Vectors that the kernels read and write at least once, per batch and per slot: those of one
// evaluation (linearise, the records of accept or update), of one sweep and of one iteration
// (multiply, advance). Records of neighbours count once per slot; the contact does not count.
enum {
  EVALUATED_PER_BATCH = 39,
  SWEPT_PER_BATCH = 19,
  ITERATED_PER_BATCH = 44,
  UPDATED_PER_BATCH = 29
};

// From r and z, whose products are r.z and r.r. They begin at x = 0 when no sweep went before: each
// of their steps then is one downhill, however early they end, while a first sweep may overshoot
// where springs are stiff.
double sonde_batches_conjugate(sonde_batches *body, double target, uint32_t most_iterations,
                               sonde_batch_sums sums, uint32_t *iterations) {
  double alpha = 0, beta = 0, residual = sqrt(sums.residual2);
  SONDE_ASSERT(target >= 0);
  for (bool first = true; residual > target && *iterations < most_iterations; first = false) {
    if (body->corners_coupled) sonde_batches_couple(body, body->direction);
    double curvature = sonde_parts_multiply(body, first);
    if (!first) curvature -= beta * sums.product / alpha;
    if (!(curvature > 0)) break;
    alpha = sums.product / curvature;
    sonde_batch_sums next = sonde_parts_advance(body, first, (real)alpha, (real)beta);
    beta = next.product / sums.product;
    sums = next;
    residual = sqrt(next.residual2);
    ++*iterations;
  }
  return residual;
}

// How a Newton iteration is made.
typedef struct iteration {
  uint32_t number; // from 1
  bool last;       // none may follow
  bool local;      // touched batches and those beside them only
  bool postponed;  // something was left to the next, local iteration
  double force2;   // (h F)^2 of the last one of all batches: extrapolation makes the first large
} iteration;

// A sweep of all batches for the sake of a few costs more than the next iteration of these alone.
enum { FEW = 2 };
static const double FAR_SHARE = 0.5; // of the square of what the solver may leave
// So far above what the solver may leave they stay above it after a sweep; and a local iteration
// has touched nodes to gain or to lose, so that the next one begins anew.
static const double HOPELESS = 30;
static const double ROUGH = 0.1; // of its first residual is what such an iteration may leave

// Sweeps until little is left, or little beside what the next iteration does; returns their number.
// Where Gauss-Seidel needs more than seven sweeps more at the pace of the last one, conjugate
// gradients are faster.
static uint32_t sweep_all(sonde_state *state, sonde_batches *body, iteration *now,
                          sonde_batch_sums sums, double target, sonde_pcg_result *result) {
  bool may_postpone = !now->last && now->number == 1 && body->awake_count > FEW * body->near_count;
  double found = result->residual;
  bool slow = false;
  uint32_t sweeps = 0, most = state->def.pcg.max_iterations;
  now->postponed =
      may_postpone && sums.far2 <= FAR_SHARE * target * target && found > HOPELESS * target;
  while (result->residual > target && sweeps < most && !slow && !now->postponed) {
    double before = found;
    sums = sonde_parts_sweep(body);
    found = sqrt(sums.residual2);
    sweeps++;
    result->residual = found * fmin(found / before, 1);
    double pace = found / before, sixth = pace * pace * pace;
    slow = found > target && !(found * sixth * sixth <= target);
    now->postponed =
        result->residual > target && may_postpone && sums.far2 <= FAR_SHARE * target * target;
  }
  return sweeps;
}

// sums: of the linearisation. From the residual that the first sweep found on; what a sweep leaves
// is what it found times the pace. Without sweeps by conjugate gradients at once. False when there
// was nothing left to solve.
static bool solve(sonde_state *state, sonde_batches *body, iteration *now, bool sweep,
                  sonde_batch_sums sums, double reference) {
  const sonde_pcg_options *options = &state->def.pcg;
  sonde_pcg_result result = {.reference = reference, .residual = sqrt(sums.residual2)};
  double target = fmax(options->relative_residual * reference, options->absolute_residual);
  bool solved = result.residual > target;
  now->postponed = false;
  uint32_t sweeps = sweep ? sweep_all(state, body, now, sums, target, &result) : 0;
  result.iterations = sweeps;
  if (result.residual > target && !now->postponed) {
    if (sweep) sums = sonde_parts_restart(body);
    double rough = ROUGH * result.residual;
    bool may_postpone = now->local && !now->last && result.residual > HOPELESS * target;
    result.residual = sonde_batches_conjugate(body, may_postpone ? rough : target,
                                              options->max_iterations, sums, &result.iterations);
    now->postponed = may_postpone && result.residual > target && result.residual <= rough;
  }
  result.converged = result.residual <= target || now->postponed;
  if (!result.converged) state->flags |= SONDE_FLAG_NOT_CONVERGED;
  const uint64_t batches = body->awake_count, slots = body->slot_total;
  const uint64_t evaluated =
      EVALUATED_PER_BATCH * batches + body->tissue->evaluated_per_slot * slots;
  const uint64_t multiplied = body->tissue->multiplied_per_slot * slots;
  body->common.bytes_moved +=
      sizeof(reals) * (evaluated + sweeps * (SWEPT_PER_BATCH * batches + multiplied) +
                       (result.iterations - sweeps) * (ITERATED_PER_BATCH * batches + multiplied));
  result.iterations += state->solver.iterations;
  state->solver = result;
  return solved;
}

// Of what the linear solver may leave: what is not seen adds up from step to step.
static const double BENT_SHARE = 0.1;

// Square of what a solution without corner couplings left out.
static double uncoupled2(sonde_batches *body) {
  double sum = 0;
  sonde_batches_couple(body, body->probe_move);
  for (uint32_t k = 0; k < body->contact_count; ++k)
    for (int c = 0; c < 3; ++c)
      for (int l = 0; l < SONDE_BATCH; ++l) {
        double product = (double)body->contact[k].product[l][c];
        sum += product * product;
      }
  return sum;
}

// Whether what the linear system did not see of its solution is more than a share of what the
// solver may leave, or what it left out is more than that; the next iteration is local when the
// contact is all of it.
static bool is_bent(sonde_state *state, sonde_batches *body, double surprise2, iteration *now) {
  double h = state->def.dt_s, rest2 = state->def.pcg.absolute_residual;
  double share = state->def.pcg.relative_residual * state->def.pcg.relative_residual;
  double contact2 = h * h * surprise2;
  double bent2 = sonde_parts_bend(body);
  rest2 *= rest2;
  double limit2 = fmax(BENT_SHARE * BENT_SHARE * share * now->force2, rest2);
  now->local = bent2 <= limit2 && !body->by_gradients;
  if (contact2 + bent2 > limit2) return true;
  return !body->corners_coupled && uncoupled2(body) > fmax(share * now->force2, rest2);
}

static bool is_equation_4(const sonde_state *state) {
  return state->def.newton_iterations == 0 && state->def.implicitness > 0;
}

// Eq. (4) of the paper is linear from the start of the step. The tissue's dampers are linear: its
// forces are evaluated at the positions of the start with velocities of zero. The contact is found
// where the velocities v of the start lead; at zero its pushes are less by its matrix times v.
static void evaluate_at_rest(sonde_batches *body) {
  const real force_scale = body->step.force_scale;
  for (uint32_t k = 0; k < body->contact_count; ++k) {
    uint32_t s = body->contact_batch[k];
    const reals *v = body->batch[s].ve;
    const reals row[4] = {v[0], v[1], v[2], all(0)};
    for (uint32_t l = 0; l < SONDE_BATCH; ++l)
      for (uint32_t c = 0; c < 4; ++c)
        body->probe_move[(s * SONDE_BATCH + l) * SONDE_QUAD + c] = row[c][l];
  }
  sonde_batches_couple(body, body->probe_move);
  for (uint32_t k = 0; k < body->contact_count; ++k) {
    sonde_batch_contact *at = &body->contact[k];
    const reals *v = body->batch[body->contact_batch[k]].ve;
    reals own[6], out[3], taken[3];
    for (int c = 0; c < 6; ++c)
      own[c] = body->corners_coupled ? at->block[c] - at->neighbours[c] : at->block[c];
    for (int c = 0; c < 3; ++c)
      for (int l = 0; l < SONDE_BATCH; ++l) taken[c][l] = at->product[l][c];
    out[0] = own[0] * v[0] + own[1] * v[1] + own[2] * v[2] - taken[0];
    out[1] = own[1] * v[0] + own[3] * v[1] + own[4] * v[2] - taken[1];
    out[2] = own[2] * v[0] + own[4] * v[1] + own[5] * v[2] - taken[2];
    for (int c = 0; c < 3; ++c) at->force[c] += out[c] / force_scale;
  }
  for (uint32_t a = 0; a < body->awake_count; ++a) {
    uint32_t s = body->awake[a];
    for (int c = 0; c < 3; ++c) body->batch[s].ve[c] = (reals){0};
    body->kernels->record(body, s);
  }
}

// One Newton iteration: contact, forces and matrix where the nodes are expected, solution, pushes
// after it. True when another one is needed; `last`: there will be none. Sweeps need a first
// iteration without corner couplings.
static bool iterate(sonde_state *state, sonde_batches *body, const sonde_probe *probe,
                    sonde_pose pose, const sonde_motion *motion, iteration *now, bool last) {
  double start = sonde_clock_now();
  bool coupled = now->number > 1 || SONDE_BATCH == 8 || body->tissue->compliance;
  body->corners_coupled = coupled && state->def.contact_law != SONDE_CONTACT_NODES;
  sonde_batches_detect(state, body, probe, pose, motion);
  bool woke = false;
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t s = state->touched[k] / SONDE_BATCH;
    woke |= !body->common.is_awake[s];
    wake(body, s);
  }
  if (woke) list_awake(body);
  if (probe && state->def.friction.mu_static > 0) add_friction(state, body, motion);
  mark_near(body);
  if (now->local) { // the others stand still for now
    for (uint32_t s = 0; s < body->common.batch_count; ++s)
      if (body->common.is_awake[s] && !body->is_near[s]) sonde_batches_still(body, s, 1);
    sonde_batches_list(body, body->is_near);
  }
  if (is_equation_4(state)) evaluate_at_rest(body);
  double detected = sonde_clock_now();

  now->last = last;
  sonde_vec3 reaction = body->reaction_n;
  bool sweep = !body->corners_coupled && !body->by_gradients, solved = true;
  double assembled = detected;
  if (!body->tissue->compliance || !sonde_batches_respond(state, body, &now->force2)) {
    sonde_batch_sums sums = sonde_parts_linearise(body, sweep);
    if (now->local)
      body->reaction_n = reaction;
    else
      now->force2 = sums.force2;
    assembled = sonde_clock_now();
    solved = solve(state, body, now, sweep, sums, sqrt(now->force2));
  }
  // The solution of eq. (4) as a change of the velocities of the start.
  for (uint32_t a = 0; is_equation_4(state) && a < body->awake_count; ++a) {
    sonde_batch *at = &body->batch[body->awake[a]];
    for (int c = 0; c < 3; ++c) at->x[c] -= at->v[c], at->ve[c] = at->v[c];
  }
  double end = sonde_clock_now();

  bool open = solved && !last;
  double surprise2 = sonde_batches_advance_contact(state, body, open);
  // Rows without masses may be touched where nothing was: until the touched rows stay the same.
  bool sought = body->tissue->compliance && probe && (now->number == 1 || body->response.changed);
  bool more = open && (is_bent(state, body, surprise2, now) || now->postponed || sought);
  // The touched nodes' velocities where they are evaluated next, or at the end.
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_vec3 x = sonde_batch_vector(body->batch[i / SONDE_BATCH].x, i % SONDE_BATCH);
    if (state->def.implicitness > 0) state->velocity[i] = v_add(state->velocity[i], x);
  }
  state->times.contact_s += detected - start + (sonde_clock_now() - end);
  state->times.assembly_s += assembled - detected;
  state->times.solve_s += end - assembled;
  return more;
}

static void fall_asleep(sonde_state *state, sonde_batches *body, uint32_t s) {
  SONDE_ASSERT(body->common.is_awake[s]);
  sonde_batch *at = &body->batch[s];
  body->common.is_awake[s] = 0;
  body->speed2[s] = 0;
  body->common.published[s] = 1;
  for (int c = 0; c < 3; ++c) at->v[c] = at->ve[c] = at->x[c] = (reals){0};
  sonde_batches_still(body, s, 1);
  body->kernels->record(body, s);
  for (uint32_t l = 0; l < body->rows[s].used; ++l) {
    uint32_t i = s * SONDE_BATCH + l;
    state->velocity[i] = vec3(0, 0, 0);
    state->position[i] = state->probed[i] =
        v_add(state->nodes.rest[i], sonde_batch_vector(at->u, l));
  }
}

// A batch sleeps when for SONDE_CALM_TICKS its nodes were slow and their unbalanced forces could
// not move them by more than the sleep displacement: the anchors alone would stop them earlier.
// Batches at the border of the waking ones are tried for one step in turn: their neighbours may
// have crept away from the place where they found balance.
static void rest(sonde_state *state, sonde_batches *body) {
  sonde_engine_data *common = &body->common;
  real creep = (real)state->def.sleep_displacement_m, still = creep / (real)10e-3;
  if (!(creep > 0)) return;
  for (uint32_t k = 0; k < state->touched_count; ++k)
    common->calm[state->touched[k] / SONDE_BATCH] = 0;
  for (uint32_t a = 0; a < body->awake_count; ++a) {
    uint32_t s = body->awake[a];
    const uint32_t *near = body->near + body->rows[s].first_near;
    for (uint32_t k = 0; body->speed2[s] > 4 * still * still && k < body->rows[s].near_count; ++k)
      if (!common->is_awake[near[k]]) wake(body, near[k]);
    if (body->speed2[s] > still * still || body->unrest2[s] > creep * creep)
      common->calm[s] = 0;
    else if (++common->calm[s] >= SONDE_CALM_TICKS)
      fall_asleep(state, body, s);
  }
  uint32_t turn = (uint32_t)(state->tick % SONDE_TRIAL_PERIOD);
  for (uint32_t s = turn; s < common->batch_count; s += SONDE_TRIAL_PERIOD) {
    const uint32_t *near = body->near + body->rows[s].first_near;
    bool beside = false;
    for (uint32_t k = 0; k < body->rows[s].near_count; ++k) beside |= common->is_awake[near[k]];
    if (common->is_awake[s] || !beside) continue;
    common->is_awake[s] = 1;
    common->calm[s] = SONDE_CALM_TICKS - 1;
  }
}

// Where forces are evaluated first: what the probe touched may have bounced, its change of velocity
// says nothing about the next.
static void expect(sonde_state *state, sonde_batches *body) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k], l = i % SONDE_BATCH;
    sonde_batch *at = &body->batch[i / SONDE_BATCH];
    for (int c = 0; c < 3; ++c) at->ve[c][l] = at->v[c][l];
    bool is_last =
        k + 1 == state->touched_count || state->touched[k + 1] / SONDE_BATCH != i / SONDE_BATCH;
    if (is_last) body->kernels->record(body, i / SONDE_BATCH);
  }
  if (!is_equation_4(state)) return;
  for (uint32_t a = 0; a < body->awake_count; ++a) {
    sonde_batch *at = &body->batch[body->awake[a]];
    for (int c = 0; c < 3; ++c) at->ve[c] = at->v[c];
  }
}

enum { RESPONDING = 20 }; // Newton iterations of a body whose compliance is known
bool sonde_batches_step(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
                        const sonde_motion *motion) {
  sonde_batches *body = sonde_batches_of(state);
  SONDE_ASSERT(body->common.node_count == state->nodes.count);
  if (body->common.stale)
    body->common.calls->import(&body->common, state->nodes.rest, state->position, state->velocity,
                               true);
  state->times = (sonde_stage_times){0};
  state->solver = (sonde_pcg_result){0};
  body->common.bytes_moved = 0;
  // A body that follows the touched nodes at once has nothing to sleep, and is expected to stay.
  bool responds = body->tissue->compliance != NULL;
  for (uint32_t s = 0; responds && s < body->common.batch_count; ++s) wake(body, s);
  list_awake(body);
  expect(state, body);
  for (uint32_t s = 0; responds && s < body->common.batch_count; ++s) {
    for (int c = 0; c < 3; ++c) body->batch[s].ve[c] = (reals){0};
    body->kernels->record(body, s);
  }
  iteration now = {.number = 1};
  uint32_t most = state->def.implicitness > 0 ? state->def.newton_iterations : 1;
  // No mass holds such a body back between two steps: the touched nodes have to be found in one.
  if (responds && most > 1 && most < RESPONDING) most = RESPONDING;
  for (; iterate(state, body, probe, pose, motion, &now, now.number >= most); now.number++) {
    sonde_parts_accept(body);
    list_awake(body);
  }
  list_awake(body);
  double solved = sonde_clock_now();
  if (probe) sonde_friction_advance(state, motion);
  sonde_contact_wrench(state, pose.position);
  state->contact.reaction_n = body->reaction_n;
  double size = sonde_parts_update(body);
  body->common.bytes_moved += sizeof(reals) * UPDATED_PER_BATCH * body->awake_count;
  bool finite = isfinite(size) && v_finite(state->contact.force_n);
  if (finite && !responds) rest(state, body);
  state->awake_nodes = 0;
  for (uint32_t a = 0; a < body->awake_count; ++a)
    state->awake_nodes += body->rows[body->awake[a]].used;
  state->times.update_s = sonde_clock_now() - solved;
  return finite;
}
