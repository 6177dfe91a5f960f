// What a second of the ellipsoid's scene costs at a given error, by method of integration.
#ifndef SONDE_APP_STEP_COST_H
#define SONDE_APP_STEP_COST_H

#include "bench_ellipsoid.h"

enum { STEP_METHODS = 4 };

// A way to advance in time.
typedef struct step_method {
  const char *name, *colour;
  double implicitness;
  uint32_t newton; // 0: eq. (4) as in the paper, linearised once
  sonde_engine engine;
} step_method;

// eq. (3); eq. (4) with lambda = 1; lambda = 1/2 with two Newton iterations; the fast engine.
extern const step_method STEP_METHOD[STEP_METHODS];

typedef struct step_cost {
  double dt_s, error, seconds; // seconds: processor time of the whole run
  long steps, products;        // of matrix and vector
} step_cost;

// The ellipsoid is pressed for 50 ms and its displacements compared with a run of `fine` steps
// (implicitness 1/2): rms of the difference over rms. Per method the step is halved until the error
// is 1 % or less; the cost is the best of three runs. A method that never gets there has an
// infinite error. costs: [STEP_METHODS]
sonde_status step_cost_study(const bench_ellipsoid *scene, long fine, step_cost *costs,
                             sonde_error *error);

// The largest step at which the explicit step of eq. (3) leaves a disturbed body bounded, where
// every node of an ellipsoid is an oscillator by itself; and what theory says.
typedef struct step_limit {
  double stiffness_scale, frequency_hz, damping_ratio;
  double measured_s, theory_s;
  long runs, steps;
} step_limit;

sonde_status step_limit_find(double stiffness_scale, long nodes, step_limit *limit,
                             sonde_error *error);

#endif
