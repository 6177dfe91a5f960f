// Sessions in real time: the threads hand over whole states, and what was recorded replays to the
// same state although the timing never repeats.
#include "exam_test.h"

#include "base/clock.h"

static int set_up(void **state) {
  *state = barrel_model();
  return 0;
}
static int tear_down(void **state) {
  sonde_model_destroy(*state);
  return 0;
}

// Reads frames until the session has made so many more ticks and there are two frames; every frame
// must be whole and newer than the last.
static uint64_t watch(sonde_session *session, uint64_t ticks) {
  uint64_t seen = 0, last = 0, end = sonde_session_ticks(session) + ticks;
  while (sonde_session_ticks(session) < end || seen < 2) {
    sonde_frame frame;
    if (!sonde_session_frame(session, &frame)) {
      sonde_clock_sleep_until(sonde_clock_now() + 2e-3);
      continue;
    }
    assert_true(frame.snapshot.tick > last);
    assert_true(last == 0 || frame.snapshot.tick >= last + 20);
    assert_true(frame.snapshot.tick <= sonde_session_ticks(session));
    double time_s = 1e-3 * (double)frame.snapshot.tick;
    assert_true(fabs(frame.snapshot.time_s - time_s) < 1e-9);
    for (size_t i = 0; i < 3 * session->nodes; ++i) assert_true(fabsf(frame.skin_m[i]) < 1.0f);
    last = frame.snapshot.tick;
    seen++;
  }
  return seen;
}

static void replay_and_compare(const char *path, const sonde_model *model, uint64_t hash) {
  sonde_replay_result result;
  sonde_error error = {0};
  if (play_again(path, model, NULL, &result, &error)) fail_msg("%s", error.message);
  assert_true(result.same);
  assert_true(result.hash == hash);
  char keys[64];
  snprintf(keys, sizeof keys, "%s.keys", path);
  unlink(keys);
  unlink(path);
}

static void realtime_run_replays_in_lockstep(void **state) {
  static const char path[] = "exam_realtime.rec";
  sonde_session_def def = small_def(*state);
  def.record_path = path;
  sonde_session *session = open_session(&def, press_device());
  assert_int_equal(sonde_session_start(session, NULL), SONDE_OK);
  assert_int_equal(sonde_session_start(session, NULL), SONDE_OK); // already running
  assert_true(sonde_session_hash(session) == 0);
  sonde_session_controls c = sonde_session_controls_now(session);
  uint64_t seen = watch(session, 700);
  c.probe = 2;
  sonde_session_control(session, &c);
  seen += watch(session, 500);
  sonde_session_stop(session);
  sonde_loop_stats stats = sonde_session_loop(session);
  assert_int_equal(stats.ticks, sonde_session_ticks(session));
  assert_true(seen > 0 && seen <= sonde_session_images(session));
  double median_s = sonde_session_latency(session, 0.5), most_s = sonde_session_latency(session, 1);
  assert_true(median_s > 0 && median_s <= most_s);
  for (int i = 0; i < 30; ++i) sonde_session_tick(session); // lockstep goes on where it stopped
  uint64_t hash = sonde_session_hash(session);
  close_session(session);
  replay_and_compare(path, *state, hash);
}

static void two_trainees_in_one_process(void **state) {
  static const char *const path[2] = {"exam_trainee_a.rec", "exam_trainee_b.rec"};
  sonde_session *session[2];
  sonde_site site = barrel_site();
  sonde_device page;
  assert_int_equal(sonde_device_page(sonde_site_pose(&site, -0.002), 1e-3, &page, NULL), SONDE_OK);
  for (int i = 0; i < 2; ++i) {
    sonde_session_def def = small_def(*state);
    def.record_path = path[i];
    session[i] = open_session(&def, i ? page : press_device());
    assert_int_equal(sonde_session_start(session[i], NULL), SONDE_OK);
  }
  sonde_device_page_goal(sonde_session_device(session[1]), sonde_site_pose(&site, 0.01));
  watch(session[0], 300);
  watch(session[1], 300);
  uint64_t hash[2];
  for (int i = 0; i < 2; ++i) {
    sonde_session_stop(session[i]);
    hash[i] = sonde_session_hash(session[i]);
    close_session(session[i]);
  }
  for (int i = 0; i < 2; ++i) replay_and_compare(path[i], *state, hash[i]);
}

// A device that sleeps once (what no device may do) makes the tick late.
static void sleepy_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  sonde_site site = barrel_site();
  const double *nap_s = self;
  if (tick == 100) sonde_clock_sleep_until(sonde_clock_now() + *nap_s);
  *sample = (sonde_device_sample){sonde_site_pose(&site, 0.005), 0, true};
}

static void write_nowhere(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  (void)self;
  assert_true(v_finite(force_n) && v_finite(torque_n_m));
}

static void a_long_gap_trips_and_is_counted(void **state) {
  double nap_s = 0.4;
  sonde_session_def def = small_def(*state);
  sonde_session *session =
      open_session(&def, (sonde_device){"sleepy", &nap_s, sleepy_read, write_nowhere, NULL});
  assert_int_equal(sonde_session_start(session, NULL), SONDE_OK);
  while (sonde_session_ticks(session) <= 200) sonde_clock_sleep_until(sonde_clock_now() + 0.01);
  sonde_session_stop(session);
  assert_int_equal(session->safety.fault, SONDE_FAULT_STALE);
  assert_true(sonde_session_loop(session).deadline_misses >= 390);
  assert_true(sonde_session_loop(session).compute_max_s >= nap_s);
  close_session(session);
}

// What another session recorded drives this one through the replay device: same state, with images.
static void replay_device_repeats_a_session(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_device script = press_device();
  enum { TICKS = 300 };
  sonde_device_sample *samples = calloc(TICKS, sizeof *samples);
  for (uint64_t i = 0; i < TICKS; ++i) script.read(script.self, i, &samples[i]);
  sonde_device replay;
  assert_int_equal(sonde_device_replay(samples, TICKS, &replay, NULL), SONDE_OK);
  free(samples);
  sonde_session *a = open_session(&def, script), *b = open_session(&def, replay);
  for (int i = 0; i < TICKS; ++i) {
    sonde_session_tick(a);
    sonde_session_tick(b);
  }
  assert_true(sonde_session_hash(a) == sonde_session_hash(b));
  sonde_frame of_a, of_b;
  assert_true(sonde_session_frame(a, &of_a) && sonde_session_frame(b, &of_b));
  assert_memory_equal(of_a.pixels, of_b.pixels, (size_t)of_a.width * of_a.height);
  close_session(a);
  close_session(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(realtime_run_replays_in_lockstep),
      cmocka_unit_test(two_trainees_in_one_process),
      cmocka_unit_test(a_long_gap_trips_and_is_counted),
      cmocka_unit_test(replay_device_repeats_a_session),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
