// Contact zero and tare of every curve as unknowns of stage 3, with Gaussian priors about zero.
// The probe is at depth (penetration - zero), and the sensor reads (force + tare). The normal
// equations of the other parameters are reduced by those of each curve (Schur complement).
#ifndef SONDE_SRC_FIT_REFIT_OFFSET_H
#define SONDE_SRC_FIT_REFIT_OFFSET_H

#include "fit/refit_inside.h"

enum { OFFSET_ZERO, OFFSET_TARE, OFFSETS };

struct sonde_offsets {
  double precision[OFFSETS];   // 1/sd^2 of zero and tare; infinite: not estimated
  double (*now)[OFFSETS];      // [curves] of the last evaluation, m and N
  double (*kept)[OFFSETS];     // [curves] at the accepted point
  double *slope_n_m;           // [rows] dF/d depth of the last evaluation
  double *kept_slope_n_m;      // [rows] at the accepted point
  double (*inverse)[3];        // [curves] inverse of a curve's own equations: zz, zt, tt
  double (*gradient)[OFFSETS]; // [curves]
  double *coupling;            // [curves * OFFSETS * parameters]
  double fall;                 // of the cost along the offsets' step, all else kept
};

// NULL when neither is to be estimated.
sonde_status sonde_offsets_create(const sonde_refit *refit, sonde_offsets **offsets,
                                  sonde_error *error);
void sonde_offsets_destroy(sonde_offsets *offsets);
// Starts from those of an earlier result.
void sonde_offsets_set(sonde_refit *refit, const sonde_curve_fit *curves);
// Depth of the probe below the skin in a row.
double sonde_offsets_depth(const sonde_refit *refit, uint32_t row);
double sonde_offsets_tare(const sonde_refit *refit, uint32_t row);
// Cost of the last evaluation's offsets.
double sonde_offsets_cost(const sonde_refit *refit);
// Reduces the normal equations at the accepted point.
void sonde_offsets_eliminate(sonde_refit *refit, const double *force_n, const double *jacobian,
                             sonde_normal *normal);
// The offsets that go with a share of a step of the other parameters; accepts or takes back.
void sonde_offsets_try(sonde_refit *refit, const double *step, double share);
void sonde_offsets_accept(sonde_refit *refit);
void sonde_offsets_return(sonde_refit *refit);

#endif
