// What the kernels of pictures from frames and from volumes share.
#ifndef SONDE_SRC_SWEEP_SLICE_MIX_H
#define SONDE_SRC_SWEEP_SLICE_MIX_H

#include "base/vector_records.h"
#include "sweep/slice.h"

#include <string.h>

static const float SLACK = 1e-3f; // of a pixel: rounding at an edge

typedef struct bounds {
  double low, high;
} bounds;

typedef struct rectangle {
  uint32_t column, row, wide, high; // pixels of the picture
} rectangle;

static inline bounds span(const double form[3], const rectangle *r) {
  double wide = r->wide - 1, high = r->high - 1;
  double centre = form[0] + form[1] * (r->column + 0.5 * wide) + form[2] * (r->row + 0.5 * high);
  double reach = 0.5 * (fabs(form[1]) * wide + fabs(form[2]) * high);
  return (bounds){centre - reach, centre + reach};
}

// The same of many forms at once.
static void span_all(const slice_spans *s, uint32_t count, const rectangle *r) {
  double wide = r->wide - 1, high = r->high - 1;
  double x = r->column + 0.5 * wide, y = r->row + 0.5 * high;
  const double *at = s->form[0], *column = s->form[1], *row = s->form[2];
  double *most = s->high, *least = s->low;
  for (uint32_t i = 0; i < count; ++i) {
    double centre = at[i] + column[i] * x + row[i] * y;
    double reach = 0.5 * (fabs(column[i]) * wide + fabs(row[i]) * high);
    least[i] = centre - reach, most[i] = centre + reach;
  }
}

static inline uint32_t at_most(uint32_t a, uint32_t b) { return a < b ? a : b; }

// What is no number becomes `low`.
INLINE float bound(float x, float low, float high) {
  x = x > low ? x : low;
  return x < high ? x : high;
}

static inline uint64_t two_greys(const uint8_t *p) {
  uint16_t both;
  memcpy(&both, p, sizeof both);
  return both;
}

INLINE float grey_of(uint32_t word, int byte) {
  return (float)(int32_t)(word >> (8 * byte) & 255u);
}

// Two rows of two greys each.
INLINE float mix_four(float a, float b, float c, float d, float t0, float t1) {
  float top = a + t0 * (b - a), low = c + t0 * (d - c);
  return top + t1 * (low - top);
}
INLINE float mix_sheet(uint32_t word, float t0, float t1) {
  return mix_four(grey_of(word, 0), grey_of(word, 1), grey_of(word, 2), grey_of(word, 3), t0, t1);
}

#endif
