// Scenes that once lied: many bodies, bodies wholly inside others, inside out, gone through others.
#include "scene_fixture.h"
#include "../sanitized.h"

#include "base/clock.h"

#include <stdlib.h>

// ---- a hundred bodies

typedef struct meter {
  size_t live, most;
} meter;

static void *metered(size_t bytes, void *user) {
  meter *m = user;
  size_t *block = malloc(bytes + 16);
  if (!block) return NULL;
  block[0] = bytes;
  m->live += bytes;
  if (m->live > m->most) m->most = m->live;
  return block + 2;
}

static void unmetered(void *pointer, void *user) {
  meter *m = user;
  if (!pointer) return;
  size_t *block = (size_t *)pointer - 2;
  m->live -= block[0];
  free(block);
}

// Balls, bricks, lattices and filled surfaces in layers over a floor.
static char *hundred(void) {
  static const char *const KIND[] = {
      "shape: {sphere_mm: 15, edge_mm: 5}, density_kg_m3: 700",
      "shape: {box_mm: [30, 25, 20]}, density_kg_m3: 900",
      "kind: lattice, shape: {box_mm: [30, 30, 30]}, lattice: {cell_mm: 10, youngs_pa: 1e5, "
      "damping_s: 5e-3}, density_kg_m3: 1000",
      "kind: springs, shape: {sphere_mm: 14, edge_mm: 6}, springs: {stiffness_n_m: 150, "
      "damping_n_s_m: 0.1, bulk_n_m5: 1e11}, mass_kg: 0.012"};
  enum { SIZE = 64 * 1024 };
  char *text = malloc(SIZE);
  int used = snprintf(
      text, SIZE,
      "sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nmaterials:\n"
      "- {name: skin, contact_stiffness_n_m3: 2e7, contact_damping_s: 2e-3, friction_static: 0.5, "
      "friction_kinetic: 0.4}\nbodies:\n"
      "- {name: floor, motion: fixed, shape: {slab_mm: [600, 600, 20]}, material: skin}\n");
  for (int k = 0; k < 99; ++k) {
    int x = k % 5, y = k / 5 % 5, z = k / 25;
    used +=
        snprintf(text + used, SIZE - (size_t)used,
                 "- {name: b%d, %s, position_mm: [%d, %d, %d], material: skin}\n", k, KIND[k % 4],
                 60 * x - 120 + 7 * (z % 2), 60 * y - 120 + 5 * (z % 2), 20 + 45 * z);
  }
  return text;
}

// They start within seconds and 500 MB although 4,950 pairs may touch, and their energy falls.
static void test_hundred(void **unused) {
  (void)unused;
  meter m = {0};
  sonde_allocator allocator = {metered, unmetered, &m};
  sonde_set_allocator(&allocator);
  char *text = hundred();
  double begin = sonde_clock_now();
  world w = world_of(text);
  steps(&w, 1);
  double start_s = sonde_clock_now() - begin;
  assert_int_equal(sonde_scene_pair_count(w.scene), 4950);
  assert_true(start_s < 5);
  assert_true(m.most < 500000000);
  double before = total_energy(&w), first = before, most = 0;
  uint32_t touching = 0;
  for (int k = 0; k < ROUNDS(200, 4); ++k) {
    steps(&w, 1);
    double now = total_energy(&w);
    most = fmax(most, (now - before) / first);
    before = now;
  }
  for (uint32_t p = 0; p < sonde_scene_pair_count(w.scene); ++p)
    touching += sonde_scene_pair_measure(w.state, p).point_count > 0;
  print_message("hundred: started in %.2f s and %.0f MB; %u pairs touch, %.2f of the energy left, "
                "largest gain in a step %.1g of it\n",
                start_s, 1e-6 * (double)m.most, touching, before / first, most);
  assert_true(touching >= ROUNDS(50, 0));
  assert_true(most < 1e-9);
  assert_unflagged(&w);
  world_end(&w);
  free(text);
  assert_int_equal(m.live, 0);
  sonde_set_allocator(NULL);
}

static world world_at(const char *name) {
  char path[512];
  snprintf(path, sizeof path, SONDE_SOURCE_DIR "/tests/scene/hostile/%s.yaml", name);
  world w = {0};
  sonde_error error = {0};
  sonde_status status = sonde_scene_load(path, NULL, &w.scene, &error);
  if (!status) status = sonde_scene_state_create(w.scene, &w.state, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  return w;
}

// ---- wholly inside another

static void assert_event(const world *w, uint32_t flag, const char *body, const char *other,
                         double least_s, double most_s) {
  sonde_scene_event event = sonde_scene_first(w->state, flag);
  assert_int_equal(event.count, 1);
  assert_string_equal(sonde_scene_body(w->scene, event.body).name, body);
  if (other) assert_string_equal(sonde_scene_body(w->scene, event.other).name, other);
  assert_true(event.time_s >= least_s && event.time_s <= most_s);
  assert_true(sonde_scene_all_flags(w->state) & flag);
}

// The ball is 20 mm below the block's top and 40 mm deep in it: it leaves through the top at a
// twentieth of a second per depth at most, and stays on the block. Energy falls in every step.
static void test_ball_inside_block(void **unused) {
  (void)unused;
  world w = world_at("inside");
  double fastest = 0, gained = 0, before = INFINITY, z;
  for (int k = 0; k < 1000; ++k) {
    steps(&w, 1);
    sonde_body_measure m = measure(&w, "ball");
    z = m.centre_m.z;
    fastest = fmax(fastest, v_norm(m.velocity_m_s));
    double now = total_energy(&w);
    if (k) gained = fmax(gained, now - before);
    before = now;
    assert_true(z > 0.0299);
  }
  print_message("inside: fastest %.3f m/s, largest gain of energy in a step %.2g J\n", fastest,
                gained);
  assert_true(fastest < 0.03 / 0.05);
  assert_near(gained, 0, 1e-6);
  assert_near(z, 0.0594, 5e-4);
  assert_event(&w, SONDE_SCENE_INSIDE, "ball", "block", 0, 0);
  assert_int_equal(sonde_scene_all_flags(w.state), SONDE_SCENE_INSIDE);
  world_end(&w);
}

// One body inside another of any kind, both free: they part, momentum and angular momentum stay.
static void part(const char *outer, const char *inner, const char *step) {
  char text[1024];
  snprintf(text, sizeof text,
           "sonde_scene: 1\nstep: {%s}\nmaterials:\n"
           "- {name: m, contact_stiffness_n_m3: 2e6, contact_damping_s: 2e-3}\nbodies:\n"
           "- {name: outer, material: m, %s}\n"
           "- {name: inner, material: m, position_mm: [6, 4, 13], %s}\n",
           step, outer, inner);
  world w = world_of(text);
  sonde_pair_measure pair = {0};
  double most = 0, fastest = 0;
  for (int k = 0; k < 800; ++k) {
    steps(&w, 1);
    sonde_body_measure a = measure(&w, "outer"), b = measure(&w, "inner");
    pair = sonde_scene_pair_measure(w.state, 0);
    most = fmax(most, pair.normal_n);
    fastest = fmax(fastest, v_norm(v_sub(b.velocity_m_s, a.velocity_m_s)));
    sonde_vec3 sum = v_add(a.momentum_kg_m_s, b.momentum_kg_m_s);
    sonde_vec3 turn = v_add(a.angular_kg_m2_s, b.angular_kg_m2_s);
    double size = v_norm(b.momentum_kg_m_s) + 1e-9;
    assert_near(v_norm(sum), 0, 1e-9 * size);
    assert_near(v_norm(turn), 0, 2e-3 * 0.02 * size + 1e-12);
  }
  print_message(
      "%.30s around %.30s (%s): pushed by %.3g N, parted at %.3g m/s, %.3g mm deep at the "
      "end\n",
      outer, inner, step, most, fastest, 1e3 * pair.depth_m);
  assert_true(most > 0.1);
  assert_true(fastest < 1);
  assert_true(pair.depth_m < 1e-3);
  assert_int_equal(sonde_scene_all_flags(w.state) & ~(uint32_t)SONDE_SCENE_INSIDE, 0);
  assert_event(&w, SONDE_SCENE_INSIDE, "inner", "outer", 0, 0);
  world_end(&w);
}

static void test_inside_any_kind(void **unused) {
  (void)unused;
  static const char BLOCK[] = "shape: {box_mm: [60, 60, 60]}, density_kg_m3: 1000";
  static const char SOFT[] = "kind: lattice, shape: {box_mm: [60, 60, 60]}, lattice: {cell_mm: 10, "
                             "youngs_pa: 1e6, damping_s: 5e-3}, density_kg_m3: 1000";
  static const char BALL[] = "shape: {sphere_mm: 8, edge_mm: 4}, density_kg_m3: 1000";
  static const char BRICK[] = "shape: {box_mm: [20, 14, 10]}, density_kg_m3: 1000, "
                              "rotation: {axis: [1, 2, 3], angle_deg: 30}";
  static const char FILLED[] = "kind: springs, shape: {sphere_mm: 8, edge_mm: 4}, springs: "
                               "{stiffness_n_m: 300, damping_n_s_m: 0.1, bulk_n_m5: 1e11}, "
                               "mass_kg: 0.003";
  part(BLOCK, BALL, "dt_s: 1e-3");
  part(BLOCK, BRICK, "dt_s: 1e-3");
  part(BLOCK, FILLED, "dt_s: 1e-3");
  part(SOFT, BALL, "dt_s: 1e-3");
  part(SOFT, FILLED, "dt_s: 1e-3, newton: 2");
  part(BLOCK, BALL, "dt_s: 1e-3, lambda: 0.5");
  part(BLOCK, BALL, "dt_s: 1e-3, method: symplectic");
  part(BLOCK, BRICK, "dt_s: 1e-3, method: explicit");
}

// ---- inside out, and through

// A flap alone, whose ends are pushed through its middle: every volume stays positive, nothing
// touches.
static void test_goes_through_itself(void **unused) {
  (void)unused;
  world w = world_at("folded");
  steps(&w, 8);
  assert_unflagged(&w);
  steps(&w, 92);
  assert_event(&w, SONDE_SCENE_INVERTED, "flap", NULL, 0.008, 0.05);
  world_end(&w);
}

// The sheet's sides pass through each other as it meets the ball: 0.0624 s of fall.
static void test_sheet_inside_out(void **unused) {
  (void)unused;
  world w = world_at("sheet");
  steps(&w, 60);
  assert_unflagged(&w);
  steps(&w, 40);
  assert_event(&w, SONDE_SCENE_INVERTED, "sheet", NULL, 0.062, 0.07);
  world_end(&w);
}

// A body that is turned inside out by hand.
static void test_volume_below_zero(void **unused) {
  (void)unused;
  world w =
      world_of("sonde_scene: 1\nbodies:\n- {name: bag, kind: springs, shape: {sphere_mm: 10}, "
               "springs: {stiffness_n_m: 10}, mass_kg: 0.01}\ncontacts: none\n");
  steps(&w, 2);
  assert_unflagged(&w);
  sonde_vec3 *x = malloc(sonde_scene_body(w.scene, 0).node_count * sizeof *x);
  for (uint32_t i = 0; i < sonde_scene_body(w.scene, 0).node_count; ++i)
    x[i] = v_neg(sonde_scene_nodes(w.state, 0)[i]);
  sonde_scene_set_nodes(w.state, 0, x, NULL);
  steps(&w, 1);
  assert_event(&w, SONDE_SCENE_INVERTED, "bag", NULL, 0.002, 0.002);
  free(x);
  world_end(&w);
}

// With whole steps bodies fly past plates: each is named, and those that stop are not.
static void test_passed(void **unused) {
  (void)unused;
  static const char *const PLATE[] = {
      "motion: fixed, shape: {box_mm: [200, 200, 5]}",
      "kind: lattice, motion: fixed, shape: {box_mm: [200, 200, 10]}, lattice: {cell_mm: 10, "
      "youngs_pa: 1e6}, density_kg_m3: 1000"};
  static const char *const BODY[] = {"shape: {box_mm: [20, 20, 20]}, spin_rad_s: [30, 50, 20]",
                                     "shape: {sphere_mm: 10, edge_mm: 6}"};
  for (int k = 0; k < 16; ++k) {
    char text[1024];
    bool fast = k & 4, cast = k & 8;
    snprintf(text, sizeof text,
             "sonde_scene: 1\nstep: {dt_s: 0.005, cast: %s}\nmaterials:\n"
             "- {name: steel, contact_stiffness_n_m3: 4e10, contact_damping_s: 1e-5}\nbodies:\n"
             "- {name: plate, material: steel, %s}\n"
             "- {name: bullet, material: steel, mass_kg: 0.05, position_mm: [3, 5, 160], "
             "velocity_m_s: [0.2, 0, %d], %s}\n",
             cast ? "true" : "false", PLATE[k & 1], fast ? -20 : -1, BODY[k >> 1 & 1]);
    world w = world_of(text);
    steps(&w, fast ? 6 : 60);
    bool through = measure(&w, "bullet").centre_m.z < 0;
    assert_int_equal(through, fast && !cast);
    if (through)
      assert_event(&w, SONDE_SCENE_PASSED, "bullet", "plate", 0.003, 0.03);
    else
      assert_unflagged(&w);
    world_end(&w);
  }
}

// A heavy ball is pressed through a soft plate: the contact's direction turns round on the way.
static void test_pressed_through(void **unused) {
  (void)unused;
  world w = world_of("sonde_scene: 1\ngravity_m_s2: [0, 0, -9.81]\nmaterials:\n"
                     "- {name: jelly, contact_stiffness_n_m3: 1e5, contact_damping_s: 1e-3}\n"
                     "bodies:\n"
                     "- {name: plate, motion: fixed, shape: {box_mm: [100, 100, 6]}, "
                     "material: jelly}\n"
                     "- {name: ball, shape: {sphere_mm: 10, edge_mm: 4}, mass_kg: 1, "
                     "material: jelly, position_mm: [0, 0, 14]}\n");
  steps(&w, 200);
  assert_true(measure(&w, "ball").centre_m.z < -0.02);
  assert_event(&w, SONDE_SCENE_PASSED, "ball", "plate", 0.005, 0.15);
  world_end(&w);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_hundred),
      cmocka_unit_test(test_ball_inside_block),
      cmocka_unit_test(test_inside_any_kind),
      cmocka_unit_test(test_sheet_inside_out),
      cmocka_unit_test(test_goes_through_itself),
      cmocka_unit_test(test_volume_below_zero),
      cmocka_unit_test(test_passed),
      cmocka_unit_test(test_pressed_through),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
