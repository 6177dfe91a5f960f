// Preconditioned conjugate gradients on a block matrix.
// dot:        product over the active rows, in list order.
// start:      first residual and direction.
// advance:    solution, residual and preconditioned residual in one pass.
// solve:      the iteration of Hestenes and Stiefel with a warm start.
#include "sparse/block.h"

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

// p = z + beta p
static void direction(rows active, const sonde_vec3 *z, double beta, sonde_vec3 *p) {
  for (uint32_t r = 0; r < active.count; ++r) {
    uint32_t i = row(active, r);
    p[i] = v_madd(z[i], beta, p[i]);
  }
}

typedef struct products {
  double rz, rr;
} products;

static inline sonde_vec3 apply_inverse(const double *d, sonde_vec3 v) {
  return vec3(d[0] * v.x + d[1] * v.y + d[2] * v.z, d[1] * v.x + d[3] * v.y + d[4] * v.z,
              d[2] * v.x + d[4] * v.y + d[5] * v.z);
}

// x += alpha p, r -= alpha q, z = D^-1 r in one pass; returns r.z and r.r.
static products advance(const sonde_block_matrix *matrix, rows active, double alpha,
                        const sonde_pcg_scratch *s, sonde_vec3 *x) {
  products sum = {0, 0};
  for (uint32_t r = 0; r < active.count; ++r) {
    uint32_t i = row(active, r);
    x[i] = v_madd(x[i], alpha, s->p[i]);
    sonde_vec3 residual = v_madd(s->r[i], -alpha, s->q[i]);
    sonde_vec3 z = apply_inverse(matrix->inverse[i], residual);
    s->r[i] = residual;
    s->z[i] = z;
    sum.rz += v_dot(residual, z);
    sum.rr += v_norm2(residual);
  }
  return sum;
}

// r = b - A x, z = D^-1 r, p = z, using q as scratch; returns r.z and r.r.
static products start(const sonde_block_matrix *matrix, const sonde_active_set *active,
                      const sonde_rank_one *terms, uint32_t term_count, rows list,
                      const sonde_vec3 *b, const sonde_vec3 *x, const sonde_pcg_scratch *s) {
  products sum = {0, 0};
  sonde_block_multiply(matrix, active, terms, term_count, x, s->q);
  for (uint32_t k = 0; k < list.count; ++k) {
    uint32_t i = row(list, k);
    s->r[i] = v_sub(b[i], s->q[i]);
    s->p[i] = s->z[i] = apply_inverse(matrix->inverse[i], s->r[i]);
    sum.rz += v_dot(s->r[i], s->z[i]);
    sum.rr += v_norm2(s->r[i]);
  }
  return sum;
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
  products now = start(matrix, active, terms, term_count, list, b, x, scratch);
  sonde_pcg_result result = {.reference = sqrt(dot(list, b, b)), .residual = sqrt(now.rr)};
  double target = options->relative_residual * result.reference;
  if (target < options->absolute_residual) target = options->absolute_residual;
  while (result.residual > target && result.iterations < options->max_iterations) {
    sonde_block_multiply(matrix, active, terms, term_count, scratch->p, scratch->q);
    double curvature = dot(list, scratch->p, scratch->q);
    if (!(curvature > 0)) break;
    products next = advance(matrix, list, now.rz / curvature, scratch, x);
    direction(list, scratch->z, next.rz / now.rz, scratch->p);
    now = next;
    result.residual = sqrt(now.rr);
    result.iterations++;
  }
  result.converged = result.residual <= target;
  return result;
}
