// What creating a body of blocks and evaluating it share; in double precision.
#ifndef SONDE_SRC_BULK_BLOCKS_INSIDE_H
#define SONDE_SRC_BULK_BLOCKS_INSIDE_H

#include "tissue/bulk/batches.h"
#include "tissue/bulk/blocks.h"
#include "tissue/bulk/bulk.h"

struct sonde_bulk_blocks {
  const sonde_model *model;
  sonde_bulk_graph graph; // its springs, for the energy
  sonde_tissue *tissue;
  uint32_t batch_count;
  sonde_rows *rows; // [batches]
  real *place;      // [rows + 1][SONDE_RECORD] displacement and velocity; the last one never moves
  void *block;
};

#endif
