// No body passes through another, whatever the step: the sweep over soft pads, and bodies that fly
// farther in a step than they are thick.
#include "scene_fixture.h"
#include "../sanitized.h"

// A pad, a ball of springs, a brick and a probe that ploughs: at long steps.
static world four_kinds(double dt_s, double youngs_pa, int newton) {
  char text[2048];
  snprintf(
      text, sizeof text,
      "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nstep: {dt_s: %g, newton: %d}\nmaterials:\n"
      "- {name: skin, contact_stiffness_n_m3: 2e7, contact_damping_s: 2e-3, "
      "friction_static: 0.5, friction_kinetic: 0.4}\n"
      "bodies:\n"
      "- {name: pad, kind: lattice, shape: {box_mm: [80, 80, 30]}, position_mm: [0, 0, -15], "
      "lattice: {cell_mm: 10, youngs_pa: %g, damping_s: 5e-3}, density_kg_m3: 1000, "
      "material: skin, held_mm: [[[-40, -40, -30], [40, 40, -30]]]}\n"
      "- {name: ball, kind: springs, shape: {sphere_mm: 15, edge_mm: 5}, "
      "springs: {stiffness_n_m: 150, damping_n_s_m: 0.1, bulk_n_m5: 1e11}, mass_kg: 0.03, "
      "material: skin, position_mm: [-15, 0, 20]}\n"
      "- {name: brick, shape: {box_mm: [20, 20, 20]}, mass_kg: 0.05, material: skin, "
      "position_mm: [20, 0, 15], spin_rad_s: [0, 3, 1]}\n"
      "- {name: probe, motion: driven, shape: {probe: point}, material: skin, path: [\n"
      "  {time_s: 0, position_mm: [0, 25, 5], rotation: {axis: [1, 0, 0], angle_deg: 180}},\n"
      "  {time_s: 0.2, position_mm: [0, 25, -4], rotation: {axis: [1, 0, 0], angle_deg: 180}},\n"
      "  {time_s: 0.8, position_mm: [0, -25, -4], rotation: {axis: [1, 0, 0], angle_deg: 180}}]}\n",
      dt_s, newton, youngs_pa);
  return world_of(text);
}

// Those of the 30 runs of docs/scene.md in which bodies went through the pad at whole steps.
static void test_sweep(void **unused) {
  (void)unused;
  static const struct {
    double dt_s, youngs_pa;
    int newton;
  } RUN[] = {{0.01, 3e3, 1}, {0.02, 3e3, 1}, {0.02, 3e3, 4}, {0.02, 3e5, 4}};
  for (size_t k = 0; k < ROUNDS(sizeof RUN / sizeof *RUN, 2); ++k) {
    world w = four_kinds(RUN[k].dt_s, RUN[k].youngs_pa, RUN[k].newton);
    steps(&w, (uint32_t)(0.3 / RUN[k].dt_s + 0.5));
    assert_unflagged(&w);
    double ball = measure(&w, "ball").centre_m.z, brick = measure(&w, "brick").centre_m.z;
    print_message("dt %g ms, %g Pa, %d iterations: ball at %.1f mm, brick at %.1f mm\n",
                  RUN[k].dt_s * 1e3, RUN[k].youngs_pa, RUN[k].newton, ball * 1e3, brick * 1e3);
    assert_true(ball > 0 && ball < 0.015);
    assert_true(brick > -0.005 && brick < 0.015);
    world_end(&w);
  }
}

// A body flies at a plate; a stiff contact holds 2.5 J within a fraction of a millimetre.
static world shot(const char *plate, const char *body, double dt_s, double speed_m_s) {
  char text[1536];
  snprintf(text, sizeof text,
           "sonde_scene: 1\nstep: {dt_s: %g}\nmaterials:\n"
           "- {name: steel, contact_stiffness_n_m3: 4e10, contact_damping_s: 1e-5}\nbodies:\n"
           "- {name: plate, material: steel, %s}\n"
           "- {name: bullet, material: steel, mass_kg: 0.05, position_mm: [3, 5, 113], "
           "velocity_m_s: [0, 0, %g], %s}\n",
           dt_s, plate, -speed_m_s, body);
  return world_of(text);
}

// Up to ten bodies' lengths per step, head on and tumbling, against a thin plate and a soft block:
// what arrives leaves again, no faster than it came but for a few per cent of so coarse a step.
static void test_fast_bodies(void **unused) {
  (void)unused;
  static const char *const PLATE[] = {
      "motion: fixed, shape: {box_mm: [200, 200, 5]}",
      "kind: lattice, shape: {box_mm: [120, 120, 30]}, lattice: {cell_mm: 10, youngs_pa: 1e7, "
      "damping_s: 1e-3}, density_kg_m3: 1000, held_mm: [[[-60, -60, -15], [60, 60, -15]]]"};
  static const char *const BODY[] = {
      "shape: {box_mm: [20, 20, 20]}", "shape: {box_mm: [20, 20, 20]}, spin_rad_s: [30, 50, 20]",
      "shape: {box_mm: [40, 40, 4]}, rotation: {axis: [1, 0, 0], angle_deg: 3}",
      "shape: {sphere_mm: 10, edge_mm: 6}"};
  static const double DT_S[] = {0.005, 0.02}, SPEED_M_S[] = {1, 10};
  for (int k = 0; k < 32; ++k) {
    double speed = SPEED_M_S[k & 1], dt = DT_S[k >> 1 & 1];
    world w = shot(PLATE[k >> 4], BODY[k >> 2 & 3], dt, speed);
    double momentum = measure(&w, "bullet").momentum_kg_m_s.z;
    steps(&w, (uint32_t)(0.2 / speed / dt + 2));
    sonde_body_measure m = measure(&w, "bullet");
    assert_unflagged(&w);
    assert_true(m.centre_m.z > 0.001);
    assert_true(m.momentum_kg_m_s.z > 0 && m.momentum_kg_m_s.z < -1.05 * momentum);
    world_end(&w);
  }
}

// Flight, and steps that are short for the speed, stay whole.
static void test_whole_steps(void **unused) {
  (void)unused;
  world w = shot("motion: fixed, shape: {box_mm: [200, 200, 5]}", "shape: {box_mm: [20, 20, 20]}",
                 0.005, 10);
  steps(&w, 1); // 50 mm of 100
  assert_int_equal(sonde_scene_last(w.state).cuts, 0);
  steps(&w, 2);
  assert_true(sonde_scene_last(w.state).cuts > 1);
  assert_near(sonde_scene_time(w.state), 0.015, 1e-15);
  world_end(&w);
  w = shot("motion: fixed, shape: {box_mm: [200, 200, 5]}", "shape: {box_mm: [20, 20, 20]}", 1e-4,
           10);
  for (int k = 0; k < 150; ++k) {
    steps(&w, 1);
    assert_int_equal(sonde_scene_last(w.state).cuts, 0);
  }
  world_end(&w);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sweep),
      cmocka_unit_test(test_fast_bodies),
      cmocka_unit_test(test_whole_steps),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
