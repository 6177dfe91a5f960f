// Aberration: what the delays across an aperture take from the echo of a point, and give to the
// places beside it. Straight ways through the slowness that the march has found lead from the
// aperture to a depth of each line.
#include "base/base.h"
#include "echo/sound.h"

#include <string.h>

enum { WAYS = 8 };                    // across an aperture
static const float least_kept = 0.2f; // of the amplitude
// The lost echo appears beside its place, as wide as fat lobules of about 3 mm scatter it.
static const float halo_m[HALO_TAPS] = {-1.1e-3f, -0.5e-3f, 0.5e-3f, 1.1e-3f};

// Share of its amplitude that a point's echo keeps at a depth, by line: exp(-(k s)^2) for both
// ways, s the delays' deviation from a slope across the aperture. The slope itself turns the beam,
// which the traced rays do. Delays are in metres at the assumed speed.
static void find_kept_amplitude(const sonde_echo *echo, float depth_m, float *kept) {
  SONDE_ASSERT(echo->padded <= SONDE_MOST_LINES && depth_m >= 0);
  const sonde_sound *s = echo->sound;
  const frame *f = &echo->frame;
  const float number = (float)(f->scanner->transmit_f + f->scanner->receive_f); // twice the mean
  const float row_m = (float)(f->reach_m / (SOUND_ROWS - 1)), per_m = (float)(1 / f->pitch_m);
  const float curve = f->radius_m > 0 ? (float)(1 / f->radius_m) : 0;
  const float k = (float)(2 * SONDE_PI / f->wavelength_m);
  // Sums over the ways of the delay, of the delay times u and of the delay squared; u is the place
  // of the way in the aperture, -1 to 1.
  float delay[SONDE_MOST_LINES], sum[3][SONDE_MOST_LINES] = {{0}}, u_square = 0;
  for (int way = 0; way < WAYS; ++way) {
    const float u = 2 * ((float)way + 0.5f) / WAYS - 1;
    u_square += u * u;
    memset(delay, 0, sizeof delay);
    for (uint32_t row = 0; row < SOUND_ROWS && (float)row * row_m < depth_m; ++row) {
      const float z = (float)row * row_m, half = (depth_m - z) / number * per_m / (1 + z * curve);
      const float beside = u * fminf(half, SOUND_MARGIN - 1); // lines
      const float *slow = s->trace_slow[row] + SOUND_MARGIN + (int)floorf(beside + 0.5f);
      for (uint32_t l = 0; l < echo->padded; l += 4)
        vstore_float_x4(delay + l, vload_float_x4(delay + l) + vload_float_x4(slow + l));
    }
    for (uint32_t l = 0; l < echo->padded; l += 4) {
      const float_x4 d = vload_float_x4(delay + l);
      vstore_float_x4(sum[0] + l, vload_float_x4(sum[0] + l) + d);
      vstore_float_x4(sum[1] + l, vload_float_x4(sum[1] + l) + u * d);
      vstore_float_x4(sum[2] + l, vload_float_x4(sum[2] + l) + d * d);
    }
  }
  for (uint32_t l = 0; l < echo->lines; ++l) {
    const float mean = sum[0][l] / WAYS, slope = sum[1][l] / u_square;
    const float square = sum[2][l] / WAYS - mean * mean - slope * slope * u_square / WAYS;
    kept[l] = fmaxf(expf(-k * k * fmaxf(square, 0)), least_kept);
  }
}

void sonde_aberration_find(sonde_echo *echo) {
  sonde_sound *s = echo->sound;
  // Lines beside the picture have the slowness of its outer ones.
  for (uint32_t row = 0; row < SOUND_ROWS; ++row) {
    float *slow = s->trace_slow[row] + SOUND_MARGIN;
    for (int k = 1; k <= SOUND_MARGIN; ++k) slow[-k] = slow[0];
    for (uint32_t l = echo->lines; l < echo->padded + SOUND_MARGIN; ++l) slow[l] = slow[l - 1];
  }
  const frame *f = &echo->frame;
  const uint32_t first = echo->pad_lines / SONDE_FINE, columns = echo->grid_lines / SONDE_FINE;
  SONDE_ASSERT(columns <= KEPT_COLUMNS && first + echo->lines <= columns);
  for (uint32_t depth = 0; depth <= KEPT_DEPTHS; ++depth) {
    float *kept = s->kept[depth];
    find_kept_amplitude(echo, (float)(f->depth_m * depth / KEPT_DEPTHS), kept + first);
    for (uint32_t l = 0; l < first; ++l) kept[l] = kept[first];
    for (uint32_t l = first + echo->lines; l < columns; ++l) kept[l] = kept[l - 1];
  }
  for (int t = 0; t < HALO_TAPS; ++t) {
    const double lines = (double)halo_m[t] / f->pitch_m;
    s->halo.offset[t] = (int32_t)clamp(rint(lines), -HAZE_REACH, HAZE_REACH);
  }
}
