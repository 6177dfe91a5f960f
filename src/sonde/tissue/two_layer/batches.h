// The two-layer tissue of a body in batches of nodes: its springs and layers, slot by slot around
// each node, in the precision of base/batch.h.
#ifndef SONDE_SRC_TWO_LAYER_BATCHES_H
#define SONDE_SRC_TWO_LAYER_BATCHES_H

#include "tissue/deformable.h"
#include "tissue/laws.h"

// One neighbour of each row of a batch; rows with fewer neighbours have share 0 there.
typedef struct two_layer_slot {
  reals rest[3]; // X_j - X_i
  reals length;  // at rest
} two_layer_slot;

// The face between a row, the neighbour of the slot before and this one, which follow one another
// around the row; zero where there is none. Before the first slot is the row's `last`.
typedef struct two_layer_face {
  reals cot[3]; // half the cotangents at the row, the neighbour before, this one
  reals bend;   // 1/(gm^2 area) and G of the shear layer
  reals shear;
} two_layer_face;

// Both layers between a row and its neighbour: all that a product reads of a slot.
typedef struct two_layer_coupling {
  wholes node;
  reals coupling; // s of the block s N_i N_j^T of the shear layer
  reals weight;   // half the cotangents of both faces: of the in-plane layer
} two_layer_coupling;

// The neighbour and the edge's block of the matrix, -(along n n^T + lateral I): all that a product
// reads of a slot, in one stream.
typedef struct two_layer_tangent {
  wholes node;
  reals n[3], along, lateral;
} two_layer_tangent;

typedef struct two_layer_batch {
  reals normal[3], k0, xm, limit;
  reals weight;      // sum of its slots' weights
  wholes last, turn; // the neighbour before the first slot, and the slots up to it
  uint32_t first_slot, slot_count;
  uint32_t whole_count; // slots from the front whose shares are all 1
  real bend;            // 1 over the shortest edge at a node, at rest
} two_layer_batch;

typedef struct two_layer {
  sonde_tissue common; // published[1]: tangential displacement, indentation and N.x of what a row
                       // moved since; a direction's tangential part and N.z
  edge_law edge;
  anchor_law anchor;
  real inplane, shear;   // 0: no such layer
  bool springs, layered; // whether edges carry springs, and faces layers
  uint32_t slot_count;
  void *block;
  two_layer_batch *batch; // [batches]
  two_layer_slot *slot;   // [slots]
  two_layer_tangent *tangent;
  two_layer_face *slot_face;      // of layered models
  two_layer_coupling *slot_layer; // as well
  wholes *slot_from;              // the same: which face, -1 for none
  reals *share;                   // [slots] of a spring: 1, 0 for padding
} two_layer;

#define sonde_two_layer_calls BY_REAL(sonde_two_layer_calls)
extern const sonde_tissue_calls sonde_two_layer_calls;

#endif
