// A leg built by hand for tests: a skin from rings of points, a round straight femur, uniform
// layers, two vessels. Frees itself with tube_clear().
#ifndef SONDE_TEST_TUBE_H
#define SONDE_TEST_TUBE_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/interior.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>
#include <cmocka.h>

typedef struct tube {
  sonde_model model;
  uint32_t around, rows; // skin nodes: row * around + i; then the two cap centres
} tube;

// Closed surface of `rows` rings with `around` points each; points row by row.
static inline void tube_surface(sonde_mesh *mesh, uint32_t around, uint32_t rows,
                                const sonde_vec3 *points) {
  uint32_t n = around * rows, f = 0;
  assert_int_equal(sonde_mesh_create(mesh, n + 2, 2 * around * (rows - 1) + 2 * around, NULL), 0);
  for (uint32_t i = 0; i < n; ++i) mesh->vertices[i] = points[i];
  for (uint32_t i = 0; i < around; ++i) {
    mesh->vertices[n] = v_madd(mesh->vertices[n], 1.0 / around, points[i]);
    mesh->vertices[n + 1] = v_madd(mesh->vertices[n + 1], 1.0 / around, points[n - around + i]);
  }
  for (uint32_t i = 0; i < around; ++i) {
    uint32_t next = (i + 1) % around, top = n - around;
    for (uint32_t j = 0; j + 1 < rows; ++j) {
      uint32_t a = j * around + i, b = j * around + next, c = a + around, d = b + around;
      uint32_t faces[2][3] = {{a, b, d}, {a, d, c}};
      memcpy(mesh->faces[f], faces, sizeof faces);
      f += 2;
    }
    uint32_t caps[2][3] = {{n, next, i}, {n + 1, top + i, top + next}};
    memcpy(mesh->faces[f], caps, sizeof caps);
    f += 2;
  }
}

static inline void tube_round(sonde_mesh *mesh, uint32_t around, uint32_t rows, sonde_vec3 low,
                              sonde_vec3 high, double r_low, double r_high) {
  sonde_vec3 *points = SONDE_NEW(sonde_vec3, around * rows);
  for (uint32_t j = 0; j < rows; ++j)
    for (uint32_t i = 0; i < around; ++i) {
      double t = (double)j / (rows - 1), a = 2 * SONDE_PI * i / around;
      double r = r_low + t * (r_high - r_low);
      sonde_vec3 c = v_lerp(low, high, t);
      points[j * around + i] = v_add(c, vec3(r * cos(a), r * sin(a), 0));
    }
  tube_surface(mesh, around, rows, points);
  sonde_free(points);
}

static inline double *tube_constant(uint32_t count, double value) {
  double *a = SONDE_NEW(double, count);
  for (uint32_t i = 0; i < count; ++i) a[i] = value;
  return a;
}

// Layers and normals of a leg whose surface and femur are there.
static inline void tube_finish(tube *t, double skin_m, double fat_m) {
  sonde_model *m = &t->model;
  uint32_t n = m->surface.vertex_count;
  m->normal = SONDE_NEW(sonde_vec3, n);
  m->area_m2 = SONDE_NEW(double, n);
  sonde_mesh_normals(&m->surface, m->normal);
  sonde_mesh_areas(&m->surface, m->area_m2);
  m->fat_depth_m = tube_constant(n, skin_m);
  m->muscle_depth_m = tube_constant(n, fat_m);
  m->bone_depth_m = tube_constant(n, 0.06);
}

// A vessel parallel to z at angle `angle` and radius `r` from the axis.
static inline void tube_vessel(sonde_vessel *v, double skin_r, double r, double angle,
                               double length, double lumen_r) {
  v->count = 16;
  for (uint32_t i = 0; i < v->count; ++i)
    v->point[i] = (sonde_vessel_point){
        vec3(r * cos(angle), r * sin(angle), length * i / (v->count - 1)), lumen_r, skin_r - r};
}

// A round leg about the z axis: radius, femur radius, length. The vessels lie under angle pi/2
// (+y), the artery 11 mm towards -x.
static inline tube tube_create(double radius, double bone, double length, double fat_m,
                               uint32_t around, uint32_t rows) {
  tube t = {.around = around, .rows = rows};
  sonde_vec3 top = vec3(0, 0, length);
  tube_round(&t.model.surface, around, rows, vec3(0, 0, 0), top, radius, radius);
  tube_round(&t.model.femur, 48, 12, vec3(0, 0, 0), top, bone, bone);
  tube_finish(&t, 1.8e-3, fat_m);
  double depth = 18e-3, r = radius - depth;
  tube_vessel(&t.model.vein, radius, r, SONDE_PI / 2, length, 4.5e-3);
  tube_vessel(&t.model.artery, radius, r, SONDE_PI / 2 + 11e-3 / r, length, 3.5e-3);
  return t;
}

static inline void tube_clear(tube *t) {
  sonde_model *m = &t->model;
  sonde_mesh_clear(&m->surface);
  sonde_mesh_clear(&m->femur);
  void *arrays[] = {m->normal, m->area_m2, m->fat_depth_m, m->muscle_depth_m, m->bone_depth_m};
  for (size_t i = 0; i < SONDE_COUNT_OF(arrays); ++i) sonde_free(arrays[i]);
}

// Probe pose on the skin of a round leg at height z under +y: x lateral, z beam into the leg.
static inline sonde_pose tube_pose(double face_radius, double z) {
  sonde_mat3 r = m_columns(vec3(-1, 0, 0), vec3(0, 0, -1), vec3(0, -1, 0));
  return (sonde_pose){vec3(0, face_radius, z), q_from_matrix(r)};
}

#endif
