/**
 * @file sparse.h
 * Symmetric sparse matrices of 3x3 blocks and preconditioned conjugate gradients.
 */
#ifndef SONDE_SPARSE_H
#define SONDE_SPARSE_H

#include "sonde/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/**
 * Symmetric matrix of 3x3 blocks: one full block per row on the diagonal and one block per pair
 * (i<j) above it; the block below is its transpose. The pattern is fixed at creation.
 */
typedef struct sonde_block_matrix {
  uint32_t row_count, pair_count;
  const uint32_t (*pairs)[2]; /**< [pair_count] borrowed, first < second */
  sonde_mat3 *diagonal;       /**< [row_count] symmetric */
  sonde_mat3 *upper;          /**< [pair_count] block (first, second) */
  double (*inverse)[6];       /**< [row_count] inverse of the diagonal block: xx xy xz yy yz zz */
} sonde_block_matrix;

/** @param pairs borrowed, must outlive the matrix @thread owner */
SONDE_API sonde_status sonde_block_matrix_create(uint32_t rows, uint32_t pair_count,
                                                 const uint32_t (*pairs)[2],
                                                 sonde_block_matrix **matrix, sonde_error *error);
SONDE_API void sonde_block_matrix_destroy(sonde_block_matrix *matrix); /**< @thread owner */
/** Bytes of the stored numbers (for the memory table). @thread any */
SONDE_API size_t sonde_block_matrix_bytes(const sonde_block_matrix *matrix);

/** Rows and pairs that take part; NULL lists mean all. Rows outside keep their value. */
typedef struct sonde_active_set {
  const uint32_t *rows;
  uint32_t row_count;
  const uint32_t *pairs;
  uint32_t pair_count;
} sonde_active_set;

/** A symmetric rank-one term added to a matrix: scale * g g^T over a list of rows. */
typedef struct sonde_rank_one {
  double scale;
  uint32_t count;
  const uint32_t *rows;
  const sonde_vec3 *g;
} sonde_rank_one;

/** Inverts the diagonal blocks (the block-Jacobi preconditioner). @thread tick */
SONDE_API void sonde_block_invert_diagonal(sonde_block_matrix *matrix,
                                           const sonde_active_set *active);

typedef struct sonde_pcg_options {
  double relative_residual; /**< stop at |r| <= this * |b| */
  double absolute_residual; /**< or at |r| <= this */
  uint32_t max_iterations;
} sonde_pcg_options;

typedef struct sonde_pcg_result {
  uint32_t iterations;
  double residual;  /**< |r| at the end */
  double reference; /**< |b| */
  bool converged;
} sonde_pcg_result;

/** Scratch of the solver: four vectors of row_count. */
typedef struct sonde_pcg_scratch {
  sonde_vec3 *r, *z, *p, *q;
} sonde_pcg_scratch;

/**
 * Block-Jacobi preconditioned conjugate gradients, warm-started from x. The diagonal must have been
 * inverted. Deterministic: sums run in list order. Press et al. 1992; docs/world.md.
 * @thread tick (no allocation)
 */
SONDE_API sonde_pcg_result sonde_pcg_solve(const sonde_block_matrix *matrix,
                                           const sonde_active_set *active,
                                           const sonde_rank_one *terms, uint32_t term_count,
                                           const sonde_vec3 *b, sonde_vec3 *x,
                                           const sonde_pcg_scratch *scratch,
                                           const sonde_pcg_options *options);

#ifdef __cplusplus
}
#endif
#endif
