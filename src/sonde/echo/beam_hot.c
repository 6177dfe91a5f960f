// From the scattered field to the envelope, a band of rows at a time: local gain, interfaces,
// lateral kernels, axial kernels, receiver noise, time-gain compensation, logarithm.
#include "base/base.h"
#include "base/random.h"
#include "echo/sound.h"

#include <string.h>

// Compensation follows the tissue's losses until its echo is this far above the receiver's noise,
// and is turned down behind: the noise stays dark grain.
static const double least_signal_db = 6, turn_down_db = 10, turn_down_db_per_m = 400;

// The slope of the compensation is the operator's; its ceiling and the sliders are the scanner's.
double sonde_echo_compensation_db(const frame *f, double depth_m) {
  SONDE_ASSERT(f != NULL && f->frequency_hz > 0 && depth_m >= 0);
  const double most = -least_signal_db - f->scanner->noise_db;
  double end_m = most / sonde_echo_default_tgc_db_per_m(f->frequency_hz);
  double down = clamp(turn_down_db_per_m * (depth_m - end_m), 0, turn_down_db);
  double gain = fmin(fmin(f->tgc_db_per_m * depth_m, f->scanner->compensation_db), most - down);
  // Between two sliders runs a cubic whose slopes are the harmonic means of the differences beside
  // it, 0 where these have two signs: it stays between its ends (Fritsch and Butland 1984).
  enum { SLIDERS = SONDE_SCANNER_SLIDERS };
  const double *slider = f->scanner->slider_db, at = depth_m / f->depth_m * (SLIDERS - 1);
  const int k = (int)clamp(at, 0, SLIDERS - 2);
  double t = clamp(at - k, 0, 1), slope[2], rise = slider[k + 1] - slider[k];
  for (int side = 0; side < 2; ++side) {
    const int n = k + (side ? 1 : -1);
    double other = n < 0 || n + 1 >= SLIDERS ? rise : slider[n + 1] - slider[n];
    slope[side] = rise * other > 0 ? 2 * rise * other / (rise + other) : 0;
  }
  return gain + slider[k] +
         t * (slope[0] +
              t * (3 * rise - 2 * slope[0] - slope[1] + t * (slope[0] + slope[1] - 2 * rise)));
}

void sonde_looks_begin(sonde_echo *echo) {
  const frame *f = &echo->frame;
  const sonde_scanner *s = f->scanner;
  // A live picture begins with all looks; then each one replaces the oldest.
  const bool all = !echo->rolling || echo->drawn_looks < echo->looks;
  SONDE_ASSERT(echo->looks > 0 && echo->looks <= SONDE_MOST_LOOKS);
  echo->first_look = all ? 0 : (echo->first_look + echo->now_looks) % echo->looks;
  echo->now_looks = all ? echo->looks : 1;
  if (all) echo->is_held = false;
  echo->drawn_looks = echo->looks;
  if (echo->bare) return;
  // Transmitted and received under an angle, an echo gains the phase 2 k sin(angle) per metre
  // across the line: the beam's pass band moves sideways.
  for (uint32_t k = 0; k < echo->looks; ++k) {
    const double to = echo->looks > 1 ? 2.0 * k / (echo->looks - 1) - 1 : 0;
    const double turn =
        4 * SONDE_PI / f->wavelength_m * sin(to * s->look_rad) * f->pitch_m / SONDE_FINE;
    for (uint32_t i = 0; i < echo->grid_lines; ++i) {
      const double angle = turn * ((double)i - 0.5 * echo->grid_lines);
      echo->ramp_re[k][i % SONDE_FINE][i / SONDE_FINE] = (float)cos(angle);
      echo->ramp_im[k][i % SONDE_FINE][i / SONDE_FINE] = (float)-sin(angle);
    }
  }
  // Side lobes: as much from every place within 3 mm, in phases without order.
  const double size = pow(10, s->haze_db / 20) / sqrt(HAZE_TAPS);
  for (int t = 0; t < HAZE_TAPS; ++t) {
    const double across = 3e-3 * (2.0 * t / (HAZE_TAPS - 1) - 1) / f->pitch_m;
    echo->haze.offset[t] = (int32_t)clamp(rint(across), -HAZE_REACH, HAZE_REACH);
  }
  echo->haze.size = (float)size;
}

void sonde_echo_ghosts(sonde_echo *echo) {
  const frame *f = &echo->frame;
  if (!(f->scanner->ghost_db > -90)) return;
  // Echoes of interfaces are over muscle speckle, and a mirror's would be so far above it.
  const float mirror_db = 50, least = 3;
  const float share = amplitude_of_db((float)f->scanner->ghost_db - mirror_db);
  const uint32_t count = echo->sheet_count;
  for (uint32_t row = 0; 2 * row < echo->grid_samples + echo->pad_samples; ++row)
    for (int32_t k = echo->first_sheet[row]; k >= 0; k = echo->sheet[k].next) {
      if ((uint32_t)k >= count) continue; // a ghost itself
      // Twice as deep is the phase twice as far, the way twice as lossy.
      const sheet_point p = echo->sheet[k];
      const float at = 2 * ((float)row - (float)echo->pad_samples + p.beyond);
      const float deep = at + (float)echo->pad_samples, nearest = floorf(deep + 0.5f);
      if (p.re * p.re + p.im * p.im < least * least) continue;
      if (!(at > 0 && nearest < (float)echo->grid_samples)) continue;
      if (echo->sheet_count == SONDE_SHEET_POINTS) return;
      int32_t *first = echo->first_sheet + (uint32_t)nearest;
      echo->sheet[echo->sheet_count] =
          (sheet_point){share * (p.re * p.re - p.im * p.im), share * 2 * p.re * p.im,
                        deep - nearest, p.column, *first};
      *first = (int32_t)echo->sheet_count++;
    }
}

// Row of the ring of a look's lateral results, of which the axial kernels read the last ones.
static float *ring_row(const sonde_echo *echo, uint32_t look, uint32_t row) {
  uint32_t rows = 2 * echo->pad_samples + AXIAL_MOST, most = 2 * SONDE_MOST_TAPS + AXIAL_MOST;
  return echo->ring + ((size_t)look * most + row % rows) * RING_PLANES * echo->padded;
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
  lateral_job job = {.lines = echo->padded, .half = half[0] > half[1] ? half[0] : half[1]};
  const float *top = &psf->lateral[above][0][0][0], *next = &psf->lateral[above + 1][0][0][0];
  const float low = (float)(scale * (1 - t)), high = (float)(scale * t);
  float *tap = &job.tap[0][0][0];
  for (int i = 0; i < LATERAL_PARTS * SONDE_RANK * (job.half + 1); ++i)
    tap[i] = low * top[i] + high * next[i];
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
  // Every look of it, spread by aberration.
  const float deep = (float)(clamp(depth / f->depth_m, 0, 1 - 1e-6) * KEPT_DEPTHS);
  const uint32_t table = (uint32_t)deep;
  for (uint32_t n = 0; n < echo->now_looks; ++n) {
    const uint32_t which = (echo->first_look + n) % echo->looks;
    const bool turned = tissue && !echo->bare;
    look_job look = {.count = merge.count, .haze = f->scanner->haze_db > -90 ? &echo->haze : NULL};
    if (sonde_sound_on(echo))
      look.kept = echo->sound->kept[table], look.kept_low = echo->sound->kept[table + 1],
      look.share = deep - (float)table, look.halo = &echo->sound->halo;
    for (int k = 0; k < SONDE_FINE; ++k) {
      look.re[k] = echo->line_re[k], look.im[k] = echo->line_im[k];
      look.ramp_re[k] = echo->ramp_re[which][k], look.ramp_im[k] = echo->ramp_im[which][k];
      look.out_re[k] = echo->look_re[k], look.out_im[k] = echo->look_im[k];
      job.re[k] = (turned ? look.out_re[k] : look.re[k]) + echo->pad_lines / SONDE_FINE;
      job.im[k] = (turned ? look.out_im[k] : look.im[k]) + echo->pad_lines / SONDE_FINE;
    }
    if (turned) echo->kernels->look(&look);
    job.out = ring_row(echo, which, sample);
    echo->kernels->lateral(&job);
  }
}

void sonde_echo_beam(sonde_echo *echo, uint32_t band, bool tissue) {
  SONDE_ASSERT(echo->pad_lines % SONDE_FINE == 0 && band < echo->band_count);
  const frame *f = &echo->frame;
  const float range = (float)f->settings.dynamic_range_db;
  axial_job job = {.count = 2 * (int)echo->pad_samples + 1,
                   .noise_size = tissue ? amplitude_of_db((float)f->scanner->noise_db) : 0,
                   .offset_db = (float)f->settings.gain_db - (float)f->scanner->white_db + range,
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
    for (uint32_t k = 0; k <= before; ++k) {
      double gain_db = tissue ? sonde_echo_compensation_db(f, (first + k) * f->step_m) : 0;
      job.compensation[k] = amplitude_of_db((float)gain_db);
    }
    for (uint32_t look = 0; look < echo->now_looks; ++look) {
      const uint32_t which = (echo->first_look + look) % echo->looks;
      for (int t = 0; t < job.count + job.samples - 1; ++t)
        job.rows[t] = ring_row(echo, which, first + (uint32_t)t);
      for (uint32_t k = 0; k <= before; ++k) {
        const uint32_t sample = first + k;
        const size_t at = (size_t)sample * echo->padded;
        uint64_t draw = sonde_random_bits(echo->seed + 3 + sonde_interior_tick(echo->interior),
                                          sample + which * echo->samples);
        job.noise[k] = echo->noise + draw % (SONDE_NOISE - 2 * SONDE_MOST_LINES);
        job.envelope[k] = (echo->bare ? echo->envelope : echo->look[which]) + at;
        job.grey[k] = echo->bare ? echo->grey + at : NULL;
      }
      echo->kernels->axial(&job);
    }
  }
}

void sonde_echo_beam_end(sonde_echo *echo) {
  if (echo->padded == echo->lines) return;
  for (uint32_t n = 0; n < echo->samples; ++n)
    memcpy(echo->flat_envelope + (size_t)n * echo->lines, echo->envelope + (size_t)n * echo->padded,
           echo->lines * sizeof(float));
}
