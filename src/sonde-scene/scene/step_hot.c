// One implicit step for all bodies of a scene (docs/scene_theory.md).
#include "scene/touch.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"

#include <string.h>

static sonde_tissue_scales scales_of(const sonde_scene_state *state, double h) {
  double lambda = state->scene->step.lambda;
  return (sonde_tissue_scales){1, lambda * h, lambda * lambda * h * h};
}

static void linearise(sonde_scene_state *state, const sonde_tissue_scales *scales) {
  state->bulk_row_count = state->term_count = 0;
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    if (state->now.asleep[b]) continue;
    if (sonde_body_is_rigid(body)) {
      for (uint32_t k = 0; k < 2; ++k) {
        uint32_t s = body->first_slot + k;
        state->force[s] = state->product[s] = vec3(0, 0, 0);
      }
      state->matrix->diagonal[body->first_slot] = m_diag(body->mass.mass_kg);
      state->matrix->diagonal[body->first_slot + 1] = state->inertia[b].start;
      state->force[body->first_slot] = v_scale(state->scene->gravity_m_s2, body->mass.mass_kg);
      continue;
    }
    // The part of the matrix that belongs to one body.
    uint32_t first = body->first_slot;
    sonde_block_matrix part = {.row_count = body->node_count,
                               .pair_count = body->model ? body->model->topology.edge_count
                                                         : body->spring_count,
                               .diagonal = state->matrix->diagonal + first,
                               .upper = state->matrix->upper + body->first_pair,
                               .inverse = state->matrix->inverse + first};
    if (body->model) {
      part.pairs = (const uint32_t(*)[2])body->model->topology.edges;
      sonde_tissue_linearise(
          body->model, state->part[b].row_count < body->node_count ? &state->part[b] : NULL,
          state->stage_position + first, state->stage_velocity + first, scales,
          state->force + first, state->product + first, &part, state->tissue_nodes);
    } else if (body->solid)
      sonde_bulk_linearise(state->solid[b], state->stage_position + first,
                           state->stage_velocity + first, scales, state->force + first,
                           state->product + first, &part);
    else
      sonde_network_linearise(state, b, scales);
    // The forces of sleepers are not made anew.
    uint32_t count = body->model ? state->part[b].row_count : body->node_count;
    sonde_vec3 gravity = sonde_body_weighs(body) ? state->scene->gravity_m_s2 : vec3(0, 0, 0);
    for (uint32_t r = 0; r < count; ++r) {
      uint32_t i = body->model ? state->part[b].rows[r] : r;
      sonde_vec3 *f = &state->force[body->first_slot + i];
      *f = v_add(v_madd(*f, body->node_mass_kg[i], gravity), body->load_n[i]);
    }
  }
  state->bulk_terms = state->term_count;
}

static void evaluate(sonde_scene_state *state, double h, double moved_s) {
  SONDE_ASSERT(h > 0 && moved_s >= 0);
  sonde_tissue_scales scales = scales_of(state, h);
  double start = sonde_clock_now();
  do {
    sonde_touch_find(state, !(moved_s > 0));
  } while (sonde_sleep_wake_bodies(state));
  sonde_sleep_wake_touched(state);
  double found = sonde_clock_now();
  linearise(state, &scales);
  double linearised = sonde_clock_now();
  sonde_touch_evaluate(state, moved_s);
  state->report.assembly_s += linearised - found;
  state->report.contact_s += found - start + sonde_clock_now() - linearised;
}

static void solve(sonde_scene_state *state, sonde_vec3 *x) {
  double start = sonde_clock_now();
  const sonde_scene_step *step = &state->scene->step;
  // The diagonal blocks of the contact terms count for the preconditioner, but the matrix keeps its
  // own.
  sonde_block_matrix *matrix = state->matrix;
  sonde_active_set active = {state->active_rows, state->active_row_count, state->active_pairs,
                             state->active_pair_count};
  for (uint32_t r = 0; r < active.row_count; ++r)
    state->plain_diagonal[r] = matrix->diagonal[active.rows[r]];
  for (uint32_t t = 0; t < state->term_count; ++t) {
    const sonde_rank_one *term = &state->terms[t];
    for (uint32_t k = 0; k < term->count; ++k) {
      sonde_mat3 *block = &matrix->diagonal[term->rows[k]];
      *block = m_add(*block, m_rank1(term->g[k], term->scale, 0));
    }
  }
  sonde_block_invert_diagonal(matrix, &active);
  for (uint32_t r = 0; r < active.row_count; ++r)
    matrix->diagonal[active.rows[r]] = state->plain_diagonal[r];
  if (step->lambda > 0) {
    memset(state->scratch.q, 0, state->scene->slot_count * sizeof(sonde_vec3));
    sonde_pcg_result result = sonde_pcg_solve(matrix, &active, state->terms, state->term_count,
                                              state->residual, x, &state->scratch, &step->solver);
    state->report.solver_iterations += result.iterations;
    if (!result.converged) state->report.flags |= SONDE_SCENE_NOT_CONVERGED;
  } else {
    // Without stiffness the matrix is the mass: it is divided by block by block.
    for (uint32_t r = 0; r < state->active_row_count; ++r) {
      uint32_t i = state->active_rows[r];
      const double *d = matrix->inverse[i];
      sonde_vec3 b = state->residual[i];
      x[i] = vec3(d[0] * b.x + d[1] * b.y + d[2] * b.z, d[1] * b.x + d[3] * b.y + d[4] * b.z,
                  d[2] * b.x + d[4] * b.y + d[5] * b.z);
    }
  }
  state->report.solve_s += sonde_clock_now() - start;
}

static double norm_active(const sonde_scene_state *state, const sonde_vec3 *x) {
  double sum = 0;
  for (uint32_t r = 0; r < state->active_row_count; ++r) sum += v_norm2(x[state->active_rows[r]]);
  return sqrt(sum);
}

static double dot_active(const sonde_scene_state *state, const sonde_vec3 *x, const sonde_vec3 *y) {
  double sum = 0;
  for (uint32_t r = 0; r < state->active_row_count; ++r)
    sum += v_dot(x[state->active_rows[r]], y[state->active_rows[r]]);
  return sum;
}

// Mass times a vector: a number per node and per centre, the inertia at the start per spin.
static void form_residual(sonde_scene_state *state, const sonde_vec3 *dv, double h) {
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    bool rigid = sonde_body_is_rigid(body);
    if (state->now.asleep[b]) continue;
    uint32_t count = body->model ? state->part[b].row_count : body->slot_count;
    for (uint32_t r = 0; r < count; ++r) {
      uint32_t k = body->model ? state->part[b].rows[r] : r, i = body->first_slot + k;
      sonde_vec3 f = v_scale(v_add(state->force[i], state->contact_force[i]), h);
      if (rigid && k == 1)
        state->residual[i] = v_sub(f, m_mul_v(state->inertia[b].start, dv[i]));
      else
        state->residual[i] =
            v_madd(f, -(rigid ? body->mass.mass_kg : body->node_mass_kg[k]), dv[i]);
    }
  }
}

// From the evaluation at the start of the step (from NULL) or at the stage of `from` to the stage
// of dv.
static void moves_since(sonde_scene_state *state, const sonde_vec3 *from, const sonde_vec3 *dv,
                        double h) {
  double lambda = state->scene->step.lambda;
  for (uint32_t r = 0; r < state->moving_count; ++r) {
    uint32_t i = state->moving[r];
    sonde_vec3 more = from ? v_sub(dv[i], from[i]) : dv[i];
    sonde_vec3 base = from ? vec3(0, 0, 0) : state->now.velocity[i];
    state->gain[i] = v_scale(more, lambda);
    state->move[i] = v_scale(v_madd(base, lambda, more), lambda * h);
  }
}

static void evaluate_at(sonde_scene_state *state, const sonde_vec3 *dv, double h) {
  sonde_tissue_scales scales = scales_of(state, h);
  sonde_stage_at(state, dv, h);
  evaluate(state, h, state->scene->step.lambda * h);
  sonde_touch_gather(state, &scales);
  form_residual(state, dv, h);
}

static void move_active(const sonde_scene_state *state, sonde_vec3 *dv, double length) {
  for (uint32_t r = 0; r < state->active_row_count; ++r) {
    uint32_t i = state->active_rows[r];
    dv[i] = v_madd(dv[i], length, state->change[i]);
  }
}

// Further iterations after the linear step of eq. (4).
static void newton(sonde_scene_state *state, double h) {
  enum { MOST_HALVINGS = 8 };
  SONDE_ASSERT(h > 0);
  const sonde_scene_step *step = &state->scene->step;
  sonde_vec3 *dv = state->now.increment;
  double reference = norm_active(state, state->residual);
  evaluate_at(state, dv, h);
  for (uint32_t k = 1; k < step->newton_iterations; ++k) {
    double size = norm_active(state, state->residual);
    state->report.newton_residual = reference > 0 ? size / reference : 0;
    if (!(size > step->newton_residual * reference)) break;
    memset(state->change, 0, state->scene->slot_count * sizeof *state->change);
    solve(state, state->change);
    double slope = dot_active(state, state->residual, state->change), length = 1;
    move_active(state, dv, 1);
    // The slope of the incremental potential along p is -g.p. It starts at -slope < 0 and vanishes
    // at the minimum; a step past it by more than half is halved. Friction and dampers have no
    // potential, but their forces have this slope all the same.
    for (int halvings = 0;; ++halvings) {
      evaluate_at(state, dv, h);
      double now = dot_active(state, state->residual, state->change);
      bool overshot = now < -0.5 * slope || !isfinite(now);
      if (!step->line_search || !overshot || halvings == MOST_HALVINGS) break;
      length *= 0.5;
      move_active(state, dv, -length);
      state->report.line_halvings++;
    }
    state->report.newton_iterations++;
  }
  moves_since(state, dv, dv, h); // the last evaluation was where the step ended
  sonde_touch_predict(state);
}

static uint32_t island_of(const uint32_t *island, uint32_t b) {
  while (island[b] != b) b = island[b];
  return b;
}

// The sum of all equations of an island that nothing outside holds is its momentum: inner forces
// cancel. What the solver left of it is a translation, which K and C do not feel.
static void balance(sonde_scene_state *state, sonde_vec3 *dv, double h) {
  const sonde_scene *scene = state->scene;
  // Bodies joined by contacts share an island.
  for (uint32_t b = 0; b < scene->body_count; ++b) state->island[b] = b;
  for (uint32_t k = 0; k < state->near_touch_count; ++k) {
    uint32_t t = state->near_touch[k];
    if (!state->now.pair[t].point_count) continue;
    uint32_t a = island_of(state->island, scene->touches[t].a);
    uint32_t b = island_of(state->island, scene->touches[t].b);
    state->island[a > b ? a : b] = a > b ? b : a;
  }
  for (uint32_t k = 0; k < scene->pin_count; ++k) {
    uint32_t p = scene->pins[k].end[0].body, q = scene->pins[k].end[1].body;
    if (p == UINT32_MAX || q == UINT32_MAX) continue;
    uint32_t a = island_of(state->island, p), b = island_of(state->island, q);
    state->island[a > b ? a : b] = a > b ? b : a;
  }
  form_residual(state, dv, h);
  for (uint32_t root = 0; root < scene->body_count; ++root) {
    sonde_vec3 sum = vec3(0, 0, 0);
    double mass = 0;
    bool loose = state->island[root] == root;
    for (uint32_t b = root; b < scene->body_count && loose; ++b) {
      const sonde_body *body = &scene->bodies[b];
      if (island_of(state->island, b) != root) continue;
      loose = state->loose[b] && !state->now.asleep[b];
      mass += body->mass.mass_kg;
      uint32_t count = sonde_body_is_rigid(body) ? 1 : body->slot_count;
      for (uint32_t k = 0; k < count; ++k) sum = v_add(sum, state->residual[body->first_slot + k]);
    }
    for (uint32_t b = root; b < scene->body_count && loose; ++b) {
      const sonde_body *body = &scene->bodies[b];
      if (island_of(state->island, b) != root) continue;
      uint32_t count = sonde_body_is_rigid(body) ? 1 : body->slot_count;
      for (uint32_t k = 0; k < count; ++k)
        dv[body->first_slot + k] = v_madd(dv[body->first_slot + k], 1 / mass, sum);
    }
  }
}

void sonde_step_once(sonde_scene_state *state, double h) {
  SONDE_ASSERT(h > 0);
  sonde_scene_motion_copy(&state->undo, &state->now);
  sonde_sleep_begin(state);
  sonde_rigid_begin(state, h);
  sonde_stage_start(state);
  evaluate(state, h, 0);
  // The linear step solves eq. (4); where a push would pull at its end, it is dropped and the step
  // is solved anew.
  enum { PASSES = 4 };
  sonde_tissue_scales scales = scales_of(state, h);
  sonde_vec3 *dv = state->now.increment;
  for (int pass = 0; pass < PASSES; ++pass) {
    sonde_touch_gather(state, &scales);
    // b = h (F0 - lambda h K v0)
    double scale = -h * h * state->scene->step.lambda;
    for (uint32_t r = 0; r < state->active_row_count; ++r) {
      uint32_t i = state->active_rows[r];
      sonde_vec3 f = v_add(state->force[i], state->contact_force[i]);
      sonde_vec3 kv = v_add(state->product[i], state->contact_product[i]);
      state->residual[i] = v_madd(v_scale(f, h), scale, kv);
    }
    solve(state, dv);
    moves_since(state, NULL, dv, h);
    uint32_t dropped = sonde_touch_predict(state);
    if (!dropped || !(scales.damping > 0)) break;
  }
  state->report.newton_iterations++;
  if (state->scene->step.newton_iterations > 1 && state->scene->step.lambda > 0) newton(state, h);
  if (state->scene->step.lambda > 0) balance(state, state->now.increment, h);
  const sonde_scene_step *step = &state->scene->step;
  double lambda = step->symplectic ? 1 : step->lambda;
  for (uint32_t r = 0; r < state->moving_count; ++r) {
    uint32_t i = state->moving[r];
    state->mean_velocity[i] = v_madd(state->now.velocity[i], lambda, state->now.increment[i]);
  }
  sonde_touch_finish(state, h);
  bool finite = true;
  for (uint32_t k = 0; k < state->near_touch_count; ++k) {
    const sonde_pair_measure *pair = &state->now.pair[state->near_touch[k]];
    finite &= v_finite(pair->force_n) && v_finite(pair->torque_n_m);
  }
  finite = sonde_stage_finish(state, state->now.increment, h) && finite;
  state->report.awake = state->active_row_count;
  if (!finite) {
    // The bodies stand still where the step began, with their contacts forgotten.
    sonde_scene_motion_head head = *state->now.head;
    sonde_scene_motion_copy(&state->now, &state->undo);
    state->listed = false;
    state->now.head->time_s = head.time_s + h;
    state->now.head->flag_count = head.flag_count;
    state->now.head->all_flags = head.all_flags;
    size_t bytes = state->scene->slot_count * sizeof(sonde_vec3);
    memset(state->now.velocity, 0, bytes);
    memset(state->now.increment, 0, bytes);
    memset(state->now.calm, 0, state->scene->slot_count);
    memset(state->now.asleep, 0, state->scene->body_count);
    sonde_scene_motion_unbond(&state->now);
    memset(state->now.bond_first, 0, state->scene->touch_count * sizeof *state->now.bond_first);
    for (uint32_t t = 0; t < state->scene->touch_count; ++t)
      state->now.pair[t] = (sonde_pair_measure){0};
    state->report.flags |= SONDE_SCENE_NON_FINITE;
    return;
  }
  state->now.head->time_s += h;
  sonde_sleep_rest(state, h);
}
