// Ranges of the numbers of a hand's limits and of the rendering.
#ifndef SONDE_SRC_HAPTICS_RANGES_H
#define SONDE_SRC_HAPTICS_RANGES_H

#include "base/link.h"
#include "sonde/haptics_render.h"

// A member of a definition, a double, and the range in which it has to lie.
typedef struct sonde_range {
  const char *name;
  size_t offset;
  double low, high;
} sonde_range;
// First member out of its range: ARGUMENT with its name. @thread any
sonde_status sonde_ranges_check(const char *what, const void *def, const sonde_range *list,
                                size_t count, sonde_error *error);

// A number outside of its range is replaced by `otherwise`, the default definition's member.
void sonde_limits_clean(sonde_safety_limits *limits);
void sonde_render_def_clean(sonde_render_def *def);
// Refuses what these two would replace: no other force may reach a hand than was asked for. The
// tick of the rendering and the time constant of the heat are not looked at.
// @return ARGUMENT, with the name of the number and its range @thread any
SONDE_LINK sonde_status sonde_hand_check(const sonde_safety_limits *limits,
                                         const sonde_render_def *def, sonde_error *error);

#endif
