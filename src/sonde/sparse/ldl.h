// Factor kept between ldl.c (ordering, analysis, numbers) and ldl_solve.c (solve).
#ifndef SONDE_SRC_LDL_H
#define SONDE_SRC_LDL_H

#include "sonde/sparse.h"

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
