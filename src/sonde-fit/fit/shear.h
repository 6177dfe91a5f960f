// Static equilibrium of the skin with normal springs and the shear layer only: one unknown per
// node, the indentation s along the inward rest normal. Energy = sum A U(s) + sum over faces A
// W(|grad s|), convex (docs/fit.md). It is the full model without surface springs: there the
// tangential motion decouples (sonde_patch_drag).
#ifndef SONDE_SRC_FIT_SHEAR_H
#define SONDE_SRC_FIT_SHEAR_H

#include "fit/cut.h"
#include "fit/fit_inside.h"
#include "sparse/direct.h"

typedef struct sonde_patch_face {
  uint32_t place[3];
  double half_cotangent[3]; // at the corners
  double area_m2;
  uint32_t entry[3][2]; // matrix entries of the pair opposite each corner; UINT32_MAX: a held end
} sonde_patch_face;

// The skin around one footprint. Places: free nodes first, then the held vertices.
typedef struct sonde_patch {
  uint32_t free_count, place_count;
  uint32_t (*parent)[3]; // [place_count] model nodes whose parameters it takes
  double (*share)[3];    // [place_count] of each parent, sum 1
  uint32_t node_count;   // of model nodes among the parents
  uint32_t *node;        // [node_count] ascending
  uint32_t (*among)[3];  // [place_count] the parents as indices of node
  double *area_m2;       // [place_count]
  double *cosine;        // [place_count] rest normal . site normal for held places, else 0
  double drag_n_m;       // force per depth of the tangential springs and the in-plane layer
  uint32_t face_count;
  sonde_patch_face *face;
  uint32_t side_count, *side;   // [side_count] faces with free and held corners
  uint32_t *row_start, *column; // matrix of the free places, full pattern
  uint32_t *diagonal;           // [free_count] entry
  sonde_symbolic *symbolic;     // its analysis
  bool coarse;                  // the mesh is too coarse for the footprint
} sonde_patch;

// Nodes within reach of the footprint; the skin beyond is cut off.
sonde_status sonde_patch_create(const sonde_model *model, const sonde_site *site, double half_u_m,
                                double half_v_m, double reach_m, sonde_patch *patch,
                                sonde_error *error);
void sonde_patch_clear(sonde_patch *patch);
// Finds drag_n_m; normal: [place_count] at rest.
sonde_status sonde_patch_drag(sonde_patch *patch, const sonde_surface_law *law,
                              const sonde_vec3 *normal, sonde_vec3 site_normal, sonde_error *error);

// Parameters of an equilibrium; logarithms of k0, xm and the shares of G and gm per surface node.
typedef struct sonde_patch_law {
  const double *ln_k0, *ln_xm, *ln_shear, *ln_limit; // the last two NULL: uniform
  double exponent, shear_n_m, limit, guard;
  // The layer as a membrane with tension: q(g) = (T + k e (1 + c e^2)) g/sqrt(1 + g^2) with
  // e = sqrt(1 + g^2) - 1, T = shear_n_m, k = limit (N/m); else G and gm.
  bool membrane;
  double stiffening; // c
} sonde_patch_law;

typedef struct sonde_patch_face_law {
  double shear_n_m, limit;   // G and gm, or T and k
  double by_shear, by_limit; // 1 over the sums of its corners' shares
} sonde_patch_face_law;

// Scratch of one worker, large enough for any patch of a list. Systems are solved by conjugate
// gradients with the factor of an earlier matrix, which is renewed when that takes too long.
typedef struct sonde_patch_solver {
  const sonde_patch *patch;
  sonde_patch_law law;
  double adjoint_accuracy; // relative, of the gradients; 1e-6 from creation
  const double *settled_m; // indentations to which residual, value and load_n belong
  double load_n;           // force of the held places there
  bool factored;           // factor is of a matrix of patch
  // Of the places and faces with the law's parameters.
  double *k0_n_m3, *xm_m, *shear_share, *limit_share;
  sonde_patch_face_law *face_law;
  double *steepness; // 1/(A gm^2)
  // At the last assembly: A p and A p' of places; of faces flux (half the cotangent Laplacian of
  // s), A g^2, secant modulus q/g and factor of the rank-one part of the stiffness.
  double *normal_n, *normal_slope, *residual, *value;
  double (*flux)[3], *square, *secant, *beyond;
  sonde_numeric factor;
  double *step, *trial, *multiplier;
  double *right, *preconditioned, *direction, *product;
} sonde_patch_solver;

sonde_status sonde_patch_solver_create(const sonde_patch *patches, uint32_t count,
                                       sonde_patch_solver *solver, sonde_error *error);
void sonde_patch_solver_clear(sonde_patch_solver *solver);
// Turns to a patch and its parameters.
void sonde_patch_solver_use(sonde_patch_solver *solver, const sonde_patch *patch,
                            const sonde_patch_law *law);

// Residual of every place and the matrix of the free ones at indentations s. Returns |R| over the
// free places; *load_n is the force of the held ones.
double sonde_patch_assemble(sonde_patch_solver *solver, const double *s, double *load_n);

// Equilibrium with the footprint at a depth; s_m [place_count] holds the start in its free places.
// Newton with line search until |R| <= relative * force.
sonde_status sonde_patch_settle(sonde_patch_solver *solver, double depth_m, double relative,
                                uint32_t max_iterations, double *s_m, sonde_error *error);

// Change of the force per depth at the last assembly, mu the motion of all places per depth.
double sonde_patch_stiffness(const sonde_patch_solver *solver, const double *mu);

// Derivatives of the force.
typedef struct sonde_patch_gradient {
  double *by_place[4];             // [place_count] by ln k0, ln xm, ln shares of G and gm there
  double by_ln_shear, by_ln_limit; // of the whole skin
} sonde_patch_gradient;

// Derivatives of sum mu R at the last assembly.
void sonde_patch_differentiate(const sonde_patch_solver *solver, const double *s, const double *mu,
                               sonde_patch_gradient *gradient);

// Force along the site's normal where sonde_patch_settle() has just ended. gradient (may be NULL):
// by one adjoint solve, which also takes the first order of the remaining residual out of the force
// and leaves the free places' motion per depth in solver->multiplier.
sonde_status sonde_patch_force(sonde_patch_solver *solver, double depth_m, const double *s_m,
                               double *force_n, sonde_patch_gradient *gradient, sonde_error *error);

#endif
