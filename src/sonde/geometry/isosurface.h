// The surface on which values at the points of a grid have a given level.
#ifndef SONDE_SRC_GEOMETRY_ISOSURFACE_H
#define SONDE_SRC_GEOMETRY_ISOSURFACE_H

#include "base/link.h"
#include "sonde/geometry.h"

// Closed, outward surface around the points whose value exceeds the level, by marching tetrahedra:
// each cell of eight points is six tetrahedra around its diagonal, in which the value is linear.
// Every edge of the surface has two faces, whatever the values are; points beyond the grid have
// the value 0. Coordinates are indices of the grid.
// @param value [size[2]][size[1]][size[0]] finite
// @param level more than 0
// @return MESH when no value exceeds the level; MEMORY, also beyond the limits of a mesh
// @thread owner
SONDE_LINK sonde_status sonde_isosurface_create(const float *value, const uint32_t size[3],
                                                float level, sonde_mesh *mesh, sonde_error *error);

#endif
