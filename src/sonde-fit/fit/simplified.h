// Least squares rows of the simplified interaction: the footprint moves, its neighbours stay.
#ifndef SONDE_SRC_FIT_SIMPLIFIED_H
#define SONDE_SRC_FIT_SIMPLIFIED_H

#include "fit/fit_inside.h"
#include "fit/law.h"

// Everything the rows of the simplified interaction need.
typedef struct sonde_site_problem {
  const sonde_fit_plan *plan;
  const sonde_measurements *m;
  sonde_footprint *footprint; // [curve_count]
  double *per_stiffness_m;    // [row_count] edge terms at the row's depth
  double *per_tension;        // [row_count]
  double *weight;             // [row_count]
  double *floor_m;            // [site_count]
  bool edges, tension;
} sonde_site_problem;

// Builds footprints and row terms; plan and m are set by the caller. Clear also after a failure.
sonde_status sonde_site_problem_create(const sonde_model *model, const sonde_site_table *sites,
                                       const sonde_fit_def *def, sonde_site_problem *p,
                                       sonde_error *error);
void sonde_site_problem_clear(sonde_site_problem *p);

// Force of a sorted row for theta = (ln k0, ln(xm - floor)) of its site and border = (ln k_s, ln
// T0); jacobian: derivatives by theta and border.
double sonde_site_force(const sonde_site_problem *p, uint32_t block, uint32_t row,
                        const double theta[2], const double *border, double jacobian[4]);
// Weighted residual; the row function of the bordered problem, user is a sonde_site_problem.
void sonde_site_row(const void *user, uint32_t block, uint32_t row, const double theta[2],
                    const double *border, double *residual, double jacobian[4]);

#endif
