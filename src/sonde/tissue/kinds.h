// The deformable models, in the order of sonde_model_kind: what each tells of itself whatever the
// precision. Its batches are registered in world/models.h.
#ifndef SONDE_SRC_KINDS_H
#define SONDE_SRC_KINDS_H

#include "tissue/nodes.h"

typedef struct sonde_kind {
  const char *name;
  sonde_nodes (*nodes)(const sonde_model *model);
  // NULL: every move is as good as another.
  sonde_vec3 (*bounded_move)(const sonde_model *model, uint32_t i, sonde_vec3 u, sonde_vec3 move);
} sonde_kind;

extern const sonde_kind sonde_two_layer_kind;

#endif
