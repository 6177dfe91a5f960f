// Curves that were measured more than once, and the two phases of a press.
#ifndef SONDE_SRC_FIT_REPEATS_H
#define SONDE_SRC_FIT_REPEATS_H

#include "fit/fit_inside.h"

typedef struct sonde_repeat_row {
  sonde_datum datum;
  sonde_vec3 position_m, normal;
  uint32_t line, repeat;
} sonde_repeat_row;

// False when a cell of the column phase names neither phase.
bool sonde_phase_of(const char *text, bool *loading);
// Replaces the rows of the measurements, which have room for them, by the mean curve of every site
// and probe at the depths of its first repeat; others are interpolated there. Fills scatter_n with
// the standard deviation of that mean: the repeats' own, pooled over the curve, over the root of
// their number. row is sorted.
sonde_status sonde_measurements_average(sonde_repeat_row *row, uint32_t count,
                                        sonde_measurements *m, sonde_error *error);

#endif
