// From the scattered field to the envelope: local gain, interfaces, lateral kernels, axial kernels,
// receiver noise, time-gain compensation.
//
// sonde_echo_beam  all stages, row by row
// window_row       a row of the grid
// merge_row        one row of the field times what tissue and losses leave
// lateral_row      lateral kernels at its depth, normalised to unit speckle
// sonde_echo_compensation_db  time-gain compensation at a depth
// axial_rows       pulse, noise, compensation, modulus
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <string.h>

static const double noise_db = -118; // receiver noise below muscle at the skin, before TGC
// Compensation follows the tissue's losses until its echo is this far above the receiver's noise,
// and is turned down behind: the noise stays dark grain.
static const double least_signal_db = 6, turn_down_db = 10, turn_down_db_per_m = 400;

static float *ring_row(const sonde_echo *echo, uint32_t row) {
  uint32_t rows = 2 * echo->pad_samples + AXIAL_MOST;
  return echo->ring + (size_t)(row % rows) * RING_PLANES * echo->padded;
}

// Rms of the splatted field per line and sample: scatterers weighted by the elevation kernel's
// energy (integral of (1 - y^2)^2 over [-1, 1] is 16/15)^4 over [-1, 1] is 256/315).
static double field_rms(const sonde_echo *echo, double depth_m, double half_m) {
  const frame *f = &echo->frame;
  double density = echo->per_cell / (echo->cell_m * echo->cell_m * echo->cell_m);
  double pitch = f->pitch_m * (f->radius_m > 0 ? 1 + fmax(depth_m, 0) / f->radius_m : 1);
  return sqrt(density * pitch / SONDE_FINE * f->step_m * half_m * 16.0 / 15.0);
}

// The row of the window; what lies in its other part beside the window is added.
static float *window_row(sonde_echo *echo, uint32_t sample) {
  const uint32_t last = echo->window_rows, row = 1 + sample % last, stride = echo->grid_stride;
  float *here = echo->grid + (size_t)row * stride;
  if (row > 1 && row < last) return here;
  float *other = row == 1 ? here + (size_t)last * stride : echo->grid;
  for (uint32_t i = 0; i < stride; ++i) here[i] += other[i], other[i] = 0;
  return here;
}

static void merge_row(sonde_echo *echo, uint32_t sample, bool tissue) {
  double at = ((double)sample - echo->pad_samples) / (echo->samples - 1) * (SONDE_MEDIUM_ROWS - 1);
  at = clamp(at, 0, SONDE_MEDIUM_ROWS - 1.001);
  uint32_t row = (uint32_t)at;
  const float *top = echo->gain + (size_t)row * echo->gain_stride;
  merge_job job = {.grid = window_row(echo, sample), .count = echo->grid_lines / SONDE_FINE};
  if (tissue) job.top = top, job.low = top + echo->gain_stride, job.share = (float)(at - row);
  for (int k = 0; k < SONDE_FINE; ++k) job.re[k] = echo->line_re[k], job.im[k] = echo->line_im[k];
  SONDE_ASSERT(job.count < echo->gain_stride);
  echo->kernels->merge(&job);
}

static void lateral_row(sonde_echo *echo, uint32_t sample, bool tissue) {
  const beam_psf *psf = echo->psf;
  double depth = ((double)sample - echo->pad_samples) * echo->frame.step_m;
  int band;
  double t = sonde_psf_band(psf, depth, &band);
  const double *half_m = psf->elevation_m + band;
  double scale = tissue ? 1 / field_rms(echo, depth, half_m[0] + t * (half_m[1] - half_m[0])) : 1;
  const int *half = psf->half + band;
  lateral_job job = {.lines = echo->padded,
                     .half = half[0] > half[1] ? half[0] : half[1],
                     .out = ring_row(echo, sample)};
  const float *top = &psf->lateral[band][0][0][0], *next = &psf->lateral[band + 1][0][0][0];
  const float low = (float)(scale * (1 - t)), high = (float)(scale * t);
  float *tap = &job.tap[0][0][0];
  for (int i = 0; i < LATERAL_PARTS * SONDE_RANK * (job.half + 1); ++i)
    tap[i] = low * top[i] + high * next[i];
  for (int k = 0; k < SONDE_FINE; ++k) {
    job.re[k] = echo->line_re[k] + echo->pad_lines / SONDE_FINE;
    job.im[k] = echo->line_im[k] + echo->pad_lines / SONDE_FINE;
  }
  merge_row(echo, sample, tissue);
  const double *sheet = psf->sheet + band;
  if (tissue)
    sonde_sheet_lay(echo, sample, (float)(1 / (scale * (sheet[0] + t * (sheet[1] - sheet[0])))));
  echo->kernels->lateral(&job);
}

// Gain at a depth, dB. The slope is the operator's; the ceiling is the scanner's.
double sonde_echo_compensation_db(const frame *f, double depth_m) {
  SONDE_ASSERT(f != NULL && f->frequency_hz > 0 && depth_m >= 0);
  const double most = -least_signal_db - noise_db;
  double end_m = most / sonde_echo_default_tgc_db_per_m(f->frequency_hz);
  double down = clamp(turn_down_db_per_m * (depth_m - end_m), 0, turn_down_db);
  return fmin(f->tgc_db_per_m * depth_m, most - down);
}

// Samples from there on.
static void axial_rows(sonde_echo *echo, axial_job *job, uint32_t first, int samples, bool tissue) {
  const frame *f = &echo->frame;
  for (int t = 0; t < job->count + samples - 1; ++t)
    job->rows[t] = ring_row(echo, first + (uint32_t)t);
  job->samples = samples;
  for (int k = 0; k < samples; ++k) {
    uint32_t sample = first + (uint32_t)k;
    uint64_t draw = sonde_random_bits(echo->seed + 3 + sonde_interior_tick(echo->interior), sample);
    job->noise[k] = echo->noise + draw % (SONDE_NOISE - 2 * SONDE_MOST_LINES);
    double gain_db = tissue ? sonde_echo_compensation_db(f, sample * f->step_m) : 0;
    job->compensation[k] = amplitude_of_db((float)gain_db);
    job->envelope[k] = echo->envelope + (size_t)sample * echo->padded;
    job->grey[k] = echo->grey + (size_t)sample * echo->padded;
  }
  echo->kernels->axial(job);
}

// Taps are mirrored: an echo at sample n reaches n + t with axial[t].
static axial_job axial_of(const sonde_echo *echo, bool tissue) {
  const sonde_echo_settings *s = &echo->frame.settings;
  float range = (float)s->dynamic_range_db;
  axial_job job = {.count = 2 * (int)echo->pad_samples + 1,
                   .noise_size = tissue ? amplitude_of_db((float)noise_db) : 0,
                   .offset_db = (float)s->gain_db - sonde_white_db + range,
                   .grey_per_db = 255 / range,
                   .lines = echo->padded};
  for (int t = 0; t < job.count; ++t)
    for (int k = 0; k < SONDE_RANK; ++k)
      job.tap[t][k] = (float)echo->psf->axial[k][job.count - 1 - t];
  return job;
}

void sonde_echo_beam(sonde_echo *echo, uint32_t tier, bool tissue) {
  SONDE_ASSERT(echo->pad_lines % SONDE_FINE == 0 && tier < echo->tier_count);
  axial_job job = axial_of(echo, tissue);
  const uint32_t first = tier * echo->tier_rows, end = first + echo->tier_rows;
  for (uint32_t n = first; n < end && n < echo->grid_samples; ++n) {
    lateral_row(echo, n, tissue);
    if (n < 2 * echo->pad_samples) continue;
    uint32_t sample = n - 2 * echo->pad_samples; // the newest that has all its rows
    uint32_t before = sample % AXIAL_MOST;
    if (before + 1 == AXIAL_MOST || sample + 1 == echo->samples)
      axial_rows(echo, &job, sample - before, (int)before + 1, tissue);
  }
}

void sonde_echo_beam_end(sonde_echo *echo) {
  if (echo->padded == echo->lines) return;
  for (uint32_t n = 0; n < echo->samples; ++n)
    memcpy(echo->flat_envelope + (size_t)n * echo->lines, echo->envelope + (size_t)n * echo->padded,
           echo->lines * sizeof(float));
}
