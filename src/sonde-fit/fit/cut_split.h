// Faces split at points on their edges.
#ifndef SONDE_SRC_FIT_CUT_SPLIT_H
#define SONDE_SRC_FIT_CUT_SPLIT_H

#include "fit/cut.h"

// A place in the footprint's axes, measured along the skin; NaN on another side of the leg.
typedef struct sonde_pad_place {
  double u_m, v_m;
} sonde_pad_place;

// A cut under way.
typedef struct sonde_cutter {
  const sonde_model *model;
  double half_u_m, half_v_m;
  sonde_pad_place *place; // [cut->vertex_count]
  sonde_cut *cut;
} sonde_cutter;

// Where an edge gets a point: its share of the way from a to b, inside (0, 1); 0: none. Asked once
// per face of the edge, a < b.
typedef double sonde_split_where(const sonde_cutter *cutter, int which, uint32_t a, uint32_t b);

// Puts the points and splits all faces that have one; *added counts points. Each new vertex takes
// parents and place from its edge.
sonde_status sonde_cut_split(sonde_cutter *cutter, sonde_split_where *where, int which,
                             uint32_t *added, sonde_error *error);

#endif
