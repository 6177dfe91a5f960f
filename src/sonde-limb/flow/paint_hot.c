// Colour over a picture: the last frame's cells between its pixels, kept off bright ones.
#include "flow/colour.h"

#include "base/base.h"
#include "base/maths.h"

static const uint8_t brightest = 110; // pixel that colour covers
static const float power_db = 25;     // that a map of power spans

void sonde_colour_paint(sonde_colour *c, const sonde_colour_box *box, double gain_db, bool power,
                        const sonde_image *image, sonde_colour_overlay *overlay) {
  SONDE_ASSERT(c && box && image && overlay && overlay->pixels);
  enum { LINES = SONDE_COLOUR_LINES, ROWS = SONDE_COLOUR_ROWS };
  const double size = image->width_m / image->width, lean = tan(box->steer_rad);
  // The pixels whose middles the box may hold.
  const double shift[2] = {lean * box->top_m, lean * box->bottom_m};
  const double left = (box->left_m + fmin(shift[0], shift[1])) / size + 0.5 * image->width;
  const double right = (box->right_m + fmax(shift[0], shift[1])) / size + 0.5 * image->width;
  overlay->left = (uint32_t)clamp(floor(left), 0, image->width);
  overlay->top = (uint32_t)clamp(floor(box->top_m / size), 0, image->height);
  overlay->width = (uint32_t)clamp(ceil(right), 0, image->width);
  overlay->height = (uint32_t)clamp(ceil(box->bottom_m / size), 0, image->height);
  overlay->width -= overlay->width > overlay->left ? overlay->left : overlay->width;
  overlay->height -= overlay->height > overlay->top ? overlay->top : overlay->height;
  const float gain = (float)pow(10, gain_db / 10);
  const float radians = (float)(SONDE_PI / sonde_colour_limit(&c->def));
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    const float at = gain * c->value[i].power, angle = radians * c->value[i].velocity_m_s;
    c->shown[0][i] = c->shown[1][i] = 0, c->shown[2][i] = at;
    if (at > 1) c->shown[0][i] = at * cosf(angle), c->shown[1][i] = at * sinf(angle);
  }
  for (uint32_t y = 0; y < overlay->height; ++y) {
    uint8_t *out = overlay->pixels + (size_t)y * overlay->width;
    const uint8_t *grey = image->pixels + (size_t)(overlay->top + y) * image->width + overlay->left;
    const double z = (overlay->top + y + 0.5) * size,
                 per_line = (box->right_m - box->left_m) / LINES;
    const double down = (z - box->top_m) / (box->bottom_m - box->top_m) * ROWS - 0.5;
    const double x = (overlay->left + 0.5 - 0.5 * image->width) * size - z * lean;
    const float first = (float)((x - box->left_m) / per_line - 0.5),
                step = (float)(size / per_line);
    const int row = (int)clamp(floor(down), 0, ROWS - 2);
    const float b = (float)(down - row);
    for (uint32_t n = 0; n < overlay->width; ++n) {
      const float line = first + (float)n * step;
      out[n] = 0;
      if (grey[n] > brightest || !(down >= 0 && down <= ROWS - 1 && line >= 0 && line <= LINES - 1))
        continue;
      const int k = line < LINES - 2 ? (int)line : LINES - 2, cell = row * LINES + k;
      const float a = line - (float)k;
      float mean[3];
      for (int j = 2; j >= 0 && (j == 2 || mean[2] > SONDE_COLOUR_POWER); --j) {
        const float *v = c->shown[j] + cell;
        mean[j] =
            (1 - b) * ((1 - a) * v[0] + a * v[1]) + b * ((1 - a) * v[LINES] + a * v[LINES + 1]);
      }
      if (!(mean[2] > SONDE_COLOUR_POWER)) continue;
      const float shown = power ? 10 * log10f(mean[2] / SONDE_COLOUR_POWER) / power_db * 2 - 1
                                : atan2f(mean[1], mean[0]) / (float)SONDE_PI;
      out[n] = (uint8_t)lrintf(128 + 127 * fminf(shown, 1));
    }
  }
}
