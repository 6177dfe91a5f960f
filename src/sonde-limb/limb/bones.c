// Bones from the body's parameters (docs/limb_theory.md, Bones).
#include "limb/bones.h"

#include "limb/knots.h"

static const double MM = 1e-3;

// The shaft's upper end of the neck's axis: the neck leaves the head's centre lateral, back and
// down.
static sonde_vec3 neck_end(const sonde_limb_body *b) {
  double down = b->offset_m * tan(b->neck_shaft_rad - 0.5 * SONDE_PI);
  return vec3(-b->offset_m * cos(b->anteversion_rad), -b->offset_m * sin(b->anteversion_rad),
              -down);
}

sonde_vec3 limb_shaft_axis(const sonde_limb_body *b, double level) {
  sonde_vec3 from = neck_end(b);
  double z = -b->thigh_length_m * level, from_y = most_of(from.y, -0.012);
  double u = (z - from.z) / (-b->thigh_length_m - from.z), chord = 0.85 * b->thigh_length_m;
  double bow = u > 0 && u < 1 ? 0.5 * u * (1 - u) * chord * chord / b->bow_m : 0;
  double lateral = (1 - u) * from.x, forward = (1 - u) * from_y - 0.004 * u;
  return vec3(lateral, forward + bow, z);
}

sonde_vec3 limb_tibia_axis(const sonde_limb_body *b, double level) {
  const double axis[][3] = {{1, 0, -5},  {1.04, 0, -4}, {1.1, 1, 0},  {1.2, 3, 3},
                            {1.5, 4, 3}, {1.8, 2, 1},   {1.95, 1, 0}, {2, 1, 0}};
  double size = b->plateau_m / 0.0785;
  return vec3(size * MM * KNOTS(axis, 1, level), size * MM * KNOTS(axis, 2, level), 0);
}

typedef struct maker {
  struct limb_bones *bones;
} maker;

static void add(maker *m, limb_solid s) {
  SONDE_ASSERT(m->bones->count < LIMB_SOLIDS && s.low < s.high);
  m->bones->solid[m->bones->count++] = s;
}

static void add_ellipsoid(maker *m, limb_solid_kind kind, sonde_vec3 centre, sonde_vec3 half) {
  SONDE_ASSERT(half.x > 0 && half.y > 0 && half.z > 0);
  add(m, (limb_solid){kind, centre, half, 0, 0, 0, centre.z - half.z, centre.z + half.z});
}

static void add_cone(maker *m, sonde_vec3 from, double r0, sonde_vec3 to, double r1) {
  add(m, (limb_solid){LIMB_CONE, from, to, r0, r1, 0, least_of(from.z - r0, to.z - r1),
                      most_of(from.z + r0, to.z + r1)});
}

static void add_femur(maker *m, const sonde_limb *limb) {
  const sonde_limb_body *b = &limb->body;
  struct limb_bones *bones = m->bones;
  double lt = b->thigh_length_m, head = b->head_m / 0.048, shaft = b->shaft_m / 0.0273;
  double knee = b->epicondylar_m / 0.084, deep = b->condyle_m / 0.064;
  sonde_vec3 j = neck_end(b);
  // Shaft: half axes in mm by level, for a mid-shaft of 27.3 mm.
  const double half[][3] = {{0.05, 17, 19},     {0.1, 20, 20},      {0.15, 18.5, 18.5},
                            {0.2, 15, 15.5},    {0.25, 14, 14},     {0.35, 13.6, 13.8},
                            {0.5, 13.4, 13.9},  {0.65, 15.6, 14.4}, {0.75, 18.4, 15.8},
                            {0.85, 24.5, 17.2}, {0.92, 33, 20},     {0.95, 35, 21}};
  limb_sweep *s = &bones->sweep[0];
  s->high = -0.07 * lt, s->low = -0.945 * lt, s->turn = SONDE_PI;
  for (uint32_t r = 0; r < LIMB_SWEEP_ROWS; ++r) {
    double z = s->low + (s->high - s->low) * r / (LIMB_SWEEP_ROWS - 1), t = -z / lt;
    sonde_vec3 axis = limb_shaft_axis(b, t);
    double wide = t < 0.65 ? shaft : shaft + (knee - shaft) * (t - 0.65) / 0.3;
    double behind = t > 0.8 ? -6 * MM * (t - 0.8) / 0.15 : 0; // the condyles stand behind the shaft
    s->row[r] = (limb_sweep_row){axis.x, axis.y + behind, MM * wide * KNOTS(half, 1, t),
                                 MM * wide * KNOTS(half, 2, t), 0.03};
  }
  add(m, (limb_solid){.kind = LIMB_SWEEP, .sweep = 0, .low = s->low, .high = s->high});
  // Head, neck, trochanters.
  add_ellipsoid(m, LIMB_ELLIPSOID, vec3(0, 0, 0),
                vec3(b->head_m / 2, b->head_m / 2, b->head_m / 2));
  add_cone(m, vec3(0.25 * j.x, 0.25 * j.y, 0.25 * j.z), 14 * MM * head, j, 17 * MM * head);
  double lateral = 1.44 * b->offset_m / 0.043; // most lateral point 63 mm from the head's centre
  add_ellipsoid(m, LIMB_ELLIPSOID, vec3(j.x - 5 * MM * lateral, j.y - 6 * MM, -28 * MM * head),
                vec3(14 * MM * head, 19 * MM * head, 22 * MM * head));
  sonde_vec3 a = limb_shaft_axis(b, 0.145);
  add_ellipsoid(m, LIMB_ELLIPSOID, vec3(a.x + 14 * MM * shaft, a.y - 12 * MM * shaft, a.z),
                vec3(8 * MM * head, 8 * MM * head, 12 * MM * head));
  // Linea aspera: a ridge behind the shaft.
  sonde_vec3 u = limb_shaft_axis(b, 0.24), v = limb_shaft_axis(b, 0.45),
             w = limb_shaft_axis(b, 0.66);
  double back = 12.2 * MM * shaft;
  u.y -= back, v.y -= back, w.y -= back;
  add_cone(m, u, 3.2 * MM, v, 3.6 * MM);
  add_cone(m, v, 3.6 * MM, w, 2.6 * MM);
  // Condyles, trochlea, epicondyles: medial is +x.
  double line = -lt + 1.5 * MM;
  for (int side = -1; side <= 1; side += 2) {
    add_ellipsoid(m, LIMB_ELLIPSOID,
                  vec3(side * 23.5 * MM * knee, -10 * MM * deep, line + 25 * MM * knee),
                  vec3(16.5 * MM * knee, 31 * MM * deep, 25 * MM * knee));
    add_ellipsoid(m, LIMB_ELLIPSOID, vec3(side * 34 * MM * knee, -7 * MM, line + 29 * MM * knee),
                  vec3(8 * MM * knee, 11 * MM, 12 * MM * knee));
  }
  add_ellipsoid(m, LIMB_ELLIPSOID, vec3(-3 * MM, 5 * MM * deep, line + 30 * MM * knee),
                vec3(31 * MM * knee, 18 * MM * deep, 22 * MM * knee));
}

static void add_lower(maker *m, const sonde_limb *limb) {
  const sonde_limb_body *b = &limb->body;
  struct limb_bones *bones = m->bones;
  double lt = b->thigh_length_m, lc = b->calf_length_m, wide = b->plateau_m / 0.0785;
  double shin = b->tibia_m / 0.0225, fibula = b->fibula_m / 0.0125, ankle = b->malleoli_m / 0.075;
  // Patella: before the trochlea, its middle above the joint line.
  double p = b->patella_m / 0.045, deep = b->condyle_m / 0.064;
  double above = (b->sex == SONDE_SEX_FEMALE ? 13 : 20) * MM * p;
  bones->first[SONDE_LIMB_PATELLA] = bones->count;
  add_ellipsoid(m, LIMB_ELLIPSOID,
                vec3(-4 * MM, 23 * MM * deep + 13 * MM * p, -lt + above + 6 * MM),
                vec3(23 * MM * p, 10.5 * MM * p, 22.5 * MM * p));
  // Tibia: half axes in mm and the triangle's third harmonic by level.
  bones->first[SONDE_LIMB_TIBIA] = bones->count;
  const double half[][4] = {
      {0.004, 35, 21.5, 0},     {0.02, 38.5, 24.5, 0},   {0.05, 35, 24, 0},
      {0.09, 27, 22, 0.04},     {0.14, 19.5, 19.5, 0.1}, {0.2, 15.5, 17, 0.15},
      {0.25, 13.8, 15.6, 0.11}, {0.5, 11.2, 12.9, 0.11}, {0.75, 11.6, 11.6, 0.09},
      {0.88, 15, 13.6, 0.05},   {0.95, 20, 17, 0.02},    {1, 23, 18.5, 0}};
  limb_sweep *s = &bones->sweep[1];
  s->high = -lt - 0.004 * lc, s->low = -lt - lc, s->turn = -0.09;
  for (uint32_t r = 0; r < LIMB_SWEEP_ROWS; ++r) {
    double z = s->low + (s->high - s->low) * r / (LIMB_SWEEP_ROWS - 1), t = (-lt - z) / lc;
    sonde_vec3 axis = limb_tibia_axis(b, 1 + t);
    double size = t < 0.2 ? wide + (shin - wide) * t / 0.2 : shin;
    if (t > 0.75) size = shin + (ankle - shin) * (t - 0.75) / 0.25;
    s->row[r] = (limb_sweep_row){axis.x, axis.y, MM * size * KNOTS(half, 1, t),
                                 MM * size * KNOTS(half, 2, t), KNOTS(half, 3, t)};
  }
  add(m, (limb_solid){.kind = LIMB_SWEEP, .sweep = 1, .low = s->low, .high = s->high});
  add_ellipsoid(m, LIMB_ELLIPSOID, vec3(-2 * MM, 17 * MM * wide, -lt - 0.095 * lc),
                vec3(10 * MM, 8 * MM, 14 * MM)); // tuberosity
  double turn = b->torsion_rad - 0.3;            // the ankle's axis turns outward with the torsion
  sonde_vec3 out = vec3(ankle * 28 * MM * cos(turn), ankle * 28 * MM * sin(turn), -lt - lc);
  add_cone(m, vec3(0.72 * out.x, 0.72 * out.y + 2 * MM, -lt - 0.955 * lc), 10 * MM * ankle,
           vec3(0.9 * out.x, 0.9 * out.y + 2 * MM, -lt - lc - 4 * MM), 7 * MM * ankle);
  // Fibula: lateral and behind.
  bones->first[SONDE_LIMB_FIBULA] = bones->count;
  const double axis[][4] = {
      {0.03, -41, -25.2, 10.3},  {0.07, -41, -25.2, 8.8},   {0.11, -37.5, -24, 6.5},
      {0.25, -34, -22.5, 6.2},   {0.5, -31, -20, 6.3},      {0.75, -26.5, -14, 6.2},
      {0.88, -24.5, -11.5, 6.5}, {0.95, -27.5, -12.2, 8.3}, {1, -30, -13, 9.2}};
  s = &bones->sweep[2];
  s->high = -lt - 0.045 * lc, s->low = -lt - lc, s->turn = 1;
  for (uint32_t r = 0; r < LIMB_SWEEP_ROWS; ++r) {
    double z = s->low + (s->high - s->low) * r / (LIMB_SWEEP_ROWS - 1), t = (-lt - z) / lc;
    double size = wide + (ankle - wide) * t, radius = MM * fibula * KNOTS(axis, 3, t);
    s->row[r] = (limb_sweep_row){MM * size * KNOTS(axis, 1, t), MM * size * KNOTS(axis, 2, t),
                                 0.95 * radius, 1.05 * radius, 0.07};
  }
  add(m, (limb_solid){.kind = LIMB_SWEEP, .sweep = 2, .low = s->low, .high = s->high});
  add_ellipsoid(m, LIMB_ELLIPSOID, vec3(-41.5 * MM * wide, -26 * MM * wide, -lt - 0.055 * lc),
                vec3(10 * MM * fibula, 12 * MM * fibula, 13 * MM * fibula));
}

static double sweep_distance(const limb_sweep *s, sonde_vec3 p) {
  double at = clamp((p.z - s->low) / (s->high - s->low), 0, 1) * (LIMB_SWEEP_ROWS - 1);
  uint32_t k = (uint32_t)least_of(at, LIMB_SWEEP_ROWS - 2);
  double u = at - k, v = 1 - u;
  const limb_sweep_row *a = &s->row[k], *b = a + 1;
  double dx = p.x - (v * a->x + u * b->x), dy = p.y - (v * a->y + u * b->y);
  double hx = v * a->half_x + u * b->half_x, hy = v * a->half_y + u * b->half_y;
  double third = v * a->third + u * b->third, r = sqrt(dx * dx + dy * dy);
  if (r > 1e-9 && third > 0) {
    // Radius by cos 3 (angle - turn), angle from the front to medial.
    double c = (dy * cos(s->turn) + dx * sin(s->turn)) / r;
    double factor = 1 + third * c * (4 * c * c - 3);
    hx *= factor, hy *= factor;
  }
  double x = dx / hx, y = dy / hy, k0 = sqrt(x * x + y * y);
  double gx = x / hx, gy = y / hy, k1 = sqrt(gx * gx + gy * gy);
  double across = k1 < 1e-9 ? -least_of(hx, hy) : k0 * (k0 - 1) / k1;
  double along = most_of(s->low - p.z, p.z - s->high);
  if (along > 0 && across > 0) return sqrt(along * along + across * across);
  return most_of(along, across);
}

double limb_one_bone(const struct limb_bones *bones, uint32_t bone, sonde_vec3 p) {
  SONDE_ASSERT(bone < SONDE_LIMB_BONES);
  const double blend = 0.006, reach = 0.03;
  double distance = 0.5;
  for (uint32_t i = bones->first[bone]; i < bones->first[bone + 1]; ++i) {
    const limb_solid *s = &bones->solid[i];
    double gap = most_of(s->low - p.z, p.z - s->high), d;
    if (gap > reach) {
      d = gap;
    } else if (s->kind == LIMB_SWEEP) {
      d = sweep_distance(&bones->sweep[s->sweep], p);
    } else if (s->kind == LIMB_CONE) {
      // To the axis, less the radius at its nearest point.
      sonde_vec3 axis = v_sub(s->b, s->a), from = v_sub(p, s->a);
      double u = clamp(v_dot(from, axis) / v_norm2(axis), 0, 1);
      d = v_distance(from, v_scale(axis, u)) - (s->r0 + u * (s->r1 - s->r0));
    } else {
      // The implicit function over its gradient's length.
      sonde_vec3 from = v_sub(p, s->a);
      sonde_vec3 q = vec3(from.x / s->b.x, from.y / s->b.y, from.z / s->b.z);
      double k0 = v_norm(q), k1 = v_norm(vec3(q.x / s->b.x, q.y / s->b.y, q.z / s->b.z));
      d = k1 < 1e-9 ? -least_of(s->b.x, least_of(s->b.y, s->b.z)) : k0 * (k0 - 1) / k1;
    }
    if (s->kind == LIMB_HOLLOW) {
      double h = most_of(blend - fabs(distance + d), 0) / blend;
      distance = most_of(distance, -d) + 0.25 * h * h * blend;
      continue;
    }
    // Smooth union: a fillet of `blend` where two parts meet; edges of hollows are rounded alike.
    double h = most_of(blend - fabs(distance - d), 0) / blend;
    distance = least_of(distance, d) - 0.25 * h * h * blend;
  }
  if (bone == SONDE_LIMB_PELVIS) return most_of(distance, p.z - bones->top);
  return bone >= SONDE_LIMB_TIBIA ? most_of(distance, bones->foot - p.z) : distance;
}

double limb_bone_distance(const sonde_limb *limb, const double xyz[3], int *which) {
  SONDE_ASSERT(limb && limb->bones && xyz);
  const struct limb_bones *bones = limb->bones;
  sonde_vec3 p = vec3(xyz[0], xyz[1], xyz[2]);
  double least = INFINITY;
  int nearest = 0;
  for (uint32_t k = 0; k < SONDE_LIMB_BONES; ++k) {
    double gap = most_of(bones->low[k] - p.z, p.z - bones->high[k]);
    if (gap >= least) continue;
    double d = gap > 0.03 ? gap : limb_one_bone(bones, k, p);
    if (d < least) least = d, nearest = (int)k;
  }
  if (which) *which = nearest;
  return least;
}

sonde_status limb_bones_make(sonde_limb *limb, sonde_error *error) {
  SONDE_ASSERT(limb && !limb->bones);
  struct limb_bones *bones = limb->bones = SONDE_NEW(struct limb_bones, 1);
  if (!bones) return sonde_fail_memory(error);
  maker m = {bones};
  // The part of the pelvis beside the groin: socket, superior ramus, columns to the ilium and to
  // the ischium, in one piece.
  double k = limb->scale * MM, head = limb->body.head_m / 2;
  double cup = head / 0.024, far = 0.3;
  add_ellipsoid(&m, LIMB_ELLIPSOID, vec3(8 * MM * cup, 1 * MM * cup, 8 * MM * cup),
                vec3(30 * MM * cup, 31 * MM * cup, 31 * MM * cup));
  // The socket's rim: a plane, as a ball of 300 mm, cuts the cup on the lateral side and below.
  sonde_vec3 rim = v_scale(v_unit(vec3(-0.75, 0.2, -0.62), vec3(0, 0, 0)), far + 0.003);
  add_ellipsoid(&m, LIMB_HOLLOW, rim, vec3(far, far, far));
  add_cone(&m, vec3(22 * k, 20 * k, 16 * k), 10 * k, vec3(44 * k, 34 * k, 4 * k), 7.5 * k);
  add_cone(&m, vec3(44 * k, 34 * k, 4 * k), 7.5 * k, vec3(57 * k, 37 * k, -6 * k), 7.5 * k);
  add_cone(&m, vec3(4 * k, -4 * k, 30 * k), 19 * k, vec3(-12 * k, -4 * k, 86 * k), 15 * k);
  add_cone(&m, vec3(0, 8 * k, 36 * k), 13 * k, vec3(-24 * k, 36 * k, 60 * k), 8 * k);
  add_cone(&m, vec3(12 * k, -22 * k, -4 * k), 15 * k, vec3(18 * k, -46 * k, -40 * k), 13 * k);
  double socket = head + 2.2 * MM;
  add_ellipsoid(&m, LIMB_HOLLOW, vec3(0, 0, 0), vec3(socket, socket, socket));
  bones->first[SONDE_LIMB_FEMUR] = bones->count;
  add_femur(&m, limb);
  add_lower(&m, limb);
  bones->first[SONDE_LIMB_BONES] = bones->count;
  // Cut where the limb ends, 2 mm inside, so that the skin closes over the bones.
  bones->foot = limb_z(limb, 2) + 0.002;
  bones->top = limb_z(limb, LIMB_TOP) - 0.002;
  for (uint32_t bone = 0; bone < SONDE_LIMB_BONES; ++bone) {
    bones->low[bone] = INFINITY, bones->high[bone] = -INFINITY;
    for (uint32_t i = bones->first[bone]; i < bones->first[bone + 1]; ++i) {
      if (bones->solid[i].kind == LIMB_HOLLOW) continue;
      bones->low[bone] = least_of(bones->low[bone], bones->solid[i].low - 0.003);
      bones->high[bone] = most_of(bones->high[bone], bones->solid[i].high + 0.003);
    }
  }
  return SONDE_OK;
}
