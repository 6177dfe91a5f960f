// Keeps the tissue of a grid from folding: displacements of its nodes under which no element turns
// inside out.
#ifndef SONDE_SRC_UNFOLD_H
#define SONDE_SRC_UNFOLD_H

#include "interior/grid.h"

typedef struct sonde_unfold {
  sonde_vec3 now[SONDE_WINDOW_NODES]; // places of the nodes: in by the field alone, out kept apart
  bool held[SONDE_WINDOW_S * SONDE_WINDOW_THETA]; // columns whose skin stays where it is
  unsigned char awake[SONDE_GRID_HEXES];          // sweeps that an element is looked at for

} sonde_unfold;

// True when nodes have moved. @param grid at rest
bool sonde_unfold_nodes(sonde_unfold *unfold, const sonde_grid *grid);

// The columns' field on a grid of its own beside the probe, kept from folding.
typedef struct sonde_bend {
  double strength; // 0: the field alone, 1: the grid alone
  sonde_grid grid;
  sonde_unfold unfold;
  sonde_vec3 move[SONDE_WINDOW_NODES]; // world
} sonde_bend;

// For the columns' field of the update.
void sonde_bend_update(sonde_bend *bend, const sonde_interior *in,
                       const sonde_interior_input *input);
// Displacement at a rest point of the leg; returns its share, the rest is the columns' field.
double sonde_bend_at(const sonde_bend *bend, double theta, double s, double r, sonde_vec3 *move);

#endif
