// A commanded motion: one coordinate, straight between knots in time.
#ifndef SONDE_SRC_TRACK_H
#define SONDE_SRC_TRACK_H

#include "base/base.h"

typedef struct sonde_track {
  uint32_t count; // >= 1
  double *time_s; // [count] increasing
  double *value;  // [count]
} sonde_track;

sonde_status sonde_track_create(uint32_t room, sonde_track *track, sonde_error *error);
void sonde_track_clear(sonde_track *track);

// Value at a time; constant beyond the ends.
double sonde_track_at(const sonde_track *track, double time_s);
// Slope of the piece from knot k to the next.
double sonde_track_slope(const sonde_track *track, uint32_t k);

// Straight moves behind noisy samples, as a robot makes them: the fewest pieces that the noise
// allows, by least squares, joined where neighbouring lines cross.
// @param value the first of count samples, stride doubles apart; the same for time_s
sonde_status sonde_track_fit(const double *time_s, const double *value, size_t stride,
                             uint32_t count, sonde_track *track, sonde_error *error);

#endif
