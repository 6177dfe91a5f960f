// Small motions of poses.
#include "haptics/motion.h"

#include "base/base.h"

static double q_dot(sonde_quat a, sonde_quat b) {
  return a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z;
}

static sonde_quat q_sum(sonde_quat a, double s, sonde_quat b, double t) {
  return (sonde_quat){s * a.w + t * b.w, s * a.x + t * b.x, s * a.y + t * b.y, s * a.z + t * b.z};
}

bool sonde_pose_usable(sonde_pose pose) {
  double n2 = q_dot(pose.rotation, pose.rotation);
  bool near = v_finite(pose.position) && v_norm(pose.position) <= SONDE_POSE_REACH_M;
  return near && isfinite(n2) && n2 > 1e-12;
}

double sonde_quat_angle(sonde_quat a, sonde_quat b) {
  sonde_quat between = q_mul(q_conj(a), b);
  return 2.0 * atan2(v_norm(vec3(between.x, between.y, between.z)), fabs(between.w));
}

// Weights sin((1-t)h)/sin h and sin(th)/sin h, h half the angle; their limit for h -> 0 is 1-t, t.
sonde_quat sonde_quat_slerp(sonde_quat a, sonde_quat b, double t) {
  SONDE_ASSERT(t >= 0.0 && t <= 1.0);
  double sign = q_dot(a, b) < 0.0 ? -1.0 : 1.0;
  double half = 0.5 * sonde_quat_angle(a, b), s = sin(half);
  if (s < 1e-9) return q_unit(q_sum(a, 1.0 - t, b, sign * t));
  return q_unit(q_sum(a, sin((1.0 - t) * half) / s, b, sign * sin(t * half) / s));
}

sonde_pose sonde_pose_blend(sonde_pose a, sonde_pose b, double t) {
  SONDE_ASSERT(t >= 0.0 && t <= 1.0);
  return (sonde_pose){v_madd(a.position, t, v_sub(b.position, a.position)),
                      sonde_quat_slerp(a.rotation, b.rotation, t)};
}

sonde_pose sonde_pose_approach(sonde_pose a, sonde_pose b, double reach_m, double rotation_rad) {
  SONDE_ASSERT(reach_m > 0.0 && rotation_rad > 0.0);
  double distance = v_distance(a.position, b.position);
  double angle = sonde_quat_angle(a.rotation, b.rotation);
  sonde_pose next = b;
  if (distance > reach_m)
    next.position = v_madd(a.position, reach_m / distance, v_sub(b.position, a.position));
  if (angle > rotation_rad)
    next.rotation = sonde_quat_slerp(a.rotation, b.rotation, rotation_rad / angle);
  return next;
}
