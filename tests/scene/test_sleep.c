// Nodes of a tissue at rest sleep: little is lost by it, and what presses wakes them.
#include "scene_fixture.h"

#include <stdlib.h>
#include <unistd.h>

// A synthetic leg under gravity with a ball dropped on it.
static world leg_and_ball(const char *sleep_mm) {
  sonde_surface_law law = sonde_surface_law_default();
  sonde_model *model = fixture_model(3, &law);
  char path[] = "/tmp/sonde_model_XXXXXX", text[1024];
  int descriptor = mkstemp(path);
  assert_true(descriptor >= 0);
  close(descriptor);
  assert_int_equal(sonde_model_save(model, path, NULL), SONDE_OK);
  sonde_model_destroy(model);
  snprintf(text, sizeof text,
           "sonde_scene: 1\ngravity_m_s2: [-9.81, 0, 0]\nstep: {dt_s: 1e-3, newton: 2%s}\n"
           "materials:\n- {name: m, contact_stiffness_n_m3: 4e7, contact_damping_s: 2e-3, "
           "friction_static: 0.5}\nbodies:\n"
           "- {name: leg, kind: two_layer, model: %s, material: m}\n"
           "- {name: ball, shape: {sphere_mm: 15, edge_mm: 5}, mass_kg: 0.1, material: m,\n"
           "   position_mm: [350, 0, 0], velocity_m_s: [0, 0, 0]}\n",
           sleep_mm, path);
  world w = world_of(text);
  unlink(path);
  return w;
}

static double farthest(const world *a, const world *b) {
  uint32_t leg = sonde_scene_find(a->scene, "leg");
  const sonde_vec3 *p = sonde_scene_nodes(a->state, leg), *q = sonde_scene_nodes(b->state, leg);
  double most = 0;
  for (uint32_t i = 0; i < sonde_scene_body(a->scene, leg).node_count; ++i)
    most = fmax(most, v_distance(p[i], q[i]));
  return most;
}

// The leg comes to rest and sleeps, the ball wakes a part of it; what moves stays within ten times
// the limit of the run in which nothing sleeps.
static void test_sleep(void **unused) {
  (void)unused;
  world w = leg_and_ball(""), all = leg_and_ball(", sleep_mm: 0");
  uint32_t slots = sonde_scene_body(w.scene, sonde_scene_find(w.scene, "leg")).node_count + 2;
  uint32_t fewest = slots, woken = 0;
  double most = 0, push = 0;
  for (int k = 0; k < 500; ++k) {
    steps(&w, 1);
    steps(&all, 1);
    uint32_t awake = sonde_scene_last(w.state).awake;
    assert_int_equal(sonde_scene_last(all.state).awake, slots);
    push = fmax(push, sonde_scene_pair_measure(w.state, 0).normal_n);
    if (push > 0) woken = awake > woken ? awake : woken;
    if (!(push > 0)) fewest = awake < fewest ? awake : fewest;
    most = fmax(most, farthest(&w, &all));
  }
  double ball = v_distance(measure(&w, "ball").centre_m, measure(&all, "ball").centre_m);
  print_message("sleep: %u of %u awake before the ball, up to %u after, nodes off by at most %.1f "
                "um, the ball by %.1f um\n",
                fewest, slots, woken, most * 1e6, ball * 1e6);
  assert_true(push > 1);
  assert_true(fewest < slots / 2);
  assert_true(woken > fewest + 10);
  assert_near(most, 0, 5e-5);
  assert_near(ball, 0, 5e-5);
  world_end(&w);
  world_end(&all);
}

// What sleeps belongs to the snapshot: a resumed run goes on bit by bit.
static void test_resume(void **unused) {
  (void)unused;
  char path[] = "/tmp/sonde_scene_XXXXXX";
  int descriptor = mkstemp(path);
  assert_true(descriptor >= 0);
  close(descriptor);
  world w = leg_and_ball(""), again = w;
  assert_int_equal(sonde_scene_state_create(w.scene, &again.state, NULL), SONDE_OK);
  steps(&w, 230);
  assert_true(sonde_scene_last(w.state).awake < 100);
  assert_int_equal(sonde_scene_state_save(w.state, path, NULL), SONDE_OK);
  assert_int_equal(sonde_scene_state_load(again.state, path, NULL), SONDE_OK);
  steps(&w, 40);
  steps(&again, 40);
  assert_true(sonde_scene_hash(w.state) == sonde_scene_hash(again.state));
  unlink(path);
  sonde_scene_state_destroy(again.state);
  world_end(&w);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sleep),
      cmocka_unit_test(test_resume),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
