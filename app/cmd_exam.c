// sonde exam: a scripted operator examines a case.
#include "exam_common.h"
#include "options.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "exam";

typedef struct options {
  const char *patient, *protocol, *operator_name, *cases, *protocols, *directory, *recover;
  long seed, seeds;
  bool compare, solid, json;
} options;

static const options DEFAULTS = {
    .protocol = "extended", .operator_name = "expert", .seed = 1, .seeds = 1};

static const app_option TABLE[] = {
    OPT_TEXT(patient, "case", "ID|FILE", "a case that ships, see sonde-cases(1), or a case file"),
    OPT_TEXT(protocol, "protocol", "P",
             "two_point, three_point, extended, whole_leg, or a protocol file"),
    OPT_TEXT(operator_name, "operator", "NAME", "expert, novice, timid or forceful"),
    OPT_INTEGER(seed, "seed", "N", 0, 4294967295L, "of the operator's hand"),
    OPT_FLAG(compare, "compare",
             "every case (or the one of --case) by every operator: a table of scores, the mean of "
             "each metric, and how well it tells the expert from each of the others (0.5: not at "
             "all; 0 or 1: always)"),
    OPT_INTEGER(seeds, "seeds", "N", 1, 100, "exams of each operator on each case when comparing"),
    OPT_TEXT(
        recover, "recover", "DIR",
        "of a directory in which sonde-run(1) keeps exams: adds the exams that its log lacks "
        "because their program was killed, with their score or as interrupted, and plays the "
        "journals of finished exams whose result or report is missing to make them again. Exams "
        "that run are left alone"),
    OPT_FLAG(solid, "solid",
             "in a thigh, the inside by finite elements, as always in a limb, instead of columns"),
    OPT_TEXT(cases, "cases", "DIR", "cases from there instead of those that ship"),
    OPT_TEXT(protocols, "protocols", "DIR", "protocols from there instead of those that ship"),
    OPT_TEXT(directory, "o,output", "DIR",
             "write each result as JSON and its presses as CSV into DIR; made when absent"),
    OPT_JSON(json)};

static int check(void *from) {
  const options *a = from;
  if (!a->compare && !a->patient && !a->recover) return app_usage_error(VERB, "--case is missing");
  for (const char *const *known = sonde_operator_names(); *known; ++known)
    if (strcmp(*known, a->operator_name) == 0) return APP_OK;
  return app_usage_error(VERB, "no operator '%s', expected expert, novice, timid or forceful",
                         a->operator_name);
}

static void print_text(const sonde_case *patient, const sonde_score *s) {
  const sonde_metrics *m = &s->metrics;
  printf("%s: %s\n%s\nfound: %s\ntruth: %s\n\n", patient->id, patient->title, s->summary, s->asked,
         s->truth);
  printf("%-18s %6s %6s  %-13s %-13s\n", "segment", "places", "done", "decision", "truth");
  for (uint32_t i = 0; i < s->segment_count; ++i) {
    const sonde_segment_verdict *v = &s->segment[i];
    const char *decision = sonde_decision_name(v->decision);
    if (v->kind != SONDE_SEGMENT_MAIN && !v->needed) continue;
    printf("%-18s %6u %6u  %-13s %-13s%s\n", v->name, v->points, v->done,
           decision[0] ? decision : "-", sonde_decision_name(v->truth),
           v->correct || !v->needed ? "" : " wrong");
  }
  printf("\nparts (0..1):");
#define PRINT_PART(name, weight, title, text) printf(" %s %.2f", #name, s->name);
  SONDE_SCORE_LIST(PRINT_PART)
#undef PRINT_PART
  printf("\ncoverage %.0f %%, largest gap %.0f mm, completeness %.2f\npresses:", 100 * m->coverage,
         1e3 * m->gap_m, m->completeness);
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k)
    printf(" %s %u", sonde_press_result_name((sonde_press_result)k), m->presses[k]);
  printf("\nforce: peak %.1f N, 95 %% below %.1f N\ntime %.0f s, path %.0f mm, smoothness %.1f\n",
         m->force_peak_n, m->force_p95_n, m->time_s, 1e3 * m->path_m, m->smoothness);
}

static int examine(const options *a, const exam_library *library,
                   const sonde_exam_protocol *protocol) {
  sonde_error error = {0};
  sonde_case patient;
  char directory[1100], json[1300], csv[1300];
  sonde_exam_def def = sonde_exam_def_default();
  if (exam_find_case(library, a->patient, &patient, directory, sizeof directory, &error))
    return app_fail(VERB, &error);
  if (a->directory && sonde_directory_make(a->directory, 0777, false, &error))
    return app_fail(VERB, &error);
  def.patient = &patient;
  def.protocol = protocol;
  def.operator_name = a->operator_name;
  def.seed = (uint64_t)a->seed;
  def.bundled = library->has_bundled ? library->bundled : NULL;
  def.directory = directory;
  def.solid = a->solid;
  if (a->directory) {
    snprintf(json, sizeof json, "%.1000s/%s-%s-%ld.json", a->directory, patient.id,
             a->operator_name, a->seed);
    snprintf(csv, sizeof csv, "%.1000s/%s-%s-%ld.csv", a->directory, patient.id, a->operator_name,
             a->seed);
    def.json_path = json;
    def.csv_path = csv;
  }
  sonde_score score;
  sonde_progress progress = app_progress();
  progress.report(0, "building the case", progress.user);
  sonde_status status = sonde_exam_run(&def, NULL, &progress, &score, &error);
  app_progress_end();
  if (status) return app_fail(VERB, &error);
  if (a->json) {
    const sonde_metrics *m = &score.metrics;
    app_json_begin();
    app_json_text("case", patient.id);
    app_json_text("protocol", protocol->id);
    app_json_text("operator", a->operator_name);
    app_json_real("score", score.score);
    app_json_bool("passed", score.passed);
    app_json_bool("correct", score.correct);
    app_json_text("diagnosis", score.asked);
    app_json_text("truth", score.truth);
#define JSON_PART(part, weight, title, text) app_json_real(#part, score.part);
    SONDE_SCORE_LIST(JSON_PART)
#undef JSON_PART
    app_json_real("gap_mm", 1e3 * m->gap_m);
    app_json_integer("places", m->points);
    app_json_integer("places_done", m->points_done);
    for (int k = 0; k < SONDE_PRESS_RESULTS; ++k)
      app_json_integer(sonde_press_result_name((sonde_press_result)k), m->presses[k]);
    app_json_real("force_peak_n", m->force_peak_n);
    app_json_real("force_p95_n", m->force_p95_n);
    app_json_real("time_s", m->time_s);
    app_json_real("path_mm", 1e3 * m->path_m);
    app_json_real("smoothness", m->smoothness);
    app_json_integer("taken_off", m->restores);
    app_json_object("segments");
    for (uint32_t i = 0; i < score.segment_count; ++i)
      app_json_text(score.segment[i].name, sonde_decision_name(score.segment[i].decision));
    app_json_close();
    app_json_end();
  } else
    print_text(&patient, &score);
  return APP_OK;
}

static int run(void *from) {
  const options *a = from;
  assert(a->protocol && a->operator_name);
  exam_library library = exam_library_find(a->cases, a->protocols);
  if (a->recover) return exam_recover(&library, a->recover, a->json);
  sonde_exam_protocol protocol;
  sonde_error error = {0};
  sonde_status status = exam_find_protocol(&library, a->protocol, &protocol, &error);
  if (status) return app_fail(VERB, &error);
  if (!a->compare) return examine(a, &library, &protocol);
  compare_options o = {&library, &protocol, a->patient, a->directory,
                       a->seed,  a->seeds,  a->json,    a->solid};
  return exam_compare(&o);
}

const app_command cmd_exam = {
    .verb = "exam",
    .summary = "let a scripted operator examine a case and score it",
    .usage = "--case ID|FILE [options]\n--compare [options]\n--recover DIR [--json]",
    .text =
        "Lets a scripted operator examine a case in lockstep and scores the exam as a person's "
        "is: the operator moves a probe over the thigh, presses, looks, and decides for every "
        "segment of the vein. The operator sees what a trainee sees, never the truth. Formulas: "
        "docs/trainer_theory.md.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .check = check,
    .run = run};
