// Recordings: what goes in comes out, replays reach the same state, damage of any kind is noticed.
#include "exam_test.h"
#include "sanitized.h"

#include <sys/stat.h>

static const char path[] = "exam_record.rec";

static int set_up(void **state) {
  *state = barrel_model();
  return 0;
}
static int tear_down(void **state) {
  sonde_model_destroy(*state);
  unlink(path);
  unlink("exam_record.rec.keys");
  return 0;
}

// Presses in lockstep while probe and case change; returns the final hash.
static uint64_t record_scene(const sonde_model *model, int ticks) {
  sonde_session_def def = small_def(model);
  def.record_path = path;
  sonde_session *session = open_session(&def, press_device());
  for (int i = 0; i < ticks; ++i) {
    sonde_session_controls c = sonde_session_controls_now(session);
    if (i == 150) c.probe = 2;
    if (i == 200) assert_int_equal(sonde_pathology_preset("chronic", &c.pathology, NULL), SONDE_OK);
    if (i == 150 || i == 200) sonde_session_control(session, &c);
    sonde_session_tick(session);
  }
  uint64_t hash = sonde_session_hash(session);
  close_session(session);
  return hash;
}

static void replay_reaches_the_same_state(void **state) {
  uint64_t hash = record_scene(*state, 400);
  sonde_replay_result result;
  sonde_error error = {0};
  if (play_again(path, *state, NULL, &result, &error)) fail_msg("%s", error.message);
  assert_int_equal(result.ticks, 400);
  assert_true(result.same && result.hash == hash && result.recorded_hash == hash);
  assert_string_equal(result.model_path, "barrel.sonde");
}

static void inspection_names_the_model(void **state) {
  record_scene(*state, 3);
  sonde_recording_info info;
  assert_int_equal(sonde_recording_inspect(path, false, &info, NULL), SONDE_OK);
  assert_string_equal(info.model_path, "barrel.sonde");
  assert_true(info.model_checksum == 0x0123456789abcdefu);
}

static void another_model_is_refused(void **state) {
  record_scene(*state, 3);
  sonde_model *model = *state;
  sonde_replay_result result;
  sonde_error error;
  model->checksum ^= 1;
  assert_int_equal(play_again(path, model, NULL, &result, &error), SONDE_MISMATCH);
  model->checksum ^= 1;
  assert_non_null(strstr(error.message, "barrel"));
}

// The gate can close: another parameter under the same checksum gives another state.
static void another_thigh_gives_another_hash(void **state) {
  NOT_SANITIZED();
  record_scene(*state, 200);
  sonde_model *twin = barrel_model();
  for (uint32_t i = 0; i < twin->surface.vertex_count; ++i) twin->k0_n_m3[i] *= 1.0 + 1e-6;
  sonde_replay_result result;
  assert_int_equal(play_again(path, twin, NULL, &result, NULL), SONDE_OK);
  assert_false(result.same);
  sonde_model_destroy(twin);
}

static bool stop_soon(double fraction, const char *what, void *user) {
  (void)what;
  (void)user;
  return fraction < 0.5;
}

static void replay_can_be_cancelled(void **state) {
  NOT_SANITIZED();
  record_scene(*state, 700);
  sonde_replay_result result;
  sonde_progress progress = {stop_soon, NULL};
  assert_int_equal(play_again(path, *state, &progress, &result, NULL), SONDE_CANCELLED);
  assert_true(result.ticks < 700 && result.ticks > 0);
  assert_false(result.same);
}

static void write_file(const char *bytes, size_t count) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, count, file), count);
  fclose(file);
}

static sonde_status inspect(sonde_error *error) {
  sonde_recording_info info;
  return sonde_recording_inspect(path, false, &info, error);
}

static void every_flipped_byte_is_noticed(void **state) {
  record_scene(*state, 2);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(path, &bytes, &count, NULL), SONDE_OK);
  for (size_t i = 0; i < count; ++i) {
    bytes[i] = (char)(bytes[i] ^ 0x20);
    write_file(bytes, count);
    sonde_error error = {0};
    sonde_status status = inspect(&error);
    assert_true(status == SONDE_CHECKSUM || status == SONDE_FORMAT || status == SONDE_VERSION);
    assert_int_equal(error.status, status);
    assert_non_null(strstr(error.message, path));
    bytes[i] = (char)(bytes[i] ^ 0x20);
  }
  write_file(bytes, count);
  assert_int_equal(inspect(NULL), SONDE_OK);
  sonde_free(bytes);
}

static void every_cut_is_noticed(void **state) {
  record_scene(*state, 2);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(path, &bytes, &count, NULL), SONDE_OK);
  for (size_t i = 0; i < count; ++i) {
    write_file(bytes, i);
    assert_int_equal(inspect(NULL), SONDE_FORMAT);
  }
  sonde_free(bytes);
  write_file("{\"not\": \"a recording\"}", 22);
  assert_int_equal(inspect(NULL), SONDE_FORMAT);
  write_file("SONDE-RECORDING 99\n{}\n", 22);
  assert_int_equal(inspect(NULL), SONDE_VERSION);
  unlink(path);
  assert_int_equal(inspect(NULL), SONDE_IO);
}

// Ticks without anyone who empties the ring: the loss is told at the end and in the file.
static void a_full_ring_is_reported(void **state) {
  sonde_session_def def = small_def(*state);
  def.record_path = path;
  def.world.sleep_displacement_m = 1e-3; // quick ticks: everything sleeps
  sonde_device device;
  sonde_site site = barrel_site();
  assert_int_equal(sonde_device_null(sonde_site_pose(&site, -0.05), &device, NULL), SONDE_OK);
  sonde_session *session = open_session(&def, device);
  for (int i = 0; i < 9000; ++i) sonde_session_step(session);
  sonde_error error = {0};
  assert_int_equal(sonde_session_destroy(session, &error), SONDE_DISK);
  assert_non_null(strstr(error.message, "too slow"));
  sonde_recording_info info;
  assert_int_equal(sonde_recording_inspect(path, true, &info, NULL), SONDE_OK); // up to the loss
  assert_true(!info.ended && info.ticks > 7000 && info.ticks < 9000);
  assert_int_equal(inspect(&error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "lost"));
}

// It grows under its own name; what was there before gets another one, unless nothing happens.
static void the_file_grows_under_its_name(void **state) {
  record_scene(*state, 5);
  struct stat before, after;
  assert_int_equal(stat(path, &before), 0);
  sonde_session_def def = small_def(*state);
  def.record_path = path;
  close_session(open_session(&def, press_device()));
  assert_int_equal(stat(path, &after), 0);
  assert_true(before.st_ino == after.st_ino); // without a tick the old one is back
  sonde_session *session = open_session(&def, press_device());
  for (int i = 0; i < 300; ++i) sonde_session_tick(session);
  assert_int_equal(stat("exam_record.rec.old", &after), 0);
  assert_true(before.st_ino == after.st_ino && before.st_size == after.st_size);
  sonde_recording_info info;
  assert_int_equal(sonde_recording_inspect(path, false, &info, NULL), SONDE_FORMAT);
  assert_int_equal(sonde_recording_inspect(path, true, &info, NULL), SONDE_OK);
  assert_int_equal(info.ticks, 250); // a block
  close_session(session);
  assert_int_equal(sonde_recording_inspect(path, false, &info, NULL), SONDE_OK);
  assert_int_equal(info.ticks, 300);
  unlink("exam_record.rec.old");
}

// Every member of a record survives the bytes exactly.
static void records_survive_the_file(void **state) {
  const sonde_model *model = *state;
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  const char *name = "linear";
  sonde_record_head head = {.model_path = "a \"quoted\"\npath",
                            .model_name = model->name,
                            .model_checksum = 0xfedcba9876543210u,
                            .world = sonde_world_def_default(),
                            .setup = sonde_setup_default(),
                            .image_width = 64,
                            .image_height = 48,
                            .ticks_per_image = 20,
                            .probe_count = 1,
                            .probes = &probe,
                            .probe_names = &name};
  head.world.dt_s = 1.0 / 3000.0; // needs all its digits
  sonde_recorder *recorder;
  assert_int_equal(sonde_recorder_create(path, &head, &recorder, NULL), SONDE_OK);
  sonde_record controls = {.tag = SONDE_RECORD_CONTROLS};
  controls.controls = small_def(model).controls;
  controls.controls.probe = 0;
  controls.controls.resume = 7;
  controls.controls.echo.gain_db = -1.0 / 7.0;
  sonde_record tick = {.tag = SONDE_RECORD_TICK};
  tick.sample = (sonde_device_sample){{{-0.1, 1e-300, 3}, {0.5, -0.5, 0.5, -0.0}}, 5, true};
  sonde_recorder_write(recorder, &controls);
  sonde_recorder_write(recorder, &tick);
  sonde_recorder_end(recorder, &(sonde_record_end){.hash = 42});
  assert_int_equal(sonde_recorder_sync(recorder, NULL), SONDE_OK);
  sonde_recorder_close(recorder);
  sonde_recording r;
  sonde_record back;
  assert_int_equal(sonde_recording_load(path, false, &r, NULL), SONDE_OK);
  assert_string_equal(r.model_path, head.model_path);
  assert_true(r.model_checksum == head.model_checksum && r.told.hash == 42 && r.told.ticks == 1);
  assert_memory_equal(&r.world.dt_s, &head.world.dt_s, sizeof(double));
  assert_true(sonde_recording_next(&r, &back));
  assert_int_equal(back.controls.resume, 7);
  assert_memory_equal(&back.controls.echo, &controls.controls.echo, sizeof back.controls.echo);
  assert_memory_equal(&back.controls.pathology, &controls.controls.pathology,
                      sizeof back.controls.pathology);
  assert_true(sonde_recording_next(&r, &back));
  assert_memory_equal(&back.sample.world_from_probe, &tick.sample.world_from_probe,
                      sizeof(sonde_pose));
  assert_int_equal(back.sample.buttons, 5);
  assert_true(back.sample.present);
  assert_false(sonde_recording_next(&r, &back));
  sonde_recording_clear(&r);
  sonde_probe_clear(&probe);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(records_survive_the_file),
      cmocka_unit_test(replay_reaches_the_same_state),
      cmocka_unit_test(inspection_names_the_model),
      cmocka_unit_test(another_model_is_refused),
      cmocka_unit_test(another_thigh_gives_another_hash),
      cmocka_unit_test(replay_can_be_cancelled),
      cmocka_unit_test(every_flipped_byte_is_noticed),
      cmocka_unit_test(every_cut_is_noticed),
      cmocka_unit_test(a_full_ring_is_reported),
      cmocka_unit_test(the_file_grows_under_its_name),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
