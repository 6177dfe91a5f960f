// Cubes of tissue on their way from rest to the image, in single precision: lengths at rest are
// from a corner of the box around the slab (0.1 m resolve 7 nm).
#ifndef SONDE_SRC_ECHO_CUBES_H
#define SONDE_SRC_ECHO_CUBES_H

#include "base/vector_records.h"
#include "echo/echo.h"

enum { CUBES_AT_ONCE = 64 };

// A node of the coarse plane: place at rest, and the columns of plane_node.in.
typedef struct cube_node {
  float_x4 rest, in[3];
} cube_node;

// A cube that the slab touches.
typedef struct slab_cube {
  float_x4 rest, at; // middle; its image coordinates to within a millimetre
  int32_t number[3]; // along the world's axes
} slab_cube;

// A vessel's section: rest centre, path of the centre, along the vessel, short axis.
typedef struct cube_section {
  float_x4 rest, shift, axis, flat;
  float_x4 size;   // radius, coupling, short and long semi-axis
  float_x4 tissue; // rotation, short, shear and long of the gradient across it
  float smoothing;
} cube_section;

// A vessel beside a cube.
typedef struct cube_wall {
  uint32_t vessel, section; // in view; before it
  float share;              // of the path to the next section
  float solid;              // share of the short axis that clot fills, from the far side
  double along_m;           // of the cube's middle, as the sections are counted
} cube_wall;

// A cube where the tissue's motion takes it.
typedef struct moved_cube {
  float_x4 rest, at; // middle; its image coordinates without the vessels
  float_x4 axis[3];  // what its edges become: image coordinates
  uint64_t bits;     // that choose its scatterers
  bool close;        // to a vessel: goes in eight pieces
  bool by_walls;     // has points among those of `group`, which walls move
  uint32_t group, walls;
  cube_wall wall[MOST_VESSELS];
} moved_cube;

typedef struct sonde_cubes {
  // Which cubes the slab touches.
  sonde_vec3 corner;                 // of the box around the slab, world
  cube_node node[SONDE_PLANE_NODES]; // of this frame
  uint32_t slab_count;
  slab_cube slab[SONDE_MAX_CELLS];
  // Where the tissue's motion takes some of them.
  float_x4 place, to_place[3];                        // flat face: image coordinates to lengths
  float_x4 image, to_image[3];                        // and back
  float_x4 low[MOST_VESSELS], high[MOST_VESSELS];     // cubes beside that box stay whole
  cube_section section[MOST_VESSELS][SONDE_SECTIONS]; // of the vessels in view, near the slab
  uint32_t count, groups, walls;
  moved_cube moved[CUBES_AT_ONCE];
  float wall[MOST_VESSELS][WALL_FIELDS][WALL_ROOM];
  float rest[3][WALL_POINTS], warped[3][WALL_POINTS], place_m[3][WALL_POINTS];
} sonde_cubes;

// The box around the slab, and the plane's nodes from its corner.
void sonde_cubes_begin(sonde_echo *echo);
// All cubes that the slab touches.
void sonde_cubes_find(sonde_echo *echo);
// What the motion of a frame's cubes needs; the box is known.
void sonde_motion_begin(sonde_echo *echo);
// Displaces cubes of the slab from number `first` on, as many as fit; returns the next one's.
uint32_t sonde_motion_displace(sonde_echo *echo, uint32_t first);
// Maps of the displaced cubes' scatterers, which then wait for their bands.
void sonde_maps_make(sonde_echo *echo);

#endif
