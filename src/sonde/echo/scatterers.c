// Random tables of a renderer: scatterers of the tissue, streamlines of the blood, receiver noise.
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <stdlib.h>

// Jittered grid: one scatterer per box of layers of 2^bits x 2^bits boxes. Fewer by chance in one
// place and more in another would make the speckle's contrast depend on the density. Boxes that
// follow each other lie apart, so that a scatterer seldom waits for what the one before it wrote.
static void draw_share(const scatter_pool *pool, uint64_t seed, uint32_t from, uint32_t first,
                       uint32_t bits, uint32_t layers) {
  const uint32_t layer = 1u << 2 * bits, side[3] = {1u << bits, 1u << bits, layers};
  for (uint32_t i = 0; i < layer * layers; ++i) {
    const uint32_t to = from + first + i;
    uint64_t j = 4 * (uint64_t)(first + i);
    uint32_t box[3] = {0, 0, i / layer};
    for (uint32_t k = 0; k < 2 * bits; ++k) box[k % 2] |= (i >> k & 1) << (bits - 1 - k / 2);
    float at[3];
    for (uint32_t c = 0; c < 3; ++c)
      at[c] = (float)((box[c] + sonde_random_uniform(seed, j + 1 + c)) / side[c] - 0.5);
    pool->x[to] = at[0], pool->y[to] = at[1], pool->z[to] = at[2];
    pool->sign[to] = sonde_random_bits(seed, j) & (1u << 20) ? 1.0f : -1.0f;
  }
}

static int by_value(const void *a, const void *b) {
  float x = *(const float *)a, y = *(const float *)b;
  return (x > y) - (x < y);
}

void sonde_scatterers_draw(sonde_echo *echo) {
  const scatter_pool *pool = &echo->pool, *blood = &echo->blood;
  const uint32_t all = echo->per_cell, layers = all / 64, quarter = all / 4,
                 piece = echo->per_piece;
  SONDE_ASSERT(all % 64 == 0 && all <= SONDE_POOL && piece % 16 == 0 && piece <= SONDE_LOOSE);
  for (uint32_t from = 0; from + all <= SONDE_POOL; from += all) {
    // In each cube's share the scatterers come in order of z, along the leg: the slab of a
    // transverse plane then takes or leaves whole vectors of them. Within a layer the other
    // coordinates do not depend on z, so that z alone is sorted.
    draw_share(pool, echo->seed, 0, from, 3, layers);
    for (uint32_t layer = 0; layer < layers; ++layer)
      qsort(pool->z + from + 64 * layer, 64, sizeof(float), by_value);
    // The same share in parts that are evenly spread each: of the four scatterers in two by two
    // boxes of a layer one goes to the first quarter, one to the second, two to the half. Order of
    // z is kept.
    const uint32_t to = SONDE_POOL + SONDE_LOOSE + from;
    uint32_t end[3] = {to, to + quarter, to + 2 * quarter};
    for (uint32_t i = 0; i < all; ++i) {
      const uint32_t layer = i / 64, square = i % 16, member = i / 16 % 4; // see draw_share()
      const uint64_t draw =
          sonde_random_bits(echo->seed + 7, ((uint64_t)from + 64 * layer) * 16 + square);
      const uint32_t part = (member + (uint32_t)(draw >> 40)) % 4, at = end[part < 2 ? part : 2]++;
      pool->x[at] = pool->x[from + i], pool->y[at] = pool->y[from + i];
      pool->z[at] = pool->z[from + i], pool->sign[at] = pool->sign[from + i];
    }
  }
  for (uint32_t i = 0; i + piece <= SONDE_LOOSE; i += piece)
    draw_share(pool, echo->seed + 5, SONDE_POOL, i, 2, piece / 16);
  // Streamlines evenly over a round section of unit width, so that the first n fill it for any n;
  // speed over the mean is 2 (1 - (r/R)^2). Bundles are squares of half a millimetre in a vein
  // of 7.
  const double bundles = 12;
  for (uint32_t i = 0; i < SONDE_BLOOD; ++i) {
    uint64_t j = 3 * (uint64_t)i, seed = echo->seed + 6;
    double square = sonde_random_uniform(seed, j), r = 0.5 * sqrt(square);
    double angle = 2 * SONDE_PI * sonde_random_uniform(seed, j + 1);
    blood->x[i] = (float)(r * cos(angle)), blood->y[i] = (float)(r * sin(angle));
    blood->z[i] = (float)sonde_random_uniform(seed, j + 2);
    blood->sign[i] = (float)(2 * (1 - square));
    echo->bundle[i] = (uint32_t)(((double)blood->x[i] + 0.5) * bundles) << 8 |
                      (uint32_t)(((double)blood->y[i] + 0.5) * bundles);
  }
  for (uint64_t i = 0; i < SONDE_NOISE; ++i)
    echo->noise[i] = (float)(sonde_random_normal(echo->seed + 1, i) * sqrt(0.5));
}
