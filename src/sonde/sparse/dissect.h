// Nested dissection of a sparse symmetric pattern by places of its rows.
#ifndef SONDE_SRC_DISSECT_H
#define SONDE_SRC_DISSECT_H

#include "sonde/base.h"

// Full pattern in compressed rows with ascending columns.
typedef struct sonde_pattern {
  uint32_t n;
  const uint32_t *start, *column; // [n + 1], [start[n]]
  const sonde_vec3 *points;       // [n]
} sonde_pattern;

// ARGUMENT for an empty pattern or one whose columns do not ascend.
sonde_status sonde_pattern_check(const sonde_pattern *pattern, sonde_error *error);

enum { SONDE_LEAF = 24 }; // rows of a piece that is not worth splitting

// order[n] receives the row at each place: the first `rows` of them with halves before what
// separates them, down to pieces of `leaf`; the others as they are. Columns may repeat, in any
// order. above [n], may be NULL: where a piece (a leaf or a separator) begins, the place where the
// separator above it begins, `rows` at a root; UINT32_MAX elsewhere. Children directly precede
// their parent.
sonde_status sonde_dissect(const sonde_pattern *pattern, uint32_t rows, uint32_t leaf,
                           uint32_t *order, uint32_t *above, sonde_error *error);

#endif
