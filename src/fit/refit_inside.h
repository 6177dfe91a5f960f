// The state of stage 3, shared by its model (refit.c) and its minimisation (refit_minimise.c).
#ifndef SONDE_SRC_FIT_REFIT_INSIDE_H
#define SONDE_SRC_FIT_REFIT_INSIDE_H

#include "fit/refit.h"

typedef struct sonde_refit_worker {
  sonde_patch_solver solver;
  sonde_patch_gradient gradient;
} sonde_refit_worker;

struct sonde_refit {
  const sonde_model *model;
  const sonde_site_table *sites;
  const sonde_measurements *m;
  const sonde_fit_plan *plan;
  const sonde_fit_def *def;
  sonde_patch *patch;    // [curve_count]
  double *basis;         // [nodes * site_count]
  double *roughness;     // [site_count * site_count]
  double *ln_k0;         // [nodes]
  double *ln_xm;         // [nodes]
  size_t *first_place;   // [row_count] where a row's equilibrium begins
  uint8_t *settled;      // [row_count] its equilibrium is a start for the next call
  double *indentation_m; // equilibria of all rows
  uint32_t workers;
  sonde_refit_worker *crew;
  double smoothness_sd;             // of ln k0 and ln xm per site spacing
  sonde_fit_confidence *confidence; // NULL: not wanted
  const bool *left_out;             // [row_count] rows that only get a force; NULL: none
  bool rough;                       // equilibria need not be exact
  uint32_t stride; // every so many rows of a curve, counted from its last, take part
};

// Standard deviation of a row's error: what the model class leaves, 2 % of a force between the
// row's own and its probe's mean. The part of the mean keeps sensor noise at small depths in
// bounds.
double sonde_refit_sd_n(const sonde_refit *refit, uint32_t row);

// Of the minimisation.
typedef struct workspace {
  uint32_t n, rows;
  double *force_n, *jacobian;             // at the trial
  double *kept_jacobian;                  // [rows * n] at the accepted point
  double *matrix, *gradient;              // normal equations at the accepted point
  double *factor, *step, *trial, *scaled; // scaled: a weighted row
} workspace;

// Tries several smoothnesses on the linearised problem at theta, sites left out one by one, and
// keeps the best one in r.
sonde_status sonde_refit_choose_smoothness(sonde_refit *r, workspace *w, const double *theta,
                                           const double *force_n, sonde_error *error);
// Fills r->confidence at the optimum theta.
sonde_status sonde_refit_confidence(sonde_refit *r, workspace *w, const double *theta,
                                    const double *force_n, sonde_error *error);

bool sonde_refit_uses(const sonde_refit *refit, uint32_t row);

#endif
