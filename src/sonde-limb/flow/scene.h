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
};

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

// Mean velocity over what is open of a section: the flow over its area now.
static inline double scene_mean(const sonde_flow_scene *s, uint32_t vessel, uint32_t i) {
  const sonde_vessel_state *at = &s->interior->state[vessel][i];
  const scene_section *section = &s->section[vessel][i];
  const double area = SONDE_PI * at->half_short_m * at->half_long_m * scene_open(s, vessel, i);
  const double rest = SONDE_PI * at->rest_radius_m * at->rest_radius_m;
  if (!(area > 0)) return 0;
  if (s->interior->course[vessel].kind == SONDE_VESSEL_ARTERY) return s->artery_m_s * rest / area;
  if (section->vein == SCENE_WHOLE)
    return section->share * s->flow.flow_m3_s[section->segment] / area;
  if (section->vein == SCENE_OTHER)
    return sonde_flow_velocity(&s->flow, section->segment) * rest / area;
  return section->share * sonde_flow_through(&s->flow, section->segment, section->vein) / area;
}

#endif
