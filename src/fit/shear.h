// Static equilibrium of the skin with normal springs and shear springs only: one unknown per node,
// the indentation s along the inward rest normal. Energy = sum A U(s) + sum L w W(|s_i - s_j|/L),
// convex (docs/fit.md). It is the full model without surface springs: there the
// tangential motion of free nodes decouples and stays zero.
#ifndef SONDE_SRC_FIT_SHEAR_H
#define SONDE_SRC_FIT_SHEAR_H

#include "fit/fit_inside.h"
#include "sonde/sparse.h"

// The skin around one footprint. Places: free nodes first, then the held ones, then one that stands
// for everything beyond a held rim (s = 0, no area).
typedef struct sonde_patch {
  uint32_t free_count, held_count, place_count; // place_count = free + held + 1
  uint32_t *node;                               // [place_count] surface node
  double *area_m2;                              // [place_count]
  double *cosine;    // [place_count] rest normal . site normal for held places, else 0
  double sliding_m2; // sum of A (1 - cosine^2): how far the footprint drags tangential springs
  uint32_t edge_count;
  uint32_t (*edge)[2]; // places
  double *rest_m, *dual_m;
  uint32_t *row_start, *column; // matrix of the free places, full pattern
  uint32_t *diagonal;           // [free_count] entry
  uint32_t (*entry)[2]; // [edge_count] entries of the two sides; UINT32_MAX with a fixed end
  sonde_vec3 *point_m;  // [free_count]
} sonde_patch;

// Nodes within reach of the footprint's held nodes; the skin beyond is cut off (free rim) or held.
sonde_status sonde_patch_create(const sonde_model *model, const sonde_footprint *footprint,
                                sonde_vec3 normal, double reach_m, bool hold_rim,
                                sonde_patch *patch, sonde_error *error);
void sonde_patch_clear(sonde_patch *patch);

// Parameters of an equilibrium; k0 and xm per surface node.
typedef struct sonde_patch_law {
  const double *k0_n_m3, *xm_m;
  double shear_n_m, limit, guard, tangential_n_m3;
} sonde_patch_law;

// Scratch of one worker, large enough for any patch of a list. Systems are solved by conjugate
// gradients with the factor of an earlier matrix, which is renewed when that takes too long.
typedef struct sonde_patch_solver {
  const sonde_patch *patch;
  sonde_ldl *ldl; // of a matrix of patch; NULL before its first factorisation
  double *residual, *step, *trial, *multiplier, *value, *scratch;
  double *right, *preconditioned, *direction, *product;
} sonde_patch_solver;

sonde_status sonde_patch_solver_create(const sonde_patch *patches, uint32_t count,
                                       sonde_patch_solver *solver, sonde_error *error);
void sonde_patch_solver_clear(sonde_patch_solver *solver);
// Turns to a patch; the next solve orders and analyses its matrix.
void sonde_patch_solver_use(sonde_patch_solver *solver, const sonde_patch *patch);

// Equilibrium with the held nodes at depth; s_m [place_count] holds the start in its free places.
// Newton with line search until |R| <= relative * force.
// @return CONVERGENCE after max_iterations or when a matrix is not positive definite
sonde_status sonde_patch_settle(sonde_patch_solver *solver, const sonde_patch_law *law,
                                double depth_m, double relative, uint32_t max_iterations,
                                double *s_m, sonde_error *error);

// Derivatives of the force by logarithms of the parameters.
typedef struct sonde_patch_gradient {
  double *by_ln_k0, *by_ln_xm; // [place_count]
  double by_ln_shear, by_ln_limit;
} sonde_patch_gradient;

// Force along the site normal at an equilibrium; with gradient, one solve with the adjoint.
sonde_status sonde_patch_force(sonde_patch_solver *solver, const sonde_patch_law *law,
                               double depth_m, const double *s_m, double *force_n,
                               sonde_patch_gradient *gradient, sonde_error *error);

#endif
