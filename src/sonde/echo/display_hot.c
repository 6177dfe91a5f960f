// What a scanner does between the envelope and the picture, on scan lines: mean of the looks,
// logarithm, smoothing along lines of tissue, sharpening, persistence, grey map.
#include "base/base.h"
#include "base/vector.h"
#include "echo/echo.h"

#include <string.h>

enum { BLOCK = SMOOTH_LINES, SIDE_TAPS = SMOOTH_TAPS / 2 };

// Means over `every` samples with the lines beside the picture, and what is found in them.
typedef struct coarse {
  uint32_t rows, every, stride; // floats per row, of the logarithm as well
  float *mean, *blur;           // [rows][stride] the means; means of 3 x 3 of them
  float (*tensor)[3];           // [rows][blocks] sums of dx dx, dz dz, dx dz over a block
  uint32_t blocks;
} coarse;

// As instructions, where the library's functions would be called.
static inline float between(float value, float low, float high) {
  return value < low ? low : value > high ? high : value;
}

static uint32_t within(int32_t row, uint32_t rows) {
  return row < 0 ? 0 : row < (int32_t)rows ? (uint32_t)row : rows - 1;
}

static uint32_t samples_behind(const sonde_echo *echo, const coarse *c, uint32_t row) {
  return row + 1 == c->rows ? echo->samples : (row + 1) * c->every;
}

// The looks' mean in decibels, beside which the outer lines go on, and its means: a coarse row.
static void compress_row(sonde_echo *echo, const coarse *c, compress_job *job, uint32_t row) {
  float *mean = c->mean + (size_t)row * c->stride;
  const float share = 1 / (float)c->every;
  for (uint32_t n = row * c->every; n < samples_behind(echo, c, row); ++n) {
    const size_t at = (size_t)n * echo->padded;
    float *log = echo->log + (size_t)n * c->stride, *out = log + DISPLAY_MARGIN;
    for (uint32_t k = 0; k < echo->looks; ++k) job->look[k] = echo->look[k] + at;
    job->envelope = echo->envelope + at, job->grey = out;
    echo->kernels->compress(job);
    for (int k = 0; k < DISPLAY_MARGIN; ++k) log[k] = out[0];
    for (uint32_t l = echo->lines; l < echo->padded + DISPLAY_MARGIN; ++l)
      out[l] = out[echo->lines - 1];
    const uint32_t in_row = n - row * c->every;
    if (in_row < c->every)
      for (uint32_t l = 0; l < c->stride; ++l)
        mean[l] = share * log[l] + (in_row > 0 ? mean[l] : 0);
  }
}

// Blur and structure tensors of a coarse row.
static void compare_row(const sonde_echo *echo, const coarse *c, uint32_t row) {
  const frame *f = &echo->frame;
  const uint32_t stride = c->stride;
  const float ninth = 1.0f / 9;
  const float *here = c->mean + (size_t)row * stride;
  const float *above = c->mean + (size_t)within((int32_t)row - 1, c->rows) * stride;
  const float *below = c->mean + (size_t)within((int32_t)row + 1, c->rows) * stride;
  const double depth = (row + 0.5) * c->every * f->step_m;
  const double pitch = f->pitch_m * (f->radius_m > 0 ? 1 + depth / f->radius_m : 1);
  // A slope along depth in units of one from line to line.
  const float steep = (float)(pitch / (c->every * f->step_m));
  for (uint32_t block = 0; block < c->blocks; ++block) {
    float_x4 xx = vset_float_x4(0), zz = xx, xz = xx;
    for (uint32_t k = 0; k < BLOCK; k += 4) {
      const uint32_t l = DISPLAY_MARGIN + BLOCK * block + k;
      const float_x4 left = vload_float_x4(here + l - 1), right = vload_float_x4(here + l + 1);
      const float_x4 up = vload_float_x4(above + l), down = vload_float_x4(below + l);
      const float_x4 dx = right - left, dz = steep * (down - up);
      xx = xx + dx * dx, zz = zz + dz * dz, xz = xz + dx * dz;
      const float_x4 three = left + vload_float_x4(here + l) + right;
      const float_x4 over = vload_float_x4(above + l - 1) + up + vload_float_x4(above + l + 1);
      const float_x4 under = vload_float_x4(below + l - 1) + down + vload_float_x4(below + l + 1);
      vstore_float_x4(c->blur + (size_t)row * stride + l, (three + over + under) * ninth);
    }
    float *sum = c->tensor[row * c->blocks + block];
    sum[0] = vsum_float_x4(xx), sum[1] = vsum_float_x4(zz), sum[2] = vsum_float_x4(xz);
  }
}

// The direction in which the picture about a block changes least, and how much less than across it.
static void find_direction(const sonde_echo *echo, const coarse *c, uint32_t row, uint32_t block,
                           smooth_job *job) {
  const frame *f = &echo->frame;
  float xx = 0, zz = 0, xz = 0;
  for (int32_t j = -2; j <= 2; ++j) {
    const float *at = c->tensor[within((int32_t)row + j, c->rows) * c->blocks + block];
    xx += at[0], zz += at[1], xz += at[2];
  }
  const float difference = zz - xx, length = sqrtf(difference * difference + 4 * xz * xz);
  const float coherence = length / (xx + zz + 1e-9f);
  job->weight = (float)f->scanner->filter * between((coherence - 0.15f) * 2, 0, 1);
  if (!(job->weight > 0)) return;
  const float x = sqrtf(0.5f * between(1 + difference / (length + 1e-12f), 0, 2));
  const float side = sqrtf(between(1 - x * x, 0, 1)), z = xz > 0 ? -side : side;
  const float depth = (float)((row + 0.5) * c->every * f->step_m);
  const float pitch = (float)f->pitch_m * (f->radius_m > 0 ? 1 + depth / (float)f->radius_m : 1);
  const float most = DISPLAY_MARGIN - 2, reach = (float)f->scanner->filter_m / SIDE_TAPS;
  for (int t = 0; t < SMOOTH_TAPS; ++t) {
    const float away = reach * (float)(t - SIDE_TAPS);
    const float across = between(away * x / pitch, -most, most);
    job->line[t] = (int32_t)(across + DISPLAY_MARGIN) - DISPLAY_MARGIN; // rounded down
    job->next[t] = across - (float)job->line[t];
    const float rows = away * z / (float)f->step_m;
    job->row[t] = (int32_t)(rows < 0 ? rows - 0.5f : rows + 0.5f);
  }
}

void sonde_echo_display(sonde_echo *echo) {
  const frame *f = &echo->frame;
  const sonde_scanner *s = f->scanner;
  coarse c = {.stride = echo->padded + 2 * DISPLAY_MARGIN,
              .mean = echo->coarse,
              .blur = echo->blurred,
              .tensor = echo->tensor,
              .blocks = echo->padded / BLOCK};
  SONDE_ASSERT(echo->looks > 0 && echo->padded % BLOCK == 0 && echo->log != NULL);
  // The mean of the looks in decibels, beside which the outer lines go on.
  const float range = (float)f->settings.dynamic_range_db;
  compress_job job = {.looks = echo->looks,
                      .lines = echo->padded,
                      .offset_db = (float)f->settings.gain_db - (float)s->white_db + range,
                      .grey_per_db = 255 / range};
  smooth_job smooth = {.stride = c.stride, .samples = echo->samples, .out_stride = echo->padded};
  show_job show = {.sharp = (float)s->sharpening,
                   .keep = echo->is_held ? (float)s->persistence : 0,
                   .map = echo->map,
                   .steps = SONDE_MAP_STEPS,
                   .lines = echo->padded};
  // Means of so many samples as a line is wide, in which directions are found.
  const double wide = f->pitch_m * (f->radius_m > 0 ? 1 + 0.5 * f->depth_m / f->radius_m : 1);
  c.every = (uint32_t)clamp(rint(wide / f->step_m), 1, 8);
  c.rows = echo->samples / c.every;
  SONDE_ASSERT(c.rows >= 4);
  // Each coarse row as soon as there are the rows that it reads: two below for the direction with
  // one more for their slopes, and as far as the smoothing reaches.
  const uint32_t ahead = 3 + (uint32_t)(s->filter_m / (f->step_m * c.every));
  const bool compared = s->filter > 0 || s->sharpening > 0;
  for (uint32_t row = 0; row < c.rows + ahead; ++row) {
    if (row < c.rows) compress_row(echo, &c, &job, row);
    if (compared && row > 0 && row <= c.rows) compare_row(echo, &c, row - 1);
    if (row < ahead) continue;
    // Smoothed block by block, then shown sample by sample.
    const uint32_t done = row - ahead, end = samples_behind(echo, &c, done);
    smooth.first = done * c.every, smooth.end = end;
    for (uint32_t block = 0; block < c.blocks; ++block) {
      if (s->filter > 0) find_direction(echo, &c, done, block, &smooth);
      smooth.log = echo->log + DISPLAY_MARGIN + BLOCK * block;
      smooth.out = echo->grey + (size_t)smooth.first * echo->padded + BLOCK * block;
      echo->kernels->smooth_lines(&smooth);
    }
    for (uint32_t n = smooth.first; n < end; ++n) {
      // The blur between two coarse rows.
      const float to = ((float)n + 0.5f) / (float)c.every - 0.5f;
      const float low = between(to, 0, (float)c.rows - 1.001f);
      show.top = c.blur + (size_t)low * c.stride + DISPLAY_MARGIN, show.low = show.top + c.stride;
      show.share = low - (float)(uint32_t)low;
      show.grey = echo->grey + (size_t)n * echo->padded;
      if (echo->rolling) show.held = echo->held + (size_t)n * echo->padded;
      echo->kernels->show(&show);
    }
  }
  echo->is_held = echo->rolling;
}
