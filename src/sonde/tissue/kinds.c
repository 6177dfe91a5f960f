// The list of deformable models and what is asked of all of them.
#include "tissue/kinds.h"

#include "base/base.h"

#include <stdio.h>
#include <string.h>

static const sonde_kind *const kinds[] = {[SONDE_TWO_LAYER] = &sonde_two_layer_kind,
                                          [SONDE_LATTICE] = &sonde_lattice_kind,
                                          [SONDE_THREE_LAYER] = &sonde_three_layer_kind,
                                          [SONDE_LINEAR_SOLID] = &sonde_linear_solid_kind,
                                          [SONDE_NEO_HOOKEAN_SOLID] = &sonde_neo_hookean_kind,
                                          [SONDE_CONDENSED_SOLID] = &sonde_condensed_kind};
static const char *const names[SONDE_COUNT_OF(kinds)] = {SONDE_MODEL_KIND_NAMES};

static const sonde_kind *kind_of(const sonde_model *model) {
  SONDE_ASSERT((size_t)model->kind < SONDE_COUNT_OF(kinds));
  return kinds[model->kind];
}

const char *sonde_model_kind_name(sonde_model_kind kind) {
  SONDE_ASSERT((size_t)kind < SONDE_COUNT_OF(kinds));
  return names[kind];
}

sonde_status sonde_model_kind_named(const char *name, sonde_model_kind *kind, sonde_error *error) {
  char list[128] = "";
  for (size_t k = 0; k < SONDE_COUNT_OF(kinds); ++k) {
    if (strcmp(names[k], name) == 0) {
      *kind = (sonde_model_kind)k;
      return SONDE_OK;
    }
    size_t used = strlen(list);
    snprintf(list + used, sizeof list - used, "%s%s", k ? ", " : "", names[k]);
  }
  return sonde_fail(error, SONDE_ARGUMENT, "'%s' is no model, expected one of %s", name, list);
}

sonde_family sonde_model_family(const sonde_model *model) { return kind_of(model)->family; }

sonde_nodes sonde_model_nodes(const sonde_model *model) { return kind_of(model)->nodes(model); }

sonde_vec3 sonde_model_bounded_move(const sonde_model *model, uint32_t i, sonde_vec3 u,
                                    sonde_vec3 move) {
  const sonde_kind *kind = kind_of(model);
  return kind->bounded_move ? kind->bounded_move(model, i, u, move) : move;
}
