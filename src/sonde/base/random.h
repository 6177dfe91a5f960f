// Counter-based random numbers: a value depends only on (seed, counter), so any item can be drawn
// again, in any order, on any thread.
//
// The generator mixes seed and counter with alternating xor-shifts and odd multiplications. Each
// such step is a bijection of 64 bits, so that for a fixed seed no two counters collide.
#ifndef SONDE_SRC_RANDOM_H
#define SONDE_SRC_RANDOM_H

#include "base/elementary.h"
#include <stdint.h>

static inline uint64_t sonde_random_mix(uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

// 64 random bits. @thread any (tick)
static inline uint64_t sonde_random_bits(uint64_t seed, uint64_t counter) {
  uint64_t key = sonde_random_mix(seed + 0x9e3779b97f4a7c15u);
  return sonde_random_mix(sonde_random_mix(counter * 0xd1342543de82ef95u + key) ^ key);
}

// Uniform in [0, 1), 53 bits. @thread any (tick)
static inline double sonde_random_uniform(uint64_t seed, uint64_t counter) {
  return (double)(sonde_random_bits(seed, counter) >> 11) * 0x1p-53;
}

// Standard normal by the polar form of the Gaussian: radius from one uniform, angle from another
// that is mixed out of the same counter. @thread any (tick)
static inline double sonde_random_normal(uint64_t seed, uint64_t counter) {
  uint64_t first = sonde_random_bits(seed, counter);
  uint64_t second = sonde_random_mix(first ^ 0x5851f42d4c957f2du);
  double u = ((double)(first >> 11) + 0.5) * 0x1p-53; // in (0, 1): log is finite
  double angle = (double)(second >> 11) * (0x1p-53 * 6.28318530717958647692);
  return sqrt(-2.0 * log(u)) * cos(angle);
}

#endif
