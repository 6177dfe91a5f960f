// Systems with one symmetric positive definite matrix, factored once and solved to the end of
// double precision: the factor in single precision preconditions conjugate gradients, of which two
// or three steps take back what it rounded.
#ifndef SONDE_SRC_DIRECT_H
#define SONDE_SRC_DIRECT_H

#include "sparse/multifrontal.h"
#include "sparse/pcg.h"

// y = A x of a pattern in compressed rows with its values. @thread any
SONDE_LINK void sonde_rows_multiply(uint32_t n, const uint32_t *row_start, const uint32_t *column,
                                    const double *value, const double *x, double *y);

typedef struct sonde_direct sonde_direct;

// The full pattern in compressed rows with ascending columns; points [n] for the ordering.
// CONVERGENCE: a pivot is not positive. @thread owner
sonde_status sonde_direct_create(uint32_t n, const uint32_t *row_start, const uint32_t *column,
                                 const double *value, const sonde_vec3 *points,
                                 sonde_direct **direct, sonde_error *error);
void sonde_direct_destroy(sonde_direct *direct);
// New values on the same pattern. @thread owner
sonde_status sonde_direct_refactor(sonde_direct *direct, const double *value, sonde_error *error);
// Solves in place. @thread one at a time; no allocation
void sonde_direct_solve(sonde_direct *direct, double *x);

#endif
