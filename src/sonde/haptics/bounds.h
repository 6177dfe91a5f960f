// Vectors kept within bounds: shared by the two gates before a hand; hot.
#ifndef SONDE_SRC_HAPTICS_BOUNDS_H
#define SONDE_SRC_HAPTICS_BOUNDS_H

#include "base/maths.h"
#include "sonde/haptics_render.h"

// Vector cut to a norm; *acted becomes true when it was longer.
static inline sonde_vec3 sonde_bound_norm(sonde_vec3 wanted, double limit, bool *acted) {
  double norm = v_norm(wanted);
  if (norm <= limit) return wanted;
  *acted = true;
  // a huge vector whose squared norm overflows still has a direction
  if (!isfinite(norm)) {
    double largest = fmax(fabs(wanted.x), fmax(fabs(wanted.y), fabs(wanted.z)));
    wanted = v_scale(wanted, 1.0 / largest);
    norm = v_norm(wanted);
  }
  return v_scale(wanted, limit / norm);
}

// A step of bounded length towards a target.
static inline sonde_vec3 sonde_bound_step(sonde_vec3 last, sonde_vec3 target, double reach,
                                          bool *acted) {
  sonde_vec3 change = v_sub(target, last);
  double norm = v_norm(change);
  if (norm <= reach) return target;
  *acted = true;
  return v_madd(last, reach / norm, change);
}

// @param count receives the number of rows @thread any
const sonde_device_limits *sonde_device_limits_list(uint32_t *count);

#endif
