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
  const bool fan = box->radius_m > 0;
  // The pixels whose middles the box may hold: a sector is deepest on its line nearest to the
  // middle.
  const double along[3] = {box->left_m, box->right_m, clamp(0, box->left_m, box->right_m)};
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  for (int k = 0; k < 6; ++k) {
    const sonde_vec3 at =
        sight_place(colour_sight(box), along[k / 2], k % 2 ? box->bottom_m : box->top_m);
    low[0] = fmin(low[0], at.x), high[0] = fmax(high[0], at.x);
    low[1] = fmin(low[1], at.z), high[1] = fmax(high[1], at.z);
  }
  overlay->left = (uint32_t)clamp(floor(low[0] / size + 0.5 * image->width), 0, image->width);
  overlay->top = (uint32_t)clamp(floor((low[1] - image->top_m) / size), 0, image->height);
  overlay->width = (uint32_t)clamp(ceil(high[0] / size + 0.5 * image->width), 0, image->width);
  overlay->height = (uint32_t)clamp(ceil((high[1] - image->top_m) / size), 0, image->height);
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
    const double z = image->top_m + (overlay->top + y + 0.5) * size,
                 per_line = (box->right_m - box->left_m) / LINES;
    double at[2] = {0, (z - box->top_m) / (box->bottom_m - box->top_m) * ROWS - 0.5};
    const double left = (overlay->left + 0.5 - 0.5 * image->width) * size, x = left - z * lean;
    const float first = (float)((x - box->left_m) / per_line - 0.5),
                step = (float)(size / per_line);
    for (uint32_t n = 0; n < overlay->width; ++n) {
      out[n] = 0;
      if (grey[n] > brightest) continue;
      float line = first + (float)n * step;
      if (fan) sonde_colour_find(box, left + n * size, z, at), line = (float)at[0];
      if (!(at[1] >= 0 && at[1] <= ROWS - 1 && line >= 0 && line <= LINES - 1)) continue;
      const int row = (int)fmin(at[1], ROWS - 2);
      const float b = (float)(at[1] - row);
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
