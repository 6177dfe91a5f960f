// The journal of an exam under a disk that fails and a program that dies: at every single call that
// changes the disk. What was acknowledged is never lost.
#include "../sanitized.h"
#include "exam_test.h"

#include "base/disk.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>

static const char path[] = "exam_journal.rec";
enum { TICKS = 300, NOTES = 5 }; // setup, three decisions, score

typedef enum fault_kind { FAULT_NONE, FAULT_KILL, FAULT_ONCE, FAULT_LASTING } fault_kind;

typedef struct fault_plan {
  fault_kind kind;
  int calls, at, failure;
  bool over;
} fault_plan;

// Shared with a child that is killed: what it was told to be on the disk.
typedef struct told {
  int calls;
  uint32_t notes;
  bool commented;
} told;

static told *shared;

static int set_up(void **state) {
  *state = barrel_model();
  shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  return shared == MAP_FAILED ? -1 : 0;
}

static void clean(void) {
  unlink(path);
  unlink("exam_journal.rec.old");
  if (system("rm -f exam_journal.rec.keys*") != 0) fail();
}

static int tear_down(void **state) {
  sonde_model_destroy(*state);
  clean();
  return 0;
}

// A write that is to kill brings half of its bytes to the file; the next call ends the program.
static int strike(sonde_disk_call call, const char *name, size_t *bytes, void *user) {
  (void)name;
  fault_plan *plan = user;
  int number = plan->calls++;
  shared->calls = plan->calls;
  *bytes /= 2;
  if (plan->over || number < plan->at) return 0;
  if (plan->kind == FAULT_LASTING && call != SONDE_DISK_CLOSE && call != SONDE_DISK_REMOVE)
    return plan->failure;
  if (plan->kind == FAULT_NONE) return 0;
  if (plan->kind != FAULT_KILL) return number > plan->at ? 0 : plan->failure;
  if (number > plan->at || call != SONDE_DISK_WRITE) raise(SIGKILL);
  return plan->failure;
}

static sonde_session *begin(const sonde_model *model, sonde_error *error) {
  sonde_session_def def = small_def(model);
  sonde_session *session = NULL;
  sonde_device device;
  sonde_site site = barrel_site();
  def.record_path = path;
  def.record_setup = "{\"exam\":\"of the test\"}";
  def.ticks_per_image = 100;
  def.world.sleep_displacement_m = 1e-3; // quick ticks: everything sleeps
  assert_int_equal(sonde_device_null(sonde_site_pose(&site, -0.05), &device, NULL), SONDE_OK);
  sonde_status status = sonde_session_create(&def, &device, &session, error);
  if (device.destroy) device.destroy(device.self);
  if (!status) sonde_interior_set_method(session->interior, SONDE_INTERIOR_COLUMNS);
  return session;
}

static void go_on(sonde_session *session) {
  shared->notes = sonde_session_recording(session).notes;
  for (int i = 0; i < TICKS; ++i) {
    char text[32];
    snprintf(text, sizeof text, "{\"n\":%d}", i);
    if (i % 100 == 40)
      assert_int_equal(sonde_session_note(session, SONDE_NOTE_DECISION, (uint64_t)i, text, NULL),
                       SONDE_OK);
    sonde_session_tick(session);
    shared->notes = sonde_session_recording(session).notes;
  }
  assert_int_equal(sonde_session_note(session, SONDE_NOTE_SCORE, TICKS, "{\"score\":1}", NULL),
                   SONDE_OK);
}

static sonde_status finish(sonde_session *session) {
  sonde_status status = sonde_session_finish(session, NULL);
  if (!status) shared->notes = NOTES;
  return status;
}

static const sonde_comment COMMENT = {0.1, "teacher", "good"};

static void whole_exam(const sonde_model *model) {
  sonde_error error;
  sonde_session *session = begin(model, &error);
  if (!session) return;
  go_on(session);
  (void)finish(session);
  sonde_session_destroy(session, NULL);
  shared->commented = sonde_comments_add(path, &COMMENT, NULL) == SONDE_OK;
}

// Everything that was acknowledged is there, in order, with all inputs before it.
static void expect_told(const told *t) {
  sonde_notes notes;
  sonde_error error = {0};
  if (t->notes == 0) return; // the exam had not begun
  if (sonde_notes_load(path, &notes, &error)) fail_msg("%s", error.message);
  assert_true(notes.count >= t->notes + (t->commented ? 1 : 0));
  assert_int_equal(notes.list[0].kind, SONDE_NOTE_SETUP);
  assert_string_equal(notes.list[0].text, "{\"exam\":\"of the test\"}");
  for (uint32_t k = 1; k < notes.count && k < 4; ++k) {
    char text[32];
    snprintf(text, sizeof text, "{\"n\":%u}", 100 * k - 60);
    assert_string_equal(notes.list[k].text, text);
  }
  sonde_recording_info info;
  assert_int_equal(sonde_recording_inspect(path, true, &info, NULL), SONDE_OK);
  if (t->notes > 1) assert_true(info.ticks >= notes.list[t->notes < 5 ? t->notes - 1 : 3].tick);
  if (t->notes == NOTES) assert_true(info.ended && info.ticks == TICKS);
  sonde_notes_clear(&notes);
}

static int count_calls(const sonde_model *model) {
  fault_plan plan = {FAULT_NONE, .at = 1 << 30};
  clean();
  *shared = (told){0};
  sonde_disk_set_fault(strike, &plan);
  whole_exam(model);
  sonde_disk_set_fault(NULL, NULL);
  expect_told(shared);
  assert_true(shared->notes == NOTES && shared->commented);
  return plan.calls;
}

// A write is torn: half of its bytes are in the file.
static void killed_at_every_call_nothing_is_lost(void **state) {
  int calls = count_calls(*state);
  assert_true(calls >= 20);
  for (int k = 0; k < calls; k += k + 3 < calls ? SAMPLES(1, 3) : 1) {
    clean();
    *shared = (told){0};
    fflush(NULL);
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
      fault_plan plan = {FAULT_KILL, .at = k, .failure = EIO};
      sonde_disk_set_fault(strike, &plan);
      whole_exam(*state);
      _exit(0);
    }
    int code = 0;
    waitpid(child, &code, 0);
    bool last = k == calls - 1; // a torn write and nothing after it
    assert_true((WIFSIGNALED(code) && WTERMSIG(code) == SIGKILL) || last);
    expect_told(shared);
  }
  print_message("killed at each of %d calls, exams lost: 0\n", calls);
}

// The disk is full from some call on until room is made at the end, or one call fails; a sync that
// fails may have dropped what the system had taken, which is then written again.
static void full_disk_loses_nothing_that_was_told(void **state) {
  int calls = count_calls(*state), refused = 0;
  struct stat right, got;
  assert_int_equal(stat(path, &right), 0);
  for (int k = 0; k < 2 * calls; k += SAMPLES(1, 3)) {
    clean();
    *shared = (told){0};
    bool once = k % 2;
    fault_plan plan = {once ? FAULT_ONCE : FAULT_LASTING, .at = k / 2};
    plan.failure = once ? EIO : ENOSPC;
    sonde_disk_set_fault(strike, &plan);
    sonde_error error = {0};
    sonde_session *session = begin(*state, &error);
    if (!session) { // told at once, before the exam
      assert_int_equal(error.status, SONDE_DISK);
      assert_non_null(strstr(error.message, "cannot be written"));
      ++refused;
    } else {
      go_on(session);
      sonde_recording_state trouble = sonde_session_recording(session);
      if (trouble.in_trouble && !once)
        assert_string_equal(trouble.reason, "No space left on device");
      sonde_status status = finish(session);
      if (status) assert_int_equal(status, SONDE_DISK);
      if (status) expect_told(shared); // as if the program died with the disk full
      plan.over = true;
      assert_int_equal(finish(session), SONDE_OK);
      close_session(session);
      shared->commented = sonde_comments_add(path, &COMMENT, NULL) == SONDE_OK;
      assert_true(shared->commented);
      assert_int_equal(stat(path, &got), 0); // a block more or less may close off the records
      assert_true(labs((long)got.st_size - (long)right.st_size) <= 64);
    }
    sonde_disk_set_fault(NULL, NULL);
    expect_told(shared);
  }
  assert_true(refused > 0 && refused < calls);
  print_message("full or failing disk at each of %d calls, %d exams refused at the start, exams "
                "lost: 0\n",
                calls, refused);
}

// More than memory may hold: inputs end, what is small is kept, and the loss is told.
static void lasting_trouble_is_bounded_and_told(void **state) {
  const sonde_model *model = *state;
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  const char *name = "linear";
  sonde_record_head head = {.model_name = model->name,
                            .world = sonde_world_def_default(),
                            .setup = sonde_setup_default(),
                            .ticks_per_image = 20,
                            .probe_count = 1,
                            .probes = &probe,
                            .probe_names = &name};
  sonde_recorder *recorder;
  clean();
  assert_int_equal(sonde_recorder_create(path, &head, &recorder, NULL), SONDE_OK);
  sonde_record record = {.tag = SONDE_RECORD_CONTROLS};
  record.controls = small_def(model).controls;
  record.controls.probe = 0;
  sonde_recorder_write(recorder, &record);
  fault_plan plan = {FAULT_LASTING, .failure = ENOSPC};
  sonde_disk_set_fault(strike, &plan);
  record = (sonde_record){.tag = SONDE_RECORD_TICK};
  record.sample.world_from_probe.rotation.w = 1;
  for (; record.tick < 450000; ++record.tick) sonde_recorder_write(recorder, &record);
  sonde_recorder_note(recorder, SONDE_NOTE_DECISION, 0, "{}");
  assert_true(sonde_recorder_look(recorder).lost > 0);
  assert_int_equal(sonde_recorder_look(recorder).trouble, ENOSPC);
  sonde_disk_set_fault(NULL, NULL);
  sonde_recorder_end(recorder, &(sonde_record_end){.hash = 1});
  assert_int_equal(sonde_recorder_sync(recorder, NULL), SONDE_OK);
  sonde_recorder_close(recorder);
  sonde_recording_info info;
  sonde_error error;
  assert_int_equal(sonde_recording_inspect(path, false, &info, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "lost"));
  assert_int_equal(sonde_recording_inspect(path, true, &info, NULL), SONDE_OK);
  assert_true(info.ticks > 400000 && info.ticks < 450000 && !info.ended);
  sonde_notes notes;
  assert_int_equal(sonde_notes_load(path, &notes, NULL), SONDE_OK);
  assert_int_equal(notes.count, 1);
  sonde_notes_clear(&notes);
  sonde_probe_clear(&probe);
}

// Any cut and any flipped byte: a prefix of the notes is read, or a sentence says why not.
static void any_damage_leaves_a_prefix(void **state) {
  clean();
  *shared = (told){0};
  whole_exam(*state);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(path, &bytes, &count, NULL), SONDE_OK);
  for (size_t at = count; at > 0; at -= at > 97 ? 97 : at) {
    sonde_notes notes;
    sonde_error error = {0};
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, at, file), at);
    fclose(file);
    sonde_status status = sonde_notes_load(path, &notes, &error);
    if (status) {
      assert_true(at < 4000 && error.message[0]);
    } else {
      shared->notes = notes.count < NOTES ? notes.count : NOTES;
      shared->commented = false;
      if (notes.count < NOTES) expect_told(shared);
      sonde_notes_clear(&notes);
    }
  }
  sonde_free(bytes);
}

// One writer at a time; a recording from before the journal keeps its comments beside it.
static void who_may_add_notes(void **state) {
  sonde_error error;
  clean();
  sonde_session *session = begin(*state, &error);
  assert_non_null(session);
  sonde_session_tick(session);
  assert_true(sonde_recording_is_open(path));
  assert_int_equal(sonde_comments_add(path, &COMMENT, &error), SONDE_DEVICE);
  assert_non_null(strstr(error.message, "is being recorded"));
  close_session(session);
  assert_false(sonde_recording_is_open(path));
  assert_int_equal(sonde_comments_add(path, &COMMENT, NULL), SONDE_OK);
  const char *const old[] = {"version_3.rec", "version_7.rec"};
  for (size_t k = 0; k < SONDE_COUNT_OF(old); ++k) {
    char from[512];
    sonde_recording_info info;
    sonde_comments comments;
    snprintf(from, sizeof from, "cp %s/tests/exam/old/%s %s", SONDE_SOURCE_DIR, old[k], path);
    assert_int_equal(system(from), 0);
    assert_int_equal(sonde_recording_inspect(path, false, &info, NULL), SONDE_OK);
    assert_int_equal(info.version, old[k][8] - '0');
    assert_int_equal(sonde_notes_add(path, SONDE_NOTE_COMMENT, "{}", NULL), SONDE_VERSION);
    assert_int_equal(sonde_comments_add(path, &COMMENT, NULL), SONDE_OK);
    assert_int_equal(sonde_comments_load(path, &comments, NULL), SONDE_OK);
    assert_int_equal(comments.count, 1);
    sonde_comments_clear(&comments);
    unlink("exam_journal.rec.comments.json");
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(killed_at_every_call_nothing_is_lost),
      cmocka_unit_test(full_disk_loses_nothing_that_was_told),
      cmocka_unit_test(lasting_trouble_is_bounded_and_told),
      cmocka_unit_test(any_damage_leaves_a_prefix),
      cmocka_unit_test(who_may_add_notes),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
