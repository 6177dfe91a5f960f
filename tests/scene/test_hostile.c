// Scenes that once lied: many bodies.
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
  assert_true(touching > ROUNDS(50, 0));
  assert_true(most < 1e-9);
  assert_unflagged(&w);
  world_end(&w);
  free(text);
  assert_int_equal(m.live, 0);
  sonde_set_allocator(NULL);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_hundred),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
