// The log of exams: what goes in comes out, several programs at once lose nothing, a file that is
// not a log is refused and stays as it is, counts and curves agree with the entries.
#include "fixture.h"
#include "sonde/trainer_log.h"

#include <fcntl.h>
#include <signal.h>
#include <sqlite3.h>
#include <stdio.h>
#include <sys/wait.h>
#include <unistd.h>

enum { WRITERS = 4, EACH = 12 };
static char path[64];

static int fresh_path(void **state) {
  (void)state;
  snprintf(path, sizeof path, "log_%d.sqlite", (int)getpid());
  unlink(path);
  return 0;
}

static int remove_path(void **state) {
  (void)state;
  unlink(path);
  return 0;
}

static sonde_exam_log *opened(void) {
  sonde_exam_log *log = NULL;
  sonde_error error = {0};
  if (sonde_exam_log_open(path, &log, &error)) fail_msg("%s", error.message);
  return log;
}

// Every member has a value of its own, so that columns cannot be mixed up unseen.
static sonde_log_entry entry_of(const char *id, const char *trainee, uint32_t n) {
  sonde_log_entry e = {.score = 40 + n % 60, .passed = true, .answered = true, .correct = true};
  snprintf(e.id, sizeof e.id, "%s", id);
  snprintf(e.trainee, sizeof e.trainee, "%s", trainee);
  snprintf(e.case_id, sizeof e.case_id, "case-%u", n % 3);
  snprintf(e.case_title, sizeof e.case_title, "Case \u00e9 %u", n);
  snprintf(e.protocol, sizeof e.protocol, "three-point");
  snprintf(e.guidance, sizeof e.guidance, "full");
  snprintf(e.recording, sizeof e.recording, "/tmp/%s.rec", id);
  sonde_log_date(1700000000 + 60 * (int64_t)n, e.date);
  sonde_metrics *m = &e.metrics;
  double *reals[] = {&m->coverage,    &m->vein_coverage, &m->gap_m,       &m->completeness,
                     &m->valid_share, &m->force_peak_n,  &m->force_p95_n, &m->time_s,
                     &m->contact_s,   &m->path_m,        &m->smoothness};
  for (uint32_t i = 0; i < sizeof reals / sizeof reals[0]; ++i) *reals[i] = 0.1 + i + n / 7.0;
  for (uint32_t i = 0; i < SONDE_PRESS_RESULTS; ++i) m->presses[i] = 10 * i + n;
  m->points = 101 + n;
  m->points_done = 202 + n;
  m->press_count = 303 + n;
  m->hints = 404 + n;
  return e;
}

static void add(sonde_exam_log *log, const sonde_log_entry *e) {
  sonde_error error = {0};
  if (sonde_exam_log_add(log, e, &error)) fail_msg("%s", error.message);
}

static void assert_same(const sonde_log_entry *a, const sonde_log_entry *b) {
  assert_string_equal(a->id, b->id);
  assert_string_equal(a->trainee, b->trainee);
  assert_string_equal(a->case_id, b->case_id);
  assert_string_equal(a->case_title, b->case_title);
  assert_string_equal(a->protocol, b->protocol);
  assert_string_equal(a->guidance, b->guidance);
  assert_string_equal(a->date, b->date);
  assert_string_equal(a->recording, b->recording);
  assert_true(a->score == b->score);
  assert_true(a->passed == b->passed && a->correct == b->correct && a->answered == b->answered);
  assert_true(a->called_thrombosis == b->called_thrombosis && a->thrombosis == b->thrombosis);
  assert_true(a->interrupted == b->interrupted);
  assert_memory_equal(&a->metrics, &b->metrics, sizeof a->metrics);
}

static uint32_t rows_of(sonde_exam_log *log, const char *trainee) {
  sonde_log_entry *entries = NULL;
  uint32_t count = 0;
  assert_int_equal(sonde_exam_log_list(log, trainee, 0, &entries, &count, NULL), SONDE_OK);
  sonde_free(entries);
  return count;
}

// ---- what goes in comes out -------------------------------------------------------------------

static void entries_come_back(void **state) {
  (void)state;
  sonde_exam_log *log = opened();
  sonde_log_entry in[3] = {entry_of("a", "Ann", 2), entry_of("b", "B'; DROP TABLE exams; --", 9),
                           entry_of("c", "Ann", 5)};
  in[1].interrupted = in[1].thrombosis = in[1].called_thrombosis = true;
  in[1].passed = in[1].correct = in[1].answered = false;
  for (int i = 0; i < 3; ++i) add(log, &in[i]);
  sonde_exam_log_close(log);
  log = opened();
  sonde_log_entry *out = NULL;
  uint32_t count = 0;
  assert_int_equal(sonde_exam_log_list(log, NULL, 0, &out, &count, NULL), SONDE_OK);
  assert_int_equal(count, 3);
  static const int newest_first[3] = {1, 2, 0};
  for (int i = 0; i < 3; ++i) assert_same(&out[i], &in[newest_first[i]]);
  sonde_free(out);
  assert_int_equal(sonde_exam_log_list(log, "Ann", 1, &out, &count, NULL), SONDE_OK);
  assert_int_equal(count, 1);
  assert_same(&out[0], &in[2]);
  sonde_free(out);
  assert_int_equal(sonde_exam_log_list(log, "nobody", 0, &out, &count, NULL), SONDE_OK);
  assert_true(count == 0 && out == NULL);
  assert_int_equal(rows_of(log, in[1].trainee), 1);
  sonde_exam_log_close(log);
}

static void what_was_not_measured_stays_so(void **state) {
  (void)state;
  sonde_exam_log *log = opened();
  sonde_log_entry e = entry_of("nan", "Ann", 1), *out = NULL;
  uint32_t count = 0;
  e.metrics.completeness = NAN;
  e.metrics.force_p95_n = NAN;
  add(log, &e);
  assert_int_equal(sonde_exam_log_list(log, NULL, 0, &out, &count, NULL), SONDE_OK);
  assert_true(isnan(out[0].metrics.completeness) && isnan(out[0].metrics.force_p95_n));
  assert_true(out[0].metrics.coverage == e.metrics.coverage);
  sonde_free(out);
  sonde_exam_log_close(log);
}

// As a journal keeps an entry; and the log says whether it has one.
static void entries_survive_as_text(void **state) {
  (void)state;
  sonde_exam_log *log = opened();
  bool found = true;
  sonde_log_entry in = entry_of("text", "Ann \"\xc3\xa9\"\n", 7), out;
  in.metrics.smoothness = (double)NAN;
  in.score = 100.0 / 3.0;
  char *text = NULL;
  assert_int_equal(sonde_log_entry_text(&in, &text, NULL), SONDE_OK);
  assert_int_equal(sonde_log_entry_parse(text, &out, NULL), SONDE_OK);
  sonde_free(text);
  assert_true(isnan(out.metrics.smoothness) && out.score == in.score);
  out.metrics.smoothness = in.metrics.smoothness = 0;
  assert_same(&in, &out);
  assert_int_equal(sonde_exam_log_has(log, "text", &found, NULL), SONDE_OK);
  assert_false(found);
  add(log, &out);
  assert_int_equal(sonde_exam_log_has(log, "text", &found, NULL), SONDE_OK);
  assert_true(found);
  const char *const bad[] = {"", "[]", "{}", "{\"id\":\"x\"}"};
  for (size_t k = 0; k < SONDE_COUNT_OF(bad); ++k)
    assert_int_equal(sonde_log_entry_parse(bad[k], &out, NULL), SONDE_FORMAT);
  sonde_exam_log_close(log);
}

static void wrong_entries_are_refused(void **state) {
  (void)state;
  sonde_exam_log *log = opened();
  sonde_log_entry good = entry_of("once", "Ann", 1), bad[6];
  for (int i = 0; i < 6; ++i) bad[i] = entry_of("other", "Ann", 1);
  bad[0].id[0] = bad[1].trainee[0] = bad[2].case_id[0] = 0;
  bad[3].score = NAN;
  bad[4].score = 100.5;
  snprintf(bad[5].date, sizeof bad[5].date, "2026-11-22 04:40:00");
  add(log, &good);
  sonde_error error = {0};
  assert_int_equal(sonde_exam_log_add(log, &good, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "'once' is in the log already"));
  for (int i = 0; i < 6; ++i)
    assert_int_equal(sonde_exam_log_add(log, &bad[i], NULL), SONDE_ARGUMENT);
  assert_int_equal(rows_of(log, NULL), 1);
  sonde_exam_log_close(log);
}

static void texts_are_cut_between_characters(void **state) {
  (void)state;
  char longer[400];
  for (size_t i = 0; i + 2 < sizeof longer; i += 2) memcpy(longer + i, "\u00e9", 3);
  sonde_case patient = {.id = "x"};
  sonde_score score = {.score = 50};
  sonde_score_note note = {.exam = "e", .trainee = longer};
  sonde_log_entry e = sonde_log_entry_make(&patient, &score, &note);
  size_t length = strlen(e.trainee);
  assert_true(length >= sizeof e.trainee - 2 && length % 2 == 0);
  assert_memory_equal(e.trainee, longer, length);
  assert_string_equal(e.protocol, "");
  assert_int_equal(strlen(e.date), 20); // now
}

static void dates_are_universal_time(void **state) {
  (void)state;
  char date[24];
  sonde_log_date(0, date);
  assert_string_equal(date, "1970-01-01T00:00:00Z");
  sonde_log_date(951827696, date); // a leap day
  assert_string_equal(date, "2000-02-29T12:34:56Z");
}

// ---- several programs ---------------------------------------------------------------------------

// Waits until all are there, so that they meet.
static void writer(uint32_t who, uint32_t each, const int gate[2]) {
  sonde_exam_log *log = NULL;
  char byte;
  close(gate[1]);
  if (read(gate[0], &byte, 1) != 0) _exit(3);
  if (sonde_exam_log_open(path, &log, NULL)) _exit(1);
  for (uint32_t i = 0; i < each; ++i) {
    char id[32];
    snprintf(id, sizeof id, "%u-%u", who, i);
    sonde_log_entry e = entry_of(id, who % 2 ? "odd" : "even", i);
    if (sonde_exam_log_add(log, &e, NULL)) _exit(2);
  }
  sonde_exam_log_close(log);
  _exit(0);
}

static void write_together(uint32_t each) {
  pid_t child[WRITERS];
  int gate[2];
  assert_int_equal(pipe(gate), 0);
  for (uint32_t i = 0; i < WRITERS; ++i)
    if ((child[i] = fork()) == 0) writer(i, each, gate);
  close(gate[0]);
  close(gate[1]);
  for (uint32_t i = 0; i < WRITERS; ++i) {
    int status = -1;
    assert_int_equal(waitpid(child[i], &status, 0), child[i]);
    assert_int_equal(status, 0);
  }
  sonde_exam_log *log = opened();
  assert_int_equal(rows_of(log, NULL), WRITERS * each);
  assert_int_equal(rows_of(log, "odd"), WRITERS * each / 2);
  sonde_exam_log_close(log);
}

static void several_programs_lose_nothing(void **state) {
  (void)state;
  write_together(EACH);
}

static void several_programs_make_one_log(void **state) {
  (void)state;
  for (int round = 0; round < 10; ++round) {
    unlink(path);
    write_together(1);
  }
}

static void a_killed_program_leaves_whole_exams(void **state) {
  (void)state;
  int pipes[2];
  uint32_t seen = 0;
  char byte;
  assert_int_equal(pipe(pipes), 0);
  pid_t child = fork();
  if (child == 0) {
    sonde_exam_log *log = NULL;
    if (sonde_exam_log_open(path, &log, NULL)) _exit(1);
    for (uint32_t i = 0;; ++i) {
      char id[32];
      snprintf(id, sizeof id, "%u", i);
      sonde_log_entry e = entry_of(id, "Ann", i);
      if (sonde_exam_log_add(log, &e, NULL) || write(pipes[1], "x", 1) != 1) _exit(2);
    }
  }
  close(pipes[1]);
  while (seen < 5 && read(pipes[0], &byte, 1) == 1) ++seen;
  kill(child, SIGKILL);
  waitpid(child, NULL, 0);
  while (read(pipes[0], &byte, 1) == 1) ++seen;
  close(pipes[0]);
  assert_true(seen >= 5);
  sonde_exam_log *log = opened();
  uint32_t kept = rows_of(log, NULL);
  assert_true(kept == seen || kept == seen + 1); // killed before it could say so
  sonde_exam_log_close(log);
}

// ---- files that are not logs --------------------------------------------------------------------

static void write_bytes(const char *bytes, size_t count) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, count, file), count);
  fclose(file);
}

// Refused with that status, a message that names the file, and not a byte changed.
static void assert_refused(sonde_status expected, const char *words) {
  char *before = NULL, *after = NULL;
  size_t before_count = 0, after_count = 0;
  sonde_exam_log *log = NULL;
  sonde_error error = {0};
  assert_int_equal(sonde_file_load(path, &before, &before_count, NULL), SONDE_OK);
  sonde_status got = sonde_exam_log_open(path, &log, &error);
  if (got != expected) fail_msg("status %d, expected %d: %s", got, expected, error.message);
  assert_null(log);
  assert_non_null(strstr(error.message, path));
  if (!strstr(error.message, words)) fail_msg("'%s' lacks '%s'", error.message, words);
  assert_int_equal(sonde_file_load(path, &after, &after_count, NULL), SONDE_OK);
  assert_int_equal(before_count, after_count);
  assert_memory_equal(before, after, before_count);
  sonde_free(before);
  sonde_free(after);
}

static void other_files_are_refused_untouched(void **state) {
  (void)state;
  static const char words[] = "These are notes of a teacher, and nobody wants to lose them.\n"
                              "They are longer than the head of a database file, a hundred bytes.";
  write_bytes(words, sizeof words);
  assert_refused(SONDE_FORMAT, "not a log of exams");
  unlink(path);
  sqlite3 *base = NULL;
  assert_int_equal(sqlite3_open(path, &base), SQLITE_OK);
  sqlite3_exec(base, "CREATE TABLE music (title TEXT); INSERT INTO music VALUES ('a')", NULL, NULL,
               NULL);
  sqlite3_close(base);
  assert_refused(SONDE_FORMAT, "something else");
}

static void newer_logs_are_refused(void **state) {
  (void)state;
  sqlite3 *base = NULL;
  sonde_exam_log_close(opened());
  assert_int_equal(sqlite3_open(path, &base), SQLITE_OK);
  sqlite3_exec(base, "PRAGMA user_version = 2", NULL, NULL, NULL);
  sqlite3_close(base);
  assert_refused(SONDE_VERSION, "version 2; expected 1");
}

static void make_long_log(void) {
  sonde_exam_log *log = opened();
  for (uint32_t i = 0; i < 40; ++i) {
    char id[16];
    snprintf(id, sizeof id, "%u", i);
    sonde_log_entry e = entry_of(id, "Ann", i);
    add(log, &e);
  }
  sonde_exam_log_close(log);
}

static void damaged_logs_are_refused_untouched(void **state) {
  (void)state;
  char *bytes = NULL;
  size_t count = 0;
  make_long_log();
  assert_int_equal(sonde_file_load(path, &bytes, &count, NULL), SONDE_OK);
  assert_true(count > 16384);
  memset(bytes + 8192, 0xa5, 4096); // a page within
  write_bytes(bytes, count);
  assert_refused(SONDE_FORMAT, "damaged");
  sonde_free(bytes);
  unlink(path);
  make_long_log();
  assert_int_equal(truncate(path, 8192), 0);
  assert_refused(SONDE_FORMAT, "damaged");
}

static void a_log_without_a_place_is_said(void **state) {
  (void)state;
  sonde_exam_log *log = NULL;
  sonde_error error = {0};
  assert_int_equal(sonde_exam_log_open("no/such/place.sqlite", &log, &error), SONDE_IO);
  assert_non_null(strstr(error.message, "no/such/place.sqlite"));
  assert_int_equal(sonde_exam_log_open("", &log, NULL), SONDE_ARGUMENT);
}

// ---- counts and curves
// ----------------------------------------------------------------------------

static void learning_curve_smooths_with_a_median(void **state) {
  (void)state;
  static const double scores[6] = {10, 90, 20, 80, 30, 70};
  sonde_exam_log *log = opened();
  for (uint32_t i = 0; i < 6; ++i) { // added in another order than done
    uint32_t n = (i * 5) % 6;
    char id[16];
    snprintf(id, sizeof id, "%u", n);
    sonde_log_entry e = entry_of(id, "Ann", n);
    e.score = scores[n];
    add(log, &e);
  }
  sonde_log_entry stopped = entry_of("stopped", "Ann", 3);
  stopped.score = 0;
  stopped.interrupted = true;
  add(log, &stopped);
  sonde_learning_point *points = NULL;
  uint32_t count = 0;
  assert_int_equal(sonde_exam_log_curve(log, "Ann", 3, &points, &count, NULL), SONDE_OK);
  static const double medians[6] = {10, 50, 20, 80, 30, 70};
  assert_int_equal(count, 6);
  for (uint32_t i = 0; i < 6; ++i) {
    assert_int_equal(points[i].number, i + 1);
    assert_near(points[i].score, scores[i], 0);
    assert_near(points[i].median, medians[i], 0);
  }
  sonde_free(points);
  assert_int_equal(sonde_exam_log_curve(log, "nobody", 0, &points, &count, NULL), SONDE_OK);
  assert_int_equal(count, 0);
  sonde_free(points);
  sonde_exam_log_close(log);
}

// Four kinds of answers, different numbers of each.
static void series_counts_answers(void **state) {
  (void)state;
  static const bool ill[4] = {true, true, false, false}, said[4] = {true, false, true, false};
  static const uint32_t times[4] = {4, 1, 2, 3};
  sonde_exam_log *log = opened();
  uint32_t n = 0;
  for (uint32_t kind = 0; kind < 4; ++kind)
    for (uint32_t i = 0; i < times[kind]; ++i) {
      char id[16];
      snprintf(id, sizeof id, "%u", ++n);
      sonde_log_entry e = entry_of(id, "Ann", n);
      e.thrombosis = ill[kind];
      e.called_thrombosis = said[kind];
      e.correct = e.passed = ill[kind] == said[kind];
      add(log, &e);
    }
  sonde_log_entry stopped = entry_of("stopped", "Ann", 1);
  stopped.interrupted = true;
  add(log, &stopped);
  sonde_series series;
  assert_int_equal(sonde_exam_log_series(log, "Ann", &series, NULL), SONDE_OK);
  assert_int_equal(series.exams, 10);
  assert_int_equal(series.passed, 7);
  assert_near(sonde_series_sensitivity(&series), 0.8, 1e-15);
  assert_near(sonde_series_specificity(&series), 0.6, 1e-15);
  assert_int_equal(sonde_exam_log_series(log, "nobody", &series, NULL), SONDE_OK);
  assert_true(series.exams == 0 && isnan(sonde_series_sensitivity(&series)));
  sonde_exam_log_close(log);
}

static void counters_add_up(void **state) {
  (void)state;
  sonde_exam_log *log = opened();
  sonde_log_count *counts = NULL;
  uint32_t count = 0;
  for (uint32_t n = 0; n < 9; ++n) {
    char id[16];
    snprintf(id, sizeof id, "%u", n);
    sonde_log_entry e = entry_of(id, n < 5 ? "Ann" : "Bo", n);
    e.interrupted = n >= 7;
    e.passed = n != 0;
    add(log, &e);
  }
  assert_int_equal(sonde_exam_log_count(log, SONDE_LOG_BY_TRAINEE, NULL, &counts, &count, NULL), 0);
  assert_int_equal(count, 2);
  assert_string_equal(counts[0].name, "Ann");
  assert_true(counts[0].exams == 5 && counts[0].finished == 5 && counts[0].passed == 4);
  assert_near(counts[0].score_best, 44, 0);
  assert_near(counts[0].score_mean, 42, 1e-12);
  assert_true(counts[1].exams == 4 && counts[1].finished == 2 && counts[1].passed == 2);
  sonde_free(counts);
  assert_int_equal(sonde_exam_log_count(log, SONDE_LOG_BY_CASE, NULL, &counts, &count, NULL), 0);
  assert_int_equal(count, 3);
  assert_string_equal(counts[1].name, "case-1");
  assert_string_equal(counts[1].title, "Case \u00e9 7");
  assert_true(counts[0].exams + counts[1].exams + counts[2].exams == 9);
  sonde_free(counts);
  assert_int_equal(sonde_exam_log_count(log, SONDE_LOG_BY_CASE, "Bo", &counts, &count, NULL), 0);
  assert_int_equal(count, 3);
  assert_true(counts[0].exams + counts[1].exams + counts[2].exams == 4);
  sonde_free(counts);
  sonde_exam_log_close(log);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, fresh_path, remove_path)

int main(void) {
  const struct CMUnitTest tests[] = {
      TEST(entries_come_back),
      TEST(what_was_not_measured_stays_so),
      TEST(entries_survive_as_text),
      TEST(wrong_entries_are_refused),
      TEST(texts_are_cut_between_characters),
      TEST(dates_are_universal_time),
      TEST(several_programs_lose_nothing),
      TEST(several_programs_make_one_log),
      TEST(a_killed_program_leaves_whole_exams),
      TEST(other_files_are_refused_untouched),
      TEST(newer_logs_are_refused),
      TEST(damaged_logs_are_refused_untouched),
      TEST(a_log_without_a_place_is_said),
      TEST(learning_curve_smooths_with_a_median),
      TEST(series_counts_answers),
      TEST(counters_add_up),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
