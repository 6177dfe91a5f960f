// sonde reconstruct: a volume from tracked frames, or each frame made again from the others.
//
// read_arguments   command line
// parse_numbers    its numbers
// print_likeness   one line of the table
// leave_one_out    measures
// volume           reconstruction
#include "frames_common.h"

static const char VERB[] = "reconstruct";
static const char HELP[] =
    "usage: sonde reconstruct SEQUENCE (-o VOLUME | --leave-one-out | --copy FILE) [OPTIONS]\n"
    "\n"
    "Makes a volume from tracked frames (.igs.mha, .igs.nrrd, .seq.nrrd). Frames whose transform "
    "or\n"
    "image is INVALID are counted and left out.\n"
    "\n"
    "  -o FILE            the volume, .mha or .nrrd\n"
    "  --leave-one-out    make each frame again from the others and compare\n"
    "  --copy FILE        write the sequence again, .mha, .nrrd or .seq.nrrd\n"
    "  --spacing-mm S     of the voxels (0.01 to 100; default 0.5)\n"
    "  --method NAME      linear (default) or nearest: how a pixel goes into voxels\n"
    "  --hole-fill-mm D   longest gap to bridge (0 to 100 spacings; default 3)\n"
    "  --beside K         with --leave-one-out: leave out K frames on either side as well (0 to "
    "50)\n"
    "  --along-sweep      with --leave-one-out: join frames pixel to pixel, not across\n"
    "  --gap-mm D         with --leave-one-out: frames further apart are not joined; default "
    "10\n" FRAMES_HELP "  --raw              write without compression\n"
    "  --json             print one JSON object\n"
    "  --help             this text\n";

typedef struct arguments {
  const char *sequence, *output, *copy, *spacing, *method, *hole_fill, *gap, *beside;
  frames_options frames;
  bool along_sweep, leave_one_out, raw, json, help;
  sonde_reconstruct_options options;
  sonde_slicer_options slicer;
} arguments;

static bool parse_numbers(arguments *a) {
  static const char *const methods[] = {"linear", "nearest", NULL};
  double spacing_mm = 0.5, fill_mm = 3, gap_mm = 10;
  int method = 0;
  if (a->spacing && !app_parse_real(VERB, "--spacing-mm", a->spacing, 0.01, 100, &spacing_mm))
    return false;
  if (fill_mm > 100 * spacing_mm) fill_mm = 100 * spacing_mm;
  if (a->hole_fill &&
      !app_parse_real(VERB, "--hole-fill-mm", a->hole_fill, 0, 100 * spacing_mm, &fill_mm))
    return false;
  if (a->gap && !app_parse_real(VERB, "--gap-mm", a->gap, 0.001, 1000, &gap_mm)) return false;
  if (a->method && !app_parse_word(VERB, "--method", a->method, methods, &method)) return false;
  long beside = 0;
  if (a->beside && !app_parse_integer(VERB, "--beside", a->beside, 0, 50, &beside)) return false;
  a->slicer.left_out_beside = (uint32_t)beside;
  a->options.spacing_m = spacing_mm * 1e-3;
  a->options.hole_fill_m = fill_mm * 1e-3;
  a->options.method = method ? SONDE_RECONSTRUCT_NEAREST : SONDE_RECONSTRUCT_LINEAR;
  a->slicer.along_sweep = a->along_sweep;
  a->slicer.gap_m = gap_mm * 1e-3;
  return true;
}

// Returns -1 to go on, else the exit code.
static int read_arguments(int argc, char **argv, arguments *a) {
  const app_option options[] = {{"-o", &a->output, NULL},
                                {"--copy", &a->copy, NULL},
                                {"--spacing-mm", &a->spacing, NULL},
                                {"--method", &a->method, NULL},
                                {"--hole-fill-mm", &a->hole_fill, NULL},
                                {"--gap-mm", &a->gap, NULL},
                                {"--beside", &a->beside, NULL},
                                FRAMES_OPTION_LIST(a->frames),
                                {"--along-sweep", NULL, &a->along_sweep},
                                {"--leave-one-out", NULL, &a->leave_one_out},
                                {"--raw", NULL, &a->raw},
                                {"--json", NULL, &a->json},
                                {"--help", NULL, &a->help}};
  if (!app_take_options(VERB, argc, argv, options, sizeof options / sizeof *options, &a->sequence))
    return APP_BAD_INPUT;
  if (a->help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  a->options = sonde_reconstruct_options_default();
  a->slicer = sonde_slicer_options_default();
  if (!app_require(VERB, "SEQUENCE", a->sequence) || !parse_numbers(a)) return APP_BAD_INPUT;
  int ways = (a->output != NULL) + a->leave_one_out + (a->copy != NULL);
  if (ways != 1)
    return app_usage_error(VERB, "expected one of -o, --leave-one-out and --copy, got %d", ways);
  int unwritable = app_check_output(VERB, a->output ? a->output : a->copy);
  return unwritable ? unwritable : -1;
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
  app_json_integer("frames_in_file", s->count);
  app_json_integer("frames_used", l->used);
  app_json_integer("frames_invalid", l->invalid);
  app_json_integer("frames_without_pose", l->missing);
  app_json_text("world", l->world);
}

static void print_frames(const sonde_sequence *s, const sonde_located *l) {
  printf("frames        %8u of %u x %u pixels; used %u, INVALID %u, without pose %u; in %s\n",
         s->count, s->width, s->height, l->used, l->invalid, l->missing, l->world);
}

static sonde_status leave_one_out(const arguments *a, const sonde_sequence *s,
                                  const sonde_located *located, sonde_error *error) {
  sonde_left_out r;
  sonde_progress progress = app_progress();
  double start = app_seconds(CLOCK_MONOTONIC);
  sonde_status status = sonde_sequence_leave_one_out(s, &a->slicer, &r, &progress, error);
  app_progress_end();
  if (status) return status;
  if (!a->json) {
    print_frames(s, located);
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
  app_json_integer("frames", r.frames);
  app_json_integer("pixels", (long long)r.krige.count);
  json_likeness("", &r.place);
  json_likeness("any_pose_", &r.krige);
  json_likeness("both_sides_", &r.bracket);
  json_likeness("nearest_", &r.nearest);
  json_likeness("neighbour_mean_", &r.neighbours);
  app_json_integer("joined_along_sweep", r.along_sweep);
  app_json_integer("left_out_beside", a->slicer.left_out_beside);
  json_frames(s, located);
  app_json_end();
  return SONDE_OK;
}

static sonde_status volume(const arguments *a, const sonde_sequence *s,
                           const sonde_located *located, sonde_error *error) {
  sonde_volume v = {0};
  sonde_reconstruct_report r = {0};
  sonde_progress progress = app_progress();
  double start = app_seconds(CLOCK_MONOTONIC);
  sonde_status status = sonde_reconstruct(s, &a->options, &v, &r, &progress, error);
  app_progress_end();
  double seconds = app_seconds(CLOCK_MONOTONIC) - start;
  if (!status) status = sonde_volume_save(a->output, &v, !a->raw, error);
  if (!status && a->json) {
    app_json_begin();
    json_frames(s, located);
    app_json_integer("width", v.size[0]);
    app_json_integer("height", v.size[1]);
    app_json_integer("depth", v.size[2]);
    app_json_real("spacing_mm", a->options.spacing_m * 1e3);
    app_json_integer("voxels", (long long)r.voxels);
    app_json_integer("touched", (long long)r.touched);
    app_json_integer("bridged", (long long)r.bridged);
    app_json_real("seconds", seconds);
    app_json_text("volume", a->output);
    app_json_end();
  } else if (!status) {
    print_frames(s, located);
    printf("volume        %u x %u x %u voxels of %g mm: %.1f %% touched, %.1f %% bridged, %.2f s\n",
           v.size[0], v.size[1], v.size[2], a->options.spacing_m * 1e3,
           100.0 * (double)r.touched / (double)r.voxels,
           100.0 * (double)r.bridged / (double)r.voxels, seconds);
    printf("written       %s\n", a->output);
  }
  sonde_volume_clear(&v);
  return status;
}

static sonde_status copy(const arguments *a, sonde_error *error) {
  sonde_sequence s;
  sonde_status status = sonde_sequence_load(a->sequence, &s, error);
  if (!status) status = sonde_sequence_save(a->copy, &s, !a->raw, error);
  if (!status && a->json) {
    app_json_begin();
    app_json_integer("frames_in_file", s.count);
    app_json_text("sequence", a->copy);
    app_json_end();
  } else if (!status) {
    printf("written       %u frames to %s\n", s.count, a->copy);
  }
  sonde_sequence_clear(&s);
  return status;
}

int old_reconstruct(int argc, char **argv);
int old_reconstruct(int argc, char **argv) {
  arguments a = {0};
  int code = read_arguments(argc, argv, &a);
  if (code >= 0) return code;
  sonde_error error = {0};
  sonde_sequence s = {0};
  sonde_located located = {0};
  sonde_status status =
      a.copy ? copy(&a, &error) : frames_load(a.sequence, &a.frames, &s, &located, &error);
  if (!status && a.leave_one_out) status = leave_one_out(&a, &s, &located, &error);
  if (!status && a.output) status = volume(&a, &s, &located, &error);
  sonde_sequence_clear(&s);
  return status ? app_fail(VERB, &error) : APP_OK;
}
