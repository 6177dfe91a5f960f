// sonde reconstruct: a volume from tracked frames, or each frame made again from the others.
#include "frames_common.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

static const char VERB[] = "reconstruct";

typedef struct options {
  const char *sequence, *output, *copy;
  frames_options frames;
  bool leave_one_out, raw, json;
  sonde_reconstruct_options volume;
  sonde_slicer_options slicer;
} options;

static void prepare(void *to) {
  options *o = to;
  o->volume = sonde_reconstruct_options_default();
  o->slicer = sonde_slicer_options_default();
}

static const char *const METHODS[] = {
    [SONDE_RECONSTRUCT_LINEAR] = "linear", [SONDE_RECONSTRUCT_NEAREST] = "nearest", NULL};

static const app_option TABLE[] = {
    OPT_ARGUMENT(
        sequence, "SEQUENCE",
        "tracked frames: .igs.mha, .igs.nrrd, .seq.nrrd or, as TUS-REC has them, .h5; 8-bit "
        "grey, raw or compressed"),
    OPT_OUTPUT(output, "o", "FILE",
               "the volume, .mha or .nrrd; voxels that no frame reaches are 0"),
    OPT_FLAG(leave_one_out, "leave-one-out",
             "make each frame with a neighbour on both sides again without it and compare: from "
             "the frames on both sides of each pixel, from the nearest frame, and as the mean of "
             "the frames before and after"),
    OPT_OUTPUT(copy, "copy", "FILE",
               "write the sequence again, .mha or .nrrd (three axes), or .seq.nrrd (four axes)"),
    OPT_REAL(volume.spacing_m, "spacing-mm", "S", 0.01, 100, 1e-3, "of the voxels"),
    OPT_WORD(volume.method, "method", "NAME", METHODS,
             "linear shares a pixel among eight voxels, nearest puts it into one"),
    OPT_REAL(volume.hole_fill_m, "hole-fill-mm", "D", 0, 10000, 1e-3,
             "longest gap to bridge, at most 100 spacings"),
    OPT_INTEGER(slicer.left_out_beside, "beside", "K", 0, 50,
                "with --leave-one-out: leave out K frames on either side as well"),
    OPT_FLAG(slicer.along_sweep, "along-sweep",
             "with --leave-one-out: join frames pixel to pixel, not across"),
    OPT_REAL(slicer.gap_m, "gap-mm", "D", 0.001, 1000, 1e-3,
             "with --leave-one-out: frames further apart are not joined"),
    FRAMES_OPTIONS(frames),
    OPT_FLAG(raw, "raw", "write without compression"),
    OPT_JSON(json)};

// The longest gap is at most 100 voxels: the default follows a fine spacing, a given one is
// refused.
static int check(void *from) {
  options *o = from;
  double most_m = 100 * o->volume.spacing_m;
  if (o->volume.hole_fill_m > most_m * (1 + 1e-12)) {
    if (app_option_given("hole-fill-mm"))
      return app_usage_error(VERB, "--hole-fill-mm expects a number from 0 to %g, got '%g'",
                             1e3 * most_m, 1e3 * o->volume.hole_fill_m);
    o->volume.hole_fill_m = most_m;
  }
  return APP_OK;
}

static void print_likeness(const char *name, const sonde_likeness *l) {
  printf("  %-22s %8.2f %8.2f %8.2f %8.4f %8.4f\n", name, l->rms_grey, l->mae_grey, l->psnr_db,
         l->ncc, l->ssim);
}

static void json_likeness(const char *prefix, const sonde_likeness *l) {
  const struct {
    const char *name;
    double value;
  } items[] = {{"rms_grey", l->rms_grey},
               {"mae_grey", l->mae_grey},
               {"psnr_db", l->psnr_db},
               {"ncc", l->ncc},
               {"ssim", l->ssim}};
  for (size_t i = 0; i < sizeof items / sizeof *items; ++i) {
    char key[64];
    snprintf(key, sizeof key, "%s%s", prefix, items[i].name);
    app_json_real(key, items[i].value);
  }
}

static void json_frames(const sonde_sequence *s, const sonde_located *l) {
  app_json("frames_in_file:%u frames_used:%u frames_invalid:%u frames_without_pose:%u world:%s",
           s->count, l->used, l->invalid, l->missing, l->world);
}

static void print_frames(const sonde_sequence *s, const sonde_located *l) {
  printf("frames        %8u of %u x %u pixels; used %u, INVALID %u, without pose %u; in %s\n",
         s->count, s->width, s->height, l->used, l->invalid, l->missing, l->world);
}

static sonde_status leave_one_out(const options *a, sonde_sequence *s, const sonde_located *located,
                                  sonde_error *error) {
  sonde_left_out r;
  sonde_pose_findings found;
  sonde_progress progress = app_progress();
  double start = app_seconds(CLOCK_MONOTONIC);
  sonde_status status =
      sonde_sequence_leave_one_out(s, &a->slicer, a->frames.refine_poses, &r, &progress, error);
  if (!status) status = frames_refine(&a->frames, SONDE_WHOLE_FILE, s, &found, error);
  app_progress_end();
  if (status) return status;
  if (!a->json) {
    print_frames(s, located);
    frames_show(&found, false);
    printf("left out      %8u frames one by one, %llu pixels, %.2f s\n", r.frames,
           (unsigned long long)r.krige.count, app_seconds(CLOCK_MONOTONIC) - start);
    printf("  %-22s %8s %8s %8s %8s %8s\n", "made from", "RMS", "MAE", "PSNR dB", "NCC", "SSIM");
    print_likeness(2 * r.along_sweep > r.frames ? "kriging, same pixel" : "kriging, across",
                   &r.place);
    print_likeness("kriging, any pose", &r.krige);
    print_likeness("frames on both sides", &r.bracket);
    print_likeness("nearest frame", &r.nearest);
    print_likeness("mean of neighbours", &r.neighbours);
    return SONDE_OK;
  }
  app_json_begin();
  app_json("frames:%u pixels:%lu", r.frames, r.krige.count);
  json_likeness("", &r.place);
  json_likeness("any_pose_", &r.krige);
  json_likeness("both_sides_", &r.bracket);
  json_likeness("nearest_", &r.nearest);
  json_likeness("neighbour_mean_", &r.neighbours);
  app_json("joined_along_sweep:%u left_out_beside:%u", r.along_sweep, a->slicer.left_out_beside);
  json_frames(s, located);
  frames_show(&found, true);
  app_json_end();
  return SONDE_OK;
}

static sonde_status volume(const options *a, sonde_sequence *s, const sonde_located *located,
                           sonde_error *error) {
  sonde_pose_findings found;
  sonde_volume v = {0};
  sonde_reconstruct_report r = {0};
  sonde_progress progress = app_progress();
  double start = app_seconds(CLOCK_MONOTONIC);
  sonde_status status = frames_refine(&a->frames, SONDE_WHOLE_FILE, s, &found, error);
  if (!status) status = sonde_reconstruct(s, &a->volume, &v, &r, &progress, error);
  app_progress_end();
  double seconds = app_seconds(CLOCK_MONOTONIC) - start;
  if (!status) status = sonde_volume_save(a->output, &v, !a->raw, error);
  if (!status && a->json) {
    app_json_begin();
    json_frames(s, located);
    frames_show(&found, true);
    app_json(
        "width:%u height:%u depth:%u spacing_mm:%g voxels:%lu touched:%lu bridged:%lu seconds:%g "
        "volume:%s",
        v.size[0], v.size[1], v.size[2], a->volume.spacing_m * 1e3, r.voxels, r.touched, r.bridged,
        seconds, a->output);
    app_json_end();
  } else if (!status) {
    print_frames(s, located);
    frames_show(&found, false);
    printf("volume        %u x %u x %u voxels of %g mm: %.1f %% touched, %.1f %% bridged, %.2f s\n",
           v.size[0], v.size[1], v.size[2], a->volume.spacing_m * 1e3,
           100.0 * (double)r.touched / (double)r.voxels,
           100.0 * (double)r.bridged / (double)r.voxels, seconds);
    printf("written       %s\n", a->output);
  }
  sonde_volume_clear(&v);
  return status;
}

static sonde_status copy(const options *a, sonde_error *error) {
  sonde_sequence s;
  sonde_status status = frames_read(a->sequence, &s, error);
  if (!status) status = sonde_sequence_save(a->copy, &s, !a->raw, error);
  if (!status && a->json) {
    app_json_begin();
    app_json("frames_in_file:%u sequence:%s", s.count, a->copy);
    app_json_end();
  } else if (!status) {
    printf("written       %u frames to %s\n", s.count, a->copy);
  }
  sonde_sequence_clear(&s);
  return status;
}

static int run(void *from) {
  const options *a = from;
  assert(a->sequence);
  sonde_error error = {0};
  sonde_sequence s = {0};
  sonde_located located = {0};
  sonde_status status =
      a->copy ? copy(a, &error) : frames_load(a->sequence, &a->frames, &s, &located, &error);
  if (!status && a->leave_one_out) status = leave_one_out(a, &s, &located, &error);
  if (!status && a->output) status = volume(a, &s, &located, &error);
  sonde_sequence_clear(&s);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_reconstruct = {
    .verb = "reconstruct",
    .summary = "make a volume from tracked image frames",
    .usage = "SEQUENCE (-o VOLUME | --leave-one-out | --copy FILE) [options]",
    .text = "Makes a volume from tracked frames, makes each frame again from the others, or writes "
            "the sequence again. Frames whose transform or image is INVALID are counted and left "
            "out.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .required = "SEQUENCE",
    .one_of = "o leave-one-out copy",
    .check = check,
    .run = run};
