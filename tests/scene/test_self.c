// A body's contact with itself: two layers of one sheet against the foundation of
// docs/scene_theory.md, and a sheet that falls in folds.
#include "scene_fixture.h"

#include <stdlib.h>

// Of the layers, less the fold: parts less than 1.5 thicknesses apart at rest do not touch.
static const double AREA_M2 = (0.1 - 0.75 * 2e-3) * 0.05;

static const double DT_S = 1e-5;
static const char STRIP[] =
    "sonde_scene: 1\nstep: {dt_s: 1e-5, sleep_mm: 0}\nmaterials:\n"
    "- {name: skin, contact_stiffness_n_m3: 2e7, contact_damping_s: 0}\nbodies:\n"
    "- {name: strip, kind: springs, shape: {sheet_mm: [200, 50], edge_mm: 2.5}, material: skin, "
    "springs: {stiffness_n_m: 1e-6, thickness_mm: 2}, mass_kg: 0.02%s}\ncontacts: none\n";

// Velocities that one short step gives to a strip whose right half lies over its left half, `apart`
// above it: momentum of the upper half over time is the force.
static double press(const char *more, double apart, sonde_vec3 *sum, sonde_vec3 *turn) {
  char text[1024];
  snprintf(text, sizeof text, STRIP, more);
  world w = world_of(text);
  uint32_t count = sonde_scene_body(w.scene, 0).node_count;
  sonde_vec3 *x = calloc(count, sizeof *x);
  bool *over = calloc(count, sizeof *over);
  assert_true(x && over);
  const double mass = 0.02 / count;
  for (uint32_t i = 0; i < count; ++i) {
    x[i] = sonde_scene_nodes(w.state, 0)[i];
    over[i] = x[i].x > 0.001;
    if (over[i]) x[i] = vec3(-x[i].x, x[i].y, apart);
  }
  sonde_scene_set_nodes(w.state, 0, x, NULL);
  steps(&w, 1);
  double force = 0;
  const sonde_vec3 *v = sonde_scene_node_velocities(w.state, 0);
  for (uint32_t i = 0; i < count; ++i)
    if (over[i]) force += mass * v[i].z / DT_S;
  sonde_body_measure m = measure(&w, "strip");
  *sum = v_scale(m.momentum_kg_m_s, 1 / DT_S), *turn = v_scale(m.angular_kg_m2_s, 1 / DT_S);
  free(x);
  free(over);
  world_end(&w);
  return force;
}

// The layers push each other by kappa/2 (t - d) on their common area, kappa that of the material;
// force and torque of a body on itself are zero. Beyond the thickness nothing pushes.
static void test_layers(void **unused) {
  (void)unused;
  sonde_vec3 sum, turn;
  for (double apart = 0.5e-3; apart < 2e-3; apart += 0.5e-3) {
    double wanted = 0.5 * 2e7 * (2e-3 - apart) * AREA_M2;
    double force = press("", apart, &sum, &turn);
    print_message("layers %.1f mm apart: %.4g N of %.4g\n", apart * 1e3, force, wanted);
    assert_near(force / wanted, 1, 0.005);
    assert_near(v_norm(sum) / wanted, 0, 1e-9);
    assert_near(v_norm(turn) / (wanted * 0.1), 0, 1e-6);
  }
  double wanted = 0.5 * 2e7 * 1e-3 * AREA_M2;
  assert_near(press("", 2.01e-3, &sum, &turn) / wanted, 0, 2e-3); // at the fold
  assert_near(press(", self_contact_mm: 0", 1e-3, &sum, &turn) / wanted, 0, 1e-6);
}

// A ribbon that stands on the floor folds as it falls. With contact its layers lie on each other,
// no step gains energy; without, it goes through itself, which is flagged.
static void test_folds(void **unused) {
  (void)unused;
  for (int contact = 1; contact >= 0; --contact) {
    char text[1400];
    snprintf(
        text, sizeof text,
        "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nstep: {newton: 4, dt_s: 1e-3}\nmaterials:\n"
        "- {name: skin, contact_stiffness_n_m3: 2e7, contact_damping_s: 2e-3, friction_static: "
        "0.5}\n"
        "bodies:\n"
        "- {name: floor, motion: fixed, shape: {slab_mm: [400, 400, 20]}, material: skin}\n"
        "- {name: ribbon, kind: springs, shape: {sheet_mm: [160, 10], edge_mm: 5}, material: skin, "
        "springs: {stiffness_n_m: 300, damping_n_s_m: 0.1, thickness_mm: 2, bending_n_m: 2e-6, "
        "bending_damping_s: 0.02}, mass_kg: 0.005, position_mm: [0, 0, 82], rotation: {axis: "
        "[0, 1, 0], angle_deg: 88}%s}\n",
        contact ? "" : ", self_contact_mm: 0");
    world w = world_of(text);
    double before = INFINITY, gained = 0;
    bool crossed = false;
    for (int k = 0; k < 500 && !crossed; ++k) {
      steps(&w, 1);
      double now = total_energy(&w);
      if (k) gained = fmax(gained, now - before);
      before = now;
      crossed = sonde_scene_all_flags(w.state) & SONDE_SCENE_INVERTED;
    }
    sonde_body_measure m = measure(&w, "ribbon");
    print_message(
        "ribbon %s contact: at %.1f mm, largest gain of energy in a step %.2g J of %.2g, %s\n",
        contact ? "with" : "without", m.centre_m.z * 1e3, gained, 0.005 * 9.81 * 0.08,
        crossed ? "through itself" : "sound");
    assert_true(crossed == !contact);
    if (contact) assert_true(gained < 1e-5);
    world_end(&w);
  }
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_layers), cmocka_unit_test(test_folds)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
