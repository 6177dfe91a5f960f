// The finite-element study of vessels (tests/data/vein_compression): its prismatic thigh, its
// bonded probe, its tables.
#ifndef SONDE_TEST_STUDY_H
#define SONDE_TEST_STUDY_H

#include "interior/tube.h"

#include <stdio.h>
#include <stdlib.h>

enum { STUDY_AROUND = 191, STUDY_ROWS = 61 };
static const double study_radius = 76e-3, study_length = 0.12;

// Femur 4 mm beyond the axis; skin 1.8 mm and fat 12 mm; vessels at `depth` under +y.
static inline tube study_thigh(double depth) {
  tube t = {.around = STUDY_AROUND, .rows = STUDY_ROWS};
  sonde_vec3 low = vec3(0, 0, 0), high = vec3(0, 0, study_length), off = vec3(0, -4e-3, 0);
  tube_round(&t.model.surface, t.around, t.rows, low, high, study_radius, study_radius);
  tube_round(&t.model.femur, 48, 12, v_add(low, off), v_add(high, off), 0.014, 0.014);
  tube_finish(&t, 1.8e-3, 13.8e-3);
  double r = study_radius - depth, angle = SONDE_PI / 2 - asin(11e-3 / r);
  tube_vessel(&t.model.vein, study_radius, r, SONDE_PI / 2, study_length, 4.5e-3);
  tube_vessel(&t.model.artery, study_radius, r, angle, study_length, 3.465e-3);
  for (uint32_t i = 0; i < t.model.artery.count; ++i) // same depth, not same radius
    t.model.artery.point[i].centre_m.x = 11e-3, t.model.artery.point[i].centre_m.y = r;
  return t;
}

static inline sonde_pose study_pose(double penetration) {
  return tube_pose(study_radius - penetration, study_length / 2);
}

// Skin under the arc of 60 x 12 mm moves by the penetration; `force_n` is spread over it.
static inline void study_press(sonde_interior *in, const tube *t, double penetration,
                               double force_n, const sonde_pathology *pathology) {
  uint32_t n = t->model.surface.vertex_count, touched = 0;
  sonde_vec3 *now = SONDE_NEW(sonde_vec3, n), *force = SONDE_NEW(sonde_vec3, n);
  for (int pass = 0; pass < 2; ++pass)
    for (uint32_t i = 0; i < n; ++i) {
      sonde_vec3 p = t->model.surface.vertices[i];
      now[i] = p;
      bool under = fabs(p.z - study_length / 2) < 6.1e-3 && i < t->around * t->rows &&
                   fabs(atan2(p.x, p.y)) * study_radius < 30.2e-3;
      if (!under) continue;
      touched += pass == 0;
      now[i].y -= penetration;
      force[i] = vec3(0, -force_n / touched, 0);
    }
  sonde_interior_update(in, &(sonde_interior_input){.positions_m = now,
                                                    .contact_forces_n = force,
                                                    .world_from_probe = study_pose(0),
                                                    .pathology = pathology,
                                                    .dt_s = -1,
                                                    .tick = 1,
                                                    .face_half_x_m = 30e-3,
                                                    .face_half_y_m = 6e-3});
  sonde_free(now);
  sonde_free(force);
}

// Stress where vessels would lie, from the study.
typedef struct stress_row {
  double penetration_m, force_n;
  char point[12];
  double xx, yy, zz; // Pa, tension positive
} stress_row;

static inline uint32_t read_stress(stress_row *rows, uint32_t capacity) {
  FILE *file = fopen(SONDE_SOURCE_DIR "/tests/data/vein_compression/stress_no_vessel.csv", "r");
  char line[512];
  uint32_t count = 0;
  while (file != NULL && count < capacity && fgets(line, sizeof line, file) != NULL) {
    double v[3], xx, yy, zz;
    stress_row *r = &rows[count];
    if (sscanf(line, "novessel,%lf,%lf,%lf,%11[a-z0-9],%lf,%lf,%lf", &v[0], &v[1], &v[2], r->point,
               &xx, &yy, &zz) != 7)
      continue;
    *r = (stress_row){.penetration_m = v[0] * 1e-3,
                      .force_n = v[1],
                      .xx = xx * 1e3,
                      .yy = yy * 1e3,
                      .zz = zz * 1e3,
                      .point = {0}};
    (void)sscanf(line, "novessel,%*f,%*f,%*f,%11[a-z0-9]", r->point);
    ++count;
  }
  if (file != NULL) fclose(file);
  return count;
}

// Effective outside pressure on a vessel along z.
static inline double effective(double xx, double yy, double zz) {
  return -(2 * (xx + yy) - zz) / 3;
}

#endif
