// The bone of a limb whose scan shows none: a rod along the middles of its sections.
// Rays from a point inside find a section's middle; sections follow each other along the limb until
// it ends or becomes another part; the rod lies on the straight line through the middles near the
// sites, as far as that line stays inside.
#include "tissue/model.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

enum { RAYS = 48, STATIONS = 200, SIDES = 24, CENTRINGS = 3 };
static const double STEP_M = 5e-3, FAR_M = 1.0, BESIDE_SITES_M = 0.04;
static const double ROD_RADIUS_M = 0.014, ROD_SHARE = 0.3; // of the least radius of a section
static const double CLEAR = 1.3;                      // rod radii between its axis and the skin
static const double NARROW = 0.5, WIDE = 1.8;         // sections of another part, of the first
static const double SLENDER = 1.3, SHORTEST_M = 0.04; // of a limb: length over width; its rod

typedef struct section {
  sonde_vec3 middle;
  double least_m, mean_m;
} section;

typedef struct limb {
  const sonde_surface_index *skin;
  sonde_vec3 along, e1, e2;
  section section[2 * STATIONS + 1];
  uint32_t count;
  bool ends; // an end was reached where the sections are still wide
} limb;

// Area, its middle and radii of the polygon that the rays from `from` find.
static bool section_at(const limb *l, sonde_vec3 from, section *s) {
  sonde_vec3 point[RAYS];
  for (int pass = 0; pass < CENTRINGS; ++pass) {
    if (!sonde_surface_inside(l->skin, from)) return false;
    double area = 0;
    sonde_vec3 moment = vec3(0, 0, 0);
    *s = (section){from, INFINITY, 0};
    for (int k = 0; k < RAYS; ++k) {
      double angle = 2 * SONDE_PI * k / RAYS;
      sonde_vec3 out = v_madd(v_scale(l->e1, cos(angle)), sin(angle), l->e2);
      sonde_surface_point hit;
      if (!sonde_surface_raycast(l->skin, from, out, FAR_M, &hit)) return false;
      point[k] = v_sub(hit.point_m, from);
      s->least_m = fmin(s->least_m, hit.distance_m);
      s->mean_m += hit.distance_m / RAYS;
    }
    for (int k = 0; k < RAYS; ++k) {
      sonde_vec3 a = point[k], b = point[(k + 1) % RAYS];
      double part = v_norm(v_cross(a, b));
      area += part;
      moment = v_madd(moment, part / 3, v_add(a, b));
    }
    SONDE_ASSERT(area > 0);
    from = v_madd(from, 1 / area, moment);
  }
  return true;
}

// Stations to one side of the first one, which stands last in the list.
static void march(limb *l, double step_m) {
  const section first = l->section[0];
  section at = first;
  for (uint32_t k = 0; k < STATIONS; ++k) {
    section next;
    bool inside = section_at(l, v_madd(at.middle, step_m, l->along), &next);
    bool narrow = inside && next.least_m < NARROW * first.least_m;
    l->ends |= !inside && at.mean_m > NARROW * first.mean_m;
    l->ends |= inside && next.mean_m > WIDE * first.mean_m;
    if (!inside || narrow || next.mean_m > WIDE * first.mean_m) return;
    l->section[l->count++] = at = next;
  }
}

static double along(const limb *l, sonde_vec3 p) { return v_dot(p, l->along); }

// Sections from the middle of the body below the central site.
static bool find_sections(const sonde_model *model, limb *l) {
  const sonde_site *site = &model->sites[sonde_model_central_site(model)];
  sonde_surface_point far;
  sonde_vec3 in = v_neg(site->normal), from = v_madd(site->position_m, 6e-3, in);
  l->along = sonde_model_axis(model).direction;
  sonde_vec3 across = fabs(l->along.x) < 0.9 ? vec3(1, 0, 0) : vec3(0, 1, 0);
  l->e1 = v_unit(v_cross(l->along, across), across);
  l->e2 = v_cross(l->along, l->e1);
  if (!sonde_surface_raycast(l->skin, from, in, FAR_M, &far)) return false;
  if (!section_at(l, v_lerp(from, far.point_m, 0.5), &l->section[0])) return false;
  l->count = 1;
  march(l, STEP_M);
  march(l, -STEP_M);
  double low = INFINITY, high = -INFINITY;
  for (uint32_t k = 0; k < l->count; ++k) {
    low = fmin(low, along(l, l->section[k].middle));
    high = fmax(high, along(l, l->section[k].middle));
  }
  return l->ends && high - low > SLENDER * 2 * l->section[0].mean_m;
}

// How far the line stays inside, away from the skin.
static double clip(const limb *l, sonde_vec3 origin, sonde_vec3 step, double clear_m) {
  double length = 0, each = v_norm(step);
  for (uint32_t k = 1; k < 2 * STATIONS; ++k) {
    sonde_vec3 p = v_madd(origin, k, step);
    if (!sonde_surface_inside(l->skin, p)) break;
    if (sonde_surface_closest(l->skin, p).distance_m < clear_m) break;
    length = k * each;
  }
  return length;
}

sonde_status sonde_model_place_rod(sonde_model *model, sonde_error *error) {
  SONDE_ASSERT(model && model->site_count > 0);
  limb *l = SONDE_NEW(limb, 1);
  sonde_surface_index *skin = NULL;
  sonde_status status =
      l ? sonde_surface_index_create(&model->surface, &skin, error) : sonde_fail_memory(error);
  double down = 0, up = 0, radius_m = 0;
  sonde_vec3 origin = vec3(0, 0, 0), direction = vec3(0, 0, 1);
  if (!status) {
    l->skin = skin;
    if (find_sections(model, l)) {
      // Least squares through the middles within BESIDE_SITES_M of the sites: their mean, and
      // their regression on the position along.
      double low = INFINITY, high = -INFINITY, count = 0, tt = 0;
      sonde_vec3 sum = vec3(0, 0, 0), slope = vec3(0, 0, 0);
      for (uint32_t k = 0; k < model->site_count; ++k) {
        low = fmin(low, along(l, model->sites[k].position_m) - BESIDE_SITES_M);
        high = fmax(high, along(l, model->sites[k].position_m) + BESIDE_SITES_M);
      }
      for (uint32_t k = 0; k < l->count; ++k) {
        double t = along(l, l->section[k].middle);
        if (t >= low && t <= high) sum = v_add(sum, l->section[k].middle), count += 1;
      }
      origin = count > 0 ? v_scale(sum, 1 / count) : l->section[0].middle;
      for (uint32_t k = 0; k < l->count; ++k) {
        double t = along(l, l->section[k].middle), from = t - along(l, origin);
        if (t < low || t > high) continue;
        slope = v_madd(slope, from, v_sub(l->section[k].middle, origin));
        tt += from * from;
      }
      direction = tt > 0 ? v_unit(slope, l->along) : l->along;
      radius_m = fmin(ROD_RADIUS_M, ROD_SHARE * l->section[0].least_m);
      down = clip(l, origin, v_scale(direction, -STEP_M), CLEAR * radius_m);
      up = clip(l, origin, v_scale(direction, STEP_M), CLEAR * radius_m);
    }
  }
  sonde_surface_index_destroy(skin);
  sonde_free(l);
  if (status) return status;
  if (down + up < SHORTEST_M) {
    sonde_log(SONDE_LOG_WARNING, "the body is no limb along the sites' v axes: the model has no "
                                 "bone, no vessels and no image");
    return SONDE_OK;
  }

  sonde_mesh *mesh = &model->femur;
  status = sonde_mesh_create(mesh, 2 * SIDES + 2, 4 * SIDES, error);
  if (status) return status;
  sonde_vec3 end[2] = {v_madd(origin, -down, direction), v_madd(origin, up, direction)};
  sonde_vec3 axis = v_unit(v_sub(end[1], end[0]), vec3(0, 0, 1));
  sonde_vec3 p = v_unit(v_cross(axis, vec3(1, 0.1, 0)), vec3(0, 1, 0)), q = v_cross(axis, p);
  for (uint32_t k = 0; k < SIDES; ++k) {
    double angle = 2 * SONDE_PI * k / SIDES;
    sonde_vec3 r = v_add(v_scale(p, radius_m * cos(angle)), v_scale(q, radius_m * sin(angle)));
    uint32_t next = (k + 1) % SIDES;
    for (uint32_t side = 0; side < 2; ++side) mesh->vertices[2 * k + side] = v_add(end[side], r);
    const uint32_t face[4][3] = {{2 * k, 2 * next, 2 * k + 1},
                                 {2 * next, 2 * next + 1, 2 * k + 1},
                                 {2 * SIDES, 2 * next, 2 * k},
                                 {2 * SIDES + 1, 2 * k + 1, 2 * next + 1}};
    memcpy(mesh->faces[4 * k], face, sizeof face);
  }
  mesh->vertices[2 * SIDES] = end[0];
  mesh->vertices[2 * SIDES + 1] = end[1];
  return SONDE_OK;
}
