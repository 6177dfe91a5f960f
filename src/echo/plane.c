// The image plane in rest coordinates: where each point of a coarse grid came from, its layers and
// its place in the vessels' cross-sections. These fields are smooth; the march interpolates them.
//
// sonde_echo_plane  all nodes, each inverted from the guess that the node above it gives
// store_node        fields of one node
// store_vessel      coordinates in a vessel's deformed cross-section
#include "base/base.h"
#include "echo/echo.h"

enum { FIRST_ITERATIONS = 24, ITERATIONS = 4 };

static const double far_away = 50; // in semi-axes

static void store_vessel(const sonde_echo *echo, int which, double s, sonde_vec3 point, float *at,
                         uint32_t node) {
  const uint32_t count = SONDE_PLANE_COLUMNS * SONDE_PLANE_ROWS;
  plane_field first = which == 0 ? PLANE_VEIN_SHORT : PLANE_ARTERY_SHORT;
  plane_field halves = which == 0 ? PLANE_VEIN_HALF_SHORT : PLANE_ARTERY_HALF_SHORT;
  sonde_vessel_state v;
  double across = far_away, along = far_away, half_short = 1e-3, half_long = 1e-3, clot = 0;
  if (sonde_vessel_at(echo->interior, which, s, &v)) {
    sonde_vec3 d = v_sub(point, v.centre_m);
    along = v_dot(d, v.flat_axis) / v.half_short_m;
    across = v_dot(d, v_cross(v.axis, v.flat_axis)) / v.half_long_m;
    half_short = v.half_short_m, half_long = v.half_long_m;
    clot = which == 0 && sonde_pathology_clot(echo->frame.pathology, v.rest_centre_m.z);
  }
  at[first * count + node] = (float)along;
  at[(first + 1) * count + node] = (float)across;
  at[halves * count + node] = (float)half_short;
  at[(halves + 1) * count + node] = (float)half_long;
  if (which == 0) at[PLANE_CLOT * count + node] = (float)clot;
}

static void store_node(sonde_echo *echo, uint32_t node, sonde_vec3 point, double theta_centre) {
  const uint32_t count = SONDE_PLANE_COLUMNS * SONDE_PLANE_ROWS;
  sonde_column_point at;
  bool within = sonde_interior_locate(echo->interior, echo->rest[node], &at);
  double turn = at.theta - theta_centre;
  at.theta -= 2 * SONDE_PI * floor(turn / (2 * SONDE_PI) + 0.5);
  float *p = echo->plane;
  p[PLANE_THETA * count + node] = (float)at.theta;
  p[PLANE_S * count + node] = (float)at.s;
  p[PLANE_DEPTH * count + node] = within ? (float)at.depth_m : -1;
  p[PLANE_FAT * count + node] = (float)at.fat_m;
  p[PLANE_MUSCLE * count + node] = (float)at.muscle_m;
  p[PLANE_R * count + node] = (float)at.r;
  for (int which = 0; which < 2; ++which) store_vessel(echo, which, at.s, point, p, node);
}

void sonde_echo_plane(sonde_echo *echo) {
  SONDE_ASSERT(echo->frame.pathology != NULL && echo->frame.depth_m > 0);
  const frame *f = &echo->frame;
  double dx = f->aperture_m / (SONDE_PLANE_COLUMNS - 1), dz = f->depth_m / (SONDE_PLANE_ROWS - 1);
  sonde_vec3 down = q_rotate(f->probe.rotation, vec3(0, 0, dz));
  sonde_column_point centre;
  (void)sonde_interior_locate(echo->interior, f->probe.position, &centre);
  for (uint32_t j = 0; j < SONDE_PLANE_ROWS; ++j)
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
      uint32_t node = j * SONDE_PLANE_COLUMNS + i;
      sonde_vec3 local = vec3(i * dx - 0.5 * f->aperture_m, 0, j * dz);
      sonde_vec3 point = pose_apply(f->probe, local);
      sonde_vec3 guess = j > 0 ? v_add(echo->rest[node - SONDE_PLANE_COLUMNS], down) : point;
      echo->rest[node] = sonde_interior_invert(echo->interior, point, guess,
                                               j > 0 ? ITERATIONS : FIRST_ITERATIONS, NULL);
      store_node(echo, node, point, centre.theta);
    }
}
