// What volumetric models tell of themselves.
#include "tissue/kinds.h"

#include "base/base.h"
#include "base/maths.h"

static sonde_nodes nodes(const sonde_model *model) {
  const sonde_bulk *bulk = model->bulk;
  SONDE_ASSERT(bulk != NULL);
  return (sonde_nodes){.count = bulk->node_count,
                       .rest = bulk->node,
                       .area_m2 = bulk->area_m2,
                       .mass_kg = bulk->mass_kg,
                       .start = bulk->start,
                       .neighbour = bulk->neighbour};
}

// Inner nodes follow those of the skin.
static sonde_nodes skin_nodes(const sonde_model *model) {
  sonde_nodes all = nodes(model);
  all.count = model->surface.vertex_count;
  return all;
}

// A third of the shortest edge, so that tetrahedra do not turn inside out.
static sonde_vec3 bounded_move(const sonde_model *model, uint32_t i, sonde_vec3 u,
                               sonde_vec3 move) {
  (void)u;
  SONDE_ASSERT(i < model->bulk->node_count);
  double size = v_norm(move), most = model->bulk->shortest_m[i] / 3;
  return size > most ? v_scale(move, most / size) : move;
}

const sonde_kind sonde_lattice_kind = {SONDE_FAMILY_BULK, nodes, NULL};
const sonde_kind sonde_three_layer_kind = {SONDE_FAMILY_BULK, nodes, bounded_move};
const sonde_kind sonde_linear_solid_kind = {SONDE_FAMILY_BULK, nodes, NULL};
const sonde_kind sonde_neo_hookean_kind = {SONDE_FAMILY_BULK, nodes, bounded_move};
const sonde_kind sonde_condensed_kind = {SONDE_FAMILY_BULK, skin_nodes, NULL};
