// Shared by the two files of the refinement.
#ifndef SONDE_SRC_GEOMETRY_REFINE_H
#define SONDE_SRC_GEOMETRY_REFINE_H

#include "geometry/internal.h"

// Wanted edge length (m) at a point.
typedef double (*target_fn)(sonde_vec3 point, void *user);

// Tiles anew the faces around every vertex that has more than 24.
sonde_status sonde_refine_spread_fans(sonde_mesh *mesh, target_fn target, void *user,
                                      sonde_error *error);

#endif
