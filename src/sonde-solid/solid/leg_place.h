// Inside of a leg under a probe.
#ifndef SONDE_SRC_LEG_PLACE_H
#define SONDE_SRC_LEG_PLACE_H

#include "inside.h"
#include "leg.h"
#include "live.h"

struct sonde_leg_place {
  sonde_pose asked, start; // where it was asked for; where the probe touches the skin at rest there
  uint32_t probe;
  sonde_hexes mesh;
  sonde_solid_live *live;
  sonde_interior_tissue *tissue;
  uint32_t skin_count;
  uint32_t *skin;              // [skin_count] nodes of the model's surface near it
  sonde_vec3 *skin_rest;       // [skin_count]
  sonde_tissue_shares *shares; // [skin_count]
  _Atomic uint32_t readers;    // images
  sonde_leg_place *next;       // of those that no longer serve
};

enum { SONDE_LEG_SPARES = 4 }; // of two places

typedef enum sonde_leg_step { SONDE_LEG_IDLE, SONDE_LEG_MAKE, SONDE_LEG_WALK } sonde_leg_step;

struct sonde_solid_leg {
  sonde_solid_leg_def def;

  // The tick's.
  sonde_leg_moment now;
  sonde_leg_counts counts; // but the times and numbers of worker and builder
  sonde_leg_step step;     // under way
  uint32_t walks;          // of the place that comes

  // Crosses the threads.
  _Atomic(sonde_leg_place *) current, working; // NULL: none
  _Atomic uint32_t wanted, built;              // steps of the builder
  sonde_pose wanted_pose;
  uint32_t wanted_probe;
  sonde_leg_place *coming, *given_back; // NULL: none

  // Worker's and builder's.
  sonde_leg_counts passes, builds;
  sonde_leg_place *retired;
  // Factors of places that were freed: memory that is new is dearer than a factor.
  sonde_numeric spare[SONDE_LEG_SPARES];
  uint32_t spares;
};

#endif
