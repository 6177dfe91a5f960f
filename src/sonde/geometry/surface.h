// Layout of the surface index, shared by its builder (cold) and its queries (hot).
#ifndef SONDE_SRC_GEOMETRY_SURFACE_H
#define SONDE_SRC_GEOMETRY_SURFACE_H

#include "geometry/internal.h"

enum { SURFACE_LEAF_FACES = 4, SURFACE_STACK = 64 };

// A box of the tree. A leaf has count > 0 faces from `first`; an inner node has its children at
// index + 1 and at `first`.
typedef struct surface_node {
  sonde_vec3 low, high;
  uint32_t first, count;
} surface_node;

struct sonde_surface_index {
  sonde_mesh mesh;
  uint32_t node_count;
  surface_node *nodes;
  uint32_t *order;              // [face_count] faces in leaf order
  sonde_vec3 *vertex_normal;    // [vertex_count] angle-weighted, for the inside test
  sonde_vec3 *face_normal;      // [face_count] unit
  sonde_vec3 (*side_normal)[3]; // [face_count] sum over the faces beside side k -> k+1
};

#endif
