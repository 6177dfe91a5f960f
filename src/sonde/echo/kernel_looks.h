// Jobs of the inner loops that make a scanner's picture: looks, the beam's kernels, the looks'
// mean, pixels.
#ifndef SONDE_SRC_ECHO_KERNEL_LOOKS_H
#define SONDE_SRC_ECHO_KERNEL_LOOKS_H

#include "echo/psf.h"
#include "sonde/echo_scanner.h"

#include <stdbool.h>
#include <stdint.h>

enum {
  SONDE_FINE = 2, // columns of the grid per scan line
  AXIAL_MOST = 4, // samples summed at once
};

// Side lobes: what neighbours send into a column, a fixed pattern of equal power. Its phases are
// quarter turns, which need no multiplication, in no order.
enum { HAZE_TAPS = 7, HAZE_REACH = 16 }; // lines
static const int haze_turns[HAZE_TAPS] = {1, 0, 3, 2, 0, 1, 2};
typedef struct haze_taps {
  int32_t offset[HAZE_TAPS]; // lines
  float size;                // amplitude of each
} haze_taps;

// Columns whose echo aberration sends into a column, in place of what the column's own loses.
enum { HALO_TAPS = 4 };
static const int halo_turns[HALO_TAPS] = {0, 3, 2, 0};
static const float halo_size = 0.5f; // all of the lost power
typedef struct halo_taps {
  int32_t offset[HALO_TAPS]; // lines
} halo_taps;

// A merged row with its side lobes, times a phase per column.
typedef struct look_job {
  const float *re[SONDE_FINE], *im[SONDE_FINE];           // [count], HAZE_REACH more on both sides
  const float *ramp_re[SONDE_FINE], *ramp_im[SONDE_FINE]; // [count]
  const haze_taps *haze;                                  // NULL: none
  // [count] amplitude that a column keeps, at the depths above and below; NULL: all
  const float *kept, *kept_low;
  float share; // of the distance from kept to kept_low
  const halo_taps *halo;
  uint32_t count;                                 // multiple of ECHO_ALIGN
  float *out_re[SONDE_FINE], *out_im[SONDE_FINE]; // [count]
} look_job;

typedef struct lateral_job {
  const float *re[SONDE_FINE], *im[SONDE_FINE]; // columns on lines, columns between; as merged
  uint32_t lines;                               // multiple of ECHO_ALIGN
  int half;
  // re, im - re, re + im: with z = x + i y, sums of re (x + y), (im - re) x and (re + im) y take
  // three multiplications instead of four
  float tap[SONDE_MOST_TAPS + 1][SONDE_RANK][LATERAL_PARTS];
  float *out; // [RING_PLANES][lines] re, im of each term
} lateral_job;

// Some samples of all lines: each starts a row after the one before.
typedef struct axial_job {
  const float *rows[2 * SONDE_MOST_TAPS + AXIAL_MOST]; // of lateral results, first to last
  int count;
  float tap[2 * SONDE_MOST_TAPS + 1][SONDE_RANK];
  int samples;                    // up to AXIAL_MOST
  const float *noise[AXIAL_MOST]; // [2*lines]
  float noise_size, compensation[AXIAL_MOST];
  float offset_db, grey_per_db; // grey = (dB + offset) * grey_per_db
  uint32_t lines;
  float *envelope[AXIAL_MOST];
  float *grey[AXIAL_MOST]; // NULL: not wanted
} axial_job;

// A row of the looks' mean envelope and its logarithm.
typedef struct compress_job {
  const float *look[SONDE_MOST_LOOKS]; // [lines]
  uint32_t looks, lines;               // lines: multiple of ECHO_ALIGN
  float offset_db, grey_per_db;
  float *envelope, *grey; // [lines]
} compress_job;

// Grey values before the map of some samples of a block of lines, smoothed along one direction:
// taps from each point, each between two lines. Rows beyond the picture are its outer ones.
enum { SMOOTH_LINES = 8, SMOOTH_TAPS = 5 };
static const float smooth_bell[SMOOTH_TAPS] = {0.11f, 0.24f, 0.30f, 0.24f, 0.11f};
typedef struct smooth_job {
  const float *log; // of the block's first line, first sample of the picture
  uint32_t stride, samples, first, end;
  int32_t row[SMOOTH_TAPS], line[SMOOTH_TAPS];
  float next[SMOOTH_TAPS]; // share of the line behind
  float weight;            // of the smoothed value
  float *out;              // of the block's first line, sample `first`
  uint32_t out_stride;
} smooth_job;

// A row of grey values in place: sharpened, mixed with the picture before, mapped.
typedef struct show_job {
  float *grey;              // [lines]
  const float *top, *low;   // [lines] two rows of its blur
  float share, sharp, keep; // of the way from top to low; of what the blur takes away; of `held`
  float *held;              // [lines] what the picture before showed and this one shows; NULL
  const float *map;         // [steps + 1]
  float steps;
  uint32_t lines; // multiple of ECHO_ALIGN
} show_job;

// A row of pixels from [samples][lines] grey values.
typedef struct convert_job {
  const float *grey;
  uint32_t lines, samples, stride; // floats per sample
  bool cubic;
  float x, dx, z;                             // of the first pixel and per pixel, m
  float lines_per_m, samples_per_m, radius_m; // curved face when radius > 0
  float first_line;                           // line at x = 0
  uint32_t width;
  uint8_t *out;
} convert_job;

#endif
