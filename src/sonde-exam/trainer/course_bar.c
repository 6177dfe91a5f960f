// The proficiency bar of a lesson: repeated exams of the scripted expert, and the file that keeps
// what they came to.
#include "base/base.h"
#include "base/bounds.h"
#include "sonde/base_json.h"
#include "trainer/course.h"
#include "trainer/judge.h"

#include <stddef.h>
#include <string.h>
#include <unistd.h>

static const double SPREADS = 2; // below the expert's mean

// The figures of a bar as the file names them.
static const struct {
  const char *key;
  size_t at;
  double unit;
} FIGURE[] = {{"score_mean", offsetof(sonde_bar, score_mean), 1},
              {"score_sd", offsetof(sonde_bar, score_sd), 1},
              {"time_mean_s", offsetof(sonde_bar, time_mean_s), 1},
              {"time_sd_s", offsetof(sonde_bar, time_sd_s), 1},
              {"path_mean_mm", offsetof(sonde_bar, path_mean_m), 1e3},
              {"path_sd_mm", offsetof(sonde_bar, path_sd_m), 1e3},
              {"force_mean_n", offsetof(sonde_bar, force_mean_n), 1},
              {"force_sd_n", offsetof(sonde_bar, force_sd_n), 1},
              {"score", offsetof(sonde_bar, score), 1}};

static double *figure_of(sonde_bar *bar, size_t k) {
  return (double *)(void *)((char *)bar + FIGURE[k].at);
}

uint64_t sonde_course_print(const sonde_exam_protocol *places) {
  uint64_t print = 0;
  for (const sonde_exam_stop *stop = places->stop; stop < places->stop + places->stop_count;
       ++stop) {
    char text[768];
    size_t length = 0;
    const sonde_station *const ends[] = {&stop->from, &stop->to};
    for (int k = 0; k < 2; ++k)
      length += (size_t)snprintf(text + length, sizeof text - length, "%s|%s|%s|%d|%.9g|%.9g|",
                                 ends[k]->segment, ends[k]->landmark, ends[k]->station,
                                 ends[k]->of_branch, ends[k]->share, ends[k]->shift_m);
    length += (size_t)snprintf(text + length, sizeof text - length, "%s|%s|%.9g|%d;", stop->needs,
                               stop->segment, stop->every_m, (int)stop->position);
    SONDE_ASSERT(length < sizeof text);
    print = sonde_hash(print, text, length);
  }
  return print;
}

// Mean and standard deviation of a list.
static void summarise(const double *list, uint32_t count, double *mean, double *sd) {
  SONDE_ASSERT(count > 1);
  double sum = 0, square = 0;
  for (uint32_t i = 0; i < count; ++i) sum += list[i];
  *mean = sum / count;
  for (uint32_t i = 0; i < count; ++i) square += (list[i] - *mean) * (list[i] - *mean);
  *sd = sqrt(square / (count - 1));
}

sonde_status sonde_lesson_measure(sonde_lesson *lesson, uint32_t runs, const char *directory,
                                  const sonde_progress *progress, sonde_error *error) {
  SONDE_ASSERT(lesson && runs >= 2 && runs <= SONDE_BAR_RUNS);
  double list[4][SONDE_BAR_RUNS];
  sonde_exam_setups setups = {.count = 0};
  sonde_plan plan = {.count = 0};
  sonde_case patient;
  sonde_exam_def def = sonde_exam_def_default();
  def.patient = &patient, def.protocol = &lesson->protocol, def.plan = &plan;
  def.directory = directory;
  sonde_status status = SONDE_OK;
  for (uint32_t run = 0; !status && run < runs; ++run) {
    def.seed = run + 1;
    if (run == 0 || lesson->drawn) {
      sonde_exam_setups_clear(&setups);
      sonde_lesson_patient(lesson, def.seed, &patient);
      status = sonde_exam_prepare(&patient, &lesson->protocol, NULL, directory, NULL, &setups,
                                  &plan, error);
    }
    sonde_score score = {0};
    if (!status) status = sonde_exam_run(&def, &setups, NULL, &score, error);
    list[0][run] = score.score, list[1][run] = score.metrics.time_s;
    list[2][run] = score.metrics.path_m, list[3][run] = score.metrics.force_peak_n;
    if (!status && !sonde_progress_report(progress, (run + 1.0) / runs, lesson->title))
      status = sonde_fail(error, SONDE_CANCELLED, "cancelled in '%s'", lesson->title);
  }
  // One press that has to be repeated lowers the share of good ones from 1 to n / (n + 1).
  double technique = 0;
#define COURSE_WEIGHT(name, weight, title, text)                                                   \
  if (strcmp(#name, "technique") == 0) technique = weight;
  SONDE_SCORE_LIST(COURSE_WEIGHT)
#undef COURSE_WEIGHT
  if (!status) {
    sonde_bar *bar = &lesson->bar;
    bar->runs = runs;
    summarise(list[0], runs, &bar->score_mean, &bar->score_sd);
    summarise(list[1], runs, &bar->time_mean_s, &bar->time_sd_s);
    summarise(list[2], runs, &bar->path_mean_m, &bar->path_sd_m);
    summarise(list[3], runs, &bar->force_mean_n, &bar->force_sd_n);
    bar->score = floor(bar->score_mean - SPREADS * bar->score_sd - technique / (plan.count + 1.0));
  }
  sonde_exam_setups_clear(&setups);
  return status;
}

sonde_status sonde_course_save_bars(const sonde_course *course, const char *path,
                                    sonde_error *error) {
  SONDE_ASSERT(course && path);
  sonde_json_out out = {.layout = SONDE_JSON_LINES};
  sonde_status status = sonde_file_create(path, &out.file, error);
  if (status) return status;
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_integer(&out, "sonde_bars", SONDE_LESSON_VERSION);
  for (uint32_t i = 0; i < course->count; ++i) {
    sonde_lesson *lesson = &course->lesson[i];
    char print[20];
    if (lesson->bar.runs == 0) continue;
    snprintf(print, sizeof print, "%016llx", (unsigned long long)lesson->print);
    sonde_json_begin_object(&out, lesson->protocol.id);
    sonde_json_put_text(&out, "print", print);
    sonde_json_put_integer(&out, "runs", lesson->bar.runs);
    for (size_t k = 0; k < SONDE_COUNT_OF(FIGURE); ++k)
      sonde_json_put_real(&out, FIGURE[k].key, FIGURE[k].unit * *figure_of(&lesson->bar, k), 6);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_file_write(out.file, "\n", 1);
  return sonde_file_commit(out.file, error);
}

sonde_status sonde_course_read_bars(sonde_course *course, const char *path, sonde_error *error) {
  SONDE_ASSERT(course && path);
  char *text = NULL;
  size_t count;
  sonde_json *root = NULL;
  const sonde_json_source source = {.name = path};
  if (access(path, F_OK) != 0) return SONDE_OK;
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_json, &text, &count, error);
  if (!status) status = sonde_json_parse(text, count, &source, &root, error);
  if (!status &&
      sonde_json_as_number(sonde_json_member(root, "sonde_bars")) != SONDE_LESSON_VERSION)
    status = sonde_fail(error, SONDE_VERSION, "%s: expected \"sonde_bars\": %d", path,
                        SONDE_LESSON_VERSION);
  for (uint32_t i = 0; !status && i < course->count; ++i) {
    sonde_lesson *lesson = &course->lesson[i];
    char print[20];
    snprintf(print, sizeof print, "%016llx", (unsigned long long)lesson->print);
    const sonde_json *item = sonde_json_member(root, lesson->protocol.id);
    const char *of = sonde_json_as_text(sonde_json_member(item, "print"));
    if (!of || strcmp(of, print) != 0) continue; // measured on another lesson than this one
    sonde_bar bar;
    const double runs = sonde_json_as_number(sonde_json_member(item, "runs"));
    bool good = runs >= 2 && runs <= SONDE_BAR_RUNS;
    bar.runs = good ? (uint32_t)runs : 0;
    for (size_t k = 0; k < SONDE_COUNT_OF(FIGURE); ++k) {
      const double value = sonde_json_as_number(sonde_json_member(item, FIGURE[k].key));
      *figure_of(&bar, k) = value / FIGURE[k].unit;
      good = good && isfinite(value);
    }
    if (good)
      lesson->bar = bar;
    else
      status = sonde_fail(error, SONDE_FORMAT, "%s:%u: a bar needs runs (2 to %d) and its figures",
                          path, sonde_json_line(item), SONDE_BAR_RUNS);
  }
  sonde_json_free(root);
  sonde_free(text);
  return status;
}
