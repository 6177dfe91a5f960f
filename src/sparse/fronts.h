// Multifrontal Cholesky of a finite-element matrix with three unknowns per node, condensed on the
// nodes that are numbered last.
//
// The nodes are ordered by nested dissection; every piece (a leaf or a separator) owns a dense
// front. What remains at the end is the dense matrix of the last nodes: their stiffness with
// everything else in equilibrium. From their displacements all others follow by one backward pass.
// Factors are kept in single precision for that pass; they are made in double.
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
// x[3*node_count] holds the displacements of the last nodes; fills in all others.
void sonde_fronts_recover(const sonde_fronts *fronts, float *x);

size_t sonde_fronts_nonzeros(const sonde_fronts *fronts);
uint64_t sonde_fronts_work(const sonde_fronts *fronts); // multiplications of one factorisation

// Cholesky of the first `own` columns of a symmetric matrix (lower triangle by columns, order n),
// columns [from, to); the rest receives the Schur complement. False at a pivot that is not
// positive.
bool sonde_front_eliminate(double *f, uint32_t n, uint32_t from, uint32_t to);
// y[0..count) -= scale * row[0..count)
void sonde_front_subtract(float *y, const float *row, float scale, uint32_t count);

#endif
