// Linear elastic solid of tetrahedra: its stiffness matrix, solved by a factor that preconditions
// conjugate gradients, and rigid footprints pressed into it.
//
// Linear tetrahedra lock where the material hardly changes its volume: every element would keep its
// own. Here the volume change that lambda resists is averaged over patches (de Souza Neto et al.
// 2005) or around nodes (Bonet and Burton 1998). docs/elements.md.
#ifndef SONDE_SRC_ELASTIC_H
#define SONDE_SRC_ELASTIC_H

#include "elements/patches.h"
#include "sparse/multifrontal.h"
#include "sparse/pcg.h"

typedef struct sonde_elastic_def {
  const sonde_tetrahedra *mesh; // borrowed while the solid lives
  // [node_count] bits 1 2 4: x y z keep their place; NULL: the mesh's held nodes do, others not.
  const uint8_t *held;
  const uint32_t *last; // nodes that are numbered last, to be condensed on; not wholly held
  uint32_t last_count;
  sonde_dilatation dilatation;
} sonde_elastic_def;

typedef struct sonde_elastic {
  const sonde_tetrahedra *mesh;
  uint32_t count, last_count; // nodes with unknowns; those to condense on come last
  uint32_t *unknown;          // [node_count] number of a node; UINT32_MAX: held
  uint32_t *node;             // [count] and back
  uint8_t *held;              // [node_count]
  double (*gradient)[4][3];   // [tetrahedra] of the shape functions, 1/m
  double *volume;             // [tetrahedra] m3
  double *young_pa;           // [tetrahedra]
  double poisson, skin_n_m;
  double accuracy; // of a solve: residual over the load; 1e-13 unless set anew
  sonde_patches patches;
  double *patch_lambda;         // [patches] Pa
  uint32_t *row_start, *column; // blocks of the stiffness matrix, both triangles
  double *value;                // [9 per block]
  sonde_vec3 *point;            // [count]
  sonde_symbolic *symbolic;
  sonde_numeric numeric;
} sonde_elastic;

// Pattern and analysis. @return ARGUMENT for a mesh of which nothing is held, and bad nodes
// @thread owner
sonde_status sonde_elastic_create(const sonde_elastic_def *def, sonde_elastic **elastic,
                                  sonde_error *error);
SONDE_LINK void sonde_elastic_destroy(sonde_elastic *elastic);

// New moduli: Young's of each tetrahedron and one Poisson ratio, 0 <= poisson < 0.5. skin_n_m is
// the shear modulus times the thickness of a membrane on the outer faces, 0: none. Assembles and
// factors. @return ARGUMENT; CONVERGENCE: the matrix is not positive definite @thread owner
sonde_status sonde_elastic_set(sonde_elastic *elastic, const double *young_pa, double poisson,
                               double skin_n_m, sonde_error *error);
// f[3 count] = K u. @thread any (read only)
void sonde_elastic_multiply(const sonde_elastic *elastic, const double *u, double *f);

// Scratch of one thread.
typedef struct sonde_elastic_scratch sonde_elastic_scratch;
SONDE_LINK sonde_status sonde_elastic_scratch_create(const sonde_elastic *elastic,
                                                     sonde_elastic_scratch **scratch,
                                                     sonde_error *error);
SONDE_LINK void sonde_elastic_scratch_destroy(sonde_elastic_scratch *scratch);

// Displacements u[3 count] under the forces f[3 count]. `imposed` (NULL: none) lists nodes of which
// u holds the displacements already; f is not read there and receives the reactions.
// @return CONVERGENCE @thread one per scratch
SONDE_LINK sonde_status sonde_elastic_solve(const sonde_elastic *elastic,
                                            sonde_elastic_scratch *scratch, const uint32_t *imposed,
                                            uint32_t imposed_count, double *f, double *u,
                                            sonde_error *error);

#endif
