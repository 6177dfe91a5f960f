// Fitting a few parameters of the model to records by forward simulations.
#ifndef SONDE_SRC_INVERSE_H
#define SONDE_SRC_INVERSE_H

#include "identify/forward.h"

enum { SONDE_INVERSE_PARAMETERS = 4 };

// All parameters are logarithms.
typedef struct sonde_inverse {
  const sonde_model *model;
  const sonde_motion_record *records; // [record_count]
  uint32_t record_count;
  const sonde_identify_options *options;
  const sonde_progress *progress; // may be NULL
  uint32_t parameter_count;
  double theta[SONDE_INVERSE_PARAMETERS]; // start, then the result
  double low[SONDE_INVERSE_PARAMETERS], high[SONDE_INVERSE_PARAMETERS];

  // What a simulation at theta takes: the law and the world of a trial, scale of all stiffnesses.
  void (*apply)(const double *theta, sonde_surface_law *law, sonde_world_def *def, double *scale);
  // Residuals of a record against the forces simulated at its samples.
  uint32_t (*count)(const sonde_motion_record *record, const sonde_drive *drive);
  void (*compare)(const sonde_motion_record *record, const sonde_drive *drive,
                  const double *normal_n, const double *tangential_n, double *residual);
  double step[SONDE_INVERSE_PARAMETERS]; // of the forward differences; wide, because contact is
                                         // rough; the end is a twentieth of it

  // Results.
  double covariance[SONDE_INVERSE_PARAMETERS][SONDE_INVERSE_PARAMETERS];
  double sensitivity[SONDE_INVERSE_PARAMETERS]; // RMS of d residual/d theta
  double rms;                                   // of the residuals
  uint32_t iterations, simulations, samples;
  bool converged;
} sonde_inverse;

// With max_iterations 0 theta stays and only the results are filled.
// @return CONVERGENCE, CANCELLED, failures of a simulation
sonde_status sonde_inverse_solve(sonde_inverse *inverse, sonde_error *error);

// e^theta with its 95 % interval.
sonde_estimate sonde_inverse_estimate(const sonde_inverse *inverse, uint32_t parameter);

#endif
