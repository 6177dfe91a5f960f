// Reading records without a model.
#ifndef SONDE_SRC_SUMMARY_H
#define SONDE_SRC_SUMMARY_H

#include "identify/track.h"
#include "sonde/identify.h"

// Samples [from, to) of a record between two times.
typedef struct sonde_span {
  uint32_t from, to;
} sonde_span;

sonde_span sonde_span_between(const sonde_motion_record *record, double start_s, double end_s);
double sonde_median(double *values, uint32_t count); // sorts them; count > 0

// Slower than this a probe stands.
#define SONDE_STANDS_M_S 5e-4

#endif
