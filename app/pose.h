// Poses of a probe: their axes in the world, steps along them, turns about them.
#ifndef SONDE_APP_POSE_H
#define SONDE_APP_POSE_H

#include "sonde/sonde.h"

#include <assert.h>
#include <math.h>

// Column 0, 1 or 2 of the rotation: across the beam, along the leg, along the beam.
static inline sonde_vec3 pose_axis(sonde_pose p, int axis) {
  assert(axis >= 0 && axis < 3);
  sonde_quat q = p.rotation;
  if (axis == 0)
    return (sonde_vec3){1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y + q.w * q.z),
                        2 * (q.x * q.z - q.w * q.y)};
  if (axis == 1)
    return (sonde_vec3){2 * (q.x * q.y - q.w * q.z), 1 - 2 * (q.x * q.x + q.z * q.z),
                        2 * (q.y * q.z + q.w * q.x)};
  return (sonde_vec3){2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x),
                      1 - 2 * (q.x * q.x + q.y * q.y)};
}

static inline sonde_pose pose_shift(sonde_pose pose, double by_m, sonde_vec3 axis) {
  pose.position.x += by_m * axis.x;
  pose.position.y += by_m * axis.y;
  pose.position.z += by_m * axis.z;
  return pose;
}

// Turned about its own axis 0, 1 or 2.
static inline sonde_pose pose_turn(sonde_pose pose, int axis, double angle_rad) {
  const double c = cos(0.5 * angle_rad);
  const sonde_quat q = pose.rotation;
  double s[3] = {0, 0, 0};
  assert(axis >= 0 && axis < 3);
  s[axis] = sin(0.5 * angle_rad);
  pose.rotation = (sonde_quat){c * q.w - s[0] * q.x - s[1] * q.y - s[2] * q.z,
                               c * q.x + s[0] * q.w + s[2] * q.y - s[1] * q.z,
                               c * q.y + s[1] * q.w - s[2] * q.x + s[0] * q.z,
                               c * q.z + s[2] * q.w + s[1] * q.x - s[0] * q.y};
  return pose;
}

static inline double vec_dot(sonde_vec3 a, sonde_vec3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

#endif
