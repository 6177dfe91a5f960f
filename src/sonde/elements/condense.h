// The stiffness of an elastic solid seen from some of its nodes, all others in equilibrium without
// load (Bro-Nielsen and Cotin 1996): K* = K_ss - K_si K_ii^-1 K_is, dense, computed beforehand.
// Contact imposes the displacements of the touched nodes; all that is needed then is the block of
// the compliance K*^-1 between these.
#ifndef SONDE_SRC_CONDENSE_H
#define SONDE_SRC_CONDENSE_H

#include "elements/elastic.h"

typedef struct sonde_condensed {
  uint32_t count;     // nodes; side = 3 count below
  uint32_t *node;     // [count] in the mesh
  double *stiffness;  // [side][side] N/m, both triangles
  double *compliance; // [side][side] m/N
} sonde_condensed;

// Seconds that the parts of the preparation took.
typedef struct sonde_condensed_times {
  double analysis_s, factor_s, inverse_s;
} sonde_condensed_times;

// Condenses on the solid's last nodes (its moduli are set) and inverts, `workers` threads at a time
// (0: one per core). times may be NULL. @return ARGUMENT for a solid without last nodes or with
// partly held ones among them; CONVERGENCE @thread owner
SONDE_LINK sonde_status sonde_condensed_create(const sonde_elastic *elastic, uint32_t workers,
                                               sonde_condensed **condensed,
                                               sonde_condensed_times *times, sonde_error *error);
SONDE_LINK void sonde_condensed_destroy(sonde_condensed *condensed);

// Forces f[3 count] that move some nodes (by their place in the list) by u[3 count], all others
// free.
// @return ARGUMENT for nodes that are missing or listed twice; CONVERGENCE @thread any (read only)
SONDE_LINK sonde_status sonde_condensed_forces(const sonde_condensed *condensed,
                                               const uint32_t *places, uint32_t count,
                                               const double *u, double *f, sonde_error *error);

// A rigid plate that moves along `inward`.
typedef struct sonde_plate {
  const uint32_t *places; // nodes of the footprint by their place in the list
  uint32_t count;
  sonde_vec3 inward;   // unit
  const double *gap_m; // [count] the plate's way until it touches each node; NULL: it fits
  bool bonded; // touched nodes follow the plate in all directions; else they slide, and come off it
               // where it would pull
} sonde_plate;

// force_n[depth_count] of the plate along `inward` at each depth; node_force [depth_count][count],
// along `inward`, may be NULL. @return as sonde_condensed_forces() @thread any (read only)
sonde_status sonde_condensed_press(const sonde_condensed *condensed, const sonde_plate *plate,
                                   const double *depth_m, uint32_t depth_count, double *force_n,
                                   double *node_force, sonde_error *error);

#endif
