// The linear system of the ellipsoid's implicit step: conjugate gradients on the sparse matrix
// against a dense factorisation, in time and memory.
#ifndef SONDE_APP_SOLVER_COST_H
#define SONDE_APP_SOLVER_COST_H

#include "bench_ellipsoid.h"

// M + h C + h^2 K at rest, and a push on the 20 first nodes.
typedef struct solver_system {
  sonde_block_matrix *matrix;
  sonde_vec3 *memory, *right, *solution;
  sonde_pcg_scratch scratch;
} solver_system;

sonde_status solver_system_create(const sonde_model *model, double stiffness, solver_system *s,
                                  sonde_error *error);
void solver_system_clear(solver_system *s);
// From zero, to the options' residual.
sonde_pcg_result solver_system_solve(solver_system *s, const sonde_pcg_options *options);

typedef struct solver_cost {
  uint32_t nodes, iterations;
  double sparse_bytes, dense_bytes; // of the numbers stored
  double pcg_s, dense_s;            // dense_s: NaN when not asked for
  double difference;                // of the solutions, relative
} solver_cost;

// Best of `repeats` conjugate gradients to 1e-8, and one dense Cholesky solution when asked for.
solver_cost solver_cost_measure(solver_system *s, int repeats, bool dense);

#endif
