// Inside of the vessels' flow in a pressed model.
#ifndef SONDE_SRC_FLOW_SCENE_H
#define SONDE_SRC_FLOW_SCENE_H

#include "base/maths.h"
#include "interior/clot.h"
#include "interior/interior.h"
#include "sonde/flow_colour.h"

// Instead of the number of a vein: all of the segment's blood, or the main vein's velocity at rest
// areas.
enum { SCENE_WHOLE = SONDE_FLOW_VEINS, SCENE_OTHER };

typedef struct scene_section {
  sonde_flow_segment segment;
  uint32_t vein;
  double share;   // of the segment's flow that runs here: less below where blood enters all along
  double upwards; // 1: the section's axis points to the heart; -1: away from it
} scene_section;

struct sonde_flow_scene {
  const sonde_interior *interior;
  scene_section *all, *section[SONDE_VESSELS];           // [sections of each vessel]
  sonde_flow flow;                                       // as the last run left it
  double profile[SONDE_FLOW_SEGMENTS][SONDE_FLOW_RINGS]; // of the main veins
  double artery_m_s, artery_profile[SONDE_FLOW_RINGS];
  // Of a segment's flow: what runs through each of its veins; velocity in the main one, 1/m2.
  double part[SONDE_FLOW_SEGMENTS][SONDE_FLOW_VEINS], main_per_m2[SONDE_FLOW_SEGMENTS];
  struct sonde_gate *gate; // that hears the blood while it runs; NULL: none
  // Each vessel's blood in the section that the picture shows, as the last run left it, and the
  // flow of each segment by which rouleaux form and break up: it falls slowly.
  uint32_t shown[SONDE_VESSELS];
  sonde_vessel_blood blood[SONDE_VESSELS];
  double clearing_m3_s[SONDE_FLOW_SEGMENTS];
};

// What gives blood its speed: the profile of a segment's main vein (below SONDE_FLOW_SEGMENTS), the
// flow of segment drive - SONDE_FLOW_SEGMENTS, or the arteries' profile.
enum { SCENE_ARTERY = 2 * SONDE_FLOW_SEGMENTS };
typedef struct scene_blood {
  int drive;
  double factor, ring;
  sonde_vec3 along; // world, unit: the way of a positive speed
} scene_blood;

// Speed of the blood now, along its way.
static inline double scene_speed(const sonde_flow_scene *s, const scene_blood *b) {
  if (b->drive >= SONDE_FLOW_SEGMENTS && b->drive < SCENE_ARTERY)
    return b->factor * s->flow.flow_m3_s[b->drive - SONDE_FLOW_SEGMENTS];
  const double *profile = b->drive == SCENE_ARTERY ? s->artery_profile : s->profile[b->drive];
  const int k = (int)fmin(b->ring, SONDE_FLOW_RINGS - 2);
  return b->factor * (profile[k] + (b->ring - k) * (profile[k + 1] - profile[k]));
}

// The blood at places of the last picture's plane and beside it, each in world coordinates; drive
// -1 where none flows (hot).
void scene_find_blood(const sonde_flow_scene *s, const sonde_echo *echo, const sonde_vec3 *drawn,
                      uint32_t count, scene_blood *blood);

// Share of a section's lumen that clot fills.
static inline double scene_solid(const sonde_flow_scene *s, uint32_t vessel, uint32_t i) {
  const sonde_pathology *p = &s->interior->pathology[vessel];
  const bool artery = s->interior->course[vessel].kind == SONDE_VESSEL_ARTERY;
  const double z = s->interior->state[vessel][i].rest_centre_m.z;
  const bool all = !(p->thrombus_to_m > p->thrombus_from_m);
  return !artery && (all || (z >= p->thrombus_from_m && z <= p->thrombus_to_m))
             ? p->thrombus_fraction
             : 0;
}

// Share that is left of a section's lumen, 0 where its walls touch.
static inline double scene_open(const sonde_flow_scene *s, uint32_t vessel, uint32_t i) {
  return s->interior->state[vessel][i].area_ratio < sonde_least_lumen
             ? 0
             : 1 - scene_solid(s, vessel, i);
}

// Mean velocity over what is open of a section by what drives it: its segment's flow or the
// arteries' mean velocity.
static inline double scene_gain(const sonde_flow_scene *s, uint32_t vessel, uint32_t i) {
  const sonde_vessel_state *at = &s->interior->state[vessel][i];
  const scene_section *section = &s->section[vessel][i];
  const double area = SONDE_PI * at->half_short_m * at->half_long_m * scene_open(s, vessel, i);
  const double rest = SONDE_PI * at->rest_radius_m * at->rest_radius_m;
  if (!(area > 0)) return 0;
  if (s->interior->course[vessel].kind == SONDE_VESSEL_ARTERY) return rest / area;
  if (section->vein == SCENE_WHOLE) return section->share / area;
  if (section->vein == SCENE_OTHER) return s->main_per_m2[section->segment] * rest / area;
  return section->share * s->part[section->segment][section->vein] / area;
}

#endif
