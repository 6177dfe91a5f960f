// Position along a space-filling curve: points with close keys are close in space.
#ifndef SONDE_SRC_MORTON_H
#define SONDE_SRC_MORTON_H

#include "base/maths.h"

// Every third bit of the result is a bit of x (21 bits).
static inline uint64_t sonde_morton_spread(uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffu;
  x = (x | x << 16) & 0x1f0000ff0000ffu;
  x = (x | x << 8) & 0x100f00f00f00f00fu;
  x = (x | x << 4) & 0x10c30c30c30c30c3u;
  return (x | x << 2) & 0x1249249249249249u;
}

// Key of a point within 10 m of the origin, in steps of 0.1 mm.
static inline uint64_t sonde_morton_key(sonde_vec3 p) {
  const double at[3] = {p.x, p.y, p.z};
  uint64_t key = 0;
  for (int k = 0; k < 3; ++k)
    key |= sonde_morton_spread((uint64_t)clamp((at[k] + 10) * 1e4, 0, 2e6)) << k;
  return key;
}

typedef struct sonde_keyed {
  uint64_t key;
  uint32_t index;
} sonde_keyed;

// Order of qsort: by key, equal keys by index.
static inline int sonde_keyed_compare(const void *a, const void *b) {
  const sonde_keyed *x = a, *y = b;
  if (x->key != y->key) return x->key < y->key ? -1 : 1;
  return x->index < y->index ? -1 : x->index > y->index;
}

#endif
