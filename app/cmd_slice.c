// sonde slice: a picture at any pose, straight from tracked frames or from a volume.
#include "frames_press.h"
#include "stack_figure.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char VERB[] = "slice";

typedef struct options {
  const char *input, *output, *method, *deviation;
  frames_options frames;
  press_options press;
  bool compare, json, volume;
  double pose[7], size_mm[2], frame; // frame NaN: a pose
  long hold_out, stack;              // -1, 0: not asked for
  double pixels[2];
  bool nearest; // of a volume
  sonde_slicer_options slicer;
} options;

static void prepare(void *to) {
  options *o = to;
  o->slicer = sonde_slicer_options_default();
  o->size_mm[0] = o->size_mm[1] = 40;
  o->pixels[0] = o->pixels[1] = 512;
  o->frame = o->pose[0] = NAN;
  o->hold_out = -1;
  o->press = (press_options){.probe = "linear",
                             .pathology = "healthy",
                             .site = -1,
                             .force_n = NAN,
                             .venous_pa = NAN,
                             .arterial_pa = NAN,
                             .vein_mm = {NAN, NAN}};
}

typedef struct work {
  sonde_sequence sequence;
  sonde_located located;
  sonde_pose_findings found;
  sonde_volume volume;
  sonde_slicer *slicer;
  sonde_image image;
  uint8_t *known;
  sonde_affine plane;
  uint64_t reached;
  double seconds;
  sonde_likeness likeness;
  bool compared;
  double deviation_grey, error_over_deviation; // root mean squares
  press_result pressed;
} work;

static const app_option TABLE[] = {
    OPT_ARGUMENT(input, "SEQUENCE|VOLUME",
                 "names that end in .igs.mha, .igs.nrrd, .seq.mha, .seq.nrrd, .h5 and .hdf5 are "
                 "sequences of "
                 "tracked frames, others volumes"),
    OPT_NUMBERS(pose, "pose", "X,Y,Z,QW,QX,QY,QZ", -INFINITY, INFINITY,
                "the probe's origin in mm and its rotation; the picture is its x-z "
                "plane, see docs/frames.md"),
    OPT_REAL(frame, "frame", "F", 0, 1e6, 1, "where frame F lies; 7.5 lies between frames 7 and 8"),
    OPT_INTEGER(hold_out, "hold-out", "N", 0, 1000000,
                "where frame N lies, made without it, and how like the two are"),
    OPT_OUTPUT(output, "o", "FILE", "the picture, PNG; black where nothing reaches"),
    OPT_FLAG(compare, "compare",
             "with --hold-out: the frame, the picture and their difference, grey level 128 + the "
             "difference, side by side"),
    OPT_INTEGER(
        stack, "stack", "K", 1, 1000,
        "with --frame or --hold-out: the picture framed in white among every K-th frame, in "
        "a parallel projection from the side; the way along the sweep is stretched"),
    OPT_TEXT(deviation, "deviation", "FILE",
             "of a sequence: also write how sure each pixel is, PNG, the expected error's standard "
             "deviation in quarters of a grey level; with --hold-out also what it is of the true "
             "error"),
    OPT_TEXT(method, "method", "NAME",
             "of a sequence both, nearest or krige: frames on both sides of a pixel, the nearest "
             "one, or two on either side weighted by how alike the frames are; of a volume linear "
             "or nearest; default both, or linear"),
    OPT_NUMBERS(size_mm, "size-mm", "W,H", 0.1, 1000, "of the picture with --pose"),
    OPT_NUMBERS(pixels, "pixels", "W,H", 2, 8192, "of the picture with --pose"),
    OPT_FLAG(slicer.along_sweep, "along-sweep", "join frames pixel to pixel instead of across"),
    OPT_REAL(slicer.gap_m, "gap-mm", "D", 0.001, 1000, 1e-3, "frames further apart are not joined"),
    OPT_REAL(slicer.reach_m, "reach-mm", "D", 0, 1000, 1e-3,
             "how far a frame speaks alone at the end of a sweep, where there is none beyond"),
    FRAMES_OPTIONS(frames),
    PRESS_OPTIONS(press),
    OPT_JSON(json)};

static int check(void *from) {
  static const char *const ENDS[] = {".igs.mha",  ".igs.nrrd", ".seq.mha",
                                     ".seq.nrrd", ".h5",       ".hdf5"};
  static const char *const METHODS[2][3] = {{"both", "nearest", "krige"}, {"linear", "nearest"}};
  options *o = from;
  bool posed = app_option_given("pose");
  double *q = o->pose + 3, norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (posed && !(fabs(norm - 1) < 1e-2))
    return app_usage_error(VERB, "--pose: the quaternion has length %g, expected 1", norm);
  for (int k = 0; posed && k < 4; ++k) q[k] /= norm;

  // A name with one of these ends is a sequence, any other a volume.
  size_t length = strlen(o->input);
  o->volume = true;
  for (size_t i = 0; i < sizeof ENDS / sizeof *ENDS; ++i) {
    size_t end = strlen(ENDS[i]);
    if (length >= end && strcmp(o->input + length - end, ENDS[i]) == 0) o->volume = false;
  }
  if (o->hold_out >= 0) o->frame = (double)o->hold_out;
  if (o->deviation && (o->volume || o->press.model))
    return app_usage_error(VERB, "--deviation needs a sequence of frames, without --press");
  if (o->volume && !posed)
    return app_usage_error(VERB, "--frame and --hold-out need a sequence; %s is read as a volume",
                           o->input);
  if (o->stack && (posed || o->compare))
    return app_usage_error(VERB, "--stack belongs to --frame or --hold-out, without --compare");
  bool sited = o->press.site >= 0, forced = !isnan(o->press.force_n);
  if ((o->press.model || sited || forced) && !(o->press.model && sited && forced))
    return app_usage_error(VERB, "--press MODEL, --site K and --force-n F belong together");
  if (o->press.model && (o->compare || o->stack))
    return app_usage_error(VERB, "--press does not go with --compare or --stack");

  // The method, of a volume or of a sequence.
  int method = 0;
  while (o->method && method < 3 - o->volume && strcmp(o->method, METHODS[o->volume][method]) != 0)
    method++;
  if (method == 3 - o->volume)
    return app_usage_error(VERB, "--method expects %s, got '%s'",
                           o->volume ? "linear or nearest" : "both, nearest or krige", o->method);
  o->nearest = method == 1;
  o->slicer.method = method == 2   ? SONDE_SLICE_KRIGE
                     : method == 1 ? SONDE_SLICE_NEAREST
                                   : SONDE_SLICE_BRACKET;
  return APP_OK;
}

static sonde_status make_image(work *w, uint32_t width, uint32_t height, sonde_error *error) {
  sonde_status status = sonde_image_create(width, height, &w->image, error);
  if (status) return status;
  w->known = calloc((size_t)width * height, 1);
  return w->known ? SONDE_OK : app_error(error, SONDE_MEMORY, "out of memory for the picture");
}

// A picture of the size asked for, in the x-z plane of the pose.
static sonde_status pose_image(const options *a, work *w, sonde_error *error) {
  const double *p = a->pose, *q = p + 3;
  sonde_pose pose = {{p[0] * 1e-3, p[1] * 1e-3, p[2] * 1e-3}, {q[0], q[1], q[2], q[3]}};
  sonde_status status = make_image(w, (uint32_t)a->pixels[0], (uint32_t)a->pixels[1], error);
  if (status) return status;
  w->image.width_m = a->size_mm[0] * 1e-3;
  w->image.height_m = a->size_mm[1] * 1e-3;
  w->plane = sonde_slice_plane(pose, &w->image);
  return SONDE_OK;
}

static sonde_status write_picture(const options *a, work *w, sonde_error *error) {
  sonde_status status = SONDE_OK;
  if (a->hold_out >= 0) {
    // How like the left-out frame and the picture are; with --compare also the picture of both:
    // real, made and 128 + real - made, two black columns between them; pixels out of reach are
    // black.
    const sonde_sequence *s = &w->sequence;
    uint32_t width = w->image.width, height = w->image.height, wide = 3 * width + 4;
    assert(a->hold_out >= 0 && width == s->clip[2] && height == s->clip[3]);
    uint8_t *real = malloc((size_t)width * height);
    sonde_image out = {0};
    if (!real) {
      status = app_error(error, SONDE_MEMORY, "out of memory for the frame");
    } else {
      // The used part of the frame.
      const uint8_t *from =
          s->pixels + ((size_t)a->hold_out * s->height + s->clip[1]) * s->width + s->clip[0];
      for (uint32_t row = 0; row < height; ++row)
        memcpy(real + (size_t)row * width, from + (size_t)row * s->width, width);
      status =
          sonde_image_likeness(real, w->image.pixels, w->known, width, height, &w->likeness, error);
      w->compared = !status;

      if (!status && a->compare) status = sonde_image_create(wide, height, &out, error);
      for (uint32_t row = 0; !status && a->compare && row < height; ++row)
        for (uint32_t x = 0; x < width; ++x) {
          size_t k = (size_t)row * width + x, to = (size_t)row * wide + x;
          int difference = 128 + real[k] - w->image.pixels[k];
          difference = difference < 0 ? 0 : difference > 255 ? 255 : difference;
          out.pixels[to] = real[k];
          out.pixels[to + width + 2] = w->image.pixels[k];
          out.pixels[to + 2 * width + 4] = w->known[k] ? (uint8_t)difference : 0;
        }
      if (!status && a->compare) status = sonde_image_save_png(&out, a->output, error);
      sonde_image_clear(&out);
      free(real);
    }
  }
  if (status || a->compare) return status;
  if (a->press.model) status = press_picture(&a->press, &w->image, w->known, &w->pressed, error);
  if (status) return status;
  if (a->stack)
    return stack_figure(&w->sequence, (uint32_t)a->stack, a->frame, &w->plane, &w->image, a->output,
                        error);
  return sonde_image_save_png(&w->image, a->output, error);
}

// How sure the picture is, by a slicer of its own; against the frame that was left out, errors over
// their deviations have a root mean square of 1 when the deviations are true.
static sonde_status write_deviation(const options *a, work *w, sonde_error *error) {
  const sonde_sequence *s = &w->sequence;
  const uint32_t width = w->image.width, height = w->image.height;
  sonde_slicer_options slicer = a->slicer;
  sonde_slicer *sure = NULL;
  sonde_image out = {0};
  slicer.deviation = true;
  if (a->hold_out >= 0) slicer.left_out = (uint32_t)a->hold_out;
  sonde_status status = sonde_slicer_create(s, &slicer, &sure, error);
  if (!status) status = sonde_image_create(width, height, &out, error);
  if (!status) {
    double squares = 0, ratios = 0, count = 0;
    (void)sonde_slicer_render(sure, &w->plane, &out, NULL);
    for (size_t k = 0; k < (size_t)width * height; ++k) {
      if (!w->known[k] || !out.pixels[k]) continue;
      const double deviation = out.pixels[k] / 4.0;
      squares += deviation * deviation, count += 1;
      if (a->hold_out < 0) continue;
      const size_t row = s->clip[1] + k / width, column = s->clip[0] + k % width;
      const double real = s->pixels[((size_t)a->hold_out * s->height + row) * s->width + column];
      const double off = (real - w->image.pixels[k]) / deviation;
      ratios += off * off;
    }
    w->deviation_grey = count > 0 ? sqrt(squares / count) : 0;
    w->error_over_deviation = a->hold_out >= 0 && count > 0 ? sqrt(ratios / count) : NAN;
    status = sonde_image_save_png(&out, a->deviation, error);
  }
  sonde_image_clear(&out);
  sonde_slicer_destroy(sure);
  return status;
}

static sonde_status slice_sequence(const options *a, work *w, sonde_error *error) {
  sonde_sequence *s = &w->sequence;
  sonde_status status = frames_load(a->input, &a->frames, s, &w->located, error);
  const uint32_t left_out = a->hold_out >= 0 ? (uint32_t)a->hold_out : SONDE_WHOLE_FILE;
  if (!status) status = frames_refine(&a->frames, left_out, s, &w->found, error);
  if (!status)
    status =
        isnan(a->frame) ? pose_image(a, w, error) : make_image(w, s->clip[2], s->clip[3], error);
  if (status) return status;
  if (!isnan(a->frame)) {
    // The plane and the size of the picture between two frames.
    uint32_t first = (uint32_t)a->frame, next = first + (a->frame > first);
    if (next >= s->count || !s->frames[first].used || !s->frames[next].used)
      return app_error(error, SONDE_ARGUMENT, "frame %g: expected one with a pose, from 0 to %u",
                       a->frame, s->count - 1);
    double t = a->frame - first;
    const sonde_affine *p = &s->frames[first].world_from_pixel;
    const sonde_affine *q = &s->frames[next].world_from_pixel;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 4; ++k) w->plane.m[i][k] = (1 - t) * p->m[i][k] + t * q->m[i][k];
    for (int i = 0; i < 3; ++i) {
      w->plane.m[i][3] += w->plane.m[i][0] * s->clip[0] + w->plane.m[i][1] * s->clip[1];
      w->image.width_m = hypot(w->image.width_m, w->plane.m[i][0] * s->clip[2]);
      w->image.height_m = hypot(w->image.height_m, w->plane.m[i][1] * s->clip[3]);
    }
  }
  sonde_slicer_options slicer = a->slicer;
  slicer.once = true;
  if (a->hold_out >= 0) slicer.left_out = (uint32_t)a->frame;
  if (!status) status = sonde_slicer_create(s, &slicer, &w->slicer, error);
  if (status) return status;
  double start = app_seconds(CLOCK_MONOTONIC);
  if (a->slicer.method == SONDE_SLICE_KRIGE && !isnan(a->frame))
    w->reached =
        sonde_slicer_render_place(w->slicer, a->frame, &w->plane, s->clip, &w->image, w->known);
  else
    w->reached = sonde_slicer_render(w->slicer, &w->plane, &w->image, w->known);
  w->seconds = app_seconds(CLOCK_MONOTONIC) - start;
  if (a->deviation) status = write_deviation(a, w, error);
  return status ? status : write_picture(a, w, error);
}

static int run(void *from) {
  const options *a = from;
  assert(a->input && a->output);
  work w = {0};
  sonde_error error = {0};
  app_progress_begin("slicing");
  sonde_status status = SONDE_OK;
  if (a->volume) {
    status = sonde_volume_load(a->input, &w.volume, &error);
    if (!status) status = pose_image(a, &w, &error);
    if (!status) {
      double start = app_seconds(CLOCK_MONOTONIC);
      w.reached = sonde_volume_slice(&w.volume, a->nearest, &w.plane, &w.image, w.known);
      w.seconds = app_seconds(CLOCK_MONOTONIC) - start;
      status = write_picture(a, &w, &error);
    }
  }
  if (!a->volume) status = slice_sequence(a, &w, &error);
  app_progress_end();
  if (!status && a->json) {
    double share = (double)w.reached / ((double)w.image.width * w.image.height);
    app_json_begin();
    app_json("width:%u height:%u width_mm:%g height_mm:%g reached:%g slice_ms:%g", w.image.width,
             w.image.height, w.image.width_m * 1e3, w.image.height_m * 1e3, share, w.seconds * 1e3);
    if (!a->volume) {
      app_json("frames_used:%u world:%s", w.located.used, w.located.world);
      frames_show(&w.found, true);
    }
    if (w.compared) {
      app_json("rms_grey:%g mae_grey:%g psnr_db:%g ncc:%g ssim:%g", w.likeness.rms_grey,
               w.likeness.mae_grey, w.likeness.psnr_db, w.likeness.ncc, w.likeness.ssim);
    }
    if (a->deviation)
      app_json("deviation_grey:%g error_over_deviation:%g", w.deviation_grey,
               w.error_over_deviation);
    if (a->press.model) {
      app_json("force_n:%g penetration_mm:%g vein_area_ratio:%g artery_area_ratio:%g",
               w.pressed.force_n, w.pressed.depth_m * 1e3, w.pressed.vein_area_ratio,
               w.pressed.artery_area_ratio);
    }
    app_json_text("image", a->output);
    app_json_end();
  }
  if (!status && !a->json) {
    double share = (double)w.reached / ((double)w.image.width * w.image.height);
    printf("picture       %u x %u pixels, %.1f x %.1f mm, %.1f %% reached, %.2f ms\n",
           w.image.width, w.image.height, w.image.width_m * 1e3, w.image.height_m * 1e3,
           100 * share, w.seconds * 1e3);
    frames_show(&w.found, false);
    if (w.compared)
      printf("against real  RMS %.2f, MAE %.2f grey levels, PSNR %.2f dB, NCC %.4f, SSIM %.4f\n",
             w.likeness.rms_grey, w.likeness.mae_grey, w.likeness.psnr_db, w.likeness.ncc,
             w.likeness.ssim);
    if (a->deviation) printf("expected error %.2f grey levels", w.deviation_grey);
    if (a->deviation && a->hold_out >= 0)
      printf(", the true one %.2f times as large", w.error_over_deviation);
    if (a->deviation) printf("\n");
    if (a->press.model)
      printf(
          "pressed       %.2f N at %.2f mm, vein %.1f %% and artery %.1f %% of their rest area\n",
          w.pressed.force_n, w.pressed.depth_m * 1e3, 100 * w.pressed.vein_area_ratio,
          100 * w.pressed.artery_area_ratio);
    printf("written       %s\n", a->output);
  }
  sonde_slicer_destroy(w.slicer);
  sonde_image_clear(&w.image);
  sonde_sequence_clear(&w.sequence);
  sonde_volume_clear(&w.volume);
  free(w.known);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_slice = {
    .verb = "slice",
    .summary = "make a picture at any pose from tracked frames or a volume",
    .usage =
        "SEQUENCE (--pose X,Y,Z,QW,QX,QY,QZ | --frame F | --hold-out N) -o IMAGE.png [options]\n"
        "VOLUME --pose X,Y,Z,QW,QX,QY,QZ -o IMAGE.png [options]",
    .text = "Writes the picture of a plane: of a sequence each pixel is interpolated between the "
            "nearest tracked frames on both sides of it, weighted by distance, without a volume in "
            "between; or of a volume.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .required = "SEQUENCE|VOLUME o",
    .one_of = "pose frame hold-out",
    .needs = "compare>hold-out probe>press case>press venous-mmhg>press arterial-mmhg>press "
             "vein-at>press",
    .check = check,
    .run = run};
