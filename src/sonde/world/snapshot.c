// Restoring a saved state: a blob is checked before anything changes.
#include "world/snapshot.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static sonde_status check_head(const sonde_state *state, const sonde_snapshot_head *head,
                               sonde_error *error) {
  bool mine = memcmp(head->magic, "SNDSTATE", sizeof head->magic) == 0 &&
              head->version == SONDE_SNAPSHOT_VERSION && head->head_bytes == sizeof *head;
  bool pose = v_finite(head->probe_pose.position);
  if (!mine || head->doubles > 1 || head->has_probe_pose > 1 || !pose ||
      head->contact.region_count > SONDE_MAX_REGIONS || head->awake_nodes > head->nodes)
    return sonde_fail(error, SONDE_FORMAT, "not a saved state of this version");
  if (head->nodes != state->nodes.count || head->batches != state->engine->batch_count ||
      head->model_checksum != state->model->checksum || head->engine != state->def.engine ||
      head->contact_law != state->def.contact_law ||
      memcmp(&head->dt_s, &state->def.dt_s, sizeof head->dt_s) != 0)
    return sonde_fail(error, SONDE_MISMATCH,
                      "a saved state of %u nodes, engine %u, step %g s does not fit this one (%u, "
                      "%u, %g s) or its model",
                      head->nodes, head->engine, head->dt_s, state->nodes.count,
                      (unsigned)state->def.engine, state->def.dt_s);
  if (head->touched > head->nodes)
    return sonde_fail(error, SONDE_FORMAT, "the saved state lacks its nodes");
  return SONDE_OK;
}

static sonde_snapshot_touched touched_at(const char *from, uint32_t k) {
  sonde_snapshot_touched node;
  memcpy(&node, from + k * sizeof node, sizeof node);
  return node;
}

static sonde_status check_parts(const sonde_state *state, const sonde_snapshot_head *head,
                                const sonde_snapshot_parts *parts, const char *from,
                                sonde_error *error) {
  bool good = true;
  uint64_t least = 0;
  for (uint32_t k = 0; k < head->touched; ++k) {
    uint64_t node = touched_at(from + parts->touched, k).node;
    good = good && node >= least && node < head->nodes;
    least = node + 1;
  }
  uint32_t batches = state->engine->batch_count;
  for (uint32_t s = 0; s < batches; ++s) good = good && (unsigned char)from[parts->awake + s] <= 1;
  if (good) return SONDE_OK;
  return sonde_fail(error, SONDE_FORMAT, "the saved state is damaged");
}

static void restore_motion(sonde_state *state, const sonde_snapshot_parts *parts, const char *from,
                           bool doubles) {
  sonde_engine_data *engine = state->engine;
  size_t count = engine->batch_count, bytes = engine->node_count * sizeof *state->position;
  SONDE_ASSERT(engine->motion_bytes <= engine->batch_bytes);
  if (doubles) {
    memcpy(state->position, from + parts->position, bytes);
    memcpy(state->velocity, from + parts->velocity, bytes);
  }
  memset(engine->batches, 0, count * engine->batch_bytes);
  for (size_t s = 0; s < count; ++s)
    memcpy(engine->batches + s * engine->batch_bytes,
           from + parts->motion + s * engine->motion_bytes, engine->motion_bytes);
  memcpy(engine->is_awake, from + parts->awake, count);
  memcpy(engine->calm, from + parts->calm, count);
  memcpy(engine->speed2, from + parts->speed2, count * engine->real_bytes);
  memcpy(engine->moved2, from + parts->moved2, count * engine->real_bytes);
  memset(engine->published, 0, count);
  engine->calls->refresh(engine);
  engine->stale = doubles;
}

// Forgets the contact at hand; nodes that the saved contact does not touch have none.
static void restore_touched(sonde_state *state, const sonde_snapshot_head *head, const char *from) {
  size_t n = state->nodes.count;
  memset(state->share_m3, 0, n * sizeof *state->share_m3);
  memset(state->gradient, 0, n * sizeof *state->gradient);
  memset(state->contact_force, 0, n * sizeof *state->contact_force);
  memset(state->bond_m, 0, n * sizeof *state->bond_m);
  memset(state->grip_n, 0, n * sizeof *state->grip_n);
  memset(state->grip_tick, 0, n * sizeof *state->grip_tick);
  for (uint32_t k = 0; k < head->touched; ++k) {
    sonde_snapshot_touched node = touched_at(from, k);
    uint32_t i = (uint32_t)node.node;
    state->touched[k] = i;
    state->share_m3[i] = node.share_m3, state->gradient[i] = node.gradient;
    state->contact_force[i] = node.contact_force;
    state->bond_m[i] = node.bond_m, state->grip_n[i] = node.grip_n;
    state->grip_tick[i] = node.grip_tick;
  }
  state->touched_count = head->touched;
}

sonde_status sonde_state_restore(sonde_state *state, const void *blob, size_t bytes,
                                 sonde_error *error) {
  SONDE_ASSERT(state != NULL && blob != NULL);
  sonde_snapshot_head head;
  if (bytes < sizeof head)
    return sonde_fail(error, SONDE_FORMAT, "a saved state of %zu bytes has no head", bytes);
  memcpy(&head, blob, sizeof head);
  sonde_status status = check_head(state, &head, error);
  if (status) return status;
  sonde_snapshot_parts parts = sonde_snapshot_layout(state, head.doubles, head.touched);
  if (parts.end != bytes)
    return sonde_fail(error, SONDE_FORMAT, "a saved state of %zu bytes, expected %zu", bytes,
                      parts.end);
  status = check_parts(state, &head, &parts, blob, error);
  if (!status) status = sonde_state_set_friction(state, &head.friction, error);
  if (status) return status;
  restore_touched(state, &head, (const char *)blob + parts.touched);
  state->tick = head.tick, state->flag_count = head.flag_count;
  state->flags = head.flags, state->mu = head.mu;
  state->probe_pose = head.probe_pose;
  state->has_probe_pose = head.has_probe_pose;
  state->contact = head.contact, state->solver = head.solver;
  state->times = (sonde_stage_times){0};
  restore_motion(state, &parts, blob, head.doubles);
  sonde_state_publish(state);
  state->awake_nodes = head.awake_nodes;
  return SONDE_OK;
}

// The numbers that an engine publishes, from batches of `nodes` floats or doubles.
static uint64_t hash_batches(const sonde_model *model, const char *batches, bool fast,
                             uint64_t hash) {
  const sonde_nodes all = sonde_model_nodes(model);
  uint32_t n = all.count, nodes = fast ? 16 : 8;
  size_t real_bytes = fast ? sizeof(float) : sizeof(double);
  for (int part = 0; part < 2; ++part)
    for (uint32_t i = 0; i < n; ++i) {
      double at[3];
      for (uint32_t c = 0; c < 3; ++c) {
        uint32_t place = (i / nodes * 9 + 3 * (uint32_t)part + c) * nodes + i % nodes;
        const char *number = batches + place * real_bytes;
        float narrow;
        memcpy(fast ? (void *)&narrow : (void *)&at[c], number, real_bytes);
        if (fast) at[c] = (double)narrow;
      }
      sonde_vec3 v = vec3(at[0], at[1], at[2]);
      if (part == 0) v = v_add(all.rest[i], v);
      hash = sonde_hash(hash, &v, sizeof v);
    }
  return hash;
}

uint64_t sonde_state_saved_hash(const sonde_model *model, const void *blob) {
  sonde_snapshot_head head;
  memcpy(&head, blob, sizeof head);
  SONDE_ASSERT(memcmp(head.magic, "SNDSTATE", sizeof head.magic) == 0);
  SONDE_ASSERT(head.nodes == sonde_model_nodes(model).count);
  bool fast = head.engine == SONDE_ENGINE_FAST;
  uint64_t hash = sonde_hash(0, &head.tick, sizeof head.tick);
  const char *from = (const char *)blob;
  if (!head.doubles)
    return hash_batches(model, from + sonde_snapshot_round(sizeof head), fast, hash);
  sonde_engine_data engine = {.node_count = head.nodes,
                              .batch_count = head.batches,
                              .motion_bytes = 9 * 64, // u, v, ve
                              .real_bytes = fast ? sizeof(float) : sizeof(double)};
  sonde_snapshot_parts parts =
      sonde_snapshot_layout(&(sonde_state){.engine = &engine}, true, head.touched);
  size_t bytes = head.nodes * sizeof(sonde_vec3);
  hash = sonde_hash(hash, from + parts.position, bytes);
  return sonde_hash(hash, from + parts.velocity, bytes);
}
