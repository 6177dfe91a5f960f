// Where the vessels run (docs/anatomy_theory.md).
#include "anatomy/shape.h"

#include <string.h>

static const double WALL_GAP_M = 0.002;   // between neighbours when they are placed
static const double LEAST_GAP_M = 0.0008; // accepted between walls of different vessels
static const double LEAST_COVER_M = 0.0005, LEAST_BONE_GAP_M = 0.002;
static const double JUNCTION = 0.09; // of the great saphenous vein
static const double FIRST = 0.02, LAST = 0.98;

typedef struct layout {
  const sonde_thigh *thigh;
  const sonde_thigh_shape *shape;
  const sonde_surface_index *skin;
  sonde_course *course;
  double cover_scale;
} layout;

double sonde_course_junction(void) { return JUNCTION; }

double sonde_course_confluence(const sonde_thigh *thigh) {
  return thigh->deep_branch_m / thigh->length_m + 0.07;
}

// 30 degrees less at mid-thigh, 110 less above the knee.
double sonde_course_angle(const sonde_thigh *thigh, double share) {
  return thigh->vein_angle_rad - (10 * share + 100 * share * share) * SONDE_PI / 180;
}

static double calibre(double t) {
  return 1 - 0.12 * smooth_step(2 * t) - 0.08 * smooth_step(2 * t - 1);
}

static void add(const layout *l, sonde_vessel *line, sonde_vec3 centre, double radius) {
  SONDE_ASSERT(line->count < SONDE_VESSEL_POINTS);
  centre = v_whole_nm(centre);
  line->point[line->count++] = (sonde_vessel_point){
      centre, whole_nm(radius), whole_nm(sonde_surface_closest(l->skin, centre).distance_m)};
}

static double share_of(uint32_t k) {
  return FIRST + (LAST - FIRST) * k / (SONDE_VESSEL_POINTS - 1);
}

// At the same height: the way in the section's plane that is `depth` below a slanting skin.
static sonde_vec3 below_skin(const layout *l, double angle, double z_m, double depth) {
  const sonde_tube *skin = &l->shape->skin;
  sonde_vec3 n = sonde_tube_normal(skin, angle, z_m);
  double level = n.x * n.x + n.y * n.y;
  return v_madd(sonde_tube_point(skin, angle, z_m), -depth / level, vec3(n.x, n.y, 0));
}

static double fat_at(const layout *l, double angle, double z_m) {
  return sonde_shape_fat(l->shape, sonde_tube_point(&l->shape->skin, angle, z_m));
}

static sonde_vec3 rotated(sonde_vec3 v, double angle) {
  return vec3(v.x * cos(angle) - v.y * sin(angle), v.x * sin(angle) + v.y * cos(angle), v.z);
}

// How far a vessel's wall lies below the fascia there.
static double below_fascia(const layout *l, sonde_vec3 centre, double radius) {
  sonde_surface_point above = sonde_surface_closest(l->skin, centre);
  return above.distance_m - radius - l->thigh->skin_m - sonde_shape_fat(l->shape, above.point_m);
}

// A vessel's point at a share of the length, between its stored ones.
static sonde_vessel_point at_share(const sonde_vessel *line, double t) {
  SONDE_ASSERT(line->count > 1);
  double at = clamp((t - FIRST) / (LAST - FIRST), 0, 1) * (line->count - 1);
  uint32_t k = (uint32_t)fmin(floor(at), line->count - 2);
  const sonde_vessel_point *a = &line->point[k], *b = a + 1;
  double s = at - k;
  return (sonde_vessel_point){v_lerp(a->centre_m, b->centre_m, s),
                              a->radius_m + s * (b->radius_m - a->radius_m),
                              a->depth_m + s * (b->depth_m - a->depth_m)};
}

static sonde_vessel *begin(const layout *l, const char *name, sonde_vessel_kind kind) {
  SONDE_ASSERT(l->course->branch_count < SONDE_BRANCHES);
  sonde_branch *branch = &l->course->branch[l->course->branch_count++];
  *branch = (sonde_branch){.kind = kind};
  snprintf(branch->name, sizeof branch->name, "%s", name);
  return &branch->line;
}

static void lay_deep(const layout *l) {
  enum { POINTS = 40 };
  const double from[2] = {l->thigh->deep_branch_m / l->thigh->length_m,
                          sonde_course_confluence(l->thigh)};
  const double to = fmax(0.62, from[1] + 0.2), bend = 0.2, bone_gap = 0.006;
  double ra = 0.35 * l->thigh->artery_m, rv = 0.37 * l->thigh->vein_m;
  const char *const name[2] = {"deep_femoral_artery", "deep_femoral_vein"};
  for (int which = 0; which < 2; ++which) {
    const sonde_vessel *parent = which == 0 ? &l->course->artery : &l->course->vein;
    sonde_vessel *line =
        begin(l, name[which], which == 0 ? SONDE_VESSEL_ARTERY : SONDE_VESSEL_VEIN);
    for (uint32_t k = 0; k < POINTS; ++k) {
      double t = from[which] + (to - from[which]) * k / (POINTS - 1);
      double thin = 1 - 0.35 * (t - from[which]) / (to - from[which]);
      double gap = which == 0 ? bone_gap + ra : bone_gap + 2 * ra + rv + WALL_GAP_M;
      // Point beside the femur, `gap` outside it, towards a medial and then back side.
      const sonde_tube *bone = &l->shape->femur;
      double z = t * l->thigh->length_m, angle = -(10 + 60 * t) * SONDE_PI / 180;
      sonde_vec3 out = vec3(cos(angle), sin(angle), 0);
      sonde_vec3 leaves = at_share(parent, t).centre_m,
                 goal = v_madd(sonde_tube_point(bone, angle, z), gap, out);
      double w = smooth_step((t - from[which]) / bend);
      add(l, line, v_lerp(leaves, goal, w), thin * (which == 0 ? ra : rv));
    }
  }
}

// Around the artery at a share s of the second vein's way, turned by `angle` in its middle.
static sonde_vec3 around_artery(const layout *l, double s, double angle, double *radius) {
  const double from = 0.32, to = 0.74;
  double t = from + (to - from) * s, w = smooth_step(4 * s) * smooth_step(4 * (1 - s));
  sonde_vessel_point v = at_share(&l->course->vein, t), a = at_share(&l->course->artery, t);
  *radius = 0.7 * v.radius_m;
  return v_add(a.centre_m, rotated(v_sub(v.centre_m, a.centre_m), angle * w));
}

static void lay_second(const layout *l) {
  enum { POINTS = 40 };
  const double angle[] = {2, -2, 1.7, -1.7, 1.4, -1.4, 1.1, -1.1};
  sonde_vessel *line = begin(l, "second_femoral_vein", SONDE_VESSEL_VEIN);
  // The side with most room to bone and fascia; 3 mm are enough, so that the wider rotation comes
  // first.
  double best = -INFINITY, chosen = angle[0], radius;
  for (size_t k = 0; k < SONDE_COUNT_OF(angle); ++k) {
    double room = INFINITY;
    for (int i = 0; i <= 8; ++i) {
      sonde_vec3 p = around_artery(l, i / 8.0, angle[k], &radius);
      room = fmin(room, below_fascia(l, p, radius));
      room = fmin(room, sonde_tube_outside(&l->shape->femur, p) - radius - LEAST_BONE_GAP_M);
    }
    room = fmin(room, 0.003);
    if (room > best) best = room, chosen = angle[k];
  }
  for (uint32_t k = 0; k < POINTS; ++k) {
    sonde_vec3 p = around_artery(l, (double)k / (POINTS - 1), chosen, &radius);
    add(l, line, p, radius);
  }
}

/* ---- checks ------------------------------------------------------------------------------- */

// Least distance of two vessels' walls.
static double gap_between(const sonde_vessel *p, const sonde_vessel *q) {
  SONDE_ASSERT(p->count > 1 && q->count > 1);
  double least = INFINITY;
  for (uint32_t i = 0; i < p->count; ++i)
    for (uint32_t j = 0; j + 1 < q->count; ++j) {
      const sonde_vessel_point *a = &q->point[j], *b = a + 1;
      sonde_vec3 at = p->point[i].centre_m, d = v_sub(b->centre_m, a->centre_m);
      double t = clamp(v_dot(v_sub(at, a->centre_m), d) / fmax(v_norm2(d), 1e-18), 0, 1);
      double apart = v_distance(at, v_madd(a->centre_m, t, d));
      least = fmin(least, apart - p->point[i].radius_m - fmax(a->radius_m, b->radius_m));
    }
  return least;
}

static sonde_status blame(const char *name, const char *what, double z_m, sonde_error *error) {
  return sonde_fail(error, SONDE_ARGUMENT,
                    "vein-mm, artery-mm, girth-mm: the %s %s at %.0f mm from the groin: the "
                    "vessels find no room; a larger girth, less fat or thinner vessels would do",
                    name, what, z_m * 1e3);
}

// Deep vessels stay between bone and fascia, the great saphenous vein between skin and fascia
// before it dives.
static sonde_status check_line(const layout *l, const char *name, const sonde_vessel *line,
                               sonde_error *error) {
  bool superficial = strcmp(name, "great_saphenous") == 0;
  for (uint32_t k = 0; k < line->count; ++k) {
    const sonde_vessel_point *p = &line->point[k];
    double z = p->centre_m.z;
    if (z < 0 || z > l->thigh->length_m) return blame(name, "leaves the thigh", z, error);
    if (sonde_tube_outside(&l->shape->femur, p->centre_m) < p->radius_m + LEAST_BONE_GAP_M)
      return blame(name, "meets the femur", z, error);
    if (superficial && p->depth_m < l->thigh->skin_m + 0.5 * p->radius_m)
      return blame(name, "meets the skin", z, error);
    if (!superficial && below_fascia(l, p->centre_m, p->radius_m) < LEAST_COVER_M)
      return blame(name, "leaves the muscle", z, error);
  }
  return SONDE_OK;
}

static sonde_status lay_all(const layout *l, sonde_error *error) {
  sonde_course *c = l->course;
  SONDE_ASSERT(l->thigh->length_m > 0 && l->cover_scale > 0);
  c->branch_count = 0;
  c->vein.count = 0;
  for (uint32_t k = 0; k < SONDE_VESSEL_POINTS; ++k) {
    double t = share_of(k), z = t * l->thigh->length_m, angle = sonde_course_angle(l->thigh, t);
    double radius = 0.5 * l->thigh->vein_m * calibre(t);
    double a = l->thigh->vein_cover_m, b = l->thigh->canal_cover_m, e = b + 0.01;
    double all = a * (1 - t) * (1 - 2 * t) + 4 * b * t * (1 - t) + e * t * (2 * t - 1);
    double depth =
        l->thigh->skin_m + fat_at(l, angle, z) + (l->cover_scale * fmax(all, 0.001)) + radius;
    c->angle_rad[k] = angle;
    c->skin_z_m[k] = z;
    add(l, &c->vein, below_skin(l, angle, z, depth), radius);
  }

  // The artery beside the vein: from lateral (10 degrees) by the front (80 at mid-thigh) to the
  // medial front (125 at the knee).
  c->artery.count = 0;
  for (uint32_t k = 0; k < SONDE_VESSEL_POINTS; ++k) {
    double t = share_of(k), radius = 0.5 * l->thigh->artery_m * calibre(t);
    double lateral = (10 + 165 * t - 50 * t * t) * SONDE_PI / 180;
    const sonde_vessel_point *vein = &c->vein.point[k];
    sonde_vec3 to = vec3(-cos(lateral), sin(lateral), 0), centre = vein->centre_m;
    uint32_t a = k > 0 ? k - 1 : 0, b = k + 1 < c->vein.count ? k + 1 : k;
    sonde_vec3 along =
        v_unit(v_sub(c->vein.point[b].centre_m, c->vein.point[a].centre_m), vec3(0, 0, 1));
    // The direction rotates away from the skin where the fascia is near.
    sonde_vec3 up = v_sub(sonde_surface_closest(l->skin, centre).point_m, centre);
    double sense = v_dot(rotated(to, 0.01), up) < v_dot(to, up) ? 1 : -1;
    for (int degree = 0; degree <= 60; ++degree) {
      sonde_vec3 side = rotated(to, sense * degree * SONDE_PI / 180);
      side = v_unit(v_madd(side, -v_dot(side, along), along), side);
      centre = v_madd(vein->centre_m, vein->radius_m + radius + WALL_GAP_M, side);
      if (below_fascia(l, centre, radius) > 2 * LEAST_COVER_M) break;
    }
    add(l, &c->artery, centre, radius);
  }

  // Medial and behind at the knee, in front at its junction with the femoral vein.
  enum { POINTS = 60 };
  const double reach = 0.10; // share of the length over which it dives to the vein
  sonde_vessel *line = begin(l, "great_saphenous", SONDE_VESSEL_VEIN);
  for (uint32_t k = 0; k < POINTS; ++k) {
    double t = JUNCTION + (LAST - JUNCTION) * k / (POINTS - 1), z = t * l->thigh->length_m;
    double s = (t - JUNCTION) / (1 - JUNCTION);
    double angle = sonde_course_angle(l->thigh, t) - (0.05 + 0.7 * s * (1 - s)) +
                   0.05 * (1 - smooth_step(s / reach));
    double fat = fat_at(l, angle, z);
    double radius = fmin(0.5 * l->thigh->saphenous_m * (1 - 0.25 * s), 0.35 * fat);
    double depth = l->thigh->skin_m + fmax(radius, fat - radius - 0.0005);
    sonde_vec3 own = below_skin(l, angle, z, depth);
    sonde_vec3 end = at_share(&l->course->vein, t).centre_m;
    add(l, line, v_lerp(end, own, smooth_step((t - JUNCTION) / reach)), radius);
  }
  lay_deep(l);
  if (l->thigh->second_vein > 0) lay_second(l);
  sonde_status status = check_line(l, "femoral vein", &c->vein, error);
  if (!status) status = check_line(l, "femoral artery", &c->artery, error);
  for (uint32_t b = 0; b < c->branch_count && !status; ++b)
    status = check_line(l, c->branch[b].name, &c->branch[b].line, error);
  if (status) return status;
  // Walls of different vessels must be apart.
  if (gap_between(&c->vein, &c->artery) < LEAST_GAP_M)
    return blame("femoral artery", "meets the vein", 0, error);
  for (uint32_t b = 0; b < c->branch_count; ++b) {
    bool vein = c->branch[b].kind == SONDE_VESSEL_VEIN;
    if (gap_between(&c->branch[b].line, vein ? &c->artery : &c->vein) < LEAST_GAP_M)
      return blame(c->branch[b].name, vein ? "meets the artery" : "meets the vein",
                   c->branch[b].line.point[0].centre_m.z, error);
    for (uint32_t a = 0; a < b; ++a)
      if (c->branch[a].kind != c->branch[b].kind &&
          gap_between(&c->branch[a].line, &c->branch[b].line) < LEAST_GAP_M)
        return blame(c->branch[b].name, "meets its companion",
                     c->branch[b].line.point[0].centre_m.z, error);
  }
  return SONDE_OK;
}

sonde_status sonde_course_place(const sonde_thigh *thigh, const sonde_thigh_shape *shape,
                                const sonde_mesh *skin, sonde_course *course, sonde_error *error) {
  layout l = {thigh, shape, NULL, course, 1};
  sonde_surface_index *index = NULL;
  sonde_mesh side = {0};
  // Depth counts from the skin without its flat ends.
  sonde_status status = sonde_mesh_copy(skin, &side, error);
  side.face_count = 0;
  for (uint32_t t = 0; !status && t < skin->face_count; ++t) {
    const uint32_t *v = skin->faces[t];
    double za = skin->vertices[v[0]].z, zb = skin->vertices[v[1]].z, zc = skin->vertices[v[2]].z;
    if (fmax(za, fmax(zb, zc)) > 1e-9 && fmin(za, fmin(zb, zc)) < shape->skin.length_m - 1e-9)
      memcpy(side.faces[side.face_count++], v, sizeof side.faces[0]);
  }
  SONDE_ASSERT(status || side.face_count > 0);
  if (!status) status = sonde_surface_index_create(&side, &index, error);
  sonde_mesh_clear(&side);
  if (status) return status;
  l.skin = index;
  for (int k = 0; k <= 24; ++k) { // shallower and deeper in turn
    l.cover_scale = k % 2 ? 1 - 0.06 * ((k + 1) / 2) : 1 + 0.12 * (k / 2);
    sonde_error later;
    status = lay_all(&l, k == 0 ? error : &later); // the first complaint is the one to tell
    if (!status) break;
  }
  sonde_surface_index_destroy(index);
  return status;
}
