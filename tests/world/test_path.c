// The slow press: its result does not depend on how the way is divided, and is the one that a hand
// meets with the stepping engine.
#include "../fixture.h"

#include "sonde/world_path.h"

typedef struct bench {
  sonde_model *model;
  sonde_state *state;
  sonde_probe probe;
} bench;

static bench make(const char *probe, sonde_world_def def) {
  bench b = {.model = fixture_model(4, NULL)};
  assert_int_equal(sonde_state_create(b.model, &def, &b.state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create(probe, &b.probe, NULL), SONDE_OK);
  return b;
}

static void clear(bench *b) {
  sonde_probe_clear(&b->probe);
  sonde_state_destroy(b->state);
  sonde_model_destroy(b->model);
}

static sonde_path_result press(bench *b, double from_m, double to_m) {
  sonde_path_result r;
  sonde_error error = {0};
  if (sonde_settle_path(b->state, &b->probe, fixture_pose(from_m), fixture_pose(to_m), NULL, NULL,
                        &r, &error))
    fail_msg("%s", error.message);
  return r;
}

static const double DEEP_M = 0.02;

// In one call, in calls of 5 mm and of 1 mm: one force, to far less than the 3 to 30 % by which
// settling at once, in 5 mm and in 1 mm differ.
static void the_force_does_not_depend_on_the_division(void **state) {
  (void)state;
  const double call_m[] = {DEEP_M, 5e-3, 1e-3};
  double force_n[3];
  bench b = make("linear", fixture_world_def());
  for (int k = 0; k < 3; ++k) {
    sonde_state_reset(b.state);
    for (double at = 0; at < DEEP_M - 1e-9; at += call_m[k]) {
      sonde_path_result r = press(&b, at, at + call_m[k]);
      assert_true(r.settled.converged);
      assert_true(r.settled.start_depth_m < SONDE_SETTLE_NEAR_M);
      force_n[k] = r.force_n;
    }
    assert_true(force_n[k] > 1);
  }
  assert_near(force_n[1], force_n[0], 2e-3 * force_n[0]);
  assert_near(force_n[2], force_n[0], 2e-3 * force_n[0]);
  clear(&b);
}

// Pressed by time steps in 0.4 s and held 0.6 s: what the hand feels.
static void a_press_by_time_steps_ends_there_too(void **state) {
  (void)state;
  sonde_world_def def = fixture_world_def();
  bench slow = make("linear", def);
  def.engine = SONDE_ENGINE_FAST;
  def.sleep_displacement_m = 0;
  bench live = make("linear", def);
  double force_n = press(&slow, 0, DEEP_M).force_n;
  for (int k = 1; k <= 1000; ++k)
    sonde_step(live.state, &live.probe, fixture_pose(DEEP_M * fmin(1, k / 400.0)));
  assert_near(v_norm(sonde_state_contact(live.state)->force_n), force_n, 5e-3 * force_n);
  clear(&slow);
  clear(&live);
}

// The depth at which a force is met has that force when pressed to it.
static void force_and_depth_are_one_curve(void **state) {
  (void)state;
  bench b = make("linear", fixture_world_def());
  sonde_path_def def = sonde_path_def_default();
  sonde_path_result met;
  double wanted = press(&b, 0, 0.012).force_n;
  sonde_state_reset(b.state);
  def.force_n = wanted;
  assert_int_equal(sonde_settle_path(b.state, &b.probe, fixture_pose(0), fixture_pose(0.05), &def,
                                     NULL, &met, NULL),
                   SONDE_OK);
  assert_near(met.force_n, wanted, 2e-4 * wanted);
  assert_near(met.way_m, 0.012, 3e-5);
  clear(&b);
}

// One call that carries the probe far into the skin says so.
static void a_far_settling_is_told(void **state) {
  (void)state;
  bench b = make("linear", fixture_world_def());
  sonde_settle_result far = sonde_settle(b.state, &b.probe, fixture_pose(DEEP_M), 1e-9, 400);
  assert_true(far.start_depth_m > 5 * SONDE_SETTLE_NEAR_M);
  sonde_state_reset(b.state);
  (void)press(&b, 0, DEEP_M);
  sonde_settle_result near = sonde_settle(b.state, &b.probe, fixture_pose(DEEP_M), 1e-9, 400);
  assert_true(near.start_depth_m > 0 && near.start_depth_m < SONDE_SETTLE_NEAR_M);
  clear(&b);
}

// With a tolerance that no two equilibria meet, every step is a jump: each is told, with its place.
static void jumps_are_told(void **state) {
  (void)state;
  bench b = make("linear", fixture_world_def());
  sonde_path_def def = sonde_path_def_default();
  def.tolerance = 1e-6;
  def.step_m = def.least_step_m = 4e-3;
  sonde_path_result r;
  assert_int_equal(sonde_settle_path(b.state, &b.probe, fixture_pose(0), fixture_pose(DEEP_M), &def,
                                     NULL, &r, NULL),
                   SONDE_OK);
  assert_true(r.jump_count >= 1 && r.jump_count <= 5);
  for (uint32_t k = 0; k < r.jump_count; ++k) {
    assert_near(r.jump[k].to_m - r.jump[k].from_m, 4e-3, 1e-9);
    assert_true(fabs(r.jump[k].whole_n - r.jump[k].two_n) > 1e-6 * r.jump[k].two_n);
    assert_true(r.jump[k].two_n > r.jump[k].before_n);
  }
  clear(&b);
}

// A search moves the rows that a press reaches and looks at all of them in the end. From a start in
// which every node is displaced all rows move: both end in the one equilibrium of a shallow press,
// and a coarse search in places that are off by less than its residual lets them be.
static void rows_out_of_reach_are_in_balance(void **state) {
  (void)state;
  const double depth_m = 5e-3, displaced_m = 3e-4;
  bench b = make("linear", fixture_world_def());
  const uint32_t n = b.model->surface.vertex_count;
  const double residual[] = {1e-10, 1e-10, 1e-4};
  sonde_vec3 *place[3];
  double force_n[3];
  for (int k = 0; k < 3; ++k) {
    place[k] = SONDE_NEW(sonde_vec3, n);
    sonde_state_reset(b.state);
    if (k == 1) {
      for (uint32_t i = 0; i < n; ++i)
        place[k][i] = v_madd(b.model->surface.vertices[i], -displaced_m, b.model->normal[i]);
      sonde_state_set(b.state, place[k], NULL);
    }
    sonde_settle_result r =
        sonde_settle(b.state, &b.probe, fixture_pose(depth_m), residual[k], 400);
    assert_true(r.converged);
    force_n[k] = r.contact_n;
    memcpy(place[k], sonde_state_positions(b.state), n * sizeof **place);
  }
  double off[3] = {0};
  for (int k = 1; k < 3; ++k)
    for (uint32_t i = 0; i < n; ++i) off[k] = fmax(off[k], v_distance(place[k][i], place[0][i]));
  print_message("%.3f N; all rows: %.2g m, %.2g N off; coarse: %.2g m, %.2g N off\n", force_n[0],
                off[1], force_n[1] - force_n[0], off[2], force_n[2] - force_n[0]);
  assert_true(off[1] < 1e-9 && fabs(force_n[1] - force_n[0]) < 1e-9 * force_n[0]);
  assert_true(off[2] < 5e-6 && fabs(force_n[2] - force_n[0]) < 1e-4 * force_n[0]);
  for (int k = 0; k < 3; ++k) sonde_free(place[k]);
  clear(&b);
}

static void bad_options_are_refused(void **state) {
  (void)state;
  bench b = make("linear", fixture_world_def());
  sonde_path_result r;
  sonde_error error;
  for (int k = 0; k < 5; ++k) {
    sonde_path_def def = sonde_path_def_default();
    double *value[] = {&def.step_m, &def.least_step_m, &def.tolerance, &def.force_n,
                       &def.relative_residual};
    *value[k] = k == 3 ? NAN : 0;
    assert_int_equal(sonde_settle_path(b.state, &b.probe, fixture_pose(0), fixture_pose(1e-3), &def,
                                       NULL, &r, &error),
                     SONDE_ARGUMENT);
  }
  clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_force_does_not_depend_on_the_division),
      cmocka_unit_test(a_press_by_time_steps_ends_there_too),
      cmocka_unit_test(force_and_depth_are_one_curve),
      cmocka_unit_test(a_far_settling_is_told),
      cmocka_unit_test(jumps_are_told),
      cmocka_unit_test(rows_out_of_reach_are_in_balance),
      cmocka_unit_test(bad_options_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
