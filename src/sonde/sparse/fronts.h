// Multifrontal Cholesky of a finite-element matrix with three unknowns per node, condensed on the
// nodes that are numbered last.
//
// The nodes are ordered by nested dissection; every piece (a leaf or a separator) owns a dense
// front. What remains at the end is the dense matrix of the last nodes: their stiffness with
// everything else in equilibrium. From their displacements all others follow by one backward pass.
// Factors are kept in single precision for that pass; they are made in double. It works in steps,
// so that it fits between ticks; frontal.h is the solver for a scalar matrix in one go.
#ifndef SONDE_SRC_FRONTS_H
#define SONDE_SRC_FRONTS_H

#include "sonde/base.h"

#define SONDE_FRONT_NONE UINT32_MAX // corner of an element that is held

typedef struct sonde_fronts sonde_fronts;

typedef struct sonde_fronts_def {
  uint32_t node_count, last_count; // the last nodes are node_count - last_count ..
  const sonde_vec3 *points;        // [node_count] for the ordering only
  uint32_t element_count;
  const uint32_t (*elements)[8]; // [element_count] borrowed while the fronts live
} sonde_fronts_def;

// Symmetric stiffness of one element, unknown 3*corner + axis.
typedef void sonde_front_matrix(const void *user, uint32_t element, double (*k)[24]);

// Orders, analyses, allocates. ARGUMENT for bad numbers. @thread owner
sonde_status sonde_fronts_create(const sonde_fronts_def *def, sonde_fronts **fronts,
                                 sonde_error *error);
void sonde_fronts_destroy(sonde_fronts *fronts);

// Starts new numbers on the same pattern. @thread one at a time; no allocation
void sonde_fronts_begin(sonde_fronts *fronts);
// Works for about `budget` multiplications. Returns true when all is factored or a pivot failed.
bool sonde_fronts_step(sonde_fronts *fronts, sonde_front_matrix *matrix, const void *user,
                       uint64_t budget);
// Steps of that budget from begin to the end; they depend on the pattern only.
uint32_t sonde_fronts_steps(const sonde_fronts *fronts, uint64_t budget);
// A pivot was not positive since _begin.
bool sonde_fronts_failed(const sonde_fronts *fronts);

// Condensed stiffness of the last nodes, lower triangle by columns: (i, j) at j*side + i, i >= j,
// side = 3*last_count. Owned by the fronts.
const double *sonde_fronts_condensed(const sonde_fronts *fronts);
// The inverse of that matrix, symmetric but for rounding: inverse[side*side]. False when it is not
// positive definite. @param scratch [side*side]
bool sonde_fronts_compliance(const sonde_fronts *fronts, double *inverse, double *scratch);
// Each x[k][3*node_count] holds displacements of the last nodes; fills in all others.
void sonde_fronts_recover(const sonde_fronts *fronts, float *const *x, uint32_t count);

size_t sonde_fronts_nonzeros(const sonde_fronts *fronts);
uint64_t sonde_fronts_work(const sonde_fronts *fronts); // multiplications of one factorisation

// For one instruction set; all of them give the same bits. Symmetric matrices are lower triangles
// by columns, of order n.
typedef struct sonde_front_kernels {
  const char *name;
  // Cholesky of the columns [from, to); what lies behind receives the Schur complement. False at a
  // pivot that is not positive.
  bool (*eliminate)(double *f, uint32_t n, uint32_t from, uint32_t to);
  // y[0..count) -= scale * row[0..count)
  void (*subtract)(float *y, const float *row, float scale, uint32_t count);
  // inverse[n*n]; f receives the factor.
  bool (*invert)(double *f, uint32_t n, double *inverse);
} sonde_front_kernels;

// The widest that this processor runs, or those called `name`; NULL: none of that name.
const sonde_front_kernels *sonde_front_kernels_find(const char *name);
extern const sonde_front_kernels sonde_front_kernels_base;
#ifdef __x86_64__
extern const sonde_front_kernels sonde_front_kernels_avx2;
extern const sonde_front_kernels sonde_front_kernels_avx512;
#endif

#endif
