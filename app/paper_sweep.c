// Figures 1 and 2: a set of echographic frames, a picture interpolated among them, and a frame that
// was left out beside the picture made in its place. The sweep is synthetic: made by the simulator.
#include "paper.h"
#include "pose.h"
#include "stack_figure.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES = 25, QUICK_FRAMES = 9, SIDE = 300, STACK_STEP = 4 };
static const double SPACING_M = 1e-3, APERTURE_M = 0.036, DEPTH_M = 0.045, WITHIN_M = 2e-3;

// Frames of the thigh at rest along the leg, the face just within the skin so that gel fills no
// gap.
static sonde_status make_sweep(const paper *p, uint32_t count, sonde_sequence *sweep,
                               sonde_error *error) {
  settled s = {0};
  sonde_pathology vein;
  sonde_echo *echo = NULL;
  sonde_image image = {0};
  sonde_echo_settings settings = sonde_echo_settings_default();
  settings.depth_m = DEPTH_M;
  settings.focus_m = 0.5 * DEPTH_M;
  sonde_status status = settled_open(&s, p->model_path, "linear", NULL, true, error);
  if (!status) status = sonde_pathology_preset("healthy", &vein, error);
  if (!status) status = sonde_echo_create(s.interior, NULL, &echo, error);
  if (!status) status = sonde_image_create(SIDE, SIDE, &image, error);
  if (!status) status = sonde_sequence_create(SIDE, SIDE, count, sweep, error);
  sonde_pose start = sonde_site_pose(p->central, WITHIN_M);
  for (uint32_t k = 0; k < count && !status; ++k) {
    s.pose = pose_shift(start, SPACING_M * (k - 0.5 * (count - 1)), p->central->v);
    settled_update(&s, &vein, 0, 0);
    sonde_echo_render(echo, s.pose, APERTURE_M, &vein, &settings, &image);
    memcpy(sweep->pixels + (size_t)k * SIDE * SIDE, image.pixels, (size_t)SIDE * SIDE);
    sweep->frames[k].world_from_pixel = sonde_slice_plane(s.pose, &image);
    sweep->frames[k].used = true;
  }
  for (int k = 0; k < 2 && !status; ++k) sweep->clip[k] = 0, sweep->clip[2 + k] = SIDE;
  sonde_image_clear(&image);
  sonde_echo_destroy(echo);
  settled_close(&s);
  return status;
}

// The picture at a place between frames; with `left_out` that frame is not used.
static sonde_status interpolate(const sonde_sequence *sweep, double place, uint32_t left_out,
                                sonde_affine *plane, sonde_image *picture, uint8_t *known,
                                sonde_error *error) {
  sonde_slicer_options options = sonde_slicer_options_default();
  sonde_slicer *slicer = NULL;
  options.once = true, options.left_out = left_out;
  uint32_t first = (uint32_t)place, next = first + (place > first);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 4; ++k) {
      double a = sweep->frames[first].world_from_pixel.m[i][k];
      plane->m[i][k] = a + (place - first) * (sweep->frames[next].world_from_pixel.m[i][k] - a);
    }
  sonde_status status = sonde_slicer_create(sweep, &options, &slicer, error);
  if (!status) sonde_slicer_render(slicer, plane, picture, known);
  sonde_slicer_destroy(slicer);
  return status;
}

static sonde_status draw_stack(paper *p, const sonde_sequence *sweep, sonde_image *picture,
                               uint8_t *known, sonde_error *error) {
  const char *TITLE = "Figure 1. An image made from a set of images";
  double place = 0.5 * (sweep->count - 1) + 2.5; // half way between two sheets that are drawn
  sonde_affine plane;
  sonde_image stack = {0};
  sonde_file *file = NULL;
  sonde_status status = interpolate(sweep, place, SONDE_WHOLE_FILE, &plane, picture, known, error);
  if (!status) status = stack_draw(sweep, STACK_STEP, place, &plane, picture, &stack, error);
  if (!status) status = paper_figure_begin(p, 1, TITLE, 780, 570, &file, error);
  if (!status) {
    sonde_svg_put_text(file, 24, 26, "class='head'", TITLE);
    sonde_svg_put_text(file, 24, 44, "class='tick'",
                       "grey frames: the synthetic sweep; white frame: interpolated");
    status =
        sonde_svg_put_image(file, 24, 54, 732, 732.0 * stack.height / stack.width, &stack, error);
  }
  paper_caption(
      p->figure[0].caption, sizeof p->figure[0].caption,
      "A synthetic sweep, made by the simulator on the thigh at rest: %u frames of %.0f "
      "x %.0f mm at %.1f mm along the leg, every fourth one drawn dimmed, the way between "
      "them stretched. The white frame, half way between two of them, is interpolated "
      "from the others.",
      sweep->count, 1e3 * DEPTH_M, 1e3 * DEPTH_M, 1e3 * SPACING_M);
  sonde_image_clear(&stack);
  return paper_figure_end(file, status, error);
}

static sonde_status draw_pair(paper *p, const sonde_sequence *sweep, sonde_image *picture,
                              uint8_t *known, sonde_error *error) {
  const char *TITLE = "Figure 2. Real and interpolated image";
  uint32_t frame = sweep->count / 2;
  sonde_image real = {.width = SIDE,
                      .height = SIDE,
                      .pixels = sweep->pixels + (size_t)frame * SIDE * SIDE},
              difference = {0};
  sonde_likeness like;
  sonde_affine plane;
  sonde_file *file = NULL;
  char words[96];
  sonde_status status = interpolate(sweep, frame, frame, &plane, picture, known, error);
  if (!status)
    status = sonde_image_likeness(real.pixels, picture->pixels, known, SIDE, SIDE, &like, error);
  if (!status) status = sonde_image_create(SIDE, SIDE, &difference, error);
  for (uint32_t k = 0; k < SIDE * SIDE && !status; ++k) {
    int grey = 128 + real.pixels[k] - picture->pixels[k];
    difference.pixels[k] = (uint8_t)(grey < 0 ? 0 : grey > 255 ? 255 : grey);
  }
  if (!status) status = paper_figure_begin(p, 2, TITLE, 960, 400, &file, error);
  const sonde_image *const shown[] = {&real, picture, &difference};
  const char *const name[] = {"\"real\": a frame of the synthetic sweep",
                              "interpolated without that frame", "difference about mid grey"};
  if (!status) sonde_svg_put_text(file, 24, 26, "class='head'", TITLE);
  for (int k = 0; k < 3 && !status; ++k) {
    sonde_svg_put_text(file, 24 + 310 * k, 52, "", name[k]);
    status = sonde_svg_put_image(file, 24 + 310 * k, 62, SIDE, SIDE, shown[k], error);
  }
  if (!status) {
    snprintf(words, sizeof words, "SSIM %.3f, NCC %.3f, PSNR %.1f dB, rms %.1f grey levels",
             like.ssim, like.ncc, like.psnr_db, like.rms_grey);
    sonde_svg_put_text(file, 24, 384, "", words);
    const double line[2][2] = {{840, 380}, {840 + 0.01 / DEPTH_M * SIDE, 380}};
    sonde_svg_put_line(file, line, 2, "stroke='#222' stroke-width='2'");
    sonde_svg_put_text(file, 912, 384, "class='tick'", "10 mm");
  }
  paper_caption(
      p->figure[1].caption, sizeof p->figure[1].caption,
      "Left: frame %u of the synthetic sweep, which stands for the real image. Middle: the "
      "picture made in its place from its neighbours, %.1f mm away on either side. Right: "
      "left minus middle. SSIM %.3f.",
      frame, 1e3 * SPACING_M, like.ssim);
  sonde_image_clear(&difference);
  return paper_figure_end(file, status, error);
}

static sonde_status judge(paper *p, const sonde_sequence *sweep, sonde_error *error) {
  sonde_slicer_options options = sonde_slicer_options_default();
  sonde_left_out r;
  sonde_status status =
      sonde_sequence_leave_one_out(sweep, &options, false, &r, &p->progress, error);
  if (status) return status;
  paper_claim *c = paper_begin(
      p, "slices_interpolate", "2, Figs. 1, 2",
      "An image of any position and orientation can be made from a set of images by interpolation.",
      "Every inner frame of a synthetic sweep made from the others and compared with itself; the "
      "nearest frame and the mean of the two neighbours for comparison.");
  paper_samples(c, r.frames, "frames left out");
  paper_value(c, "ssim", r.bracket.ssim);
  paper_value(c, "ncc", r.bracket.ncc);
  paper_value(c, "psnr_db", r.bracket.psnr_db);
  paper_value(c, "kriged_ssim", r.place.ssim);
  paper_value(c, "kriged_psnr_db", r.place.psnr_db);
  paper_value(c, "nearest_ssim", r.nearest.ssim);
  paper_value(c, "nearest_ncc", r.nearest.ncc);
  paper_value(c, "nearest_psnr_db", r.nearest.psnr_db);
  bool better = r.bracket.psnr_db > r.nearest.psnr_db && r.bracket.ssim > r.nearest.ssim;
  paper_say(c, better ? PAPER_HOLDS : PAPER_IN_PART,
            "From the frames on both sides, %.1f mm away: SSIM %.3f, NCC %.2f, PSNR %.1f dB; from "
            "the nearest frame alone %.3f, %.2f, %.1f dB. Walls and layers come back; speckle, "
            "which changes within a millimetre, does not.",
            1e3 * SPACING_M, r.bracket.ssim, r.bracket.ncc, r.bracket.psnr_db, r.nearest.ssim,
            r.nearest.ncc, r.nearest.psnr_db);
  return SONDE_OK;
}

sonde_status paper_sweep(paper *p, sonde_error *error) {
  sonde_sequence sweep = {0};
  sonde_image picture = {0};
  uint8_t *known = calloc((size_t)SIDE * SIDE, 1);
  sonde_status status = known ? SONDE_OK : (error->status = SONDE_MEMORY);
  if (!status) status = make_sweep(p, p->quick ? QUICK_FRAMES : FRAMES, &sweep, error);
  if (!status) status = sonde_image_create(SIDE, SIDE, &picture, error);
  if (!status) status = draw_stack(p, &sweep, &picture, known, error);
  if (!status) status = draw_pair(p, &sweep, &picture, known, error);
  if (!status) status = judge(p, &sweep, error);
  sonde_sequence_clear(&sweep);
  sonde_image_clear(&picture);
  free(known);
  return status;
}
