// Stage 3: site parameters and shear layer fitted to the static equilibrium of the whole skin.
#ifndef SONDE_SRC_FIT_REFIT_H
#define SONDE_SRC_FIT_REFIT_H

#include "fit/shear.h"

typedef struct sonde_refit sonde_refit;

// Of the skin around a footprint that takes part.
#define REFIT_REACH_M 0.05

// Everything that does not change during the refit. Borrows all arguments.
sonde_status sonde_refit_create(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *m, const sonde_fit_plan *plan,
                                const sonde_fit_def *def, double reach_m, sonde_refit **refit,
                                sonde_error *error);
void sonde_refit_destroy(sonde_refit *refit);

// Parameters: fields of one number per site (ln k0, ln xm, ln shares of G and gm; the last two only
// when the shear layer may vary), then ln G, ln gm.
uint32_t sonde_refit_parameters(const sonde_refit *refit);

// Forces of the sorted rows; jacobian [rows * parameters] may be NULL. Equilibria start from those
// of the call before.
// @return CONVERGENCE naming site and depth when an equilibrium is not found
sonde_status sonde_refit_forces(sonde_refit *refit, const double *theta, double *force_n,
                                double *jacobian, const sonde_progress *progress,
                                sonde_error *error);

typedef struct sonde_refit_result {
  uint32_t iterations;
  bool converged;
  double start_cost, cost;
} sonde_refit_result;

// Levenberg-Marquardt from theta, in place; force_n [rows] receives the forces at its end.
sonde_status sonde_refit_minimise(sonde_refit *refit, double *theta, double *force_n,
                                  const sonde_progress *progress, sonde_refit_result *result,
                                  sonde_error *error);

// Where the minimisation puts what is known about its result; NULL: not wanted.
void sonde_refit_want_confidence(sonde_refit *refit, sonde_fit_confidence *confidence);

// Contact zero and tare of the curves [curve_count] at the end of the minimisation.
void sonde_refit_offsets(const sonde_refit *refit, sonde_curve_fit *curves);

// The next equilibria start afresh.
void sonde_refit_forget(sonde_refit *refit);

// Generic start from the curves of stage 1.
void sonde_refit_start(const sonde_refit *refit, const sonde_curve_fit *curves, double *theta);

#endif
