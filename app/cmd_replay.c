// sonde replay: plays a recording again and compares hashes, or exports what it shows.
#include "app.h"
#include "replay_export.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <unistd.h>

static const char help[] =
    "usage: sonde replay RECORDING [OPTIONS]\n"
    "\n"
    "Plays the recorded inputs again, tick by tick, and compares the state with the recorded one.\n"
    "With an export it writes what the exam shows instead. Exit code 0: the same, or written;\n"
    "1: different, or failed; 2: the file or the model cannot be used.\n"
    "\n"
    "  --model MODEL     model file; default: the one the recording names, or the bundled thigh\n"
    "  --images          make every image again as well and compare their hash\n"
    "  --recover         take a file that was cut off (by a killed program or a full disk), as\n"
    "                    far as it is whole\n"
    "  --csv FILE        a row per image: time, pose, force, depth, area ratios; units in the "
    "head\n"
    "  --json-file FILE  the same as JSON, with the comments\n"
    "  --frames DIR      a PNG per image\n"
    "  --video FILE.mp4  a film of 25 pictures per second; needs the program ffmpeg\n"
    "  --from S, --to S  part of the exam to export, in seconds\n"
    "  --json            print one JSON object: ticks, hash, recorded_hash, same; of an export "
    "rows,\n"
    "                    pictures, film_frames\n"
    "  --help            this text\n";

typedef struct settings {
  const char *recording, *model;
  replay_export what;
  bool json, images, recover, ranged, help;
} settings;

static bool parse_option(int option, settings *s) {
  switch (option) {
  case 'm': s->model = optarg; return true;
  case 'j': s->json = true; return true;
  case 'h': s->help = true; return true;
  case 'i': s->images = true; return true;
  case 'r': s->recover = true; return true;
  case 'c': s->what.csv = optarg; return true;
  case 'J': s->what.json = optarg; return true;
  case 'v': s->what.video = optarg; return true;
  case 'd': s->what.frames = optarg; return true;
  case 'f':
    s->ranged = true;
    return app_parse_real("replay", "--from", optarg, 0, 1e6, &s->what.from_s);
  default: s->ranged = true; return app_parse_real("replay", "--to", optarg, 0, 1e6, &s->what.to_s);
  }
}

static bool exports(const settings *s) {
  return s->what.csv || s->what.json || s->what.video || s->what.frames;
}

// 0 when the command line is good.
static int parse(int argc, char **argv, settings *s) {
  static const struct option options[] = {
      {"model", required_argument, NULL, 'm'}, {"json", no_argument, NULL, 'j'},
      {"images", no_argument, NULL, 'i'},      {"recover", no_argument, NULL, 'r'},
      {"csv", required_argument, NULL, 'c'},   {"json-file", required_argument, NULL, 'J'},
      {"video", required_argument, NULL, 'v'}, {"frames", required_argument, NULL, 'd'},
      {"from", required_argument, NULL, 'f'},  {"to", required_argument, NULL, 't'},
      {"help", no_argument, NULL, 'h'},        {NULL, 0, NULL, 0}};
  int option;
  opterr = 0;
  s->what.to_s = 1e6;
  while ((option = getopt_long(argc, argv, ":hm:", options, NULL)) != -1) {
    if (option == ':') return app_usage_error("replay", "%s needs a value", argv[optind - 1]);
    if (option == '?') return app_usage_error("replay", "unknown option '%s'", argv[optind - 1]);
    if (!parse_option(option, s)) return APP_BAD_INPUT;
  }
  if (s->help) return APP_OK;
  if (optind + 1 != argc) return app_usage_error("replay", "expected one RECORDING");
  if (s->ranged && !exports(s))
    return app_usage_error("replay",
                           "--from and --to need --csv, --json-file, --frames or --video");
  if (s->images && exports(s))
    return app_usage_error("replay", "--images compares and exports nothing");
  if (!(s->what.from_s <= s->what.to_s))
    return app_usage_error("replay", "--from %g is behind --to %g", s->what.from_s, s->what.to_s);
  s->recording = s->what.recording = argv[optind];
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

static void print_result(const settings *s, const sonde_replay_result *r, bool ended) {
  char hash[20], recorded[20], image_hash[20];
  snprintf(hash, sizeof hash, "%016llx", (unsigned long long)r->hash);
  snprintf(recorded, sizeof recorded, "%016llx", (unsigned long long)r->recorded_hash);
  snprintf(image_hash, sizeof image_hash, "%016llx", (unsigned long long)r->image_hash);
  if (s->json) {
    app_json_begin();
    app_json_integer("ticks", (long long)r->ticks);
    app_json_text("hash", hash);
    app_json_text("recorded_hash", recorded);
    app_json_bool("ended", ended);
    app_json_bool("same", r->same);
    app_json_integer("checks", r->checks);
    app_json_integer("different_tick", (long long)r->different_tick);
    if (s->images) {
      app_json_integer("images", (long long)r->images);
      app_json_text("image_hash", image_hash);
      app_json_bool("same_images", r->same_images);
    }
    app_json_end();
    return;
  }
  printf("%llu ticks replayed: state hash %s, recorded %s: %s\n", (unsigned long long)r->ticks,
         hash, ended ? recorded : "none (the file was cut off)",
         r->same ? "the same" : "DIFFERENT");
  if (s->images)
    printf("%llu images made: hash %s: %s\n", (unsigned long long)r->images, image_hash,
           r->same_images ? "the same" : "DIFFERENT");
  if (r->checks || r->different_tick)
    printf("%u states on the way compared%s", r->checks, r->different_tick ? "; " : "\n");
  if (r->different_tick)
    printf("first difference at tick %llu\n", (unsigned long long)r->different_tick);
}

static void print_export(const settings *s) {
  const replay_export *w = &s->what;
  if (s->json) {
    app_json_begin();
    app_json_integer("rows", w->rows);
    app_json_integer("pictures", w->pictures);
    app_json_integer("film_frames", w->film_frames);
    app_json_end();
    return;
  }
  if (w->csv || w->json) printf("%u rows written\n", w->rows);
  if (w->frames) printf("%u pictures written to %s\n", w->pictures, w->frames);
  if (w->video) printf("%u frames of film written to %s\n", w->film_frames, w->video);
}

static sonde_status work(settings *s, sonde_player *player, sonde_replay_result *result,
                         sonde_error *error) {
  sonde_progress progress = app_progress();
  double end_s = sonde_player_info(player)->duration_s;
  sonde_status status;
  s->what.to_s = fmin(s->what.to_s, end_s);
  if (exports(s))
    status = replay_export_run(player, &s->what, &progress, error);
  else
    status = sonde_player_check(player, s->images, &progress, result, error);
  app_progress_end();
  return status;
}

int old_replay(int argc, char **argv);
int old_replay(int argc, char **argv) {
  settings s = {0};
  int code = parse(argc, argv, &s);
  if (code != APP_OK) return code;
  if (s.help) {
    fputs(help, stdout);
    return APP_OK;
  }
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_player *player = NULL;
  sonde_recording_info info = {0};
  sonde_replay_result result = {0};
  sonde_status status = sonde_recording_inspect(s.recording, s.recover, &info, &error);
  if (!status) {
    char path[4096];
    snprintf(path, sizeof path, "%s", info.model_path);
    choose_model(&s, path, sizeof path);
    status = sonde_model_load(path, &model, &error);
  }
  sonde_player_def def = {.path = s.recording, .model = model, .recover = s.recover};
  if (!status) status = sonde_player_open(&def, &player, &error);
  if (!status) status = work(&s, player, &result, &error);
  sonde_player_close(player);
  sonde_model_destroy(model);
  if (status) return app_fail("replay", &error);
  if (exports(&s)) {
    print_export(&s);
    return APP_OK;
  }
  print_result(&s, &result, info.ended);
  return result.same && (!s.images || result.same_images) ? APP_OK : APP_FAILED;
}
