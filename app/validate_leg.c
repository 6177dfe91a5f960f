// A round synthetic leg of known layers.
// tube:    closed surface of rings about the z axis.
// vessel:  straight, parallel to z.
#include "validate_leg.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

enum { AROUND = 160, ROWS = 60 };
static const double length_m = 0.3, two_pi = 6.283185307179586;

static sonde_status tube(double radius, uint32_t around, uint32_t rows, sonde_mesh *mesh,
                         sonde_error *error) {
  uint32_t n = around * rows, f = 0;
  sonde_status status = sonde_mesh_create(mesh, n + 2, 2 * around * rows, error);
  if (status) return status;
  for (uint32_t k = 0; k < n; ++k) {
    double angle = two_pi * (k % around) / around;
    mesh->vertices[k] = (sonde_vec3){radius * cos(angle), radius * sin(angle),
                                     length_m * (k / around) / (rows - 1)};
  }
  mesh->vertices[n + 1].z = length_m;
  for (uint32_t i = 0; i < around; ++i) {
    uint32_t next = (i + 1) % around, top = n - around;
    for (uint32_t j = 0; j <= rows; ++j, ++f) {
      uint32_t a = (j < rows ? j : 0) * around + i, b = a - i + next, *v = mesh->faces[f];
      if (j + 1 < rows) {
        v[0] = a, v[1] = b, v[2] = b + around;
        v = mesh->faces[++f];
        v[0] = a, v[1] = b + around, v[2] = a + around;
      } else if (j + 1 == rows) {
        v[0] = n, v[1] = next, v[2] = i;
      } else {
        v[0] = n + 1, v[1] = top + i, v[2] = top + next;
      }
    }
  }
  return SONDE_OK;
}

static double *constant(uint32_t count, double value) {
  double *list = malloc(count * sizeof *list);
  for (uint32_t i = 0; list && i < count; ++i) list[i] = value;
  return list;
}

static void vessel(sonde_vessel *v, double skin, double depth, double turn, double lumen_m) {
  double r = skin - depth, angle = 0.25 * two_pi + turn / r;
  v->count = 16;
  for (uint32_t i = 0; i < v->count; ++i) {
    v->point[i].centre_m =
        (sonde_vec3){r * cos(angle), r * sin(angle), length_m * i / (v->count - 1)};
    v->point[i].radius_m = lumen_m;
    v->point[i].depth_m = depth;
  }
}

sonde_status validate_leg_build(double radius_m, double bone_m, double muscle_m,
                                double vein_depth_m, bool vessels, sonde_model *m,
                                sonde_error *error) {
  assert(bone_m > 0 && bone_m < radius_m && vein_depth_m < radius_m);
  *m = (sonde_model){0};
  sonde_status status = tube(radius_m, AROUND, ROWS, &m->surface, error);
  if (!status) status = tube(bone_m, AROUND, 12, &m->femur, error);
  if (status) return status;
  uint32_t n = m->surface.vertex_count;
  m->normal = malloc(n * sizeof *m->normal);
  m->area_m2 = constant(n, 0);
  m->fat_depth_m = constant(n, 1.8e-3);
  m->muscle_depth_m = constant(n, muscle_m);
  m->bone_depth_m = constant(n, radius_m - bone_m);
  if (!m->normal || !m->area_m2 || !m->fat_depth_m || !m->muscle_depth_m || !m->bone_depth_m)
    return error->status = SONDE_MEMORY;
  sonde_mesh_normals(&m->surface, m->normal);
  sonde_mesh_areas(&m->surface, m->area_m2);
  if (!vessels) return SONDE_OK;
  vessel(&m->vein, radius_m, vein_depth_m, 0, 4.5e-3);
  vessel(&m->artery, radius_m, vein_depth_m, 14e-3, 3.5e-3);
  return SONDE_OK;
}

void validate_leg_clear(sonde_model *m) {
  sonde_mesh_clear(&m->surface);
  sonde_mesh_clear(&m->femur);
  free(m->normal);
  free(m->area_m2);
  free(m->fat_depth_m);
  free(m->muscle_depth_m);
  free(m->bone_depth_m);
}

sonde_pose validate_leg_pose(double face_m, double z_m) {
  // x to -x, y to -z, z to -y: half a turn about (0, 1, -1).
  const double h = 0.7071067811865476;
  sonde_pose pose = {.position = {0, face_m, z_m}};
  pose.rotation.y = h, pose.rotation.z = -h;
  return pose;
}
