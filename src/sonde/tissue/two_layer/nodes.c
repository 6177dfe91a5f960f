// What the two-layer model tells of itself: its nodes are those of the skin.
#include "tissue/kinds.h"

#include "base/base.h"
#include "base/maths.h"

static sonde_nodes nodes(const sonde_model *model) {
  return (sonde_nodes){.count = model->surface.vertex_count,
                       .rest = model->surface.vertices,
                       .area_m2 = model->area_m2,
                       .mass_kg = model->mass_kg,
                       .start = model->topology.start,
                       .neighbour = model->topology.neighbour};
}

// The indentation stays below x_m: at most 95 % of the remaining gap.
static sonde_vec3 bounded_move(const sonde_model *model, uint32_t i, sonde_vec3 u,
                               sonde_vec3 move) {
  SONDE_ASSERT(i < model->surface.vertex_count);
  sonde_vec3 n = model->normal[i];
  double gap = fmax(0.95 * (model->xm_m[i] + v_dot(n, u)), 0), over = -v_dot(n, move) - gap;
  return over > 0 ? v_madd(move, over, n) : move;
}

const sonde_kind sonde_two_layer_kind = {SONDE_FAMILY_TWO_LAYER, nodes, bounded_move};
