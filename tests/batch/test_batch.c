// Laws of a batch of thighs: drives, limits, states to return to, and one physics with a session.
#include "batch_test.h"

#include "exam/session.h"

typedef struct shared {
  sonde_model *model;
  sonde_case_setup setup;
  const sonde_case_setup *patients[1];
} shared;
static shared s;

static int set_up(void **state) {
  (void)state;
  s.model = bundled_thigh();
  s.setup = patient_of(s.model);
  s.patients[0] = &s.setup;
  return 0;
}
static int tear_down(void **state) {
  (void)state;
  sonde_model_destroy(s.model);
  return 0;
}

static sonde_batch_def thighs(uint32_t count) {
  sonde_batch_def def = sonde_batch_def_default();
  def.patients = s.patients, def.patient_count = 1, def.count = count;
  return def;
}

// Over site 27, 5 mm above the skin.
static sonde_batch_start over_the_vein(const sonde_batch *batch) {
  sonde_batch_start start = sonde_batch_start_default(batch, 0);
  start.world_from_probe = sonde_site_pose(sonde_model_site(s.model, 27), -0.005);
  return start;
}

static void a_force_is_kept_and_closes_the_vein(void **state) {
  (void)state;
  sonde_batch_def def = thighs(1);
  def.drive = SONDE_BATCH_BY_FORCE;
  sonde_batch *batch = batch_of(&def);
  sonde_batch_start start = over_the_vein(batch);
  assert_int_equal(sonde_batch_reset(batch, 0, &start, NULL), SONDE_OK);
  sonde_batch_view view = sonde_batch_look(batch);
  assert_near(view.wrench[2], 0, 0);
  const double action[SONDE_BATCH_ACTION] = {0, 0, 12};
  double most_n = 0;
  for (int k = 0; k < 60; ++k) {
    step(batch, action);
    most_n = fmax(most_n, -view.wrench[2]);
  }
  assert_near(-view.wrench[2], 12, 0.02);
  assert_true(most_n < 12.5);
  assert_near(view.time_s[0], 1.2, 1e-9);
  assert_true(view.vessel[SONDE_BATCH_vein_ratio] < 0.1);
  assert_true(view.vessel[SONDE_BATCH_artery_ratio] > 0.9);
  assert_true(view.vessel[SONDE_BATCH_vein_z_m] > 0.008 &&
              view.vessel[SONDE_BATCH_vein_z_m] < 0.03);
  const sonde_snapshot *snapshot = sonde_batch_snapshot(batch, 0);
  assert_near(snapshot->force_normal_n, -view.wrench[2], 1e-9);
  assert_near(snapshot->vein_area_ratio, view.vessel[SONDE_BATCH_vein_ratio], 0);
  sonde_batch_destroy(batch);
}

// The way down to the skin at the greatest speed takes nothing from the speed along the face later.
static void a_force_leaves_the_speed_along_the_face(void **state) {
  (void)state;
  sonde_batch_def def = thighs(1);
  def.drive = SONDE_BATCH_BY_FORCE, def.inside = false;
  sonde_batch *batch = batch_of(&def);
  sonde_batch_start start = over_the_vein(batch);
  assert_int_equal(sonde_batch_reset(batch, 0, &start, NULL), SONDE_OK);
  const double action[SONDE_BATCH_ACTION] = {0.02, 0, 12};
  for (int k = 0; k < 20; ++k) step(batch, action);
  const double *now = sonde_batch_look(batch).pose;
  const sonde_vec3 x = q_rotate(start.world_from_probe.rotation, vec3(1, 0, 0));
  const double way_m =
      v_dot(v_sub(vec3(now[0], now[1], now[2]), start.world_from_probe.position), x);
  assert_near(way_m, 0.02 * 0.4, 0.01 * 0.02 * 0.4);
  sonde_batch_destroy(batch);

  // In the air a probe that may go at 25 mm/s keeps the slope of 20 along the face to 25 down.
  def.speed_m_s = 0.025;
  batch = batch_of(&def);
  assert_int_equal(sonde_batch_reset(batch, 0, &start, NULL), SONDE_OK);
  step(batch, action);
  now = sonde_batch_look(batch).pose;
  const sonde_vec3 way = v_sub(vec3(now[0], now[1], now[2]), start.world_from_probe.position);
  const sonde_vec3 down = q_rotate(start.world_from_probe.rotation, vec3(0, 0, 1));
  assert_near(v_dot(way, x) / v_dot(way, down), 0.8, 1e-9);
  assert_near(v_norm(way), 0.025 * 0.02, 1e-9);
  sonde_batch_destroy(batch);
}

static void no_action_goes_far_beyond_the_limit(void **state) {
  (void)state;
  sonde_batch_def def = thighs(1);
  def.inside = false, def.force_limit_n = 10;
  sonde_batch *batch = batch_of(&def);
  sonde_batch_start start = over_the_vein(batch);
  assert_int_equal(sonde_batch_reset(batch, 0, &start, NULL), SONDE_OK);
  sonde_batch_view view = sonde_batch_look(batch);
  const double action[SONDE_BATCH_ACTION] = {0, 0, 0.05};
  double most_n = 0;
  for (int k = 0; k < 50; ++k) {
    step(batch, action);
    most_n = fmax(most_n, -view.wrench[2]);
  }
  assert_true(most_n > 9.5 && most_n < 11);
  sonde_batch_destroy(batch);
}

// The poses of a batch's ticks into a session: the state is the same to the bit.
static void a_session_feels_the_same(void **state) {
  (void)state;
  sonde_batch_def def = thighs(1);
  def.drive = SONDE_BATCH_TO_POSE, def.ticks_per_step = 1, def.inside = false;
  sonde_batch *batch = batch_of(&def);
  sonde_session_def lone = sonde_session_def_default();
  sonde_case_session(&s.setup, &lone);
  static const char *const PROBES[] = {"linear", NULL};
  lone.probe_names = PROBES, lone.ticks_per_image = 1000000;
  sonde_batch_start start = over_the_vein(batch);
  assert_int_equal(sonde_batch_reset(batch, 0, &start, NULL), SONDE_OK);
  sonde_setup setup = sonde_setup_of(&lone);
  sonde_subject *subject = NULL;
  lone.controls.stiffness_scale = lone.controls.damping_scale = lone.controls.friction_scale = 1;
  assert_int_equal(
      sonde_subject_create(&setup, s.model, &lone.world, &lone.controls, &subject, NULL), SONDE_OK);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  sonde_batch_view view = sonde_batch_look(batch);
  for (int k = 0; k < 200; ++k) {
    sonde_pose pose = sonde_site_pose(sonde_model_site(s.model, 27), -0.005 + 1e-4 * k);
    const double action[SONDE_BATCH_ACTION] = {pose.position.x, pose.position.y, pose.position.z,
                                               pose.rotation.w, pose.rotation.x, pose.rotation.y,
                                               pose.rotation.z};
    step(batch, action);
    sonde_pose there = {.position = {view.pose[0], view.pose[1], view.pose[2]},
                        .rotation = {view.pose[3], view.pose[4], view.pose[5], view.pose[6]}};
    assert_near(v_distance(there.position, pose.position), 0, 1e-15);
    sonde_subject_step(subject, &probe, there);
  }
  assert_true(-view.wrench[2] > 3);
  uint64_t own = sonde_state_hash(subject->state), both = sonde_hash(0, &own, sizeof own);
  both = sonde_hash(both, view.pose, SONDE_BATCH_POSE * sizeof(double));
  assert_true(both == sonde_batch_hash(batch));
  sonde_subject_destroy(subject);
  sonde_probe_clear(&probe);
  sonde_batch_destroy(batch);
}

static void saved_states_go_on_alike(void **state) {
  (void)state;
  sonde_batch_def def = thighs(2);
  def.drive = SONDE_BATCH_BY_FORCE, def.width = 64, def.height = 96;
  sonde_batch *batch = batch_of(&def);
  sonde_batch_start start = over_the_vein(batch);
  for (uint32_t i = 0; i < 2; ++i)
    assert_int_equal(sonde_batch_reset(batch, i, &start, NULL), SONDE_OK);
  assert_alike(batch, 0, batch, 1);
  const double actions[2 * SONDE_BATCH_ACTION] = {0.01, 0, 6, 0, 0, 0.1, 0, -0.01, 0.01, 3};
  for (int k = 0; k < 20; ++k) step(batch, actions);
  sonde_batch_view view = sonde_batch_look(batch);
  assert_true(fabs(view.wrench[2] - view.wrench[8]) > 1);
  size_t bytes = sonde_batch_size(batch, 0);
  assert_int_equal(bytes, sonde_batch_size(batch, 1));
  void *blob = sonde_calloc(1, bytes);
  sonde_batch_save(batch, 0, blob);

  // Environment 1 goes on as 0 does, after one step and after ten.
  assert_int_equal(sonde_batch_restore(batch, 1, blob, bytes, NULL), SONDE_OK);
  const size_t columns = SONDE_BATCH_VESSEL;
  assert_memory_equal(view.vessel, view.vessel + columns, columns * sizeof(double));
  assert_memory_equal(view.wrench, view.wrench + 6, 6 * sizeof(double));
  const double same[2 * SONDE_BATCH_ACTION] = {0.01, 0, 9, 0, 0, 0.1, 0, 0.01, 0, 9, 0, 0, 0.1};
  for (int k = 0; k < 10; ++k) {
    step(batch, same);
    if (k == 0 || k == 9) assert_alike(batch, 0, batch, 1);
  }
  uint32_t grey = 0;
  for (int k = 0; k < 64 * 96; ++k) grey += view.pixels[k];
  assert_true(grey > 64 * 96 * 10u);

  // A reset is a new beginning; the mask holds an environment.
  sonde_batch *fresh = batch_of(&def);
  assert_int_equal(sonde_batch_reset(fresh, 0, &start, NULL), SONDE_OK);
  assert_int_equal(sonde_batch_reset(batch, 1, &start, NULL), SONDE_OK);
  assert_alike(fresh, 0, batch, 1);
  const uint8_t mask[] = {0, 1};
  double before_s = view.time_s[0];
  assert_int_equal(sonde_batch_step(batch, actions, mask, NULL), SONDE_OK);
  assert_near(view.time_s[0], before_s, 0);
  assert_near(view.time_s[1], 0.02, 1e-12);

  // What is no saved environment is refused, and the batch goes on.
  sonde_error error = {0};
  assert_int_equal(sonde_batch_restore(batch, 0, blob, bytes - 8, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "expected"));
  step(batch, actions);
  sonde_free(blob);
  sonde_batch_destroy(fresh);
  sonde_batch_destroy(batch);
}

static void bad_definitions_are_named(void **state) {
  (void)state;
  sonde_batch *batch = NULL;
  sonde_error error = {0};
  sonde_batch_def def = thighs(1);
  def.ticks_per_step = 0;
  assert_int_equal(sonde_batch_create(&def, &batch, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "ticks_per_step"));
  def = thighs(1), def.width = def.height = 64, def.inside = false;
  assert_int_equal(sonde_batch_create(&def, &batch, &error), SONDE_ARGUMENT);
  def = thighs(1), def.force_limit_n = (double)NAN;
  assert_int_equal(sonde_batch_create(&def, &batch, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "force_limit_n"));
  def = thighs(1), def.patient_count = 0;
  assert_int_equal(sonde_batch_create(&def, &batch, &error), SONDE_ARGUMENT);
  def = thighs(1), def.inside = false;
  batch = batch_of(&def);
  sonde_batch_start start = over_the_vein(batch);
  start.stiffness_scale = 3;
  assert_int_equal(sonde_batch_reset(batch, 0, &start, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "stiffness_scale"));
  start = over_the_vein(batch), start.world_from_probe.position.x = (double)NAN;
  assert_int_equal(sonde_batch_reset(batch, 0, &start, &error), SONDE_ARGUMENT);
  // Numbers that are none stand still.
  start = over_the_vein(batch);
  assert_int_equal(sonde_batch_reset(batch, 0, &start, NULL), SONDE_OK);
  sonde_batch_view view = sonde_batch_look(batch);
  double z = view.pose[2];
  const double action[SONDE_BATCH_ACTION] = {(double)NAN, INFINITY, (double)NAN};
  step(batch, action);
  assert_near(view.pose[2], z, 1e-15);
  sonde_batch_destroy(batch);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_force_is_kept_and_closes_the_vein),
      cmocka_unit_test(a_force_leaves_the_speed_along_the_face),
      cmocka_unit_test(no_action_goes_far_beyond_the_limit),
      cmocka_unit_test(a_session_feels_the_same),
      cmocka_unit_test(saved_states_go_on_alike),
      cmocka_unit_test(bad_definitions_are_named),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
