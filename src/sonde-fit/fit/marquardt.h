// Levenberg-Marquardt: when a step is damped more or less, tried, taken, and when it ends. What is
// minimised, how the damped normal equations are solved (dense, or blocks with a border) and what
// is small enough are the caller's.
#ifndef SONDE_SRC_FIT_MARQUARDT_H
#define SONDE_SRC_FIT_MARQUARDT_H

#include "base/link.h"
#include "sonde/base.h"

typedef struct sonde_marquardt {
  void *user;
  // Normal equations at the accepted point and its cost. *done: it is the optimum.
  sonde_status (*linearise)(void *user, double *cost, bool *done, sonde_error *error);
  // Trial point from the damped equations at a point of that cost; false: they are not positive
  // definite. *done: the step is not worth a trial.
  bool (*propose)(void *user, double damping, double cost, bool *done);
  // Cost of the trial; infinite where it has none.
  sonde_status (*evaluate)(void *user, double *cost, sonde_error *error);
  // The trial becomes the accepted point, whose cost is lower by `fall`. *done: that was the end.
  void (*accept)(void *user, double cost, double fall, bool *done);
  // The trial is not taken: its cost is higher by `rise`. *done: that is the end; *renew: the
  // accepted point has another cost now, and is linearised again. NULL: nothing to do.
  sonde_status (*refuse)(void *user, double damping, double cost, double rise, bool *done,
                         bool *renew, sonde_error *error);
  // No trial lowered the cost. Returns whether the accepted point counts as the optimum.
  bool (*stall)(void *user, double cost);

  double damping;           // of the first step
  double fall, least;       // times `fall` after a step that was taken, at least `least`
  double rise, rise_least;  // times `rise` after one that was not, at least `rise_least`
  double most;              // from there on no step is tried
  uint32_t trials_per_step; // 0: no limit
  uint32_t max_steps, max_trials;
  const sonde_progress *progress; // of the steps; may be NULL
} sonde_marquardt;

typedef struct sonde_marquardt_result {
  double start_cost, cost;
  uint32_t steps, trials; // steps that were begun
  bool converged, cancelled;
} sonde_marquardt_result;

// Failures are those of the functions.
sonde_status sonde_marquardt_minimise(const sonde_marquardt *m, sonde_marquardt_result *result,
                                      sonde_error *error);

#endif
