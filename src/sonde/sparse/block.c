// Symmetric matrix of 3x3 blocks: creation, release, size.
#include "sonde/sparse.h"

#include "base/base.h"

sonde_status sonde_block_matrix_create(uint32_t rows, uint32_t pair_count,
                                       const uint32_t (*pairs)[2], sonde_block_matrix **out,
                                       sonde_error *error) {
  *out = NULL;
  for (uint32_t e = 0; e < pair_count; ++e)
    if (pairs[e][0] >= pairs[e][1] || pairs[e][1] >= rows)
      return sonde_fail(error, SONDE_ARGUMENT, "pair %u (%u, %u) is not ordered within the %u rows",
                        e, pairs[e][0], pairs[e][1], rows);
  sonde_block_matrix *matrix = SONDE_NEW(sonde_block_matrix, 1);
  if (!matrix) return sonde_fail_memory(error);
  matrix->row_count = rows;
  matrix->pair_count = pair_count;
  matrix->pairs = pairs;
  matrix->diagonal = SONDE_NEW(sonde_mat3, rows);
  matrix->upper = SONDE_NEW(sonde_mat3, pair_count);
  matrix->inverse = sonde_calloc(rows, sizeof *matrix->inverse);
  if (!matrix->diagonal || !matrix->upper || !matrix->inverse) {
    sonde_block_matrix_destroy(matrix);
    return sonde_fail_memory(error);
  }
  *out = matrix;
  return SONDE_OK;
}

void sonde_block_matrix_destroy(sonde_block_matrix *matrix) {
  if (!matrix) return;
  sonde_free(matrix->diagonal);
  sonde_free(matrix->upper);
  sonde_free(matrix->inverse);
  sonde_free(matrix);
}

size_t sonde_block_matrix_bytes(const sonde_block_matrix *matrix) {
  return matrix->row_count * (sizeof *matrix->diagonal + sizeof *matrix->inverse) +
         matrix->pair_count * (sizeof *matrix->upper + sizeof *matrix->pairs);
}
