// A volumetric body in batches of nodes: springs along the edges of its tetrahedra, and the
// tetrahedra themselves, row by row, in the precision of base/batch.h.
#ifndef SONDE_SRC_BULK_BATCHES_H
#define SONDE_SRC_BULK_BATCHES_H

#include "tissue/deformable.h"
#include "tissue/laws.h"

// A neighbour of each row and the block K_ij of the stiffness between them: F_i = -sum K_ij u_j.
typedef struct bulk_slot {
  wholes node;
  reals block[9];
} bulk_slot;

// The spring of a slot's edge; none where both stiffnesses are 0.
typedef struct bulk_spring {
  reals rest[3], length; // X_j - X_i
  biphasic_law law;
} bulk_spring;

// A tetrahedron at each row: its three other corners, their slots, the gradients of their shape
// functions; volume 0 where there is none.
typedef struct bulk_corner {
  wholes node[3], slot[3];
  reals gradient[3][3], volume, mu, lambda;
} bulk_corner;

typedef struct bulk_batch {
  uint32_t first_slot, slot_count, first_corner, corner_count;
  reals own[6]; // K_ii of a body whose stiffness is constant: xx xy xz yy yz zz
  real bend;    // change of a row's stiffness by a move, over the square of the move: N/m2
} bulk_batch;

typedef struct bulk_tissue {
  sonde_tissue common;
  bool constant, springs, solid; // whether the stiffness is constant, and what makes it if not
  real made_scale, gain;         // stiffness_scale that the blocks hold; the present one over it
  real damping_s;                // dampers: this time times the stiffness
  uint32_t slot_count, corner_count;
  void *block;
  bulk_batch *batch;   // [batches]
  bulk_slot *slot;     // [slots]
  bulk_spring *spring; // [slots] where there are springs
  bulk_corner *corner; // [corners] of a solid
  reals *compliance;   // of a condensed solid, see sonde_tissue
} bulk_tissue;

#define sonde_bulk_calls BY_REAL(sonde_bulk_calls)
extern const sonde_tissue_calls sonde_bulk_calls;

#endif
