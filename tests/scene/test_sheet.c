// Sheets: bending against a strip that is clamped at one end, gradients against differences, and
// what falls on a thin sheet.
#include "../sanitized.h"
#include "scene_fixture.h"

#include <stdlib.h>

// The gradient of the angle is that of central differences; it turns and moves nothing as a whole.
static void test_gradient(void **unused) {
  (void)unused;
  const sonde_crease crease = {.node = {0, 1, 2, 3}};
  sonde_vec3 x[4] = {
      {0, 0, 0}, {0.01, 0.001, 0.002}, {0.004, 0.008, 0.003}, {0.006, -0.009, 0.004}};
  sonde_vec3 g[4], other[4], sum = vec3(0, 0, 0), turn = sum;
  sonde_crease_angle(&crease, x, g);
  for (int k = 0; k < 4; ++k) {
    double *at[3] = {&x[k].x, &x[k].y, &x[k].z}, got[3] = {g[k].x, g[k].y, g[k].z};
    for (int c = 0; c < 3; ++c) {
      double was = *at[c];
      *at[c] = was + 1e-7;
      double high = sonde_crease_angle(&crease, x, other);
      *at[c] = was - 1e-7;
      double low = sonde_crease_angle(&crease, x, other);
      *at[c] = was;
      assert_near(got[c], (high - low) / 2e-7, 1e-5 * fmax(1, fabs(got[c])));
    }
    sum = v_add(sum, g[k]);
    turn = v_add(turn, v_cross(x[k], g[k]));
  }
  assert_near(v_norm(sum), 0, 1e-10);
  assert_near(v_norm(turn), 0, 1e-12);
}

// A strip of width w and length L, held at one end by two rows, carries F at the other: it sinks by
// F L^3/(3 B w), B its flexural rigidity. The creases of the last row that is held bend as well, so
// that the clamp is half a cell behind it.
static void test_cantilever(void **unused) {
  (void)unused;
  const double B = 2e-4, LENGTH = 0.0825, WIDTH = 0.02, FORCE = 2e-5;
  char text[1024];
  snprintf(
      text, sizeof text,
      "sonde_scene: 1\nstep: {dt_s: 2e-3, newton: 2, sleep_mm: 0}\nbodies:\n"
      "- {name: strip, kind: springs, shape: {sheet_mm: [85, 20], edge_mm: 5}, "
      "springs: {stiffness_n_m: 2000, damping_n_s_m: 1, bending_n_m: %g, "
      "bending_damping_s: 0.02}, mass_kg: 0.002, held_mm: [[[-43, -10, -1], [-37, 10, 1]]], "
      "loads: [{box_mm: [[42, -10, -1], [43, 10, 1]], force_n: [0, 0, %g]}]}\ncontacts: none\n",
      B, FORCE);
  world w = world_of(text);
  const int rounds = ROUNDS(2000, 100); // it needs them all to come to rest
  steps(&w, rounds);
  double tip = 0;
  const sonde_vec3 *x = sonde_scene_nodes(w.state, 0);
  for (uint32_t i = 0; i < sonde_scene_body(w.scene, 0).node_count; ++i) tip = fmax(tip, x[i].z);
  double wanted = FORCE * LENGTH * LENGTH * LENGTH / (3 * B * WIDTH);
  print_message("cantilever: sinks by %.4g mm of %.4g\n", tip * 1e3, wanted * 1e3);
  assert_near(tip / wanted, 1, rounds == 2000 ? 0.03 : 1);
  world_end(&w);
}

// A sheet of 1 mm falls on a ball on a floor: it drapes over the ball, is neither inside out nor
// through the floor, and gains no energy.
static void test_drapes(void **unused) {
  (void)unused;
  world w = world_of(
      "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nstep: {newton: 2}\nmaterials:\n"
      "- {name: skin, contact_stiffness_n_m3: 2e7, contact_damping_s: 2e-3, friction_static: 0.5}\n"
      "bodies:\n"
      "- {name: floor, motion: fixed, shape: {slab_mm: [300, 300, 20]}, material: skin}\n"
      "- {name: ball, motion: fixed, shape: {sphere_mm: 20, edge_mm: 5}, material: skin, "
      "position_mm: [0, 0, 20]}\n"
      "- {name: sheet, kind: springs, shape: {sheet_mm: [80, 80], edge_mm: 5}, material: skin, "
      "springs: {stiffness_n_m: 150, damping_n_s_m: 0.1, thickness_mm: 1, bending_n_m: 1e-4, "
      "bending_damping_s: 0.01}, mass_kg: 0.01, position_mm: [0, 0, 60]}\n");
  double before = INFINITY, gained = 0;
  for (int k = 0; k < ROUNDS(600, 60); ++k) {
    steps(&w, 1);
    double now = total_energy(&w);
    if (k) gained = fmax(gained, now - before);
    before = now;
  }
  sonde_body_measure m = measure(&w, "sheet");
  print_message("sheet on a ball: at %.1f mm, largest gain of energy in a step %.2g J of %.2g\n",
                m.centre_m.z * 1e3, gained, 0.01 * 9.81 * 0.06);
  assert_true(gained < 1e-5);
  assert_true(m.centre_m.z > 0.005 && m.centre_m.z < ROUNDS(0.045, 0.061));
  assert_unflagged(&w);
  world_end(&w);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_gradient),
      cmocka_unit_test(test_cantilever),
      cmocka_unit_test(test_drapes),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
