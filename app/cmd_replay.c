// sonde replay: plays a recording again and compares the state hash.
#include "app.h"

#include <getopt.h>
#include <stdio.h>
#include <unistd.h>

static const char help[] =
    "usage: sonde replay RECORDING [--model MODEL] [--json]\n"
    "\n"
    "Plays the recorded inputs again, tick by tick, and compares the final state with the "
    "recorded\n"
    "one. Exit code 0: the same; 1: different; 2: the file or the model cannot be used.\n"
    "\n"
    "  --model MODEL   model file; default: the one the recording names, or the bundled thigh\n"
    "  --json          print one JSON object: ticks, hash, recorded_hash, same\n"
    "  --help          this text\n";

typedef struct settings {
  const char *recording, *model;
  bool json, help;
} settings;

// 0 when the command line is good.
static int parse(int argc, char **argv, settings *s) {
  static const struct option options[] = {{"model", required_argument, NULL, 'm'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":hm:", options, NULL)) != -1) {
    if (option == 'm')
      s->model = optarg;
    else if (option == 'j')
      s->json = true;
    else if (option == 'h')
      s->help = true;
    else if (option == ':')
      return app_usage_error("replay", "%s needs a value", argv[optind - 1]);
    else
      return app_usage_error("replay", "unknown option '%s'", argv[optind - 1]);
  }
  if (s->help) return APP_OK;
  if (optind + 1 != argc) return app_usage_error("replay", "expected one RECORDING");
  s->recording = argv[optind];
  return APP_OK;
}

// A recording may have moved to a machine that keeps the model elsewhere: then the bundled one is
// tried, and the recorded checksum decides.
static void choose_model(const settings *s, char *path, size_t size) {
  char bundled[4096], searched[4096];
  if (s->model)
    snprintf(path, size, "%s", s->model);
  else if (access(path, R_OK) != 0 &&
           app_bundled_model(bundled, sizeof bundled, searched, sizeof searched))
    snprintf(path, size, "%s", bundled);
}

static void print_result(const settings *s, const sonde_replay_result *result) {
  char hash[20], recorded[20];
  snprintf(hash, sizeof hash, "%016llx", (unsigned long long)result->hash);
  snprintf(recorded, sizeof recorded, "%016llx", (unsigned long long)result->recorded_hash);
  if (!s->json) {
    printf("%llu ticks replayed: state hash %s, recorded %s: %s\n",
           (unsigned long long)result->ticks, hash, recorded,
           result->same ? "the same" : "DIFFERENT");
    return;
  }
  app_json_begin();
  app_json_integer("ticks", (long long)result->ticks);
  app_json_text("hash", hash);
  app_json_text("recorded_hash", recorded);
  app_json_bool("same", result->same);
  app_json_end();
}

int cmd_replay(int argc, char **argv) {
  settings s = {0};
  int code = parse(argc, argv, &s);
  if (code != APP_OK) return code;
  if (s.help) {
    fputs(help, stdout);
    return APP_OK;
  }
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_replay_result result = {0};
  char path[4096] = "";
  sonde_status status = sonde_replay_inspect(s.recording, path, sizeof path, NULL, &error);
  if (!status) {
    choose_model(&s, path, sizeof path);
    status = sonde_model_load(path, &model, &error);
  }
  if (!status) {
    sonde_progress progress = app_progress();
    status = sonde_replay_run(s.recording, model, &progress, &result, &error);
    app_progress_end();
  }
  sonde_model_destroy(model);
  if (status) return app_fail("replay", &error);
  print_result(&s, &result);
  return result.same ? APP_OK : APP_FAILED;
}
