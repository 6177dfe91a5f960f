// Moduli of a linear solid that make it as stiff under bonded footprints as was measured.
#ifndef SONDE_SRC_MODULI_H
#define SONDE_SRC_MODULI_H

#include "elements/elastic.h"

// A rigid footprint that is bonded to nodes of the surface and moves along `inward`. A linear solid
// answers with a force proportional to depth: of measured forces only their best proportion counts.
typedef struct sonde_bonded_footprint {
  const uint32_t *nodes;
  uint32_t count;
  sonde_vec3 inward;    // unit
  double stiffness_n_m; // sum of depth times force over the sum of depth^2, of the measured rows
  double weight_m2;     // that sum of depth^2 times the weight of a row's squared error, 1/N^2
} sonde_bonded_footprint;

typedef struct sonde_moduli_result {
  uint32_t rounds;
  double misfit;     // sum of weight (stiffness - measured)^2
  double change;     // largest change of ln E in the last round; 0: the misfit stayed
  double *stiffness; // [footprints] of the solid, given by the caller, may be NULL
} sonde_moduli_result;

// Fits Young's modulus of each group (of group[tetrahedron] < group_count <= 7) and, where
// *skin_n_m is positive, the membrane, from the values given, by Levenberg and Marquardt's method
// on their logarithms. The solid ends with the result. Footprints are shared among `workers`
// threads.
// @return ARGUMENT; CONVERGENCE: of a solve @thread owner
sonde_status sonde_moduli_fit(sonde_elastic *elastic, double poisson, const uint32_t *group,
                              uint32_t group_count, const sonde_bonded_footprint *footprints,
                              uint32_t count, uint32_t workers, double *young_pa, double *skin_n_m,
                              sonde_moduli_result *result, sonde_error *error);

#endif
