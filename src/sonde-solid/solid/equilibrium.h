// Inside of a solid with a probe on it.
#ifndef SONDE_SRC_EQUILIBRIUM_H
#define SONDE_SRC_EQUILIBRIUM_H

#include "sparse/multifrontal.h"
#include "touch.h"

struct sonde_equilibrium {
  const sonde_hexes *mesh;
  sonde_equilibrium_def def;
  sonde_touch_shape shape;
  sonde_pose start, pose; // where the skin is at rest; where the state is in equilibrium
  // Unknowns: free nodes, then those of the zone, whose skin may touch.
  uint32_t unknown_count, zone_count;
  uint32_t *unknown;     // [node_count] SONDE_HELD_CORNER: the node is held
  uint32_t (*corner)[8]; // [hexes] unknowns
  uint32_t *zone_node;   // [zone_count]
  uint8_t *imposed;      // [zone_count] the node is moved to `target`
  sonde_vec3 *target;    // [zone_count] displacement
  uint32_t *face;        // [face_count] faces of the zone, then the others
  uint32_t zone_faces;   //
  sonde_symbolic *symbolic;
  sonde_numeric numeric;
  sonde_vec3 *moved, *trial, *kept; // [node_count] displacements: state, of a line search, before
  double *force, *step;             // [3 unknown_count]
  double *schur, *matrix;           // [side * side], side = 3 zone_count
  double *way, *way_trial, *load, *touch, *right, *touch_trial; // [side]
  double shift;  // of the stiffness, over an element's mean diagonal
  bool factored; // the factor is that of the state or of the last step towards it, without shift
};

static inline uint32_t sonde_zone_first(const sonde_equilibrium *e) {
  return e->unknown_count - e->zone_count;
}

// Makes the equilibrium of these nodes: in_zone [node_count]. Nothing is imposed.
sonde_status sonde_equilibrium_make(const sonde_hexes *mesh, const uint8_t *in_zone,
                                    const sonde_equilibrium_def *def,
                                    sonde_equilibrium **equilibrium, sonde_error *error);
// Strain energy and forces [3 unknown_count] at displacements u. @return false: turned inside out
bool sonde_equilibrium_forces(const sonde_equilibrium *e, const sonde_vec3 *u, double *energy_j,
                              double *force);
// Corners of a face of the skin at displacements u.
void sonde_equilibrium_face(const sonde_equilibrium *e, const sonde_vec3 *u, uint32_t face,
                            sonde_vec3 rest[4], sonde_vec3 now[4]);
// Solves at a pose from the state; imposed nodes go to their targets. @return false: none found
bool sonde_equilibrium_solve(sonde_equilibrium *e, sonde_pose pose,
                             sonde_equilibrium_result *result);

#endif
