// The neighbours of a node in the order in which its faces follow one another.
#ifndef SONDE_SRC_FAN_H
#define SONDE_SRC_FAN_H

#include "sonde/tissue.h"

// Where face[k] is a face, its corners are the node, node[k-1] and node[k]; `last` is the neighbour
// before the first, whose own slot is turn - 1. Room for twice as many as there are faces around
// it.
#define SONDE_NO_FACE UINT32_MAX
typedef struct sonde_fan {
  uint32_t count, last, turn;
  uint32_t *node, *face;
} sonde_fan;
void sonde_fan_find(const sonde_model *model, uint32_t i, sonde_fan *fan);

#endif
