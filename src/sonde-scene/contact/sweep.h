// Memory of the sweep over the boxes of bodies.
#ifndef SONDE_SRC_CONTACT_SWEEP_H
#define SONDE_SRC_CONTACT_SWEEP_H

#include "contact/tree.h"

struct sonde_sweep {
  uint32_t capacity, count;
  uint32_t *order; // [capacity] boxes by their lower x at the last call
};

#endif
