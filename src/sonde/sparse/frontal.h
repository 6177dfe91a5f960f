// Multifrontal Cholesky of a symmetric positive definite scalar matrix: analysed once, factored
// and solved many times, by several threads with storage of their own.
//
// Rows are ordered by nested dissection; every piece (a leaf or a separator) owns dense columns.
// Factors are made in double precision and kept in single: what a preconditioner needs. Every
// number is the same whatever the instruction set.
#ifndef SONDE_SRC_FRONTAL_H
#define SONDE_SRC_FRONTAL_H

#include "base/link.h"
#include "sparse/dense.h"
#include "sparse/dissect.h"

typedef struct sonde_frontal sonde_frontal;

// Orders and analyses; the pattern is not kept. ARGUMENT for a bad one. @thread owner
SONDE_LINK sonde_status sonde_frontal_create(const sonde_pattern *pattern, sonde_frontal **frontal,
                                             sonde_error *error);
SONDE_LINK void sonde_frontal_destroy(sonde_frontal *frontal);

// Numbers of a factor, of the scratch that factoring needs, and of that for solving.
SONDE_LINK size_t sonde_frontal_factor_size(const sonde_frontal *frontal);
SONDE_LINK size_t sonde_frontal_work_size(const sonde_frontal *frontal);
SONDE_LINK size_t sonde_frontal_scratch_size(const sonde_frontal *frontal);

// The numbers `value` of the full pattern. False: a pivot is not positive. @thread any
SONDE_LINK bool sonde_frontal_factor(const sonde_frontal *frontal, const double *value,
                                     float *factor, double *work);
// Solves in place, to single precision. @thread any
SONDE_LINK void sonde_frontal_solve(const sonde_frontal *frontal, const float *factor, double *x,
                                    float *scratch);

// Other kernels than the widest, for tests.
void sonde_frontal_use(sonde_frontal *frontal, const sonde_dense_kernels *kernels);

#endif
