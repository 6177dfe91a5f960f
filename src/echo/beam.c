// From the scattered field to the envelope: local gain, lateral beam, specular echoes, axial pulse,
// receiver noise, time-gain compensation.
//
// sonde_echo_beam  all stages
// beam_kernel      lateral kernel at a depth: narrow at the focus, normalised in energy
// pulse_kernel     axial kernel
// lateral_row      gain and lateral kernel of one row of samples
// add_specular     echoes of interfaces, carrier phase included
// axial_row        pulse, noise, compensation, modulus
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <string.h>

static const double noise_db = -118;          // receiver noise below muscle at the skin, before TGC
static const double pulse_wavelengths = 1.15; // axial width between half values
static const double focus_wavelengths = 2.0;  // lateral width at the focus
static const double field_depth_wavelengths = 130; // distance over which it grows by sqrt(2)
static const double gaussian_half = 2.35482;       // full width at half maximum over sigma

typedef struct kernel {
  int half;
  float tap[SONDE_MAX_TAPS + 1];
} kernel;

// Gaussian taps; energy of the kernel folded with the splat's triangle is one per unit length.
static kernel gaussian(double sigma) {
  SONDE_ASSERT(sigma > 0);
  kernel k = {.half = (int)ceil(2.6 * sigma)};
  if (k.half > SONDE_MAX_TAPS) k.half = SONDE_MAX_TAPS;
  if (k.half < 1) k.half = 1;
  for (int i = 0; i <= k.half; ++i) k.tap[i] = (float)exp(-0.5 * i * i / (sigma * sigma));
  double energy = 0;
  for (int i = -k.half; i <= k.half; ++i)
    for (int j = -k.half; j <= k.half; ++j) {
      int apart = abs(i - j);
      double overlap = apart == 0 ? 2.0 / 3 : apart == 1 ? 1.0 / 6 : 0;
      energy += overlap * (double)k.tap[abs(i)] * (double)k.tap[abs(j)];
    }
  for (int i = 0; i <= k.half; ++i) k.tap[i] /= (float)sqrt(energy);
  return k;
}

// The splat's triangle already widens by a variance of 1/6.
static kernel beam_kernel(const frame *f, double depth_m) {
  double away = (depth_m - f->focus_m) / (field_depth_wavelengths * f->wavelength_m);
  double width = focus_wavelengths * f->wavelength_m * sqrt(1 + away * away);
  double sigma = width / gaussian_half / f->pitch_m;
  return gaussian(sqrt(fmax(sigma * sigma - 1.0 / 6, 0.09)));
}

static kernel pulse_kernel(const frame *f) {
  double sigma = pulse_wavelengths * f->wavelength_m / gaussian_half / f->step_m;
  return gaussian(sqrt(fmax(sigma * sigma - 1.0 / 6, 0.09)));
}

// Gain of one row of samples, per grid line (padding repeats the edge).
static void gain_row(const sonde_echo *echo, uint32_t sample, float scale, float *gain) {
  double at = ((double)sample - SONDE_SAMPLE_PAD) / (echo->samples - 1) * (SONDE_MEDIUM_ROWS - 1);
  at = clamp(at, 0, SONDE_MEDIUM_ROWS - 1.001);
  uint32_t row = (uint32_t)at;
  float b = (float)(at - row);
  const float *top = echo->gain + row * echo->lines, *next = top + echo->lines;
  for (uint32_t l = 0; l < echo->lines; ++l)
    gain[l + SONDE_LINE_PAD] = scale * (top[l] + b * (next[l] - top[l]));
  for (uint32_t l = 0; l < SONDE_LINE_PAD; ++l) {
    gain[l] = gain[SONDE_LINE_PAD];
    gain[echo->lines + SONDE_LINE_PAD + l] = gain[echo->lines + SONDE_LINE_PAD - 1];
  }
}

static void lateral_row(sonde_echo *echo, uint32_t sample, float scale) {
  float gain[512 + 2 * SONDE_LINE_PAD];
  SONDE_ASSERT(echo->grid_lines <= SONDE_COUNT_OF(gain));
  double depth = ((double)sample - SONDE_SAMPLE_PAD) * echo->frame.step_m;
  kernel k = beam_kernel(&echo->frame, depth);
  float *in = echo->grid + (size_t)sample * 2 * echo->grid_lines;
  float *out = echo->beam + (size_t)sample * 2 * echo->lines;
  gain_row(echo, sample, scale, gain);
  for (uint32_t l = 0; l < echo->grid_lines; ++l) in[2 * l] *= gain[l], in[2 * l + 1] *= gain[l];
  const float *centre = in + 2 * SONDE_LINE_PAD;
  uint32_t width = 2 * echo->lines;
  for (uint32_t i = 0; i < width; ++i) out[i] = k.tap[0] * centre[i];
  for (int t = 1; t <= k.half; ++t) {
    const float *left = centre - 2 * t, *right = centre + 2 * t;
    float tap = k.tap[t];
    for (uint32_t i = 0; i < width; ++i) out[i] += tap * (left[i] + right[i]);
  }
}

// A sheet is smooth along the lines: its echo enters after the lateral kernel, one per line.
// Roughness comes with the tissue's own speckle beside it.
static void add_specular(sonde_echo *echo, float pulse_peak) {
  const frame *f = &echo->frame;
  for (uint32_t l = 0; l < echo->lines; ++l)
    for (uint32_t e = 0; e < echo->echo_count[l]; ++e) {
      specular s = echo->echoes[l * SONDE_MAX_ECHOES + e];
      double at = s.depth_m / f->step_m + SONDE_SAMPLE_PAD;
      if (!(at >= 0 && at < echo->grid_samples - 1)) continue;
      uint32_t sample = (uint32_t)at;
      float b = (float)(at - sample), amplitude = s.amplitude / pulse_peak;
      double turns = 2 * s.depth_m / f->wavelength_m;
      uint32_t phase = (uint32_t)(turns * SONDE_PHASES) & (SONDE_PHASES - 1);
      float re = amplitude * echo->phase[2 * phase], im = amplitude * echo->phase[2 * phase + 1];
      float *out = echo->beam + ((size_t)sample * echo->lines + l) * 2;
      out[0] += (1 - b) * re, out[1] += (1 - b) * im;
      out += 2 * echo->lines;
      out[0] += b * re, out[1] += b * im;
    }
}

static void axial_row(sonde_echo *echo, uint32_t sample, const kernel *k, float noise, float tgc) {
  uint32_t width = 2 * echo->lines;
  const float *centre = echo->beam + (size_t)(sample + SONDE_SAMPLE_PAD) * width;
  float *sum = echo->sum, *out = echo->envelope + (size_t)sample * echo->lines;
  uint64_t draw = sonde_random_bits(echo->seed + 3 + sonde_interior_tick(echo->interior), sample);
  const float *static_noise = echo->noise + draw % (SONDE_NOISE - 1024);
  for (uint32_t i = 0; i < width; ++i) sum[i] = k->tap[0] * centre[i] + noise * static_noise[i];
  for (int t = 1; t <= k->half; ++t) {
    const float *up = centre - (size_t)t * width, *down = centre + (size_t)t * width;
    float tap = k->tap[t];
    for (uint32_t i = 0; i < width; ++i) sum[i] += tap * (up[i] + down[i]);
  }
  for (uint32_t l = 0; l < echo->lines; ++l)
    out[l] = tgc * sqrtf(sum[2 * l] * sum[2 * l] + sum[2 * l + 1] * sum[2 * l + 1]);
}

void sonde_echo_beam(sonde_echo *echo) {
  const frame *f = &echo->frame;
  // Scatterers per line and sample, weighted by the elevation kernel's energy
  // (integral of (1 - y^2)^4 over [-1, 1] is 256/315), bring the rms of a gain of one to one.
  double density = echo->per_cell / (echo->cell_m * echo->cell_m * echo->cell_m);
  double power = density * f->pitch_m * f->step_m * sonde_elevation_half_m * 256.0 / 315.0;
  kernel pulse = pulse_kernel(f);
  for (uint32_t n = 0; n < echo->grid_samples; ++n) lateral_row(echo, n, (float)(1 / sqrt(power)));
  add_specular(echo, pulse.tap[0]);
  for (uint32_t n = 0; n < echo->samples; ++n) {
    double tgc_db = n * f->step_m * f->tgc_db_per_m;
    float noise = (float)pow(10, noise_db / 20);
    axial_row(echo, n, &pulse, noise, (float)pow(10, tgc_db / 20));
  }
}
