// Hot kernels of the block matrix.
// multiply: y = A x over the active rows and pairs, plus rank-one terms.
// invert:   inverse of each symmetric diagonal block for the preconditioner.
#include "sparse/block.h"

#include "base/base.h"
#include "base/maths.h"

static void multiply_diagonal(const sonde_block_matrix *matrix, const sonde_active_set *active,
                              const sonde_vec3 *x, sonde_vec3 *y) {
  const uint32_t *rows = active ? active->rows : NULL;
  uint32_t count = rows ? active->row_count : matrix->row_count;
  for (uint32_t r = 0; r < count; ++r) {
    uint32_t i = rows ? rows[r] : r;
    y[i] = m_mul_v(matrix->diagonal[i], x[i]);
  }
}

// y_i += B x_j and y_j += B^T x_i for one stored block.
static inline void multiply_pair(const sonde_mat3 *block, const sonde_vec3 *x, sonde_vec3 *y,
                                 uint32_t i, uint32_t j) {
  const double(*b)[3] = block->m;
  sonde_vec3 xi = x[i], xj = x[j];
  y[i].x += b[0][0] * xj.x + b[0][1] * xj.y + b[0][2] * xj.z;
  y[i].y += b[1][0] * xj.x + b[1][1] * xj.y + b[1][2] * xj.z;
  y[i].z += b[2][0] * xj.x + b[2][1] * xj.y + b[2][2] * xj.z;
  y[j].x += b[0][0] * xi.x + b[1][0] * xi.y + b[2][0] * xi.z;
  y[j].y += b[0][1] * xi.x + b[1][1] * xi.y + b[2][1] * xi.z;
  y[j].z += b[0][2] * xi.x + b[1][2] * xi.y + b[2][2] * xi.z;
}

static void multiply_pairs(const sonde_block_matrix *matrix, const sonde_active_set *active,
                           const sonde_vec3 *x, sonde_vec3 *y) {
  const uint32_t *list = active ? active->pairs : NULL;
  uint32_t count = list ? active->pair_count : matrix->pair_count;
  for (uint32_t k = 0; k < count; ++k) {
    uint32_t e = list ? list[k] : k;
    multiply_pair(&matrix->upper[e], x, y, matrix->pairs[e][0], matrix->pairs[e][1]);
  }
}

static void multiply_rank_one(const sonde_rank_one *term, const sonde_vec3 *x, sonde_vec3 *y) {
  double projection = 0;
  for (uint32_t k = 0; k < term->count; ++k) projection += v_dot(term->g[k], x[term->rows[k]]);
  projection *= term->scale;
  for (uint32_t k = 0; k < term->count; ++k)
    y[term->rows[k]] = v_madd(y[term->rows[k]], projection, term->g[k]);
}

void sonde_block_multiply(const sonde_block_matrix *matrix, const sonde_active_set *active,
                          const sonde_rank_one *terms, uint32_t term_count, const sonde_vec3 *x,
                          sonde_vec3 *y) {
  SONDE_ASSERT(x != y);
  multiply_diagonal(matrix, active, x, y);
  multiply_pairs(matrix, active, x, y);
  for (uint32_t t = 0; t < term_count; ++t) multiply_rank_one(&terms[t], x, y);
}

// Adjugate over determinant of a symmetric 3x3 block. A block whose determinant rounds to no
// positive number (one stiffness is 1e16 times another) counts as its mean stiffness in all
// directions.
static void invert_symmetric(const double (*d)[3], double *inverse) {
  double a = d[0][0], b = d[0][1], c = d[0][2], e = d[1][1], f = d[1][2], g = d[2][2];
  double xx = e * g - f * f, xy = c * f - b * g, xz = b * f - c * e;
  double determinant = a * xx + b * xy + c * xz;
  if (determinant <= 0) {
    double mean = (a + e + g) / 3;
    for (int k = 0; k < 6; ++k) inverse[k] = 0;
    inverse[0] = inverse[3] = inverse[5] = mean > 0 ? 1 / mean : 1;
    return;
  }
  double s = 1.0 / determinant;
  inverse[0] = xx * s;
  inverse[1] = xy * s;
  inverse[2] = xz * s;
  inverse[3] = (a * g - c * c) * s;
  inverse[4] = (b * c - a * f) * s;
  inverse[5] = (a * e - b * b) * s;
}

void sonde_block_invert_diagonal(sonde_block_matrix *matrix, const sonde_active_set *active) {
  const uint32_t *rows = active ? active->rows : NULL;
  uint32_t count = rows ? active->row_count : matrix->row_count;
  SONDE_ASSERT(count <= matrix->row_count);
  for (uint32_t r = 0; r < count; ++r) {
    uint32_t i = rows ? rows[r] : r;
    invert_symmetric((const double(*)[3])matrix->diagonal[i].m, matrix->inverse[i]);
  }
}
