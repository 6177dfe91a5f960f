// Smooth fields over the image plane, in line and depth.
#ifndef SONDE_SRC_ECHO_PLANE_H
#define SONDE_SRC_ECHO_PLANE_H

#include <stdint.h>

typedef enum plane_field {
  PLANE_THETA, // radians, unwrapped around the picture's centre
  PLANE_S,
  PLANE_DEPTH,
  PLANE_FAT,
  PLANE_MUSCLE,
  PLANE_ACROSS, // from the leg's axis at rest, m: the distance itself bends too much at the bone
  PLANE_UP,
  PLANE_BONE,  // what a point lies deeper in bone than in the cylinder about the axis, m
  PLANE_LAYERS // vessels follow, then lesions
} plane_field;

// Per vessel in view.
typedef enum vessel_field {
  VESSEL_SHORT, // coordinates in the deformed cross-section over its semi-axes
  VESSEL_LONG,
  VESSEL_HALF_SHORT, // semi-axes, m
  VESSEL_HALF_LONG,
  VESSEL_CLOT, // 1 where a thrombus lies
  VESSEL_FIELDS
} vessel_field;

enum {
  LESION_FIELDS = 3, // coordinates at rest over the semi-axes
  MOST_VESSELS = 16, // in view at once
  MOST_LESIONS = 8,
  MOST_BODIES = 8, // nerves, tendons and nodes in view, of such a model
  BODY_FIELDS = 3, // place in a body over its semi-axes, along a cord in m
  MOST_CELLS = 16, // seeds of muscles' cells in view, of a model with a tissue map
  MOST_FIELDS = PLANE_LAYERS + MOST_VESSELS * VESSEL_FIELDS + MOST_LESIONS * LESION_FIELDS + 1 +
                MOST_CELLS + MOST_BODIES * BODY_FIELDS
};

// What can matter for some lines between two coarse rows: numbers of vessels, of seeds of muscles'
// cells and of bodies in view, ascending.
typedef struct tissue_gate {
  uint8_t vessels, cells, bodies;
  uint8_t vessel[MOST_VESSELS], cell[MOST_CELLS], body[MOST_BODIES];
} tissue_gate;

static inline uint32_t vessel_field_at(uint32_t vessel, vessel_field field) {
  return (uint32_t)PLANE_LAYERS + vessel * VESSEL_FIELDS + (uint32_t)field;
}
static inline uint32_t lesion_field_at(uint32_t vessels, uint32_t lesion, uint32_t axis) {
  return (uint32_t)PLANE_LAYERS + vessels * VESSEL_FIELDS + lesion * LESION_FIELDS + axis;
}
// Of a model with a tissue map: distance to the superficial fascia, m, then |p - seed|^2 - weight
// of each seed, mm^2, then the places in its bodies. Its square terms are the same for all seeds,
// so that differences are linear in p.
static inline uint32_t map_field_at(uint32_t vessels, uint32_t lesions, uint32_t which) {
  return lesion_field_at(vessels, lesions, 0) + which;
}

#endif
