// Free surface of a mural clot: what bounds it in the picture, in the labels and for the blood.
#ifndef SONDE_SRC_CLOT_H
#define SONDE_SRC_CLOT_H

#include "base/maths.h"

#include <stdint.h>

enum { CLOT_WAVES = 3 };

// A wave of the surface: height in radii of the lumen, cycles per radius across the lumen and per
// metre along it, share of a cycle at the origin.
typedef struct clot_wave {
  float height, across, per_m, start;
} clot_wave;

static const clot_wave clot_waves[CLOT_WAVES] = {
    {0.10f, 0.45f, 110, 0.13f}, {0.07f, 0.80f, 190, 0.57f}, {0.05f, 1.30f, 330, 0.31f}};
// The clot climbs the walls: bend of the surface across the lumen, and the square of the offset at
// which the bend changes sign.
static const float clot_bend = 0.5f, clot_level = 0.3f;

// Start of a wave in one vessel, in cycles.
static inline float sonde_clot_start(uint32_t vessel, uint32_t wave) {
  float turns = clot_waves[wave].start + 0.618034f * (float)(vessel * (wave + 1));
  return turns - (float)(int32_t)turns;
}

// Height of the surface over the chord that bounds the clot's share, in radii towards its bottom;
// `across` the lumen in radii, `along_m` as the sections count. It depends on the tissue alone, so
// that it stays where it is.
static inline double sonde_clot_surface(uint32_t vessel, double along_m, double across) {
  double sum = (double)clot_bend * ((double)clot_level - across * across);
  for (uint32_t k = 0; k < CLOT_WAVES; ++k) {
    const clot_wave *w = &clot_waves[k];
    double turns = (double)w->across * across + (double)w->per_m * along_m +
                   (double)sonde_clot_start(vessel, k);
    sum += (double)w->height * cos(2 * SONDE_PI * turns);
  }
  return sum;
}

#endif
