// Attachments: ball joints, hinges, welds, nodes pinned to a frame; against pendulums, oscillators,
// the weight that hangs on them, and one body in place of two.
#include "scene_fixture.h"

// Time between the first two passes of x through 0 in one direction, doubled by caller's choice.
static double period(world *w, const char *name, double dt, double seconds, double middle) {
  double last = measure(w, name).centre_m.x - middle, first = -1, previous = -1;
  uint32_t count = 0;
  for (double t = dt; t < seconds; t += dt) {
    steps(w, 1);
    double x = measure(w, name).centre_m.x - middle;
    if (last < 0 && x >= 0) {
      double at = t - dt * x / (x - last);
      if (first < 0) first = at;
      previous = at;
      ++count;
    }
    last = x;
  }
  assert_true(count > 2);
  return (previous - first) / (count - 1);
}

// A rod of 100 x 20 x 20 mm that swings about a point, or about a hinge, at its end: the period of
// a compound pendulum, 2 pi sqrt(I/(m g d)) (1 + a^2/16) with the amplitude a.
static void swing(const char *points) {
  const double AMPLITUDE = 0.05, DT = 1e-3;
  char text[1024];
  snprintf(text, sizeof text,
           "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nstep: {dt_s: %g, lambda: 0.5, newton: 3, "
           "sleep_mm: 0}\nbodies:\n"
           "- {name: rod, shape: {box_mm: [20, 20, 100]}, mass_kg: 0.2, "
           "position_mm: [%.9g, 0, %.9g], rotation: {axis: [0, 1, 0], angle_deg: %.9g}}\n"
           "attachments:\n- {bodies: [rod], points_mm: %s, stiffness_n_m: 1e6, damping_n_s_m: 0}\n",
           DT, -50 * sin(AMPLITUDE), -50 * cos(AMPLITUDE), AMPLITUDE * 180 / SONDE_PI, points);
  world w = world_of(text);
  double start = total_energy(&w);
  double inertia = 0.2 * ((0.1 * 0.1 + 0.02 * 0.02) / 12 + 0.05 * 0.05);
  double wanted =
      2 * SONDE_PI * sqrt(inertia / (0.2 * 9.81 * 0.05)) * (1 + AMPLITUDE * AMPLITUDE / 16);
  double got = period(&w, "rod", DT, 3, 0);
  sonde_attachment_measure m = sonde_scene_attachment(w.state, 0);
  print_message("pendulum at %s: period %.6g s of %.6g, stretch %.2g mm, energy off by %.2g of the "
                "swing's\n",
                points, got, wanted, m.stretch_m * 1e3,
                (total_energy(&w) - start) / (0.2 * 9.81 * 0.05 * AMPLITUDE * AMPLITUDE / 2));
  assert_near(got / wanted, 1, 1e-3);
  assert_near(measure(&w, "rod").centre_m.y, 0, 1e-6);
  assert_near(m.stretch_m, 0, 5e-6);
  assert_near(total_energy(&w), start, 1e-3 * 0.2 * 9.81 * 0.05 * AMPLITUDE * AMPLITUDE / 2);
  assert_unflagged(&w);
  world_end(&w);
}

static void test_pendulum(void **unused) {
  (void)unused;
  swing("[[0, 0, 0]]");
  swing("[[0, -10, 0], [0, 10, 0]]");
}

// Two free bodies on one spring: frequency sqrt(k/m_red), decay c/(2 m_red); momentum stays.
static void test_oscillator(void **unused) {
  (void)unused;
  world w =
      world_of("sonde_scene: 1\nstep: {dt_s: 2e-4, lambda: 0.5, sleep_mm: 0}\nbodies:\n"
               "- {name: a, shape: {sphere_mm: 10}, mass_kg: 0.1, velocity_m_s: [0.3, 0, 0]}\n"
               "- {name: b, shape: {sphere_mm: 5}, mass_kg: 0.3}\n"
               "attachments:\n- {bodies: [a, b], points_mm: [[0, 0, 0]], stiffness_n_m: 750, "
               "damping_n_s_m: 0}\n");
  double reduced = 0.1 * 0.3 / 0.4, last = -1, first = -1, end = -1;
  int count = 0;
  for (int k = 1; k < 5000; ++k) {
    steps(&w, 1);
    sonde_body_measure a = measure(&w, "a"), b = measure(&w, "b");
    double x = a.centre_m.x - b.centre_m.x, t = sonde_scene_time(w.state);
    if (last < 0 && x >= 0) {
      end = t - 2e-4 * x / (x - last);
      if (count++ == 0) first = end;
    }
    last = x;
    assert_near(a.momentum_kg_m_s.x + b.momentum_kg_m_s.x, 0.03, 1e-12);
  }
  double frequency = (count - 1) / (end - first);
  print_message("oscillator: %.6g Hz of %.6g\n", frequency, sqrt(750 / reduced) / (2 * SONDE_PI));
  assert_near(frequency / (sqrt(750 / reduced) / (2 * SONDE_PI)), 1, 1e-3);
  world_end(&w);
}

// Two boxes welded at four points fly and tumble as the one box that they make.
static void test_weld(void **unused) {
  (void)unused;
  world two = world_of(
      "sonde_scene: 1\nstep: {dt_s: 5e-4, lambda: 0.5, newton: 4}\nbodies:\n"
      "- {name: a, shape: {box_mm: [40, 20, 10]}, density_kg_m3: 1000, position_mm: [-20, 0, 0], "
      "velocity_m_s: [0, -0.06, 0.04], spin_rad_s: [1, 2, 3]}\n"
      "- {name: b, shape: {box_mm: [40, 20, 10]}, density_kg_m3: 1000, position_mm: [20, 0, 0], "
      "velocity_m_s: [0, 0.06, -0.04], spin_rad_s: [1, 2, 3]}\n"
      "attachments:\n- {bodies: [a, b], stiffness_n_m: 1e6, damping_n_s_m: 5, points_mm: "
      "[[0, -10, -5], [0, 10, -5], [0, 10, 5], [0, -10, 5]]}\n");
  world one = world_of(
      "sonde_scene: 1\nstep: {dt_s: 5e-4, lambda: 0.5}\nbodies:\n"
      "- {name: a, shape: {box_mm: [80, 20, 10]}, density_kg_m3: 1000, spin_rad_s: [1, 2, 3]}\n");
  sonde_vec3 turn = measure(&one, "a").angular_kg_m2_s;
  assert_int_equal(sonde_scene_pair_count(two.scene), 0); // attached bodies do not touch
  steps(&two, 2000);
  steps(&one, 2000);
  sonde_body_measure a = measure(&two, "a"), b = measure(&two, "b"), c = measure(&one, "a");
  sonde_vec3 x = q_rotate(c.rotation, vec3(0.02, 0, 0));
  double off = fmax(v_distance(b.centre_m, x), v_distance(a.centre_m, v_neg(x)));
  sonde_vec3 sum = v_add(a.angular_kg_m2_s, b.angular_kg_m2_s);
  print_message("weld: off by %.2g mm after %.2g turns, angular momentum by %.2g\n", off * 1e3,
                v_norm(c.spin_rad_s) / (2 * SONDE_PI), v_distance(sum, turn) / v_norm(turn));
  assert_near(off, 0, 2e-4);
  assert_near(v_distance(sum, turn) / v_norm(turn), 0, 1e-4);
  assert_unflagged(&two);
  world_end(&two);
  world_end(&one);
}

// A soft block hangs by the nodes of its top on a driven plate that rises: the force is its weight,
// and where it hangs follows the plate.
static void test_nodes_on_frame(void **unused) {
  (void)unused;
  world w =
      world_of("sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nbodies:\n"
               "- {name: plate, motion: driven, shape: {box_mm: [60, 60, 10]}, path: [\n"
               "  {time_s: 0, position_mm: [0, 0, 25]}, {time_s: 0.5, position_mm: [0, 0, 75]}]}\n"
               "- {name: block, kind: lattice, shape: {box_mm: [40, 40, 40]}, density_kg_m3: 1000, "
               "lattice: {cell_mm: 10, youngs_pa: 1e5, damping_s: 0.01}}\n"
               "attachments:\n- {bodies: [block, plate], box_mm: [[-20, -20, 20], [20, 20, 20]], "
               "stiffness_n_m: 1e4}\n");
  steps(&w, 1500);
  sonde_attachment_measure m = sonde_scene_attachment(w.state, 0);
  sonde_body_measure block = measure(&w, "block");
  // The block stretches under its own weight by rho g L^2/(2 E), half of it at the centre.
  double sag = 1000 * 9.81 * 0.04 * 0.04 / 1e5;
  print_message("hanging block: %.6g N of %.6g, sags by %.3g mm of at most %.3g\n", m.force_n.z,
                0.064 * 9.81, (0.05 - block.centre_m.z) * 1e3, sag * 1e3);
  assert_near(m.force_n.z, 0.064 * 9.81, 1e-6);
  assert_true(block.centre_m.z < 0.05 && block.centre_m.z > 0.05 - sag);
  assert_unflagged(&w);
  world_end(&w);
}

// Attached bodies sleep and wake together.
static void test_sleeps_together(void **unused) {
  (void)unused;
  world w = world_of(
      "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nbodies:\n"
      "- {name: bob, shape: {sphere_mm: 10}, mass_kg: 0.1, position_mm: [0, 0, -50]}\n"
      "- {name: rod, shape: {box_mm: [4, 4, 50]}, mass_kg: 0.02, position_mm: [0, 0, -25]}\n"
      "attachments:\n- {bodies: [rod], points_mm: [[0, 0, 0]], damping_n_s_m: 20}\n"
      "- {bodies: [rod, bob], points_mm: [[0, 0, -50]], damping_n_s_m: 20}\ncontacts: none\n");
  steps(&w, 1000);
  assert_int_equal(sonde_scene_last(w.state).awake, 0);
  assert_near(sonde_scene_attachment(w.state, 0).force_n.z, 0.12 * 9.81, 1e-3);
  world_end(&w);
}

static void test_refused(void **unused) {
  (void)unused;
  static const struct {
    const char *entry, *words;
  } BAD[] = {
      {"{bodies: [a, c], points_mm: [[0, 0, 0]]}", "no body 'c'"},
      {"{bodies: [a, a], points_mm: [[0, 0, 0]]}", "not attached to itself"},
      {"{bodies: [a, s]}", "needs points_mm or box_mm"},
      {"{bodies: [a, s], points_mm: [[0, 0, 0]]}",
       "from the nearest node of 's', expected 1 or less"},
      {"{bodies: [a, s], box_mm: [[0, 0, 0], [1, 1, 1]]}", "a deformable first body"},
      {"{bodies: [s, a], box_mm: [[90, 0, 0], [91, 1, 1]]}", "the box holds no node"},
      {"{bodies: [], points_mm: [[0, 0, 0]]}", "must name two bodies"},
      {"{bodies: [a], points_mm: [[0, 0, 0]], stiffness_n_m: 0}", "stiffness_n_m"},
  };
  for (size_t k = 0; k < sizeof BAD / sizeof *BAD; ++k) {
    char text[1024];
    snprintf(
        text, sizeof text,
        "sonde_scene: 1\nbodies:\n- {name: a, shape: {sphere_mm: 5}, mass_kg: 1}\n"
        "- {name: s, kind: springs, shape: {sphere_mm: 5}, position_mm: [20, 0, 0], mass_kg: 1, "
        "springs: {stiffness_n_m: 1}}\nattachments:\n- %s\n",
        BAD[k].entry);
    sonde_scene *scene = NULL;
    sonde_error error = {0};
    assert_true(sonde_scene_parse(text, "bad.yaml", NULL, &scene, &error) != SONDE_OK);
    if (!strstr(error.message, BAD[k].words)) print_error("%s\n", error.message);
    assert_non_null(strstr(error.message, BAD[k].words));
    assert_non_null(strstr(error.message, "bad.yaml:"));
  }
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_pendulum),
      cmocka_unit_test(test_oscillator),
      cmocka_unit_test(test_weld),
      cmocka_unit_test(test_nodes_on_frame),
      cmocka_unit_test(test_sleeps_together),
      cmocka_unit_test(test_refused),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
