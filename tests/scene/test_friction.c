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
  assert_true(before.x < 5e-4); // about the displacement of the bonds
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
  double displacement = measure(&w, "box").centre_m.x - x0;
  print_message("soft slab: slid %.1f mm, v^2/(2 mu g) = %.1f mm\n", displacement * 1e3,
                0.64 / (0.6 * 9.81) * 1e3);
  assert_near(displacement / (0.64 / (0.6 * 9.81)), 1, 0.03);
  world_end(&w);
}

// A soft block on a soft slope: holds below atan(mu_s) and slides above it, with equal and opposite
// forces on one line.
static world soft_incline(double angle) {
  char text[2048];
  snprintf(text, sizeof text,
           "sonde_scene: 1\ngravity_m_s2: [%.17g, 0, %.17g]\nstep: {dt_s: 2e-3, newton: 2}\n"
           "materials:\n"
           "- {name: gel, contact_stiffness_n_m3: 5e7, contact_damping_s: 2e-3, "
           "friction_static: 0.5, friction_kinetic: 0.4}\n"
           "bodies:\n"
           "- {name: slope, kind: lattice, shape: {box_mm: [160, 80, 20]}, position_mm: [0, 0, "
           "-10], lattice: {cell_mm: 20, youngs_pa: 2e5, damping_s: 5e-3}, density_kg_m3: 1000, "
           "material: gel, held_mm: [[[-80, -40, -20], [80, 40, -20]]]}\n"
           "- {name: block, kind: lattice, shape: {box_mm: [45, 45, 15]}, position_mm: [-20, 0, "
           "7.5], lattice: {cell_mm: 15, youngs_pa: 2e5, damping_s: 5e-3}, density_kg_m3: 1000, "
           "material: gel}\n",
           9.81 * sin(angle), -9.81 * cos(angle));
  return world_of(text);
}

static void test_soft_incline(void **unused) {
  (void)unused;
  double limit = atan(0.5);
  world w = soft_incline(0.95 * limit);
  steps(&w, 600);
  sonde_vec3 before = measure(&w, "block").centre_m;
  steps(&w, 500);
  double crept = v_distance(measure(&w, "block").centre_m, before);
  sonde_body_measure m = measure(&w, "block");
  sonde_pair_measure pair = sonde_scene_pair_measure(w.state, 0);
  double sign = sonde_scene_pair_at(w.scene, 0).a == sonde_scene_find(w.scene, "block") ? 1 : -1;
  double weight = sonde_scene_body(w.scene, sonde_scene_find(w.scene, "block")).mass.mass_kg * 9.81;
  print_message("soft on soft: crept %.3g um in 1 s, friction %.4f of its part of the weight\n",
                crept * 1e6, -sign * pair.force_n.x / (weight * sin(0.95 * limit)));
  assert_near(crept, 0, 1e-7);
  assert_near(v_norm(m.velocity_m_s), 0, 1e-7);
  assert_near(-sign * pair.force_n.x / (weight * sin(0.95 * limit)), 1, 1e-3);
  assert_near(v_norm(v_add(pair.torque_n_m, pair.torque_b_n_m)) / v_norm(pair.torque_n_m), 0, 1e-9);
  world_end(&w);

  double angle = 1.2 * limit;
  w = soft_incline(angle);
  steps(&w, 75);
  double first = measure(&w, "block").velocity_m_s.x;
  steps(&w, 75);
  double gained = measure(&w, "block").velocity_m_s.x - first;
  print_message("soft on soft: slides at %.3f of g (sin - mu_k cos)\n",
                gained / (0.15 * 9.81 * (sin(angle) - 0.4 * cos(angle))));
  assert_near(gained / (0.15 * 9.81 * (sin(angle) - 0.4 * cos(angle))), 1, 0.05);
  world_end(&w);
}

static sonde_vec3 pair_angular(const world *w) {
  return v_add(measure(w, "left").angular_kg_m2_s, measure(w, "right").angular_kg_m2_s);
}

// Two soft balls that graze: their friction leaves the angular momentum of both as it was.
static void test_soft_couple(void **unused) {
  (void)unused;
  world w = world_of(
      "sonde_scene: 1\nstep: {dt_s: 5e-4, lambda: 0.5, newton: 30, newton_residual: 1e-11, "
      "solver_relative: 1e-11}\nmaterials:\n"
      "- {name: skin, contact_stiffness_n_m3: 2e6, contact_damping_s: 1e-3, friction_static: 0.5}\n"
      "bodies:\n"
      "- {name: left, kind: springs, shape: {sphere_mm: 20, edge_mm: 8}, springs: {stiffness_n_m: "
      "400, damping_n_s_m: 0.1, bulk_n_m5: 1e10}, mass_kg: 0.05, material: skin, "
      "position_mm: [-20.5, 6, 0], velocity_m_s: [0.5, 0, 0.5]}\n"
      "- {name: right, kind: springs, shape: {sphere_mm: 20, edge_mm: 8}, springs: {stiffness_n_m: "
      "400, damping_n_s_m: 0.1, bulk_n_m5: 1e10}, mass_kg: 0.05, material: skin, "
      "position_mm: [20.5, -6, 1], velocity_m_s: [-0.5, 0, -0.5]}\n");
  sonde_vec3 start = pair_angular(&w);
  double most = 0, friction = 0;
  for (int k = 0; k < 150; ++k) {
    steps(&w, 1);
    sonde_pair_measure pair = sonde_scene_pair_measure(w.state, 0);
    friction = fmax(friction, v_norm(pair.friction_n));
    most = fmax(most, v_distance(pair_angular(&w), start));
  }
  print_message("soft couple: friction up to %.2f N, angular momentum changed by %.2g of %.2g\n",
                friction, most / v_norm(start), v_norm(start));
  assert_true(friction > 0.1);
  assert_near(most / v_norm(start), 0, 1e-6);
  assert_unflagged(&w);
  world_end(&w);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sliding_distance), cmocka_unit_test(test_incline),
      cmocka_unit_test(test_torsion_holds),    cmocka_unit_test(test_on_a_soft_slab),
      cmocka_unit_test(test_soft_incline),     cmocka_unit_test(test_soft_couple),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
