// From the envelope to grey pixels.
//
// sonde_echo_render                the stages of one frame
// sonde_echo_default_tgc_db_per_m  compensation of the mean soft tissue
// compress                         envelope -> grey values, logarithmic
// sonde_echo_picture               scan conversion: bilinear, square pixels, black beside the lines
#include "base/base.h"
#include "echo/echo.h"

#include <string.h>

static const double mean_loss_db_per_m_mhz = 95; // one way, skin to femur
static const float white_db = 40;                // over the rms of muscle speckle

double sonde_echo_default_tgc_db_per_m(double frequency_hz) {
  return 2 * mean_loss_db_per_m_mhz * frequency_hz * 1e-6;
}

// 20 log10 of an amplitude within 0.01 dB, without a call: exponent bits and a cubic in the
// mantissa.
static inline float decibels(float amplitude) {
  uint32_t bits;
  float floor_value = amplitude > 1e-20f ? amplitude : 1e-20f;
  memcpy(&bits, &floor_value, sizeof bits);
  int32_t exponent = (int32_t)(bits >> 23) - 127;
  bits = (bits & 0x7fffffu) | 0x3f800000u;
  float m;
  memcpy(&m, &bits, sizeof m);
  float t = m - 1; // log2(1 + t), minimax of degree 5 with exact ends
  float log2m = t * (1.4419f + t * (-0.7096f + t * (0.4175f + t * (-0.1943f + t * 0.0445f))));
  return 6.0205999f * ((float)exponent + log2m);
}

static void compress(sonde_echo *echo) {
  SONDE_ASSERT(echo->frame.settings.dynamic_range_db > 0);
  const sonde_echo_settings *s = &echo->frame.settings;
  float range = (float)s->dynamic_range_db, scale = 255 / range;
  float offset = (float)s->gain_db - white_db + range;
  size_t count = (size_t)echo->lines * echo->samples;
  for (size_t i = 0; i < count; ++i) {
    float grey = (decibels(echo->envelope[i]) + offset) * scale;
    echo->grey[i] = grey < 0 ? 0 : grey > 255 ? 255 : grey;
  }
}

void sonde_echo_picture(sonde_echo *echo, sonde_image *image) {
  const frame *f = &echo->frame;
  double pixel = f->depth_m / image->height;
  uint32_t lines = echo->lines, samples = echo->samples;
  compress(echo);
  image->width_m = pixel * image->width;
  image->height_m = f->depth_m;
  image->tick = sonde_interior_tick(echo->interior);
  float dx = (float)(pixel / f->pitch_m);
  float first = (float)(0.5 * (lines - 1)) - (0.5f * (float)image->width - 0.5f) * dx;
  for (uint32_t row = 0; row < image->height; ++row) {
    float z = ((float)row + 0.5f) / (float)image->height * (float)(samples - 1);
    uint32_t n = (uint32_t)z < samples - 2 ? (uint32_t)z : samples - 2;
    float b = z - (float)n;
    const float *top = echo->grey + (size_t)n * lines, *next = top + lines;
    uint8_t *out = image->pixels + (size_t)row * image->width;
    for (uint32_t column = 0; column < image->width; ++column) {
      float x = first + (float)column * dx;
      out[column] = 0;
      if (!(x >= 0 && x < (float)(lines - 1))) continue;
      uint32_t l = (uint32_t)x;
      float a = x - (float)l;
      float up = top[l] + a * (top[l + 1] - top[l]), low = next[l] + a * (next[l + 1] - next[l]);
      out[column] = (uint8_t)(up + b * (low - up) + 0.5f);
    }
  }
}

void sonde_echo_render(sonde_echo *echo, sonde_pose world_from_probe, double aperture_m,
                       const sonde_pathology *pathology, const sonde_echo_settings *settings,
                       sonde_image *image) {
  SONDE_ASSERT(echo != NULL && pathology != NULL && settings != NULL);
  SONDE_ASSERT(image != NULL && image->pixels != NULL && aperture_m > 0);
  sonde_echo_settings s = sonde_echo_settings_clamp(*settings);
  frame *f = &echo->frame;
  f->probe = world_from_probe;
  f->from_world = m_transpose(q_matrix(world_from_probe.rotation));
  f->aperture_m = aperture_m;
  f->depth_m = s.depth_m;
  f->pitch_m = aperture_m / (echo->lines - 1);
  f->step_m = s.depth_m / (echo->samples - 1);
  f->frequency_hz = s.frequency_hz;
  f->wavelength_m = sonde_sound_m_s / s.frequency_hz;
  f->focus_m = s.focus_m;
  f->pathology = pathology;
  f->settings = s;
  f->tgc_db_per_m = sonde_echo_default_tgc_db_per_m(s.frequency_hz) + s.tgc_db_per_m;
  sonde_echo_plane(echo);
  sonde_echo_medium(echo);
  sonde_echo_scatter(echo);
  sonde_echo_beam(echo);
  sonde_echo_picture(echo, image);
}
