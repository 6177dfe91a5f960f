// Pieces of a nested dissection (leaves and separators) and what each leaves to those above it:
// what multifrontal factors have in common.
#ifndef SONDE_SRC_PIECES_H
#define SONDE_SRC_PIECES_H

#include "sparse/dissect.h"

// A piece's update waits on a stack for its parent. On top when piece t takes its children's lies
// that of t - 1; `before` leads to the others.
typedef struct sonde_piece {
  uint32_t first, count;             // own rows: places in the order
  uint32_t boundary, boundary_count; // later places that it touches or its children leave
  uint32_t parent, child_count;
  uint32_t before;             // the piece whose update waits below; UINT32_MAX: none
  uint32_t entry, entry_count; // the user's: what the matrix adds
  size_t factor;               // the user's: where its part of the factor begins
} sonde_piece;

typedef struct sonde_pieces {
  uint32_t count;
  sonde_piece *list; // [count + 1]; the last one, of the rows not dissected, is above the roots
  uint32_t *order, *rank; // [n] row at a place, place of a row
  uint32_t *piece_of;     // [n + 1] piece at a place
  uint32_t *boundary;     // [boundary_total] places, ascending per piece
  size_t boundary_total;
} sonde_pieces;

// Dissects the first `rows` of the pattern (sonde_dissect) and analyses. Clear after a failure,
// too.
sonde_status sonde_pieces_find(const sonde_pattern *pattern, uint32_t rows, uint32_t leaf,
                               sonde_pieces *pieces, sonde_error *error);
void sonde_pieces_clear(sonde_pieces *pieces);

#endif
