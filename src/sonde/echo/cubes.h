// Cubes of tissue on their way from rest into the grid, some at a time, in single precision:
// lengths at rest are from a corner of the box around the slab (0.1 m resolve 7 nm).
#ifndef SONDE_SRC_ECHO_CUBES_H
#define SONDE_SRC_ECHO_CUBES_H

#include "echo/echo.h"
#include "base/vector_records.h"

enum {
  CUBES_AT_ONCE = 64,
};

// A node of the coarse plane: place at rest, and the columns of plane_node.in.
typedef struct cube_node {
  float_x4 rest, in[3];
} cube_node;

// A vessel's station.
typedef struct cube_station {
  float_x4 rest, shift, axis, flat;
  float_x4 size;   // radius, lead, short and long semi-axis
  float_x4 tissue; // turn, short, shear and long of the gradient across it
  float even;
} cube_station;

// A vessel beside a cube.
typedef struct cube_wall {
  uint32_t vessel, station; // in view; before it
  float share;              // of the way to the next station
  float solid;              // share of the short axis that clot fills, from the far side
  double along_m;           // of the cube's middle, as the stations count
} cube_wall;

typedef struct cube {
  float_x4 rest, at; // middle; its image coordinates without the vessels
  float_x4 axis[3];  // what its edges become: image coordinates
  uint64_t bits;     // that choose its scatterers
  bool close;        // goes in eight pieces
  bool carried;      // by walls: has points among those of `group`
  uint32_t group, walls;
  cube_wall wall[MOST_VESSELS];
} cube;

typedef struct sonde_cubes {
  sonde_vec3 corner;                 // of the box, world
  cube_node node[SONDE_PLANE_NODES]; // of this frame
  float_x4 place, to_place[3];       // flat face: image coordinates to lengths and back
  float_x4 image, to_image[3];       //
  float_x4 unit, pad;                // image coordinates to the grid's
  float_x4 low[MOST_VESSELS], high[MOST_VESSELS];     // cubes beside that box stay whole
  cube_station station[MOST_VESSELS][SONDE_STATIONS]; // of the vessels in view, near the slab
  uint32_t count, groups, walls;
  cube cube[CUBES_AT_ONCE];
  float wall[MOST_VESSELS][WALL_FIELDS][WALL_ROOM];
  float rest[3][CARRY_POINTS], gathered[3][CARRY_POINTS], moved[3][CARRY_POINTS];
} sonde_cubes;

// The box is known, no cube has been added.
void sonde_cubes_begin(sonde_echo *echo);
// @param at image coordinates to within a millimetre
void sonde_cubes_add(sonde_echo *echo, const int32_t cell[3], float_x4 rest, float_x4 at);
// Maps of what is left.
void sonde_cubes_end(sonde_echo *echo);

#endif
