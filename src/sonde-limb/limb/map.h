// The limb as the tissue map of a model (sonde/tissue_anatomy.h).
#ifndef SONDE_SRC_LIMB_MAP_H
#define SONDE_SRC_LIMB_MAP_H

#include "limb/frame.h"
#include "sonde/limb_pose.h"

// Cusps of a valve, in the straight right limb's frame.
typedef struct limb_cusps {
  sonde_vec3 root;    // on the vein's centre line
  sonde_vec3 up, out; // unit: towards the heart; across the vein, away from the limb's middle
  double radius_m, length_m;
} limb_cusps;

// The limb of a model and its position; a straight limb has none.
typedef struct limb_held {
  sonde_limb *limb;
  sonde_limb_pose *pose; // of the limb, or NULL
  uint64_t number;       // of all maps of a program, from 1
  limb_cusps *cusps;     // [cusp_count], the map's own
  uint32_t cusp_count;
} limb_held;

// Empties it.
void limb_held_clear(limb_held *held);
// @param[out] map owns limb and pose from then on
sonde_status limb_map_create(const limb_held *held, sonde_tissue_map **map, sonde_error *error);
// What a map (or NULL) answers for; NULL when it is not that of a limb.
const limb_held *limb_map_held(const sonde_tissue_map *map);

#endif
