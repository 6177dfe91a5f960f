// A leg made by hand below a probe, and its picture.
#ifndef SONDE_TEST_ECHO_BENCH_H
#define SONDE_TEST_ECHO_BENCH_H

#include "interior/interior.h"
#include "interior/tube.h"
#include "sonde/echo.h"

static const double leg_radius = 0.08;

typedef struct bench {
  tube leg;
  sonde_interior *interior;
  sonde_echo *echo;
  sonde_image image;
  sonde_pathology pathology;
  sonde_echo_settings settings;
  sonde_pose pose;
  sonde_vec3 *forces;
} bench;

static inline void look(bench *b, const sonde_vec3 *positions) {
  const sonde_vec3 *p = positions ? positions : b->leg.model.surface.vertices;
  b->interior->model = &b->leg.model; // the bench was returned by value
  sonde_interior_update(b->interior,
                        &(sonde_interior_input){p, b->forces, b->pose, &b->pathology, -1, 1,
                                                INFINITY, INFINITY, 0, SONDE_POSTURE_SUPINE, NULL});
  sonde_echo_render(b->echo, b->pose, 0.04, &b->pathology, &b->settings, &b->image);
}

// The interior keeps the address of the leg: the bench stays where it is.
static inline void bench_create(bench *b, double radius, double bone, double fat_m, bool plain,
                                bool vessels) {
  *b = (bench){.leg = tube_create(radius, bone, 0.3, fat_m, 160, 60)};
  if (!vessels) b->leg.model.vein.count = b->leg.model.artery.count = 0;
  sonde_echo_def def = {.version = SONDE_DEF_VERSION, .plain = plain, .seed = 5};
  assert_int_equal(sonde_interior_create(&b->leg.model, &b->interior, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_create(b->interior, &def, &b->echo, NULL), SONDE_OK);
  assert_int_equal(sonde_image_create(512, 512, &b->image, NULL), SONDE_OK);
  assert_int_equal(sonde_pathology_preset("healthy", &b->pathology, NULL), SONDE_OK);
  b->settings = sonde_echo_settings_default();
  b->pose = tube_pose(radius - 3e-3, 0.15);
  b->forces = SONDE_NEW(sonde_vec3, b->leg.model.surface.vertex_count);
}

static inline void bench_clear(bench *b) {
  sonde_echo_destroy(b->echo);
  sonde_interior_destroy(b->interior);
  sonde_image_clear(&b->image);
  tube_clear(&b->leg);
  sonde_free(b->forces);
}

#endif
