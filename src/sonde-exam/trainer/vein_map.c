// The veins as the examination knows them: the skin above every point of the main vein's course,
// the segments of all veins, the stations.
#include "trainer/judge.h"

#include <ctype.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

enum { DIRECTIONS = 120, SMOOTH = 4, COURSE = 10 }; // the last two: points to either side
static const double REACH_M = 0.2;
static const double FACE_HALF_M = 0.025; // half of the picture's width: veins farther aside are not
                                         // in it
enum { SLIDES = 10, STEADY = 2 };
static const double SLIDE_M = 0.002;
static const double MOST_ALONG_BEAM = 0.5; // cosine between a vein and the beam

static const struct {
  const char *name, *title;
  double to; // share of the main vein's course, for models without anatomy; 0: another vein
  sonde_segment_kind kind;
  const char *vein[SONDE_SEGMENT_VEINS]; // branches of a limb
} SEGMENT[] = {
    {"common_femoral", "Common femoral vein", 0.16, SONDE_SEGMENT_MAIN, {0}},
    {"femoral_proximal", "Femoral vein, upper third", 0.40, SONDE_SEGMENT_MAIN, {0}},
    {"femoral_mid", "Femoral vein, middle", 0.65, SONDE_SEGMENT_MAIN, {0}},
    {"femoral_distal", "Femoral vein, lower third", 0.88, SONDE_SEGMENT_MAIN, {0}},
    {"popliteal", "Popliteal vein", 1.0, SONDE_SEGMENT_MAIN, {0}},
    {"deep_femoral", "Deep femoral vein", 0, SONDE_SEGMENT_DEEP, {"deep_femoral_vein"}},
    {"tibioperoneal",
     "Tibioperoneal trunk vein",
     0,
     SONDE_SEGMENT_CALF,
     {"tibioperoneal_trunk_vein"}},
    {"posterior_tibial",
     "Posterior tibial veins",
     0,
     SONDE_SEGMENT_CALF,
     {"posterior_tibial_vein", "second_posterior_tibial_vein"}},
    {"peroneal",
     "Peroneal veins",
     0,
     SONDE_SEGMENT_CALF,
     {"peroneal_vein", "second_peroneal_vein"}},
    {"gastrocnemius",
     "Gastrocnemius veins",
     0,
     SONDE_SEGMENT_CALF,
     {"medial_gastrocnemius_vein", "second_medial_gastrocnemius_vein", "lateral_gastrocnemius_vein",
      "second_lateral_gastrocnemius_vein"}},
    {"soleal",
     "Soleal veins",
     0,
     SONDE_SEGMENT_CALF,
     {"medial_soleal_vein", "central_soleal_vein", "lateral_soleal_vein"}},
    {"great_saphenous",
     "Great saphenous vein",
     0,
     SONDE_SEGMENT_SUPERFICIAL,
     {"great_saphenous", "second_great_saphenous"}},
    {"small_saphenous", "Small saphenous vein", 0, SONDE_SEGMENT_SUPERFICIAL, {"small_saphenous"}}};
_Static_assert(SONDE_COUNT_OF(SEGMENT) == TRAINER_SEGMENTS, "a row for each name");

void sonde_vessel_title(const sonde_vein_map *map, const sonde_vessel_view *view, char *title,
                        size_t size) {
  SONDE_ASSERT(map && view && size > 1);
  const char *kind = view->artery ? "artery" : "vein", *name = "";
  const uint32_t branch = view->vessel - TRAINER_FIRST_BRANCH;
  if (view->vessel < TRAINER_FIRST_BRANCH) {
    const uint32_t k = sonde_vein_segment_at(map, view->rest_z_m);
    const char *segment = k < map->segment_count ? map->segment[k].name : "";
    name = strcmp(segment, "common_femoral") == 0 ? "common femoral"
           : strcmp(segment, "popliteal") == 0    ? "popliteal"
                                                  : "femoral";
  } else if (branch < map->branch_count) {
    name = map->branch[branch];
  }
  const size_t length = strlen(name), tail = strlen(kind);
  const bool told = length >= tail && strcmp(name + length - tail, kind) == 0;
  snprintf(title, size, "%s%s%s", name, told ? "" : " ", told ? "" : kind);
  for (char *c = title; *c; ++c)
    if (*c == '_') *c = ' ';
  title[0] = (char)toupper((unsigned char)title[0]);
}

const char *sonde_segment_title(const char *name) {
  for (size_t i = 0; i < SONDE_COUNT_OF(SEGMENT); ++i)
    if (strcmp(SEGMENT[i].name, name) == 0) return SEGMENT[i].title;
  return name;
}

const char *sonde_segment_known(uint32_t i, sonde_segment_kind *kind) {
  SONDE_ASSERT(i < TRAINER_SEGMENTS);
  if (kind) *kind = SEGMENT[i].kind;
  return SEGMENT[i].name;
}

const char *sonde_segment_of_branch(const char *branch) {
  for (size_t i = 0; i < SONDE_COUNT_OF(SEGMENT); ++i)
    for (size_t k = 0; k < SONDE_SEGMENT_VEINS && SEGMENT[i].vein[k]; ++k)
      if (strcmp(SEGMENT[i].vein[k], branch) == 0) return SEGMENT[i].name;
  return NULL;
}

// The skin above every point, and the direction across the vein. The ends of the model are not
// skin, so the nearest skin is looked for across the leg, which runs along z when it is straight
// and with the vein, smoothed, when it is held in a position; directions are averaged along the
// vein.
static sonde_status find_skin(const sonde_model *model, sonde_vein_map *map, sonde_error *error) {
  sonde_surface_index *skin;
  sonde_status status = sonde_surface_index_create(&model->surface, &skin, error);
  if (status) return status;
  const bool held = v_norm2(model->gravity.up) > 0;
  sonde_vec3 out[SONDE_VESSEL_POINTS];
  sonde_surface_point hit;
  for (uint32_t k = 0; k < map->point_count && !status; ++k) {
    double least_m = REACH_M;
    sonde_vec3 u = vec3(1, 0, 0), v = vec3(0, 1, 0);
    if (held) {
      uint32_t from = k > COURSE ? k - COURSE : 0;
      uint32_t to = k + COURSE < map->point_count ? k + COURSE : map->point_count - 1;
      sonde_vec3 along = v_sub(map->point[to].vein_m, map->point[from].vein_m);
      v = v_unit(v_cross(along, u), v);
      u = v_unit(v_cross(v, along), u);
    }
    for (int i = 0; i < DIRECTIONS; ++i) {
      double angle = 2 * SONDE_PI * i / DIRECTIONS;
      sonde_vec3 direction = v_add(v_scale(u, cos(angle)), v_scale(v, sin(angle)));
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
  sonde_surface_index_destroy(skin);
  return status;
}

// Where the plane of a probe cuts a line under its face, nearest to the beam; NaN: nowhere.
static sonde_vec3 cross_line(const sonde_vessel *line, sonde_pose probe) {
  const double none = (double)NAN;
  double nearest = FACE_HALF_M;
  sonde_vec3 found = vec3(none, none, none);
  for (uint32_t i = 0; i + 1 < line->count; ++i) {
    sonde_vec3 a = pose_apply_inverse(probe, line->point[i].centre_m);
    sonde_vec3 b = pose_apply_inverse(probe, line->point[i + 1].centre_m);
    if ((a.y > 0) == (b.y > 0)) continue;
    double t = a.y / (a.y - b.y), aside_m = fabs(a.x + t * (b.x - a.x));
    if (aside_m > nearest) continue;
    nearest = aside_m;
    found = v_lerp(line->point[i].centre_m, line->point[i + 1].centre_m, t);
  }
  return found;
}

// A vein that begins or ends beside the station is looked for within 20 mm, where it
// stays in the plane when the tissue moves a little under the press, and where it runs across the
// plane: along the beam, as in the arch of a saphenous vein, a press hardly closes it.
static void find_vein(const sonde_model *model, const sonde_exam_segment *segment, uint32_t number,
                      sonde_map_station *to) {
  enum { ALL = SLIDES + STEADY };
  const sonde_vec3 y = q_rotate(to->probe.rotation, vec3(0, 1, 0));
  const sonde_vec3 beam = q_rotate(to->probe.rotation, vec3(0, 0, 1));
  sonde_vec3 at[2 * ALL + 1];
  for (int step = -ALL; step <= ALL; ++step) {
    sonde_pose probe = to->probe;
    probe.position = v_madd(probe.position, (y.z < 0 ? -SLIDE_M : SLIDE_M) * step, y);
    for (uint32_t v = segment->vein_count; v-- > 0;) {
      const uint32_t branch = segment->vein[v] - TRAINER_FIRST_BRANCH;
      sonde_vec3 met = cross_line(&model->anatomy->branch[branch].line, probe);
      if (isfinite(met.z) || v + 1 == segment->vein_count) at[step + ALL] = met;
    }
  }
  int best = 0, least = INT_MAX; // the nearest of the best kind
  for (int step = -SLIDES; step <= SLIDES; ++step) {
    const sonde_vec3 *here = &at[step + ALL];
    bool steady = true;
    for (int n = -STEADY; n <= STEADY; ++n) steady &= isfinite(here[n].z);
    bool across = steady;
    for (int n = -STEADY; n < STEADY && across; ++n)
      across = fabs(v_dot(v_unit(v_sub(here[n + 1], here[n]), beam), beam)) < MOST_ALONG_BEAM;
    const int rank = abs(step) + 2 * SLIDES * (!steady + !across);
    if (isfinite(here->z) && rank < least) least = rank, best = step;
  }
  to->vein_m[number] = at[best + ALL];
  to->slide_m[number] = SLIDE_M * best;
}

// Stations of a limb in the model's frame: the probe as the limb has it, left and right of the
// image as at the model's site.
static void find_stations(const sonde_model *model, const sonde_limb *limb, sonde_vein_map *map) {
  static const char *const OTHER[][2] = {{"posterior_tibial", "posterior_tibial"},
                                         {"peroneal", "peroneal"},
                                         {"gastrocnemius", "gastrocnemius"},
                                         {"great_saphenous", "great_saphenous"},
                                         {"small_saphenous", "small_saphenous"}};
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  const sonde_limb_pose *pose = sonde_limb_pose_of(model);
  if (pose)
    sonde_limb_pose_stations(pose, station);
  else
    sonde_limb_stations(limb, station);
  map->station_count = SONDE_LIMB_STATIONS;
  SONDE_ASSERT(model->site_count >= SONDE_LIMB_STATIONS &&
               map->landmark_count >= map->station_count);
  for (uint32_t k = 0; k < map->station_count; ++k) {
    sonde_map_station *to = &map->station[k];
    sonde_vec3 x = q_rotate(station[k].probe.rotation, vec3(1, 0, 0));
    sonde_vec3 z = q_rotate(station[k].probe.rotation, vec3(0, 0, 1));
    x.z = -x.z, z.z = -z.z; // the model's z runs the other way
    if (v_dot(x, model->sites[k].u) < 0) x = v_neg(x);
    *to = (sonde_map_station){
        .text = station[k].text,
        .segment = SONDE_SEGMENTS,
        .probe = {model->sites[k].position_m, q_from_matrix(m_columns(x, v_cross(z, x), z))}};
    memcpy(to->name, map->landmark[k], sizeof to->name);
    sonde_vec3 main_m = cross_line(&model->vein, to->probe);
    for (size_t i = 0; i < SONDE_COUNT_OF(OTHER); ++i)
      if (strcmp(OTHER[i][0], to->name) == 0) to->segment = sonde_vein_segment(map, OTHER[i][1]);
    if (to->segment == SONDE_SEGMENTS && isfinite(main_m.z))
      to->segment = sonde_vein_segment_at(map, main_m.z);
    for (uint32_t i = 0; i < map->segment_count; ++i) {
      to->vein_m[i] = main_m;
      if (map->segment[i].vein_count > 0) find_vein(model, &map->segment[i], i, to);
    }
  }

  // Middles of the leg: of the skin's extent across it, at equal steps of z.
  const sonde_mesh *skin = &model->surface;
  double low = INFINITY, high = -INFINITY;
  for (uint32_t i = 0; i < skin->vertex_count; ++i) {
    low = fmin(low, skin->vertices[i].z);
    high = fmax(high, skin->vertices[i].z);
  }
  map->middle_z_m[0] = low, map->middle_z_m[1] = high;
  for (uint32_t k = 0; k < SONDE_MAP_MIDDLES; ++k) {
    const double step_m = (high - low) / (SONDE_MAP_MIDDLES - 1), z = low + k * step_m;
    sonde_vec3 least = vec3(INFINITY, INFINITY, z), most = vec3(-INFINITY, -INFINITY, z);
    for (uint32_t i = 0; i < skin->vertex_count; ++i)
      if (fabs(skin->vertices[i].z - z) <= step_m) {
        least = v_min(least, skin->vertices[i]);
        most = v_max(most, skin->vertices[i]);
      }
    map->middle_m[k] = v_lerp(least, most, 0.5);
    map->middle_m[k].z = z;
  }
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

  if (status) return status;

  // Segments, branches and landmarks that the model names; a model without anatomy gets the
  // segments of SEGMENT by their shares of the course.
  const sonde_thigh_anatomy *anatomy = model->anatomy;
  double first = map->point[0].z_m, last = map->point[map->point_count - 1].z_m, from = first;
  double low = fmin(first, last), high = fmax(first, last);
  for (uint32_t i = 0; anatomy && i < anatomy->segment_count && i < MAIN_SEGMENTS; ++i) {
    const sonde_segment *named = &anatomy->segment[i];
    sonde_exam_segment segment = {.from_m = fmax(named->from_m, low),
                                  .to_m = fmin(named->to_m, high)};
    memcpy(segment.name, named->name, sizeof segment.name);
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
  const bool named = map->segment_count > 0;
  for (size_t i = 0; !named && i < SONDE_COUNT_OF(SEGMENT) && SEGMENT[i].to > 0; ++i) {
    double to = first + SEGMENT[i].to * (last - first);
    sonde_exam_segment *segment = &map->segment[map->segment_count++];
    *segment = (sonde_exam_segment){.from_m = fmin(from, to), .to_m = fmax(from, to)};
    snprintf(segment->name, sizeof segment->name, "%s", SEGMENT[i].name);
    from = to;
  }

  // Segments of veins beside the main one that the model has, in the order of the table.
  for (size_t i = 0; anatomy && i < SONDE_COUNT_OF(SEGMENT); ++i) {
    sonde_exam_segment *segment = &map->segment[map->segment_count];
    *segment = (sonde_exam_segment){.from_m = INFINITY, .to_m = -INFINITY, .kind = SEGMENT[i].kind};
    snprintf(segment->name, sizeof segment->name, "%s", SEGMENT[i].name);
    for (size_t k = 0; k < SONDE_SEGMENT_VEINS && SEGMENT[i].vein[k]; ++k)
      for (uint32_t b = 0; b < anatomy->branch_count; ++b) {
        const sonde_branch *branch = &anatomy->branch[b];
        if (strcmp(branch->name, SEGMENT[i].vein[k]) != 0 || branch->line.count < 2) continue;
        segment->vein[segment->vein_count++] = TRAINER_FIRST_BRANCH + b;
        for (uint32_t p = 0; p < branch->line.count; ++p) {
          segment->from_m = fmin(segment->from_m, branch->line.point[p].centre_m.z);
          segment->to_m = fmax(segment->to_m, branch->line.point[p].centre_m.z);
        }
        break; // the first of that name
      }
    if (segment->vein_count > 0) map->segment_count++;
  }
  SONDE_ASSERT(map->segment_count <= SONDE_SEGMENTS);
  const sonde_limb *limb = sonde_limb_of(model);
  if (limb) find_stations(model, limb, map);
  return SONDE_OK;
}

sonde_pose sonde_vein_pose(const sonde_vein_point *place, double depth_m) {
  SONDE_ASSERT(place != NULL && isfinite(depth_m));
  sonde_vec3 z = v_neg(place->normal), x = place->across;
  return (sonde_pose){v_madd(place->skin_m, -depth_m, place->normal),
                      q_from_matrix(m_columns(x, v_cross(z, x), z))};
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
  for (uint32_t i = 0; i < map->segment_count && map->segment[i].vein_count == 0; ++i)
    if (z_m >= map->segment[i].from_m && z_m <= map->segment[i].to_m) return i;
  return SONDE_SEGMENTS;
}

double sonde_segment_ratio(const sonde_vein_map *map, uint32_t segment,
                           const sonde_snapshot *snapshot, sonde_vec3 *rest_m) {
  SONDE_ASSERT(map && segment < map->segment_count && snapshot);
  const sonde_exam_segment *of = &map->segment[segment];
  if (of->vein_count == 0) {
    if (rest_m) *rest_m = snapshot->vein_rest_m;
    return sonde_vein_ratio(snapshot);
  }
  double ratio = (double)NAN;
  for (uint32_t v = 0; v < of->vein_count; ++v)
    for (uint32_t i = 0; i < snapshot->crossing_count; ++i) {
      const sonde_vein_crossing *cut = &snapshot->crossing[i];
      if (cut->vessel != of->vein[v] || !(fabs(cut->aside_m) <= FACE_HALF_M)) continue;
      if (isnan(ratio) && rest_m) *rest_m = cut->rest_m;
      ratio = fmax(ratio, cut->area_ratio);
    }
  return ratio;
}

void sonde_vein_segment_ends(const sonde_vein_map *map, uint32_t segment, double *from_m,
                             double *to_m) {
  SONDE_ASSERT(segment < map->segment_count && from_m && to_m);
  double a = sonde_vein_along(map, map->segment[segment].from_m);
  double b = sonde_vein_along(map, map->segment[segment].to_m);
  *from_m = fmin(a, b);
  *to_m = fmax(a, b);
}

double sonde_vein_course(const sonde_vein_map *from, const sonde_vein_map *to, double along_m) {
  SONDE_ASSERT(from && to && from->segment_count == to->segment_count);
  if (from == to || isnan(along_m)) return along_m;
  // Knots of both: the start of the first segment, then the end of each.
  double a[2] = {0, 0}, b[2] = {0, 0};
  for (uint32_t k = 0; k <= from->segment_count && a[1] < along_m; ++k) {
    const uint32_t i = k > 0 ? k - 1 : 0;
    double one[2], other[2];
    if (from->segment[i].vein_count > 0) break;
    sonde_vein_segment_ends(from, i, &one[0], &one[1]);
    sonde_vein_segment_ends(to, i, &other[0], &other[1]);
    a[0] = a[1], a[1] = one[k > 0];
    b[0] = b[1], b[1] = other[k > 0];
  }
  return a[1] > a[0] ? b[0] + (along_m - a[0]) / (a[1] - a[0]) * (b[1] - b[0]) : along_m;
}

sonde_status sonde_station_find(const sonde_station *station, const sonde_vein_map *map,
                                double *along_m, sonde_error *error) {
  SONDE_ASSERT(station && map && along_m);
  double base = 0;
  if (station->of_branch)
    return sonde_fail(error, SONDE_ARGUMENT, "a share without a segment is one of a branch");
  // On a thigh a station is the landmark of its name, or the middle of the segment of its name.
  const bool stands = station->station[0] != 0;
  const char *mark = stands ? station->station : station->landmark;
  uint32_t at = 0;
  while (at < map->landmark_count && strcmp(map->landmark[at], mark) != 0) ++at;
  const bool marked = mark[0] && at < map->landmark_count;
  if (marked && stands && map->station_count > 0) {
    const sonde_map_station *there = &map->station[at];
    if (there->segment >= map->segment_count || map->segment[there->segment].vein_count > 0)
      return sonde_fail(error, SONDE_NOT_FOUND, "the station '%s' is not on the main vein", mark);
  }
  if (marked) {
    base = sonde_vein_along(map, map->landmark_z_m[at]);
  } else if (stands) {
    uint32_t i = sonde_vein_segment(map, mark);
    if (i == SONDE_SEGMENTS)
      return sonde_fail(error, SONDE_NOT_FOUND, "the thigh has no station '%s'", mark);
    double from, to;
    sonde_vein_segment_ends(map, i, &from, &to);
    base = 0.5 * (from + to);
  } else if (station->landmark[0]) {
    return sonde_fail(error, SONDE_NOT_FOUND, "the thigh has no landmark '%s'", mark);
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
