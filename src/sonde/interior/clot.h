// Where a clot ends that does not fill its vein: what bounds it in the picture, in the labels and
// for the blood.
#ifndef SONDE_SRC_CLOT_H
#define SONDE_SRC_CLOT_H

#include "base/maths.h"
#include "sonde/interior.h"

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

// Turns per metre of the middle of a floating clot and of the channels of a recanalised one, and
// how far they wander, of the room that they have; the wider channel's share of all that is open.
// The channels keep apart where clot fills half of the lumen or more.
static const float clot_winds_per_m = 12, clot_wanders[2] = {0.6f, 0.9f}, clot_wide_share = 0.75f;

// How deep a place of the lumen lies in clot, in radii of the lumen; negative in blood. `a` and `b`
// are its coordinates over the half axes, a from the far wall; solid < 1 is the clot's share.
static inline double sonde_clot_depth(sonde_clot_form form, double solid, uint32_t vessel,
                                      double along_m, double a, double b) {
  if (form == SONDE_CLOT_MURAL)
    return -a - (1 - 2 * solid) - sonde_clot_surface(vessel, along_m, b);
  const double turns = (double)clot_winds_per_m * along_m + (double)sonde_clot_start(vessel, 0);
  const double c = cos(2 * SONDE_PI * turns), s = sin(2 * SONDE_PI * turns);
  if (form == SONDE_CLOT_FLOATING) {
    const double radius = sqrt(solid), off = (double)clot_wanders[0] * (1 - radius);
    return radius - hypot(a - off * c, b - off * s);
  }
  const double open = 1 - solid, wide = (double)clot_wide_share;
  const double one = sqrt(wide * open), other = sqrt((1 - wide) * open);
  const double far = (double)clot_wanders[1], off = far * (1 - one), opposite = far * (1 - other);
  return fmin(hypot(a - off * c, b - off * s) - one,
              hypot(a + opposite * c, b + opposite * s) - other);
}

// Whether clot holds a place of the lumen, of a clot whose share may be anything from 0 to 1.
static inline bool sonde_clot_holds(sonde_clot_form form, double solid, uint32_t vessel,
                                    double along_m, double a, double b) {
  if (!(solid > 0) || solid >= 1) return solid >= 1;
  return sonde_clot_depth(form, solid, vessel, along_m, a, b) > 0;
}

#endif
