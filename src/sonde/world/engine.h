// What the world asks of an engine: the same code over batches of 16 floats (FAST) and of 8 doubles
// (DOUBLE, and every search for equilibrium).
#ifndef SONDE_SRC_ENGINE_H
#define SONDE_SRC_ENGINE_H

#include "world/state.h"

typedef struct sonde_engine_calls sonde_engine_calls;

// The part of an engine's data that does not depend on its precision; the first member of it.
typedef struct sonde_engine_data {
  const sonde_engine_calls *calls;
  uint32_t node_count, batch_count;
  uint32_t batch_nodes;     // 16 or 8
  uint8_t *is_awake, *calm; // [batches]
  uint8_t *published;       // [batches] the state's positions and velocities are up to date
  bool stale;               // those of the state are newer
  uint64_t bytes_moved;     // by the last step, at least
  // For snapshots: each batch begins with the numbers that go on from step to step.
  char *batches;
  size_t batch_bytes, motion_bytes, real_bytes;
  void *speed2, *moved2; // [batches] largest squares of a node's speed and displacement
} sonde_engine_data;

struct sonde_engine_calls {
  // face_order: faces along a space-filling curve, borrowed.
  sonde_status (*create)(const sonde_model *model, const sonde_world_def *def,
                         const uint32_t *face_order, sonde_engine_data **data, sonde_error *error);
  void (*destroy)(sonde_engine_data *data);
  // Takes over the springs of a model with the same mesh. @thread tick
  void (*tune)(sonde_engine_data *data, const sonde_model *tuned, const sonde_world_def *def);
  // Takes over displacements and velocities; wakes every batch, or none.
  void (*import)(sonde_engine_data *data, const sonde_vec3 *rest, const sonde_vec3 *position,
                 const sonde_vec3 *velocity, bool awake);
  // Writes positions and velocities that are not up to date. @thread tick
  void (*publish)(sonde_engine_data *data, const sonde_vec3 *rest, sonde_vec3 *position,
                  sonde_vec3 *velocity);
  // What neighbours read, after the batches were restored.
  void (*refresh)(sonde_engine_data *data);
  // One step; false when something is not finite. @thread tick
  bool (*step)(sonde_state *state, const sonde_probe *probe, sonde_pose pose,
               const sonde_motion *motion);
};

extern const sonde_engine_calls sonde_engine_float, sonde_engine_double;

#endif
