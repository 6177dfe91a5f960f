// sonde slice: a picture at any pose, straight from tracked frames or from a volume.
//
// read_arguments    command line
// parse_numbers     its numbers
// pose_plane        picture of a pose
// between_frames    picture at a fractional frame number
// beside            three pictures next to each other
// compare           held-out frame, made frame, difference
// used_part         pixels of a frame
// slice_sequence, slice_volume
#include "frames_press.h"
#include "stack_figure.h"

#include <math.h>
#include <stdlib.h>

static const char VERB[] = "slice";
static const char HELP[] =
    "usage: sonde slice SEQUENCE (--pose P | --frame F | --hold-out N) -o IMAGE.png [OPTIONS]\n"
    "       sonde slice VOLUME --pose P -o IMAGE.png [OPTIONS]\n"
    "\n"
    "Writes the picture of a plane, made from the tracked frames on both sides of each pixel or "
    "from\n"
    "a volume. Names that end in .igs.mha, .igs.nrrd, .seq.mha and .seq.nrrd are sequences.\n"
    "\n"
    "  --pose P           X,Y,Z,QW,QX,QY,QZ: the probe's origin in mm and its rotation; the "
    "picture\n"
    "                     is its x-z plane, see docs/frames.md\n"
    "  --frame F          where frame F lies; 7.5 lies between frames 7 and 8\n"
    "  --hold-out N       where frame N lies, made without it\n"
    "  -o FILE            the picture, PNG\n"
    "  --compare          with --hold-out: the frame, the picture and their difference, grey "
    "level\n"
    "                     128 + the difference, side by side\n"
    "  --stack K          with --frame or --hold-out: the picture framed in white among every "
    "K-th\n"
    "                     frame, seen from the side\n"
    "  --method NAME      both (default), nearest or krige: frames on both sides, the nearest one, "
    "or two\n"
    "                     on either side weighted by how alike the frames are;\n"
    "                     of a volume linear (default) or nearest\n"
    "  --size-mm W,H      of the picture with --pose (default 40,40)\n"
    "  --pixels W,H       of the picture with --pose (default 512,512)\n"
    "  --along-sweep      join frames pixel to pixel instead of across\n"
    "  --gap-mm D         frames further apart are not joined (default 10)\n"
    "  --reach-mm D       how far a frame speaks alone at the end of a sweep (default "
    "1)\n" FRAMES_HELP
    "  --press MODEL      deform the picture as that thigh is deformed; its top lies on the skin\n"
    "  --site K           with --press: number of the site\n"
    "  --force-n F        with --press: settled force (0.01 to 200)\n"
    "  --probe NAME       with --press: as of sonde press; default linear\n"
    "  --case NAME        with --press: as of sonde press; default healthy\n"
    "  --venous-mmhg P    with --press: pressure in the vein; default of the case\n"
    "  --arterial-mmhg P  with --press: pressure in the artery; default of the case\n"
    "  --vein-at X,Z      with --press: where the vein is in the picture, mm from the middle of "
    "its\n"
    "                     top; default where the model has it\n"
    "  --json             print one JSON object\n"
    "  --help             this text\n";

typedef struct arguments {
  const char *input, *output, *pose, *frame, *hold_out, *method, *size, *pixels, *gap, *reach;
  const char *stack;
  frames_options frames;
  press_options press;
  bool compare, along_sweep, json, help, volume;
  double position_mm[3], quaternion[4], size_mm[2], frame_number;
  uint32_t width, height;
  long stack_step;
  int method_index;
  sonde_slicer_options options;
} arguments;

typedef struct work {
  sonde_sequence sequence;
  sonde_located located;
  sonde_volume volume;
  sonde_slicer *slicer;
  sonde_image image;
  uint8_t *known;
  sonde_affine plane;
  uint64_t reached;
  double seconds;
  sonde_likeness likeness;
  bool compared;
  press_result pressed;
} work;

static bool parse_pose(arguments *a) {
  double v[7];
  if (!frames_numbers(a->pose, 7, ',', v)) {
    app_usage_error(VERB, "--pose expects X,Y,Z,QW,QX,QY,QZ, got '%s'", a->pose);
    return false;
  }
  double norm = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  if (!(fabs(norm - 1) < 1e-2)) {
    app_usage_error(VERB, "--pose: the quaternion has length %g, expected 1", norm);
    return false;
  }
  for (int k = 0; k < 3; ++k) a->position_mm[k] = v[k];
  for (int k = 0; k < 4; ++k) a->quaternion[k] = v[3 + k] / norm;
  return true;
}

static bool parse_pair(const char *option, const char *text, double low, double high,
                       double value[2]) {
  if (!text) return true;
  if (frames_numbers(text, 2, ',', value) && value[0] >= low && value[0] <= high &&
      value[1] >= low && value[1] <= high)
    return true;
  app_usage_error(VERB, "%s expects W,H from %g to %g, got '%s'", option, low, high, text);
  return false;
}

static bool parse_numbers(arguments *a) {
  static const char *const ways[] = {"both", "nearest", "krige", NULL};
  static const char *const voxels[] = {"linear", "nearest", NULL};
  double pixels[2] = {512, 512}, gap_mm = 10, reach_mm = 1;
  a->size_mm[0] = a->size_mm[1] = 40;
  if ((a->pose && !parse_pose(a)) || !parse_pair("--size-mm", a->size, 0.1, 1000, a->size_mm) ||
      !parse_pair("--pixels", a->pixels, 2, 8192, pixels))
    return false;
  if (a->gap && !app_parse_real(VERB, "--gap-mm", a->gap, 0.001, 1000, &gap_mm)) return false;
  if (a->reach && !app_parse_real(VERB, "--reach-mm", a->reach, 0, 1000, &reach_mm)) return false;
  if (a->frame && !app_parse_real(VERB, "--frame", a->frame, 0, 1e6, &a->frame_number))
    return false;
  long frame = 0;
  if (a->hold_out && !app_parse_integer(VERB, "--hold-out", a->hold_out, 0, 1000000, &frame))
    return false;
  if (a->hold_out) a->frame_number = (double)frame;
  if (a->stack && !app_parse_integer(VERB, "--stack", a->stack, 1, 1000, &a->stack_step))
    return false;
  if (a->method &&
      !app_parse_word(VERB, "--method", a->method, a->volume ? voxels : ways, &a->method_index))
    return false;
  a->width = (uint32_t)pixels[0], a->height = (uint32_t)pixels[1];
  a->options.gap_m = gap_mm * 1e-3, a->options.reach_m = reach_mm * 1e-3;
  a->options.along_sweep = a->along_sweep;
  static const sonde_slice_method methods[] = {SONDE_SLICE_BRACKET, SONDE_SLICE_NEAREST,
                                               SONDE_SLICE_KRIGE};
  a->options.method = methods[a->method_index];
  return true;
}

static bool is_sequence(const char *path) {
  static const char *const ends[] = {".igs.mha", ".igs.nrrd", ".seq.mha", ".seq.nrrd"};
  size_t length = strlen(path);
  for (size_t i = 0; i < sizeof ends / sizeof *ends; ++i) {
    size_t end = strlen(ends[i]);
    if (length >= end && strcmp(path + length - end, ends[i]) == 0) return true;
  }
  return false;
}

// Returns -1 to go on, else the exit code.
static int check(arguments *a) {
  if (!app_require(VERB, "SEQUENCE or VOLUME", a->input) || !app_require(VERB, "-o", a->output))
    return APP_BAD_INPUT;
  a->volume = !is_sequence(a->input);
  int ways = (a->pose != NULL) + (a->frame != NULL) + (a->hold_out != NULL);
  if (ways != 1)
    return app_usage_error(VERB, "expected one of --pose, --frame and --hold-out, got %d", ways);
  if (a->volume && !a->pose)
    return app_usage_error(VERB, "--frame and --hold-out need a sequence; %s is read as a volume",
                           a->input);
  if (a->compare && !a->hold_out) return app_usage_error(VERB, "--compare belongs to --hold-out");
  if (a->stack && (a->pose || a->compare))
    return app_usage_error(VERB, "--stack belongs to --frame or --hold-out, without --compare");
  if (a->press.model && (a->compare || a->stack))
    return app_usage_error(VERB, "--press does not go with --compare or --stack");
  if (!press_check(VERB, &a->press) || !parse_numbers(a)) return APP_BAD_INPUT;
  int unwritable = app_check_output(VERB, a->output);
  return unwritable ? unwritable : -1;
}

static int read_arguments(int argc, char **argv, arguments *a) {
  const app_option options[] = {
      {"--pose", &a->pose, NULL},         {"--frame", &a->frame, NULL},
      {"--hold-out", &a->hold_out, NULL}, {"-o", &a->output, NULL},
      {"--method", &a->method, NULL},     {"--size-mm", &a->size, NULL},
      {"--pixels", &a->pixels, NULL},     {"--gap-mm", &a->gap, NULL},
      {"--reach-mm", &a->reach, NULL},    {"--stack", &a->stack, NULL},
      FRAMES_OPTION_LIST(a->frames),      PRESS_OPTION_LIST(a->press),
      {"--compare", NULL, &a->compare},   {"--along-sweep", NULL, &a->along_sweep},
      {"--json", NULL, &a->json},         {"--help", NULL, &a->help}};
  a->options = sonde_slicer_options_default();
  if (!app_take_options(VERB, argc, argv, options, sizeof options / sizeof *options, &a->input))
    return APP_BAD_INPUT;
  if (!a->help) return check(a);
  fputs(HELP, stdout);
  return APP_OK;
}

static sonde_status make_image(work *w, uint32_t width, uint32_t height, sonde_error *error) {
  sonde_status status = sonde_image_create(width, height, &w->image, error);
  if (status) return status;
  w->known = calloc((size_t)width * height, 1);
  return w->known ? SONDE_OK : frames_fail(error, SONDE_MEMORY, "out of memory for the picture");
}

static void pose_plane(const arguments *a, work *w) {
  const double *p = a->position_mm, *q = a->quaternion;
  sonde_pose pose = {{p[0] * 1e-3, p[1] * 1e-3, p[2] * 1e-3}, {q[0], q[1], q[2], q[3]}};
  w->image.width_m = a->size_mm[0] * 1e-3;
  w->image.height_m = a->size_mm[1] * 1e-3;
  w->plane = sonde_slice_plane(pose, &w->image);
}

// Plane of the used part that moves evenly from one frame to the next.
static sonde_status between_frames(const arguments *a, work *w, sonde_error *error) {
  const sonde_sequence *s = &w->sequence;
  uint32_t first = (uint32_t)a->frame_number, next = first + (a->frame_number > first);
  if (next >= s->count || !s->frames[first].used || !s->frames[next].used)
    return frames_fail(error, SONDE_ARGUMENT, "frame %g: expected one with a pose, from 0 to %u",
                       a->frame_number, s->count - 1);
  double t = a->frame_number - first;
  const sonde_affine *p = &s->frames[first].world_from_pixel;
  const sonde_affine *q = &s->frames[next].world_from_pixel;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 4; ++k) w->plane.m[i][k] = (1 - t) * p->m[i][k] + t * q->m[i][k];
  for (int i = 0; i < 3; ++i) {
    w->plane.m[i][3] += w->plane.m[i][0] * s->clip[0] + w->plane.m[i][1] * s->clip[1];
    w->image.width_m = hypot(w->image.width_m, w->plane.m[i][0] * s->clip[2]);
    w->image.height_m = hypot(w->image.height_m, w->plane.m[i][1] * s->clip[3]);
  }
  return SONDE_OK;
}

// Real, made and 128 + real - made, two black columns between them; pixels out of reach are black.
static sonde_status beside(const work *w, const uint8_t *real, const char *path,
                           sonde_error *error) {
  uint32_t width = w->image.width, height = w->image.height, wide = 3 * width + 4;
  sonde_image out;
  sonde_status status = sonde_image_create(wide, height, &out, error);
  if (status) return status;
  for (uint32_t row = 0; row < height; ++row)
    for (uint32_t x = 0; x < width; ++x) {
      size_t from = (size_t)row * width + x, to = (size_t)row * wide + x;
      int difference = 128 + real[from] - w->image.pixels[from];
      out.pixels[to] = real[from];
      out.pixels[to + width + 2] = w->image.pixels[from];
      out.pixels[to + 2 * width + 4] = !w->known[from] ? 0
                                                       : (uint8_t)(difference < 0     ? 0
                                                                   : difference > 255 ? 255
                                                                                      : difference);
    }
  status = sonde_image_save_png(&out, path, error);
  sonde_image_clear(&out);
  return status;
}

// Copy of the used part of a frame, freed by the caller.
static uint8_t *used_part(const sonde_sequence *s, size_t frame, sonde_error *error) {
  const uint8_t *from = s->pixels + (frame * s->height + s->clip[1]) * s->width + s->clip[0];
  uint8_t *part = malloc((size_t)s->clip[2] * s->clip[3]);
  if (!part) frames_fail(error, SONDE_MEMORY, "out of memory for the frame");
  for (uint32_t row = 0; part && row < s->clip[3]; ++row)
    memcpy(part + (size_t)row * s->clip[2], from + (size_t)row * s->width, s->clip[2]);
  return part;
}

static sonde_status write_picture(const arguments *a, work *w, sonde_error *error) {
  const sonde_sequence *s = &w->sequence;
  if (a->hold_out) {
    uint8_t *real = used_part(s, (size_t)a->frame_number, error);
    if (!real) return error->status;
    sonde_status status = sonde_image_likeness(real, w->image.pixels, w->known, w->image.width,
                                               w->image.height, &w->likeness, error);
    w->compared = !status;
    if (!status && a->compare) status = beside(w, real, a->output, error);
    free(real);
    if (status || a->compare) return status;
  }
  if (a->press.model) {
    sonde_status status = press_picture(VERB, &a->press, &w->image, w->known, &w->pressed, error);
    if (status) return status;
  }
  if (a->stack)
    return stack_figure(s, (uint32_t)a->stack_step, a->frame_number, &w->plane, &w->image,
                        a->output, error);
  return sonde_image_save_png(&w->image, a->output, error);
}

static sonde_status slice_sequence(const arguments *a, work *w, sonde_error *error) {
  sonde_sequence *s = &w->sequence;
  sonde_status status = frames_load(a->input, &a->frames, s, &w->located, error);
  if (!status)
    status = a->pose ? make_image(w, a->width, a->height, error)
                     : make_image(w, s->clip[2], s->clip[3], error);
  if (status) return status;
  if (a->pose)
    pose_plane(a, w);
  else
    status = between_frames(a, w, error);
  sonde_slicer_options options = a->options;
  options.once = true;
  if (a->hold_out) options.left_out = (uint32_t)a->frame_number;
  if (!status) status = sonde_slicer_create(s, &options, &w->slicer, error);
  if (status) return status;
  double start = app_seconds(CLOCK_MONOTONIC);
  if (a->options.method == SONDE_SLICE_KRIGE && !a->pose)
    w->reached = sonde_slicer_render_place(w->slicer, a->frame_number, &w->plane, s->clip,
                                           &w->image, w->known);
  else
    w->reached = sonde_slicer_render(w->slicer, &w->plane, &w->image, w->known);
  w->seconds = app_seconds(CLOCK_MONOTONIC) - start;
  return write_picture(a, w, error);
}

static sonde_status slice_volume(const arguments *a, work *w, sonde_error *error) {
  sonde_status status = sonde_volume_load(a->input, &w->volume, error);
  if (!status) status = make_image(w, a->width, a->height, error);
  if (status) return status;
  pose_plane(a, w);
  double start = app_seconds(CLOCK_MONOTONIC);
  w->reached = sonde_volume_slice(&w->volume, a->method_index == 1, &w->plane, &w->image, w->known);
  w->seconds = app_seconds(CLOCK_MONOTONIC) - start;
  return write_picture(a, w, error);
}

static void print_json(const arguments *a, const work *w, double share) {
  app_json_begin();
  app_json_integer("width", w->image.width);
  app_json_integer("height", w->image.height);
  app_json_real("width_mm", w->image.width_m * 1e3);
  app_json_real("height_mm", w->image.height_m * 1e3);
  app_json_real("reached", share);
  app_json_real("slice_ms", w->seconds * 1e3);
  if (!a->volume) {
    app_json_integer("frames_used", w->located.used);
    app_json_text("world", w->located.world);
  }
  if (w->compared) {
    app_json_real("rms_grey", w->likeness.rms_grey);
    app_json_real("mae_grey", w->likeness.mae_grey);
    app_json_real("psnr_db", w->likeness.psnr_db);
    app_json_real("ncc", w->likeness.ncc);
    app_json_real("ssim", w->likeness.ssim);
  }
  if (a->press.model) {
    app_json_real("force_n", w->pressed.force_n);
    app_json_real("penetration_mm", w->pressed.depth_m * 1e3);
    app_json_real("vein_area_ratio", w->pressed.vein_area_ratio);
    app_json_real("artery_area_ratio", w->pressed.artery_area_ratio);
  }
  app_json_text("image", a->output);
  app_json_end();
}

static void print(const arguments *a, const work *w) {
  double share = (double)w->reached / ((double)w->image.width * w->image.height);
  if (a->json) {
    print_json(a, w, share);
    return;
  }
  printf("picture       %u x %u pixels, %.1f x %.1f mm, %.1f %% reached, %.2f ms\n", w->image.width,
         w->image.height, w->image.width_m * 1e3, w->image.height_m * 1e3, 100 * share,
         w->seconds * 1e3);
  if (w->compared)
    printf("against real  RMS %.2f, MAE %.2f grey levels, PSNR %.2f dB, NCC %.4f, SSIM %.4f\n",
           w->likeness.rms_grey, w->likeness.mae_grey, w->likeness.psnr_db, w->likeness.ncc,
           w->likeness.ssim);
  if (a->press.model)
    printf("pressed       %.2f N at %.2f mm, vein %.1f %% and artery %.1f %% of their rest area\n",
           w->pressed.force_n, w->pressed.depth_m * 1e3, 100 * w->pressed.vein_area_ratio,
           100 * w->pressed.artery_area_ratio);
  printf("written       %s\n", a->output);
}

int old_slice(int argc, char **argv);
int old_slice(int argc, char **argv) {
  arguments a = {0};
  int code = read_arguments(argc, argv, &a);
  if (code >= 0) return code;
  work w = {0};
  sonde_error error = {0};
  app_progress_begin("slicing");
  sonde_status status = a.volume ? slice_volume(&a, &w, &error) : slice_sequence(&a, &w, &error);
  app_progress_end();
  if (!status) print(&a, &w);
  sonde_slicer_destroy(w.slicer);
  sonde_image_clear(&w.image);
  sonde_sequence_clear(&w.sequence);
  sonde_volume_clear(&w.volume);
  free(w.known);
  return status ? app_fail(VERB, &error) : APP_OK;
}
