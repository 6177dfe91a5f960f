// sonde dataset: a population of legs, pressed and drawn, with labels, for machine learning.
#include "dataset_hdf5.h"
#include "options.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "dataset";

typedef struct options {
  const char *plan, *directory, *shard, *check;
  long legs, seed; // -1: the plan's
  int format;
  uint32_t part, parts;
  bool show, json;
} options;

static const options DEFAULTS = {.legs = -1, .seed = -1, .part = 1, .parts = 1};

enum { TAR, FOLDER, HDF5 };
static const char *const FORMATS[] = {"tar", "folder", "hdf5", NULL};

static const app_option TABLE[] = {
    OPT_TEXT(plan, "plan", "YAML",
             "what the data set holds, see docs/dataset.md; default: the plan "
             "that --show-plan prints"),
    OPT_INTEGER(legs, "count", "N", 1, 1000000, "legs, instead of the plan's number"),
    OPT_INTEGER(seed, "seed", "S", 0, 4294967295L, "of all that is drawn, instead of the plan's"),
    OPT_TEXT(shard, "shard", "I/N",
             "make every N-th leg from the I-th: the work of one of N processes"),
    OPT_WORD(format, "format", "FORMAT", FORMATS,
             "a tar file for each leg (WebDataset), a folder of PNG, NPY and JSON files, or an "
             "HDF5 file, where the "
             "program was built with libhdf5"),
    OPT_TEXT(directory, "o,output", "DIR", "where to write; made when it is absent"),
    OPT_TEXT(check, "check", "DIR",
             "read a whole data set and compare every file with its SHA-256"),
    OPT_FLAG(show, "show-plan", "print the plan with all its keys, and make nothing"),
    OPT_JSON(json)};

static int check_options(void *from) {
  options *o = from;
  if ((o->directory != NULL) + (o->check != NULL) + o->show != 1)
    return app_usage_error(VERB, "expected one of -o DIR, --check DIR and --show-plan");
  if (o->check && (o->plan || o->shard || o->legs >= 0 || o->seed >= 0))
    return app_usage_error(VERB, "--check takes no plan, count, seed or shard");
  if (o->format == HDF5 && !dataset_hdf5())
    return app_usage_error(VERB, "this program was built without libhdf5, expected tar or folder");
  return app_shard(VERB, o->shard, &o->part, &o->parts);
}

static int run(void *from) {
  const options *o = from;
  assert(o->part >= 1 && o->part <= o->parts);
  sonde_error error = {0};
  if (o->check) {
    uint32_t files = 0;
    const sonde_progress reading = app_progress();
    if (sonde_dataset_verify(o->check, &reading, &files, &error)) return app_fail(VERB, &error);
    app_progress_end();
    if (!o->json) {
      printf("%s: %u files, each with its SHA-256\n", o->check, files);
      return APP_OK;
    }
    app_json_begin();
    app_json("directory:%s files:%u", o->check, files);
    app_json_end();
    return APP_OK;
  }
  sonde_dataset_plan plan = sonde_dataset_plan_default();
  sonde_status status = o->plan ? sonde_dataset_plan_load(o->plan, &plan, &error) : SONDE_OK;
  if (status) return app_fail(VERB, &error);
  if (o->legs >= 0) plan.legs = (uint32_t)o->legs;
  if (o->seed >= 0) plan.seed = (uint64_t)o->seed;
  if (o->show) {
    char *text = NULL;
    if (sonde_dataset_plan_text(&plan, &text, &error)) return app_fail(VERB, &error);
    fputs(text, stdout);
    sonde_free(text);
    return APP_OK;
  }
  char bundled[4096], searched[4096], scanners[4096];
  sonde_dataset_def def = sonde_dataset_def_default();
  def.plan = &plan, def.directory = o->directory;
  def.shard = o->part, def.shards = o->parts;
  def.folder = o->format == FOLDER;
  if (o->format == HDF5) def.format = dataset_hdf5();
  if (app_bundled_model(bundled, sizeof bundled, searched, sizeof searched)) def.bundled = bundled;
  if (app_data_directory("scanners", scanners, sizeof scanners)) def.scanners = scanners;
  const sonde_progress progress = app_progress();
  def.progress = &progress;
  sonde_dataset_count count;
  status = sonde_dataset_write(&def, &count, &error);
  app_progress_end();
  if (status) return app_fail(VERB, &error);
  if (o->json) {
    app_json_begin();
    app_json("directory:%s format:%s shard:%u shards:%u whole:%hhd", o->directory,
             FORMATS[o->format], o->part, o->parts, count.whole);
    app_json("legs:%u legs_made:%u legs_planned:%u frames:%u clot_frames:%u stopped_presses:%u "
             "bytes:%llu",
             count.legs, count.made, plan.legs, count.frames, count.clots, count.stopped,
             (unsigned long long)count.bytes);
    app_json_end();
    return APP_OK;
  }
  printf("%s: %u of %u legs (%u made now), %u frames, %u with a clot, %.1f MB\n", o->directory,
         count.legs, plan.legs, count.made, count.frames, count.clots, 1e-6 * (double)count.bytes);
  if (count.stopped > 0)
    printf("%u presses ended early: no equilibrium, or force out of reach\n", count.stopped);
  if (!count.whole) printf("not whole yet: run the other shards into the same directory\n");
  return APP_OK;
}

const app_command cmd_dataset = {
    .verb = "dataset",
    .summary = "write pictures with labels, forces and strain of many legs",
    .usage = "[--plan YAML] [--count N] [--seed S] [--shard I/N] [--format FORMAT] -o DIR\n"
             "--check DIR\n[--plan YAML] --show-plan",
    .text = "Writes a data set for machine learning: a population of legs drawn by a seed, pressed "
            "by an operator's hand and drawn by scanners; of every frame the picture, envelope, "
            "tissue, vessel, clot, displacement and strain of each pixel, force, pose, closure of "
            "the veins, settings and patient. Whole legs are kept: the same words again go on.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .check = check_options,
    .run = run};
