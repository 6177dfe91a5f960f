// Sessions whose tissue is the hyperelastic solid: force, skin, vein and picture are of one state,
// which ends at the equilibrium; the probe goes from place to place without a jump; what was
// recorded replays and seeks to the same bits.
#include "exam_test.h"

#include "base/clock.h"

static const double coarse_m = 20e-3; // faces of a mesh that only has to be there

static int set_up(void **state) {
  *state = barrel_model();
  return 0;
}
static int tear_down(void **state) {
  sonde_model_destroy(*state);
  return 0;
}

static void check(sonde_status status, const sonde_error *error) {
  if (status) fail_msg("%s", error->message);
}

typedef struct key {
  double time_s, depth_m, along_m;
} key;

static sonde_pose pose_of(double depth_m, double along_m) {
  const sonde_site site = barrel_site();
  sonde_pose pose = sonde_site_pose(&site, depth_m);
  pose.position.z += along_m;
  return pose;
}

static sonde_session *open_solid(const sonde_model *model, const key *keys, uint32_t count,
                                 double edge_m, const char *record) {
  sonde_script_key script[8];
  for (uint32_t k = 0; k < count; ++k)
    script[k] = (sonde_script_key){keys[k].time_s, pose_of(keys[k].depth_m, keys[k].along_m)};
  sonde_device device;
  assert_int_equal(sonde_device_script(script, count, 1e-3, &device, NULL), SONDE_OK);
  sonde_session_solid solid = sonde_session_solid_default();
  solid.edge_m = edge_m;
  sonde_session_def def = small_def(model);
  def.solid = &solid;
  def.record_path = record;
  sonde_session *session = NULL;
  sonde_error error = {0};
  check(sonde_session_create(&def, &device, &session, &error), &error);
  return session;
}

// The newest frame after so many ticks.
static sonde_frame run(sonde_session *session, int ticks) {
  sonde_frame frame = {0};
  for (int t = 0; t < ticks; ++t) {
    sonde_session_tick(session);
    (void)sonde_session_frame(session, &frame);
  }
  assert_non_null(frame.pixels);
  return frame;
}

// What sonde press --solid has of a pose: force along the probe, area of the vein in its plane.
static void press_offline(const sonde_model *model, double edge_m, double depth_m, double *force_n,
                          double *vein_ratio) {
  const sonde_site site = barrel_site();
  const sonde_pose start = sonde_site_pose(&site, 0), pose = pose_of(depth_m, 0);
  const sonde_equilibrium_def def = sonde_equilibrium_def_default();
  sonde_hexes_def how = sonde_hexes_def_default();
  sonde_probe probe;
  sonde_hexes mesh = {0};
  sonde_equilibrium *e = NULL;
  sonde_equilibrium_result result;
  sonde_interior_tissue *tissue = NULL;
  sonde_interior *interior = NULL;
  sonde_pathology pathology;
  sonde_vessel_state vein;
  sonde_error error = {0};
  check(sonde_probe_create("linear", &probe, &error), &error);
  how.half_u_m = probe.half_x_m, how.half_v_m = probe.half_y_m, how.edge_m = edge_m;
  check(sonde_hexes_ring(model, &site, &how, &mesh, &error), &error);
  check(sonde_equilibrium_create(&mesh, &probe, start, &def, &e, &error), &error);
  check(sonde_equilibrium_find(e, pose, &result, &error), &error);
  check(sonde_equilibrium_tissue(e, &tissue, &error), &error);
  check(sonde_interior_create(model, &interior, &error), &error);
  check(sonde_pathology_preset("healthy", &pathology, &error), &error);
  const sonde_interior_input input = {.world_from_probe = pose,
                                      .pathology = &pathology,
                                      .dt_s = -1,
                                      .face_half_x_m = probe.half_x_m,
                                      .face_half_y_m = probe.half_y_m,
                                      .tissue = tissue};
  sonde_interior_update(interior, &input);
  assert_true(sonde_interior_vessel_at_plane(interior, 0, pose, &vein));
  *force_n = v_dot(result.force_n, site.normal), *vein_ratio = vein.area_ratio;
  sonde_interior_destroy(interior);
  sonde_solid_tissue_destroy(tissue);
  sonde_equilibrium_destroy(e);
  sonde_hexes_clear(&mesh);
  sonde_probe_clear(&probe);
}

// A held probe: on the session's mesh the equilibrium itself; on the finer one of sonde press the
// force within 3 % and the vein's area within 0.06 of its rest.
static void force_and_vein_are_those_of_one_solid(void **state) {
  const key keys[] = {{0, -5e-3, 0}, {0.1, -5e-3, 0}, {0.4, 8e-3, 0}};
  sonde_session *session = open_solid(*state, keys, 3, 10e-3, NULL);
  const sonde_frame frame = run(session, 800);
  double force_n, vein_ratio;
  assert_true(frame.snapshot.solid && frame.snapshot.contact_area_m2 > 1e-4);
  press_offline(*state, 10e-3, 8e-3, &force_n, &vein_ratio);
  assert_true(force_n > 1 && vein_ratio < 0.95);
  assert_true(fabs(frame.snapshot.force_normal_n / force_n - 1) < 1e-3);
  assert_true(fabs(frame.snapshot.vein_area_ratio - vein_ratio) < 3e-3);
  press_offline(*state, 5e-3, 8e-3, &force_n, &vein_ratio);
  assert_true(fabs(frame.snapshot.force_normal_n / force_n - 1) < 0.03);
  assert_true(fabs(frame.snapshot.vein_area_ratio - vein_ratio) < 0.06);
  // The skin that is shown lies on the probe's face.
  double nearest_m = INFINITY, depth_m = 0;
  for (size_t i = 0; i < session->nodes; ++i) {
    const float *x = frame.skin_m + 3 * i;
    const double aside_m = hypot((double)x[1], (double)x[2]);
    if (x[0] > 0 && aside_m < nearest_m) nearest_m = aside_m, depth_m = 0.07 - (double)x[0];
  }
  assert_true(nearest_m < 6e-3 && fabs(depth_m - 8e-3) < 1e-3);
  close_session(session);
}

// Along the leg by 24 mm with the probe pressed in deeper than half its width: the force is that of
// a probe that was put there, and no tick on the way changes it by more than 0.1 N.
static void a_slide_goes_from_place_to_place(void **state) {
  const key slide[] = {{0, -2e-3, 0}, {0.4, 12e-3, 0}, {0.5, 12e-3, 0}, {1.7, 12e-3, 24e-3}};
  const key put[] = {{0, -2e-3, 24e-3}, {0.4, 12e-3, 24e-3}};
  sonde_session *session = open_solid(*state, slide, 4, 10e-3, NULL);
  (void)run(session, 500);
  double most_n = 0;
  sonde_vec3 last = session->subject->felt.force_n;
  for (int t = 0; t < 1200; ++t) {
    sonde_session_tick(session);
    most_n = fmax(most_n, v_distance(session->subject->felt.force_n, last));
    last = session->subject->felt.force_n;
  }
  const sonde_frame slid = run(session, 400);
  const sonde_session_solid_counts counts = sonde_session_solid_count(session);
  assert_true(counts.places >= 4 && counts.late == 0);
  assert_true(most_n < 0.1 && counts.handed_over_n < 0.1);
  close_session(session);
  session = open_solid(*state, put, 2, 10e-3, NULL);
  const sonde_frame pressed = run(session, 800);
  assert_true(fabs(slid.snapshot.force_normal_n / pressed.snapshot.force_normal_n - 1) < 0.02);
  assert_true(fabs(slid.snapshot.vein_area_ratio - pressed.snapshot.vein_area_ratio) < 0.02);
  close_session(session);
}

// A probe that slides off the only place there is loses its force, but in no tick by a jerk.
static void a_probe_that_leaves_its_place_feels_no_jerk(void **state) {
  const key keys[] = {{0, -2e-3, 0}, {0.2, 8e-3, 0}, {0.3, 8e-3, 0}, {1.3, 8e-3, 40e-3}};
  sonde_session *session = open_solid(*state, keys, 4, coarse_m, NULL);
  sonde_vec3 last = vec3(0, 0, 0);
  double most_n = 0, largest_n = 0;
  for (int t = 0; t < 1300; ++t) {
    const sonde_vec3 *felt_n = &session->subject->felt.force_n;
    sonde_session_step(session);
    sonde_solid_leg_await(session->subject->solid, SONDE_LEG_PASS | (t < 100) * SONDE_LEG_PLACE);
    (void)sonde_session_show(session);
    most_n = fmax(most_n, v_distance(*felt_n, last)), largest_n = fmax(largest_n, v_norm(last));
    last = *felt_n;
  }
  assert_true(largest_n > 1 && v_norm(last) < 0.05 && most_n < 0.3);
  assert_int_equal(sonde_session_solid_count(session).places, 1);
  assert_true(sonde_session_solid_count(session).ticks_without_place > 300);
  close_session(session);
}

// Pressed in from the first tick on: the first place is asked for then, made, walked to the probe
// and serves 40 ticks later.
static void ticks_in_the_skin_without_a_place_are_counted(void **state) {
  const key keys[] = {{0, 4e-3, 0}, {0.1, 4e-3, 0}};
  sonde_session *session = open_solid(*state, keys, 2, coarse_m, NULL);
  (void)run(session, 100);
  assert_int_equal(sonde_session_solid_count(session).ticks_without_place, 40);
  assert_true(session->subject->felt.area_m2 > 0);
  close_session(session);
}

static void forget(const char *path) {
  char keys[64];
  snprintf(keys, sizeof keys, "%s.keys", path);
  unlink(keys);
  unlink(path);
}

static sonde_player *open_player(const char *path, const sonde_model *model) {
  sonde_player *player = NULL;
  sonde_error error = {0};
  const sonde_player_def def = {.path = path, .model = model};
  check(sonde_player_open(&def, &player, &error), &error);
  return player;
}

// Twice pressed at different places with the probe in the air between: a seek into the second
// begins with the solid at rest there.
static void a_seek_has_the_bits_of_playing_through(void **state) {
  static const char path[] = "exam_solid.rec";
  const key keys[] = {{0, -3e-3, 0},       {0.2, 5e-3, 0},      {0.35, -3e-3, 0},
                      {0.6, -4e-3, 15e-3}, {1.0, -4e-3, 15e-3}, {1.2, 5e-3, 15e-3},
                      {1.35, 5e-3, 18e-3}};
  sonde_session *session = open_solid(*state, keys, 7, coarse_m, path);
  (void)run(session, 1400);
  const uint64_t hash = sonde_session_hash(session);
  close_session(session);
  unlink("exam_solid.rec.keys");
  sonde_player *player = open_player(path, *state);
  sonde_replay_result result;
  sonde_frame frame;
  sonde_error error = {0};
  check(sonde_player_check(player, true, NULL, &result, &error), &error);
  assert_true(result.same && result.same_images && result.hash == hash && result.checks > 0);
  assert_true(player->keyframes.count > 0);
  const sonde_packed_keyframe *from = sonde_keyframes_find(&player->keyframes, 1100);
  assert_true(from && from->tick > 600); // in the air, above the second place
  assert_true(sonde_player_frame(player, &frame));
  const uint64_t pixels = sonde_frame_hash(0, &frame);
  check(sonde_player_seek(player, 0.1, NULL, &error), &error);
  check(sonde_player_seek(player, 1.25, NULL, &error), &error);
  sonde_player_advance(player, 1.4);
  assert_true(sonde_player_frame(player, &frame));
  assert_true(sonde_player_hash(player) == hash);
  assert_true(sonde_frame_hash(0, &frame) == pixels);
  sonde_player_close(player);
  forget(path);
}

// However late its passes and places come, a session in real time replays to the same bits.
static void a_session_in_real_time_replays(void **state) {
  static const char path[] = "exam_solid_live.rec";
  const key keys[] = {{0, -3e-3, 0}, {0.3, -3e-3, 0}, {0.6, 5e-3, 0}, {1.2, 5e-3, 12e-3}};
  sonde_session *session = open_solid(*state, keys, 4, coarse_m, path);
  sonde_error error = {0};
  check(sonde_session_start(session, &error), &error);
  sonde_frame frame;
  for (bool solid = false; !solid || sonde_session_ticks(session) < 1400;) {
    sonde_clock_sleep_until(sonde_clock_now() + 5e-3);
    if (sonde_session_frame(session, &frame)) solid = frame.snapshot.contact_area_m2 > 0;
    if (sonde_session_ticks(session) > 120000) fail_msg("no place was made in two minutes");
  }
  sonde_session_stop(session);
  const uint64_t hash = sonde_session_hash(session);
  assert_true(sonde_session_solid_count(session).places > 0);
  close_session(session);
  sonde_player *player = open_player(path, *state);
  sonde_replay_result result;
  check(sonde_player_check(player, true, NULL, &result, &error), &error);
  assert_true(result.same && result.same_images && result.hash == hash);
  sonde_player_close(player);
  forget(path);
}

static size_t calls;
static void *counting(size_t bytes, void *user) {
  (void)user;
  ++calls;
  return malloc(bytes);
}

// With a place asked for, taken over and pressed; worker and builder come in between.
static void ticks_do_not_allocate(void **state) {
  const key keys[] = {{0, -3e-3, 0}, {0.1, -3e-3, 0}, {0.3, 5e-3, 0}, {0.6, 5e-3, 12e-3}};
  sonde_session *session = open_solid(*state, keys, 4, coarse_m, NULL);
  calls = 0;
  for (int t = 0; t < 600; ++t) {
    sonde_set_allocator(&(sonde_allocator){counting, NULL, NULL});
    sonde_session_step(session);
    sonde_set_allocator(NULL);
    sonde_solid_leg_await(session->subject->solid, SONDE_LEG_PASS | SONDE_LEG_PLACE);
    (void)sonde_session_show(session);
  }
  assert_int_equal(calls, 0);
  assert_true(sonde_session_solid_count(session).places > 1);
  assert_true(session->subject->felt.area_m2 > 0);
  close_session(session);
}

static void expect_refusal(const sonde_session_def *def, const char *words) {
  sonde_session *session = NULL;
  sonde_error error = {0};
  sonde_device device = press_device();
  assert_int_equal(sonde_session_create(def, &device, &session, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, words));
  device.destroy(device.self);
}

static void what_a_solid_does_not_have_is_refused(void **state) {
  sonde_session_solid solid = sonde_session_solid_default();
  sonde_session_def def = small_def(*state);
  def.solid = &solid;
  def.preset_count = 1, def.presets[0] = sonde_preset_default();
  expect_refusal(&def, "without presets");
  def.preset_count = 0;
  def.world.dt_s = 2e-3;
  expect_refusal(&def, "ticks of 0.002 s");
  def.world.dt_s = 1e-3;
  solid.edge_m = 1;
  expect_refusal(&def, "edge_m");
  solid.edge_m = 10e-3;
  solid.layer[SONDE_SOLID_FAT].shear_pa = -1;
  expect_refusal(&def, "fat");
  solid.layer[SONDE_SOLID_FAT].shear_pa = 1e3;
  solid.version = 0;
  expect_refusal(&def, "version");
  solid.version = SONDE_DEF_VERSION;
  sonde_model *model = *state; // forces only
  const uint32_t faces = model->femur.face_count;
  model->femur.face_count = 0;
  expect_refusal(&def, "no bone");
  model->femur.face_count = faces;
  model->edge_share = SONDE_NEW(double, model->topology.edge_count);
  assert_non_null(model->edge_share);
  expect_refusal(&def, "skin is cut");
  sonde_free(model->edge_share);
  model->edge_share = NULL;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(force_and_vein_are_those_of_one_solid),
      cmocka_unit_test(a_slide_goes_from_place_to_place),
      cmocka_unit_test(a_probe_that_leaves_its_place_feels_no_jerk),
      cmocka_unit_test(ticks_in_the_skin_without_a_place_are_counted),
      cmocka_unit_test(a_seek_has_the_bits_of_playing_through),
      cmocka_unit_test(a_session_in_real_time_replays),
      cmocka_unit_test(ticks_do_not_allocate),
      cmocka_unit_test(what_a_solid_does_not_have_is_refused),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
