// Last stage: grey pixels from the grey values of lines and samples. Scan conversion is bilinear or
// bicubic, with square pixels, black beside the lines.
#include "base/base.h"
#include "echo/echo.h"
#include "echo/lines.h"

void sonde_echo_picture(sonde_echo *echo, sonde_image *image) {
  const frame *f = &echo->frame;
  // A curved face's outer lines start higher than its middle: the picture begins there.
  const double top = sight_top(f->radius_m, f->aperture_m);
  double pixel = (f->depth_m - top) / image->height;
  SONDE_ASSERT(pixel > 0);
  image->width_m = pixel * image->width;
  image->height_m = f->depth_m - top;
  image->top_m = top;
  image->tick = sonde_interior_tick(echo->interior);
  convert_job job = {.grey = echo->grey,
                     .lines = echo->lines,
                     .samples = echo->samples,
                     .stride = echo->padded,
                     .cubic = f->scanner->cubic > 0.5,
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
