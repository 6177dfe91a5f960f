// A saved state: a head, then the arrays of the engine, then what the probe touches. Every part
// starts at a multiple of 8 bytes.
#ifndef SONDE_SRC_SNAPSHOT_H
#define SONDE_SRC_SNAPSHOT_H

#include "world/engine.h"

enum { SONDE_SNAPSHOT_VERSION = 2 };

typedef struct sonde_snapshot_head {
  char magic[8]; // "SNDSTATE"
  uint32_t version, head_bytes;
  uint64_t model_checksum;
  uint32_t nodes, batches, engine, contact_law;
  uint64_t tick, flag_count;
  uint32_t doubles; // positions and velocities as doubles follow, else those of the batches
  uint32_t touched, has_probe_pose, flags, awake_nodes, spare;
  double dt_s, mu;
  sonde_pose probe_pose;
  sonde_friction friction;
  sonde_contact contact;
  sonde_pcg_result solver;
} sonde_snapshot_head;

// A touched node.
typedef struct sonde_snapshot_touched {
  uint64_t node, grip_tick;
  double share_m3;
  sonde_vec3 gradient, contact_force, bond_m, grip_n;
} sonde_snapshot_touched;

// Bytes of a part in the blob.
static inline size_t sonde_snapshot_round(size_t bytes) { return (bytes + 7) & ~(size_t)7; }

// Places of the parts; the ones that the state does not have are empty.
typedef struct sonde_snapshot_parts {
  size_t motion, awake, calm, speed2, moved2; // of batches
  size_t position, velocity;                  // doubles
  size_t touched, end;
} sonde_snapshot_parts;

static inline size_t sonde_snapshot_place(size_t *end, size_t bytes) {
  size_t at = *end;
  *end += sonde_snapshot_round(bytes);
  return at;
}

static inline sonde_snapshot_parts sonde_snapshot_layout(const sonde_state *state, bool doubles,
                                                         uint32_t touched) {
  const sonde_engine_data *engine = state->engine;
  size_t end = sonde_snapshot_round(sizeof(sonde_snapshot_head)), s = engine->batch_count;
  size_t d = doubles ? engine->node_count : 0;
  sonde_snapshot_parts p = {0};
  p.motion = sonde_snapshot_place(&end, s * engine->motion_bytes);
  p.awake = sonde_snapshot_place(&end, s), p.calm = sonde_snapshot_place(&end, s);
  p.speed2 = sonde_snapshot_place(&end, s * engine->real_bytes);
  p.moved2 = sonde_snapshot_place(&end, s * engine->real_bytes);
  p.position = sonde_snapshot_place(&end, d * sizeof(sonde_vec3));
  p.velocity = sonde_snapshot_place(&end, d * sizeof(sonde_vec3));
  p.touched = sonde_snapshot_place(&end, touched * sizeof(sonde_snapshot_touched));
  p.end = end;
  return p;
}

#endif
