// The grid of a leg around the probe: columns from the skin to the femur, fine under the probe and
// growing away from it. It carries the elements of the solid (window.h) and the map that keeps
// tissue from folding (repair.h).
#ifndef SONDE_SRC_GRID_H
#define SONDE_SRC_GRID_H

#include "interior/interior.h"

enum {
  SONDE_WINDOW_THETA = 27, // columns around
  SONDE_WINDOW_S = 19,     // rows along
  SONDE_WINDOW_LEVELS = 8, // skin .. bone
  SONDE_WINDOW_FAT = 2,    // level of the fat/muscle interface
  SONDE_WINDOW_NEAR_T =
      15, // columns and rows whose skin can be touched: first columns, middle rows
  SONDE_WINDOW_NEAR_S = 9,
  SONDE_WINDOW_NEAR_FIRST = (SONDE_WINDOW_S - SONDE_WINDOW_NEAR_S) / 2,
  SONDE_WINDOW_NODES = SONDE_WINDOW_THETA * SONDE_WINDOW_S * SONDE_WINDOW_LEVELS,
  SONDE_GRID_HEXES = SONDE_WINDOW_THETA * (SONDE_WINDOW_S - 1) * (SONDE_WINDOW_LEVELS - 1),
};

// Where a grid is: middle and half extents of the probe's face on the leg (angle, axial position).
typedef struct sonde_footprint {
  double theta, s;
  double half_theta_m, half_s_m;
} sonde_footprint;

typedef struct sonde_grid {
  sonde_footprint footprint;
  double theta[SONDE_WINDOW_THETA +
               1]; // offsets from footprint.theta, ascending; the last is the first
  double s[SONDE_WINDOW_S];
  double centre[SONDE_WINDOW_S][2]; // where the columns of each row start: along e1, e2
  float radius[SONDE_WINDOW_S * SONDE_WINDOW_THETA][SONDE_WINDOW_LEVELS];
  sonde_vec3 node[SONDE_WINDOW_NODES]; // at rest, leg frame: e1, e2, along the axis
  // Of the corners of each element: one over the volume that the three edges there span at rest.
  double per_volume[SONDE_GRID_HEXES][8];
} sonde_grid;

static inline uint32_t sonde_grid_node(uint32_t i, uint32_t j, uint32_t level) {
  return (j * SONDE_WINDOW_THETA + i) * SONDE_WINDOW_LEVELS + level;
}

// Nodes of an element: bits 0, 1 and 2 of a corner's number tell its ends around, along and
// inwards.
static inline void sonde_grid_nodes(uint32_t hex, uint32_t node[8]) {
  uint32_t l = hex % (SONDE_WINDOW_LEVELS - 1);
  uint32_t i = hex / (SONDE_WINDOW_LEVELS - 1) % SONDE_WINDOW_THETA;
  uint32_t j = hex / (SONDE_WINDOW_LEVELS - 1) / SONDE_WINDOW_THETA;
  for (uint32_t k = 0; k < 8; ++k)
    node[k] = sonde_grid_node((i + (k & 1)) % SONDE_WINDOW_THETA, j + (k >> 1 & 1), l + (k >> 2));
}

// Edges of an element along its three axes: around, along the leg, inwards.
typedef struct sonde_grid_edges {
  sonde_vec3 x[2][2], y[2][2], z[2][2]; // by the ends along the other two axes, in the axes' order
} sonde_grid_edges;

static inline void sonde_grid_read_edges(const sonde_vec3 *position, const uint32_t node[8],
                                         sonde_grid_edges *e) {
  for (uint32_t i = 0; i < 2; ++i)
    for (uint32_t j = 0; j < 2; ++j) {
      e->x[i][j] = v_sub(position[node[1 + 2 * i + 4 * j]], position[node[2 * i + 4 * j]]);
      e->y[i][j] = v_sub(position[node[2 + i + 4 * j]], position[node[i + 4 * j]]);
      e->z[i][j] = v_sub(position[node[4 + i + 2 * j]], position[node[i + 2 * j]]);
    }
}

// Where a point lies in a grid: four columns and the level above it.
typedef struct sonde_grid_cell {
  uint32_t i, j, level;
  uint32_t column[4];
  double a, b, t;   // 0..1 around, along, from the level to the next
  double weight[4]; // of the columns
} sonde_grid_cell;

// Columns and rows for a footprint.
void sonde_grid_begin(sonde_grid *grid, const sonde_interior *in, sonde_footprint footprint);
// Footprint of a probe; false when it is far above the skin. *within: not beyond the leg's ends.
bool sonde_grid_footprint(const sonde_interior *in, const sonde_interior_input *input,
                          sonde_footprint *footprint, bool *within);
// The columns around an angle and a row; false beyond the ends.
bool sonde_grid_columns(const sonde_grid *grid, double theta, double s, sonde_grid_cell *cell);
// Faces of elements cut the skin's corners: the outermost element goes on by this share of a layer.
static const double sonde_grid_beyond = -0.15;
// The same with the level; a radius farther outside the skin or in the bone counts as on it.
bool sonde_grid_find(const sonde_grid *grid, double theta, double s, double r,
                     sonde_grid_cell *cell);

#endif
