// The beam's point response as three products of a lateral and an axial kernel.
#ifndef SONDE_SRC_ECHO_PSF_H
#define SONDE_SRC_ECHO_PSF_H

#include "echo/reference.h"

enum {
  SONDE_RANK = 3,
  SONDE_PSF_DEPTHS = 40, // at which the response is known
  SONDE_MOST_TAPS = 48,  // half width of a kernel, lines or samples
  SONDE_PSF_STEPS = SONDE_PSF_DEPTHS + 2,
  LATERAL_PARTS = 3, // numbers of a complex tap
};

// What a beam depends on.
typedef struct beam_key {
  double frequency_hz, focus_m, depth_m, pitch_m, step_m, radius_m;
  double transmit_f, receive_f, pulse_wavelengths; // of the scanner
} beam_key;

// Around a scatterer between lines and samples the response is
// sum over k of lateral[depth][|line|][k] axial[k][sample]; the axial kernels are the same
// everywhere, so the lateral ones interpolate between depths.
typedef struct beam_psf {
  beam_key key;
  int half_lines, half_rows; // reach of the kernels
  double depth_m[SONDE_PSF_DEPTHS], elevation_m[SONDE_PSF_DEPTHS];
  int half[SONDE_PSF_DEPTHS]; // lines needed at that depth
  // Width of the resolution cell across the lines, in columns: (sum p)^2 / sum p^2 of the
  // intensity.
  double cell_columns[SONDE_PSF_DEPTHS];
  // re, im - re, re + im of each: kernel.h
  float lateral[SONDE_PSF_DEPTHS][SONDE_MOST_TAPS + 1][SONDE_RANK][LATERAL_PARTS];
  double axial[SONDE_RANK][2 * SONDE_MOST_TAPS + 1]; // orthonormal
  double sheet[SONDE_PSF_DEPTHS];                    // echo of a level sheet of 1 per column
  double share[SONDE_PSF_DEPTHS];                    // energy of the response that rank 3 keeps
  int step; // of the build, SONDE_PSF_STEPS when it is ready
  // scratch of the build: Gram matrix of all responses' rows, response at [lines 0..][rows][2]
  double gram[2 * SONDE_MOST_TAPS + 1][2 * SONDE_MOST_TAPS + 1];
  double table[SONDE_PSF_DEPTHS][SONDE_MOST_TAPS + 1][2 * (2 * SONDE_MOST_TAPS + 1)];
} beam_psf;

// The array that belongs to a key.
sonde_array sonde_beam_array(const beam_key *key);
// Starts a build. No allocation here and in the steps.
void sonde_psf_begin(beam_psf *psf, const beam_key *key);
// One of about equal steps; true when nothing is left to do.
bool sonde_psf_step(beam_psf *psf);
// Whether the build, finished or not, is for that key.
bool sonde_psf_is_for(const beam_psf *psf, const beam_key *key);
// Fraction of the path from tabulated depth number *above to the next.
double sonde_psf_depth(const beam_psf *psf, double depth_m, int *above);

#endif
