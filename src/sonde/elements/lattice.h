// A body-centred lattice, graded by an octree: the background of the tetrahedral meshes.
#ifndef SONDE_SRC_LATTICE_H
#define SONDE_SRC_LATTICE_H

#include "elements/index_map.h"
#include "base/maths.h"

enum { SONDE_LATTICE_CELLS = 4000000 }; // more are refused

// A cube of the octree. Lengths and places are in units of half the smallest cube, so that the
// centres of the smallest have whole places too.
typedef struct sonde_cell {
  uint32_t x, y, z; // lowest corner
  uint32_t side;
  uint32_t child; // first of eight; 0: a leaf
} sonde_cell;

typedef struct sonde_lattice {
  sonde_vec3 origin;
  double unit_m;
  uint32_t side; // of the root
  uint32_t cell_count, cell_room;
  sonde_cell *cell;
  uint32_t point_count, point_room;
  uint64_t *point; // [point_count] places, packed
  uint32_t count, room;
  uint32_t (*corner)[4]; // [count] positively oriented
} sonde_lattice;

static inline sonde_vec3 sonde_lattice_at(const sonde_lattice *l, double x, double y, double z) {
  return v_add(l->origin, vec3(x * l->unit_m, y * l->unit_m, z * l->unit_m));
}

// Place of a point.
static inline sonde_vec3 sonde_lattice_point(const sonde_lattice *l, uint32_t point) {
  uint64_t key = l->point[point];
  return sonde_lattice_at(l, (double)(key >> 42), (double)(key >> 21 & 0x1fffff),
                          (double)(key & 0x1fffff));
}

// Cells of the box low..high are split while wanted(centre, side) says so, and until cells that
// share as much as a corner differ by at most a factor of two; tetrahedra between the centres and
// corners follow. A cube as long as `smallest_m` is never split. Clear after a failure, too.
// @return ARGUMENT for too many cells
sonde_status sonde_lattice_create(sonde_vec3 low, sonde_vec3 high, double smallest_m,
                                  bool (*wanted)(const void *user, sonde_vec3 centre,
                                                 double side_m),
                                  const void *user, sonde_lattice *lattice, sonde_error *error);
void sonde_lattice_clear(sonde_lattice *lattice);

#endif
