// Refits around the result of an estimation of stage 3.
#ifndef SONDE_SRC_FIT_NEARBY_REFIT_H
#define SONDE_SRC_FIT_NEARBY_REFIT_H

#include "fit/refit_inside.h"

// A refit with the result's smoothness. Borrows the measurements; must not move.
typedef struct sonde_nearby_refit {
  sonde_fit_plan plan;
  sonde_fit_def def;
  sonde_refit *refit;
  uint32_t parameters;
  double *optimum;        // [parameters] the result's
  double *theta;          // [parameters] the optimum at creation
  double *step;           // [parameters] scratch
  double *force_n;        // [plan.row_count]
  bool *left_out;         // [plan.row_count]
  sonde_normal curvature; // at the end of the last refit
  double *factor;         // [parameters^2] scratch of sonde_nearby_refit_spread()
} sonde_nearby_refit;

// @return ARGUMENT when the result is not of stage 3; cleared then
sonde_status sonde_nearby_refit_create(const sonde_model *model, const sonde_site_table *sites,
                                       const sonde_measurements *m, const sonde_fit_def *def,
                                       const sonde_fit_result *result, sonde_nearby_refit *again,
                                       sonde_error *error);
void sonde_nearby_refit_clear(sonde_nearby_refit *again);
// Refits from theta, in place.
sonde_status sonde_nearby_refit_run(sonde_nearby_refit *again, const sonde_progress *progress,
                                    sonde_refit_result *found, sonde_error *error);
// Factors the curvature. False when the data leave a parameter open.
bool sonde_nearby_refit_factor(sonde_nearby_refit *again);
// again->step = H^-1 row: how all parameters vary with a combination of them; after
// sonde_nearby_refit_factor(). Returns the combination's variance.
double sonde_nearby_refit_spread(sonde_nearby_refit *again, const double *row);

#endif
