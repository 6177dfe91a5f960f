// Coulomb friction with bonds: sliding distance, the angle of an incline, no creep, tearing off.
#include "scene_fixture.h"

#include <unistd.h>

// A box on a slab that leans by an angle about y; gravity is turned instead of the slab.
static world on_incline(double angle, const char *step, const char *velocity) {
  char text[2048];
  snprintf(text, sizeof text,
           "sonde_scene: 1\ngravity_m_s2: [%.17g, 0, %.17g]\nstep: {%s}\nmaterials:\n"
           "- {name: cork, contact_stiffness_n_m3: 2e8, contact_damping_s: 1e-3, "
           "friction_static: 0.5, friction_kinetic: 0.4}\n"
           "bodies:\n"
           "- {name: slab, motion: fixed, shape: {slab_mm: [2000, 400, 50]}, material: cork}\n"
           "- {name: box, shape: {box_mm: [80, 60, 30], edge_mm: 20}, mass_kg: 1, material: cork, "
           "position_mm: [0, 0, 14.9796], velocity_m_s: %s}\n",
           9.81 * sin(angle), -9.81 * cos(angle), step, velocity);
  return world_of(text);
}

// v^2/(2 mu g) within 3 %.
static void test_sliding_distance(void **unused) {
  (void)unused;
  static const char *const STEP[] = {"dt_s: 1e-3", "dt_s: 1e-3, newton: 4",
                                     "dt_s: 5e-4, lambda: 0.5"};
  for (int k = 0; k < 3; ++k) {
    world w = on_incline(0, STEP[k], "[1.2, 0, 0]");
    steps(&w, k == 2 ? 1600 : 800);
    sonde_body_measure m = measure(&w, "box");
    double expected = 1.2 * 1.2 / (2 * 0.4 * 9.81);
    print_message("%s: slid %.2f mm, v^2/(2 mu g) = %.2f mm\n", STEP[k], m.centre_m.x * 1e3,
                  expected * 1e3);
    assert_near(m.centre_m.x / expected, 1, 0.03);
    assert_near(v_norm(m.velocity_m_s), 0, 1e-4);
    world_end(&w);
  }
}

// Below atan(mu_s) it holds for good, above it slides at g (sin - mu_k cos).
static void test_incline(void **unused) {
  (void)unused;
  double limit = atan(0.5);
  world w = on_incline(0.95 * limit, "dt_s: 1e-3", "[0, 0, 0]");
  steps(&w, 2000);
  sonde_vec3 before = measure(&w, "box").centre_m;
  steps(&w, 3000);
  sonde_vec3 after = measure(&w, "box").centre_m;
  assert_true(before.x < 5e-4); // about the way of the bonds
  assert_near(v_distance(after, before), 0, 1e-9);
  sonde_pair_measure pair = sonde_scene_pair_measure(w.state, 0);
  assert_near(pair.friction_n.x, 9.81 * sin(0.95 * limit), 1e-4);
  world_end(&w);

  w = on_incline(1.1 * limit, "dt_s: 1e-3", "[0, 0, 0]");
  steps(&w, 300);
  double first = measure(&w, "box").velocity_m_s.x;
  steps(&w, 200);
  double gained = measure(&w, "box").velocity_m_s.x - first;
  double angle = 1.1 * limit;
  assert_near(gained / (0.2 * 9.81 * (sin(angle) - 0.4 * cos(angle))), 1, 0.03);
  world_end(&w);
}

// A spinning box is stopped by torsion of the same bonds, and then stays.
static void test_torsion_holds(void **unused) {
  (void)unused;
  world w = on_incline(0, "dt_s: 1e-3", "[0, 0, 0], spin_rad_s: [0, 0, 8]");
  steps(&w, 1000);
  sonde_body_measure m = measure(&w, "box");
  assert_near(v_norm(m.spin_rad_s), 0, 1e-4);
  steps(&w, 1000);
  sonde_quat turn = q_mul(measure(&w, "box").rotation, q_conj(m.rotation));
  assert_near(v_norm(vec3(turn.x, turn.y, turn.z)), 0, 1e-7);
  world_end(&w);
}

// A box dragged over a soft slab: the friction that both feel is mu times the push, and the slab's
// skin is dragged along.
static void test_on_a_soft_slab(void **unused) {
  (void)unused;
  world w = world_of(
      "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nstep: {dt_s: 1e-3, newton: 2}\nmaterials:\n"
      "- {name: gel, contact_stiffness_n_m3: 5e7, contact_damping_s: 2e-3, friction_static: 0.3}\n"
      "bodies:\n"
      "- {name: slab, kind: lattice, shape: {box_mm: [280, 80, 20]}, position_mm: [0, 0, -10], "
      "lattice: {cell_mm: 10, youngs_pa: 2e5, damping_s: 2e-3}, density_kg_m3: 1000, "
      "material: gel, held_mm: [[[-140, -40, -20], [140, 40, -20]]]}\n"
      "- {name: box, shape: {box_mm: [40, 40, 10]}, mass_kg: 0.2, material: gel, "
      "position_mm: [-100, 0, 5], velocity_m_s: [0.8, 0, 0]}\n");
  double x0 = measure(&w, "box").centre_m.x;
  steps(&w, 100);
  sonde_pair_measure pair = sonde_scene_pair_measure(w.state, 0);
  uint32_t a = sonde_scene_pair_at(w.scene, 0).a;
  double drag = a == 0 ? pair.friction_n.x : -pair.friction_n.x;
  assert_near(drag / pair.normal_n, 0.3, 0.01);
  steps(&w, 400);
  double way = measure(&w, "box").centre_m.x - x0;
  print_message("soft slab: slid %.1f mm, v^2/(2 mu g) = %.1f mm\n", way * 1e3,
                0.64 / (0.6 * 9.81) * 1e3);
  assert_near(way / (0.64 / (0.6 * 9.81)), 1, 0.03);
  world_end(&w);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sliding_distance),
      cmocka_unit_test(test_incline),
      cmocka_unit_test(test_torsion_holds),
      cmocka_unit_test(test_on_a_soft_slab),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
