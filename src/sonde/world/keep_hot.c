// Saving the moving state between two steps. Copies only.
// save_slices:      of the fast engine.
// save_doubles:     of the other one, or where the doubles are newer than the slices.
// save_touched:     what belongs to the nodes that the probe touches.
// sonde_state_save: all of it.
#include "world/keep.h"

#include "base/base.h"

#include <string.h>

static void save_slices(const sonde_lanes *lanes, const sonde_keep_parts *parts, char *to) {
  SONDE_ASSERT(offsetof(sonde_slice, ve) + 3 * sizeof(sonde_lane) == SONDE_KEEP_SLICE);
  size_t count = lanes->slice_count;
  for (size_t s = 0; s < count; ++s)
    memcpy(to + parts->slices + s * SONDE_KEEP_SLICE, &lanes->slice[s], SONDE_KEEP_SLICE);
  memcpy(to + parts->awake, lanes->is_awake, count);
  memcpy(to + parts->calm, lanes->calm, count);
  memcpy(to + parts->speed2, lanes->speed2, count * sizeof *lanes->speed2);
  memcpy(to + parts->way2, lanes->way2, count * sizeof *lanes->way2);
}

static void save_doubles(const sonde_state *state, const sonde_keep_parts *parts, char *to) {
  size_t n = state->model->surface.vertex_count, bytes = n * sizeof *state->position;
  memcpy(to + parts->position, state->position, bytes);
  memcpy(to + parts->velocity, state->velocity, bytes);
  memcpy(to + parts->increment, state->increment, bytes);
  memcpy(to + parts->node_awake, state->awake, n);
  memcpy(to + parts->node_calm, state->calm, n);
  memcpy(to + parts->box, state->boxes, state->block_count * sizeof *state->boxes);
}

static void save_touched(const sonde_state *state, char *to) {
  for (uint32_t k = 0; k < state->touched_count; ++k) {
    uint32_t i = state->touched[k];
    sonde_keep_touched node = {.node = i,
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
  return sonde_keep_layout(state, true, state->model->surface.vertex_count).end;
}

size_t sonde_state_save(const sonde_state *state, void *blob) {
  SONDE_ASSERT(state != NULL && blob != NULL);
  SONDE_ASSERT(((uintptr_t)blob & 7) == 0);
  bool doubles = !state->lanes || state->lanes->stale;
  sonde_keep_parts parts = sonde_keep_layout(state, doubles, state->touched_count);
  sonde_keep_head head;
  memset(&head, 0, sizeof head);
  memcpy(head.magic, "SNDSTATE", sizeof head.magic);
  head.version = SONDE_KEEP_VERSION, head.head_bytes = sizeof head;
  head.model_checksum = state->model->checksum;
  head.nodes = state->model->surface.vertex_count, head.blocks = state->block_count;
  head.engine = state->def.engine, head.contact_law = state->def.contact_law;
  head.tick = state->tick, head.flag_count = state->flag_count;
  head.doubles = doubles, head.touched = state->touched_count;
  head.has_probe_pose = state->has_probe_pose, head.flags = state->flags;
  head.row_count = state->row_count;
  head.dt_s = state->def.dt_s, head.mu = state->mu;
  head.probe_pose = state->probe_pose, head.friction = state->def.friction;
  head.contact = state->contact, head.solver = state->solver;
  memcpy(blob, &head, sizeof head);
  if (state->lanes) save_slices(state->lanes, &parts, blob);
  if (doubles) save_doubles(state, &parts, blob);
  save_touched(state, (char *)blob + parts.touched);
  return parts.end;
}
