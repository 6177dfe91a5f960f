// Going on where a state was saved; cold.
// check_head, check_touched: the blob belongs to this state and is whole.
// restore_slices, restore_doubles, restore_touched: the parts.
// sonde_state_restore:       all of it.
// sonde_state_saved_hash:    sonde_state_hash() of the saved state.
#include "world/keep.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static sonde_status check_head(const sonde_state *state, const sonde_keep_head *head,
                               sonde_error *error) {
  bool mine = memcmp(head->magic, "SNDSTATE", sizeof head->magic) == 0 &&
              head->version == SONDE_KEEP_VERSION && head->head_bytes == sizeof *head;
  bool pose = v_finite(head->probe_pose.position);
  if (!mine || head->doubles > 1 || head->has_probe_pose > 1 || !pose ||
      head->contact.region_count > SONDE_MAX_REGIONS || head->row_count > head->nodes)
    return sonde_fail(error, SONDE_FORMAT, "not a saved state of this version");
  if (head->nodes != state->model->surface.vertex_count || head->blocks != state->block_count ||
      head->model_checksum != state->model->checksum || head->engine != state->def.engine ||
      head->contact_law != state->def.contact_law ||
      memcmp(&head->dt_s, &state->def.dt_s, sizeof head->dt_s) != 0)
    return sonde_fail(error, SONDE_MISMATCH,
                      "a saved state of %u nodes, engine %u, step %g s does not fit this one (%u, "
                      "%u, %g s) or its model",
                      head->nodes, head->engine, head->dt_s, state->model->surface.vertex_count,
                      (unsigned)state->def.engine, state->def.dt_s);
  if (head->touched > head->nodes || (!state->lanes && !head->doubles))
    return sonde_fail(error, SONDE_FORMAT, "the saved state lacks its nodes");
  return SONDE_OK;
}

static sonde_keep_touched touched_at(const char *from, uint32_t k) {
  sonde_keep_touched node;
  memcpy(&node, from + k * sizeof node, sizeof node);
  return node;
}

static sonde_status check_parts(const sonde_state *state, const sonde_keep_head *head,
                                const sonde_keep_parts *parts, const char *from,
                                sonde_error *error) {
  bool good = true;
  uint64_t least = 0;
  for (uint32_t k = 0; k < head->touched; ++k) {
    uint64_t node = touched_at(from + parts->touched, k).node;
    good = good && node >= least && node < head->nodes;
    least = node + 1;
  }
  uint32_t slices = state->lanes ? state->lanes->slice_count : 0;
  for (uint32_t s = 0; s < slices; ++s) good = good && (unsigned char)from[parts->awake + s] <= 1;
  for (uint32_t i = 0; head->doubles && i < head->nodes; ++i)
    good = good && (unsigned char)from[parts->node_awake + i] <= 1;
  if (good) return SONDE_OK;
  return sonde_fail(error, SONDE_FORMAT, "the saved state is damaged");
}

static void restore_slices(sonde_state *state, const sonde_keep_parts *parts, const char *from,
                           bool stale) {
  sonde_lanes *lanes = state->lanes;
  size_t count = lanes->slice_count, rows = count * SONDE_LANES;
  for (size_t s = 0; s < count; ++s) {
    memset(&lanes->slice[s], 0, sizeof lanes->slice[s]);
    memcpy(&lanes->slice[s], from + parts->slices + s * SONDE_KEEP_SLICE, SONDE_KEEP_SLICE);
  }
  memcpy(lanes->is_awake, from + parts->awake, count);
  memcpy(lanes->calm, from + parts->calm, count);
  memcpy(lanes->speed2, from + parts->speed2, count * sizeof *lanes->speed2);
  memcpy(lanes->way2, from + parts->way2, count * sizeof *lanes->way2);
  memset(lanes->published, 0, count);
  sonde_lanes_still(lanes, 0, lanes->slice_count);
  for (uint32_t i = 0; i < rows; ++i) sonde_lanes_record(lanes, i);
  lanes->stale = stale;
}

static void restore_doubles(sonde_state *state, const sonde_keep_parts *parts, const char *from) {
  size_t n = state->model->surface.vertex_count, bytes = n * sizeof *state->position;
  memcpy(state->position, from + parts->position, bytes);
  memcpy(state->velocity, from + parts->velocity, bytes);
  memcpy(state->increment, from + parts->increment, bytes);
  memcpy(state->awake, from + parts->node_awake, n);
  memcpy(state->calm, from + parts->node_calm, n);
  memcpy(state->boxes, from + parts->box, state->block_count * sizeof *state->boxes);
}

// Forgets the contact at hand; nodes that the saved contact does not touch have none.
static void restore_touched(sonde_state *state, const sonde_keep_head *head, const char *from) {
  size_t n = state->model->surface.vertex_count;
  memset(state->share_m3, 0, n * sizeof *state->share_m3);
  memset(state->gradient, 0, n * sizeof *state->gradient);
  memset(state->contact_force, 0, n * sizeof *state->contact_force);
  memset(state->bond_m, 0, n * sizeof *state->bond_m);
  memset(state->grip_n, 0, n * sizeof *state->grip_n);
  memset(state->grip_tick, 0, n * sizeof *state->grip_tick);
  for (uint32_t k = 0; k < head->touched; ++k) {
    sonde_keep_touched node = touched_at(from, k);
    uint32_t i = (uint32_t)node.node;
    state->touched[k] = i;
    state->share_m3[i] = node.share_m3, state->gradient[i] = node.gradient;
    state->contact_force[i] = node.contact_force;
    state->bond_m[i] = node.bond_m, state->grip_n[i] = node.grip_n;
    state->grip_tick[i] = node.grip_tick;
  }
  state->touched_count = head->touched;
  state->touched_face_count = state->term_count = 0;
}

static void restore_head(sonde_state *state, const sonde_keep_head *head) {
  state->tick = head->tick, state->flag_count = head->flag_count;
  state->flags = head->flags, state->mu = head->mu;
  state->probe_pose = head->probe_pose;
  state->has_probe_pose = head->has_probe_pose;
  state->contact = head->contact, state->solver = head->solver;
  state->times = (sonde_stage_times){0};
}

sonde_status sonde_state_restore(sonde_state *state, const void *blob, size_t bytes,
                                 sonde_error *error) {
  SONDE_ASSERT(state != NULL && blob != NULL);
  sonde_keep_head head;
  if (bytes < sizeof head)
    return sonde_fail(error, SONDE_FORMAT, "a saved state of %zu bytes has no head", bytes);
  memcpy(&head, blob, sizeof head);
  sonde_status status = check_head(state, &head, error);
  if (status) return status;
  sonde_keep_parts parts = sonde_keep_layout(state, head.doubles, head.touched);
  if (parts.end != bytes)
    return sonde_fail(error, SONDE_FORMAT, "a saved state of %zu bytes, expected %zu", bytes,
                      parts.end);
  status = check_parts(state, &head, &parts, blob, error);
  if (!status) status = sonde_state_set_friction(state, &head.friction, error);
  if (status) return status;
  restore_touched(state, &head, (const char *)blob + parts.touched);
  restore_head(state, &head);
  if (head.doubles) restore_doubles(state, &parts, blob);
  if (state->lanes) restore_slices(state, &parts, blob, head.doubles);
  if (!state->lanes || head.doubles) sonde_state_list_awake(state);
  sonde_state_publish(state);
  memcpy(state->probed, state->position, head.nodes * sizeof *state->probed);
  state->row_count = head.row_count;
  return SONDE_OK;
}

// The numbers that sonde_lanes_publish() writes.
static uint64_t hash_slices(const sonde_model *model, const char *slices, uint64_t hash) {
  uint32_t n = model->surface.vertex_count;
  float motion[2 * 3 * SONDE_LANES];
  for (int part = 0; part < 2; ++part)
    for (uint32_t i = 0; i < n; ++i) {
      uint32_t l = i % SONDE_LANES;
      if (l == 0) memcpy(motion, slices + i / SONDE_LANES * SONDE_KEEP_SLICE, sizeof motion);
      const float *at = motion + part * 3 * SONDE_LANES + l;
      sonde_vec3 v = vec3((double)at[0], (double)at[SONDE_LANES], (double)at[2 * SONDE_LANES]);
      if (part == 0) v = v_add(model->surface.vertices[i], v);
      hash = sonde_hash(hash, &v, sizeof v);
    }
  return hash;
}

uint64_t sonde_state_saved_hash(const sonde_model *model, const void *blob) {
  sonde_keep_head head;
  memcpy(&head, blob, sizeof head);
  SONDE_ASSERT(memcmp(head.magic, "SNDSTATE", sizeof head.magic) == 0);
  SONDE_ASSERT(head.nodes == model->surface.vertex_count);
  uint64_t hash = sonde_hash(0, &head.tick, sizeof head.tick);
  uint32_t slices = (head.nodes + SONDE_LANES - 1) / SONDE_LANES;
  const char *from = (const char *)blob + sonde_keep_round(sizeof head);
  if (!head.doubles) return hash_slices(model, from, hash);
  sonde_lanes lanes = {.slice_count = slices};
  sonde_state like = {.model = model, .block_count = head.blocks};
  if (head.engine == SONDE_ENGINE_FAST) like.lanes = &lanes;
  sonde_keep_parts parts = sonde_keep_layout(&like, true, head.touched);
  size_t bytes = head.nodes * sizeof(sonde_vec3);
  hash = sonde_hash(hash, (const char *)blob + parts.position, bytes);
  return sonde_hash(hash, (const char *)blob + parts.velocity, bytes);
}
