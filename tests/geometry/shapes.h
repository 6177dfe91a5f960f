// Shapes and small tools that the tests of the geometry room share.
#ifndef SONDE_TESTS_GEOMETRY_SHAPES_H
#define SONDE_TESTS_GEOMETRY_SHAPES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/base.h"
#include "base/maths.h"
#include "geometry/internal.h"
#include "sonde/geometry.h"

#define SHAPE_DATA SONDE_SOURCE_DIR "/../shared/data/"

static sonde_error shape_error;

#define assert_ok(call)                                                                            \
  do {                                                                                             \
    if ((call) != SONDE_OK) fail_msg("%s: %s", #call, shape_error.message);                        \
  } while (0)

#define assert_near(a, b, tolerance)                                                               \
  do {                                                                                             \
    double shape_a = (a), shape_b = (b), shape_t = (tolerance);                                    \
    if (!(fabs(shape_a - shape_b) <= shape_t))                                                     \
      fail_msg("%s = %.17g, expected %.17g within %g", #a, shape_a, shape_b, shape_t);             \
  } while (0)

// Uniform numbers from a 64-bit state (splitmix64).
static inline double shape_uniform(uint64_t *state, double low, double high) {
  uint64_t z = (*state += UINT64_C(0x9e3779b97f4a7c15));
  z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
  z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
  z ^= z >> 31;
  return low + (high - low) * ((double)(z >> 11) * 0x1p-53);
}

static inline sonde_vec3 shape_point(uint64_t *state, double reach) {
  double x = shape_uniform(state, -reach, reach), y = shape_uniform(state, -reach, reach);
  return vec3(x, y, shape_uniform(state, -reach, reach));
}

static inline sonde_vec3 shape_direction(uint64_t *state) {
  for (;;) {
    sonde_vec3 p = shape_point(state, 1);
    double n = v_norm(p);
    if (n > 0.1 && n <= 1) return v_scale(p, 1 / n);
  }
}

static inline sonde_quat shape_rotation(uint64_t *state) {
  sonde_vec3 axis = shape_direction(state);
  double half = shape_uniform(state, 0, SONDE_PI);
  return (sonde_quat){cos(half), axis.x * sin(half), axis.y * sin(half), axis.z * sin(half)};
}

static inline sonde_mesh shape_box(double hx, double hy, double hz) {
  static const uint32_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                        {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                        {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  sonde_mesh mesh;
  assert_ok(sonde_mesh_create(&mesh, 8, 12, &shape_error));
  for (int k = 0; k < 8; ++k)
    mesh.vertices[k] = vec3(k & 1 ? hx : -hx, k & 2 ? hy : -hy, k & 4 ? hz : -hz);
  memcpy(mesh.faces, faces, sizeof faces);
  return mesh;
}

// Octahedron whose faces are cut into n^2 by the grid of each face, pushed onto the sphere.
static inline sonde_mesh shape_sphere(uint32_t n, double radius) {
  sonde_vec3 *points = calloc(8 * (size_t)(n + 1) * (n + 2) / 2, sizeof *points);
  size_t count = 0;
  for (int octant = 0; octant < 8; ++octant)
    for (uint32_t i = 0; i <= n; ++i)
      for (uint32_t j = 0; i + j <= n; ++j) {
        // Shared edges are made once: a zero coordinate belongs to the positive octant.
        if ((octant & 1 && i == 0) || (octant & 2 && j == 0) || (octant & 4 && i + j == n))
          continue;
        sonde_vec3 p = vec3(i, j, n - i - j);
        if (octant & 1) p.x = -p.x;
        if (octant & 2) p.y = -p.y;
        if (octant & 4) p.z = -p.z;
        points[count++] = v_scale(v_unit(p, p), radius);
      }
  sonde_convex hull;
  assert_ok(sonde_convex_hull(points, (uint32_t)count, &hull, &shape_error));
  assert_int_equal(hull.hull.vertex_count, count);
  sonde_mesh mesh;
  assert_ok(sonde_mesh_copy(&hull.hull, &mesh, &shape_error));
  sonde_convex_clear(&hull);
  free(points);
  return mesh;
}

static inline double shape_segment_distance(sonde_vec3 p, sonde_vec3 a, sonde_vec3 b) {
  sonde_vec3 u = v_sub(b, a);
  double t = clamp(v_dot(v_sub(p, a), u) / v_norm2(u), 0, 1);
  return v_distance(p, v_madd(a, t, u));
}

// Distance of a point from a triangle: its plane where the foot lies inside, else its sides.
static inline double shape_triangle_distance(sonde_vec3 p, const sonde_vec3 t[3]) {
  sonde_vec3 n = v_cross(v_sub(t[1], t[0]), v_sub(t[2], t[0]));
  bool inside = true;
  double best = INFINITY;
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 side = v_sub(t[(k + 1) % 3], t[k]);
    if (v_dot(v_cross(n, side), v_sub(p, t[k])) < 0) inside = false;
    best = fmin(best, shape_segment_distance(p, t[k], t[(k + 1) % 3]));
  }
  return inside ? fabs(v_dot(n, v_sub(p, t[0]))) / v_norm(n) : best;
}

static inline void shape_move(sonde_mesh *mesh, sonde_pose pose) {
  for (uint32_t v = 0; v < mesh->vertex_count; ++v)
    mesh->vertices[v] = pose_apply(pose, mesh->vertices[v]);
}

static inline sonde_convex shape_convex(const sonde_mesh *mesh) {
  sonde_convex convex;
  assert_ok(sonde_convex_create(mesh, &convex, &shape_error));
  return convex;
}

static inline sonde_mesh_report shape_report(const sonde_mesh *mesh) {
  sonde_mesh_report report;
  assert_ok(sonde_mesh_inspect(mesh, &report, &shape_error));
  return report;
}

// Least squares slope of log(y) over log(x).
static inline double shape_slope(const double *x, const double *y, int count) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (int k = 0; k < count; ++k) {
    double a = log(x[k]), b = log(y[k]);
    sx += a;
    sy += b;
    sxx += a * a;
    sxy += a * b;
  }
  return (count * sxy - sx * sy) / (count * sxx - sx * sx);
}

#endif
