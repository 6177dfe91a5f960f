// Small dense symmetric systems, lower triangles in row order.
#ifndef SONDE_SRC_FIT_DENSE_H
#define SONDE_SRC_FIT_DENSE_H

#include <stdbool.h>
#include <stdint.h>

// Cholesky factor in the lower triangle of a [n * n], in place. @return false: not positive
// definite
bool sonde_cholesky(double *a, uint32_t n);
// Solves L x = b in place.
void sonde_cholesky_forward(const double *factor, uint32_t n, double *x);
// Solves L L^T x = b in place.
void sonde_cholesky_solve(const double *factor, uint32_t n, double *x);
// Adds weight * row row^T to the lower triangle; entries that are 0 are skipped.
void sonde_add_outer(double *a, uint32_t n, const double *row, double weight);

#endif
