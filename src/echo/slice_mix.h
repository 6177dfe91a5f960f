// What the kernels of pictures from frames and from volumes share.
#ifndef SONDE_SRC_ECHO_SLICE_MIX_H
#define SONDE_SRC_ECHO_SLICE_MIX_H

#include "base/vector.h"
#include "echo/slice.h"

#include <string.h>

static const float SLACK = 1e-3f; // of a pixel: rounding at an edge

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
INLINE float mix_sheet(uint32_t word, float t0, float t1) {
  float a = grey_of(word, 0), b = grey_of(word, 1), c = grey_of(word, 2), d = grey_of(word, 3);
  float top = a + t0 * (b - a), low = c + t0 * (d - c);
  return top + t1 * (low - top);
}

#endif
