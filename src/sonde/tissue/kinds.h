// The deformable models, in the order of sonde_model_kind: what each tells of itself whatever the
// precision. Its batches are registered in world/models.h.
#ifndef SONDE_SRC_TISSUE_KINDS_H
#define SONDE_SRC_TISSUE_KINDS_H

#include "base/link.h"
#include "tissue/nodes.h"

// Kinds of one family share their data in batches and their kernels.
typedef enum sonde_family { SONDE_FAMILY_TWO_LAYER, SONDE_FAMILY_BULK } sonde_family;

typedef struct sonde_kind {
  sonde_family family;
  sonde_nodes (*nodes)(const sonde_model *model);
  // NULL: every move is as good as another.
  sonde_vec3 (*bounded_move)(const sonde_model *model, uint32_t i, sonde_vec3 u, sonde_vec3 move);
} sonde_kind;

extern const sonde_kind sonde_two_layer_kind, sonde_lattice_kind, sonde_three_layer_kind,
    sonde_linear_solid_kind, sonde_neo_hookean_kind, sonde_condensed_kind;

// @thread any
sonde_family sonde_model_family(const sonde_model *model);
// Names as in `sonde fit --model`. @return ARGUMENT naming those that there are @thread any
const char *sonde_model_kind_name(sonde_model_kind kind);
sonde_status sonde_model_kind_named(const char *name, sonde_model_kind *kind, sonde_error *error);

#endif
