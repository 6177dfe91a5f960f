// The list of deformable models and what is asked of all of them.
#include "tissue/kinds.h"

#include "base/base.h"

static const sonde_kind *const kinds[] = {[SONDE_TWO_LAYER] = &sonde_two_layer_kind};

static const sonde_kind *kind_of(const sonde_model *model) {
  SONDE_ASSERT((size_t)model->kind < SONDE_COUNT_OF(kinds));
  return kinds[model->kind];
}

sonde_nodes sonde_model_nodes(const sonde_model *model) { return kind_of(model)->nodes(model); }

sonde_vec3 sonde_model_bounded_move(const sonde_model *model, uint32_t i, sonde_vec3 u,
                                    sonde_vec3 move) {
  const sonde_kind *kind = kind_of(model);
  return kind->bounded_move ? kind->bounded_move(model, i, u, move) : move;
}
