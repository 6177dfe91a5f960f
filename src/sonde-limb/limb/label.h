// Layers of a right limb at a point.
#ifndef SONDE_SRC_LIMB_LABEL_H
#define SONDE_SRC_LIMB_LABEL_H

#include "limb/frame.h"

// Signed distances, m, negative inside: exact to first order at each surface.
typedef struct limb_layers {
  double skin, superficial, fascia;
} limb_layers;
limb_layers limb_layers_at(const sonde_limb *limb, sonde_vec3 p);

#endif
