// Laws of large bodies, which are stepped in two parts: the same bits from one thread and two, the
// double engine's motion across the parts' border, and a second thread that can sleep.
#include "../fixture.h"
#include "../sanitized.h"
#include "world/batches.h"
#include "world/second_thread.h"

#include "base/clock.h"
#include "base/random.h"

enum { LEVELS = 6 }; // 40,962 nodes

typedef struct couplings {
  double edge_n_m, shear_n_m, inplane_n_m;
} couplings;

static sonde_model *make_model(couplings by) {
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = by.edge_n_m;
  law.shear_stiffness_n_m = by.shear_n_m;
  law.inplane_stiffness_n_m = by.inplane_n_m;
  return fixture_model(LEVELS, &law);
}

// All nodes move, those at the parts' border too.
static sonde_state *make_moving(const sonde_model *model, const sonde_world_def *def) {
  sonde_state *state = NULL;
  assert_int_equal(sonde_state_create(model, def, &state, NULL), SONDE_OK);
  uint32_t n = model->surface.vertex_count;
  sonde_vec3 *velocity = calloc(n, sizeof *velocity);
  assert_non_null(velocity);
  for (uint32_t i = 0; i < n; ++i)
    velocity[i] = v_scale(
        vec3(sonde_random_normal(3, i), sonde_random_normal(4, i), sonde_random_normal(5, i)),
        0.02);
  sonde_state_set(state, NULL, velocity);
  free(velocity);
  return state;
}

static void press(sonde_state *state, int steps) {
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("ball:20", &probe, NULL), SONDE_OK);
  for (int k = 0; k < steps; ++k) sonde_step(state, &probe, fixture_pose(1e-4 * k));
  assert_true(v_norm(sonde_state_contact(state)->force_n) > 0);
  sonde_probe_clear(&probe);
}

static uint64_t hash_of(const sonde_model *model, const sonde_world_def *def, int steps) {
  sonde_state *state = make_moving(model, def);
  assert_int_equal(sonde_batches_of(state)->part_count, 2);
  assert_true(sonde_batches_of(state)->seen_count > 100);
  assert_int_equal(sonde_batches_of(state)->thread != NULL, def->threads > 1);
  press(state, steps);
  uint64_t hash = sonde_state_hash(state);
  sonde_state_destroy(state);
  return hash;
}

static void one_thread_and_two_give_the_same_bits(void **state) {
  (void)state;
  const couplings kinds[] = {{50, 15, 70}, {50, 0, 0}, {0, 15, 70}};
  for (size_t k = 0; k < ROUNDS(SONDE_COUNT_OF(kinds), 1); ++k) {
    sonde_model *model = make_model(kinds[k]);
    sonde_world_def def = fixture_world_def();
    def.engine = SONDE_ENGINE_FAST;
    def.contact_law = k == 1 ? SONDE_CONTACT_NODES : SONDE_CONTACT_FOUNDATION;
    uint64_t hash = hash_of(model, &def, ROUNDS(60, 5));
    def.threads = 2;
    for (int repeat = 0; repeat < 2; ++repeat)
      assert_true(hash_of(model, &def, ROUNDS(60, 5)) == hash);
    sonde_model_destroy(model);
  }
}

static double farthest(sonde_state *a, sonde_state *b) {
  const sonde_vec3 *x = sonde_state_positions(a), *y = sonde_state_positions(b);
  double most = 0;
  for (uint32_t i = 0; i < sonde_state_model(a)->surface.vertex_count; ++i)
    most = fmax(most, v_distance(x[i], y[i]));
  return most;
}

// Both solved to the end: a neighbour that is not seen, or seen twice, would show.
static void parts_move_as_one_body(void **state) {
  (void)state;
  const couplings kinds[] = {{200, 0, 0}, {50, 15, 70}};
  for (size_t k = 0; k < ROUNDS(SONDE_COUNT_OF(kinds), 1); ++k) {
    sonde_model *model = make_model(kinds[k]);
    sonde_world_def def = fixture_world_def();
    def.newton_iterations = 6;
    def.pcg.relative_residual = 1e-6;
    def.sleep_displacement_m = 0;
    sonde_state *exact = make_moving(model, &def);
    def.engine = SONDE_ENGINE_FAST;
    sonde_state *parts = make_moving(model, &def);
    for (int step = 0; step < ROUNDS(10, 2); ++step) {
      sonde_step(exact, NULL, fixture_pose(0));
      sonde_step(parts, NULL, fixture_pose(0));
    }
    double off = farthest(exact, parts);
    print_message("farthest node %.2g um off\n", 1e6 * off);
    assert_true(off < 0.1e-6);
    sonde_state_destroy(exact);
    sonde_state_destroy(parts);
    sonde_model_destroy(model);
  }
}

static void count(void *with, uint32_t part) { ++((uint32_t *)with)[part]; }

// Work that comes at once, and work that comes when the thread has gone to sleep.
static void a_second_thread_sleeps_and_wakes(void **state) {
  (void)state;
  sonde_second_thread *second = NULL;
  uint32_t done[2] = {0, 0}, pieces = 0;
  assert_int_equal(sonde_second_thread_create(&second, NULL), SONDE_OK);
  for (int round = 0; round < 5; ++round) {
    for (int k = 0; k < 1000; ++k, ++pieces) sonde_second_thread_run(second, count, done);
    sonde_clock_sleep_until(sonde_clock_now() + 0.02);
  }
  sonde_second_thread_destroy(second);
  assert_int_equal(done[0], pieces);
  assert_int_equal(done[1], pieces);
  sonde_second_thread_run(NULL, count, done);
  assert_int_equal(done[1], pieces + 1);
  sonde_second_thread_destroy(NULL);
}

static void two_threads_belong_to_the_fast_engine(void **state) {
  (void)state;
  sonde_model *model = fixture_model(2, NULL);
  sonde_world_def def = fixture_world_def();
  sonde_state *none = NULL;
  sonde_error error = {0};
  def.threads = 2;
  assert_int_equal(sonde_state_create(model, &def, &none, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "threads"));
  def.engine = SONDE_ENGINE_FAST;
  def.threads = 3;
  assert_int_equal(sonde_state_create(model, &def, &none, &error), SONDE_ARGUMENT);
  def.threads = 2;
  assert_int_equal(sonde_state_create(model, &def, &none, &error), SONDE_OK);
  assert_int_equal(sonde_batches_of(none)->part_count, 1);
  assert_null(sonde_batches_of(none)->thread);
  sonde_state_destroy(none);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(one_thread_and_two_give_the_same_bits),
      cmocka_unit_test(parts_move_as_one_body),
      cmocka_unit_test(a_second_thread_sleeps_and_wakes),
      cmocka_unit_test(two_threads_belong_to_the_fast_engine),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
