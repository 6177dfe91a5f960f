// Bones as implicit solids: smooth unions of ellipsoids, rounded cones and swept sections.
#ifndef SONDE_SRC_LIMB_BONES_H
#define SONDE_SRC_LIMB_BONES_H

#include "limb/frame.h"

enum { LIMB_SOLIDS = 40, LIMB_SWEEPS = 4, LIMB_SWEEP_ROWS = 97 };

typedef enum limb_solid_kind { LIMB_ELLIPSOID, LIMB_CONE, LIMB_SWEEP, LIMB_HOLLOW } limb_solid_kind;

// A part of a bone. LIMB_HOLLOW is an ellipsoid that is taken away from what stands before it.
typedef struct limb_solid {
  limb_solid_kind kind;
  sonde_vec3 a, b;  // ellipsoid: centre, half axes; cone: both ends
  double r0, r1;    // cone: radii at both ends
  uint32_t sweep;   // which sweep
  double low, high; // z range
} limb_solid;

// Sections on a uniform grid of z from `low` to `high`: centre, half axes across and forward, third
// harmonic and its direction's sine and cosine.
typedef struct limb_sweep_row {
  double x, y, half_x, half_y, third;
} limb_sweep_row;
typedef struct limb_sweep {
  double low, high, turn; // turn: direction of an edge of the triangle, from the front to medial
  limb_sweep_row row[LIMB_SWEEP_ROWS];
} limb_sweep;

struct limb_bones {
  uint32_t count, first[SONDE_LIMB_BONES + 1];
  limb_solid solid[LIMB_SOLIDS];
  limb_sweep sweep[LIMB_SWEEPS];
  double low[SONDE_LIMB_BONES], high[SONDE_LIMB_BONES];
  double foot; // z where tibia and fibula are cut
  double top;  // z where the pelvis is cut
};

sonde_status limb_bones_make(sonde_limb *limb, sonde_error *error);
// Signed distance to one bone, m.
double limb_one_bone(const struct limb_bones *bones, uint32_t bone, sonde_vec3 p);
// Axis of the femoral shaft and of the tibia at a level, x and y, from the body alone.
sonde_vec3 limb_shaft_axis(const sonde_limb_body *body, double level);
sonde_vec3 limb_tibia_axis(const sonde_limb_body *body, double level);

#endif
