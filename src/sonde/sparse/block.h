// Product with the symmetric matrix of 3x3 blocks: block_hot.c.
#ifndef SONDE_SRC_SPARSE_BLOCK_H
#define SONDE_SRC_SPARSE_BLOCK_H

#include "sonde/sparse.h"

// y = A x over the active rows, A with the rank-one terms added. @thread tick
void sonde_block_multiply(const sonde_block_matrix *matrix, const sonde_active_set *active,
                          const sonde_rank_one *terms, uint32_t term_count, const sonde_vec3 *x,
                          sonde_vec3 *y);

#endif
