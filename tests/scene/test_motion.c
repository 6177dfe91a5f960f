// Free bodies: inertia of the primitives, conservation in flight, the explicit limit, order of
// convergence, snapshots.
#include "scene_fixture.h"

#include <unistd.h>

static const char FLIGHT[] = "sonde_scene: 1\n"
                             "step: {dt_s: 1e-3, lambda: 0.5}\n"
                             "contacts: none\n"
                             "bodies:\n"
                             "- name: brick\n"
                             "  shape: {box_mm: [40, 100, 200]}\n"
                             "  density_kg_m3: 1200\n"
                             "  velocity_m_s: [0.3, -0.2, 0.1]\n"
                             "  spin_rad_s: [0.1, 9, 0.2]\n";

static void test_inertia_of_primitives(void **unused) {
  (void)unused;
  world w =
      world_of("sonde_scene: 1\ncontacts: none\nbodies:\n"
               "- {name: box, shape: {box_mm: [20, 30, 50], edge_mm: 4}, density_kg_m3: 1000}\n"
               "- {name: ball, shape: {sphere_mm: 30, edge_mm: 1}, density_kg_m3: 1000}\n"
               "- {name: rod, shape: {cylinder_mm: {radius: 10, length: 80}, edge_mm: 0.5}, "
               "mass_kg: 2}\n"
               "- {name: egg, shape: {ellipsoid_mm: [10, 20, 30], edge_mm: 0.7}, mass_kg: 3}\n");
  sonde_mass box = sonde_scene_body(w.scene, 0).mass, ball = sonde_scene_body(w.scene, 1).mass;
  sonde_mass rod = sonde_scene_body(w.scene, 2).mass, egg = sonde_scene_body(w.scene, 3).mass;
  assert_near(box.mass_kg, 0.03, 0.03e-9);
  assert_near(box.inertia_kg_m2.m[0][0], 0.03 / 12 * (9e-4 + 25e-4), 1e-6 * 8.5e-6);
  assert_near(box.inertia_kg_m2.m[2][2], 0.03 / 12 * (4e-4 + 9e-4), 1e-6 * 3e-6);
  double ball_kg = 4.0 / 3 * SONDE_PI * 27e-6 * 1000;
  assert_near(ball.mass_kg / ball_kg, 1, 2e-3);
  assert_near(ball.inertia_kg_m2.m[1][1] / (0.4 * ball.mass_kg * 9e-4), 1, 2e-3);
  assert_near(rod.mass_kg, 2, 1e-12);
  assert_near(rod.inertia_kg_m2.m[2][2] / (0.5 * 2 * 1e-4), 1, 1e-3);
  assert_near(rod.inertia_kg_m2.m[0][0] / (2 * (3e-4 + 64e-4) / 12), 1, 1e-3);
  assert_near(egg.inertia_kg_m2.m[0][0] / (3 * (4e-4 + 9e-4) / 5), 1, 3e-3);
  assert_near(egg.inertia_kg_m2.m[2][2] / (3 * (1e-4 + 4e-4) / 5), 1, 3e-3);
  world_end(&w);
}

// Spin about the middle axis: it tumbles, and both momenta stay.
static void test_flight_keeps_momenta(void **unused) {
  (void)unused;
  for (int scheme = 0; scheme < 3; ++scheme) {
    world w = world_of(FLIGHT);
    set_step(&w, 1e-3, 0.5 * scheme, 1);
    sonde_body_measure start = measure(&w, "brick");
    bool turned = false;
    for (int k = 0; k < 4000; ++k) {
      steps(&w, 1);
      turned |= q_rotate(measure(&w, "brick").rotation, vec3(0, 1, 0)).y < -0.5;
    }
    sonde_body_measure end = measure(&w, "brick");
    assert_true(turned);
    assert_near(v_distance(end.momentum_kg_m_s, start.momentum_kg_m_s), 0,
                1e-12 * v_norm(start.momentum_kg_m_s));
    assert_near(v_distance(end.angular_kg_m2_s, start.angular_kg_m2_s), 0,
                1e-11 * v_norm(start.angular_kg_m2_s));
    if (scheme == 1) assert_near(end.kinetic_j / start.kinetic_j, 1, 1e-4);
    world_end(&w);
  }
}

// Same tumbling, half the step: the error falls by four (lambda = 1/2) and by two (lambda = 1).
static double flight_error(double dt_s, double lambda, sonde_vec3 exact, sonde_vec3 *spin) {
  world w = world_of(FLIGHT);
  set_step(&w, dt_s, lambda, 1);
  steps(&w, (uint32_t)round(0.5 / dt_s));
  *spin = measure(&w, "brick").spin_rad_s;
  world_end(&w);
  return v_distance(*spin, exact);
}

static void test_order_of_tumbling(void **unused) {
  (void)unused;
  sonde_vec3 exact, spin;
  flight_error(1e-5, 0.5, vec3(0, 0, 0), &exact);
  double second = flight_error(2e-3, 0.5, exact, &spin) / flight_error(1e-3, 0.5, exact, &spin);
  double first = flight_error(2e-4, 1, exact, &spin) / flight_error(1e-4, 1, exact, &spin);
  assert_near(log2(second), 2, 0.1);
  assert_near(log2(first), 1, 0.1);
}

static void test_fall(void **unused) {
  (void)unused;
  world w = world_of("sonde_scene: 1\ngravity_m_s2: [0, 0, -10]\nstep: {lambda: 0.5}\nbodies:\n"
                     "- {name: stone, shape: {sphere_mm: 5}, mass_kg: 0.1}\n");
  steps(&w, 500);
  sonde_body_measure m = measure(&w, "stone");
  assert_near(m.centre_m.z, -1.25, 1e-12);
  assert_near(m.velocity_m_s.z, -5, 1e-12);
  assert_near(m.kinetic_j + m.gravity_j, 0, 1e-12);
  world_end(&w);
}

// A driven body stands where its path says, whatever the step.
static void test_driven_path(void **unused) {
  (void)unused;
  world w = world_of("sonde_scene: 1\nstep: {dt_s: 3e-3}\nbodies:\n"
                     "- name: probe\n  motion: driven\n  shape: {probe: linear}\n  path:\n"
                     "  - {time_s: 0, position_mm: [0, 0, 10]}\n"
                     "  - {time_s: 0.3, position_mm: [30, 0, 10], rotation: {axis: [0, 0, 1], "
                     "angle_deg: 90}}\n");
  steps(&w, 50); // 0.15 s: half way
  sonde_body_measure m = measure(&w, "probe");
  sonde_vec3 local = sonde_scene_body(w.scene, 0).mass.centre_m;
  sonde_vec3 expected = pose_apply(
      (sonde_pose){vec3(0.015, 0, 0.01), {cos(SONDE_PI / 8), 0, 0, sin(SONDE_PI / 8)}}, local);
  assert_near(v_distance(m.centre_m, expected), 0, 1e-12);
  assert_near(m.spin_rad_s.z, SONDE_PI / 2 / 0.3, 1e-9);
  steps(&w, 100);
  m = measure(&w, "probe");
  assert_near(m.centre_m.x, 0.03 + local.x * 0 - local.y, 1e-12);
  assert_near(v_norm(m.velocity_m_s), 0, 1e-12);
  world_end(&w);
}

static void test_snapshot_goes_on_bit_by_bit(void **unused) {
  (void)unused;
  char path[] = "/tmp/sonde_scene_XXXXXX";
  int descriptor = mkstemp(path);
  assert_true(descriptor >= 0);
  close(descriptor);
  world w = world_of(FLIGHT);
  steps(&w, 100);
  assert_int_equal(sonde_scene_state_save(w.state, path, NULL), SONDE_OK);
  steps(&w, 100);
  uint64_t hash = sonde_scene_hash(w.state);
  world other = world_of(FLIGHT);
  assert_int_equal(sonde_scene_state_load(other.state, path, NULL), SONDE_OK);
  assert_int_equal(sonde_scene_tick(other.state), 100);
  steps(&other, 100);
  assert_true(sonde_scene_hash(other.state) == hash);
  sonde_scene_state_reset(other.state);
  steps(&other, 200);
  assert_true(sonde_scene_hash(other.state) == hash);
  world_end(&other);

  other = world_of("sonde_scene: 1\nbodies:\n- {name: a, shape: {sphere_mm: 5}, mass_kg: 1}\n");
  sonde_error error = {0};
  assert_int_equal(sonde_scene_state_load(other.state, path, &error), SONDE_MISMATCH);
  world_end(&other);
  FILE *file = fopen(path, "r+b");
  fseek(file, 100, SEEK_SET);
  fputc('x', file);
  fclose(file);
  assert_int_equal(sonde_scene_state_load(w.state, path, &error), SONDE_CHECKSUM);
  world_end(&w);
  unlink(path);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_inertia_of_primitives),
      cmocka_unit_test(test_flight_keeps_momenta),
      cmocka_unit_test(test_order_of_tumbling),
      cmocka_unit_test(test_fall),
      cmocka_unit_test(test_driven_path),
      cmocka_unit_test(test_snapshot_goes_on_bit_by_bit),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
