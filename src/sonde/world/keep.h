// A saved state: a head, then the arrays of the engine, then what the probe touches. Every part
// starts at a multiple of 8 bytes.
#ifndef SONDE_SRC_KEEP_H
#define SONDE_SRC_KEEP_H

#include "world/lanes.h"
#include "world/state.h"

enum { SONDE_KEEP_VERSION = 1 };

typedef struct sonde_keep_head {
  char magic[8]; // "SNDSTATE"
  uint32_t version, head_bytes;
  uint64_t model_checksum;
  uint32_t nodes, blocks, engine, contact_law;
  uint64_t tick, flag_count;
  uint32_t doubles; // positions and velocities as doubles follow, else those of the slices
  uint32_t touched, has_probe_pose, flags, row_count, spare;
  double dt_s, mu;
  sonde_pose probe_pose;
  sonde_friction friction;
  sonde_contact contact;
  sonde_pcg_result solver;
} sonde_keep_head;

// What a slice carries from step to step: u, v, ve, which lie together.
enum { SONDE_KEEP_SLICE = 9 * sizeof(sonde_lane) };

// A touched node.
typedef struct sonde_keep_touched {
  uint64_t node, grip_tick;
  double share_m3;
  sonde_vec3 gradient, contact_force, bond_m, grip_n;
} sonde_keep_touched;

// Bytes of a part in the blob.
static inline size_t sonde_keep_round(size_t bytes) { return (bytes + 7) & ~(size_t)7; }

// Places of the parts; the ones that the state does not have are empty.
typedef struct sonde_keep_parts {
  size_t slices, awake, calm, speed2, way2;                         // fast engine
  size_t position, velocity, increment, node_awake, node_calm, box; // doubles
  size_t touched, end;
} sonde_keep_parts;

static inline size_t sonde_keep_place(size_t *end, size_t bytes) {
  size_t at = *end;
  *end += sonde_keep_round(bytes);
  return at;
}

static inline sonde_keep_parts sonde_keep_layout(const sonde_state *state, bool doubles,
                                                 uint32_t touched) {
  size_t n = state->model->surface.vertex_count, end = sonde_keep_round(sizeof(sonde_keep_head));
  size_t s = state->lanes ? state->lanes->slice_count : 0, d = doubles ? n : 0;
  sonde_keep_parts p = {0};
  p.slices = sonde_keep_place(&end, s * SONDE_KEEP_SLICE);
  p.awake = sonde_keep_place(&end, s), p.calm = sonde_keep_place(&end, s);
  p.speed2 = sonde_keep_place(&end, s * sizeof(float));
  p.way2 = sonde_keep_place(&end, s * sizeof(float));
  p.position = sonde_keep_place(&end, d * sizeof(sonde_vec3));
  p.velocity = sonde_keep_place(&end, d * sizeof(sonde_vec3));
  p.increment = sonde_keep_place(&end, d * sizeof(sonde_vec3));
  p.node_awake = sonde_keep_place(&end, d), p.node_calm = sonde_keep_place(&end, d);
  p.box = sonde_keep_place(&end, (doubles ? state->block_count : 0) * sizeof(sonde_box));
  p.touched = sonde_keep_place(&end, touched * sizeof(sonde_keep_touched));
  p.end = end;
  return p;
}

#endif
