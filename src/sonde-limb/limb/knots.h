// Values between knots in level.
#ifndef SONDE_SRC_LIMB_KNOTS_H
#define SONDE_SRC_LIMB_KNOTS_H

#include "base/base.h"

// Value of a column at x of the C1 cubic through knots[count][columns], whose first column is x,
// ascending. Tangents: the parabola through three neighbours, limited where the knots are monotone
// so that no value leaves the range of its neighbours. Constant beyond the ends.
double limb_through(const double *knots, uint32_t count, uint32_t columns, uint32_t column,
                    double x);

#define KNOTS(table, column, x)                                                                    \
  limb_through(&(table)[0][0], SONDE_COUNT_OF(table), SONDE_COUNT_OF((table)[0]), column, x)

#endif
