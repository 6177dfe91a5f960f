// A leg under a probe that goes anywhere. One live solid serves, around the place where it was
// made. Where the probe strays from that, a builder makes the next one below the probe, takes it to
// the probe's pose, and the tick changes over to it; the hand is eased from the one to the other.
//
//   tick ---- pass asked for ----> worker: the pass        \  both counted by asked and done; the
//        ---- place asked for ---> builder: mesh, walk     /  tick looks at its schedule's ticks
//        ---- displacements -----> image: tissue and skin of a place, until it is given back
//
// Which pass and which place belong to which tick are bits that each tick returns. Told again, they
// give the same forces, whoever does the work when.
#ifndef SONDE_SRC_LEG_H
#define SONDE_SRC_LEG_H

#include "base/link.h"
#include "sonde/solid_live.h"

typedef struct sonde_solid_leg sonde_solid_leg;
typedef struct sonde_leg_place sonde_leg_place;

enum {
  SONDE_LEG_PASS = 1,               // a pass was taken over
  SONDE_LEG_PLACE = 2,              // a step of the builder was
  SONDE_LEG_AS_DONE = 1 << 30,      // instead of these: whatever is done
  SONDE_LEG_NODES_MOST = 12 * 1024, // of a place's mesh
};

typedef struct sonde_solid_leg_def {
  const sonde_model *model;        // this and the following four are borrowed
  const sonde_interior *columns;   // of the model; only what does not move is read. NULL: no bone
  const sonde_surface_index *skin; // of the model at rest
  const sonde_probe *probes;       // [probe_count]
  uint32_t probe_count;
  sonde_hexes_def mesh; // its footprint is the probe's
  sonde_solid_live_def live;
  // From the place's middle, before the next is made, and for a probe that is held still.
  double stray_m, stray_rad, still_m;
} sonde_solid_leg_def;
SONDE_LINK sonde_solid_leg_def sonde_solid_leg_def_default(void);

// No place is there before a probe comes near the skin. @return ARGUMENT, MEMORY @thread owner
SONDE_LINK sonde_status sonde_solid_leg_create(const sonde_solid_leg_def *def,
                                               sonde_solid_leg **leg, sonde_error *error);
SONDE_LINK void sonde_solid_leg_destroy(sonde_solid_leg *leg); // @thread owner

// One millisecond. Neither allocates nor waits. @param told bits @return those that came true
// @thread tick
SONDE_LINK uint32_t sonde_solid_leg_tick(sonde_solid_leg *leg, uint32_t probe, sonde_pose pose,
                                         uint32_t told, sonde_solid_contact *contact);
// Does the pass that was asked for. @return whether there was one @thread worker
SONDE_LINK bool sonde_solid_leg_work(sonde_solid_leg *leg);
// Does the step of a place that was asked for. @return whether there was one @thread builder
SONDE_LINK bool sonde_solid_leg_build(sonde_solid_leg *leg);
// Does all that a tick with these bits takes over. @thread owner, in place of worker and builder
SONDE_LINK void sonde_solid_leg_await(sonde_solid_leg *leg, uint32_t told);

// What a leg without load depends on.
typedef struct sonde_leg_moment {
  uint64_t ticks;
  sonde_pose last; // of the probe, in the last tick
  sonde_vec3 drift_m_s;
  sonde_pose place, refused; // where the place in use was asked for, and one that is none
  sonde_pose asked[2];       // of its last passes
  uint32_t probe, refused_probe;
  uint8_t moved, placed, is_refused;
} sonde_leg_moment;
// @return false: the solid is loaded or a place is being made, and there is no such moment
// @thread tick
SONDE_LINK bool sonde_solid_leg_remember(const sonde_solid_leg *leg, sonde_leg_moment *moment);
// Goes on from there, with the same bits. @return FORMAT for poses that are none, MEMORY, ...
// @thread owner, in place of all others
SONDE_LINK sonde_status sonde_solid_leg_recall(sonde_solid_leg *leg, const sonde_leg_moment *moment,
                                               sonde_error *error);

// For the image of this tick: displacements [SONDE_LEG_NODES_MOST] of the last pass, of the place
// that is returned, which stays until it is given back; NULL: none, all is at rest. @thread tick
SONDE_LINK sonde_leg_place *sonde_solid_leg_offer(sonde_solid_leg *leg, sonde_vec3 *moved);
// Tissue of these displacements, until the next call or the return. @thread image
SONDE_LINK const sonde_interior_tissue *sonde_leg_place_tissue(sonde_leg_place *place,
                                                               const sonde_vec3 *moved);
// Moves the model's skin [surface vertices] from rest, and marks with a unit vector what touches
// the probe; other nodes are not written. Behind sonde_leg_place_tissue(). @thread image
SONDE_LINK void sonde_leg_place_skin(const sonde_leg_place *place, sonde_pose pose,
                                     sonde_vec3 *skin_m, sonde_vec3 *touching);
SONDE_LINK void sonde_leg_place_give_back(sonde_leg_place *place); // @thread image

typedef struct sonde_leg_counts {
  uint64_t ticks, passes, factors;
  uint64_t without_place;        // ticks in the skin at rest where no place bears the probe
  uint32_t late;                 // passes that were not done when they were due
  uint32_t places, refused;      // handed over; asked for where no ring can be
  double pass_s, pass_most_s;    // processor time of the passes, and of the longest
  double build_s, handed_over_n; // of the places; largest change of the force they made
} sonde_leg_counts;
SONDE_LINK sonde_leg_counts sonde_solid_leg_count(const sonde_solid_leg *leg); // @thread owner

#endif
