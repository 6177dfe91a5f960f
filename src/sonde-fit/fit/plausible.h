// Shared by the examinations of measurements (plausible.c) and of results (plausible_result.c).
#ifndef SONDE_SRC_FIT_PLAUSIBLE_H
#define SONDE_SRC_FIT_PLAUSIBLE_H

#include "base/base.h"
#include "sonde/fit_plausible.h"

// Rows of the table of ranges.
typedef enum sonde_quantity {
  QUANTITY_DEEPEST,    // largest penetration of a table, mm
  QUANTITY_PEAK,       // largest force of a table, N
  QUANTITY_MODULUS,    // apparent Young's modulus at small depth, kPa
  QUANTITY_STIFFENING, // slope at the end of a curve over that at its beginning
  QUANTITY_ZERO,       // depth at which the extrapolated force vanishes, mm
  QUANTITY_ASYMPTOTE,  // x_m over the thickness of the tissue
  QUANTITY_SHARE,      // penetration over the thickness of the body
  QUANTITY_BIAS,       // mean residual of a quarter of the depths over the mean force there
  QUANTITIES
} sonde_quantity;

// The grade of a value; *low and *high receive the range that it should have kept to.
bool sonde_plausible(sonde_quantity quantity, double value, sonde_doubt_grade *grade);
const sonde_plausible_range *sonde_plausible_range_of(sonde_quantity quantity);
// Adds one objection to a row of the measurements (NULL: to the table), or raises the grade of one
// of the same kind and counts its curves. Returns it; NULL when there is no room.
sonde_doubt *sonde_doubt_add(sonde_doubts *doubts, const char *kind, sonde_doubt_grade grade,
                             const sonde_measurements *measurements, const sonde_datum *first);

#endif
