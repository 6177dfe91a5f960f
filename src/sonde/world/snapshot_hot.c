// Saving the moving state between two steps. Copies only.
#include "world/snapshot.h"

#include "base/base.h"

#include <string.h>

static void save_touched(const sonde_state *state, char *to) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_snapshot_touched node = {.node = i,
                                   .grip_tick = state->grip_tick[i],
                                   .share_m3 = state->share_m3[i],
                                   .gradient = state->gradient[i],
                                   .contact_force = state->contact_force[i],
                                   .bond_m = state->bond_m[i],
                                   .grip_n = state->grip_n[i]};
    memcpy(to + k * sizeof node, &node, sizeof node);
  }
}

size_t sonde_state_size(const sonde_state *state) {
  SONDE_ASSERT(state != NULL);
  return sonde_snapshot_layout(state, true, state->nodes.count).end;
}

size_t sonde_state_save(const sonde_state *state, void *blob) {
  SONDE_ASSERT(state != NULL && blob != NULL);
  SONDE_ASSERT(((uintptr_t)blob & 7) == 0);
  const sonde_engine_data *engine = state->engine;
  size_t count = engine->batch_count, bytes = engine->node_count * sizeof *state->position;
  bool doubles = engine->stale;
  sonde_snapshot_parts parts = sonde_snapshot_layout(state, doubles, state->touched_count);
  sonde_snapshot_head head;
  memset(&head, 0, sizeof head);
  memcpy(head.magic, "SNDSTATE", sizeof head.magic);
  head.version = SONDE_SNAPSHOT_VERSION, head.head_bytes = sizeof head;
  head.model_checksum = state->model->checksum;
  head.nodes = state->nodes.count, head.batches = engine->batch_count;
  head.engine = state->def.engine, head.contact_law = state->def.contact_law;
  head.tick = state->tick, head.flag_count = state->flag_count;
  head.doubles = doubles, head.touched = state->touched_count;
  head.has_probe_pose = state->has_probe_pose, head.flags = state->flags;
  head.awake_nodes = state->awake_nodes;
  head.dt_s = state->def.dt_s, head.mu = state->mu;
  head.probe_pose = state->probe_pose, head.friction = state->def.friction;
  head.contact = state->contact, head.solver = state->solver;
  memcpy(blob, &head, sizeof head);
  char *to = blob;
  for (size_t s = 0; s < count; ++s)
    memcpy(to + parts.motion + s * engine->motion_bytes, engine->batches + s * engine->batch_bytes,
           engine->motion_bytes);
  memcpy(to + parts.awake, engine->is_awake, count);
  memcpy(to + parts.calm, engine->calm, count);
  memcpy(to + parts.speed2, engine->speed2, count * engine->real_bytes);
  memcpy(to + parts.moved2, engine->moved2, count * engine->real_bytes);
  if (doubles) {
    memcpy(to + parts.position, state->position, bytes);
    memcpy(to + parts.velocity, state->velocity, bytes);
  }
  save_touched(state, (char *)blob + parts.touched);
  return parts.end;
}
