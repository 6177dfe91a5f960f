// The solids of a limb as surfaces, for drawings; inside of view*.c.
#ifndef SONDE_SRC_LIMB_VIEW_H
#define SONDE_SRC_LIMB_VIEW_H

#include "limb/pose.h"

typedef enum view_kind {
  VIEW_SKIN,
  VIEW_MUSCLE,
  VIEW_TENDON,
  VIEW_BONE,
  VIEW_ARTERY,
  VIEW_DEEP_VEIN,
  VIEW_SUPERFICIAL,
  VIEW_NERVE,
  VIEW_KINDS
} view_kind;

typedef struct view_solid {
  view_kind kind;
  const char *name; // NULL: none
  uint8_t colour[3];
  sonde_mesh mesh;
  sonde_vec3 *normal; // [vertices] unit, outward
} view_solid;

enum { VIEW_SOLIDS = 192 };
typedef struct view_scene {
  uint32_t count;
  view_solid solid[VIEW_SOLIDS];
} view_scene;

// Surfaces of a limb, at rest or in a position (NULL: rest), in the limb's own frame.
sonde_status view_scene_make(const sonde_limb *limb, const sonde_limb_pose *pose, view_scene *scene,
                             sonde_error *error);
void view_scene_clear(view_scene *scene);

#endif
