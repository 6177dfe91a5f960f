// The vein as the examination knows it: the skin above every point of its course, and its segments.
#include "trainer/judge.h"

#include <string.h>

enum { DIRECTIONS = 120, SMOOTH = 4 };
static const double REACH_M = 0.2;

static const struct {
  const char *name, *title;
  double to; // share of the course, for models without anatomy
} SEGMENT[] = {{"common_femoral", "Common femoral vein", 0.16},
               {"femoral_proximal", "Femoral vein, upper third", 0.40},
               {"femoral_mid", "Femoral vein, middle", 0.65},
               {"femoral_distal", "Femoral vein, lower third", 0.88},
               {"popliteal", "Vein behind the knee", 1.0}};

const char *sonde_segment_title(const char *name) {
  for (size_t i = 0; i < SONDE_COUNT_OF(SEGMENT); ++i)
    if (strcmp(SEGMENT[i].name, name) == 0) return SEGMENT[i].title;
  return name;
}

// The skin above every point. The leg runs along z, and the ends of the model are not skin, so the
// nearest skin is looked for across the leg; directions are averaged along the vein.
static sonde_status find_skin(const sonde_model *model, sonde_vein_map *map, sonde_error *error) {
  sonde_surface_index *skin;
  sonde_status status = sonde_surface_index_create(&model->surface, &skin, error);
  if (status) return status;
  sonde_vec3 out[SONDE_VESSEL_POINTS];
  sonde_surface_point hit;
  for (uint32_t k = 0; k < map->point_count && !status; ++k) {
    double least_m = REACH_M;
    for (int i = 0; i < DIRECTIONS; ++i) {
      double angle = 2 * SONDE_PI * i / DIRECTIONS;
      sonde_vec3 direction = vec3(cos(angle), sin(angle), 0);
      if (!sonde_surface_raycast(skin, map->point[k].vein_m, direction, least_m, &hit)) continue;
      double distance_m = v_distance(hit.point_m, map->point[k].vein_m);
      if (distance_m < least_m) least_m = distance_m, out[k] = direction;
    }
    if (!(least_m < REACH_M))
      status = sonde_fail(error, SONDE_MESH, "point %u of the vein has no skin above it", k);
  }
  for (uint32_t k = 0; k < map->point_count && !status; ++k) {
    sonde_vein_point *p = &map->point[k];
    sonde_vec3 sum = vec3(0, 0, 0);
    for (uint32_t i = k > SMOOTH ? k - SMOOTH : 0; i < map->point_count && i <= k + SMOOTH; ++i)
      sum = v_add(sum, out[i]);
    p->normal = v_unit(sum, out[k]);
    bool met = sonde_surface_raycast(skin, p->vein_m, p->normal, REACH_M, &hit);
    p->skin_m = met ? hit.point_m : v_madd(p->vein_m, p->depth_m, p->normal);
    p->depth_m = v_distance(p->skin_m, p->vein_m);
  }
  sonde_surface_index_destroy(skin);
  return status;
}

sonde_status sonde_vein_map_make(const sonde_model *model, sonde_vein_map *map,
                                 sonde_error *error) {
  SONDE_ASSERT(model && map);
  *map = (sonde_vein_map){.point_count = model->vein.count};
  if (model->vein.count < 2)
    return sonde_fail(error, SONDE_MESH, "%s: the model has no femoral vein", model->name);
  for (uint32_t k = 0; k < map->point_count; ++k) {
    const sonde_vessel_point *from = &model->vein.point[k];
    sonde_vein_point *p = &map->point[k];
    *p = (sonde_vein_point){.vein_m = from->centre_m, .z_m = from->centre_m.z};
    p->radius_m = from->radius_m;
    p->depth_m = from->depth_m;
    if (k > 0) map->length_m += v_distance(p->vein_m, map->point[k - 1].vein_m);
    p->along_m = map->length_m;
  }
  sonde_status status = find_skin(model, map, error);

  // Across the vein in the plane of the skin, as the nearest site has it, so that left and right of
  // the image do not change between the two.
  for (uint32_t k = 0; k < map->point_count && !status; ++k) {
    sonde_vein_point *p = &map->point[k];
    const sonde_vein_point *before = &map->point[k > 0 ? k - 1 : 0];
    const sonde_vein_point *after = &map->point[k + 1 < map->point_count ? k + 1 : k];
    sonde_vec3 course = v_sub(after->vein_m, before->vein_m);
    course = v_madd(course, -v_dot(course, p->normal), p->normal);
    p->across = v_cross(v_unit(course, vec3(0, 0, 1)), p->normal);
    double nearest = INFINITY;
    sonde_vec3 u = p->across;
    for (uint32_t i = 0; i < model->site_count; ++i) {
      double distance = v_distance(model->sites[i].position_m, p->skin_m);
      if (distance < nearest) nearest = distance, u = model->sites[i].u;
    }
    if (v_dot(u, p->across) < 0) p->across = v_neg(p->across);
  }
  if (status) return status;

  // Segments, branches and landmarks that the model names; a model without anatomy gets the
  // segments of SEGMENT by their shares of the course.
  const sonde_thigh_anatomy *anatomy = model->anatomy;
  double first = map->point[0].z_m, last = map->point[map->point_count - 1].z_m, from = first;
  double low = fmin(first, last), high = fmax(first, last);
  for (uint32_t i = 0; anatomy && i < anatomy->segment_count; ++i) {
    sonde_segment segment = anatomy->segment[i];
    segment.from_m = fmax(segment.from_m, low);
    segment.to_m = fmin(segment.to_m, high);
    if (segment.to_m > segment.from_m) map->segment[map->segment_count++] = segment;
  }
  map->branch_count = anatomy ? anatomy->branch_count : 0;
  for (uint32_t i = 0; i < map->branch_count; ++i)
    memcpy(map->branch[i], anatomy->branch[i].name, sizeof map->branch[i]);
  map->landmark_count = anatomy ? anatomy->landmark_count : 0;
  for (uint32_t i = 0; i < map->landmark_count; ++i) {
    memcpy(map->landmark[i], anatomy->landmark[i].name, sizeof map->landmark[i]);
    map->landmark_z_m[i] = anatomy->landmark[i].vein_m.z;
  }
  if (map->segment_count > 0) return SONDE_OK;
  for (size_t i = 0; i < SONDE_COUNT_OF(SEGMENT); ++i) {
    double to = first + SEGMENT[i].to * (last - first);
    sonde_segment *segment = &map->segment[map->segment_count++];
    *segment = (sonde_segment){.from_m = fmin(from, to), .to_m = fmax(from, to)};
    snprintf(segment->name, sizeof segment->name, "%s", SEGMENT[i].name);
    from = to;
  }
  return SONDE_OK;
}

sonde_vein_point sonde_vein_at(const sonde_vein_map *map, double along_m) {
  SONDE_ASSERT(map->point_count >= 2);
  uint32_t k = 1;
  while (k + 1 < map->point_count && map->point[k].along_m < along_m) ++k;
  const sonde_vein_point *a = &map->point[k - 1], *b = &map->point[k];
  double s = clamp((along_m - a->along_m) / (b->along_m - a->along_m), 0, 1);
  sonde_vein_point p = {.along_m = a->along_m + s * (b->along_m - a->along_m),
                        .z_m = a->z_m + s * (b->z_m - a->z_m),
                        .vein_m = v_lerp(a->vein_m, b->vein_m, s),
                        .skin_m = v_lerp(a->skin_m, b->skin_m, s),
                        .normal = v_unit(v_lerp(a->normal, b->normal, s), a->normal),
                        .across = v_lerp(a->across, b->across, s),
                        .radius_m = a->radius_m + s * (b->radius_m - a->radius_m),
                        .depth_m = a->depth_m + s * (b->depth_m - a->depth_m)};
  sonde_vec3 flat = v_madd(p.across, -v_dot(p.across, p.normal), p.normal);
  p.across = v_unit(flat, a->across);
  return p;
}

double sonde_vein_along(const sonde_vein_map *map, double z_m) {
  SONDE_ASSERT(map->point_count >= 2);
  for (uint32_t k = 1; k < map->point_count; ++k) {
    const sonde_vein_point *a = &map->point[k - 1], *b = &map->point[k];
    double s = (z_m - a->z_m) / (b->z_m - a->z_m);
    bool last = k + 1 == map->point_count;
    if ((s >= 0 || k == 1) && (s <= 1 || last))
      return a->along_m + clamp(s, 0, 1) * (b->along_m - a->along_m);
  }
  return map->length_m;
}

bool sonde_vein_has_branch(const sonde_vein_map *map, const char *name) {
  for (uint32_t i = 0; i < map->branch_count; ++i)
    if (strcmp(map->branch[i], name) == 0) return true;
  return false;
}

uint32_t sonde_vein_segment(const sonde_vein_map *map, const char *name) {
  for (uint32_t i = 0; i < map->segment_count; ++i)
    if (strcmp(map->segment[i].name, name) == 0) return i;
  return SONDE_SEGMENTS;
}

uint32_t sonde_vein_segment_at(const sonde_vein_map *map, double z_m) {
  for (uint32_t i = 0; i < map->segment_count; ++i)
    if (z_m >= map->segment[i].from_m && z_m <= map->segment[i].to_m) return i;
  return SONDE_SEGMENTS;
}

void sonde_vein_segment_ends(const sonde_vein_map *map, uint32_t segment, double *from_m,
                             double *to_m) {
  SONDE_ASSERT(segment < map->segment_count && from_m && to_m);
  double a = sonde_vein_along(map, map->segment[segment].from_m);
  double b = sonde_vein_along(map, map->segment[segment].to_m);
  *from_m = fmin(a, b);
  *to_m = fmax(a, b);
}

sonde_status sonde_station_find(const sonde_station *station, const sonde_vein_map *map,
                                double *along_m, sonde_error *error) {
  SONDE_ASSERT(station && map && along_m);
  double base = 0;
  if (station->landmark[0]) {
    uint32_t i = 0;
    while (i < map->landmark_count && strcmp(map->landmark[i], station->landmark) != 0) ++i;
    if (i == map->landmark_count)
      return sonde_fail(error, SONDE_NOT_FOUND, "the thigh has no landmark '%s'",
                        station->landmark);
    base = sonde_vein_along(map, map->landmark_z_m[i]);
  } else if (station->segment[0]) {
    uint32_t i = sonde_vein_segment(map, station->segment);
    if (i == SONDE_SEGMENTS)
      return sonde_fail(error, SONDE_NOT_FOUND, "the thigh has no segment '%s' (it begins with %s)",
                        station->segment, map->segment[0].name);
    double from, to;
    sonde_vein_segment_ends(map, i, &from, &to);
    base = from + station->share * (to - from);
  }
  *along_m = base + station->shift_m;
  if (*along_m >= -1e-9 && *along_m <= map->length_m + 1e-9) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT,
                    "a place is %.0f mm from the groin end of the vein, which has %.0f mm",
                    1e3 * *along_m, 1e3 * map->length_m);
}
