// sonde exam: a scripted operator examines a case.
// examine:    one exam.
// print_text, print_json: its result.
#include "exam_common.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "exam";
static const char HELP[] =
    "usage: sonde exam --case ID|FILE [options]\n"
    "       sonde exam --compare [options]\n"
    "       sonde exam --recover DIR [--json]\n"
    "\n"
    "Lets a scripted operator examine a case in lockstep and scores the exam. The operator sees\n"
    "what a trainee sees, never the truth. Formulas: docs/trainer.md.\n"
    "\n"
    "  --case ID|FILE    a case that ships (sonde cases lists them) or a case file\n"
    "  --protocol P      two_point, three_point, extended, or a file; default extended\n"
    "  --operator NAME   expert, novice, timid, forceful; default expert\n"
    "  --seed N          of the operator's hand (0 to 4294967295); default 1\n"
    "  --compare         every case by every operator, and each metric's separation\n"
    "  --seeds N         exams of each operator on each case when comparing (1 to 100); default 1\n"
    "  --recover DIR     of a directory of exams kept by sonde run: adds to its log the exams "
    "whose\n"
    "                    program was killed, makes missing results and reports from the journals\n"
    "  --solid           the inside by finite elements, as in real time; slower\n"
    "  --cases DIR       cases from there\n"
    "  --protocols DIR   protocols from there\n"
    "  -o, --output DIR  write results as JSON and the presses as CSV; made when absent\n"
    "  --json            print one JSON object\n"
    "  --help            this text\n";

typedef struct arguments {
  const char *patient, *protocol, *operator_name, *cases, *protocols, *directory, *recover;
  long seed, seeds;
  bool compare, solid, json, help;
} arguments;

static bool read_option(int option, arguments *a) {
  switch (option) {
  case 'c': a->patient = optarg; return true;
  case 'p': a->protocol = optarg; return true;
  case 'O': a->operator_name = optarg; return true;
  case 's': return app_parse_integer(VERB, "--seed", optarg, 0, 4294967295L, &a->seed);
  case 'n': return app_parse_integer(VERB, "--seeds", optarg, 1, 100, &a->seeds);
  case 'C': a->cases = optarg; return true;
  case 'P': a->protocols = optarg; return true;
  case 'o': a->directory = optarg; return true;
  case 'x': return a->compare = true;
  case 'S': return a->solid = true;
  case 'R': a->recover = optarg; return true;
  case 'j': return a->json = true;
  case 'h': return a->help = true;
  default: return false;
  }
}

static bool read_arguments(int argc, char **argv, arguments *a) {
  static const struct option LONG[] = {{"case", required_argument, NULL, 'c'},
                                       {"protocol", required_argument, NULL, 'p'},
                                       {"operator", required_argument, NULL, 'O'},
                                       {"seed", required_argument, NULL, 's'},
                                       {"seeds", required_argument, NULL, 'n'},
                                       {"cases", required_argument, NULL, 'C'},
                                       {"protocols", required_argument, NULL, 'P'},
                                       {"output", required_argument, NULL, 'o'},
                                       {"compare", no_argument, NULL, 'x'},
                                       {"solid", no_argument, NULL, 'S'},
                                       {"recover", required_argument, NULL, 'R'},
                                       {"json", no_argument, NULL, 'j'},
                                       {"help", no_argument, NULL, 'h'},
                                       {NULL, 0, NULL, 0}};
  for (int c; (c = getopt_long(argc, argv, "o:", LONG, NULL)) != -1;)
    if (!read_option(c, a)) return false;
  if (a->help) return true;
  if (optind < argc) {
    app_usage_error(VERB, "unexpected argument '%s'", argv[optind]);
    return false;
  }
  if (a->compare || a->patient || a->recover) return true;
  app_usage_error(VERB, "--case is missing");
  return false;
}

static void print_segments(const sonde_score *s) {
  printf("%-18s %6s %6s  %-13s %-13s\n", "segment", "places", "done", "decision", "truth");
  for (uint32_t i = 0; i < s->segment_count; ++i) {
    const sonde_segment_verdict *v = &s->segment[i];
    const char *decision = sonde_decision_name(v->decision);
    printf("%-18s %6u %6u  %-13s %-13s%s\n", v->name, v->points, v->done,
           decision[0] ? decision : "-", sonde_decision_name(v->truth),
           v->correct || !v->needed ? "" : " wrong");
  }
}

static void print_text(const sonde_case *patient, const sonde_score *s) {
  const sonde_metrics *m = &s->metrics;
  printf("%s: %s\n%s\nfound: %s\ntruth: %s\n\n", patient->id, patient->title, s->summary, s->asked,
         s->truth);
  print_segments(s);
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

static void print_json(const sonde_case *patient, const char *protocol, const char *name,
                       const sonde_score *s) {
  const sonde_metrics *m = &s->metrics;
  app_json_begin();
  app_json_text("case", patient->id);
  app_json_text("protocol", protocol);
  app_json_text("operator", name);
  app_json_real("score", s->score);
  app_json_bool("passed", s->passed);
  app_json_bool("correct", s->correct);
  app_json_text("diagnosis", s->asked);
  app_json_text("truth", s->truth);
#define JSON_PART(part, weight, title, text) app_json_real(#part, s->part);
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
  for (uint32_t i = 0; i < s->segment_count; ++i)
    app_json_text(s->segment[i].name, sonde_decision_name(s->segment[i].decision));
  app_json_close();
  app_json_end();
}

static int examine(const arguments *a, const exam_library *library,
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
  if (a->json)
    print_json(&patient, protocol->id, a->operator_name, &score);
  else
    print_text(&patient, &score);
  return APP_OK;
}

static bool known_operator(const char *name) {
  for (const char *const *known = sonde_operator_names(); *known; ++known)
    if (strcmp(*known, name) == 0) return true;
  app_usage_error(VERB, "no operator '%s', expected expert, novice, timid or forceful", name);
  return false;
}

int old_exam(int argc, char **argv);
int old_exam(int argc, char **argv) {
  arguments a = {.protocol = "extended", .operator_name = "expert", .seed = 1, .seeds = 1};
  if (!read_arguments(argc, argv, &a)) return APP_BAD_INPUT;
  if (a.help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  if (!known_operator(a.operator_name)) return APP_BAD_INPUT;
  exam_library library = exam_library_find(a.cases, a.protocols);
  if (a.recover) return exam_recover(&library, a.recover, a.json);
  sonde_exam_protocol protocol;
  sonde_error error = {0};
  sonde_status status = exam_find_protocol(&library, a.protocol, &protocol, &error);
  if (status) return app_fail(VERB, &error);
  if (!a.compare) return examine(&a, &library, &protocol);
  compare_options o = {&library, &protocol, a.patient, a.directory,
                       a.seed,   a.seeds,   a.json,    a.solid};
  return exam_compare(&o);
}
