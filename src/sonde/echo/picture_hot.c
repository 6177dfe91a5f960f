// A frame, and its grey pixels.
//
// sonde_echo_render                the stages of one frame
// sonde_echo_default_tgc_db_per_m  compensation of the mean soft tissue
// sonde_echo_picture               scan conversion: bilinear, square pixels, black beside the lines
#include "base/base.h"
#include "echo/tiers.h"

#include <time.h>

static const double mean_loss_db_per_m_mhz = 95; // one way, skin to femur

double sonde_echo_default_tgc_db_per_m(double frequency_hz) {
  return 2 * mean_loss_db_per_m_mhz * frequency_hz * 1e-6;
}

void sonde_echo_picture(sonde_echo *echo, sonde_image *image) {
  const frame *f = &echo->frame;
  // A curved face's outer lines start higher than its middle: the picture begins there.
  double half = 0.5 * f->aperture_m, top = 0;
  if (f->radius_m > 0) top = f->radius_m * (cos(half / f->radius_m) - 1);
  double pixel = (f->depth_m - top) / image->height;
  SONDE_ASSERT(pixel > 0);
  image->width_m = pixel * image->width;
  image->height_m = f->depth_m - top;
  image->tick = sonde_interior_tick(echo->interior);
  convert_job job = {.grey = echo->grey,
                     .lines = echo->lines,
                     .samples = echo->samples,
                     .stride = echo->padded,
                     .x = (float)((0.5 - 0.5 * image->width) * pixel),
                     .dx = (float)pixel,
                     .lines_per_m = (float)(1 / f->pitch_m),
                     .samples_per_m = (float)(1 / f->step_m),
                     .radius_m = (float)f->radius_m,
                     .first_line = (float)f->first_line,
                     .width = image->width};
  for (uint32_t row = 0; row < image->height; ++row) {
    job.z = (float)(top + (row + 0.5) * pixel);
    job.out = image->pixels + (size_t)row * image->width;
    echo->kernels->convert(&job);
  }
}

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// Time since *from, which moves on.
static double lap(double *from) {
  double now = seconds(), since = now - *from;
  *from = now;
  return since;
}

void sonde_echo_render(sonde_echo *echo, sonde_pose world_from_probe, double aperture_m,
                       const sonde_pathology *pathology, const sonde_echo_settings *settings,
                       sonde_image *image) {
  SONDE_ASSERT(echo != NULL && pathology != NULL && settings != NULL);
  SONDE_ASSERT(image != NULL && image->pixels != NULL && aperture_m > 0);
  double start = seconds();
  sonde_echo_times *t = &echo->times;
  echo->frame.pathology = pathology;
  sonde_echo_frame(echo, world_from_probe, aperture_m, settings);
  t->settings_s = lap(&start);
  sonde_echo_plane(echo);
  t->plane_s = lap(&start);
  sonde_echo_medium(echo);
  t->medium_s = lap(&start);
  sonde_echo_scatter(echo);
  sonde_echo_blood(echo);
  t->scatter_s = lap(&start);
  t->beam_s = 0;
  for (uint32_t tier = 0; tier < echo->tier_count; ++tier) {
    sonde_tiers_lay(echo, tier);
    t->scatter_s += lap(&start);
    sonde_echo_beam(echo, tier, true);
    t->beam_s += lap(&start);
  }
  sonde_echo_beam_end(echo);
  sonde_echo_picture(echo, image);
  t->picture_s = lap(&start);
  t->scatterers = echo->moved;
  t->blood = echo->bled;
  t->lost = echo->lost;
}

sonde_echo_times sonde_echo_last_times(const sonde_echo *echo) {
  SONDE_ASSERT(echo != NULL);
  return echo->times;
}

void sonde_echo_render_points(sonde_echo *echo, double aperture_m,
                              const sonde_echo_settings *settings, const sonde_echo_point *points,
                              uint32_t count) {
  SONDE_ASSERT(echo != NULL && (points != NULL || count == 0));
  sonde_echo_frame(echo, (sonde_pose){.rotation = {.w = 1}}, aperture_m, settings);
  for (uint32_t tier = 0; tier < echo->tier_count; ++tier) {
    sonde_echo_scatter_points(echo, points, count, tier);
    sonde_echo_beam(echo, tier, false);
  }
  sonde_echo_beam_end(echo);
}
