// Elastic solid of tetrahedra at finite displacements, without a factor: forces and their change
// are computed element by element, equilibria found by Newton's method with conjugate gradients.
#ifndef SONDE_SRC_VOLUME_H
#define SONDE_SRC_VOLUME_H

#include "elements/patches.h"
#include "elements/volume_kernels.h"
#include "sparse/pcg.h"

typedef struct sonde_elastic_volume_def {
  const sonde_tetrahedra *mesh; // borrowed while the solid lives
  sonde_elastic_material material;
  sonde_dilatation dilatation;
  const uint8_t *held;    // [node_count] as in sonde_elastic_def
  const double *young_pa; // [tetrahedra] borrowed during the call
  double poisson;         // 0 <= poisson < 0.5
} sonde_elastic_volume_def;

typedef struct sonde_elastic_volume {
  const sonde_tetrahedra *mesh;
  sonde_elastic_material material;
  uint32_t batch_count;
  sonde_elastic_volume_batch *batch; // at whole cache lines of memory
  void *memory;
  const sonde_elastic_volume_kernels *kernels;
  uint8_t *held;
  sonde_patches patches;
  double *volume, *patch_lambda;
  double *growth, *pressure, *pressure_change; // [8 batches] of each tetrahedron
  double *patch_pressure;                      // [patches]
  double (*diagonal)[6];                       // [nodes] inverse blocks of the preconditioner
  double *vectors;                             // [7][3 nodes]
  uint32_t *rows, row_count;                   // nodes that are solved for
  const double *at;                            // displacements of the tangent
} sonde_elastic_volume;

// @return ARGUMENT @thread owner
sonde_status sonde_elastic_volume_create(const sonde_elastic_volume_def *def,
                                         sonde_elastic_volume **volume, sonde_error *error);
void sonde_elastic_volume_destroy(sonde_elastic_volume *volume);
// Forces f[3 nodes] that hold the nodes at the displacements u[3 nodes]; returns the energy, J.
// @thread owner; no allocation, here and below
double sonde_elastic_volume_forces(sonde_elastic_volume *volume, const double *u, double *f);
// Their change df under a change d of the displacements, at the u of the last forces.
void sonde_elastic_volume_tangent(sonde_elastic_volume *volume, const double *d, double *df);

typedef struct sonde_elastic_volume_result {
  uint32_t newton, cg; // iterations
  double residual_n;   // largest force that is not balanced
} sonde_elastic_volume_result;
// Equilibrium u[3 nodes], from u as it is, where the listed nodes keep their place in u. f receives
// the forces. @return CONVERGENCE; result is filled then, too
sonde_status sonde_elastic_volume_settle(sonde_elastic_volume *volume, const uint32_t *imposed,
                                         uint32_t imposed_count, double *u, double *f,
                                         sonde_elastic_volume_result *result, sonde_error *error);

#endif
