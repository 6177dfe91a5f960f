// Patches of tetrahedra that change their volume together.
#ifndef SONDE_SRC_PATCHES_H
#define SONDE_SRC_PATCHES_H

#include "elements/tetrahedra.h"

// How the volume change that lambda resists is averaged: not at all, which locks near a Poisson
// ratio of 0.5; over disjoint patches of about eight tetrahedra; or over those around every node.
typedef enum sonde_dilatation {
  SONDE_DILATATION_PATCH,
  SONDE_DILATATION_NODE,
  SONDE_DILATATION_ELEMENT
} sonde_dilatation;

typedef struct sonde_patches {
  uint32_t count;
  double share;           // of a tetrahedron that counts in each of its patches: 1, or 1/4 by nodes
  uint32_t *start, *list; // tetrahedra of each patch
  uint32_t *of_start, *of; // patches of each tetrahedron
  double *volume;          // [count] m3
} sonde_patches;

// Clear after a failure, too. @thread owner
sonde_status sonde_patches_find(const sonde_tetrahedra *mesh, sonde_dilatation kind,
                                const double *volume, sonde_patches *patches, sonde_error *error);
void sonde_patches_clear(sonde_patches *patches);

#endif
