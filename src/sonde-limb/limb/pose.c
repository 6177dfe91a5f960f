// Putting a limb in a position: joints, the bed under it, a check that nothing folds; its surfaces.
#include "limb/pose.h"

#define DEGREE (SONDE_PI / 180)

static const struct position_row {
  const char *name;
  double flexion, rotation, abduction, knee; // degrees
} POSITIONS[SONDE_LIMB_POSITIONS] = {[SONDE_LIMB_SUPINE_TURNED] = {"supine turned", 6, 30, 15, 20},
                                     [SONDE_LIMB_PRONE_BENT] = {"prone bent", 0, 0, 0, 25},
                                     [SONDE_LIMB_SITTING] = {"sitting", 40, 0, 10, 45},
                                     [SONDE_LIMB_SUPINE] = {"supine", 0, 0, 0, 0},
                                     [SONDE_LIMB_PRONE] = {"prone", 0, 0, 0, 0},
                                     [SONDE_LIMB_STANDING] = {"standing", 0, 0, 0, 0}};

const char *sonde_limb_position_name(sonde_limb_position position) {
  SONDE_ASSERT((unsigned)position < SONDE_LIMB_POSITIONS);
  return POSITIONS[position].name;
}

sonde_limb_setting sonde_limb_setting_usual(sonde_limb_position position) {
  SONDE_ASSERT((unsigned)position < SONDE_LIMB_POSITIONS);
  const struct position_row *row = &POSITIONS[position];
  return (sonde_limb_setting){position, row->flexion * DEGREE, row->rotation * DEGREE,
                              row->abduction * DEGREE, row->knee * DEGREE};
}

static sonde_pose turned(sonde_vec3 axis, double angle) {
  sonde_pose pose = {{0, 0, 0}, quat_identity()};
  pose.rotation.w = cos(angle / 2);
  pose.rotation.x = axis.x * sin(angle / 2), pose.rotation.y = axis.y * sin(angle / 2),
  pose.rotation.z = axis.z * sin(angle / 2);
  return pose;
}

static void set_joints(sonde_limb_pose *pose) {
  const sonde_limb_setting *s = &pose->setting;
  const sonde_limb_body *body = &pose->limb->body;
  // Hip: first the thigh about its own axis, then forward, then outward.
  sonde_pose hip = pose_mul(turned(vec3(0, 1, 0), s->hip_abduction_rad),
                            pose_mul(turned(vec3(1, 0, 0), s->hip_flexion_rad),
                                     turned(vec3(0, 0, 1), s->hip_rotation_rad)));
  sonde_quat q = hip.rotation.w < 0 ? (sonde_quat){-hip.rotation.w, -hip.rotation.x,
                                                   -hip.rotation.y, -hip.rotation.z}
                                    : hip.rotation;
  sonde_vec3 axis = vec3(q.x, q.y, q.z);
  pose->hip_angle = 2 * atan2(v_norm(axis), q.w);
  pose->hip_axis = v_unit(axis, vec3(1, 0, 0));
  // Knee: about the centres of the condyles, ellipses of 31 x 25 mm; the tibia stays as far from
  // their edge as it was.
  double wide = body->epicondylar_m / 0.084, deep = body->condyle_m / 0.064;
  pose->knee = vec3(0, -0.010 * deep, -body->thigh_length_m + 0.0015 + 0.025 * wide);
  pose->knee_angle = s->knee_flexion_rad;
  double high = 0.025 * wide, far = 0.031 * deep;
  pose->roll = fmax(hypot(high * cos(pose->knee_angle), far * sin(pose->knee_angle)) - high, 0);
  for (uint32_t k = 0; k < SONDE_LIMB_BONES; ++k) {
    const double patella = 0.65;
    double share = k == SONDE_LIMB_PATELLA ? patella : k >= SONDE_LIMB_TIBIA ? 1 : 0;
    sonde_pose knee = turned(vec3(1, 0, 0), -share * pose->knee_angle);
    knee.position = v_sub(pose->knee, q_rotate(knee.rotation, pose->knee));
    sonde_vec3 down = vec3(0, -sin(pose->knee_angle), -cos(pose->knee_angle));
    knee.position = v_madd(knee.position, share * pose->roll, down);
    pose->bone[k] = k == SONDE_LIMB_PELVIS ? turned(vec3(1, 0, 0), 0) : pose_mul(hip, knee);
  }
  // Where up is: against the back when prone, in front when supine, along the thigh's front when
  // the trunk leans back; along the body when standing.
  pose->bed = s->position != SONDE_LIMB_STANDING;
  pose->up = vec3(0, 1, 0), pose->along = vec3(0, 0, -1);
  if (s->position == SONDE_LIMB_PRONE || s->position == SONDE_LIMB_PRONE_BENT)
    pose->up = vec3(0, -1, 0);
  if (s->position == SONDE_LIMB_STANDING) pose->up = vec3(0, 0, 1), pose->along = vec3(0, 1, 0);
  if (s->position == SONDE_LIMB_SITTING) {
    pose->up = vec3(0, cos(s->hip_flexion_rad), sin(s->hip_flexion_rad));
    pose->along = vec3(0, sin(s->hip_flexion_rad), -cos(s->hip_flexion_rad));
  }
  pose->across = v_cross(pose->up, pose->along);
}

// Of each row the least of it and its neighbours, then a mean over as many, which is not more than
// the row's own value.
static void smooth_least(const double *value, double *out) {
  enum { BESIDE = 5 };
  double least[LIMB_BED_ROWS];
  for (int r = 0; r < LIMB_BED_ROWS; ++r) {
    least[r] = INFINITY;
    for (int k = r - BESIDE; k <= r + BESIDE; ++k)
      if (k >= 0 && k < LIMB_BED_ROWS) least[r] = fmin(least[r], value[k]);
  }
  // A gap of rows without tissue takes the value of its nearest neighbour.
  for (int r = 1; r < LIMB_BED_ROWS; ++r)
    if (!isfinite(least[r])) least[r] = least[r - 1];
  for (int r = LIMB_BED_ROWS - 2; r >= 0; --r)
    if (!isfinite(least[r])) least[r] = least[r + 1];
  for (int r = 0; r < LIMB_BED_ROWS; ++r) {
    double sum = 0;
    int count = 0;
    for (int k = r - BESIDE; k <= r + BESIDE; ++k)
      if (k >= 0 && k < LIMB_BED_ROWS) sum += least[k], ++count;
    out[r] = sum / count;
  }
}

// Rows of the bed: how low skin and bone come, and the middle of the section.
static sonde_status lay_bed(sonde_limb_pose *pose, sonde_error *error) {
  enum { SIDES = 72 };
  const sonde_limb *limb = pose->limb;
  const double most = 0.083, spare = 0.003; // squeezed depth; left to the bone
  double skin[LIMB_BED_ROWS], bone[LIMB_BED_ROWS], left[LIMB_BED_ROWS], right[LIMB_BED_ROWS];
  double sum[LIMB_BED_ROWS] = {0}, weights[LIMB_BED_ROWS] = {0};
  for (int r = 0; r < LIMB_BED_ROWS; ++r)
    skin[r] = bone[r] = left[r] = INFINITY, right[r] = -INFINITY;
  pose->first = INFINITY;
  double last = -INFINITY;
  for (int pass = 0; pass < 3; ++pass)
    for (double level = LIMB_TOP; level <= 2; level += 0.008)
      for (int k = 0; k < SIDES; ++k) {
        double angle = 2 * SONDE_PI * k / SIDES, r = limb_skin_radius(limb, level, angle);
        sonde_vec3 c = limb_centre(limb, level),
                   q = limb_pose_joints(pose, v_madd(c, r, vec3(sin(angle), cos(angle), 0)));
        double t = v_dot(q, pose->along), s = v_dot(q, pose->across);
        if (pass == 0) {
          pose->first = fmin(pose->first, t), last = fmax(last, t);
          continue;
        }
        int row = (int)((t - pose->first) / LIMB_BED_STEP + 0.5);
        if (row >= LIMB_BED_ROWS) continue;
        double height = v_dot(q, pose->up);
        if (pass == 1) {
          skin[row] = fmin(skin[row], height);
          left[row] = fmin(left[row], s), right[row] = fmax(right[row], s);
          continue;
        }
        // The middle of what would lie on the bed first.
        double w = exp((skin[row] - height) / 0.003);
        sum[row] += w * s, weights[row] += w;
      }
  for (uint32_t b = 0; b < SONDE_LIMB_BONES; ++b) {
    sonde_mesh mesh = {0};
    sonde_status status = sonde_limb_bone_mesh(limb, (sonde_limb_bone)b, 0.006, &mesh, error);
    if (status) return status;
    for (uint32_t i = 0; i < mesh.vertex_count; ++i) {
      sonde_vec3 q = pose_apply(pose->bone[b], limb_side_point(limb, mesh.vertices[i]));
      int row = (int)((v_dot(q, pose->along) - pose->first) / LIMB_BED_STEP + 0.5);
      if (row >= 0 && row < LIMB_BED_ROWS) bone[row] = fmin(bone[row], v_dot(q, pose->up));
    }
    sonde_mesh_clear(&mesh);
  }
  double deepest[LIMB_BED_ROWS], far[LIMB_BED_ROWS], near[LIMB_BED_ROWS];
  smooth_least(skin, pose->low);
  smooth_least(bone, deepest);
  for (int r = 0; r < LIMB_BED_ROWS; ++r) right[r] = -right[r];
  smooth_least(left, near);
  smooth_least(right, far);
  // The bed bears all of the limb but its ends; of a sitting one the upper thigh.
  pose->plane = INFINITY;
  double from = pose->first + 0.02, until = last - 0.03;
  if (pose->setting.position == SONDE_LIMB_SITTING) until = 0.6 * limb->body.thigh_length_m;
  for (int r = 0; r < LIMB_BED_ROWS; ++r) {
    double t = pose->first + r * LIMB_BED_STEP;
    pose->lies[r] = smooth_step(fmin(t - from, until - t) / 0.06);
    pose->deep[r] = clamp(deepest[r] - pose->low[r] - spare, 0, most);
    pose->centre[r] = 0.5 * (near[r] - far[r]), pose->half[r] = 0.5 * (-far[r] - near[r]);
    // A mean over neighbouring rows that have skin.
    double middle = 0, all = 0;
    for (int k = r - 8; k <= r + 8; ++k)
      if (k >= 0 && k < LIMB_BED_ROWS && weights[k] > 0) middle += sum[k] / weights[k], ++all;
    pose->middle[r] = all > 0 ? middle / all : pose->centre[r];
    double flat = pose->low[r] + (1 - LIMB_SQUEEZED) * pose->lies[r] * pose->deep[r] / 2;
    if (pose->lies[r] > 0) pose->plane = fmin(pose->plane, flat);
  }
  return SONDE_OK;
}

sonde_status sonde_limb_pose_create(const sonde_limb *limb, const sonde_limb_setting *setting,
                                    sonde_limb_pose **out, sonde_error *error) {
  SONDE_ASSERT(limb && limb->bones && setting && out);
  *out = NULL;
  if ((unsigned)setting->position >= SONDE_LIMB_POSITIONS)
    return sonde_fail(error, SONDE_ARGUMENT, "position %d is none of the %d", setting->position,
                      SONDE_LIMB_POSITIONS);
  const struct range {
    const char *name;
    double value, low, high; // degrees
  } range[] = {{"hip flexion", setting->hip_flexion_rad / DEGREE, -10, 60},
               {"outward rotation of the hip", setting->hip_rotation_rad / DEGREE, -20, 45},
               {"hip abduction", setting->hip_abduction_rad / DEGREE, -5, 30},
               {"knee flexion", setting->knee_flexion_rad / DEGREE, 0, 75}};
  for (size_t k = 0; k < SONDE_COUNT_OF(range); ++k)
    if (!(range[k].value >= range[k].low - 1e-9 && range[k].value <= range[k].high + 1e-9))
      return sonde_fail(error, SONDE_ARGUMENT, "the %s is %g degrees, expected %g to %g",
                        range[k].name, range[k].value, range[k].low, range[k].high);
  sonde_limb_pose *pose = SONDE_NEW(sonde_limb_pose, 1);
  if (!pose) return sonde_fail_memory(error);
  pose->limb = limb, pose->setting = *setting;
  set_joints(pose);
  sonde_status status = pose->bed ? lay_bed(pose, error) : SONDE_OK;
  // Least determinant of the map over the limb; where it is not well above 0 the tissue folds.
  const double between = 0.015; // tissue that the bones of a joint squeeze is not asked
  double least = INFINITY, at = 0;
  for (double level = LIMB_TOP; level <= 2; level += 0.02)
    for (int k = 0; k < 24; ++k)
      for (int j = 1; j <= 3; ++j) {
        double angle = 2 * SONDE_PI * k / 24;
        double r = j / 3.0 * limb_skin_radius(limb, level, angle);
        sonde_vec3 p = v_madd(limb_centre(limb, level), r, vec3(sin(angle), cos(angle), 0));
        const double xyz[3] = {p.x, p.y, p.z};
        if (limb_bone_distance(limb, xyz, NULL) < between) continue;
        sonde_mat3 g = limb_pose_gradient(pose, p);
        double det = v_dot(m_column(&g, 0), v_cross(m_column(&g, 1), m_column(&g, 2)));
        if (det < least) least = det, at = level;
      }
  if (!status && !(least > 0.02))
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "the tissue would fold at level %.2f in this position (volume changes by "
                        "%.2f, expected above 0): bend hip or knee less",
                        at, least);
  if (status) {
    sonde_free(pose);
    return status;
  }
  *out = pose;
  return SONDE_OK;
}

void sonde_limb_pose_destroy(sonde_limb_pose *pose) { sonde_free(pose); }

sonde_limb_setting sonde_limb_pose_setting(const sonde_limb_pose *pose) {
  SONDE_ASSERT(pose);
  return pose->setting;
}

sonde_status sonde_limb_pose_skin(const sonde_limb_pose *pose, double edge_m, sonde_mesh *mesh,
                                  sonde_error *error) {
  SONDE_ASSERT(pose);
  sonde_status status = sonde_limb_skin(pose->limb, edge_m, mesh, error);
  for (uint32_t i = 0; !status && i < mesh->vertex_count; ++i)
    mesh->vertices[i] = sonde_limb_pose_point(pose, mesh->vertices[i]);
  return status;
}

sonde_status sonde_limb_pose_bone_mesh(const sonde_limb_pose *pose, sonde_limb_bone bone,
                                       double edge_m, sonde_mesh *mesh, sonde_error *error) {
  SONDE_ASSERT(pose);
  sonde_status status = sonde_limb_bone_mesh(pose->limb, bone, edge_m, mesh, error);
  sonde_pose posed_from_rest = sonde_limb_pose_bone(pose, bone);
  for (uint32_t i = 0; !status && i < mesh->vertex_count; ++i)
    mesh->vertices[i] = pose_apply(posed_from_rest, mesh->vertices[i]);
  return status;
}
