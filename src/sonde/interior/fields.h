// The displacement field for many points of one state in single precision: the solid's field as
// sonde_interior_field has it, from a table of the nodes near them.
#ifndef SONDE_SRC_FIELDS_H
#define SONDE_SRC_FIELDS_H

#include "base/vector_records.h"
#include "interior/window.h"

// A column of the window from the skin to the bone.
typedef struct sonde_field_column {
  float_x4 radius[SONDE_WINDOW_LEVELS / 4];
  float_x4 move[SONDE_WINDOW_LEVELS]; // world
} sonde_field_column;

typedef struct sonde_fields {
  const sonde_interior *interior;
  sonde_vec3 corner; // origin of the rest positions
  // Of the leg, rotated so that the window's middle is at angle 0: x, y and position along it =
  // first + columns times the offset from the corner.
  float_x4 first, turned[3];
  double cosine, sine; // of the window's middle
  float theta[SONDE_WINDOW_THETA + 1], per_theta[SONDE_WINDOW_THETA];
  float s[SONDE_WINDOW_S], per_s[SONDE_WINDOW_S];
  uint32_t rows; // a bit per row of the window that is in the table
  sonde_field_column column[SONDE_WINDOW_S * SONDE_WINDOW_THETA];
} sonde_fields;

// For the state of the last update. @thread owner of `fields`
void sonde_fields_begin(sonde_fields *fields, const sonde_interior *interior, sonde_vec3 corner);
// Displacements of points, m: within 0.1 um of sonde_interior_field for points within 0.1 m of the
// corner.
void sonde_fields_at(sonde_fields *fields, uint32_t count, const float_x4 *rest, float_x4 *field);

#endif
