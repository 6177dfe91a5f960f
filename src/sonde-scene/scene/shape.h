// The skin of a block of grid cells, shared by boxes, ellipsoids and lattices.
#ifndef SONDE_SRC_SCENE_SHAPE_H
#define SONDE_SRC_SCENE_SHAPE_H

#include "sonde/geometry.h"

// Index of a grid point with n cells along each side.
uint32_t sonde_grid_index(const uint32_t n[3], const uint32_t at[3]);
// Closed outward mesh whose vertices have whole coordinates 0..n.
// @param place receives the grid index of each vertex, freed by sonde_free
sonde_status sonde_grid_skin(const uint32_t n[3], sonde_mesh *mesh, uint32_t **place,
                             sonde_error *error);

#endif
