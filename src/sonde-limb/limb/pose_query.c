// Labels, distances, fibres, vessels and stations of a limb in a position.
#include "limb/pose.h"
#include "limb/vessels_graph.h"

#include "interior/law.h"

#include <string.h>

sonde_vec3 sonde_limb_pose_point(const sonde_limb_pose *pose, sonde_vec3 rest_m) {
  SONDE_ASSERT(pose);
  return limb_side_point(pose->limb, limb_pose_forward(pose, limb_side_point(pose->limb, rest_m)));
}

bool sonde_limb_pose_rest(const sonde_limb_pose *pose, sonde_vec3 posed_m, sonde_vec3 *rest_m) {
  SONDE_ASSERT(pose && rest_m);
  double off = limb_pose_inverse(pose, limb_side_point(pose->limb, posed_m), rest_m);
  *rest_m = limb_side_point(pose->limb, *rest_m);
  return off < LIMB_POSE_BOUND;
}

sonde_pose sonde_limb_pose_bone(const sonde_limb_pose *pose, sonde_limb_bone bone) {
  SONDE_ASSERT(pose && (unsigned)bone < SONDE_LIMB_BONES);
  sonde_pose p = pose->bone[bone];
  if (pose->limb->body.side == SONDE_LIMB_LEFT) // the mirror in x of a turn
    p.position.x = -p.position.x, p.rotation.y = -p.rotation.y, p.rotation.z = -p.rotation.z;
  return p;
}

sonde_vec3 sonde_limb_pose_up(const sonde_limb_pose *pose) {
  SONDE_ASSERT(pose);
  return pose->up;
}

double sonde_limb_pose_bed(const sonde_limb_pose *pose, sonde_vec3 posed_m) {
  SONDE_ASSERT(pose);
  if (!pose->bed) return INFINITY;
  sonde_vec3 q = limb_side_point(pose->limb, posed_m);
  // A sitting limb's bed ends below its thigh.
  if (pose->setting.position == SONDE_LIMB_SITTING &&
      v_dot(q, pose->along) > 0.65 * pose->limb->body.thigh_length_m)
    return INFINITY;
  return v_dot(q, pose->up) - limb_pose_bed_height(pose, q);
}

double sonde_limb_pose_pressure(const sonde_limb_pose *pose, sonde_vec3 posed_m) {
  SONDE_ASSERT(pose);
  const sonde_limb_position position = pose->setting.position;
  return sonde_posture_pressure(
      limb_pose_posture(position), SONDE_VESSEL_VEIN,
      v_dot(v_sub(limb_pose_groin(pose), limb_side_point(pose->limb, posed_m)), pose->up));
}

sonde_posture limb_pose_posture(sonde_limb_position position) {
  return position == SONDE_LIMB_SITTING    ? SONDE_POSTURE_SITTING
         : position == SONDE_LIMB_STANDING ? SONDE_POSTURE_STANDING
                                           : SONDE_POSTURE_SUPINE;
}

sonde_vec3 limb_pose_groin(const sonde_limb_pose *pose) {
  return limb_pose_forward(pose, vec3(0.03 * pose->limb->scale, 0.045, -0.02));
}

// A straight knee narrows the popliteal vein from 7.7 to 4.3 mm; 20 degrees free it.
double limb_pose_knee(const sonde_limb_pose *pose, uint32_t vessel, sonde_vec3 rest) {
  const vessel_branch *branch = &pose->limb->vessels->branch[vessel];
  if (branch->kind != SONDE_LIMB_DEEP_VEIN || !strstr(branch->name, "popliteal vein")) return 1;
  double u = clamp(1 - pose->knee_angle / (20 * DEGREE), 0, 1);
  double beside = clamp((fabs(limb_level(pose->limb, rest.z) - 0.97) - 0.1) / 0.08, 0, 1);
  return 1 - (1 - 4.3 / 7.7) * u * u * (3 - 2 * u) * (1 - beside * beside * (3 - 2 * beside));
}

double limb_pose_filling(const sonde_limb_pose *pose, uint32_t vessel, sonde_vec3 rest) {
  const sonde_limb_vessel_kind kind = pose->limb->vessels->branch[vessel].kind;
  if (kind == SONDE_LIMB_ARTERY) return 1;
  double level = limb_level(pose->limb, rest.z);
  // Area by pressure above that of lying: the slope of each kind, less as the wall gets taut.
  const double deep[][2] = {{0, 0.031}, {0.75, 0.031}, {1, 0.024}, {1.2, 0.015}, {2, 0.015}};
  double slope = 0.015;
  if (kind == SONDE_LIMB_SUPERFICIAL_VEIN || kind == SONDE_LIMB_PERFORATOR) slope = 0.012;
  if (kind == SONDE_LIMB_DEEP_VEIN) {
    uint32_t k = 0;
    while (k + 2 < SONDE_COUNT_OF(deep) && deep[k + 1][0] < level) ++k;
    double u = clamp((level - deep[k][0]) / (deep[k + 1][0] - deep[k][0]), 0, 1);
    slope = deep[k][1] + u * (deep[k + 1][1] - deep[k][1]);
  }
  const double most = 1.2;
  sonde_vec3 posed = limb_side_point(pose->limb, limb_pose_forward(pose, rest));
  double above =
      (sonde_limb_pose_pressure(pose, posed) - 10 * SONDE_PA_PER_MMHG) / SONDE_PA_PER_MMHG;
  double area = above >= 0 ? 1 + most * (1 - exp(-slope * above / most)) : exp(slope * above);
  return sqrt(area) * limb_pose_knee(pose, vessel, rest);
}

sonde_limb_label sonde_limb_pose_at(const sonde_limb_pose *pose, sonde_vec3 posed_m) {
  SONDE_ASSERT(pose && pose->limb->muscles);
  const sonde_limb *limb = pose->limb;
  sonde_vec3 rest;
  const double gap = 0.005; // where a joint closes on tissue, that which is nearest
  if (limb_pose_inverse(pose, limb_side_point(limb, posed_m), &rest) > gap)
    return (sonde_limb_label){SONDE_LIMB_OUTSIDE, 0, limb->body.side};
  const double right[3] = {rest.x, rest.y, rest.z};
  rest = limb_side_point(limb, rest);
  sonde_limb_label label = sonde_limb_at(limb, rest);
  if (!limb->vessels || label.tissue <= SONDE_LIMB_SKIN || label.tissue == SONDE_LIMB_BONE ||
      label.tissue == SONDE_LIMB_NERVE || label.tissue == SONDE_LIMB_NODE ||
      limb_vessels_clear(limb->vessels, right))
    return label;
  sonde_limb_vessel_near near = sonde_limb_vessel_at(limb, rest);
  const vessel_branch *branch = &limb->vessels->branch[near.vessel];
  if (branch->kind == SONDE_LIMB_ARTERY || near.lumen_m > 0.006) return label;
  sonde_limb_vessel_point place = sonde_limb_vessel_place(limb, near.vessel, near.arc_m);
  double ratio = limb_pose_filling(pose, near.vessel, limb_side_point(limb, place.centre_m));
  double lumen = near.lumen_m - (ratio - 1) * place.radius_m, wall = near.wall_m / ratio;
  if (lumen < wall)
    return (sonde_limb_label){lumen < 0 ? SONDE_LIMB_LUMEN : SONDE_LIMB_WALL, near.vessel,
                              limb->body.side};
  // What an emptier vein leaves is loose fat.
  if ((label.tissue == SONDE_LIMB_LUMEN || label.tissue == SONDE_LIMB_WALL) &&
      label.index == near.vessel)
    label.tissue = SONDE_LIMB_SHEATH, label.index = 0;
  return label;
}

sonde_limb_distances sonde_limb_pose_distance(const sonde_limb_pose *pose, sonde_vec3 posed_m) {
  SONDE_ASSERT(pose);
  const sonde_limb *limb = pose->limb;
  sonde_limb_distances far = {INFINITY, INFINITY, INFINITY, INFINITY};
  sonde_vec3 rest, q = limb_side_point(limb, posed_m);
  // Bones keep their form: theirs is the distance from the point turned back.
  for (uint32_t k = 0; k < SONDE_LIMB_BONES; ++k)
    far.bone = fmin(far.bone, limb_one_bone(limb->bones, k, pose_apply_inverse(pose->bone[k], q)));
  if (limb_pose_inverse(pose, q, &rest) >= LIMB_POSE_BOUND) return far;
  // Of the others the distance at rest over the length of its gradient in the position.
  const double step = 5e-5;
  sonde_mat3 gradient = limb_pose_gradient(pose, rest);
  sonde_vec3 a = m_column(&gradient, 0), b = m_column(&gradient, 1), c = m_column(&gradient, 2);
  double det = v_dot(a, v_cross(b, c));
  sonde_limb_distances d[7];
  for (int k = 0; k < 7; ++k) {
    double sign = k % 2 ? step : -step;
    int axis = (k - 1) / 2;
    sonde_vec3 p = k ? v_madd(rest, sign, vec3(axis == 0, axis == 1, axis == 2)) : rest;
    d[k] = sonde_limb_distance(limb, limb_side_point(limb, p));
  }
#define SCALED(member)                                                                             \
  do {                                                                                             \
    double gx = d[1].member - d[2].member, gy = d[3].member - d[4].member,                         \
           gz = d[5].member - d[6].member;                                                         \
    sonde_vec3 g =                                                                                 \
        v_madd(v_madd(v_scale(v_cross(b, c), gx), gy, v_cross(c, a)), gz, v_cross(a, b));          \
    double at_rest = sqrt(gx * gx + gy * gy + gz * gz), posed = v_norm(g) / det;                   \
    far.member = d[0].member * (at_rest > 0 && posed > 0 ? fmin(at_rest / posed, 2) : 1);          \
  } while (0)
  SCALED(skin);
  SCALED(fascia);
  if (limb->vessels) SCALED(vessel);
#undef SCALED
  return far;
}

bool sonde_limb_pose_fibre(const sonde_limb_pose *pose, sonde_vec3 posed_m, sonde_vec3 *direction) {
  SONDE_ASSERT(pose && direction);
  sonde_vec3 rest;
  if (!sonde_limb_pose_rest(pose, posed_m, &rest) || !sonde_limb_fibre(pose->limb, rest, direction))
    return false;
  sonde_mat3 gradient = limb_pose_gradient(pose, limb_side_point(pose->limb, rest));
  sonde_vec3 turned = m_mul_v(gradient, limb_side_point(pose->limb, *direction));
  *direction = limb_side_point(pose->limb, v_unit(turned, vec3(0, 0, -1)));
  return true;
}

sonde_limb_vessel_point sonde_limb_pose_place(const sonde_limb_pose *pose, uint32_t vessel,
                                              double arc_m) {
  SONDE_ASSERT(pose && pose->limb->vessels && vessel < pose->limb->vessels->branches);
  const sonde_limb *limb = pose->limb;
  sonde_limb_vessel_point p = sonde_limb_vessel_place(limb, vessel, arc_m);
  sonde_vec3 rest = limb_side_point(limb, p.centre_m);
  double ratio = limb_pose_filling(pose, vessel, rest);
  sonde_vec3 along = m_mul_v(limb_pose_gradient(pose, rest), limb_side_point(limb, p.direction));
  p.centre_m = sonde_limb_pose_point(pose, p.centre_m);
  p.direction = limb_side_point(limb, v_unit(along, vec3(0, 0, -1)));
  p.radius_m *= ratio, p.wall_m /= ratio, p.area_m2 *= ratio * ratio;
  return p;
}

double sonde_limb_pose_length(const sonde_limb_pose *pose, uint32_t vessel) {
  SONDE_ASSERT(pose && pose->limb->vessels && vessel < pose->limb->vessels->branches);
  const struct limb_vessels *v = pose->limb->vessels;
  double length = 0;
  for (uint32_t k = 0; k + 1 < v->branch[vessel].count; ++k)
    length += v_distance(limb_pose_forward(pose, limb_branch_point(v, vessel, k)),
                         limb_pose_forward(pose, limb_branch_point(v, vessel, k + 1)));
  return length;
}

bool sonde_limb_pose_reaches(const sonde_limb_pose *pose, sonde_pose probe) {
  SONDE_ASSERT(pose);
  const double touch = 0.008, length = 0.13, step = 0.0075;
  double midline = 0.088 * pose->limb->scale;
  if (pose->limb->body.side == SONDE_LIMB_LEFT) midline = -midline;
  for (double back = step / 2; back < length; back += step)
    for (int u = -4; u <= 4; ++u)
      for (int v = -2; v <= 2; ++v) {
        double wide = fmin(back / 0.03, 1);
        sonde_vec3 p = pose_apply(probe, vec3(u / 4.0 * (0.0225 + 0.0075 * wide),
                                              v / 2.0 * (0.006 + 0.009 * wide), -back));
        if (sonde_limb_pose_bed(pose, p) < 0) return false;
        if (sonde_limb_pose_at(pose, p).tissue != SONDE_LIMB_OUTSIDE &&
            sonde_limb_pose_distance(pose, p).skin < -touch)
          return false;
        sonde_vec3 mirrored = vec3(2 * midline - p.x, p.y, p.z);
        if (sonde_limb_pose_at(pose, mirrored).tissue != SONDE_LIMB_OUTSIDE) return false;
      }
  return true;
}

// Skin on a ray from a point within the limb: place and unit outward normal.
static sonde_vec3 skin_on_ray(const sonde_limb_pose *pose, sonde_vec3 from, sonde_vec3 out,
                              sonde_vec3 *normal) {
  double inside = 0, outside = 0.25;
  for (double r = 0; r < outside; r += 0.003) {
    if (sonde_limb_pose_at(pose, v_madd(from, r, out)).tissue == SONDE_LIMB_OUTSIDE)
      outside = r;
    else
      inside = r;
  }
  while (outside - inside > 1e-6) {
    double middle = 0.5 * (inside + outside);
    if (sonde_limb_pose_at(pose, v_madd(from, middle, out)).tissue == SONDE_LIMB_OUTSIDE)
      outside = middle;
    else
      inside = middle;
  }
  sonde_vec3 skin = v_madd(from, inside, out);
  const double step = 0.0005;
  double slope[3];
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 e = vec3(k == 0, k == 1, k == 2);
    slope[k] = sonde_limb_pose_distance(pose, v_madd(skin, step, e)).skin -
               sonde_limb_pose_distance(pose, v_madd(skin, -step, e)).skin;
  }
  *normal = v_unit(vec3(slope[0], slope[1], slope[2]), out);
  return skin;
}

void sonde_limb_pose_stations(const sonde_limb_pose *pose,
                              sonde_limb_station stations[SONDE_LIMB_STATIONS]) {
  SONDE_ASSERT(pose && stations);
  const sonde_limb *limb = pose->limb;
  sonde_limb_stations(limb, stations);
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k) {
    sonde_limb_station *s = &stations[k];
    sonde_mat3 gradient = limb_pose_gradient(pose, limb_side_point(limb, s->skin_m));
    sonde_vec3 across = q_rotate(s->probe.rotation, vec3(1, 0, 0));
    across = limb_side_point(limb, m_mul_v(gradient, limb_side_point(limb, across)));
    sonde_limb_vessel_point vein = sonde_limb_pose_place(pose, s->vein[0], s->arc_m[0]);
    s->target_m = vein.centre_m;
    // From the station's own side; where there is no room, round the limb by 10 degrees at a time
    // towards the side that lies higher.
    sonde_vec3 out =
        v_unit(v_sub(sonde_limb_pose_point(pose, s->skin_m), vein.centre_m), s->normal);
    sonde_vec3 axis = v_unit(v_cross(out, across), vec3(0, 0, 1));
    double sense = v_dot(v_cross(axis, out), pose->up) > 0 ? 1 : -1;
    sonde_pose first = {{0, 0, 0}, quat_identity()};
    sonde_vec3 first_normal = out;
    for (int turn = 0; turn < 8; ++turn) {
      double angle = sense * turn * 10 * DEGREE;
      sonde_vec3 way = v_add(v_scale(out, cos(angle)), v_scale(v_cross(axis, out), sin(angle)));
      s->skin_m = skin_on_ray(pose, s->target_m, way, &s->normal);
      sonde_vec3 down = v_neg(way), side = v_cross(axis, way);
      side = v_unit(v_dot(side, across) < 0 ? v_neg(side) : side, across);
      s->probe = (sonde_pose){s->skin_m, q_from_matrix(m_columns(side, v_cross(down, side), down))};
      if (sonde_limb_pose_reaches(pose, s->probe)) break;
      if (turn == 0) first = s->probe, first_normal = s->normal;
      if (turn == 7) s->probe = first, s->skin_m = first.position, s->normal = first_normal;
    }
    s->depth_m = fmax(v_distance(s->skin_m, s->target_m) - vein.radius_m, 0.001);
    sonde_limb_force_band(s->depth_m, s->force_n);
    // The band is that of 10 mmHg in the vein; it closes at some 12 mmHg more than it has.
    const double closing = 12 * SONDE_PA_PER_MMHG, lying = 10 * SONDE_PA_PER_MMHG;
    double more = (sonde_limb_pose_pressure(pose, s->target_m) + closing) / (lying + closing);
    for (int i = 0; i < 2; ++i) s->force_n[i] *= more;
  }
}
