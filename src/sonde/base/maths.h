// Small vector maths by value: vec3, mat3, quaternion, pose. All inline, no state.
#ifndef SONDE_SRC_MATHS_H
#define SONDE_SRC_MATHS_H

#include "sonde/base.h"

#include "base/elementary.h"

#define SONDE_PI 3.14159265358979323846

static inline sonde_vec3 vec3(double x, double y, double z) { return (sonde_vec3){x, y, z}; }
static inline sonde_vec3 v_add(sonde_vec3 a, sonde_vec3 b) {
  return vec3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline sonde_vec3 v_sub(sonde_vec3 a, sonde_vec3 b) {
  return vec3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline sonde_vec3 v_scale(sonde_vec3 a, double s) { return vec3(a.x * s, a.y * s, a.z * s); }
static inline sonde_vec3 v_neg(sonde_vec3 a) { return vec3(-a.x, -a.y, -a.z); }
// a + s b
static inline sonde_vec3 v_madd(sonde_vec3 a, double s, sonde_vec3 b) {
  return vec3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z);
}
// Corners of the box around two points; a coordinate of b that is not a number does not count.
static inline sonde_vec3 v_min(sonde_vec3 a, sonde_vec3 b) {
  return vec3(b.x < a.x ? b.x : a.x, b.y < a.y ? b.y : a.y, b.z < a.z ? b.z : a.z);
}
static inline sonde_vec3 v_max(sonde_vec3 a, sonde_vec3 b) {
  return vec3(b.x > a.x ? b.x : a.x, b.y > a.y ? b.y : a.y, b.z > a.z ? b.z : a.z);
}
static inline double v_coordinate(sonde_vec3 p, int axis) {
  return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}
static inline double v_dot(sonde_vec3 a, sonde_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline sonde_vec3 v_cross(sonde_vec3 a, sonde_vec3 b) {
  return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline double v_norm2(sonde_vec3 a) { return v_dot(a, a); }
static inline double v_norm(sonde_vec3 a) { return sqrt(v_dot(a, a)); }
static inline double v_distance(sonde_vec3 a, sonde_vec3 b) { return v_norm(v_sub(a, b)); }
// Index of the nearest of count > 0 points; the first of equals.
static inline uint32_t v_nearest(const sonde_vec3 *points, uint32_t count, sonde_vec3 to) {
  uint32_t nearest = 0;
  double least = INFINITY;
  for (uint32_t i = 0; i < count; ++i) {
    double d2 = v_norm2(v_sub(points[i], to));
    if (d2 < least) least = d2, nearest = i;
  }
  return nearest;
}
static inline sonde_vec3 v_lerp(sonde_vec3 a, sonde_vec3 b, double t) {
  return v_madd(v_scale(a, 1.0 - t), t, b);
}
// Unit vector along a; fallback when a has no direction.
static inline sonde_vec3 v_unit(sonde_vec3 a, sonde_vec3 fallback) {
  double n = v_norm(a);
  return n > 1e-300 ? v_scale(a, 1.0 / n) : fallback;
}
static inline bool v_finite(sonde_vec3 a) {
  return isfinite(a.x) && isfinite(a.y) && isfinite(a.z);
}

static inline sonde_mat3 m_zero(void) { return (sonde_mat3){{{0}}}; }
static inline sonde_mat3 m_diag(double d) {
  return (sonde_mat3){{{d, 0, 0}, {0, d, 0}, {0, 0, d}}};
}
// a a^T scaled by s plus d on the diagonal
static inline sonde_mat3 m_rank1(sonde_vec3 a, double s, double d) {
  return (sonde_mat3){{{s * a.x * a.x + d, s * a.x * a.y, s * a.x * a.z},
                       {s * a.y * a.x, s * a.y * a.y + d, s * a.y * a.z},
                       {s * a.z * a.x, s * a.z * a.y, s * a.z * a.z + d}}};
}
static inline sonde_mat3 m_add(sonde_mat3 a, sonde_mat3 b) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) a.m[i][j] += b.m[i][j];
  return a;
}
static inline sonde_mat3 m_scale(sonde_mat3 a, double s) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) a.m[i][j] *= s;
  return a;
}
static inline sonde_vec3 m_mul_v(sonde_mat3 a, sonde_vec3 v) {
  return vec3(a.m[0][0] * v.x + a.m[0][1] * v.y + a.m[0][2] * v.z,
              a.m[1][0] * v.x + a.m[1][1] * v.y + a.m[1][2] * v.z,
              a.m[2][0] * v.x + a.m[2][1] * v.y + a.m[2][2] * v.z);
}
static inline sonde_mat3 m_transpose(sonde_mat3 a) {
  sonde_mat3 t;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) t.m[i][j] = a.m[j][i];
  return t;
}
static inline sonde_mat3 m_mul(sonde_mat3 a, sonde_mat3 b) {
  sonde_mat3 c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j];
  return c;
}
// Matrix whose columns are a, b, c.
static inline sonde_mat3 m_columns(sonde_vec3 a, sonde_vec3 b, sonde_vec3 c) {
  return (sonde_mat3){{{a.x, b.x, c.x}, {a.y, b.y, c.y}, {a.z, b.z, c.z}}};
}

static inline sonde_vec3 m_column(const sonde_mat3 *a, int k) {
  return vec3(a->m[0][k], a->m[1][k], a->m[2][k]);
}

static inline sonde_quat quat_identity(void) { return (sonde_quat){1, 0, 0, 0}; }
static inline sonde_quat q_mul(sonde_quat a, sonde_quat b) {
  return (sonde_quat){
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
// A turn about axis 0, 1 or 2.
static inline sonde_quat q_about(int axis, double angle_rad) {
  const double c = cos(0.5 * angle_rad), s = sin(0.5 * angle_rad);
  return (sonde_quat){c, axis == 0 ? s : 0, axis == 1 ? s : 0, axis == 2 ? s : 0};
}
static inline sonde_quat q_conj(sonde_quat a) { return (sonde_quat){a.w, -a.x, -a.y, -a.z}; }
static inline sonde_quat q_unit(sonde_quat a) {
  double n = sqrt(a.w * a.w + a.x * a.x + a.y * a.y + a.z * a.z);
  if (!(n > 1e-300)) return quat_identity();
  return (sonde_quat){a.w / n, a.x / n, a.y / n, a.z / n};
}
// The turn that a spin (a vector of rad/s) makes in a time.
static inline sonde_quat q_spun(sonde_vec3 spin, double time_s) {
  double speed = v_norm(spin), half = 0.5 * time_s * speed;
  double scale = half > 1e-8 ? sin(half) / speed : 0.5 * time_s;
  return (sonde_quat){cos(half), scale * spin.x, scale * spin.y, scale * spin.z};
}
// The spin that makes a turn in a time, the shorter way round.
static inline sonde_vec3 q_spin(sonde_quat turn, double time_s) {
  double sign = turn.w < 0 ? -1 : 1;
  sonde_vec3 axis = vec3(sign * turn.x, sign * turn.y, sign * turn.z);
  double angle = 2 * atan2(v_norm(axis), sign * turn.w);
  return v_scale(v_unit(axis, vec3(0, 0, 1)), angle / time_s);
}
static inline sonde_mat3 q_matrix(sonde_quat q) {
  double w = q.w, x = q.x, y = q.y, z = q.z;
  return (sonde_mat3){{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                       {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                       {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}
// Quaternion of a rotation matrix (Shepperd's choice of the largest component).
static inline sonde_quat q_from_matrix(sonde_mat3 r) {
  double t = r.m[0][0] + r.m[1][1] + r.m[2][2];
  sonde_quat q;
  if (t > 0) {
    double s = 2 * sqrt(t + 1);
    q = (sonde_quat){s / 4, (r.m[2][1] - r.m[1][2]) / s, (r.m[0][2] - r.m[2][0]) / s,
                     (r.m[1][0] - r.m[0][1]) / s};
  } else if (r.m[0][0] > r.m[1][1] && r.m[0][0] > r.m[2][2]) {
    double s = 2 * sqrt(1 + r.m[0][0] - r.m[1][1] - r.m[2][2]);
    q = (sonde_quat){(r.m[2][1] - r.m[1][2]) / s, s / 4, (r.m[0][1] + r.m[1][0]) / s,
                     (r.m[0][2] + r.m[2][0]) / s};
  } else if (r.m[1][1] > r.m[2][2]) {
    double s = 2 * sqrt(1 + r.m[1][1] - r.m[0][0] - r.m[2][2]);
    q = (sonde_quat){(r.m[0][2] - r.m[2][0]) / s, (r.m[0][1] + r.m[1][0]) / s, s / 4,
                     (r.m[1][2] + r.m[2][1]) / s};
  } else {
    double s = 2 * sqrt(1 + r.m[2][2] - r.m[0][0] - r.m[1][1]);
    q = (sonde_quat){(r.m[1][0] - r.m[0][1]) / s, (r.m[0][2] + r.m[2][0]) / s,
                     (r.m[1][2] + r.m[2][1]) / s, s / 4};
  }
  return q_unit(q);
}
static inline sonde_vec3 q_rotate(sonde_quat q, sonde_vec3 v) {
  sonde_vec3 u = vec3(q.x, q.y, q.z);
  sonde_vec3 t = v_scale(v_cross(u, v), 2.0);
  return v_add(v_madd(v, q.w, t), v_cross(u, t));
}
static inline sonde_vec3 pose_apply(sonde_pose a_from_b, sonde_vec3 p_b) {
  return v_add(q_rotate(a_from_b.rotation, p_b), a_from_b.position);
}
static inline sonde_vec3 pose_apply_inverse(sonde_pose a_from_b, sonde_vec3 p_a) {
  return q_rotate(q_conj(a_from_b.rotation), v_sub(p_a, a_from_b.position));
}
static inline sonde_pose pose_mul(sonde_pose a_from_b, sonde_pose b_from_c) {
  return (sonde_pose){pose_apply(a_from_b, b_from_c.position),
                      q_mul(a_from_b.rotation, b_from_c.rotation)};
}
static inline sonde_pose pose_inverse(sonde_pose a_from_b) {
  sonde_quat r = q_conj(a_from_b.rotation);
  return (sonde_pose){v_neg(q_rotate(r, a_from_b.position)), r};
}
static inline double clamp(double x, double low, double high) {
  return x < low ? low : (x > high ? high : x);
}
// A wanted number within its range; the one before stands in where none is wanted.
static inline double clamp_wanted(double wanted, double before, double low, double high) {
  return clamp(isfinite(wanted) ? wanted : before, low, high);
}

// Whole nanometres: results of the maths library that differ in the last bit become equal.
static inline double whole_nm(double m) { return nearbyint(m * 1e9) / 1e9; }
static inline sonde_vec3 v_whole_nm(sonde_vec3 p) {
  return vec3(whole_nm(p.x), whole_nm(p.y), whole_nm(p.z));
}
// 0 below 0, 1 above 1, smooth in between.
static inline double smooth_step(double t) {
  t = clamp(t, 0, 1);
  return t * t * (3 - 2 * t);
}
#endif
