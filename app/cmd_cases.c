// sonde cases: the trainer's cases.
#include "exam_common.h"
#include "options.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "cases";
static const char *const THIGHS[] = {"bundled", "generated", "model", "leg"};

typedef struct options {
  const char *cases, *check, *output;
  long seed; // < 0: none
  int level;
  bool truth, json;
} options;

static const options DEFAULTS = {.seed = -1, .level = SONDE_CASE_EASY};

// In the order of sonde_case_level.
static const char *const LEVELS[] = {"first", "easy", "hard", NULL};

static const app_option TABLE[] = {
    OPT_TEXT(cases, "cases", "DIR", "cases from there; default: those that ship"),
    OPT_FLAG(truth, "truth", "list the diagnoses too"),
    OPT_TEXT(check, "check", "FILE",
             "read a case, make its thigh, and compare its truth with its pathology; a mistake is "
             "named with its line"),
    OPT_INTEGER(seed, "generate", "SEED", 0, 4294967295L,
                "draw a case; equal seeds and levels give equal files"),
    OPT_WORD(level, "level", "LEVEL", LEVELS, "of the drawn case"),
    OPT_TEXT(output, "o,output", "FILE", "where to write the drawn case"),
    OPT_JSON(json)};

static int check_options(void *from) {
  const options *a = from;
  const char *wrong = NULL;
  if (a->check && a->seed >= 0) wrong = "either --check or --generate";
  if (a->seed >= 0 && !a->output) wrong = "-o FILE with --generate";
  if (a->seed < 0 && a->output) wrong = "-o FILE only with --generate";
  return wrong ? app_usage_error(VERB, "expected %s", wrong) : APP_OK;
}

static int list(const options *a, const exam_library *library) {
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

// A case is good when it can be built: then the truth fits the pathology.
static int check(const options *a, const exam_library *library, const sonde_case *c,
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
  const sonde_vein_map *map = &setup.map;
  if (!a->json) {
    printf("%s: %s (%s), %s\n", file, c->id, sonde_case_level_name(c->level), c->diagnosis);
    for (uint32_t i = 0; i < map->segment_count; ++i)
      printf("  %-18s z %.0f to %.0f mm, %s\n", map->segment[i].name, 1e3 * map->segment[i].from_m,
             1e3 * map->segment[i].to_m,
             sonde_decision_name(sonde_case_truth(c, map->segment[i].name)));
  } else {
    app_json_begin();
    app_json_text("file", file);
    app_json_text("id", c->id);
    app_json_text("level", sonde_case_level_name(c->level));
    app_json_bool("thrombosis", c->thrombosis);
    app_json_text("diagnosis", c->diagnosis);
    app_json_real("vein_mm", 1e3 * map->length_m);
    app_json_object("segments");
    for (uint32_t i = 0; i < map->segment_count; ++i)
      app_json_text(map->segment[i].name,
                    sonde_decision_name(sonde_case_truth(c, map->segment[i].name)));
    app_json_close();
    app_json_end();
  }
  sonde_case_setup_clear(&setup);
  return APP_OK;
}

static int run(void *from) {
  const options *a = from;
  assert(!a->check || a->seed < 0);
  exam_library library = exam_library_find(a->cases, NULL);
  sonde_error error = {0};
  sonde_case c;
  if (a->seed >= 0) {
    sonde_case_generate((uint64_t)a->seed, (sonde_case_level)a->level, &c);
    return check(a, &library, &c, a->output, NULL);
  }
  if (!a->check) return list(a, &library);
  char directory[1100];
  const char *slash = strrchr(a->check, '/');
  snprintf(directory, sizeof directory, "%.*s", slash ? (int)(slash - a->check) : 1,
           slash ? a->check : ".");
  if (sonde_case_load(a->check, &c, &error)) return app_fail(VERB, &error);
  return check(a, &library, &c, a->check, directory);
}

const app_command cmd_cases = {
    .verb = "cases",
    .summary = "list, check and draw the cases of the trainer",
    .usage = "[--cases DIR] [--truth] [--json]\n--check FILE [--json]\n"
             "--generate SEED -o FILE [--level LEVEL] [--json]",
    .text =
        "Lists the cases of the trainer, or reads a case file, makes its thigh and compares its "
        "truth with its pathology, or draws a case and writes it. The format is in "
        "docs/trainer.md; examples in data/cases.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .check = check_options,
    .run = run};
