// Products with the block matrix over its active rows and pairs, the inverses of its diagonal
// blocks, and its solution by conjugate gradients that these precondition.
#include "sparse/block.h"

#include "base/base.h"
#include "base/maths.h"
#include "sparse/pcg.h"

void sonde_block_multiply(const sonde_block_matrix *matrix, const sonde_active_set *active,
                          const sonde_rank_one *terms, uint32_t term_count, const sonde_vec3 *x,
                          sonde_vec3 *y) {
  SONDE_ASSERT(x != y);
  // Blocks on the diagonal.
  const uint32_t *list = active ? active->rows : NULL;
  uint32_t count = list ? active->row_count : matrix->row_count;
  for (uint32_t r = 0; r < count; ++r) {
    uint32_t i = list ? list[r] : r;
    y[i] = m_mul_v(matrix->diagonal[i], x[i]);
  }
  // y_i += B x_j and y_j += B^T x_i of each block above it.
  list = active ? active->pairs : NULL;
  count = list ? active->pair_count : matrix->pair_count;
  for (uint32_t k = 0; k < count; ++k) {
    uint32_t e = list ? list[k] : k, i = matrix->pairs[e][0], j = matrix->pairs[e][1];
    const double(*b)[3] = (const double(*)[3])matrix->upper[e].m;
    sonde_vec3 xi = x[i], xj = x[j];
    y[i].x += b[0][0] * xj.x + b[0][1] * xj.y + b[0][2] * xj.z;
    y[i].y += b[1][0] * xj.x + b[1][1] * xj.y + b[1][2] * xj.z;
    y[i].z += b[2][0] * xj.x + b[2][1] * xj.y + b[2][2] * xj.z;
    y[j].x += b[0][0] * xi.x + b[1][0] * xi.y + b[2][0] * xi.z;
    y[j].y += b[0][1] * xi.x + b[1][1] * xi.y + b[2][1] * xi.z;
    y[j].z += b[0][2] * xi.x + b[1][2] * xi.y + b[2][2] * xi.z;
  }
  // Rank-one terms.
  for (uint32_t t = 0; t < term_count; ++t) {
    const sonde_rank_one *term = &terms[t];
    double projection = 0;
    for (uint32_t k = 0; k < term->count; ++k) projection += v_dot(term->g[k], x[term->rows[k]]);
    projection *= term->scale;
    for (uint32_t k = 0; k < term->count; ++k)
      y[term->rows[k]] = v_madd(y[term->rows[k]], projection, term->g[k]);
  }
}

void sonde_block_invert_diagonal(sonde_block_matrix *matrix, const sonde_active_set *active) {
  const uint32_t *rows = active ? active->rows : NULL;
  uint32_t count = rows ? active->row_count : matrix->row_count;
  SONDE_ASSERT(count <= matrix->row_count);
  for (uint32_t r = 0; r < count; ++r) {
    uint32_t i = rows ? rows[r] : r;
    // Adjugate over determinant of a symmetric block. A block whose determinant rounds to no
    // positive number (one stiffness is 1e16 times another) counts as its mean stiffness in all
    // directions.
    const double(*d)[3] = (const double(*)[3])matrix->diagonal[i].m;
    double *inverse = matrix->inverse[i];
    double a = d[0][0], b = d[0][1], c = d[0][2], e = d[1][1], f = d[1][2], g = d[2][2];
    double xx = e * g - f * f, xy = c * f - b * g, xz = b * f - c * e;
    double determinant = a * xx + b * xy + c * xz;
    if (determinant <= 0) {
      double mean = (a + e + g) / 3;
      for (int k = 0; k < 6; ++k) inverse[k] = 0;
      inverse[0] = inverse[3] = inverse[5] = mean > 0 ? 1 / mean : 1;
      continue;
    }
    double s = 1.0 / determinant;
    inverse[0] = xx * s;
    inverse[1] = xy * s;
    inverse[2] = xz * s;
    inverse[3] = (a * g - c * c) * s;
    inverse[4] = (b * c - a * f) * s;
    inverse[5] = (a * e - b * b) * s;
  }
}

// ---- solution -----------------------------------------------------------------------------

typedef struct block_operator {
  const sonde_block_matrix *matrix;
  const sonde_active_set *active;
  const sonde_rank_one *terms;
  uint32_t term_count;
} block_operator;

static void multiply(const void *user, const double *x, double *y) {
  const block_operator *a = user;
  sonde_block_multiply(a->matrix, a->active, a->terms, a->term_count, (const sonde_vec3 *)x,
                       (sonde_vec3 *)y);
}

static double precondition(const void *user, const double *r, double *z) {
  const block_operator *a = user;
  const uint32_t *rows = a->active ? a->active->rows : NULL;
  uint32_t count = rows ? a->active->row_count : a->matrix->row_count;
  double sum = 0;
  for (uint32_t k = 0; k < count; ++k) {
    uint32_t i = rows ? rows[k] : k;
    const double *d = a->matrix->inverse[i], *v = r + 3 * (size_t)i;
    double *to = z + 3 * (size_t)i;
    to[0] = d[0] * v[0] + d[1] * v[1] + d[2] * v[2];
    to[1] = d[1] * v[0] + d[3] * v[1] + d[4] * v[2];
    to[2] = d[2] * v[0] + d[4] * v[1] + d[5] * v[2];
    sum += v[0] * to[0] + v[1] * to[1] + v[2] * to[2];
  }
  return sum;
}

sonde_pcg_result sonde_pcg_solve(const sonde_block_matrix *matrix, const sonde_active_set *active,
                                 const sonde_rank_one *terms, uint32_t term_count,
                                 const sonde_vec3 *b, sonde_vec3 *x,
                                 const sonde_pcg_scratch *scratch,
                                 const sonde_pcg_options *options) {
  const block_operator user = {matrix, active, terms, term_count};
  sonde_operator a = {.count = matrix->row_count,
                      .width = 3,
                      .multiply = multiply,
                      .precondition = precondition,
                      .user = &user};
  if (active && active->rows) a.rows = active->rows, a.count = active->row_count;
  SONDE_ASSERT(a.count <= matrix->row_count);
  const sonde_pcg_vectors vectors = {&scratch->r->x, &scratch->z->x, &scratch->p->x,
                                     &scratch->q->x};
  const sonde_pcg_goal goal = {.relative = options->relative_residual,
                               .absolute = options->absolute_residual,
                               .max_iterations = options->max_iterations};
  return sonde_pcg(&a, &b->x, &x->x, &vectors, &goal);
}
