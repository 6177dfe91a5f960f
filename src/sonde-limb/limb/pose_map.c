// The map from rest to a position and back (docs/limb_pose.md): turns at hip and knee whose share
// depends on direction from the joint and on the nearness of bones, then the squeeze of the bed.
#include "limb/pose.h"

// Share of a turn at a direction `angle` from the proximal side: 0 to 1 between two angles, with
// parabolas over a fifth at either end. *slope: derivative.
static double ramp(double angle, double from, double to, double *slope) {
  const double end = 0.2, steep = 1 / (1 - end);
  double u = (angle - from) / (to - from);
  *slope = 0;
  if (u <= 0) return 0;
  if (u >= 1) return 1;
  double scaled = steep / (to - from);
  if (u < end) {
    *slope = scaled * u / end;
    return steep * u * u / (2 * end);
  }
  if (u > 1 - end) {
    *slope = scaled * (1 - u) / end;
    return 1 - steep * (1 - u) * (1 - u) / (2 * end);
  }
  *slope = scaled;
  return steep * (u - end / 2);
}

// Distance to a bone, exact below 30 mm and more than that beyond.
static double to_bone(const sonde_limb_pose *pose, uint32_t bone, sonde_vec3 p) {
  const struct limb_bones *b = pose->limb->bones;
  double gap = fmax(b->low[bone] - p.z, p.z - b->high[bone]);
  return gap > 0.03 ? gap : limb_one_bone(b, bone, p);
}

static sonde_vec3 turn_about(sonde_vec3 axis, double angle, sonde_vec3 v) {
  double c = cos(angle), s = sin(angle);
  return v_madd(v_madd(v_scale(v, c), s, v_cross(axis, v)), (1 - c) * v_dot(axis, v), axis);
}

// Bend of the knee: points move on circles about the axis through the condyles. A sector that the
// bend narrows grows outward and sideways by as much.
static sonde_vec3 bend_knee(const sonde_limb_pose *pose, sonde_vec3 p) {
  const double from = 25 * SONDE_PI / 180, to = 155 * SONDE_PI / 180, sideways = 0.4, far = 0.17;
  sonde_vec3 v = v_sub(p, pose->knee);
  double slope, share = ramp(atan2(fabs(v.y), v.z), from, to, &slope), free = 1;
  // Bones keep their form: share 0 on the femur, 1 on tibia and fibula, 0.65 on the patella.
  if (v_norm2(v) < far * far) {
    const double patella = 0.65;
    double femur = to_bone(pose, SONDE_LIMB_FEMUR, p), cap = to_bone(pose, SONDE_LIMB_PATELLA, p),
           tibia = fmin(to_bone(pose, SONDE_LIMB_TIBIA, p), to_bone(pose, SONDE_LIMB_FIBULA, p));
    double f = smooth_step(femur / 0.008), k = smooth_step(cap / 0.01),
           t = smooth_step(tibia / 0.02);
    double of_tibia = (share + 1 - t) * f * k, of_femur = (2 - share - f) * t * k,
           of_patella = (1 - k) * f * t, sum = of_tibia + of_femur + of_patella;
    if (sum > 0) share = (of_tibia + patella * of_patella) / sum;
    free = smooth_step(fmin(femur, fmin(cap, tibia)) / 0.02);
  } else if (share <= 0) {
    return p;
  }
  // A sector in front is stretched, one behind is narrowed, by this factor.
  double sector = 1 + (v.y > 0 ? 1 : -1) * pose->knee_angle * slope;
  double grow = 1 + free * (pow(sector, -0.5 * (1 - sideways)) - 1),
         wide = 1 + free * (pow(sector, -sideways) - 1);
  sonde_vec3 c = limb_centre(pose->limb, clamp(limb_level(pose->limb, p.z), LIMB_TOP, 2));
  v = vec3(c.x - pose->knee.x + wide * (p.x - c.x), grow * v.y, grow * v.z);
  v = turn_about(vec3(1, 0, 0), -share * pose->knee_angle, v);
  sonde_vec3 down = vec3(0, -sin(pose->knee_angle), -cos(pose->knee_angle));
  return v_add(pose->knee, v_madd(v, share * pose->roll, down));
}

sonde_vec3 limb_pose_joints(const sonde_limb_pose *pose, sonde_vec3 p) {
  sonde_vec3 bent = pose->knee_angle > 0 ? bend_knee(pose, p) : p;
  if (!(pose->hip_angle > 0)) return bent;
  // The hip turns about its centre, by a share that depends on the place at rest.
  const double from = 50 * SONDE_PI / 180, to = 145 * SONDE_PI / 180, far = 0.16;
  double tilt = 30 * SONDE_PI / 180;
  sonde_vec3 pole =
      vec3(sin(tilt), 0, cos(tilt)); // from the femur's side of the joint to the pelvis
  double toward = v_dot(p, pole), slope;
  sonde_vec3 aside = v_madd(p, -toward, pole);
  double across = v_norm(aside), r = v_norm(p);
  double share = ramp(atan2(across, toward), from, to, &slope), free = 1;
  // Down the thigh the turn is whole, on its medial side too, where the cone would go on to the
  // knee.
  const double down = 0.24, whole = 0.4;
  double near = smooth_step((whole - r) / (whole - down));
  share = 1 - near * (1 - share), slope *= near;
  if (r < far) {
    double pelvis = to_bone(pose, SONDE_LIMB_PELVIS, p), femur = to_bone(pose, SONDE_LIMB_FEMUR, p);
    double h = smooth_step(pelvis / 0.008), f = smooth_step(femur / 0.008);
    double of_femur = (share + 1 - f) * h, of_pelvis = (2 - share - h) * f;
    if (of_femur + of_pelvis > 0) share = of_femur / (of_femur + of_pelvis);
    free = smooth_step(fmin(pelvis, femur) / 0.006);
  }
  if (share <= 0) return bent;
  if (slope > 0 && across > 1e-9) {
    // Solid angle that the turn leaves to a direction, against that at rest.
    sonde_vec3 d = v_scale(p, 1 / r);
    sonde_vec3 meridian =
        v_sub(v_scale(aside, toward / (across * r)), v_scale(pole, across / r)); // off the pole
    double sector = 1 + pose->hip_angle * slope * v_dot(v_cross(pose->hip_axis, d), meridian);
    double grow = 1 + free * (cbrt(1 / fmax(sector, 0.05)) - 1);
    bent = v_scale(bent, grow);
  }
  return turn_about(pose->hip_axis, share * pose->hip_angle, bent);
}

// ---- the bed ------------------------------------------------------------------------------------

typedef struct bed_place {
  double low, deep, middle, lost; // lost: share of height that the lowest layer loses
} bed_place;

static bed_place bed_at(const sonde_limb_pose *pose, double along) {
  double at = clamp((along - pose->first) / LIMB_BED_STEP, 0, LIMB_BED_ROWS - 1.000001);
  uint32_t k = (uint32_t)at;
  // Cubic between rows, flat at rows: the slope is continuous.
  double u = at - k;
  u = smooth_step(u);
  return (bed_place){pose->low[k] + u * (pose->low[k + 1] - pose->low[k]),
                     pose->deep[k] + u * (pose->deep[k + 1] - pose->deep[k]),
                     pose->middle[k] + u * (pose->middle[k + 1] - pose->middle[k]),
                     (1 - LIMB_SQUEEZED) *
                         (pose->lies[k] + u * (pose->lies[k + 1] - pose->lies[k]))};
}

double limb_pose_bed_height(const sonde_limb_pose *pose, sonde_vec3 posed) {
  double t = v_dot(posed, pose->along);
  bed_place b = bed_at(pose, t);
  double at = clamp((t - pose->first) / LIMB_BED_STEP, 0, LIMB_BED_ROWS - 1);
  // Beside the limb there is no cushion under it: the bed is as low as where it is lowest.
  double aside = v_dot(posed, pose->across) - pose->centre[(int)at];
  if (fabs(aside) > pose->half[(int)at]) return pose->plane;
  return b.low + b.lost * b.deep / 2;
}

sonde_vec3 limb_pose_forward(const sonde_limb_pose *pose, sonde_vec3 rest) {
  sonde_vec3 p = limb_pose_joints(pose, rest);
  if (!pose->bed) return p;
  // Layers are thinner the nearer they are to the bed and wider by as much.
  double t = v_dot(p, pose->along), s = v_dot(p, pose->across), h = v_dot(p, pose->up);
  bed_place b = bed_at(pose, t);
  double depth = h - b.low;
  if (depth >= b.deep || b.lost <= 0 || b.deep <= 0) return p;
  double held = fmax(depth, 0), layer = 1 - b.lost * (1 - held / b.deep);
  double height = b.low + b.lost * b.deep / 2 + held - b.lost * (held - held * held / (2 * b.deep));
  height += (depth - held) * layer;
  return v_madd(v_madd(p, (s - b.middle) * (1 / layer - 1), pose->across), height - h, pose->up);
}

sonde_mat3 limb_pose_gradient(const sonde_limb_pose *pose, sonde_vec3 rest) {
  const double step = 2e-5;
  sonde_vec3 column[3];
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 e = vec3(k == 0, k == 1, k == 2);
    column[k] = v_scale(v_sub(limb_pose_forward(pose, v_madd(rest, step, e)),
                              limb_pose_forward(pose, v_madd(rest, -step, e))),
                        0.5 / step);
  }
  return m_columns(column[0], column[1], column[2]);
}

// Newton's steps with differences from a guess, whose error is `off`; a step that does not help is
// halved. @return the error that is left
static double descend(const sonde_limb_pose *pose, sonde_vec3 q, sonde_vec3 off, double bound,
                      sonde_vec3 *p) {
  double least = v_norm(off);
  for (int pass = 0; pass < 40 && least >= bound; ++pass) {
    const double step = 1e-5, longest = 0.06;
    sonde_vec3 column[3], here = v_sub(q, off), move;
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 aside = v_madd(*p, step, vec3(k == 0, k == 1, k == 2));
      column[k] = v_scale(v_sub(limb_pose_joints(pose, aside), here), 1 / step);
    }
    // Move by the inverse of the map's gradient, or a part of the error where that is singular.
    sonde_vec3 bc = v_cross(column[1], column[2]), ac = v_cross(column[0], off);
    double det = v_dot(column[0], bc), before = least;
    move = fabs(det) > 1e-3
               ? v_scale(vec3(v_dot(off, bc), v_dot(column[2], ac), -v_dot(column[1], ac)), 1 / det)
               : v_scale(off, 0.3);
    double length = v_norm(move), share = length > longest ? longest / length : 1;
    for (int halved = 0; halved < 6; ++halved, share *= 0.5) {
      sonde_vec3 next = v_madd(*p, share, move), left = v_sub(q, limb_pose_joints(pose, next));
      double size = v_norm(left);
      if (size >= least) continue;
      least = size, *p = next, off = left;
      break;
    }
    if (!(least < before)) break;
  }
  return least;
}

double limb_pose_inverse(const sonde_limb_pose *pose, sonde_vec3 posed, sonde_vec3 *rest) {
  const double bound = LIMB_POSE_BOUND;
  static const sonde_limb_bone PARTS[3] = {SONDE_LIMB_FEMUR, SONDE_LIMB_TIBIA, SONDE_LIMB_PELVIS};
  sonde_vec3 q = posed, guess[3], off[3];
  double size[3], least = INFINITY;
  // Undo the bed: e = (1 - lost) d + lost d^2 / (2 deep) is the height above the flattened skin.
  double s = v_dot(q, pose->across), h = v_dot(q, pose->up);
  bed_place b = bed_at(pose, v_dot(q, pose->along));
  if (pose->bed && h - b.low < b.deep && b.lost > 0 && b.deep > 0) {
    double e = h - b.low - b.lost * b.deep / 2, first = 1 - b.lost, depth = e / first;
    if (e > 0) depth = 2 * e / (first + sqrt(first * first + 2 * b.lost * e / b.deep));
    double layer = 1 - b.lost * (1 - fmax(depth, 0) / b.deep);
    q = v_madd(v_madd(q, (s - b.middle) * (layer - 1), pose->across), b.low + depth - h, pose->up);
  }
  // Begin as if the point belonged to thigh, calf or pelvis: the one that is right or nearest, then
  // the others.
  for (int k = 0; k < 3; ++k) {
    guess[k] = pose_apply_inverse(pose->bone[PARTS[k]], q);
    off[k] = v_sub(q, limb_pose_joints(pose, guess[k]));
    size[k] = v_norm(off[k]);
    if (size[k] < bound) {
      *rest = guess[k];
      return size[k];
    }
  }
  for (int pass = 0; pass < 3 && least >= bound; ++pass) {
    int k = size[0] <= size[1] && size[0] <= size[2] ? 0 : size[1] <= size[2] ? 1 : 2;
    double left = descend(pose, q, off[k], bound, &guess[k]);
    if (left < least) least = left, *rest = guess[k];
    size[k] = INFINITY;
  }
  return least;
}
