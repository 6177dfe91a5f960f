// What an engine knows of one batch of nodes or faces: motion and contact, in the precision of
// base/batch.h.
#ifndef SONDE_SRC_BATCH_PARTS_H
#define SONDE_SRC_BATCH_PARTS_H

#include "tissue/deformable.h"
#include "tissue/laws.h"

// Of a batch of batches at rest: boxes of their nodes, longest edges at one of them. Beyond the
// last batch boxes are inside out.
typedef struct sonde_batch_boxes {
  reals low[3], high[3], reach;
} sonde_batch_boxes;

typedef struct sonde_batch {
  reals u[3], v[3]; // at the start of the step: displacement, velocity
  reals ve[3]; // where forces are evaluated, at u + reach ve; starts at v + the last step's change
  reals factor[6]; // of the diagonal blocks D = L E L^T: l21 l31 l32, 1/e1 1/e2 1/e3
  reals x[3], r[3], z[3], w[3], p[3], q[3]; // of the conjugate gradients; D z = r
} sonde_batch;

// What the contact adds to a batch: forces, xx xy xz yy yz zz of the diagonal blocks, which hold
// whole rows, what of these belongs to neighbours, and, row by row, what the corner couplings make
// of the directions.
typedef struct sonde_batch_contact {
  reals force[3], block[6], neighbours[6];
  quad product[SONDE_BATCH];
} sonde_batch_contact;

// A pushed face couples its corners along the slope of the depth. A diagonal block holds the whole
// row; a corner coupling takes back what is too much when two corners part: it acts on their
// difference. A batch at a time; beyond the last they are zero.
typedef struct sonde_corner_couplings {
  wholes row[3];
  reals slope[3], between[3]; // of corners 0 1, 1 2, 2 0
} sonde_corner_couplings;

// The probe, places from its origin.
typedef struct sonde_batch_probe {
  real (*plane)[4]; // [max planes] depth of x: [3] - [0..2].x
  real (*slope)[4]; // of that depth; 1 over its weight, 0 where the plane faces backwards
  uint32_t plane_count;
  real radius, centre[3], inward[3]; // radius > 0: a ball
  real low[3], high[3];              // box
  real origin[3], origin_low[3];     // in the world, and what the precision leaves of it
  real velocity[3], spin[3];
  real stiffness, damping; // N/m^3, N s/m^3
  real gain;               // of a push by velocity, per area
} sonde_batch_probe;

// A batch of faces, or of nodes, of which some points are inside the probe; a node is its own only
// point.
enum { SONDE_FACE_POINTS = 4 };
typedef struct sonde_pushed_batch {
  uint32_t index, inside;                                     // batch; its rows with a point inside
  reals area;                                                 // of a point
  reals push[SONDE_FACE_POINTS], slope[SONDE_FACE_POINTS][3]; // where they are evaluated
} sonde_pushed_batch;

// What the faces of a pushed batch add to their corners; nodes to [0].
typedef struct sonde_push_corners {
  reals share[3], gradient[3][3], force[3][3], block[3][6];
  reals area;                          // of the points inside
  reals between[3], coupling_slope[3]; // of corners 0 1, 1 2, 2 0
  uint32_t coupled, alike;             // rows with a push; whose pushing points show one plane
} sonde_push_corners;

// The same after the solution: pushes at the end of the step by the linear system, and what these
// differ from the pushes that are met there.
typedef struct sonde_advance_corners {
  reals force[3][3], surprise[3][3];
} sonde_advance_corners;

#endif
