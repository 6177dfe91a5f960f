// The strain-energy laws and the eight-node element with one mean volume ratio (Q1P0).
#ifndef SONDE_SRC_HEX_H
#define SONDE_SRC_HEX_H

#include "base/maths.h"
#include "sonde/solid.h"

// The energy of a change of shape per rest volume in logarithms of the stretches: w, its first
// derivatives (principal Kirchhoff stresses, trace zero) and its second ones.
typedef struct sonde_shape_energy {
  double w_pa, first_pa[3], second_pa[3][3];
} sonde_shape_energy;

// For one instruction set; all give the same bits.
typedef struct sonde_hex_kernels {
  const char *name;
  // Energy (J) of an element whose corners have moved from rest to now, forces f[3 corner + axis]
  // that hold it there (its gradient, N) and, where k is not NULL, the stiffness (N/m).
  // @return false: turned inside out at an integration point
  bool (*evaluate)(const sonde_hyperelastic *material, const sonde_vec3 rest[8],
                   const sonde_vec3 now[8], double *energy_j, double f[24], double (*k)[24]);
  // Change of these forces with the exponent; zero for a law without one.
  bool (*by_exponent)(const sonde_hyperelastic *material, const sonde_vec3 rest[8],
                      const sonde_vec3 now[8], double f[24]);
  // @param stretch2 squares of the principal stretches
  void (*shape)(const sonde_hyperelastic *material, const double stretch2[3],
                sonde_shape_energy *energy);
  // Eigenvalues and the columns of eigenvectors of a symmetric matrix.
  void (*principal)(sonde_mat3 matrix, double value[3], double vector[3][3]);
} sonde_hex_kernels;

// The widest that this processor runs, or those called `name`; NULL: none of that name.
const sonde_hex_kernels *sonde_hex_kernels_find(const char *name);
extern const sonde_hex_kernels sonde_hex_kernels_base;
#ifdef __x86_64__
extern const sonde_hex_kernels sonde_hex_kernels_avx2, sonde_hex_kernels_avx512;
#endif

#endif
