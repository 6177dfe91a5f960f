// The skin cut along the sides of a footprint, so that faces lie inside or outside as a whole.
#ifndef SONDE_SRC_FIT_CUT_H
#define SONDE_SRC_FIT_CUT_H

#include "base/base.h"
#include "sonde/tissue.h"

// Vertices: nodes of the model first (ascending), then points on its faces: middles of edges that
// are too long near the sides, and where the sides cross edges. Faces keep their orientation.
typedef struct sonde_cut {
  uint32_t vertex_count, node_count; // node_count: vertices that are nodes of the model
  uint32_t (*parent)[3];             // [vertex_count] corners of the model's face; a node: itself
  double (*share)[3];                // [vertex_count] of the parents, sum 1; a node: 1, 0, 0
  bool *held;                        // [vertex_count] moves with the footprint
  double *rim_m; // [node_count] its share of the border where the skin is cut off
  uint32_t held_count;
  uint32_t face_count;
  uint32_t (*face)[3]; // [face_count]
  bool coarse;         // the model's edges there are longer than three quarters of its narrow side
} sonde_cut;

// Cuts the faces within reach of the footprint; reach_m = INFINITY keeps the whole skin. The sides
// are measured along the skin, as a pad does that takes the skin's shape. Near them no edge is
// longer than 2.1 mm.
// @return MISMATCH when there is no skin under the footprint
sonde_status sonde_cut_create(const sonde_model *model, const sonde_site *site, double half_u_m,
                              double half_v_m, double reach_m, sonde_cut *cut, sonde_error *error);
void sonde_cut_clear(sonde_cut *cut);

// Rest place and rest normal of a vertex.
sonde_vec3 sonde_cut_point(const sonde_model *model, const sonde_cut *cut, uint32_t vertex);
sonde_vec3 sonde_cut_normal(const sonde_model *model, const sonde_cut *cut, uint32_t vertex);

// A model of the cut skin with the same law and the parameters of `model` at its vertices; for
// sonde_state_create(). Destroyed by sonde_model_destroy().
sonde_status sonde_cut_model(const sonde_model *model, const sonde_cut *cut,
                             sonde_model **cut_model, sonde_error *error);

#endif
