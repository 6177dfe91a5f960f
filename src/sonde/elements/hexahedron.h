// Shape functions of the eight-node hexahedron and its 2x2x2 integration points.
#ifndef SONDE_SRC_HEXAHEDRON_H
#define SONDE_SRC_HEXAHEDRON_H

#include "base/maths.h"

// Local coordinate of the integration points of the rule with two points per axis.
static const double sonde_hexahedron_gauss = 0.57735026918962576;
// Corners in local coordinates: 0-3 run round one face, 4-7 lie behind them.
static const double sonde_hexahedron_sign[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1},
                                                   {-1, 1, -1},  {-1, -1, 1}, {1, -1, 1},
                                                   {1, 1, 1},    {-1, 1, 1}};

// Gradients (1/m) of the shape functions at local (a, b, c) of the hexahedron with those corners;
// returns det J, negative for a left-handed one.
static inline double sonde_hexahedron_gradients(const sonde_vec3 corner[8], double a, double b,
                                                double c, sonde_vec3 g[8]) {
  const double(*sign)[3] = sonde_hexahedron_sign;
  sonde_vec3 local[8], j[3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  for (int n = 0; n < 8; ++n) {
    double x = 1 + sign[n][0] * a, y = 1 + sign[n][1] * b, z = 1 + sign[n][2] * c;
    local[n] = vec3(sign[n][0] * y * z / 8, x * sign[n][1] * z / 8, x * y * sign[n][2] / 8);
    sonde_vec3 p = corner[n];
    j[0] = v_madd(j[0], local[n].x, p);
    j[1] = v_madd(j[1], local[n].y, p);
    j[2] = v_madd(j[2], local[n].z, p);
  }
  double det = v_dot(j[0], v_cross(j[1], j[2]));
  sonde_vec3 dual[3] = {v_scale(v_cross(j[1], j[2]), 1 / det),
                        v_scale(v_cross(j[2], j[0]), 1 / det),
                        v_scale(v_cross(j[0], j[1]), 1 / det)};
  for (int n = 0; n < 8; ++n) {
    g[n] = v_scale(dual[0], local[n].x);
    g[n] = v_madd(g[n], local[n].y, dual[1]);
    g[n] = v_madd(g[n], local[n].z, dual[2]);
  }
  return det;
}

#endif
