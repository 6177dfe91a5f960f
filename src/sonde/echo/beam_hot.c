// From the scattered field to the envelope, a band of rows at a time: local gain, interfaces,
// lateral kernels, axial kernels, receiver noise, time-gain compensation, logarithm.
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <string.h>

static const double noise_db = -118; // receiver noise below muscle at the skin, before TGC
// Compensation follows the tissue's losses until its echo is this far above the receiver's noise,
// and is turned down behind: the noise stays dark grain.
static const double least_signal_db = 6, turn_down_db = 10, turn_down_db_per_m = 400;

// The slope of the compensation is the operator's; its ceiling is the scanner's.
double sonde_echo_compensation_db(const frame *f, double depth_m) {
  SONDE_ASSERT(f != NULL && f->frequency_hz > 0 && depth_m >= 0);
  const double most = -least_signal_db - noise_db;
  double end_m = most / sonde_echo_default_tgc_db_per_m(f->frequency_hz);
  double down = clamp(turn_down_db_per_m * (depth_m - end_m), 0, turn_down_db);
  return fmin(f->tgc_db_per_m * depth_m, most - down);
}

// Row of the ring of lateral results, of which the axial kernels read the last ones.
static float *ring_row(const sonde_echo *echo, uint32_t row) {
  uint32_t rows = 2 * echo->pad_samples + AXIAL_MOST;
  return echo->ring + (size_t)(row % rows) * RING_PLANES * echo->padded;
}

// Lateral kernels at the row's depth, normalised to unit speckle; interfaces join before them.
static void filter_row(sonde_echo *echo, uint32_t sample, bool tissue) {
  const frame *f = &echo->frame;
  const beam_psf *psf = echo->psf;
  const double depth = ((double)sample - echo->pad_samples) * f->step_m;
  int above;
  const double t = sonde_psf_depth(psf, depth, &above);
  // Rms of the splatted field per line and sample: scatterers weighted by the elevation kernel's
  // energy (integral of (1 - y^2)^2 over [-1, 1] is 16/15).
  double scale = 1;
  if (tissue) {
    const double *half_m = psf->elevation_m + above;
    double density = echo->per_cell / (echo->cell_m * echo->cell_m * echo->cell_m);
    double pitch = f->pitch_m * (f->radius_m > 0 ? 1 + fmax(depth, 0) / f->radius_m : 1);
    double slab = half_m[0] + t * (half_m[1] - half_m[0]);
    scale = 1 / sqrt(density * pitch / SONDE_FINE * f->step_m * slab * 16.0 / 15.0);
  }
  const int *half = psf->half + above;
  lateral_job job = {.lines = echo->padded,
                     .half = half[0] > half[1] ? half[0] : half[1],
                     .out = ring_row(echo, sample)};
  const float *top = &psf->lateral[above][0][0][0], *next = &psf->lateral[above + 1][0][0][0];
  const float low = (float)(scale * (1 - t)), high = (float)(scale * t);
  float *tap = &job.tap[0][0][0];
  for (int i = 0; i < LATERAL_PARTS * SONDE_RANK * (job.half + 1); ++i)
    tap[i] = low * top[i] + high * next[i];
  for (int k = 0; k < SONDE_FINE; ++k) {
    job.re[k] = echo->line_re[k] + echo->pad_lines / SONDE_FINE;
    job.im[k] = echo->line_im[k] + echo->pad_lines / SONDE_FINE;
  }
  // One row of the field, times what tissue and losses leave of it, into the row of columns.
  // The window's first and last rows have parts beside it.
  const uint32_t last = echo->window_rows, row = 1 + sample % last, stride = echo->grid_stride;
  float *here = echo->grid + (size_t)row * stride;
  if (row == 1 || row == last) {
    float *other = row == 1 ? here + (size_t)last * stride : echo->grid;
    for (uint32_t i = 0; i < stride; ++i) here[i] += other[i], other[i] = 0;
  }
  // Gain between two rows of the march.
  double at = ((double)sample - echo->pad_samples) / (echo->samples - 1) * (SONDE_MEDIUM_ROWS - 1);
  at = clamp(at, 0, SONDE_MEDIUM_ROWS - 1.001);
  const float *gain = echo->gain + (size_t)(uint32_t)at * echo->gain_stride;
  merge_job merge = {.grid = here, .count = echo->grid_lines / SONDE_FINE};
  if (tissue)
    merge.top = gain, merge.low = gain + echo->gain_stride,
    merge.share = (float)(at - (uint32_t)at);
  for (int k = 0; k < SONDE_FINE; ++k)
    merge.re[k] = echo->line_re[k], merge.im[k] = echo->line_im[k];
  SONDE_ASSERT(merge.count < echo->gain_stride);
  echo->kernels->merge(&merge);
  const double *sheet = psf->sheet + above;
  if (tissue)
    sonde_sheet_lay(echo, sample, (float)(1 / (scale * (sheet[0] + t * (sheet[1] - sheet[0])))));
  echo->kernels->lateral(&job);
}

void sonde_echo_beam(sonde_echo *echo, uint32_t band, bool tissue) {
  SONDE_ASSERT(echo->pad_lines % SONDE_FINE == 0 && band < echo->band_count);
  const frame *f = &echo->frame;
  const float range = (float)f->settings.dynamic_range_db;
  axial_job job = {.count = 2 * (int)echo->pad_samples + 1,
                   .noise_size = tissue ? amplitude_of_db((float)noise_db) : 0,
                   .offset_db = (float)f->settings.gain_db - sonde_white_db + range,
                   .grey_per_db = 255 / range,
                   .lines = echo->padded};
  // Taps are mirrored: an echo at sample n reaches n + t with axial[t].
  for (int t = 0; t < job.count; ++t)
    for (int k = 0; k < SONDE_RANK; ++k)
      job.tap[t][k] = (float)echo->psf->axial[k][job.count - 1 - t];
  const uint32_t start = band * echo->band_rows, end = start + echo->band_rows;
  for (uint32_t n = start; n < end && n < echo->grid_samples; ++n) {
    filter_row(echo, n, tissue);
    // Samples up to the newest that has all its rows, some at a time.
    if (n < 2 * echo->pad_samples) continue;
    const uint32_t newest = n - 2 * echo->pad_samples, before = newest % AXIAL_MOST;
    if (before + 1 != AXIAL_MOST && newest + 1 != echo->samples) continue;
    const uint32_t first = newest - before;
    job.samples = (int)before + 1;
    for (int t = 0; t < job.count + job.samples - 1; ++t)
      job.rows[t] = ring_row(echo, first + (uint32_t)t);
    for (uint32_t k = 0; k <= before; ++k) {
      const uint32_t sample = first + k;
      uint64_t draw =
          sonde_random_bits(echo->seed + 3 + sonde_interior_tick(echo->interior), sample);
      job.noise[k] = echo->noise + draw % (SONDE_NOISE - 2 * SONDE_MOST_LINES);
      double gain_db = tissue ? sonde_echo_compensation_db(f, sample * f->step_m) : 0;
      job.compensation[k] = amplitude_of_db((float)gain_db);
      job.envelope[k] = echo->envelope + (size_t)sample * echo->padded;
      job.grey[k] = echo->grey + (size_t)sample * echo->padded;
    }
    echo->kernels->axial(&job);
  }
}

void sonde_echo_beam_end(sonde_echo *echo) {
  if (echo->padded == echo->lines) return;
  for (uint32_t n = 0; n < echo->samples; ++n)
    memcpy(echo->flat_envelope + (size_t)n * echo->lines, echo->envelope + (size_t)n * echo->padded,
           echo->lines * sizeof(float));
}
