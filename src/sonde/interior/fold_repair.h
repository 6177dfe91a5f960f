// Repairs folds in the tissue of a grid: displacements of its nodes under which no element turns
// inside out.
#ifndef SONDE_SRC_UNFOLD_H
#define SONDE_SRC_UNFOLD_H

#include "interior/grid.h"

typedef struct sonde_fold_repair {
  sonde_vec3
      now[SONDE_WINDOW_NODES]; // positions of the nodes: in by the field alone, out without folds
  bool held[SONDE_WINDOW_S * SONDE_WINDOW_THETA]; // columns whose skin stays where it is
  unsigned char pending[SONDE_GRID_HEXES];        // sweeps that an element is looked at for

} sonde_fold_repair;

// True when nodes have moved. @param grid at rest
bool sonde_fold_repair_nodes(sonde_fold_repair *repair, const sonde_grid *grid);

// The columns' field on a grid of its own beside the probe, kept from folding.
typedef struct sonde_column_grid {
  double strength; // 0: the field alone, 1: the grid alone
  sonde_grid grid;
  sonde_fold_repair repair;
  sonde_vec3 move[SONDE_WINDOW_NODES]; // world
} sonde_column_grid;

// For the columns' field of the update.
void sonde_column_grid_update(sonde_column_grid *grid, const sonde_interior *in,
                              const sonde_interior_input *input);
// Displacement at a rest point of the leg; returns its share, the rest is the columns' field.
double sonde_column_grid_at(const sonde_column_grid *grid, double theta, double s, double r,
                            sonde_vec3 *move);

#endif
