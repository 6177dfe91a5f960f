// The faces of a closed barrel, for the legs that tests and fuzz targets make.
#ifndef SONDE_TESTS_BARREL_MESH_H
#define SONDE_TESTS_BARREL_MESH_H

#include "sonde/geometry.h"

#include <string.h>

// Vertices 0 and 1 are the middles of the lower and the upper end, vertex 2 + i * around + k is
// number k of ring i from below. Writes all 2 * around * rings faces, outward.
// @return number of faces written
static inline uint32_t barrel_mesh_faces(sonde_mesh *mesh, uint32_t rings, uint32_t around) {
  uint32_t face = 0;
  for (uint32_t k = 0; k < around; ++k) {
    uint32_t next = (k + 1) % around, top = 2 + (rings - 1) * around;
    memcpy(mesh->faces[face++], (uint32_t[3]){0, 2 + next, 2 + k}, sizeof mesh->faces[0]);
    memcpy(mesh->faces[face++], (uint32_t[3]){1, top + k, top + next}, sizeof mesh->faces[0]);
    for (uint32_t i = 0; i + 1 < rings; ++i) {
      uint32_t a = 2 + i * around + k, b = 2 + i * around + next, up = around;
      memcpy(mesh->faces[face++], (uint32_t[3]){a, b, b + up}, sizeof mesh->faces[0]);
      memcpy(mesh->faces[face++], (uint32_t[3]){a, b + up, a + up}, sizeof mesh->faces[0]);
    }
  }
  return face;
}

#endif
