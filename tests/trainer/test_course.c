// The course: what ships can be read and has its bars; mistakes in a lesson are named; a bar
// belongs to the lesson that it was measured on.
#include "trainer_test.h"

#include "sonde/trainer_course.h"

#include <sys/stat.h>

static char folder[256];

static const char *put(const char *name, const char *text) {
  static char path[512];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  return path;
}

static const char HEAD[] = "sonde_lesson: 1\nid: a\ntitle: A\ngoal: g\nfilm: f\n";
static const char REST[] = "places:\n- {title: B, text: b, at: 20}\n";

static void the_course_that_ships(void **state) {
  (void)state;
  sonde_course course;
  sonde_error error = {0};
  if (sonde_course_load(SONDE_SOURCE_DIR "/data/course", &course, &error))
    fail_msg("%s", error.message);
  assert_int_equal(course.count, 11);
  for (uint32_t i = 0; i < course.count; ++i) {
    const sonde_lesson *l = &course.lesson[i];
    const char *id = l->protocol.id;
    assert_int_equal(sonde_course_find(&course, id), i);
    assert_int_equal(sonde_course_find(&course, id + strlen("lesson-")), i);
    assert_int_equal(l->drawn, i + 1 == course.count); // the certification
    assert_true(l->goal[0] && l->film[0]);
    // Guidance fades to nothing; every lesson but the certification begins with all of it.
    assert_int_equal(l->turn[0], l->drawn ? SONDE_GUIDANCE_EXAM : SONDE_GUIDANCE_FULL);
    assert_int_equal(l->turn[l->turn_count - 1], SONDE_GUIDANCE_EXAM);
    assert_true(l->drawn || l->question_count >= 2);
    for (uint32_t k = 0; k < l->question_count; ++k)
      assert_true(l->question[k].right < l->question[k].choice_count && l->question[k].why[0]);
    // Each lesson has a leg of its own.
    for (uint32_t k = 0; k < i && !l->drawn; ++k)
      assert_int_not_equal(course.lesson[k].patient.seed, l->patient.seed);
    // The bar is what was measured, with its spread, and in reach: below the expert's mean.
    const sonde_bar *bar = &l->bar;
    if (bar->runs < 2) fail_msg("%s: the bar is missing or of another lesson: measure again", id);
    assert_true(bar->score_sd >= 0 && bar->time_mean_s > 0 && bar->path_mean_m > 0);
    assert_true(bar->score <= bar->score_mean - 2 * bar->score_sd);
    assert_true(bar->score >= 70); // what passes an exam at all
  }
  assert_int_equal(sonde_course_find(&course, "other"), course.count);
  sonde_course_clear(&course);
}

static void mistakes_are_named(void **state) {
  (void)state;
  static const struct {
    const char *more, *says;
  } BAD[] = {
      {"practice: [exam]\n", "x.yaml:1: give either case"},
      {"draw: hard\ncase: c.yaml\npractice: [exam]\n", "give either case"},
      {"draw: medium\npractice: [exam]\n", "x.yaml:8:"},
      {"draw: hard\n", "0 repetitions"},
      {"draw: hard\npractice: [hints, full, exam]\n", "x.yaml:9: guidance fades"},
      {"draw: hard\npractice: [full]\n", "x.yaml:9: the last repetition is exam"},
      {"draw: hard\npractice: [some]\n", "x.yaml:9: practice is full, hints or exam, not 'some'"},
      {"draw: hard\npractice: [exam]\nquiz:\n- {ask: a, choices: [b], right: 1, why: w}\n",
       "x.yaml:11: 1 choices"},
      {"draw: hard\npractice: [exam]\nquiz:\n- {ask: a, choices: [b, c], right: 3, why: w}\n",
       "x.yaml:11:"},
      {"draw: hard\npractice: [exam]\nquiz:\n- {ask: a, choices: [b, c], why: w}\n",
       "right is missing"},
      {"case: none.yaml\npractice: [exam]\n", "x.yaml:8:"},
      {"draw: hard\npractice: [exam]\nbar: 70\n", "x.yaml:10: unknown key 'bar'"},
  };
  for (size_t i = 0; i < SONDE_COUNT_OF(BAD); ++i) {
    char text[1024];
    sonde_lesson lesson;
    sonde_error error = {0};
    snprintf(text, sizeof text, "%s%s%s", HEAD, REST, BAD[i].more);
    assert_int_not_equal(sonde_lesson_load(put("x.yaml", text), &lesson, &error), SONDE_OK);
    if (!strstr(error.message, BAD[i].says))
      fail_msg("says: %s, expected %s", error.message, BAD[i].says);
  }
  remove(put("x.yaml", ""));
}

// A bar is kept by its file, until what the expert would do differently is changed; words may be.
static void a_bar_belongs_to_its_lesson(void **state) {
  (void)state;
  static const char *const LESSON[] = {
      "sonde_lesson: 1\nid: a\ntitle: A\ngoal: g\nfilm: f\nplaces:\n- {title: B, text: b, at: "
      "20}\ndraw: easy\npractice: [exam]\n",
      "sonde_lesson: 1\nid: a\ntitle: Other\ngoal: words\nfilm: f\nplaces:\n- {title: C, text: d, "
      "at: 20}\ndraw: easy\npractice: [hints, exam]\n",
      "sonde_lesson: 1\nid: a\ntitle: A\ngoal: g\nfilm: f\nplaces:\n- {title: B, text: b, at: "
      "21}\ndraw: easy\npractice: [exam]\n"};
  char path[512];
  sonde_course course;
  sonde_error error = {0};
  put("a.yaml", LESSON[0]);
  assert_int_equal(sonde_course_load(folder, &course, &error), SONDE_OK);
  assert_int_equal(course.lesson[0].bar.runs, 0);
  course.lesson[0].bar = (sonde_bar){9, 97.5, 0.75, 12, 1, 0.25, 0.01, 8, 0.5, 90};
  snprintf(path, sizeof path, "%s/bar.json", folder);
  assert_int_equal(sonde_course_save_bars(&course, path, &error), SONDE_OK);
  sonde_course_clear(&course);
  for (int i = 0; i < 3; ++i) {
    put("a.yaml", LESSON[i]);
    assert_int_equal(sonde_course_load(folder, &course, &error), SONDE_OK);
    const sonde_bar *bar = &course.lesson[0].bar;
    assert_int_equal(bar->runs, i < 2 ? 9 : 0);
    if (i < 2) assert_near(bar->score_mean, 97.5, 1e-9);
    if (i < 2) assert_near(bar->path_sd_m, 0.01, 1e-12);
    if (i < 2) assert_near(bar->score, 90, 0);
    sonde_course_clear(&course);
  }
  put("a.yaml", LESSON[0]);
  put("bar.json", "{\"sonde_bars\":2}");
  assert_int_equal(sonde_course_load(folder, &course, &error), SONDE_VERSION);
  put("bar.json", "{");
  assert_int_equal(sonde_course_load(folder, &course, &error), SONDE_FORMAT);
  put("b.yaml", LESSON[0]);
  remove(path);
  assert_int_equal(sonde_course_load(folder, &course, &error), SONDE_ARGUMENT); // twice the id
  remove(put("a.yaml", "")), remove(put("b.yaml", ""));
}

int main(void) {
  snprintf(folder, sizeof folder, "course_test.%d", (int)getpid());
  assert_int_equal(mkdir(folder, 0700), 0);
  const struct CMUnitTest tests[] = {cmocka_unit_test(the_course_that_ships),
                                     cmocka_unit_test(mistakes_are_named),
                                     cmocka_unit_test(a_bar_belongs_to_its_lesson)};
  int failed = cmocka_run_group_tests(tests, NULL, NULL);
  rmdir(folder);
  return failed;
}
