// Sparse LDL^T factor: ldl.c orders, analyses and factors, ldl_solve.c solves.
#ifndef SONDE_SRC_LDL_H
#define SONDE_SRC_LDL_H

#include "sonde/sparse.h"

typedef struct sonde_ldl sonde_ldl;

// Orders (nested dissection by `points`, without them breadth-first levels reversed), analyses and
// factors a symmetric positive definite scalar matrix into L D L^T. The matrix is given by its full
// pattern in CSR with ascending columns.
// @param points [n] positions for the ordering, or NULL
// @return SONDE_CONVERGENCE when a pivot is not positive @thread owner
sonde_status sonde_ldl_create(uint32_t n, const uint32_t *row_start, const uint32_t *column,
                              const double *value, const sonde_vec3 *points, sonde_ldl **ldl,
                              sonde_error *error);
// Numbers again on the same pattern. @thread owner
sonde_status sonde_ldl_refactor(sonde_ldl *ldl, const double *value, sonde_error *error);
// Solves in place, `columns` right-hand sides interleaved x[row*columns + c]. @thread tick
void sonde_ldl_solve(const sonde_ldl *ldl, uint32_t columns, double *x, double *scratch);
// Doubles needed as scratch by a solve. @thread any
size_t sonde_ldl_scratch(const sonde_ldl *ldl, uint32_t columns);
size_t sonde_ldl_nonzeros(const sonde_ldl *ldl); // @thread any
void sonde_ldl_destroy(sonde_ldl *ldl);          // @thread owner

struct sonde_ldl {
  uint32_t n;
  uint32_t *order;  // [n] old row at each new place
  uint32_t *rank;   // [n] new place of each old row
  uint32_t *parent; // [n] elimination tree; n at a root

  // Entries of the permuted matrix above the diagonal, by new column, with their place in `value`.
  size_t *upper_start; // [n+1]
  uint32_t *upper_row;
  uint32_t *upper_source;
  uint32_t *diagonal_source; // [n]

  size_t *start;    // [n+1] columns of L, unit diagonal left out
  uint32_t *row;    // [start[n]] new rows, ascending per column
  double *lower;    // [start[n]]
  double *diagonal; // [n] D

  // Scratch of the factorisation.
  double *work;    // [n] dense row
  uint32_t *mark;  // [n] last row that visited the node
  uint32_t *stack; // [2n] pattern of a row and the path that leads to it
  size_t *fill;    // [n] entries written per column
};

#endif
