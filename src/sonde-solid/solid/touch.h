// Contact with a rigid convex probe as one potential: over the skin's faces at rest the integral of
// stiffness/2 depth^2, where depth is the exact distance from the probe's surface to a point in it.
#ifndef SONDE_SRC_TOUCH_H
#define SONDE_SRC_TOUCH_H

#include "base/maths.h"
#include "sonde/solid.h"

// A convex core and a rounding around it.
typedef struct sonde_touch_shape {
  const sonde_probe *probe;
  sonde_surface_index *hull; // of the core; NULL where no distance outside it is asked for
  double rounding_m;
} sonde_touch_shape;

// How deep a point of the probe's frame lies in it, negative up to margin_m outside of it; @return
// false: not at all, and farther than the margin.
// @param out unit, the way out; bend the change of `out` with the point (1/m)
bool sonde_touch_depth(const sonde_touch_shape *shape, sonde_vec3 point, double margin_m,
                       double *depth_m, sonde_vec3 *out, sonde_mat3 *bend);

enum { SONDE_TOUCH_POINTS = 9 };
// Shares of a face's corners in one of its points, and the area at rest that it stands for (m^2).
double sonde_touch_point(const sonde_vec3 rest[4], int point, double shape[4]);

// Coulomb's friction at a point, in the probe's frame. The skin sticks elastically to a foothold,
// as stiffly as it is held off the probe, and slips where that would take more than the limit. With
// the limit and the way out held, it has a potential of the point's place.
typedef struct sonde_stick {
  sonde_vec3 foothold, out; // out: unit, the way out of the probe there
  double limit_pa;          // coefficient of friction times pressure; 0: the point does not touch
} sonde_stick;

// How far a point of the probe's frame has been pulled from its foothold along the surface.
static inline sonde_vec3 sonde_stick_pull(const sonde_stick *stick, sonde_vec3 point) {
  const sonde_vec3 way = v_sub(point, stick->foothold);
  return v_madd(way, -v_dot(way, stick->out), stick->out);
}

// Sums of the contact over some faces.
typedef struct sonde_touch {
  double energy_j;  // of the pressure and of friction
  double slipped_j; // of that, what slipping has taken
  double area_m2, deepest_m;
  sonde_vec3 force_n, torque_nm; // on the probe, about its origin
} sonde_touch;

// A face of the skin whose corners have moved from rest to now.
// @param stick [SONDE_TOUCH_POINTS] friction of its points; NULL: none
// @param f[12] receives forces on the corners, when there is contact
// @param k NULL or receives the stiffness, with or without what the probe's bending takes away
// @return whether there is contact
bool sonde_touch_face(const sonde_touch_shape *shape, sonde_pose pose, double stiffness_n_m3,
                      const sonde_stick *stick, const sonde_vec3 rest[4], const sonde_vec3 now[4],
                      bool bend, sonde_touch *sum, double f[12], double (*k)[12]);

#endif
