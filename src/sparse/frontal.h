// Multifrontal Cholesky of a symmetric positive definite scalar matrix: analysed once, factored
// and solved many times, by several threads with storage of their own.
//
// Rows are ordered by nested dissection; every piece (a leaf or a separator) owns dense columns.
// Factors are made in double precision and kept in single: what a preconditioner needs. Every
// number is the same whatever the instruction set.
#ifndef SONDE_SRC_FRONTAL_H
#define SONDE_SRC_FRONTAL_H

#include "sparse/dissect.h"

typedef struct sonde_frontal sonde_frontal;

// Orders and analyses; the pattern is not kept. ARGUMENT for a bad one. @thread owner
sonde_status sonde_frontal_create(const sonde_pattern *pattern, sonde_frontal **frontal,
                                  sonde_error *error);
void sonde_frontal_destroy(sonde_frontal *frontal);

// Numbers of a factor, of the scratch that factoring needs, and of that for solving.
size_t sonde_frontal_factor_size(const sonde_frontal *frontal);
size_t sonde_frontal_work_size(const sonde_frontal *frontal);
size_t sonde_frontal_scratch_size(const sonde_frontal *frontal);

// The numbers `value` of the full pattern. False: a pivot is not positive. @thread any
bool sonde_frontal_factor(const sonde_frontal *frontal, const double *value, float *factor,
                          double *work);
// Solves in place, to single precision. @thread any
void sonde_frontal_solve(const sonde_frontal *frontal, const float *factor, double *x,
                         float *scratch);

// Kernels on one piece: `own` columns of `rows` numbers each, the triangle at the top; rows are a
// multiple of 8, those behind the last used one zero.
typedef struct sonde_frontal_kernels {
  const char *name;
  // Factors the columns and subtracts their product from the update [size x size], lower triangle
  // by columns, size a multiple of 4; the diagonal receives its inverse, what is above it zero.
  // False: a pivot is not positive.
  bool (*eliminate)(double *columns, uint32_t own, uint32_t rows, double *update, uint32_t size);
  void (*forward)(const float *columns, uint32_t own, uint32_t rows, float *x);
  void (*backward)(const float *columns, uint32_t own, uint32_t rows, float *x);
} sonde_frontal_kernels;
extern const sonde_frontal_kernels sonde_frontal_kernels_base, sonde_frontal_kernels_avx2;

// The widest kernels that this processor runs; another name for tests, NULL when it has none such.
const sonde_frontal_kernels *sonde_frontal_kernels_named(const char *name);
void sonde_frontal_use(sonde_frontal *frontal, const sonde_frontal_kernels *kernels);

#endif
