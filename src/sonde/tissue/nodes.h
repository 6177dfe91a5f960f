// The nodes of a body that moves, those of its skin first, and what every deformable model tells of
// itself whatever the precision.
#ifndef SONDE_SRC_NODES_H
#define SONDE_SRC_NODES_H

#include "base/link.h"
#include "sonde/tissue.h"

// Borrowed from a model.
typedef struct sonde_nodes {
  uint32_t count;
  const sonde_vec3 *rest;            // [count] m
  const double *area_m2, *mass_kg;   // [count]; inner nodes have no area
  const uint32_t *start, *neighbour; // [count + 1] nodes that forces couple with a node
} sonde_nodes;

// @thread any
SONDE_LINK sonde_nodes sonde_model_nodes(const sonde_model *model);

// A node's move from a displacement u, as far as one step of a search for equilibrium may take it.
// @thread tick
sonde_vec3 sonde_model_bounded_move(const sonde_model *model, uint32_t i, sonde_vec3 u,
                                    sonde_vec3 move);

#endif
