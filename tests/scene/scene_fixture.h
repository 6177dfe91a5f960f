// Scenes written as text in the tests.
#ifndef SONDE_TESTS_SCENE_FIXTURE_H
#define SONDE_TESTS_SCENE_FIXTURE_H

#include "fixture.h"
#include "scene/scene.h"

#include <stdio.h>

typedef struct world {
  sonde_scene *scene;
  sonde_scene_state *state;
} world;

static inline world world_of(const char *text) {
  world w = {0};
  sonde_error error = {0};
  sonde_status status = sonde_scene_parse(text, "test.yaml", NULL, &w.scene, &error);
  if (!status) status = sonde_scene_state_create(w.scene, &w.state, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  return w;
}

static inline void world_end(world *w) {
  sonde_scene_state_destroy(w->state);
  sonde_scene_destroy(w->scene);
}

static inline void set_step(world *w, double dt_s, double lambda, uint32_t newton) {
  sonde_scene_step step = sonde_scene_get_step(w->scene);
  step.dt_s = dt_s;
  step.lambda = lambda;
  step.newton_iterations = newton;
  assert_int_equal(sonde_scene_set_step(w->scene, &step, NULL), SONDE_OK);
}

static inline void steps(world *w, uint32_t count) {
  for (uint32_t k = 0; k < count; ++k) sonde_scene_advance(w->state);
}

static inline sonde_body_measure measure(const world *w, const char *name) {
  uint32_t body = sonde_scene_find(w->scene, name);
  assert_int_not_equal(body, UINT32_MAX);
  return sonde_scene_measure(w->state, body);
}

// Of all bodies and of all contacts (J).
static inline double total_energy(const world *w) {
  double sum = 0;
  for (uint32_t b = 0; b < sonde_scene_body_count(w->scene); ++b) {
    sonde_body_measure m = sonde_scene_measure(w->state, b);
    sum += m.kinetic_j + m.elastic_j + m.gravity_j;
  }
  for (uint32_t p = 0; p < sonde_scene_pair_count(w->scene); ++p)
    sum += sonde_scene_pair_measure(w->state, p).energy_j;
  for (uint32_t k = 0; k < sonde_scene_attachment_count(w->scene); ++k)
    sum += sonde_scene_attachment(w->state, k).energy_j;
  return sum;
}

static inline void assert_unflagged(const world *w) {
  assert_int_equal(sonde_scene_all_flags(w->state), 0);
}

#endif
