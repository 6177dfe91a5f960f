// Patches of tetrahedra that change their volume together.
#ifndef SONDE_SRC_PATCHES_H
#define SONDE_SRC_PATCHES_H

#include "elements/kinds.h"
#include "elements/tetrahedra.h"

typedef struct sonde_patches {
  uint32_t count;
  double share;           // of a tetrahedron that counts in each of its patches: 1, or 1/4 by nodes
  uint32_t *start, *list; // tetrahedra of each patch
  uint32_t *of_start, *of; // patches of each tetrahedron
  double *volume;          // [count] m3
} sonde_patches;

// Clear after a failure, too. @thread owner
sonde_status sonde_patches_find(const sonde_tetrahedra *mesh, sonde_dilatation kind,
                                const double *volume, sonde_patches *patches, sonde_error *error);
void sonde_patches_clear(sonde_patches *patches);

// Gradients of the shape functions of a tetrahedron, 1/m; returns its volume.
double sonde_tetrahedron_gradients(const sonde_tetrahedra *mesh, uint32_t tetrahedron,
                                   double gradient[4][3]);
// Lame's constants of Young's modulus and Poisson's ratio.
static inline double sonde_shear_modulus(double young_pa, double poisson) {
  return young_pa / (2 * (1 + poisson));
}
static inline double sonde_lame_lambda(double young_pa, double poisson) {
  return young_pa * poisson / ((1 + poisson) * (1 - 2 * poisson));
}
// lambda [patches]: a uniform pressure p in a patch makes there the mean of p / lambda.
void sonde_patches_lambda(const sonde_patches *patches, const double *volume,
                          const double *young_pa, double poisson, double *lambda);

#endif
