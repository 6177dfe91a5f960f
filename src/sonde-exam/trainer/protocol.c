// Protocols: their files, and their places on one thigh.
#include "trainer/case.h"

#include "base/bounds.h"

#include <string.h>

static const double DEGREE = SONDE_PI / 180, SAME_M = 1e-6;

sonde_criteria sonde_criteria_default(void) {
  return (sonde_criteria){
      .tilt_rad = 20 * DEGREE, .closed_ratio = 0.10, .open_ratio = 0.30, .reach_m = 0.010};
}

void sonde_read_stops(sonde_reader *reader, sonde_place root, sonde_exam_protocol *out) {
  static const char *const PLACE[] = {"title", "text", "needs",    "segment",  "at",
                                      "from",  "to",   "every_mm", "position", NULL};
  sonde_place places = sonde_read_find(reader, root, "places");
  out->stop_count = sonde_read_count(reader, places);
  if (out->stop_count == 0 || out->stop_count > SONDE_EXAM_STOPS) {
    sonde_reader_fail(reader, root, SONDE_FORMAT, "%u places, expected 1 to %d", out->stop_count,
                      SONDE_EXAM_STOPS);
    out->stop_count = 0;
  }
  for (uint32_t i = 0; i < out->stop_count; ++i) {
    sonde_exam_stop *stop = &out->stop[i];
    const sonde_place at = sonde_read_item(reader, places, i);
    sonde_read_keys(reader, at, "a place", PLACE);
    sonde_read_member(reader, at, "needs", false, stop->needs, sizeof stop->needs);
    sonde_read_member(reader, at, "title", true, stop->title, sizeof stop->title);
    sonde_read_member(reader, at, "segment", false, stop->segment, sizeof stop->segment);
    stop->position = (sonde_limb_position)sonde_read_choice(
        reader, at, "position", sonde_case_positions, SONDE_LIMB_POSITIONS);
    sonde_place one = sonde_read_find(reader, at, "at"), from = sonde_read_find(reader, at, "from");
    sonde_place to = sonde_read_find(reader, at, "to");
    bool stands = one && sonde_read_find(reader, one, "station");
    sonde_read_member(reader, at, "text", !stands, stop->text, sizeof stop->text);
    if (stop->segment[0] && !stands)
      sonde_reader_fail(reader, at, SONDE_FORMAT, "segment belongs to a place with a station");
    if ((one != 0) == (from != 0) || (from != 0) != (to != 0)) {
      sonde_reader_fail(reader, at, SONDE_FORMAT, "give either at, or from, to and every_mm");
      continue;
    }
    if (one) {
      sonde_read_station(reader, one, "at", &stop->from);
      continue;
    }
    sonde_read_station(reader, from, "from", &stop->from);
    sonde_read_station(reader, to, "to", &stop->to);
    stop->every_m = 1e-3 * sonde_read_real(reader, at, "every_mm", 2, 200, (double)NAN);
  }
}

sonde_status sonde_exam_protocol_parse(const char *text, const char *name, sonde_exam_protocol *out,
                                       sonde_error *error) {
  SONDE_ASSERT(text && name && out);
  static const char *const KEYS[] = {"sonde_protocol", "id",     "title", "text",
                                     "criteria",       "places", NULL};
  static const char *const CRITERIA[] = {"tilt_deg", "closed_ratio", "open_ratio", "reach_mm",
                                         NULL};
  sonde_reader *reader;
  *out = (sonde_exam_protocol){.criteria = sonde_criteria_default()};
  sonde_status status = sonde_reader_create(text, name, &reader, error);
  if (status) return status;
  sonde_place root = sonde_reader_root(reader);
  sonde_read_keys(reader, root, "a protocol", KEYS);
  sonde_read_version(reader, root, "sonde_protocol", "protocol", SONDE_EXAM_PROTOCOL_VERSION);
  sonde_read_member(reader, root, "id", true, out->id, sizeof out->id);
  sonde_read_member(reader, root, "title", true, out->title, sizeof out->title);
  sonde_read_member(reader, root, "text", true, out->text, sizeof out->text);

  sonde_criteria *c = &out->criteria;
  sonde_place at = sonde_read_find(reader, root, "criteria");
  if (at) {
    sonde_read_keys(reader, at, "criteria", CRITERIA);
    c->tilt_rad = DEGREE * sonde_read_real(reader, at, "tilt_deg", 1, 80, c->tilt_rad / DEGREE);
    c->closed_ratio = sonde_read_real(reader, at, "closed_ratio", 0, 1, c->closed_ratio);
    c->open_ratio = sonde_read_real(reader, at, "open_ratio", 0, 1, c->open_ratio);
    c->reach_m = 1e-3 * sonde_read_real(reader, at, "reach_mm", 1, 50, 1e3 * c->reach_m);
    if (!(c->closed_ratio < c->open_ratio))
      sonde_reader_fail(reader, at, SONDE_ARGUMENT,
                        "closed_ratio is %g, expected less than open_ratio (%g)", c->closed_ratio,
                        c->open_ratio);
  }

  sonde_read_stops(reader, root, out);
  status = sonde_reader_status(reader, error);
  sonde_reader_destroy(reader);
  return status;
}

sonde_status sonde_exam_protocol_load(const char *path, sonde_exam_protocol *out,
                                      sonde_error *error) {
  SONDE_ASSERT(path && out);
  char *text = NULL;
  size_t count;
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_yaml, &text, &count, error);
  if (!status) status = sonde_exam_protocol_parse(text, path, out, error);
  sonde_free(text);
  return status;
}

// As sonde_item_load.
static sonde_status load_one(const char *path, void *item, sonde_error *error) {
  return sonde_exam_protocol_load(path, item, error);
}

// Single places before stretches, fewer before more.
static int compare_protocols(const void *a, const void *b) {
  const sonde_exam_protocol *x = a, *y = b;
  double rank[2] = {0, 0};
  for (uint32_t i = 0; i < x->stop_count; ++i) rank[0] += x->stop[i].every_m > 0 ? 100 : 1;
  for (uint32_t i = 0; i < y->stop_count; ++i) rank[1] += y->stop[i].every_m > 0 ? 100 : 1;
  if (rank[0] != rank[1]) return rank[0] < rank[1] ? -1 : 1;
  return strcmp(x->id, y->id);
}

sonde_status sonde_exam_protocol_list(const char *directory, sonde_exam_protocol **protocols,
                                      uint32_t *count, sonde_error *error) {
  SONDE_ASSERT(directory && protocols && count);
  void *items;
  sonde_status status =
      sonde_load_directory(directory, sizeof(sonde_exam_protocol), load_one, &items, count, error);
  *protocols = items;
  if (!status) qsort(items, *count, sizeof(sonde_exam_protocol), compare_protocols);
  return status;
}

// ---- on a thigh

// The map in whose position a stop is, and that of the first setup.
typedef struct stop_maps {
  uint32_t held;
  sonde_limb_position position;
  const sonde_vein_map *map, *first;
} stop_maps;

// A place at a station of the limb, or on the main vein at along_m when `station` is NULL.
static sonde_status add_point(const sonde_exam_stop *stop, const stop_maps *maps,
                              const sonde_map_station *station, double along_m, sonde_plan *plan,
                              sonde_error *error) {
  const sonde_vein_map *map = maps->map;
  const double none = (double)NAN;
  if (plan->count == SONDE_PLAN_POINTS)
    return sonde_fail(error, SONDE_ARGUMENT, "more than %d places, expected fewer",
                      SONDE_PLAN_POINTS);
  sonde_plan_point *point = &plan->point[plan->count];
  *point = (sonde_plan_point){
      .held = maps->held, .position = maps->position, .station = station != NULL};
  if (station) {
    // The probe as it stands there, over the first vein of the segment.
    point->segment = stop->segment[0] ? sonde_vein_segment(map, stop->segment) : station->segment;
    if (point->segment == SONDE_SEGMENTS)
      return sonde_fail(error, SONDE_NOT_FOUND, "'%s': the leg has no segment '%s' there",
                        stop->title, stop->segment);
    sonde_vec3 vein_m = station->vein_m[point->segment], down = vec3(0, 0, 1);
    bool main = map->segment[point->segment].vein_count == 0;
    if (!v_finite(vein_m))
      return sonde_fail(error, SONDE_NOT_FOUND, "'%s': the station %s of this leg shows no %s",
                        stop->title, station->name, map->segment[point->segment].name);
    sonde_vec3 y = q_rotate(station->probe.rotation, vec3(0, 1, 0));
    double slide_m = (y.z < 0 ? -1 : 1) * station->slide_m[point->segment];
    sonde_vec3 face_m = v_madd(station->probe.position, slide_m, y);
    if (main) point->segment = sonde_vein_segment_at(map, vein_m.z);
    point->at = (sonde_vein_point){
        .along_m = main ? sonde_vein_along(map, vein_m.z) : none,
        .z_m = vein_m.z,
        .vein_m = vein_m,
        .skin_m = face_m,
        .normal = v_neg(q_rotate(station->probe.rotation, down)),
        .across = q_rotate(station->probe.rotation, vec3(1, 0, 0)),
        .depth_m = v_distance(vein_m, face_m),
    };
  } else {
    point->at = sonde_vein_at(map, along_m);
    point->segment = sonde_vein_segment_at(map, point->at.z_m);
  }
  if (point->segment == SONDE_SEGMENTS)
    return sonde_fail(error, SONDE_NOT_FOUND, "'%s' lies in no segment of the vein", stop->title);
  const char *segment = sonde_segment_title(map->segment[point->segment].name);
  snprintf(point->title, sizeof point->title, "%s", stop->every_m > 0 ? segment : stop->title);
  bool own = stop->text[0] || !station || !station->text;
  snprintf(point->text, sizeof point->text, "%s", own ? stop->text : station->text);
  point->target = (sonde_force_target){none, none, none};
  point->course_m = sonde_vein_course(map, maps->first, point->at.along_m);
  plan->count++;
  return SONDE_OK;
}

// The places of one stop of the protocol.
static sonde_status add_stop(const sonde_exam_stop *stop, const stop_maps *maps, sonde_plan *plan,
                             sonde_error *error) {
  const sonde_vein_map *map = maps->map;
  if (stop->needs[0] && !sonde_vein_has_branch(map, stop->needs)) return SONDE_OK;
  double from_m, to_m;
  for (uint32_t k = 0; k < map->station_count && !(stop->every_m > 0); ++k)
    if (strcmp(map->station[k].name, stop->from.station) == 0)
      return add_point(stop, maps, &map->station[k], 0, plan, error);
  sonde_status status = sonde_station_find(&stop->from, map, &from_m, error);
  if (!status && stop->segment[0])
    status = sonde_fail(error, SONDE_NOT_FOUND, "'%s': a thigh has no station for %s", stop->title,
                        stop->segment);
  if (!status && !(stop->every_m > 0)) return add_point(stop, maps, NULL, from_m, plan, error);
  // Equal steps of at most every_m from the first place to the last.
  if (!status) status = sonde_station_find(&stop->to, map, &to_m, error);
  if (status) return status;
  double steps = fmax(1, ceil((fabs(to_m - from_m) - SAME_M) / stop->every_m));
  for (double k = 0; k <= steps && !status; ++k)
    status = add_point(stop, maps, NULL, from_m + (to_m - from_m) * k / steps, plan, error);
  return status;
}

static sonde_status end_plan(const sonde_exam_protocol *protocol, const sonde_plan *plan,
                             sonde_error *error) {
  SONDE_ASSERT(plan->count <= SONDE_PLAN_POINTS);
  if (plan->count > 0) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT, "the thigh has no place of the protocol '%s'",
                    protocol->id);
}

sonde_status sonde_plan_make(const sonde_exam_protocol *protocol, const sonde_vein_map *map,
                             sonde_plan *plan, sonde_error *error) {
  SONDE_ASSERT(protocol && map && plan);
  *plan = (sonde_plan){.criteria = protocol->criteria};
  const stop_maps maps = {0, SONDE_LIMB_POSITIONS, map, map};
  sonde_status status = SONDE_OK;
  for (uint32_t i = 0; i < protocol->stop_count && !status; ++i)
    status = add_stop(&protocol->stop[i], &maps, plan, error);
  return status ? status : end_plan(protocol, plan, error);
}

// ---- in the positions that it asks for

sonde_status sonde_exam_lay(const sonde_case *from, const sonde_exam_protocol *protocol,
                            const char *bundled, const char *directory, sonde_exam_setups *setups,
                            sonde_plan *plan, sonde_error *error) {
  SONDE_ASSERT(from && protocol && setups && plan);
  setups->count = 0;
  *plan = (sonde_plan){.criteria = protocol->criteria};
  sonde_status status = SONDE_OK;
  if (from->truth_count == 0)
    status = sonde_fail(error, SONDE_ARGUMENT, "%s: nobody can be examined on a case without truth",
                        from->id);
  for (uint32_t i = 0; i < protocol->stop_count && !status; ++i) {
    // The setup of the stop's position, built when there is none yet.
    const sonde_exam_stop *stop = &protocol->stop[i];
    sonde_case turned = *from;
    if (stop->position < SONDE_LIMB_POSITIONS && sonde_case_takes(from, stop->position))
      turned.position = stop->position;
    const uint32_t held = sonde_exam_setups_find(setups, turned.position);
    if (held == SONDE_EXAM_SETUPS)
      status = sonde_fail(error, SONDE_ARGUMENT, "the protocol asks for more than %d positions",
                          SONDE_EXAM_SETUPS);
    sonde_case_setup *setup = &setups->held[held], *first = &setups->held[0];
    if (!status && held == setups->count) {
      status = sonde_case_build(&turned, bundled, directory, setup, error);
      setups->count += !status;
    }
    if (status) break;
    // The same leg has the same segments in every position.
    SONDE_ASSERT(setup->map.segment_count == first->map.segment_count);
    const stop_maps maps = {held, turned.position, &setup->map, &first->map};
    status = add_stop(stop, &maps, plan, error);
  }
  if (!status) status = end_plan(protocol, plan, error);
  if (status) sonde_exam_setups_clear(setups);
  return status;
}

sonde_status sonde_exam_prepare(const sonde_case *from, const sonde_exam_protocol *protocol,
                                const char *bundled, const char *directory,
                                const sonde_progress *progress, sonde_exam_setups *setups,
                                sonde_plan *plan, sonde_error *error) {
  sonde_status status = sonde_exam_lay(from, protocol, bundled, directory, setups, plan, error);
  if (!status) status = sonde_plan_find_targets(plan, setups->held, progress, error);
  if (status) sonde_exam_setups_clear(setups);
  return status;
}

uint32_t sonde_exam_setups_find(const sonde_exam_setups *setups, sonde_limb_position position) {
  SONDE_ASSERT(setups && setups->count <= SONDE_EXAM_SETUPS);
  uint32_t held = 0;
  while (held < setups->count && setups->held[held].position != position) ++held;
  return held;
}

void sonde_exam_setups_clear(sonde_exam_setups *setups) {
  if (!setups) return;
  for (uint32_t k = 0; k < setups->count; ++k) sonde_case_setup_clear(&setups->held[k]);
  setups->count = 0;
}
