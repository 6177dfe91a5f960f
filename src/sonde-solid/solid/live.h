// Inside of a live solid. The worker owns all but the tick's part; tangents change hands by the
// counts of passes asked for and done.
#ifndef SONDE_SRC_SOLID_LIVE_H
#define SONDE_SRC_SOLID_LIVE_H

#include "equilibrium.h"
#include "sonde/solid_live.h"

#include <stdatomic.h>

// The solid as the tick sees it: where the zone's skin would be without a probe, and how it gives.
typedef struct sonde_live_tangent {
  sonde_vec3 *free_m;   // [zone_count] places
  float *give_m_n;      // [side][width] displacements of the zone's nodes for a force on one
  double stiffness_n_m; // of all of the zone held to the probe
  sonde_vec3 *moved;    // [node_count] displacements of the state
  bool rests;           // the state is the solid's at rest, see sonde_live_is_at_rest()
} sonde_live_tangent;

// A probe whose way from the state's pose is less than this is where the state is.
static const double sonde_live_still_m = 1e-7;

// A point of the contact's quadrature.
typedef struct sonde_live_point {
  uint32_t node[4]; // of the zone
  double share[4];  // of the nodes
  double soft_m_n;  // depth per force of the contact
  float load_n;     // pushes the skin out, from tick to tick
} sonde_live_point;

// A point that may bear a force in a tick.
typedef struct sonde_live_candidate {
  sonde_live_point *point;
  sonde_vec3 out; // unit, the way the skin is pushed
  sonde_vec3 arm; // from the probe's origin
  float part[12]; // out times share, by node and axis
  float depth_m;  // without any force
  float give_m_n; // own, with the contact's; 0: `row` is not made yet
  float *row;     // [width] displacements of the zone's nodes for a force on the point
} sonde_live_candidate;

struct sonde_solid_live {
  sonde_solid_live_def def;
  sonde_equilibrium *e; // the state of the last pass, its numbering, its contact

  // The worker's. Hexahedra of the bulk, then those of the skin that stay nonlinear.
  uint32_t *hex, bulk_count, skin_count;
  uint8_t *is_skin;      // [hexes]
  sonde_numeric bulk[2]; // the factor that serves and the one in the making
  sonde_pose bulk_pose[2];
  bool is_shifted[2], of_rest[2]; // made positive definite by a shift; of the solid at rest
  int serves;
  sonde_pose before; // that the pass before was asked for
  bool making;
  bool returns;           // the state comes from rest and is not with the probe yet
  bool walks;             // sonde_live_walk() is under way
  uint32_t stuck;         // passes in a row without a step, or without balance
  uint32_t settled;       // passes in a row at one pose that began in balance
  double shift;           // of the factor in the making, over an element's mean diagonal
  uint64_t slice;         // multiplications of a factor per pass
  sonde_vec3 *bulk_state; // [node_count] that the factor in the making is of
  double unbalance;       // what the last pass has left without balance, over the contact's force
  double *pull;           // [patch side] load of the condensed bulk at the state
  double *stretch;        // [patch side] what the bulk exerts for the ways of this pass
  double *ways;           // [patch side] of this pass
  double *left;           // [patch side] right-hand side, then ways of a step
  double *right, *rest, *trial; // [patch side]
  float *tangent;               // [patch side][stride] by columns: eliminated down to the zone
  bool ready;                   // `tangent` is that of the state
  bool rests;                   // so do state, factor and `tangent`, as after the creation
  float *inverse;               // [2 zone side][stride] front
  sonde_solid_live_counts counts;

  // Both: a pass writes tangent[pass & 1].
  _Atomic uint32_t asked, done;        // passes
  sonde_pose asked_pose, asked_before; // of the pass asked for last and of the one before it
  sonde_live_tangent shown[2];

  // The tick's.
  uint32_t point_count, width, serving;
  uint64_t ticks;
  uint32_t late;
  bool touches;                    // in the last tick
  bool adopts;                     // what the hand felt on another solid is taken over
  sonde_live_point *point;         // [zone_faces * SONDE_TOUCH_POINTS]
  sonde_live_candidate *candidate; // [point_count]
  float *rows;                     // [point_count][width]
  float *moved;                    // [width] displacements of the zone's nodes under the loads
  sonde_vec3 *skin;                // [zone_count] places of the last tick
  sonde_vec3 felt_n, felt_nm;      // by the hand in the last tick
  sonde_pose felt_pose;            // and where
  sonde_vec3 easing_n, easing_nm;  // of it what the contact does not exert
};

static inline size_t sonde_live_side(const sonde_solid_live *l) { // of patch and zone
  return 3 * (size_t)(l->e->patch_count + l->e->zone_count);
}

// Room for a factor of the bulk, and for those of the places that follow, which differ by a little.
static inline sonde_status sonde_live_reserve(sonde_numeric *bulk, const sonde_symbolic *symbolic,
                                              sonde_error *error) {
  bulk->single = true, bulk->slack = 0.125;
  return sonde_numeric_reserve(bulk, symbolic, error);
}

// As sonde_solid_live_create(), with the memory of two factors that another live solid has left,
// which is taken; NULL: none.
sonde_status sonde_live_make(const sonde_hexes *mesh, const sonde_probe *probe, sonde_pose start,
                             const sonde_solid_live_def *def, sonde_numeric *spare,
                             sonde_solid_live **live, sonde_error *error);
// Whether the pass that was asked for is done. @thread tick
static inline bool sonde_live_is_done(const sonde_solid_live *l) {
  return atomic_load_explicit(&l->done, memory_order_acquire) ==
         atomic_load_explicit(&l->asked, memory_order_relaxed);
}
// A tick that takes over the pass that is done and asks for the next, or does not. @thread tick
void sonde_live_step(sonde_solid_live *live, sonde_pose pose, bool take,
                     sonde_solid_contact *contact);
// Whether the solid is at rest, its factor and tangent too, and no skin bears the probe: then what
// follows depends on asked_pose and asked_before alone. @thread tick
static inline bool sonde_live_is_at_rest(const sonde_solid_live *l) {
  return l->shown[l->serving].rests && !l->touches;
}
// Goes back there, with a pass under way at asked[1] behind one at asked[0]. Not during a pass.
// @return false: there is no positive tangent @thread owner
bool sonde_live_rest(sonde_solid_live *live, const sonde_pose asked[2]);
// Takes the state to a pose by passes of its own, before any tick. @thread owner
void sonde_live_walk(sonde_solid_live *live, sonde_pose pose);
// Begins the factor of the state, all of it or in slices.
void sonde_live_begin_factor(sonde_solid_live *live);
// One share of it; a finished factor serves from then on. @return false: it is not done yet
bool sonde_live_share_factor(sonde_solid_live *live, uint64_t budget);
// Forces of the bulk at the state. @return false: turned inside out
bool sonde_live_forces(sonde_solid_live *live);
// The load of the condensed bulk, of these forces.
void sonde_live_pull(sonde_solid_live *live);
// The tangent at the state, condensed on the zone, for the tick. @return false: no positive one
bool sonde_live_show(sonde_solid_live *live, sonde_live_tangent *shown);
// Whether a probe at the pose leaves the skin at rest.
bool sonde_live_is_clear(sonde_solid_live *live, sonde_pose pose);
// Takes the state to a pose that touches: the skin's Newton steps, then the bulk; leaves the forces
// there.
// @return false: no step found, the state is the old one
bool sonde_live_follow(sonde_solid_live *live, sonde_pose pose);

#endif
