// Inside of a solid with a probe on it.
#ifndef SONDE_SRC_EQUILIBRIUM_H
#define SONDE_SRC_EQUILIBRIUM_H

#include "hex.h"
#include "sparse/multifrontal.h"
#include "touch.h"

struct sonde_equilibrium {
  const sonde_hexes *mesh;
  sonde_equilibrium_def def;
  const sonde_hex_kernels *kernels;
  sonde_touch_shape shape;
  sonde_pose start, pose; // where the skin is at rest; where the state is in equilibrium
  // Unknowns: free nodes, those of the patch, then those of the zone, whose skin may touch. The
  // factor condenses on the patch, which a live solid has, and the zone.
  uint32_t unknown_count, zone_count, patch_count;
  uint32_t *unknown;     // [node_count] SONDE_HELD_CORNER: the node is held
  uint32_t (*corner)[8]; // [hexes] unknowns
  uint32_t *zone_node;   // [zone_count]
  uint8_t *imposed;      // [zone_count] the node is moved to `target`
  sonde_vec3 *target;    // [zone_count] displacement
  uint32_t *face;        // [face_count] faces of the zone, then the others
  uint32_t zone_faces;   //
  sonde_stick *stick;    // [zone_faces * SONDE_TOUCH_POINTS] NULL: without friction
  sonde_symbolic *symbolic;
  sonde_numeric numeric;            // of a solid with a patch, which has its own, only the kernels
  sonde_vec3 *moved, *trial, *kept; // [node_count] displacements: state, of a line search, before
  double *force, *step;             // [3 unknown_count]
  double *schur, *matrix;           // [side * side], side = 3 zone_count
  float *front;                     // [side][stride] of the contact's matrix
  double *way, *way_trial, *load, *touch, *right, *touch_trial; // [side]
  double least_load_n;                                          // that residuals are compared with
  double shift;  // of the stiffness, over an element's mean diagonal
  bool factored; // the factor is that of the state or of the last step towards it, without shift
};

static inline uint32_t sonde_zone_first(const sonde_equilibrium *e) {
  return e->unknown_count - e->zone_count;
}
static inline uint32_t sonde_patch_first(const sonde_equilibrium *e) {
  return sonde_zone_first(e) - e->patch_count;
}

enum { SONDE_IN_ZONE = 1, SONDE_IN_PATCH = 2 };
// @return ARGUMENT naming the value out of range
sonde_status sonde_equilibrium_check(const sonde_equilibrium_def *def, sonde_error *error);
// Makes the equilibrium of these nodes: in_zone [node_count], others 0. Nothing is imposed.
sonde_status sonde_equilibrium_make(const sonde_hexes *mesh, const uint8_t *in_zone,
                                    const sonde_equilibrium_def *def,
                                    sonde_equilibrium **equilibrium, sonde_error *error);
// As sonde_equilibrium_create(), with a patch of the skin's hexahedra within patch_m of the
// footprint; 0: none.
sonde_status sonde_equilibrium_place(const sonde_hexes *mesh, const sonde_probe *probe,
                                     sonde_pose start, const sonde_equilibrium_def *def,
                                     double patch_m, sonde_equilibrium **equilibrium,
                                     sonde_error *error);
// Way of the probe from pose to pose, m: of its origin, and of its surface for turns.
double sonde_equilibrium_way(sonde_pose from, sonde_pose to);
// Adds strain energy and forces [3 unknown_count] of some hexahedra (NULL: the first `count`) at
// displacements u. @return false: turned inside out
bool sonde_equilibrium_add_forces(const sonde_equilibrium *e, const uint32_t *hexes, uint32_t count,
                                  const sonde_vec3 *u, double *energy_j, double *force);
// Stiffness of a hexahedron at displacements u, with `shift` of its mean diagonal added to the
// diagonal and nothing between held coordinates and others.
void sonde_equilibrium_stiffness(const sonde_equilibrium *e, const sonde_vec3 *u, double shift,
                                 uint32_t hex, double (*k)[24]);
// Contact of the zone at displacements u and ways v of its nodes (NULL: none): energy and sums,
// forces f[side] on the nodes; the stiffness is added to `matrix` unless that is NULL, with or
// without what the probe's bending takes away.
sonde_touch sonde_equilibrium_touch(const sonde_equilibrium *e, sonde_pose pose,
                                    const sonde_vec3 *u, const double *v, bool bend, double *f,
                                    double *matrix);
// Ways of the zone's nodes that balance the condensed solid (schur, load) and the contact: e->way.
// A probe that is moving to the pose takes the skin with it first. Returns the number of steps; 0:
// the condensed stiffness is not positive definite.
uint32_t sonde_equilibrium_contact(sonde_equilibrium *e, sonde_pose pose, bool moving);
// Corners of a face of the skin at displacements u.
void sonde_equilibrium_face(const sonde_equilibrium *e, const sonde_vec3 *u, uint32_t face,
                            sonde_vec3 rest[4], sonde_vec3 now[4]);
// The same of face n of the zone, whose nodes have gone v (NULL: none) farther.
void sonde_equilibrium_zone_face(const sonde_equilibrium *e, const sonde_vec3 *u, const double *v,
                                 uint32_t n, sonde_vec3 rest[4], sonde_vec3 now[4]);
// Friction at displacements u and ways v of the zone (NULL: none). Its limits follow the pressure;
// the footholds stay, or a step ends and slip takes them along, or all friction is forgotten.
typedef enum sonde_friction_look_kind {
  SONDE_FRICTION_PRESSURE,
  SONDE_FRICTION_SLIP,
  SONDE_FRICTION_FORGET
} sonde_friction_look_kind;
void sonde_friction_look(sonde_equilibrium *e, sonde_pose pose, const sonde_vec3 *u,
                         const double *v, sonde_friction_look_kind kind);
// The least force (N) that residuals are compared with: below it rounding of the elements' forces
// would be taken for a residual.
double sonde_equilibrium_least_load(const sonde_equilibrium *e);
// Solves at a pose from the state; imposed nodes go to their targets. @return false: none found
bool sonde_equilibrium_solve(sonde_equilibrium *e, sonde_pose pose,
                             sonde_equilibrium_result *result);

#endif
