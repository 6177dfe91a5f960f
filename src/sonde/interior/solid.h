// A linear elastic, nearly incompressible solid of eight-node elements, condensed on some of its
// nodes. Knows nothing of legs: window.h builds one from the columns, the tests build others.
#ifndef SONDE_SRC_SOLID_H
#define SONDE_SRC_SOLID_H

#include "base/maths.h"
#include "sparse/multifrontal.h"

// Corners 0-3 run round the outer face, 4-7 lie below them. A left-handed element counts its
// volume positive.
typedef struct sonde_solid_hex {
  uint32_t node[8];
  double shear_pa, bulk_pa;
  double skin_n_m; // shear modulus times thickness of a membrane on the outer face
} sonde_solid_hex;

typedef struct sonde_solid {
  uint32_t node_count, hex_count, unknown_count, last_count;
  sonde_vec3 *node;
  sonde_solid_hex *hex;
  uint32_t *unknown;     // [node_count] number among the free nodes, SONDE_HELD_CORNER: at rest
  unsigned char *held;   // [node_count] bits 1 2 4: x y z stay zero
  uint32_t (*corner)[8]; // [hex_count] unknowns of the corners
  bool plain;            // full integration of the volume change: locks, for comparison
  sonde_symbolic *symbolic;
  sonde_numeric numeric;
  float *x; // [3*unknown_count] displacements
} sonde_solid;

// Allocates the lists. @thread owner
sonde_status sonde_solid_allocate(sonde_solid *solid, uint32_t nodes, uint32_t hexes,
                                  sonde_error *error);
// Numbers the unknowns: nodes with last[node] come last, resting nodes (held == 7) none; then
// orders and analyses. `points` for the ordering, NULL: the nodes.
sonde_status sonde_solid_connect(sonde_solid *solid, const unsigned char *last,
                                 const sonde_vec3 *points, sonde_error *error);
void sonde_solid_clear(sonde_solid *solid);
// Stiffness of one element, for a sonde_matrix_source over a sonde_solid.
void sonde_solid_matrix(const void *solid, uint32_t hex, double (*k)[24]);
// Starts new numbers of the factor.
void sonde_solid_begin(sonde_solid *solid);
// Factors everything now; false at a pivot that is not positive.
bool sonde_solid_factor(sonde_solid *solid);

sonde_vec3 sonde_solid_moved(const sonde_solid *solid, uint32_t node);
// Stress (Pa, tension positive) in the middle of an element under displacements x (solid->x or
// another solution of the same shape).
sonde_mat3 sonde_solid_stress(const sonde_solid *solid, const float *x, uint32_t hex);
// Change of an element's volume over its volume at rest, exact for the moved corners.
double sonde_solid_dilatation(const sonde_solid *solid, uint32_t hex, double *rest_m3);

#endif
