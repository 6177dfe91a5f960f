// Meshes that are a grid of depth, u and v bent into a shape.
#ifndef SONDE_SRC_SOLID_GRID_H
#define SONDE_SRC_SOLID_GRID_H

#include "sonde/solid.h"

enum { SONDE_LINES_MOST = 200, SONDE_LEVELS_MOST = 60 };

// Ascending places along an axis.
typedef struct sonde_lines {
  uint32_t count;
  double at[SONDE_LINES_MOST];
} sonde_lines;

// Levels through the layers from the base to the skin: 0 base, 1 muscle ends, 2 fat ends, 3 skin.
typedef struct sonde_levels {
  uint32_t count;
  double at[SONDE_LEVELS_MOST];
} sonde_levels;

// Lines from -down to up: even over [-half, half] by about `edge`, then growing. @return ARGUMENT
sonde_status sonde_lines_make(const sonde_hexes_def *def, double half, double down, double up,
                              sonde_lines *lines, sonde_error *error);
// Hexahedra get smaller from the base to the fat.
void sonde_levels_make(uint32_t muscle, uint32_t fat, uint32_t skin, sonde_levels *levels);
// @return ARGUMENT for a def that makes no mesh
sonde_status sonde_hexes_check(const sonde_hexes_def *def, sonde_error *error);

typedef struct sonde_grid_shape {
  const sonde_levels *levels;
  uint32_t u_count, v_count;
  bool around; // the last u meets the first
  sonde_vec3 (*place)(const void *user, double level, uint32_t u, uint32_t v);
  const void *user;
} sonde_grid_shape;

static inline uint32_t sonde_grid_shape_node(const sonde_grid_shape *s, uint32_t level, uint32_t u,
                                             uint32_t v) {
  return (level * s->u_count + u % s->u_count) * s->v_count + v;
}

// @return ARGUMENT for a model that no ring can be made of: without a bone, or cut
sonde_status sonde_hexes_ring_check(const sonde_model *model, sonde_error *error);
// The ring of a leg whose columns an interior has, of which only what does not move is read.
sonde_status sonde_hexes_ring_of(const sonde_interior *interior, const sonde_site *site,
                                 const sonde_hexes_def *def, sonde_hexes *mesh, sonde_error *error);
// Nodes, hexahedra, layers and skin; nothing is held but the base. @return MEMORY, MESH for a
// hexahedron that is folded
sonde_status sonde_hexes_bend(const sonde_grid_shape *shape, sonde_hexes *mesh, sonde_error *error);

#endif
