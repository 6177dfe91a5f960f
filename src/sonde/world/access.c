// Reading, resetting and waking the moving state. No allocation: callable on the tick path.
#include "world/engine.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

void sonde_state_publish(sonde_state *state) {
  if (!state->engine->stale)
    state->engine->calls->publish(state->engine, state->nodes.rest, state->position,
                                  state->velocity);
}

void sonde_state_wake_all(sonde_state *state) {
  state->engine->stale = true;
  state->awake_nodes = state->nodes.count;
}

void sonde_state_reset(sonde_state *state) {
  uint32_t n = state->nodes.count;
  SONDE_ASSERT(n > 0);
  // As rest + displacement gives them: a coordinate of -0 would hash differently once it is
  // restored.
  for (uint32_t i = 0; i < n; ++i) state->position[i] = v_add(state->nodes.rest[i], vec3(0, 0, 0));
  memcpy(state->probed, state->nodes.rest, n * sizeof *state->probed);
  memset(state->velocity, 0, n * sizeof *state->velocity);
  memset(state->contact_force, 0, n * sizeof *state->contact_force);
  memset(state->share_m3, 0, n * sizeof *state->share_m3);
  memset(state->gradient, 0, n * sizeof *state->gradient);
  state->tick = 0;
  state->touched_count = 0;
  state->has_probe_pose = false;
  state->solver = (sonde_pcg_result){.converged = true};
  state->flags = 0;
  state->times = (sonde_stage_times){0};
  sonde_contact_clear(state);
  bool awake = !(state->def.sleep_displacement_m > 0);
  state->awake_nodes = awake ? n : 0;
  state->engine->calls->import(state->engine, state->position, state->position, state->velocity,
                               awake);
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
uint32_t sonde_state_awake(const sonde_state *state) { return state->awake_nodes; }
uint32_t sonde_state_flags(const sonde_state *state) { return state->flags; }
uint64_t sonde_state_flag_count(const sonde_state *state) { return state->flag_count; }
sonde_stage_times sonde_state_times(const sonde_state *state) { return state->times; }

void sonde_state_set(sonde_state *state, const sonde_vec3 *positions,
                     const sonde_vec3 *velocities) {
  size_t bytes = state->nodes.count * sizeof *state->position;
  sonde_state_publish(state);
  if (positions) memcpy(state->position, positions, bytes);
  if (velocities) memcpy(state->velocity, velocities, bytes);
  sonde_state_wake_all(state);
}

uint64_t sonde_state_bytes_moved(const sonde_state *state) { return state->engine->bytes_moved; }

uint64_t sonde_state_hash(sonde_state *state) {
  size_t bytes = state->nodes.count * sizeof *state->position;
  sonde_state_publish(state);
  uint64_t hash = sonde_hash(0, &state->tick, sizeof state->tick);
  hash = sonde_hash(hash, state->position, bytes);
  return sonde_hash(hash, state->velocity, bytes);
}
