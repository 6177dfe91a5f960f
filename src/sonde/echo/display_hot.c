// What a scanner does between the envelope and the picture, on scan lines: mean of the looks,
// logarithm, smoothing along lines of tissue, sharpening, persistence, grey map.
#include "base/base.h"
#include "base/vector.h"
#include "echo/echo.h"

#include <string.h>

enum { BLOCK = 4, SIDE_TAPS = 2, TAPS = 2 * SIDE_TAPS + 1 }; // lines of a block; smoothing taps

// Means over `every` samples with the lines beside the picture, and what is found in them.
typedef struct coarse {
  uint32_t rows, every, stride; // floats per row, of the logarithm as well
  float *mean, *blur;           // [rows][stride] the means; means of 3 x 3 of them
  float (*tensor)[3];           // [rows][blocks] sums of dx dx, dz dz, dx dz over a block
  uint32_t blocks;
} coarse;

// Smoothing of a block: taps along a direction, each between two lines.
typedef struct block_filter {
  int32_t row[TAPS], line[TAPS]; // from a point of the block
  float next[TAPS];              // share of the line after it
  float weight;                  // of the smoothed value
} block_filter;

// As instructions, where the library's functions would be called.
static inline float between(float value, float low, float high) {
  return value < low ? low : value > high ? high : value;
}

static uint32_t within(int32_t row, uint32_t rows) {
  return row < 0 ? 0 : row < (int32_t)rows ? (uint32_t)row : rows - 1;
}

// The coarse rows of a logarithm, their blur and the structure tensors of their blocks.
static void make_coarse(const sonde_echo *echo, const coarse *c) {
  const uint32_t stride = c->stride;
  const float share = 1 / (float)c->every, ninth = 1.0f / 9;
  for (uint32_t row = 0; row < c->rows; ++row) {
    const float *in = echo->log + (size_t)row * c->every * stride;
    float *out = c->mean + (size_t)row * stride;
    memcpy(out, in, stride * sizeof *out);
    for (uint32_t n = 1; n < c->every; ++n)
      for (uint32_t l = 0; l < stride; ++l) out[l] += in[n * stride + l];
    for (uint32_t l = 0; l < stride; ++l) out[l] *= share;
  }
  const frame *f = &echo->frame;
  for (uint32_t row = 0; row < c->rows; ++row) {
    const float *here = c->mean + (size_t)row * stride;
    const float *above = c->mean + (size_t)within((int32_t)row - 1, c->rows) * stride;
    const float *below = c->mean + (size_t)within((int32_t)row + 1, c->rows) * stride;
    const double depth = (row + 0.5) * c->every * f->step_m;
    const double pitch = f->pitch_m * (f->radius_m > 0 ? 1 + depth / f->radius_m : 1);
    // A slope along depth in units of one from line to line.
    const float steep = (float)(pitch / (c->every * f->step_m));
    for (uint32_t block = 0; block < c->blocks; ++block) {
      const uint32_t l = DISPLAY_MARGIN + BLOCK * block;
      const float_x4 left = vload_float_x4(here + l - 1), right = vload_float_x4(here + l + 1);
      const float_x4 up = vload_float_x4(above + l), down = vload_float_x4(below + l);
      const float_x4 dx = right - left, dz = steep * (down - up);
      const float_x4 xx = dx * dx, zz = dz * dz, xz = dx * dz;
      float *sum = c->tensor[row * c->blocks + block];
      sum[0] = vsum_float_x4(xx), sum[1] = vsum_float_x4(zz), sum[2] = vsum_float_x4(xz);
      const float_x4 three = left + vload_float_x4(here + l) + right;
      const float_x4 over = vload_float_x4(above + l - 1) + up + vload_float_x4(above + l + 1);
      const float_x4 under = vload_float_x4(below + l - 1) + down + vload_float_x4(below + l + 1);
      vstore_float_x4(c->blur + (size_t)row * stride + l, (three + over + under) * ninth);
    }
  }
}

// The direction in which the picture about a block changes least, and how much less than across it.
static block_filter find_filter(const sonde_echo *echo, const coarse *c, uint32_t row,
                                uint32_t block) {
  const frame *f = &echo->frame;
  float xx = 0, zz = 0, xz = 0;
  for (int32_t j = -2; j <= 2; ++j) {
    const float(*at)[3] =
        (const float(*)[3])c->tensor + within((int32_t)row + j, c->rows) * c->blocks;
    const uint32_t left = block > 0 ? block - 1 : block;
    const uint32_t right = block + 1 < c->blocks ? block + 1 : block;
    xx += at[block][0] + 0.5f * (at[left][0] + at[right][0]);
    zz += at[block][1] + 0.5f * (at[left][1] + at[right][1]);
    xz += at[block][2] + 0.5f * (at[left][2] + at[right][2]);
  }
  const float difference = zz - xx, length = sqrtf(difference * difference + 4 * xz * xz);
  const float coherence = length / (xx + zz + 1e-9f);
  const float strength = between((coherence - 0.15f) * 2, 0, 1);
  block_filter filter = {.weight = (float)f->scanner->filter * strength};
  if (!(filter.weight > 0)) return filter;
  const float x = sqrtf(0.5f * between(1 + difference / (length + 1e-12f), 0, 2));
  const float side = sqrtf(between(1 - x * x, 0, 1)), z = xz > 0 ? -side : side;
  const float depth = (float)((row + 0.5) * c->every * f->step_m);
  const float pitch = (float)f->pitch_m * (f->radius_m > 0 ? 1 + depth / (float)f->radius_m : 1);
  const float most = DISPLAY_MARGIN - 2, reach = (float)f->scanner->filter_m / SIDE_TAPS;
  for (int t = 0; t < TAPS; ++t) {
    const float away = reach * (float)(t - SIDE_TAPS);
    const float across = between(away * x / pitch, -most, most);
    filter.line[t] = (int32_t)(across + DISPLAY_MARGIN) - DISPLAY_MARGIN; // rounded down
    filter.next[t] = across - (float)filter.line[t];
    const float rows = away * z / (float)f->step_m;
    filter.row[t] = (int32_t)(rows < 0 ? rows - 0.5f : rows + 0.5f);
  }
  return filter;
}

// Smooths a block along its direction, sharpens it, mixes it with the picture before and maps it.
static void filter_block(sonde_echo *echo, const coarse *c, uint32_t row, uint32_t block,
                         const block_filter *filter) {
  static const float bell[TAPS] = {0.11f, 0.24f, 0.30f, 0.24f, 0.11f};
  const uint32_t stride = c->stride, line = BLOCK * block;
  const float sharp = (float)echo->frame.scanner->sharpening;
  const float keep = echo->is_held ? (float)echo->frame.scanner->persistence : 0;
  const uint32_t end = row + 1 == c->rows ? echo->samples : (row + 1) * c->every;
  for (uint32_t n = row * c->every; n < end; ++n) {
    const float *log = echo->log + DISPLAY_MARGIN + line;
    float_x4 value = vload_float_x4(log + (size_t)n * stride);
    if (filter->weight > 0) {
      float_x4 smooth = vset_float_x4(0);
      for (int t = 0; t < TAPS; ++t) {
        const size_t at = within((int32_t)n + filter->row[t], echo->samples);
        const float *p = log + (ptrdiff_t)(at * stride) + filter->line[t];
        const float_x4 left = vload_float_x4(p), right = vload_float_x4(p + 1);
        smooth = smooth + bell[t] * (left + filter->next[t] * (right - left));
      }
      value = value + filter->weight * (smooth - value);
    }
    if (sharp > 0) {
      // The blur between two coarse rows.
      const float to = ((float)n + 0.5f) / (float)c->every - 0.5f;
      const float low = between(to, 0, (float)c->rows - 1.001f);
      const uint32_t from = (uint32_t)low;
      const float *p = c->blur + (size_t)from * stride + DISPLAY_MARGIN + line;
      const float_x4 top = vload_float_x4(p), next = vload_float_x4(p + stride);
      value = value + sharp * (value - (top + (low - (float)from) * (next - top)));
    }
    // A live picture follows changes of more than 20 grey levels at once.
    float *held = echo->held + (size_t)n * echo->padded + line;
    if (keep > 0) {
      const float_x4 before = vload_float_x4(held), change = value - before;
      const float_x4 still = vmin_float_x4(
          vmax_float_x4(2 - vabs_float_x4(change) * 0.05f, vset_float_x4(0)), vset_float_x4(1));
      value = before + (1 - keep * still) * change;
    }
    if (echo->rolling) vstore_float_x4(held, value);
    const float_x4 shown =
        vmin_float_x4(vmax_float_x4(value, vset_float_x4(0)), vset_float_x4(255));
    const int_x4 step = vint_float_x4(shown * (SONDE_MAP_STEPS / 255.0f) + 0.5f);
    float *grey = echo->grey + (size_t)n * echo->padded + line;
    for (int k = 0; k < BLOCK; ++k) grey[k] = echo->map[step[k]];
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
  for (uint32_t n = 0; n < echo->samples; ++n) {
    const size_t at = (size_t)n * echo->padded;
    float *row = echo->log + (size_t)n * c.stride, *out = row + DISPLAY_MARGIN;
    for (uint32_t k = 0; k < echo->looks; ++k) job.look[k] = echo->look[k] + at;
    job.envelope = echo->envelope + at, job.grey = out;
    echo->kernels->compress(&job);
    for (int k = 0; k < DISPLAY_MARGIN; ++k) row[k] = out[0];
    for (uint32_t l = echo->lines; l < echo->padded + DISPLAY_MARGIN; ++l)
      out[l] = out[echo->lines - 1];
  }
  // Means of so many samples as a line is wide, in which directions are found.
  const double wide = f->pitch_m * (f->radius_m > 0 ? 1 + 0.5 * f->depth_m / f->radius_m : 1);
  c.every = (uint32_t)clamp(rint(wide / f->step_m), 1, 8);
  c.rows = echo->samples / c.every;
  SONDE_ASSERT(c.rows >= 4);
  if (s->filter > 0 || s->sharpening > 0) make_coarse(echo, &c);
  for (uint32_t row = 0; row < c.rows; ++row)
    for (uint32_t block = 0; block < c.blocks; ++block) {
      block_filter filter = {.weight = 0};
      if (s->filter > 0) filter = find_filter(echo, &c, row, block);
      filter_block(echo, &c, row, block, &filter);
    }
  echo->is_held = echo->rolling;
}
