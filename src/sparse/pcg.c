// Preconditioned conjugate gradients on a block matrix.
// dot, axpy:  vector operations over the active rows, in list order.
// apply:      z = block-Jacobi preconditioner times r.
// solve:      the iteration of Hestenes and Stiefel with a warm start.
#include "sonde/sparse.h"

#include "base/base.h"
#include "base/maths.h"

typedef struct rows {
  const uint32_t *list;
  uint32_t count;
} rows;

static inline uint32_t row(rows active, uint32_t r) { return active.list ? active.list[r] : r; }

static double dot(rows active, const sonde_vec3 *a, const sonde_vec3 *b) {
  double sum = 0;
  for (uint32_t r = 0; r < active.count; ++r) {
    uint32_t i = row(active, r);
    sum += v_dot(a[i], b[i]);
  }
  return sum;
}

static void axpy(rows active, double s, const sonde_vec3 *x, sonde_vec3 *y) {
  for (uint32_t r = 0; r < active.count; ++r) {
    uint32_t i = row(active, r);
    y[i] = v_madd(y[i], s, x[i]);
  }
}

// p = z + beta p
static void direction(rows active, const sonde_vec3 *z, double beta, sonde_vec3 *p) {
  for (uint32_t r = 0; r < active.count; ++r) {
    uint32_t i = row(active, r);
    p[i] = v_madd(z[i], beta, p[i]);
  }
}

// z = D^-1 r; returns r.z
static double precondition(const sonde_block_matrix *matrix, rows active,
                           const sonde_vec3 *residual, sonde_vec3 *z) {
  double sum = 0;
  for (uint32_t r = 0; r < active.count; ++r) {
    uint32_t i = row(active, r);
    const double *d = matrix->inverse[i];
    sonde_vec3 v = residual[i];
    z[i] = vec3(d[0] * v.x + d[1] * v.y + d[2] * v.z, d[1] * v.x + d[3] * v.y + d[4] * v.z,
                d[2] * v.x + d[4] * v.y + d[5] * v.z);
    sum += v_dot(v, z[i]);
  }
  return sum;
}

// r = b - A x, using q as scratch.
static void initial_residual(const sonde_block_matrix *matrix, const sonde_active_set *active,
                             const sonde_rank_one *terms, uint32_t term_count, rows list,
                             const sonde_vec3 *b, const sonde_vec3 *x,
                             const sonde_pcg_scratch *scratch) {
  sonde_block_multiply(matrix, active, terms, term_count, x, scratch->q);
  for (uint32_t k = 0; k < list.count; ++k) {
    uint32_t i = row(list, k);
    scratch->r[i] = v_sub(b[i], scratch->q[i]);
  }
}

sonde_pcg_result sonde_pcg_solve(const sonde_block_matrix *matrix, const sonde_active_set *active,
                                 const sonde_rank_one *terms, uint32_t term_count,
                                 const sonde_vec3 *b, sonde_vec3 *x,
                                 const sonde_pcg_scratch *scratch,
                                 const sonde_pcg_options *options) {
  SONDE_ASSERT(options->relative_residual >= 0 && options->absolute_residual >= 0);
  rows list = {active ? active->rows : NULL, matrix->row_count};
  if (list.list) list.count = active->row_count;
  SONDE_ASSERT(list.count <= matrix->row_count);
  sonde_vec3 *r = scratch->r, *z = scratch->z, *p = scratch->p, *q = scratch->q;
  initial_residual(matrix, active, terms, term_count, list, b, x, scratch);
  sonde_pcg_result result = {.reference = sqrt(dot(list, b, b))};
  double target = options->relative_residual * result.reference;
  if (target < options->absolute_residual) target = options->absolute_residual;
  double rz = precondition(matrix, list, r, z);
  for (uint32_t k = 0; k < list.count; ++k) p[row(list, k)] = z[row(list, k)];
  result.residual = sqrt(dot(list, r, r));
  while (result.residual > target && result.iterations < options->max_iterations) {
    sonde_block_multiply(matrix, active, terms, term_count, p, q);
    double curvature = dot(list, p, q);
    if (!(curvature > 0)) break;
    double alpha = rz / curvature;
    axpy(list, alpha, p, x);
    axpy(list, -alpha, q, r);
    double next = precondition(matrix, list, r, z);
    direction(list, z, next / rz, p);
    rz = next;
    result.residual = sqrt(dot(list, r, r));
    result.iterations++;
  }
  result.converged = result.residual <= target;
  return result;
}
