// Multifrontal Cholesky factor of a symmetric positive definite matrix of 1x1 or 3x3 blocks: one
// symbolic analysis, and numbers as often as wanted, by several threads with storage of their own.
//
// Nodes are ordered by nested dissection; every piece (a leaf or a separator) owns a dense front.
// The matrix may be condensed on the nodes that are numbered last: what remains is their stiffness
// with everything else in equilibrium. Factors are made in double precision, or in single twice as
// fast, and kept in single: what a preconditioner or a displacement needs. All instruction sets
// give the same bits.
#ifndef SONDE_SRC_MULTIFRONTAL_H
#define SONDE_SRC_MULTIFRONTAL_H

#include "base/link.h"
#include "sparse/dense.h"
#include "sparse/pieces.h"

#define SONDE_HELD_CORNER UINT32_MAX // corner of an element that has no unknowns

typedef struct sonde_symbolic_def {
  uint32_t node_count, last_count; // the last nodes are node_count - last_count ..
  uint32_t block;                  // unknowns per node, 1 or 3
  const sonde_vec3 *points;        // [node_count] for the ordering only
  // Either the full pattern of pairs of nodes, in compressed rows with ascending columns ..
  const uint32_t *row_start, *column; // [node_count + 1]
  // .. or elements; borrowed while the analysis lives.
  uint32_t element_count;
  const uint32_t (*elements)[8]; // [element_count]
} sonde_symbolic_def;

// An entry of the pattern and its row and column in the front that it adds to.
typedef struct sonde_front_entry {
  uint32_t source, row, column;
} sonde_front_entry;

typedef struct sonde_symbolic {
  uint32_t node_count, last_count, block;
  const uint32_t (*elements)[8]; // NULL: the matrix comes as a pattern
  sonde_pieces pieces;           // behind those of the dissection comes that of the last nodes
  uint32_t *related;             // [as boundary] index among the nodes of the parent's front
  uint32_t *element_of;          // [element_count] by piece
  sonde_front_entry *entries;    // by piece
  size_t factor_size, stack_size, front_order; // numbers; the largest front has front_order rows
  uint64_t macs;                               // multiplications of one factorisation
} sonde_symbolic;

// Orders and analyses. ARGUMENT for bad numbers. @thread owner
SONDE_LINK sonde_status sonde_symbolic_create(const sonde_symbolic_def *def,
                                              sonde_symbolic **symbolic, sonde_error *error);
SONDE_LINK void sonde_symbolic_destroy(sonde_symbolic *symbolic);
// Steps of sonde_numeric_step() with that budget from begin to the end.
SONDE_LINK uint32_t sonde_symbolic_steps(const sonde_symbolic *symbolic, uint64_t budget);

// Where the numbers of the matrix come from.
typedef struct sonde_matrix_source {
  const double *value; // of a pattern: block*block numbers per entry, in rows
  // Symmetric matrix of one element, unknown 3*corner + axis.
  void (*element)(const void *user, uint32_t element, double (*k)[24]);
  const void *user;
} sonde_matrix_source;

// A factor and the work on it. Starts all zero.
typedef struct sonde_numeric {
  const sonde_symbolic *symbolic; // of the matrix that is being factored
  sonde_matrix_source source;
  const sonde_dense_kernels *kernels; // the widest; tests choose others
  float *factor;   // per piece, in rows of sonde_front_width(own): see sonde_dense_kernels
  bool single;     // of fronts, set before room is made: double precision or single
  double slack;    // likewise: share of all room made beyond what is wanted, for analyses to come
  void *front;     // working front, the condensed matrix at the end; double or float
  void *stack;     // updates that wait for their parent
  uint32_t *local; // [node_count] place -> index in the working front
  float *part, *gathered; // unknowns of a piece and its boundary, all unknowns in their order
  size_t factor_room, front_room, stack_room, local_room, gathered_room, part_room;
  size_t top;           // of the stack
  uint32_t now, column; // piece and column at work
  bool assembled, failed;
} sonde_numeric;

// Makes room for matrices of an analysis. @thread owner
SONDE_LINK sonde_status sonde_numeric_reserve(sonde_numeric *numeric,
                                              const sonde_symbolic *symbolic, sonde_error *error);
SONDE_LINK void sonde_numeric_clear(sonde_numeric *numeric);

// Starts new numbers. @thread one at a time; no allocation, here and below
SONDE_LINK void sonde_numeric_begin(sonde_numeric *numeric, const sonde_symbolic *symbolic,
                                    const sonde_matrix_source *source);
// Works for about `budget` multiplications. Returns true when all is factored or a pivot failed.
SONDE_LINK bool sonde_numeric_step(sonde_numeric *numeric, uint64_t budget);
// All of it now. False: a pivot is not positive.
SONDE_LINK bool sonde_numeric_factor(sonde_numeric *numeric, const sonde_symbolic *symbolic,
                                     const sonde_matrix_source *source);

// Condensed stiffness of the last nodes, lower triangle by columns: (i, j) at j*side + i, i >= j,
// side = block*last_count; until new numbers begin.
SONDE_LINK const double *sonde_numeric_condensed(const sonde_numeric *numeric);
SONDE_LINK const float *sonde_numeric_condensed_single(const sonde_numeric *numeric);
// Each x[k][block*node_count] holds displacements of the last nodes; fills in all others.
void sonde_numeric_recover(const sonde_numeric *numeric, float *const *x, uint32_t count);
// Solves in place, to single precision, when no nodes are condensed on.
SONDE_LINK void sonde_numeric_solve(const sonde_numeric *numeric, double *x);
// With loads on all nodes (block 3), in two halves: the first leaves in the last nodes of x the
// load of the condensed stiffness, g = f_s - K_si K_ii^-1 f_i; the second takes their displacements
// there and fills in all others. To single precision.
SONDE_LINK void sonde_numeric_reduce(const sonde_numeric *numeric, double *x);
SONDE_LINK void sonde_numeric_expand(const sonde_numeric *numeric, double *x);

#endif
