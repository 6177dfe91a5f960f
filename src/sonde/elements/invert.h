// Inverse of a large dense symmetric positive definite matrix by several threads.
#ifndef SONDE_SRC_INVERT_H
#define SONDE_SRC_INVERT_H

#include "base/link.h"
#include "sonde/base.h"

// inverse [n * n], both triangles, of a [n * n], of which the lower triangle is read; they differ.
// The same bits for any number of workers (0: one per core).
// @return CONVERGENCE: not positive definite @thread owner
sonde_status sonde_invert(const double *a, uint32_t n, uint32_t workers, double *inverse,
                          sonde_error *error);

#endif
