// What a scanner does between the envelope and the picture, on scan lines: mean of the looks,
// logarithm, smoothing along lines of tissue, sharpening, persistence, grey map.
#include "base/base.h"
#include "base/vector.h"
#include "echo/echo.h"

#include <string.h>

enum { BLOCK = 4, SMOOTHED = 3 }; // lines of a block; taps to either side of its middle

// A block's smoothing: taps along a direction, each between two lines.
typedef struct block_filter {
  int32_t row[2 * SMOOTHED + 1], line[2 * SMOOTHED + 1]; // from a point of the block
  float next[2 * SMOOTHED + 1];                          // share of the line after it
  float weight;                                          // of the smoothed value
} block_filter;

static uint32_t log_stride(const sonde_echo *echo) { return echo->padded + 2 * DISPLAY_MARGIN; }

// Structure tensor of a block of lines on a coarse row, over 5 x 7 values; lengths in metres.
static block_filter find_filter(const sonde_echo *echo, const float *mean, uint32_t row,
                                uint32_t line, uint32_t every) {
  const frame *f = &echo->frame;
  const uint32_t stride = log_stride(echo), rows = echo->samples / every;
  const float depth = (float)((row + 0.5) * every * f->step_m);
  const float pitch = (float)f->pitch_m * (f->radius_m > 0 ? 1 + depth / (float)f->radius_m : 1);
  const float down = (float)(every * f->step_m);
  float xx = 0, zz = 0, xz = 0;
  for (int32_t j = -2; j <= 2; ++j) {
    int32_t at = (int32_t)row + j;
    at = at < 1 ? 1 : at + 2 > (int32_t)rows ? (int32_t)rows - 2 : at;
    const float *p = mean + (uint32_t)at * stride + DISPLAY_MARGIN + line;
    for (int32_t i = -2; i < BLOCK + 2; ++i) {
      const float dx = (p[i + 1] - p[i - 1]) / pitch;
      const float dz = (p[i + (int32_t)stride] - p[i - (int32_t)stride]) / down;
      xx += dx * dx, zz += dz * dz, xz += dx * dz;
    }
  }
  // The direction in which the picture changes least, and how much less than across it.
  const float sum = xx + zz + 1e-9f, difference = zz - xx;
  const float length = sqrtf(difference * difference + 4 * xz * xz);
  const float coherence = length / sum;
  float x = sqrtf(0.5f * fmaxf(1 + difference / (length + 1e-12f), 0));
  float z = sqrtf(fmaxf(1 - x * x, 0));
  if (xz > 0) z = -z;
  block_filter filter = {.weight = (float)f->scanner->filter *
                                   (float)clamp(((double)coherence - 0.15) / 0.5, 0, 1)};
  const float reach = (float)f->scanner->filter_m;
  for (int t = -SMOOTHED; t <= SMOOTHED; ++t) {
    const float away = reach * (float)t / SMOOTHED, most = DISPLAY_MARGIN - 2;
    const float across = fminf(fmaxf(away * x / pitch, -most), most), whole = floorf(across);
    filter.line[t + SMOOTHED] = (int32_t)whole, filter.next[t + SMOOTHED] = across - whole;
    filter.row[t + SMOOTHED] = (int32_t)floorf(away * z / (float)f->step_m + 0.5f);
  }
  return filter;
}

// Smooths a block along its direction, sharpens it, mixes it with the picture before and maps it.
static void filter_block(sonde_echo *echo, const float *mean, uint32_t row, uint32_t line,
                         uint32_t every, const block_filter *filter) {
  static const float bell[2 * SMOOTHED + 1] = {0.0702f, 0.1311f, 0.1907f, 0.216f,
                                               0.1907f, 0.1311f, 0.0702f};
  const uint32_t stride = log_stride(echo), rows = echo->samples / every;
  const float sharp = (float)echo->frame.scanner->sharpening;
  const float keep = (float)echo->frame.scanner->persistence;
  const uint32_t end = row + 1 == rows ? echo->samples : (row + 1) * every;
  for (uint32_t n = row * every; n < end; ++n) {
    const float *here = echo->log + (size_t)n * stride + DISPLAY_MARGIN + line;
    float_x4 value = vload_float_x4(here), smooth = vset_float_x4(0);
    for (int t = 0; t < 2 * SMOOTHED + 1 && filter->weight > 0; ++t) {
      int32_t at = (int32_t)n + filter->row[t];
      at = at < 0 ? 0 : at < (int32_t)echo->samples ? at : (int32_t)echo->samples - 1;
      const float *p =
          echo->log + (size_t)at * stride + DISPLAY_MARGIN + (int32_t)line + filter->line[t];
      float_x4 left = vload_float_x4(p), right = vload_float_x4(p + 1);
      smooth = smooth + bell[t] * (left + filter->next[t] * (right - left));
    }
    if (filter->weight > 0) value = value + filter->weight * (smooth - value);
    if (sharp > 0) {
      // The blur: means of 3 x 3 coarse values, between coarse rows.
      const float to = ((float)n + 0.5f) / (float)every - 0.5f;
      const float low = fminf(fmaxf(to, 1), (float)rows - 3), from = floorf(low);
      const float *p = mean + (size_t)from * stride + DISPLAY_MARGIN + line;
      float_x4 sum[4];
      for (int k = 0; k < 4; ++k) {
        const float *q = p + (ptrdiff_t)(k - 1) * (ptrdiff_t)stride;
        sum[k] = vload_float_x4(q - 1) + vload_float_x4(q) + vload_float_x4(q + 1);
      }
      float_x4 first = sum[0] + sum[1] + sum[2], second = sum[1] + sum[2] + sum[3];
      float_x4 blur = (first + (low - from) * (second - first)) * (1.0f / 9);
      value = value + sharp * (value - blur);
    }
    // A live picture follows changes of more than 20 grey levels at once.
    float *held = echo->held + (size_t)n * echo->padded + line;
    if (echo->is_held && keep > 0) {
      float_x4 before = vload_float_x4(held), change = value - before;
      float_x4 still = vmin_float_x4(
          vmax_float_x4(2 - vabs_float_x4(change) * 0.05f, vset_float_x4(0)), vset_float_x4(1));
      value = before + (1 - keep * still) * change;
    }
    vstore_float_x4(held, value);
    float *grey = echo->grey + (size_t)n * echo->padded + line;
    for (int k = 0; k < BLOCK; ++k) {
      const float at = fminf(fmaxf(value[k], 0), 255) * (SONDE_MAP_STEPS / 255.0f);
      const int32_t step = (int32_t)at;
      grey[k] = echo->map[step] + (at - (float)step) * (echo->map[step + 1] - echo->map[step]);
    }
  }
}

void sonde_echo_display(sonde_echo *echo) {
  const frame *f = &echo->frame;
  const sonde_scanner *s = f->scanner;
  const uint32_t stride = log_stride(echo);
  SONDE_ASSERT(echo->looks > 0 && echo->padded % BLOCK == 0 && echo->log != NULL);
  // The mean of the looks in decibels, beside which the outer lines go on.
  const float range = (float)f->settings.dynamic_range_db;
  compress_job job = {.looks = echo->looks,
                      .lines = echo->padded,
                      .offset_db = (float)f->settings.gain_db - (float)s->white_db + range,
                      .grey_per_db = 255 / range};
  for (uint32_t n = 0; n < echo->samples; ++n) {
    const size_t at = (size_t)n * echo->padded;
    float *row = echo->log + (size_t)n * stride, *out = row + DISPLAY_MARGIN;
    for (uint32_t k = 0; k < echo->looks; ++k) job.look[k] = echo->look[k] + at;
    job.envelope = echo->envelope + at, job.grey = out;
    echo->kernels->compress(&job);
    for (int k = 0; k < DISPLAY_MARGIN; ++k) row[k] = out[0];
    for (uint32_t l = echo->lines; l < echo->padded + DISPLAY_MARGIN; ++l)
      out[l] = out[echo->lines - 1];
  }
  // Means of so many samples as a line is wide, on which directions are found.
  const double wide = f->pitch_m * (f->radius_m > 0 ? 1 + 0.5 * f->depth_m / f->radius_m : 1);
  const uint32_t every = (uint32_t)clamp(rint(wide / f->step_m), 1, 8);
  const uint32_t rows = echo->samples / every;
  const bool coarse = s->filter > 0 || s->sharpening > 0;
  float *mean = echo->coarse;
  SONDE_ASSERT(rows >= 4);
  for (uint32_t row = 0; coarse && row < rows; ++row) {
    float *out = mean + (size_t)row * stride;
    const float *in = echo->log + (size_t)row * every * stride, share = 1 / (float)every;
    memcpy(out, in, stride * sizeof *out);
    for (uint32_t n = 1; n < every; ++n)
      for (uint32_t l = 0; l < stride; ++l) out[l] += in[n * stride + l];
    for (uint32_t l = 0; l < stride; ++l) out[l] *= share;
  }
  for (uint32_t row = 0; row < rows; ++row)
    for (uint32_t line = 0; line < echo->padded; line += BLOCK) {
      block_filter filter = {.weight = 0};
      if (s->filter > 0) filter = find_filter(echo, mean, row, line, every);
      filter_block(echo, mean, row, line, every, &filter);
    }
  echo->is_held = echo->rolling;
}
