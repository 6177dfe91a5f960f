// sonde cases: the trainer's cases.
// list:      those of a directory.
// check:     a file, and its truth against its thigh.
// generate:  a case by its seed.
#include "exam_common.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "cases";
static const char HELP[] =
    "usage: sonde cases [--cases DIR] [--json]\n"
    "       sonde cases --check FILE [--json]\n"
    "       sonde cases --generate SEED -o FILE [--level LEVEL] [--json]\n"
    "\n"
    "Lists the cases of the trainer, checks a case file against its thigh, or draws a case.\n"
    "The format is in docs/trainer.md.\n"
    "\n"
    "  --cases DIR       cases from there; default: those that ship\n"
    "  --check FILE      read a case, make its thigh, and compare its truth with its pathology\n"
    "  --generate SEED   draw a case (0 to 4294967295)\n"
    "  --level LEVEL     first, easy, hard; default easy\n"
    "  -o, --output FILE where to write it\n"
    "  --truth           list the diagnoses too\n"
    "  --json            print one JSON object\n"
    "  --help            this text\n";

static const char *const THIGHS[] = {"bundled", "generated", "model"};

typedef struct arguments {
  const char *cases, *check, *output;
  long seed, level; // seed < 0: none
  bool truth, json, help;
} arguments;

static bool read_level(const char *text, long *level) {
  for (*level = 0; *level < 3; ++*level)
    if (strcmp(sonde_case_level_name((sonde_case_level)*level), text) == 0) return true;
  app_usage_error(VERB, "--level expects first, easy or hard, got '%s'", text);
  return false;
}

static bool read_option(int option, arguments *a) {
  switch (option) {
  case 'C': a->cases = optarg; return true;
  case 'c': a->check = optarg; return true;
  case 'g': return app_parse_integer(VERB, "--generate", optarg, 0, 4294967295L, &a->seed);
  case 'l': return read_level(optarg, &a->level);
  case 'o': a->output = optarg; return true;
  case 't': return a->truth = true;
  case 'j': return a->json = true;
  case 'h': return a->help = true;
  default: return false;
  }
}

static bool read_arguments(int argc, char **argv, arguments *a) {
  static const struct option LONG[] = {{"cases", required_argument, NULL, 'C'},
                                       {"check", required_argument, NULL, 'c'},
                                       {"generate", required_argument, NULL, 'g'},
                                       {"level", required_argument, NULL, 'l'},
                                       {"output", required_argument, NULL, 'o'},
                                       {"truth", no_argument, NULL, 't'},
                                       {"json", no_argument, NULL, 'j'},
                                       {"help", no_argument, NULL, 'h'},
                                       {NULL, 0, NULL, 0}};
  for (int c; (c = getopt_long(argc, argv, "o:", LONG, NULL)) != -1;)
    if (!read_option(c, a)) return false;
  if (a->help) return true;
  const char *wrong = NULL;
  if (optind < argc) wrong = "no argument";
  if (a->check && a->seed >= 0) wrong = "either --check or --generate";
  if (a->seed >= 0 && !a->output) wrong = "-o FILE with --generate";
  if (a->seed < 0 && a->output) wrong = "-o FILE only with --generate";
  if (wrong) app_usage_error(VERB, "expected %s", wrong);
  return !wrong;
}

static int list(const arguments *a, const exam_library *library) {
  sonde_case *cases;
  uint32_t count;
  sonde_error error = {0};
  sonde_status status =
      library->cases[0] ? sonde_case_list(library->cases, &cases, &count, &error)
                        : app_error(&error, SONDE_NOT_FOUND, "the cases that ship were not found");
  if (status) return app_fail(VERB, &error);
  if (a->json)
    app_json_begin();
  else
    printf("%-22s %-6s %-10s %s\n", "id", "level", "thigh", "title");
  for (uint32_t i = 0; i < count; ++i) {
    const sonde_case *c = &cases[i];
    if (!a->json) {
      printf("%-22s %-6s %-10s %s\n", c->id, sonde_case_level_name(c->level), THIGHS[c->thigh],
             c->title);
      if (a->truth) printf("%-22s %s\n", "", c->diagnosis);
      continue;
    }
    app_json_object(c->id);
    app_json_text("title", c->title);
    app_json_text("level", sonde_case_level_name(c->level));
    app_json_text("thigh", THIGHS[c->thigh]);
    app_json_text("history", c->history);
    if (a->truth) app_json_text("diagnosis", c->diagnosis);
    app_json_close();
  }
  if (a->json) app_json_end();
  sonde_free(cases);
  return APP_OK;
}

static int tell(const arguments *a, const sonde_case *c, const sonde_vein_map *map,
                const char *file) {
  if (!a->json) {
    printf("%s: %s (%s), %s\n", file, c->id, sonde_case_level_name(c->level), c->diagnosis);
    for (uint32_t i = 0; i < map->segment_count; ++i)
      printf("  %-18s z %.0f to %.0f mm\n", map->segment[i].name, 1e3 * map->segment[i].from_m,
             1e3 * map->segment[i].to_m);
    return APP_OK;
  }
  app_json_begin();
  app_json_text("file", file);
  app_json_text("id", c->id);
  app_json_text("level", sonde_case_level_name(c->level));
  app_json_bool("thrombosis", c->thrombosis);
  app_json_text("diagnosis", c->diagnosis);
  app_json_real("vein_mm", 1e3 * map->length_m);
  app_json_object("segments");
  for (uint32_t i = 0; i < c->truth_count; ++i)
    app_json_text(c->truth_segment[i], sonde_decision_name(c->truth[i]));
  app_json_close();
  app_json_end();
  return APP_OK;
}

// A case is good when it can be built: then the truth fits the pathology.
static int check(const arguments *a, const exam_library *library, const sonde_case *c,
                 const char *file, const char *directory) {
  sonde_error error = {0};
  sonde_case_setup setup;
  const char *bundled = library->has_bundled ? library->bundled : NULL;
  app_progress_begin("building the case");
  sonde_status status = sonde_case_build(c, bundled, directory, &setup, &error);
  app_progress_end();
  if (status) return app_fail(VERB, &error);
  if (a->output && sonde_case_save(c, a->output, &error)) {
    sonde_case_setup_clear(&setup);
    return app_fail(VERB, &error);
  }
  int code = tell(a, c, &setup.map, file);
  sonde_case_setup_clear(&setup);
  return code;
}

int old_cases(int argc, char **argv);
int old_cases(int argc, char **argv) {
  arguments a = {.seed = -1, .level = SONDE_CASE_EASY};
  if (!read_arguments(argc, argv, &a)) return APP_BAD_INPUT;
  if (a.help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  exam_library library = exam_library_find(a.cases, NULL);
  sonde_error error = {0};
  sonde_case c;
  if (a.seed >= 0) {
    sonde_case_generate((uint64_t)a.seed, (sonde_case_level)a.level, &c);
    return check(&a, &library, &c, a.output, NULL);
  }
  if (!a.check) return list(&a, &library);
  char directory[1100];
  const char *slash = strrchr(a.check, '/');
  snprintf(directory, sizeof directory, "%.*s", slash ? (int)(slash - a.check) : 1,
           slash ? a.check : ".");
  if (sonde_case_load(a.check, &c, &error)) return app_fail(VERB, &error);
  return check(&a, &library, &c, a.check, directory);
}
