// The state of stage 3, shared by its model (refit.c) and its minimisation (refit_minimise.c).
#ifndef SONDE_SRC_FIT_REFIT_INSIDE_H
#define SONDE_SRC_FIT_REFIT_INSIDE_H

#include "fit/refit.h"

typedef struct sonde_normal sonde_normal;
typedef struct sonde_offsets sonde_offsets;

// Standard deviations of the sites' logarithms per site spacing: of k0 and xm, of G and gm.
typedef struct sonde_smoothness {
  double normal_sd, shear_sd;
} sonde_smoothness;

typedef struct sonde_refit_worker {
  sonde_patch_solver solver;
  sonde_patch_gradient gradient;
  double *by_node, *basis; // of the nodes of a patch: [nodes * fields], [nodes * sites]
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
  uint32_t fields;       // 4, or 2 with a uniform shear layer
  double *field[4];      // [nodes] of each
  size_t *first_place;   // [row_count] where a row's equilibrium begins
  uint8_t *settled;      // [row_count] its equilibrium is a start for the next call
  double *indentation_m; // equilibria of all rows
  uint32_t workers;
  sonde_refit_worker *pool;
  sonde_smoothness smoothness;
  sonde_fit_confidence *confidence; // NULL: not wanted
  sonde_offsets *offsets;           // contact zero and tare of the curves; NULL: none
  const bool *left_out;             // [row_count] rows that do not take part; NULL: none
  const bool *fixed;                // [parameters] that keep their start; NULL: none
  sonde_normal *curvature; // receives the normal equations at the optimum; NULL: not wanted
  double enough;           // relative fall of the cost that is not worth a step; 0: default
  bool near;               // the start is near the optimum: no minimisation on few depths before
  bool rough;              // equilibria need not be exact
  bool membrane;           // the layer is a membrane: T and k in the places of G and gm (shear.h)
  double stiffening;       // its c
  uint32_t stride;         // every so many rows of a curve, counted from its last, take part
};

// Standard deviation of a row's error: what the model class leaves, 2 % of a force between the
// row's own and its probe's mean. The part of the mean keeps sensor noise at small depths in
// bounds.
double sonde_refit_sd_n(const sonde_refit *refit, uint32_t row);

// Normal equations of a least squares problem, lower triangle.
struct sonde_normal {
  uint32_t n;
  double *matrix, *gradient; // [n * n], [n]
};

bool sonde_normal_create(sonde_normal *normal, uint32_t n);
void sonde_normal_free(sonde_normal *normal);
void sonde_normal_clear(sonde_normal *normal); // all zero
void sonde_normal_copy(const sonde_normal *from, sonde_normal *to);
// Adds `times` another one.
void sonde_normal_add(const sonde_normal *other, double times, sonde_normal *normal);
// Adds rows [count][n].
void sonde_normal_add_rows(sonde_normal *normal, const double *rows, uint32_t count,
                           const double *residual, const double *weight);
// The minimiser of the quadratic: Cholesky in factor [n * n], step [n]; damping scales the diagonal
// by 1 + damping. False: not positive definite.
bool sonde_normal_solve(const sonde_normal *normal, double damping, double *factor, double *step);

// Error of a row in newtons, its weight in the normal equations (robust loss included), its loss.
typedef struct sonde_refit_row {
  double error_n, weight, loss;
} sonde_refit_row;
sonde_refit_row sonde_refit_weigh(const sonde_refit *refit, uint32_t row, double force_n);
// Adds rows [first, end) that take part; returns their loss. normal NULL: the loss alone.
double sonde_refit_add_rows(const sonde_refit *refit, uint32_t first, uint32_t end,
                            const double *force_n, const double *jacobian, sonde_normal *normal);
// What is known beforehand, one equation after another: each site follows its neighbours, its share
// of the shear layer is near 1, the shares' mean is 1; with one probe, which cannot tell the layer
// from the springs below it, also G over the mean k0 and gm are near those of a thigh.
uint32_t sonde_refit_prior_rows(const sonde_refit *refit);
// Row [n] of equation k and its right-hand side; returns its weight.
double sonde_refit_prior_row(const sonde_refit *refit, sonde_smoothness s, uint32_t k, double *row,
                             double *target);
// Adds all of them; returns their cost. row [n] is scratch.
double sonde_refit_add_prior(const sonde_refit *refit, const double *theta, sonde_smoothness s,
                             double *row, sonde_normal *normal);

// Of the minimisation.
typedef struct sonde_refit_workspace {
  uint32_t n, rows;
  double *force_n, *jacobian;           // at the trial
  double *kept_jacobian;                // [rows * n] at the accepted point
  sonde_normal normal;                  // at the accepted point
  double *factor, *step, *trial, *line; // line: scratch of one row
} sonde_refit_workspace;

// Tries several smoothnesses on the linearised problem at theta, sites left out one by one, and
// keeps the best one in r.
sonde_status sonde_refit_choose_smoothness(sonde_refit *r, sonde_refit_workspace *w,
                                           const double *theta, const double *force_n,
                                           sonde_error *error);
// Fills r->confidence at the optimum theta.
sonde_status sonde_refit_confidence(sonde_refit *r, sonde_refit_workspace *w, const double *theta,
                                    const double *force_n, sonde_error *error);

bool sonde_refit_uses(const sonde_refit *refit, uint32_t row);

#endif
