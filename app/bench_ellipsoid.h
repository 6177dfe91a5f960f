// The scene that dynamics engines are compared on: a ball pressed into a soft ellipsoid.
#ifndef SONDE_BENCH_ELLIPSOID_H
#define SONDE_BENCH_ELLIPSOID_H

#include "sonde/sonde.h"

typedef struct bench_ellipsoid {
  long nodes;       // asked for; the nearest 10 f^2 + 2 is built
  double stiffness; // of a surface spring, N/m
  double size;      // of the body, 1: 0.20 x 0.08 x 0.08 m
} bench_ellipsoid;

// Closed geodesic ellipsoid on springs along its radii. @param model owned by the caller
sonde_status bench_ellipsoid_build(const bench_ellipsoid *def, sonde_model **model,
                                   sonde_error *error);
// The world of the scene: penalty at the nodes, backward Euler.
sonde_world_def bench_ellipsoid_world(double dt_s);
// Pose of the ball: 20 mm deep in 0.1 s, held to 0.3 s, then 0.1 m/s along the body to 0.5 s.
sonde_pose bench_ellipsoid_pose(const bench_ellipsoid *def, double time_s);

#endif
