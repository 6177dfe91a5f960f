// The limb as the tissue map of a model (sonde/tissue_anatomy.h).
#ifndef SONDE_SRC_LIMB_MAP_H
#define SONDE_SRC_LIMB_MAP_H

#include "limb/frame.h"

// @param[out] map owns the limb from then on
sonde_status limb_map_create(sonde_limb *limb, sonde_tissue_map **map, sonde_error *error);
// Whether a map (or NULL) is that of a limb.
bool limb_map_is(const sonde_tissue_map *map);

#endif
