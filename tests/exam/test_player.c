// Players: the pictures, forces and state of the live session, any moment from anywhere the same as
// played through, with and without keyframes, also of what a killed program left.
#include "exam/player.h"
#include "exam_test.h"
#include "sonde/files_scanner.h"

#include "base/clock.h"

#include <fcntl.h>
#include <sys/stat.h>

static const char path[] = "exam_player.rec";
static const char keys_path[] = "exam_player.rec.keys";
enum { MOST = 400 };

// Hash of each image that a session showed, with its tick and forces.
typedef struct seen {
  uint32_t count, columns; // images; columns of the spectrum in them
  uint64_t tick[MOST], hash[MOST], colour[MOST];
  sonde_snapshot snapshot[MOST];
} seen;

static int set_up(void **state) {
  *state = barrel_model();
  return 0;
}
static int tear_down(void **state) {
  sonde_model_destroy(*state);
  unlink(path);
  unlink(keys_path);
  unlink("exam_player.rec.comments.json");
  return 0;
}

static uint64_t colour_of(const sonde_frame *frame) {
  const sonde_colour_overlay *over = &frame->colour.over;
  const sonde_gate_spectrum *heard = &frame->spectrum;
  if (!frame->colour.shown) return 0;
  const uint64_t hash = sonde_hash(1, over->pixels, (size_t)over->width * over->height);
  return heard->on ? sonde_hash(hash, heard->column, heard->count * sizeof *heard->column) : hash;
}

static void look(sonde_session *session, seen *s) {
  sonde_frame frame;
  if (s->count >= MOST || !sonde_session_frame(session, &frame)) return;
  s->tick[s->count] = frame.snapshot.tick;
  s->snapshot[s->count] = frame.snapshot;
  s->colour[s->count] = colour_of(&frame);
  s->columns += frame.spectrum.on ? frame.spectrum.count : 0;
  s->hash[s->count++] = sonde_hash(0, frame.pixels, (size_t)frame.width * frame.height);
}

// Colour, a gate, a squeeze, another case, another probe, other settings of the beam and back,
// while it runs.
static void change_controls(sonde_session *session, uint64_t tick) {
  sonde_session_controls c = sonde_session_controls_now(session);
  if (tick == 200) c.duplex.shown = SONDE_DUPLEX_VELOCITY;
  if (tick == 330) c.echo.frequency_hz = 5e6, ++c.squeeze;
  if (tick == 500) c.echo.frequency_hz = 7.5e6, c.echo.gain_db = 3;
  if (tick == 610)
    assert_int_equal(sonde_pathology_preset("chronic", &c.pathology, NULL), SONDE_OK);
  if (tick == 800) c.probe = 2;
  if (tick == 700) c.duplex.scale_m_s = 0.1, ++c.deep_breath;
  if (tick == 260) c.duplex.gated = true;
  if (tick == 560) c.duplex.gate.x_m = 2e-3, c.duplex.gate.baseline = 0.25;
  if (tick == 200 || tick == 260 || tick == 330 || tick == 560 || tick == 500 || tick == 610 ||
      tick == 700 || tick == 800)
    sonde_session_control(session, &c);
}

static const sonde_scanner *scanner; // of the recorded session; NULL: the plain one

static void record(const sonde_model *model, uint64_t ticks, seen *s) {
  sonde_session_def def = small_def(model);
  def.scanner = scanner;
  def.record_path = path;
  def.controls.echo.depth_m = 0.05;
  sonde_session *session = open_session(&def, press_device());
  *s = (seen){0};
  for (uint64_t i = 0; i < ticks; ++i) {
    change_controls(session, i);
    sonde_session_tick(session);
    look(session, s);
  }
  close_session(session);
}

static sonde_player *open_player(const sonde_model *model, bool recover, bool no_cache) {
  sonde_player *player = NULL;
  sonde_error error = {0};
  sonde_player_def def = {.path = path, .model = model, .recover = recover, .no_cache = no_cache};
  if (sonde_player_open(&def, &player, &error)) fail_msg("%s", error.message);
  sonde_interior_set_method(player->session->interior, SONDE_INTERIOR_COLUMNS);
  return player;
}

static void same_frame(sonde_player *player, const seen *s, uint32_t i) {
  sonde_frame frame;
  assert_true(sonde_player_frame(player, &frame));
  const sonde_snapshot *a = &frame.snapshot, *b = &s->snapshot[i];
  assert_int_equal(a->tick, s->tick[i]);
  if (sonde_hash(0, frame.pixels, (size_t)frame.width * frame.height) != s->hash[i])
    fail_msg("another picture at tick %u", (unsigned)s->tick[i]);
  assert_memory_equal(&a->force_n, &b->force_n, sizeof a->force_n);
  assert_memory_equal(&a->rendered_force_n, &b->rendered_force_n, sizeof a->rendered_force_n);
  assert_memory_equal(&a->world_from_probe, &b->world_from_probe, sizeof a->world_from_probe);
  assert_memory_equal(&a->vein_area_ratio, &b->vein_area_ratio, sizeof(double));
  assert_memory_equal(&a->penetration_m, &b->penetration_m, sizeof(double));
  assert_true(a->fault == b->fault && a->probe == b->probe && a->awake_nodes == b->awake_nodes);
}

static void played_through_it_shows_the_same(void **state) {
  static seen s;
  record(*state, 1000, &s);
  assert_int_equal(s.count, 50);
  assert_true(s.columns > 20);
  sonde_player *player = open_player(*state, false, true);
  assert_int_equal(sonde_player_info(player)->images, s.count);
  for (uint32_t i = 0; i < s.count; ++i) {
    sonde_frame frame;
    assert_true(sonde_player_next_image(player, true));
    same_frame(player, &s, i);
    assert_true(sonde_player_frame(player, &frame) && colour_of(&frame) == s.colour[i]);
    assert_true((s.colour[i] != 0) == (s.tick[i] > 200));
  }
  assert_false(sonde_player_next_image(player, true));
  sonde_replay_result result;
  assert_int_equal(sonde_player_check(player, true, NULL, &result, NULL), SONDE_OK);
  assert_true(result.same && result.same_images && result.checks == 3);
  assert_true(result.images == 50 && result.different_tick == 0);
  sonde_player_close(player);
}

// Live pictures of a scanner hold looks of those before: played through they are the same. After a
// seek the next picture has all looks at once, wherever the player was before.
static void a_scanner_is_played_again(void **state) {
  static seen s;
  sonde_scanner three = sonde_scanner_plain();
  three.looks = 3, three.look_rad = 0.15, three.persistence = 0.4, three.filter = 0.3;
  scanner = &three;
  record(*state, 600, &s);
  scanner = NULL;
  sonde_player *player = open_player(*state, false, true);
  for (uint32_t i = 0; i < s.count; ++i) {
    assert_true(sonde_player_next_image(player, true));
    same_frame(player, &s, i);
  }
  sonde_replay_result result;
  assert_int_equal(sonde_player_check(player, true, NULL, &result, NULL), SONDE_OK);
  assert_true(result.same && result.same_images && result.images == s.count);
  uint64_t hash[2];
  for (int k = 0; k < 2; ++k) {
    sonde_frame frame;
    assert_int_equal(sonde_player_seek(player, k ? 0.58 : 0.1, NULL, NULL), SONDE_OK);
    assert_int_equal(sonde_player_seek(player, 0.4, NULL, NULL), SONDE_OK);
    assert_true(sonde_player_frame(player, &frame));
    hash[k] = sonde_hash(0, frame.pixels, (size_t)frame.width * frame.height);
  }
  assert_true(hash[0] == hash[1]);
  sonde_player_close(player);
}

static uint64_t next_random(uint64_t *x) { return *x = *x * 6364136223846793005u + 1; }

// Any order of moments: what a player shows does not depend on where it was before.
static void seek_everywhere(sonde_player *player, const seen *s, uint64_t ticks) {
  uint64_t x = 7;
  for (int k = 0; k < 24; ++k) {
    uint64_t goal = next_random(&x) >> 33;
    goal = k == 0 ? ticks : k == 1 ? 0 : goal % (ticks + 1);
    assert_int_equal(sonde_player_seek(player, 1e-3 * (double)goal, NULL, NULL), SONDE_OK);
    assert_int_equal(sonde_player_tick(player), goal);
    uint32_t i = 0;
    while (i < s->count && s->tick[i] <= goal) ++i;
    sonde_frame frame;
    if (i == 0)
      assert_false(sonde_player_frame(player, &frame));
    else if (k % 3)
      same_frame(player, s, i - 1);
    if (k % 5 == 4 && i < s->count) {
      assert_true(sonde_player_next_image(player, true));
      same_frame(player, s, i);
    }
  }
}

static void any_moment_is_that_of_playing_through(void **state) {
  static seen s;
  record(*state, 1200, &s);
  struct stat info;
  assert_int_equal(stat(keys_path, &info), 0);
  sonde_player *player = open_player(*state, false, false);
  assert_int_equal(player->keyframes.count, 3);
  seek_everywhere(player, &s, 1200);
  uint64_t hash = player->recording.told.hash;
  assert_int_equal(sonde_player_seek(player, 9, NULL, NULL), SONDE_OK);
  assert_true(sonde_player_hash(player) == hash);
  sonde_player_close(player);
}

// Deleted, damaged or foreign keyframes: they are made again, or passed over.
static void keyframes_are_a_cache(void **state) {
  static seen s;
  record(*state, 1200, &s);
  char *bytes, *again;
  size_t count, other;
  assert_int_equal(sonde_file_load(keys_path, &bytes, &count, NULL), SONDE_OK);
  unlink(keys_path);
  sonde_player *player = open_player(*state, false, false);
  assert_int_equal(player->keyframes.count, 0);
  seek_everywhere(player, &s, 1200);
  assert_int_equal(player->keyframes.count, 3);
  sonde_player_close(player);
  assert_int_equal(sonde_file_load(keys_path, &again, &other, NULL), SONDE_OK);
  assert_in_range(other, count - 64, count + 64); // bytes between members pack differently
  count = other;
  uint64_t x = 3;
  for (int k = 0; k < 5; ++k) {
    size_t at = (next_random(&x) >> 20) % count;
    if (k == 0) at = count - 10; // the recording's CRC
    again[at] = (char)(again[at] ^ 0x11);
    FILE *file = fopen(keys_path, "wb");
    fwrite(again, 1, k % 4 == 3 ? count / 2 : count, file);
    fclose(file);
    again[at] = (char)(again[at] ^ 0x11);
    player = open_player(*state, false, false);
    player->no_cache = true;
    assert_int_equal(sonde_player_seek(player, 1.17, NULL, NULL), SONDE_OK);
    same_frame(player, &s, 57);
    sonde_player_close(player);
  }
  sonde_free(bytes);
  sonde_free(again);
}

// In real time the images come when they come; the recording says when.
static void a_realtime_session_shows_the_same_again(void **state) {
  static seen s;
  s = (seen){0};
  sonde_session_def def = small_def(*state);
  def.record_path = path;
  sonde_session *session = open_session(&def, press_device());
  assert_int_equal(sonde_session_start(session, NULL), SONDE_OK);
  bool changed = false;
  while (sonde_session_ticks(session) < 1100 || s.count < 5) {
    look(session, &s);
    if (!changed && sonde_session_ticks(session) > 300) {
      sonde_session_controls c = sonde_session_controls_now(session);
      c.echo.focus_m = 0.03;
      sonde_session_control(session, &c);
      changed = true;
    }
    sonde_clock_sleep_until(sonde_clock_now() + 1e-3);
  }
  sonde_session_stop(session);
  look(session, &s);
  uint64_t images = sonde_session_images(session);
  close_session(session);
  sonde_player *player = open_player(*state, false, false);
  assert_int_equal(sonde_player_info(player)->images, images);
  sonde_replay_result result;
  assert_int_equal(sonde_player_check(player, true, NULL, &result, NULL), SONDE_OK);
  assert_true(result.same && result.same_images);
  for (uint32_t i = s.count; i-- > 0;) { // backwards
    assert_int_equal(sonde_player_seek(player, 1e-3 * (double)s.tick[i], NULL, NULL), SONDE_OK);
    same_frame(player, &s, i);
  }
  sonde_player_close(player);
}

// The gate can close: one pixel's worth of another setting is noticed, and where.
static void another_picture_is_noticed(void **state) {
  static seen s;
  record(*state, 700, &s);
  sonde_player *player = open_player(*state, false, true);
  player->start_inputs.controls.echo.gain_db += 0.5;
  sonde_replay_result result;
  assert_int_equal(sonde_player_check(player, true, NULL, &result, NULL), SONDE_OK);
  assert_true(result.same && !result.same_images);
  assert_int_equal(result.different_tick, 20);
  sonde_player_close(player);
}

static void write_file(const char *bytes, size_t count) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, count, file), count);
  fclose(file);
}

// Cut anywhere: all whole blocks are there, never more than one block and a record are lost.
static void every_cut_loses_at_most_a_block(void **state) {
  static seen s;
  record(*state, 520, &s);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(path, &bytes, &count, NULL), SONDE_OK);
  sonde_recording r;
  assert_int_equal(sonde_recording_load(path, false, &r, NULL), SONDE_OK);
  size_t start = r.start;
  sonde_recording_clear(&r);
  size_t most = 250 * SONDE_RECORD_TICK_BYTES + 4096;
  uint64_t last = 0;
  for (size_t cut = 0; cut <= count; cut += cut < start || cut > count - 200 ? 1 : 101) {
    write_file(bytes, cut);
    sonde_error error = {0};
    sonde_recording_info info;
    sonde_status status = sonde_recording_inspect(path, true, &info, &error);
    if (status) {
      assert_int_equal(status, SONDE_FORMAT);
      assert_true(cut < start + most);
      continue;
    }
    assert_true(info.ticks >= last && info.ticks % 250 == (cut == count ? 20 : 0));
    assert_true(cut - start < (info.ticks + 250) * SONDE_RECORD_TICK_BYTES + 4096);
    assert_true(info.ended == (cut == count));
    last = info.ticks;
  }
  assert_int_equal(last, 520);
  write_file(bytes, count - 30);
  sonde_player *player = open_player(*state, true, true);
  assert_int_equal(sonde_player_info(player)->ticks, 500);
  assert_int_equal(sonde_player_seek(player, 0.5, NULL, NULL), SONDE_OK);
  same_frame(player, &s, 23); // the one of tick 500 came behind the block
  sonde_replay_result result;
  assert_int_equal(sonde_player_check(player, true, NULL, &result, NULL), SONDE_OK);
  assert_true(result.same && result.same_images && result.ticks == 500 && result.checks == 2);
  sonde_player_close(player);
  sonde_free(bytes);
}

// Any byte changed: refused, or played without harm.
static void damaged_files_are_survived(void **state) {
  static seen s;
  record(*state, 260, &s);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(path, &bytes, &count, NULL), SONDE_OK);
  uint64_t x = 11;
  for (int k = 0; k < 700; ++k) {
    size_t at = (next_random(&x) >> 20) % (k % 2 ? count : 1500);
    char was = bytes[at];
    bytes[at] = (char)(next_random(&x) >> 40);
    write_file(bytes, count);
    sonde_recording r;
    sonde_error error = {0};
    sonde_status status = sonde_recording_load(path, true, &r, &error);
    if (!status) {
      sonde_record next;
      while (sonde_recording_next(&r, &next)) assert_true(next.tick <= 260);
      sonde_recording_clear(&r);
    }
    bytes[at] = was;
  }
  sonde_free(bytes);
}

// What is on the disk while the session runs is what a kill would leave.
static void a_killed_session_is_recovered(void **state) {
  sonde_session_def def = small_def(*state);
  def.record_path = "exam_killed.rec";
  sonde_session *session = open_session(&def, press_device());
  for (int i = 0; i < 1101; ++i) sonde_session_tick(session);
  char command[256];
  snprintf(command, sizeof command, "cp exam_killed.rec %s", path);
  assert_int_equal(system(command), 0);
  close_session(session);
  unlink("exam_killed.rec");
  unlink("exam_killed.rec.keys");
  assert_int_equal(sonde_recording_inspect(path, false, &(sonde_recording_info){0}, NULL),
                   SONDE_FORMAT);
  sonde_player *player = open_player(*state, true, true);
  assert_true(sonde_player_info(player)->ticks >= 850);
  sonde_replay_result result;
  assert_int_equal(sonde_player_check(player, true, NULL, &result, NULL), SONDE_OK);
  assert_true(result.same && result.same_images && result.checks > 0);
  sonde_player_close(player);
}

static void the_controls_are_told(void **state) {
  static seen s;
  record(*state, 900, &s);
  sonde_player *player = open_player(*state, false, true);
  const sonde_player_event *events = player->events;
  assert_int_equal(player->event_count, 9);
  assert_true(events[0].time_s == 0 && fabs(events[6].time_s - 0.61) < 1e-9);
  assert_true(events[6].controls.pathology.thrombus_fraction == 1);
  assert_int_equal(sonde_player_seek(player, 0.4, NULL, NULL), SONDE_OK);
  assert_true(sonde_player_controls(player).echo.frequency_hz == 5e6);
  assert_int_equal(sonde_player_seek(player, 0.85, NULL, NULL), SONDE_OK);
  assert_int_equal(sonde_player_controls(player).probe, 2);
  sonde_player_close(player);
}

static void comments_are_kept_in_order(void **state) {
  (void)state;
  sonde_comments list;
  assert_int_equal(sonde_comments_load(path, &list, NULL), SONDE_OK);
  assert_int_equal(list.count, 0);
  sonde_comments_clear(&list);
  const sonde_comment a = {2.5, "T. \"Lehrer\"", "druckt zu fr\xc3\xbch\nhier"}, b = {1, "", "x"};
  assert_int_equal(sonde_comments_add(path, &a, NULL), SONDE_OK);
  assert_int_equal(sonde_comments_add(path, &b, NULL), SONDE_OK);
  assert_int_equal(sonde_comments_load(path, &list, NULL), SONDE_OK);
  assert_int_equal(list.count, 2);
  assert_string_equal(list.list[0].text, "x");
  assert_string_equal(list.list[1].text, a.text);
  assert_string_equal(list.list[1].author, a.author);
  sonde_comments_clear(&list);
  const sonde_comment bad[] = {{-1, "", "x"},    {(double)NAN, "", "x"}, {0, "", ""},
                               {0, "", "\xc3("}, {0, "", "\xc0\xaf"},    {0, "\x1b[2J", "x"}};
  for (size_t k = 0; k < SONDE_COUNT_OF(bad); ++k)
    assert_int_equal(sonde_comments_add(path, &bad[k], NULL), SONDE_ARGUMENT);
  FILE *file = fopen("exam_player.rec.comments.json", "w");
  fputs("{\"comments\":[{\"time_s\":1,\"author\":\"\",\"text\":\"ok\"},{\"time_s\":\"1\"}]}", file);
  fclose(file);
  sonde_error error;
  assert_int_equal(sonde_comments_load(path, &list, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "comment 1"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(played_through_it_shows_the_same),
      cmocka_unit_test(a_scanner_is_played_again),
      cmocka_unit_test(any_moment_is_that_of_playing_through),
      cmocka_unit_test(keyframes_are_a_cache),
      cmocka_unit_test(a_realtime_session_shows_the_same_again),
      cmocka_unit_test(another_picture_is_noticed),
      cmocka_unit_test(every_cut_loses_at_most_a_block),
      cmocka_unit_test(damaged_files_are_survived),
      cmocka_unit_test(a_killed_session_is_recovered),
      cmocka_unit_test(the_controls_are_told),
      cmocka_unit_test(comments_are_kept_in_order),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
