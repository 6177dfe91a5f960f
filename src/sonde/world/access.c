// Reading, resetting and waking the moving state. No allocation: callable on the tick path.
#include "tissue/two_layer.h"
#include "world/lanes.h"
#include "world/state.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

void sonde_state_publish(sonde_state *state) {
  if (state->lanes && !state->lanes->stale)
    sonde_lanes_publish(state->lanes, state->model->surface.vertices, state->position,
                        state->velocity);
}

void sonde_state_wake_all(sonde_state *state) {
  uint32_t n = state->model->surface.vertex_count;
  memset(state->awake, 1, n);
  memset(state->calm, 0, n);
  if (state->lanes) state->lanes->stale = true;
  sonde_state_list_awake(state);
}

static void add_rim(sonde_state *state, uint32_t i) {
  if (state->awake[i] || state->in_rim[i]) return;
  state->in_rim[i] = 1;
  state->rim[state->rim_count++] = i;
}

void sonde_state_list_awake(sonde_state *state) {
  const sonde_topology *topology = &state->model->topology;
  for (uint32_t k = 0; k < state->rim_count; ++k) state->in_rim[state->rim[k]] = 0;
  state->row_count = state->edge_count = state->pair_count = 0;
  state->face_count = state->rim_count = 0;
  state->lists_stale = false;
  for (uint32_t i = 0; i < topology->vertex_count; ++i) {
    state->rows[state->row_count] = i;
    state->row_count += state->awake[i];
  }
  for (uint32_t e = 0; e < topology->edge_count; ++e) {
    uint32_t i = topology->edges[e][0], j = topology->edges[e][1];
    uint8_t a = state->awake[i], b = state->awake[j];
    if (!(a | b)) continue;
    state->edges[state->edge_count++] = e;
    if (a & b)
      state->pairs[state->pair_count++] = e;
    else
      add_rim(state, a ? j : i);
  }
  // Faces are for the layers only.
  const sonde_mesh *skin = &state->model->surface;
  uint32_t face_count = sonde_tissue_is_layered(&state->model->law) ? skin->face_count : 0;
  for (uint32_t f = 0; f < face_count; ++f) {
    const uint32_t *v = skin->faces[f];
    state->faces[state->face_count] = f;
    state->face_count += state->awake[v[0]] | state->awake[v[1]] | state->awake[v[2]];
  }
}

void sonde_state_reset(sonde_state *state) {
  uint32_t n = state->model->surface.vertex_count;
  // As rest + displacement gives them: a coordinate of -0 would hash differently once it is
  // restored.
  for (uint32_t i = 0; i < n; ++i)
    state->position[i] = v_add(state->model->surface.vertices[i], vec3(0, 0, 0));
  memcpy(state->probed, state->model->surface.vertices, n * sizeof *state->probed);
  memset(state->velocity, 0, n * sizeof *state->velocity);
  memset(state->increment, 0, n * sizeof *state->increment);
  memset(state->contact_force, 0, n * sizeof *state->contact_force);
  memset(state->share_m3, 0, n * sizeof *state->share_m3);
  memset(state->gradient, 0, n * sizeof *state->gradient);
  memset(state->awake, state->def.sleep_displacement_m > 0 ? 0 : 1, n);
  memset(state->calm, SONDE_CALM_TICKS, n);
  state->tick = 0;
  state->touched_count = state->touched_face_count = 0;
  state->has_probe_pose = false;
  state->solver = (sonde_pcg_result){.converged = true};
  state->flags = 0;
  state->times = (sonde_stage_times){0};
  sonde_contact_clear(state);
  sonde_state_list_awake(state);
  if (state->lanes)
    sonde_lanes_import(state->lanes, state->position, state->position, state->velocity,
                       !(state->def.sleep_displacement_m > 0));
}

void sonde_state_relax(sonde_state *state) {
  uint64_t tick = state->tick, count = state->flag_count;
  sonde_state_reset(state);
  state->tick = tick;
  state->flag_count = count;
}

const sonde_model *sonde_state_model(const sonde_state *state) { return state->model; }
const sonde_world_def *sonde_state_def(const sonde_state *state) { return &state->def; }
uint64_t sonde_state_tick(const sonde_state *state) { return state->tick; }
double sonde_state_time(const sonde_state *state) { return (double)state->tick * state->def.dt_s; }
const sonde_vec3 *sonde_state_positions(sonde_state *state) {
  sonde_state_publish(state);
  return state->position;
}
const sonde_vec3 *sonde_state_velocities(sonde_state *state) {
  sonde_state_publish(state);
  return state->velocity;
}
const sonde_contact *sonde_state_contact(const sonde_state *state) { return &state->contact; }
const sonde_vec3 *sonde_state_contact_forces(const sonde_state *state) {
  return state->contact_force;
}
sonde_pcg_result sonde_state_solver(const sonde_state *state) { return state->solver; }
uint32_t sonde_state_awake(const sonde_state *state) { return state->row_count; }
uint32_t sonde_state_flags(const sonde_state *state) { return state->flags; }
uint64_t sonde_state_flag_count(const sonde_state *state) { return state->flag_count; }
sonde_stage_times sonde_state_times(const sonde_state *state) { return state->times; }

void sonde_state_set(sonde_state *state, const sonde_vec3 *positions,
                     const sonde_vec3 *velocities) {
  size_t bytes = state->model->surface.vertex_count * sizeof *state->position;
  sonde_state_publish(state);
  if (positions) memcpy(state->position, positions, bytes);
  if (velocities) memcpy(state->velocity, velocities, bytes);
  memset(state->increment, 0, bytes);
  memcpy(state->probed, state->position, bytes);
  sonde_state_wake_all(state);
}

uint64_t sonde_state_bytes_moved(const sonde_state *state) {
  return state->lanes ? state->lanes->bytes_moved : 0;
}

uint64_t sonde_state_hash(sonde_state *state) {
  size_t bytes = state->model->surface.vertex_count * sizeof *state->position;
  sonde_state_publish(state);
  uint64_t hash = sonde_hash(0, &state->tick, sizeof state->tick);
  hash = sonde_hash(hash, state->position, bytes);
  return sonde_hash(hash, state->velocity, bytes);
}
