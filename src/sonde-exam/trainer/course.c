// The course: its lessons' files.
#include "sonde/trainer_course.h"

#include "base/bounds.h"
#include "trainer/case.h"
#include "trainer/course.h"

#include <string.h>

static const char *const GUIDANCE[] = {"full", "hints", "exam", NULL};
static const char PREFIX[] = "lesson-";

const char *sonde_guidance_level_name(sonde_guidance_level level) {
  SONDE_ASSERT(level <= SONDE_GUIDANCE_EXAM);
  return GUIDANCE[level];
}

// Either `case`, a file beside the lesson's, or `draw`. The patient's text joins the print.
static void read_patient(sonde_reader *reader, sonde_place root, const char *path,
                         sonde_lesson *out) {
  char file[4096] = "", name[256] = "";
  sonde_place one = sonde_read_find(reader, root, "case"),
              draw = sonde_read_find(reader, root, "draw");
  if ((one != 0) == (draw != 0)) {
    sonde_reader_fail(reader, root, SONDE_FORMAT, "give either case (a file) or draw (a level)");
    return;
  }
  out->drawn = draw != 0;
  if (out->drawn) {
    out->level = (sonde_case_level)sonde_read_choice(reader, root, "draw", sonde_case_levels, 0);
    return;
  }
  sonde_read_member(reader, root, "case", true, name, sizeof name);
  const char *slash = strrchr(path, '/');
  snprintf(file, sizeof file, "%.*s%s", slash ? (int)(slash + 1 - path) : 0, path, name);
  sonde_error error = {0};
  char *text = NULL;
  if (!sonde_reader_good(reader)) return;
  sonde_status status = sonde_case_load(file, &out->patient, &error);
  if (!status) status = sonde_case_text(&out->patient, &text, &error);
  if (status)
    sonde_reader_pass(reader, one, &error);
  else
    out->print = sonde_hash(out->print, text, strlen(text));
  sonde_free(text);
}

sonde_status sonde_lesson_load(const char *path, sonde_lesson *out, sonde_error *error) {
  SONDE_ASSERT(path && out);
  static const char *const KEYS[] = {"sonde_lesson", "id",       "title", "goal",
                                     "film",         "case",     "draw",  "places",
                                     "doppler",      "practice", "quiz",  NULL};
  const double none = (double)NAN;
  char *text = NULL, id[32] = "";
  size_t count;
  sonde_reader *reader = NULL;
  *out = (sonde_lesson){.protocol.criteria = sonde_criteria_default(),
                        .bar = {0, none, none, none, none, none, none, none, none, none}};
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_yaml, &text, &count, error);
  if (!status) status = sonde_reader_create(text, path, &reader, error);
  if (status) {
    sonde_free(text);
    return status;
  }
  sonde_place root = sonde_reader_root(reader);
  sonde_read_keys(reader, root, "a lesson", KEYS);
  sonde_read_version(reader, root, "sonde_lesson", "lesson", SONDE_LESSON_VERSION);
  sonde_exam_protocol *places = &out->protocol;
  sonde_read_member(reader, root, "id", true, id, sizeof id);
  snprintf(places->id, sizeof places->id, "%s%s", PREFIX, id);
  sonde_read_member(reader, root, "title", true, out->title, sizeof out->title);
  sonde_read_member(reader, root, "goal", true, out->goal, sizeof out->goal);
  sonde_read_member(reader, root, "film", true, out->film, sizeof out->film);
  snprintf(places->title, sizeof places->title, "%s", out->title);
  snprintf(places->text, sizeof places->text, "%s", out->goal);
  sonde_read_stops(reader, root, places);
  out->print = sonde_course_print(places);
  read_patient(reader, root, path, out);
  out->doppler = sonde_read_bool(reader, root, "doppler", false);

  sonde_place turns = sonde_read_find(reader, root, "practice");
  out->turn_count = sonde_read_count(reader, turns);
  sonde_place quiz = sonde_read_find(reader, root, "quiz");
  out->question_count = sonde_read_count(reader, quiz);
  if (out->turn_count == 0 || out->turn_count > SONDE_LESSON_TURNS)
    sonde_reader_fail(reader, turns ? turns : root, SONDE_FORMAT,
                      "%u repetitions in practice, expected 1 to %d", out->turn_count,
                      SONDE_LESSON_TURNS);
  if (out->question_count > SONDE_LESSON_QUESTIONS)
    sonde_reader_fail(reader, quiz, SONDE_FORMAT, "%u questions, expected at most %d",
                      out->question_count, SONDE_LESSON_QUESTIONS);
  // Guidance never comes back once it is gone, and the last time there is none.
  for (uint32_t i = 0; sonde_reader_good(reader) && i < out->turn_count; ++i) {
    sonde_place item = sonde_read_item(reader, turns, i);
    const char *word = sonde_read_text_at(reader, item, "guidance");
    int level = 0;
    while (word && GUIDANCE[level] && strcmp(GUIDANCE[level], word) != 0) ++level;
    if (!word || !GUIDANCE[level]) {
      sonde_reader_fail(reader, item, SONDE_FORMAT, "practice is full, hints or exam, not '%s'",
                        word ? word : "");
      break;
    }
    out->turn[i] = (sonde_guidance_level)level;
    if (i > 0 && out->turn[i] < out->turn[i - 1])
      sonde_reader_fail(reader, item, SONDE_FORMAT, "guidance fades: %s does not follow %s", word,
                        GUIDANCE[out->turn[i - 1]]);
    if (i + 1 == out->turn_count && out->turn[i] != SONDE_GUIDANCE_EXAM)
      sonde_reader_fail(reader, item, SONDE_FORMAT, "the last repetition is exam, not %s", word);
  }
  for (uint32_t i = 0; sonde_reader_good(reader) && i < out->question_count; ++i)
    sonde_read_question(reader, sonde_read_item(reader, quiz, i), &out->question[i]);
  status = sonde_reader_status(reader, error);
  sonde_reader_destroy(reader);
  sonde_free(text);
  return status;
}

static sonde_status load_one(const char *path, void *item, sonde_error *error) {
  return sonde_lesson_load(path, item, error);
}

sonde_status sonde_course_load(const char *directory, sonde_course *course, sonde_error *error) {
  SONDE_ASSERT(directory && course);
  void *items = NULL;
  *course = (sonde_course){0};
  sonde_status status = sonde_load_directory(directory, sizeof(sonde_lesson), load_one, &items,
                                             &course->count, error);
  course->lesson = items;
  for (uint32_t i = 0; !status && i < course->count; ++i)
    if (sonde_course_find(course, course->lesson[i].protocol.id) != i)
      status = sonde_fail(error, SONDE_ARGUMENT, "%s: two lessons have the id '%s'", directory,
                          course->lesson[i].protocol.id + sizeof PREFIX - 1);
  char path[4096];
  snprintf(path, sizeof path, "%.3800s/bar.json", directory);
  if (!status) status = sonde_course_read_bars(course, path, error);
  if (status) sonde_course_clear(course);
  return status;
}

void sonde_course_clear(sonde_course *course) {
  if (!course) return;
  sonde_free(course->lesson);
  *course = (sonde_course){0};
}

uint32_t sonde_course_find(const sonde_course *course, const char *id) {
  SONDE_ASSERT(course && id);
  const size_t skip = strncmp(id, PREFIX, sizeof PREFIX - 1) == 0 ? 0 : sizeof PREFIX - 1;
  uint32_t i = 0;
  while (i < course->count && strcmp(course->lesson[i].protocol.id + skip, id) != 0) ++i;
  return i;
}

void sonde_lesson_patient(const sonde_lesson *lesson, uint64_t seed, sonde_case *out) {
  SONDE_ASSERT(lesson && out);
  if (lesson->drawn)
    sonde_case_generate(seed, lesson->level, out);
  else
    *out = lesson->patient;
}
