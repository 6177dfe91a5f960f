// Condensation: forces and displacements of the kept nodes are those of the whole solid, the
// inverse is one, columns and condensation agree, plates hold what they should.
#include "solids.h"
#include "elements/condense.h"
#include "elements/invert.h"

typedef struct scene {
  sonde_tetrahedra mesh;
  uint32_t *kept, count;
  sonde_elastic *solid;
  sonde_condensed *condensed;
} scene;

// A ball on a rigid core, condensed on the nodes of its upper part.
static scene make_scene(double edge_m) {
  scene s = {.mesh = held_ball(0.05, 0.02, edge_m)};
  s.kept = calloc(s.mesh.surface_count, sizeof *s.kept);
  for (uint32_t i = 0; i < s.mesh.surface_count; ++i)
    if (s.mesh.node[i].z > 0.01) s.kept[s.count++] = i;
  const sonde_elastic_def def = {.mesh = &s.mesh, .last = s.kept, .last_count = s.count};
  s.solid = make_solid(&def, 1e4, 0.48);
  sonde_condensed_times times;
  assert_ok(sonde_condensed_create(s.solid, 2, &s.condensed, &times, &shape_error));
  return s;
}

static void clear_scene(scene *s) {
  sonde_condensed_destroy(s->condensed);
  sonde_elastic_destroy(s->solid);
  sonde_tetrahedra_clear(&s->mesh);
  free(s->kept);
}

static void test_equals_the_whole(void **state) {
  (void)state;
  scene s = make_scene(0.012);
  const sonde_elastic *e = s.solid;
  const size_t side = 3 * (size_t)s.count;
  sonde_elastic_scratch *scratch;
  assert_ok(sonde_elastic_scratch_create(e, &scratch, &shape_error));
  double *u = calloc(3 * (size_t)e->count, sizeof *u), *f = calloc(3 * (size_t)e->count, sizeof *f);
  uint64_t seed = 5;
  double largest = 0, off = 0;
  const size_t first = 3 * (size_t)(e->count - e->last_count);
  for (size_t k = 0; k < side; ++k) u[first + k] = shape_uniform(&seed, -1e-3, 1e-3);
  assert_ok(sonde_elastic_solve(e, scratch, s.kept, s.count, f, u, &shape_error));
  for (size_t i = 0; i < side; ++i) {
    double sum = 0;
    for (size_t j = 0; j < side; ++j) sum += s.condensed->stiffness[i * side + j] * u[first + j];
    largest = fmax(largest, fabs(sum)), off = fmax(off, fabs(sum - f[first + i]));
  }
  print_message("%u nodes condensed on %u: forces differ by %.1e of the largest\n", e->count,
                s.count, off / largest);
  assert_true(off <= 1e-10 * largest);
  // Stiffness times compliance is one.
  off = 0;
  for (size_t i = 0; i < side; i += 7)
    for (size_t j = 0; j < side; ++j) {
      double sum = 0;
      for (size_t k = 0; k < side; ++k)
        sum += s.condensed->stiffness[i * side + k] * s.condensed->compliance[j * side + k];
      off = fmax(off, fabs(sum - (i == j)));
    }
  assert_true(off <= 1e-10);
  free(u);
  free(f);
  sonde_elastic_scratch_destroy(scratch);
  clear_scene(&s);
}

// The inverse of a matrix of several tiles, by one worker and by three; of one that is not
// definite.
static void test_inverse(void **state) {
  (void)state;
  enum { N = 300 };
  double *a = calloc(N * N, sizeof *a), *inverse = calloc(N * N, sizeof *a);
  double *same = calloc(N * N, sizeof *a);
  uint64_t seed = 9;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j)
      a[i * N + j] = a[j * N + i] = shape_uniform(&seed, -1, 1) + (i == j ? 25 : 0);
  assert_ok(sonde_invert(a, N, 1, inverse, &shape_error));
  assert_ok(sonde_invert(a, N, 3, same, &shape_error));
  assert_memory_equal(inverse, same, N * N * sizeof *a);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) {
      double sum = 0;
      for (int k = 0; k < N; ++k) sum += a[i * N + k] * inverse[k * N + j];
      assert_near(sum, i == j, 1e-12);
    }
  a[290 * N + 290] = -1;
  assert_int_equal(sonde_invert(a, N, 2, inverse, &shape_error), SONDE_CONVERGENCE);
  free(a), free(inverse), free(same);
}

// Nodes near the pole, with the way of a plate from above to each.
static uint32_t footprint(const scene *s, double radius, uint32_t *places, double *gap) {
  uint32_t count = 0;
  double top = -1;
  for (uint32_t k = 0; k < s->count; ++k) {
    sonde_vec3 p = s->mesh.node[s->kept[k]];
    if (hypot(p.x, p.y) >= radius) continue;
    gap[count] = p.z, places[count++] = k;
    top = fmax(top, p.z);
  }
  for (uint32_t k = 0; k < count; ++k) gap[k] = top - gap[k];
  return count;
}

static void test_plates(void **state) {
  (void)state;
  enum { MOST = 400, DEPTHS = 5 };
  scene s = make_scene(0.01);
  const size_t side = 3 * (size_t)s.count;
  uint32_t places[MOST];
  double gap[MOST], depth[DEPTHS], force[DEPTHS], node_force[DEPTHS * MOST], u[3 * MOST],
      f[3 * MOST];
  uint32_t count = footprint(&s, 0.02, places, gap);
  assert_in_range(count, 10, MOST);
  for (int d = 0; d < DEPTHS; ++d) depth[d] = 1e-3 * d;
  sonde_plate plate = {.places = places, .count = count, .inward = {0, 0, -1}, .bonded = true};
  // Bonded and fitting: force proportional to depth, equal to that of imposed displacements.
  assert_ok(sonde_condensed_press(s.condensed, &plate, depth, DEPTHS, force, NULL, &shape_error));
  for (uint32_t k = 0; k < count; ++k) u[3 * k] = u[3 * k + 1] = 0, u[3 * k + 2] = -1e-3;
  assert_ok(sonde_condensed_forces(s.condensed, places, count, u, f, &shape_error));
  double sum = 0;
  for (uint32_t k = 0; k < count; ++k) sum -= f[3 * k + 2];
  assert_true(sum > 0);
  for (int d = 0; d < DEPTHS; ++d) assert_near(force[d], d * sum, 1e-10 * sum);
  // Sliding and flat: a node carries or stays clear of the plate.
  plate.bonded = false, plate.gap_m = gap;
  double fitting = force[4];
  assert_ok(
      sonde_condensed_press(s.condensed, &plate, depth, DEPTHS, force, node_force, &shape_error));
  assert_near(force[0], 0, 0);
  for (int d = 1; d < DEPTHS; ++d) {
    uint32_t touched = 0;
    for (uint32_t k = 0; k < count; ++k) {
      double moved = 0, push = node_force[(uint32_t)d * count + k];
      for (uint32_t q = 0; q < count; ++q)
        moved += s.condensed->compliance[(3 * places[k] + 2) * side + 3 * places[q] + 2] *
                 node_force[(uint32_t)d * count + q];
      assert_true(push >= 0);
      assert_true(moved >= depth[d] - gap[k] - 1e-12);
      touched += push > 0;
      if (push > 0) assert_near(moved, depth[d] - gap[k], 1e-12);
    }
    // More nodes at more depth: the force grows faster than the depth.
    assert_true(touched > 0 && (d < 2 || force[d] / depth[d] > force[d - 1] / depth[d - 1]));
  }
  assert_true(force[4] < fitting);
  // A node listed twice cannot be told apart.
  places[1] = places[0];
  plate.bonded = true;
  assert_int_equal(
      sonde_condensed_press(s.condensed, &plate, depth, DEPTHS, force, NULL, &shape_error),
      SONDE_ARGUMENT);
  clear_scene(&s);
}

static void test_refusals(void **state) {
  (void)state;
  sonde_tetrahedra t = held_ball(0.05, 0.02, 0.02);
  sonde_elastic_def def = {.mesh = &t};
  sonde_elastic *e = make_solid(&def, 1e4, 0.3);
  sonde_condensed *c;
  assert_int_equal(sonde_condensed_create(e, 1, &c, NULL, &shape_error), SONDE_ARGUMENT);
  assert_null(c);
  sonde_elastic_destroy(e);
  sonde_tetrahedra_clear(&t);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_equals_the_whole),
      cmocka_unit_test(test_inverse),
      cmocka_unit_test(test_plates),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
