// Vectors of the fast engine, and its contact: 16 faces or nodes at a time, places from the probe's
// origin.
#ifndef SONDE_SRC_PRESS_H
#define SONDE_SRC_PRESS_H

#include <stdint.h>

enum { SONDE_LANES = 16, SONDE_RECORD = 8, SONDE_QUAD = 4 };

typedef float sonde_lane __attribute__((vector_size(64)));
typedef float sonde_quad __attribute__((vector_size(16)));
typedef int32_t sonde_lane_index __attribute__((vector_size(64)));

// High and low parts of a number. Where gcc 12 makes vectors of it, it takes (double)(float)a for
// a: hence volatile.
static inline void sonde_split(double a, float *high, float *low) {
  volatile float rounded = (float)a;
  *high = rounded;
  *low = (float)(a - (double)*high);
}

// What the contact adds to a slice: forces, xx xy xz yy yz zz of the diagonal blocks, which hold
// whole rows, what of these belongs to neighbours, and, row by row, what ties make of the
// directions.
typedef struct sonde_slice_press {
  sonde_lane force[3], block[6], tied[6];
  sonde_quad carry[SONDE_LANES];
} sonde_slice_press;

// A pressed face couples its corners along the slope of the depth. A diagonal block holds the whole
// row; a tie takes back what is too much when two corners part: it acts on their difference. 16 at
// a time; beyond the last they are zero.
typedef struct sonde_press_ties {
  sonde_lane_index row[3];
  sonde_lane slope[3], tie[3]; // of corners 0 1, 1 2, 2 0
} sonde_press_ties;

// The probe, places from its origin.
typedef struct sonde_lane_probe {
  float (*plane)[4]; // [max planes] depth of x: [3] - [0..2].x
  float (*slope)[4]; // of that depth; 1 over its weight, 0 where the plane faces backwards
  uint32_t plane_count;
  float radius, centre[3], inward[3]; // radius > 0: a ball
  float low[3], high[3];              // box
  float origin[3], origin_low[3];     // in the world, and what single precision leaves of it
  float velocity[3], spin[3];
  float stiffness, damping; // N/m^3, N s/m^3
} sonde_lane_probe;

// 16 faces, or nodes, of which some points are inside the probe; a node is its own only point.
enum { SONDE_FACE_POINTS = 4 };
typedef struct sonde_pressed_slice {
  uint32_t index, inside; // slice; its lanes with a point inside
  sonde_lane area;        // of a point
  sonde_lane push[SONDE_FACE_POINTS], slope[SONDE_FACE_POINTS][3]; // where they are evaluated
} sonde_pressed_slice;

// What the faces of a pressed slice add to their corners; nodes to [0].
typedef struct sonde_press_corners {
  sonde_lane share[3], gradient[3][3], force[3][3], block[3][6];
  sonde_lane area;                 // of the points inside
  sonde_lane tie[3], tie_slope[3]; // of corners 0 1, 1 2, 2 0
  uint32_t tied, alike;            // lanes with a push; whose pushing points show one plane
} sonde_press_corners;

// The same after the solution: pushes at the end of the step by the linear system, and what these
// differ from the pushes that are met there.
typedef struct sonde_meet_corners {
  sonde_lane force[3][3], surprise[3][3];
} sonde_meet_corners;

#endif
