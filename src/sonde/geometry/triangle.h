// One triangle.
#ifndef SONDE_SRC_GEOMETRY_TRIANGLE_H
#define SONDE_SRC_GEOMETRY_TRIANGLE_H

#include "sonde/base.h"

// Barycentric weights of the point of abc closest to p; all but those of the closest corner or side
// are exactly 0. @thread any
SONDE_LINK void sonde_triangle_closest(sonde_vec3 p, sonde_vec3 a, sonde_vec3 b, sonde_vec3 c,
                                       double w[3]);

#endif
