// Nodes of a tissue and whole bodies at rest sleep: little is lost by it, and what presses wakes
// them.
#include "scene_fixture.h"

#include <stdlib.h>
#include <unistd.h>

// A synthetic leg under gravity with a ball dropped on it.
static world leg_and_ball(const char *sleep_mm, const char *sags) {
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
           "- {name: leg, kind: two_layer, model: %s, material: m%s}\n"
           "- {name: ball, shape: {sphere_mm: 15, edge_mm: 5}, mass_kg: 0.1, material: m,\n"
           "   position_mm: [350, 0, 0], velocity_m_s: [0, 0, 0]}\n",
           sleep_mm, path, sags);
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
  world w = leg_and_ball("", ", sags: true"), all = leg_and_ball(", sleep_mm: 0", ", sags: true");
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
  world w = leg_and_ball("", ", sags: true"), again = w;
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

// A leg whose shape is the one under its weight sleeps from the start, and without sleep it does
// not stir until the ball comes.
static void test_asleep_at_start(void **unused) {
  (void)unused;
  world w = leg_and_ball("", ""), all = leg_and_ball(", sleep_mm: 0", "");
  steps(&w, 100);
  steps(&all, 100);
  assert_int_equal(sonde_scene_last(w.state).awake, 2);
  assert_near(farthest(&w, &all), 0, 0);
  double push = 0, most = 0;
  for (int k = 0; k < 400; ++k) {
    steps(&w, 1);
    steps(&all, 1);
    push = fmax(push, sonde_scene_pair_measure(w.state, 0).normal_n);
    most = fmax(most, farthest(&w, &all));
  }
  print_message("asleep at the start: pushed by %.2g N, nodes off by at most %.1f um\n", push,
                most * 1e6);
  assert_true(push > 1);
  assert_near(most, 0, 5e-5);
  world_end(&w);
  world_end(&all);
}

// ---- bodies

// Bricks on each other, a filled surface and a lattice on a floor, and a tile that comes down on
// the upper brick after 1.2 s.
static world pile(const char *sleep_mm) {
  char text[2048];
  snprintf(
      text, sizeof text,
      "sonde_scene: 1\ngravity_m_s2: [0, 0, -1]\nstep: {dt_s: 2e-3%s}\nmaterials:\n"
      "- {name: m, contact_stiffness_n_m3: 2e7, contact_damping_s: 0.02, friction_static: 0.5}\n"
      "bodies:\n"
      "- {name: floor, motion: fixed, shape: {slab_mm: [300, 300, 20]}, material: m}\n"
      "- {name: low, shape: {box_mm: [60, 60, 30]}, mass_kg: 0.1, material: m, "
      "position_mm: [0, 0, 15]}\n"
      "- {name: high, shape: {box_mm: [40, 40, 30]}, mass_kg: 0.05, material: m, "
      "position_mm: [3, 2, 45.1]}\n"
      "- {name: block, kind: lattice, shape: {box_mm: [40, 40, 20]}, material: m, "
      "position_mm: [80, 0, 10.2], lattice: {cell_mm: 10, youngs_pa: 1e5, damping_s: 0.02}, "
      "density_kg_m3: 1000}\n"
      "- {name: bag, kind: springs, shape: {box_mm: [30, 30, 30], edge_mm: 10}, material: m, "
      "position_mm: [-80, 0, 15.2], mass_kg: 0.02, "
      "springs: {stiffness_n_m: 300, damping_n_s_m: 2, bulk_n_m5: 1e11}}\n"
      "- {name: tile, shape: {box_mm: [16, 16, 8]}, mass_kg: 0.005, material: m, "
      "position_mm: [3, 2, 784]}\n",
      sleep_mm);
  return world_of(text);
}

// All but the tile in flight sleep; the tile wakes the bricks and nothing else; at the end all
// sleep, forces are still told, and everything is where it is without sleep.
static void test_bodies(void **unused) {
  (void)unused;
  static const char *const NAME[] = {"low", "high", "block", "bag", "tile"};
  world w = pile(""), all = pile(", sleep_mm: 0");
  double before = 0, gained = 0;
  uint32_t fewest = UINT32_MAX, most = 0;
  for (int k = 0; k < 1500; ++k) {
    steps(&w, 1);
    steps(&all, 1);
    uint32_t awake = sonde_scene_last(w.state).awake;
    if (k > 400 && k < 550) fewest = awake < fewest ? awake : fewest;
    if (k > 600 && k < 700) most = awake > most ? awake : most;
    double now = total_energy(&w);
    if (k > 0) gained = fmax(gained, now - before);
    before = now;
  }
  double off = 0;
  for (size_t k = 0; k < sizeof NAME / sizeof *NAME; ++k)
    off = fmax(off, v_distance(measure(&w, NAME[k]).centre_m, measure(&all, NAME[k]).centre_m));
  print_message(
      "bodies: %u slots awake before the tile, %u with it, %u at the end; off by %.2g mm, "
      "largest gain of energy in a step %.2g J\n",
      fewest, most, sonde_scene_last(w.state).awake, off * 1e3, gained);
  assert_int_equal(fewest, 2);
  assert_int_equal(most, 6);
  assert_int_equal(sonde_scene_last(w.state).awake, 0);
  assert_near(off, 0, 1e-5);
  assert_near(gained, 0, 1e-9);
  for (uint32_t p = 0; p < sonde_scene_pair_count(w.scene); ++p) {
    sonde_pair_measure a = sonde_scene_pair_measure(w.state, p);
    sonde_pair_measure b = sonde_scene_pair_measure(all.state, p);
    assert_near(v_distance(a.force_n, b.force_n), 0, 1e-3);
  }
  assert_unflagged(&w);
  world_end(&w);
  world_end(&all);
}

// What drifts freely keeps its momentum, however slow it is.
static void test_drift(void **unused) {
  (void)unused;
  world w = world_of("sonde_scene: 1\nbodies:\n"
                     "- {name: slow, shape: {box_mm: [10, 10, 10]}, mass_kg: 1, "
                     "velocity_m_s: [1e-6, 0, 0]}\n"
                     "- {name: other, shape: {box_mm: [10, 10, 10]}, mass_kg: 1, "
                     "position_mm: [50, 0, 0]}\n");
  steps(&w, 1000);
  assert_near(measure(&w, "slow").momentum_kg_m_s.x, 1e-6, 1e-18);
  world_end(&w);
}

// Sleeping bodies are awake again when a driven one comes, and belong to the snapshot.
static void test_woken_by_driven(void **unused) {
  (void)unused;
  char path[] = "/tmp/sonde_scene_XXXXXX";
  int descriptor = mkstemp(path);
  assert_true(descriptor >= 0);
  close(descriptor);
  world w = world_of("sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nmaterials:\n"
                     "- {name: m, contact_stiffness_n_m3: 2e7, contact_damping_s: 5e-3, "
                     "friction_static: 0.3}\nbodies:\n"
                     "- {name: floor, motion: fixed, shape: {slab_mm: [300, 300, 20]}, "
                     "material: m}\n"
                     "- {name: brick, shape: {box_mm: [30, 30, 30]}, mass_kg: 0.05, material: m, "
                     "position_mm: [0, 0, 15]}\n"
                     "- {name: pusher, motion: driven, shape: {box_mm: [20, 20, 20]}, material: m, "
                     "path: [\n  {time_s: 0, position_mm: [-60, 0, 15]},\n"
                     "  {time_s: 0.6, position_mm: [-60, 0, 15]},\n"
                     "  {time_s: 0.8, position_mm: [-20, 0, 15]}]}\n");
  world again = w;
  assert_int_equal(sonde_scene_state_create(w.scene, &again.state, NULL), SONDE_OK);
  steps(&w, 550);
  assert_int_equal(sonde_scene_last(w.state).awake, 0);
  assert_near(sonde_scene_pair_measure(w.state, 0).force_n.z, -0.05 * 9.81, 1e-3);
  assert_int_equal(sonde_scene_state_save(w.state, path, NULL), SONDE_OK);
  assert_int_equal(sonde_scene_state_load(again.state, path, NULL), SONDE_OK);
  assert_near(sonde_scene_pair_measure(again.state, 0).force_n.z, -0.05 * 9.81, 1e-3);
  steps(&w, 1000);
  steps(&again, 1000);
  assert_true(sonde_scene_hash(w.state) == sonde_scene_hash(again.state));
  // Where it was pushed to, and v^2/(2 mu g) further, as it hops ahead of the pusher or not.
  assert_near(measure(&w, "brick").centre_m.x, 0.005 + 0.04 / (2 * 0.3 * 9.81), 5e-4);
  assert_int_equal(sonde_scene_last(w.state).awake, 0);
  unlink(path);
  sonde_scene_state_destroy(again.state);
  world_end(&w);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sleep),           cmocka_unit_test(test_resume),
      cmocka_unit_test(test_asleep_at_start), cmocka_unit_test(test_bodies),
      cmocka_unit_test(test_drift),           cmocka_unit_test(test_woken_by_driven),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
