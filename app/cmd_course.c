// sonde course: the lessons of the course, and their proficiency bars.
#include "exam_common.h"
#include "options.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char VERB[] = "course";
enum { MOST_LEARNERS = 200, MOST_SEARCHES = 16384 };

typedef struct options {
  const char *course, *only, *output;
  long runs, learners;
  bool measure, search, json;
} options;

static const options DEFAULTS = {.runs = 12, .learners = 20};

static const app_option TABLE[] = {
    OPT_TEXT(course, "course", "DIR", "lessons from there instead of those that ship"),
    OPT_TEXT(only, "lesson", "ID", "this lesson only"),
    OPT_FLAG(measure, "measure",
             "let the scripted expert examine each lesson's places again and again, and take the "
             "proficiency bar from that"),
    OPT_INTEGER(runs, "runs", "N", 2, SONDE_BAR_RUNS, "exams of the expert for each lesson"),
    OPT_FLAG(search, "search",
             "let scripted learners with errors of search look for the view of each place with all "
             "guidance, with names alone and with none: how far the probe went, and how long"),
    OPT_INTEGER(learners, "learners", "N", 2, MOST_LEARNERS, "learners for each place and level"),
    OPT_OUTPUT(output, "o,output", "FILE",
               "write the bars there: bar.json of the course's directory. Lessons that are not "
               "measured keep theirs"),
    OPT_JSON(json)};

static int check(void *from) {
  const options *a = from;
  const char *wrong = NULL;
  if (a->measure && !a->output) wrong = "-o FILE with --measure";
  if (!a->measure && (a->output || app_option_given("runs")))
    wrong = "--measure with --runs and -o";
  if (a->measure && a->search) wrong = "either --measure or --search";
  if (!a->search && app_option_given("learners")) wrong = "--search with --learners";
  return wrong ? app_usage_error(VERB, "expected %s", wrong) : APP_OK;
}

// What the searches of one level came to.
typedef struct searches {
  uint32_t count, found;
  double path_m[MOST_SEARCHES], ticks[MOST_SEARCHES];
} searches;

static int search_all(const options *a, const sonde_course *course, uint32_t first, uint32_t end,
                      const char *directory) {
  assert(course->count >= end && a->learners > 1);
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  searches *all = calloc(SONDE_GUIDANCE_LEVELS, sizeof *all);
  if (!all) status = app_error(&error, SONDE_MEMORY, "out of memory");
  sonde_progress progress = app_progress();
  for (uint32_t i = first; !status && i < end; ++i) {
    if (!progress.report((double)(i - first) / (end - first), course->lesson[i].title,
                         progress.user))
      status = app_error(&error, SONDE_CANCELLED, "cancelled");
    // Every learner at every place of the lesson, by level.
    const sonde_lesson *lesson = &course->lesson[i];
    sonde_exam_setups setups = {.count = 0};
    sonde_plan plan = {.count = 0};
    sonde_case patient;
    sonde_search search[SONDE_GUIDANCE_LEVELS * MOST_LEARNERS];
    const uint32_t learners = (uint32_t)a->learners;
    sonde_lesson_patient(lesson, 1, &patient);
    if (!status)
      status = sonde_exam_lay(&patient, &lesson->protocol, NULL, directory, &setups, &plan, &error);
    for (uint32_t place = 0; place < plan.count && !status; ++place) {
      status = sonde_learner_search(&setups, &plan, place, learners, search, &error);
      for (uint32_t k = 0; k < SONDE_GUIDANCE_LEVELS * learners && !status; ++k) {
        searches *to = &all[k / learners];
        if (to->count == MOST_SEARCHES) break;
        to->path_m[to->count] = search[k].path_m;
        to->ticks[to->count++] = search[k].ticks;
        to->found += search[k].found;
      }
    }
    sonde_exam_setups_clear(&setups);
  }
  app_progress_end();
  if (!status && a->json)
    app_json_begin();
  else if (!status)
    printf("%-8s %9s %7s %18s %18s\n", "guidance", "searches", "found", "path mm, 90 %",
           "ticks, 90 %");
  for (int level = 0; level < SONDE_GUIDANCE_LEVELS && !status; ++level) {
    searches *of = &all[level];
    const char *name = sonde_guidance_level_name((sonde_guidance_level)level);
    const double path_m = app_quantile(of->path_m, of->count, 0.5),
                 far_m = app_quantile(of->path_m, of->count, 0.9),
                 ticks = app_quantile(of->ticks, of->count, 0.5),
                 long_ticks = app_quantile(of->ticks, of->count, 0.9);
    if (!a->json) {
      printf("%-8s %9u %7u %9.0f %8.0f %9.0f %8.0f\n", name, of->count, of->found, 1e3 * path_m,
             1e3 * far_m, ticks, long_ticks);
      continue;
    }
    app_json_object(name);
    app_json("searches:%u found:%u path_mm:%g path_p90_mm:%g ticks:%g ticks_p90:%g", of->count,
             of->found, 1e3 * path_m, 1e3 * far_m, ticks, long_ticks);
    app_json_close();
  }
  if (!status && a->json) app_json_end();
  free(all);
  return status ? app_fail(VERB, &error) : APP_OK;
}

static int run(void *from) {
  const options *a = from;
  assert(a->runs >= 2);
  char directory[1100];
  sonde_course course = {0};
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  if (a->course)
    snprintf(directory, sizeof directory, "%s", a->course);
  else if (!app_data_directory("course", directory, sizeof directory))
    status = app_error(&error, SONDE_NOT_FOUND, "the course that ships was not found");
  if (!status) status = sonde_course_load(directory, &course, &error);
  const uint32_t one = !status && a->only ? sonde_course_find(&course, a->only) : course.count;
  if (!status && a->only && one == course.count)
    status = app_error(&error, SONDE_NOT_FOUND, "no lesson '%s' in %.300s", a->only, directory);
  uint32_t first = a->only ? one : 0, end = a->only && !status ? one + 1 : course.count;

  if (!status && a->search) {
    const int code = search_all(a, &course, first, end, directory);
    sonde_course_clear(&course);
    return code;
  }
  sonde_progress progress = app_progress();
  for (uint32_t i = first; a->measure && !status && i < end; ++i) {
    app_progress_part((double)(i - first) / (end - first), (i - first + 1.0) / (end - first));
    status =
        sonde_lesson_measure(&course.lesson[i], (uint32_t)a->runs, directory, &progress, &error);
  }
  app_progress_end();
  if (!status && a->measure) status = sonde_course_save_bars(&course, a->output, &error);
  if (!status && a->json)
    app_json_begin();
  else if (!status)
    printf("%-24s %6s %6s %9s  %-14s %7s %6s  %s\n", "lesson", "places", "times", "questions",
           "expert", "time", "bar", "title");
  for (uint32_t i = first; !status && i < end; ++i) {
    const sonde_lesson *lesson = &course.lesson[i];
    const sonde_bar *bar = &lesson->bar;
    const char *id = lesson->protocol.id;
    if (!a->json) {
      printf("%-24s %6u %6u %9u", id, lesson->protocol.stop_count, lesson->turn_count,
             lesson->question_count);
      if (bar->runs == 0)
        printf("  %-28s  %s\n", "not measured", lesson->title);
      else
        printf("  %5.1f +- %-5.2f %5.0f s %6.0f  %s\n", bar->score_mean, bar->score_sd,
               bar->time_mean_s, bar->score, lesson->title);
      continue;
    }
    app_json_object(id);
    app_json_text("title", lesson->title);
    app_json_text("goal", lesson->goal);
    app_json_text("patient", lesson->drawn ? "drawn" : lesson->patient.id);
    app_json_integer("places", lesson->protocol.stop_count);
    app_json_integer("repetitions", lesson->turn_count);
    app_json_integer("questions", lesson->question_count);
    app_json_integer("runs", bar->runs);
    app_json_real("score_mean", bar->score_mean);
    app_json_real("score_sd", bar->score_sd);
    app_json_real("time_mean_s", bar->time_mean_s);
    app_json_real("path_mean_mm", 1e3 * bar->path_mean_m);
    app_json_real("force_mean_n", bar->force_mean_n);
    app_json_real("bar", bar->score);
    app_json_close();
  }
  if (!status && a->json) app_json_end();
  sonde_course_clear(&course);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_course = {
    .verb = "course",
    .summary = "list the lessons of the course and measure their bars",
    .usage = "[--course DIR] [--lesson ID] [--json]\n"
             "--measure -o FILE [--runs N] [--course DIR] [--lesson ID] [--json]\n"
             "--search [--learners N] [--course DIR] [--lesson ID] [--json]",
    .text =
        "Lists the lessons of the course, which the page teaches (docs/course.md), or measures "
        "their proficiency bars: what the scripted expert reaches in repeated exams of a lesson's "
        "places, with its spread; or lets scripted learners look for the views. Lessons are files: "
        "data/course.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .check = check,
    .run = run};
