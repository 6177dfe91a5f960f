// A small thigh and small scenes for the tests of the exam room.
#ifndef SONDE_TESTS_EXAM_TEST_H
#define SONDE_TESTS_EXAM_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "base/base.h"
#include "base/maths.h"
#include "exam/player.h"
#include "../barrel_mesh.h"

#include <string.h>
#include <unistd.h>

enum { RINGS = 20, AROUND = 28 };

// Closed round leg along z, 300 mm long, 70 mm in radius at the middle, flat ends.
static inline void barrel_mesh(sonde_mesh *mesh) {
  assert_int_equal(sonde_mesh_create(mesh, 2 + RINGS * AROUND, 2 * AROUND * RINGS, NULL), SONDE_OK);
  mesh->vertices[0] = vec3(0, 0, -0.15);
  mesh->vertices[1] = vec3(0, 0, 0.15);
  for (int i = 0; i < RINGS; ++i)
    for (int k = 0; k < AROUND; ++k) {
      double t = 2.0 * i / (RINGS - 1) - 1.0, turn = 2 * SONDE_PI * k / AROUND;
      double radius_m = 0.07 - 0.008 * t * t;
      mesh->vertices[2 + i * AROUND + k] =
          vec3(radius_m * cos(turn), radius_m * sin(turn), 0.15 * t);
    }
  assert_int_equal(barrel_mesh_faces(mesh, RINGS, AROUND), mesh->face_count);
}

static inline sonde_site barrel_site(void) {
  return (sonde_site){.id = 27,
                      .position_m = vec3(0.07, 0, 0),
                      .normal = vec3(1, 0, 0),
                      .u = vec3(0, 1, 0),
                      .v = vec3(0, 0, 1),
                      .k0_n_m3 = 1.5e5,
                      .xm_m = 0.045};
}

static inline sonde_model *barrel_model(void) {
  sonde_mesh skin;
  barrel_mesh(&skin);
  sonde_site site = barrel_site();
  sonde_model_def def = sonde_model_def_default();
  def.name = "barrel";
  def.provenance = "made for tests";
  def.skin = &skin;
  def.sites = &site;
  def.site_count = 1;
  def.fine_edge_m = 0.008;
  def.fine_reach_m = 0.01;
  sonde_model *model = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_model_build(&def, &model, &error);
  if (status) fail_msg("%s", error.message);
  sonde_mesh_clear(&skin);
  model->checksum = 0x0123456789abcdefu;
  return model;
}

static inline sonde_session_def small_def(const sonde_model *model) {
  sonde_session_def def = sonde_session_def_default();
  def.model = model;
  def.model_path = "barrel.sonde";
  def.controls.probe = 1;
  def.image_width = def.image_height = 64;
  return def;
}

// Approaches, presses to 15 mm, holds, lets go; 0.6 s.
static inline sonde_device press_device(void) {
  sonde_site site = barrel_site();
  const sonde_script_key keys[] = {{0.0, sonde_site_pose(&site, -0.002)},
                                   {0.3, sonde_site_pose(&site, 0.015)},
                                   {0.4, sonde_site_pose(&site, 0.015)},
                                   {0.6, sonde_site_pose(&site, -0.005)}};
  sonde_device device;
  assert_int_equal(sonde_device_script(keys, SONDE_COUNT_OF(keys), 1e-3, &device, NULL), SONDE_OK);
  return device;
}

// With the inside by columns: factoring the solid would take most of a test's time.
static inline sonde_session *open_session(const sonde_session_def *def, sonde_device device) {
  sonde_session *session = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_session_create(def, &device, &session, &error);
  if (status) fail_msg("%s", error.message);
  assert_null(device.self);
  sonde_interior_set_method(session->interior, SONDE_INTERIOR_COLUMNS);
  return session;
}

static inline void close_session(sonde_session *session) {
  sonde_error error = {0};
  if (sonde_session_destroy(session, &error)) fail_msg("%s", error.message);
}

// The recorded inputs once more, compared with what was recorded; images are not made.
static inline sonde_status play_again(const char *path, const sonde_model *model,
                                      const sonde_progress *progress, sonde_replay_result *result,
                                      sonde_error *error) {
  sonde_player *player = NULL;
  const sonde_player_def def = {.path = path, .model = model, .no_cache = true};
  sonde_status status = sonde_player_open(&def, &player, error);
  if (status) return status;
  sonde_interior_set_method(player->session->interior, SONDE_INTERIOR_COLUMNS);
  status = sonde_player_check(player, false, progress, result, error);
  sonde_player_close(player);
  return status;
}

#endif
