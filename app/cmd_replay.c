// sonde replay: plays a recording again and compares hashes, or exports what it shows.
#include "exam_app_export.h"
#include "options.h"
#include "replay_export.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <unistd.h>

typedef struct options {
  const char *recording, *model, *cases;
  replay_export what;
  bool json, images, recover, progress;
} options;

static const options DEFAULTS = {.what.to_s = 1e6};

static const app_option TABLE[] = {
    OPT_ARGUMENT(recording, "RECORDING", NULL),
    OPT_TEXT(
        model, "m,model", "MODEL",
        "model file; default: the leg of the exam's case, the file that the recording names, or "
        "the bundled thigh"),
    OPT_TEXT(cases, "cases", "DIR",
             "where the files lie that the exam's case names; default: the cases that ship"),
    OPT_FLAG(images, "images",
             "make every image again as well and compare the hash of their pixels"),
    OPT_FLAG(recover, "recover",
             "take a file without an end, as a killed program leaves it, up to its last whole "
             "block, and one with inputs that a full disk lost, up to the loss"),
    OPT_TEXT(what.csv, "csv", "FILE",
             "a row per image: time, pose, force, depth, area ratios; units in the head"),
    OPT_TEXT(what.json, "json-file", "FILE",
             "the same as JSON, with the comments in recording.comments.json"),
    OPT_TEXT(what.frames, "frames", "DIR", "a PNG per image, named by its tick"),
    OPT_TEXT(what.video, "video", "FILE.mp4",
             "a film of 25 pictures per second; needs the program ffmpeg (Debian package ffmpeg)"),
    OPT_TEXT(
        what.sequence, "sequence", "FILE",
        "a tracked sequence for PLUS, 3D Slicer and sonde slice: the images with the probe's "
        "pose, time, force and area ratios; .igs.mha, .igs.nrrd or .seq.nrrd; .dcm: ultrasound "
        "multi-frame of DICOM, with one depth"),
    OPT_REAL(what.from_s, "from", "S", 0, 1e6, 1, "begin of the part to export, in seconds"),
    OPT_REAL(what.to_s, "to", "S", 0, 1e6, 1, "end of the part to export, in seconds"),
    OPT_FLAG(
        progress, "progress",
        "say on standard error how much of an export is done, a line for each per cent, as for a "
        "program that waits for it"),
    OPT_FLAG(
        json, "json",
        "print one JSON object: ticks, hash, recorded_hash, ended, same, checks, "
        "different_tick, with --images also images, image_hash, same_images; of an export rows, "
        "pictures, film_frames, tracked_frames")};

static bool exports(const options *s) {
  return s->what.csv || s->what.json || s->what.video || s->what.frames || s->what.sequence;
}

static int check(void *from) {
  options *s = from;
  if ((app_option_given("from") || app_option_given("to")) && !exports(s))
    return app_usage_error(
        "replay", "--from and --to need --csv, --json-file, --frames, --video or --sequence");
  if (s->images && exports(s))
    return app_usage_error("replay", "--images compares and exports nothing");
  if (!(s->what.from_s <= s->what.to_s))
    return app_usage_error("replay", "--from %g is behind --to %g", s->what.from_s, s->what.to_s);
  s->what.recording = s->recording;
  return APP_OK;
}

static void print_check(const options *s, const sonde_replay_result *result, bool ended) {
  char hash[20], recorded[20], image_hash[20];
  snprintf(hash, sizeof hash, "%016llx", (unsigned long long)result->hash);
  snprintf(recorded, sizeof recorded, "%016llx", (unsigned long long)result->recorded_hash);
  snprintf(image_hash, sizeof image_hash, "%016llx", (unsigned long long)result->image_hash);
  if (s->json) {
    app_json_begin();
    app_json("ticks:%lu hash:%s recorded_hash:%s ended:%hhd same:%hhd checks:%u different_tick:%lu",
             result->ticks, hash, recorded, ended, result->same, result->checks,
             result->different_tick);
    if (s->images) {
      app_json("images:%lu image_hash:%s same_images:%hhd", result->images, image_hash,
               result->same_images);
    }
    app_json_end();
  } else {
    printf("%llu ticks replayed: state hash %s, recorded %s: %s\n",
           (unsigned long long)result->ticks, hash,
           ended ? recorded : "none (the file was cut off)",
           result->same ? "the same" : "DIFFERENT");
    if (s->images)
      printf("%llu images made: hash %s: %s\n", (unsigned long long)result->images, image_hash,
             result->same_images ? "the same" : "DIFFERENT");
    if (result->checks || result->different_tick)
      printf("%u states on the way compared%s", result->checks,
             result->different_tick ? "; " : "\n");
    if (result->different_tick)
      printf("first difference at tick %llu\n", (unsigned long long)result->different_tick);
  }
}

static int run(void *from) {
  options *s = from;
  assert(s->recording);
  sonde_error error = {0};
  if (s->progress) app_progress_lines();
  sonde_player *player = NULL;
  sonde_recording_info info = {0};
  sonde_replay_result result = {0};
  sonde_status status = sonde_recording_inspect(s->recording, s->recover, &info, &error);

  // A recording may have moved to a machine that keeps the model elsewhere: then the bundled one is
  // tried, and the recorded checksum decides.
  char bundled[4096], searched[4096];
  const char *path = s->model ? s->model : info.model_path;
  if (!status && !s->model && access(path, R_OK) != 0 &&
      app_bundled_model(bundled, sizeof bundled, searched, sizeof searched))
    path = bundled;
  // An exam brings its case: the leg is made again as it was, with what the case has found in it.
  char cases[1100];
  bool known = false;
  sonde_case_setup leg = {0};
  const char *directory = s->cases;
  if (!directory && app_data_directory("cases", cases, sizeof cases)) directory = cases;
  if (!status)
    status = exam_part_leg(s->recording, path, s->model, directory, &leg, &known, &error);
  sonde_player_def def = {.path = s->recording,
                          .model = leg.model,
                          .findings = known ? &leg.findings : NULL,
                          .recover = s->recover};
  if (!status) status = sonde_player_open(&def, &player, &error);
  if (!status) {
    sonde_progress progress = app_progress();
    const double ends_s = sonde_player_info(player)->duration_s;
    s->what.to_s = fmin(s->what.to_s, ends_s);
    status = s->what.from_s > ends_s
                 ? app_error(&error, SONDE_ARGUMENT, "--from %g s, expected at most %g, the end",
                             s->what.from_s, ends_s)
             : exports(s) ? replay_export_run(player, &s->what, &progress, &error)
                          : sonde_player_check(player, s->images, &progress, &result, &error);
    app_progress_end();
  }
  sonde_player_close(player);
  sonde_case_setup_clear(&leg);
  if (status) return app_fail("replay", &error);
  const replay_export *w = &s->what;
  if (exports(s) && s->json) {
    app_json_begin();
    app_json("rows:%u pictures:%u film_frames:%u tracked_frames:%u", w->rows, w->pictures,
             w->film_frames, w->tracked);
    app_json_end();
    return APP_OK;
  }
  if (w->csv || w->json) printf("%u rows written\n", w->rows);
  if (w->frames) printf("%u pictures written to %s\n", w->pictures, w->frames);
  if (w->video) printf("%u frames of film written to %s\n", w->film_frames, w->video);
  if (w->sequence) printf("%u tracked frames written to %s\n", w->tracked, w->sequence);
  if (exports(s)) return APP_OK;
  print_check(s, &result, info.ended);
  return result.same && (!s->images || result.same_images) ? APP_OK : APP_FAILED;
}

const app_command cmd_replay = {
    .verb = "replay",
    .summary = "play a recording again and compare the state hash",
    .usage = "RECORDING [options]",
    .text = "Plays the recorded inputs again, tick by tick, and compares the state with the "
            "recorded one, at the end and at the hashes on the way. With an export it writes what "
            "the exam shows instead and compares nothing. Exit code 0: the same, or written; 1: "
            "different, or failed; 2: the file or the model cannot be used.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .required = "RECORDING",
    .check = check,
    .run = run};
