// The judge: from snapshots to compressions, and what they examine.
#include "trainer/judge.h"

#include <string.h>

// A press begins when the force has risen by this much since the last; it ends below a share of its
// peak.
static const double RISE_N = 2, END_SHARE = 0.5, END_N = 1.5;
static const double LONGEST_STEP_S = 0.5; // snapshots further apart leave time that is not counted

static const char *const RESULT[] = {"complete", "open", "insufficient", "too_hard", "off_axis"};
static const char *const STATE[] = {"none", "pressing", "complete", "open", "too_hard", "off_axis"};

const char *sonde_press_result_name(sonde_press_result result) {
  SONDE_ASSERT(result < SONDE_PRESS_RESULTS);
  return RESULT[result];
}

const char *sonde_press_state_name(sonde_press_state state) {
  SONDE_ASSERT(state < SONDE_COUNT_OF(STATE));
  return STATE[state];
}

// ---- stretches of vein

uint32_t sonde_vein_steps(const sonde_vein_map *map) {
  return (uint32_t)ceil(fmin(map->length_m / JUDGE_BIN_M, JUDGE_BINS));
}

void sonde_vein_mark(const sonde_vein_map *map, bool *bins, double from_m, double to_m) {
  double end_m = fmin(map->length_m, JUDGE_BIN_M * JUDGE_BINS);
  if (!(to_m > 0 && from_m < end_m)) return;
  double first = clamp(floor(from_m / JUDGE_BIN_M), 0, JUDGE_BINS - 1);
  double last = clamp(floor(fmin(to_m, end_m) / JUDGE_BIN_M), 0, JUDGE_BINS - 1);
  for (uint32_t i = (uint32_t)first; i <= (uint32_t)last; ++i) {
    double middle_m = ((double)i + 0.5) * JUDGE_BIN_M;
    if (middle_m >= from_m && middle_m <= to_m && middle_m <= end_m) bins[i] = true;
  }
}

sonde_vein_run sonde_vein_longest_gap(const bool *planned, const bool *covered, uint32_t steps) {
  SONDE_ASSERT(steps <= JUDGE_BINS);
  sonde_vein_run longest = {0, 0};
  for (uint32_t i = 0, run = 0; i < steps; ++i) {
    run = planned[i] && !covered[i] ? run + 1 : 0;
    if (run > longest.to - longest.from) longest = (sonde_vein_run){i + 1 - run, i + 1};
  }
  return longest;
}

bool sonde_place_is_done(const sonde_plan *plan, uint32_t place, const sonde_compression *presses,
                         uint32_t count) {
  SONDE_ASSERT(place < plan->count && (presses || count == 0));
  for (uint32_t i = 0; i < count; ++i)
    if (presses[i].examined >> place & 1) return true;
  return false;
}

// ---- a judge

sonde_status sonde_judge_create(const sonde_vein_map *map, const sonde_plan *plan,
                                sonde_judge **out, sonde_error *error) {
  SONDE_ASSERT(map && plan && out && plan->count <= SONDE_PLAN_POINTS);
  sonde_judge *judge = *out = SONDE_NEW(sonde_judge, 1);
  if (!judge) return sonde_fail_memory(error);
  judge->map = judge->first = *map;
  judge->plan = *plan;
  judge->hint_s = -INFINITY;
  judge->seen = SONDE_SEGMENTS;
  for (uint32_t i = 0; i < plan->count; ++i) {
    double at_m = plan->point[i].course_m, reach_m = plan->criteria.reach_m;
    SONDE_ASSERT(plan->point[i].segment < map->segment_count);
    sonde_vein_mark(map, judge->wanted, at_m - reach_m, at_m + reach_m); // none without along_m
  }
  return SONDE_OK;
}

void sonde_judge_destroy(sonde_judge *judge) {
  if (!judge) return;
  sonde_free(judge->press);
  sonde_free(judge);
}

// ---- one press

sonde_force_target sonde_press_target(const sonde_judge *judge) {
  const double none = (double)NAN;
  uint32_t place = judge->now.place;
  if (place >= judge->plan.count) return (sonde_force_target){none, none, none};
  return judge->plan.point[place].target;
}

// Distance of the press under way from a place, along the main vein or where another is cut; NaN:
// its vein is not in view, or the patient lies otherwise.
static double distance_from(const sonde_judge *judge, const sonde_plan_point *place) {
  uint32_t slot = sonde_segment_slot(&judge->map, place->segment);
  sonde_vec3 start_m = judge->view[slot].start_m;
  if (place->held != judge->held) return (double)NAN;
  if (slot != 0) return v_distance(start_m, place->at.vein_m);
  if (isnan(start_m.z)) return start_m.z;
  return fabs(sonde_vein_along(&judge->map, start_m.z) - place->at.along_m);
}

// What the press under way shows of the veins of a slot, at a place (NULL: anywhere on the vein).
// At a station the plane has to stand as it does there, since its vein may run obliquely.
// Comparisons with NaN are false: without a force target nothing is firm.
static sonde_press_result show(const sonde_judge *judge, uint32_t slot,
                               const sonde_plan_point *place, double firm_n) {
  const sonde_criteria *c = &judge->plan.criteria;
  const sonde_vein_view *view = &judge->view[slot];
  double tilt_rad = view->tilt_rad;
  if (place && (place->station || slot != 0)) {
    sonde_vec3 course = v_cross(place->at.normal, place->at.across);
    tilt_rad = acos(fmin(1, fabs(v_dot(view->probe_y, course))));
  }
  if (!view->seen_at_peak || !(tilt_rad <= c->tilt_rad)) return SONDE_PRESS_OFF_AXIS;
  if (view->ratio <= c->closed_ratio) return SONDE_PRESS_COMPLETE;
  bool firm = judge->now.force_peak_n >= firm_n;
  return view->ratio >= c->open_ratio && firm ? SONDE_PRESS_OPEN : SONDE_PRESS_INSUFFICIENT;
}

sonde_compression sonde_press_weigh(const sonde_judge *judge) {
  sonde_compression p = judge->now;
  const sonde_plan *plan = &judge->plan;
  const double reach_m = plan->criteria.reach_m;
  SONDE_ASSERT(judge->map.segment_count > 0);

  // The place it belongs to says which vein it is about.
  const sonde_plan_point *own = p.place < plan->count ? &plan->point[p.place] : NULL;
  uint32_t slot = own ? sonde_segment_slot(&judge->map, own->segment) : 0;
  bool here = own && distance_from(judge, own) <= reach_m;
  p.result = show(judge, slot, here || slot != 0 ? own : NULL, sonde_press_target(judge).firm_n);
  bool hard = p.force_peak_n > sonde_press_target(judge).limit_n;

  // Places within reach, each by its own veins and its own force. A vein that stays open is what
  // the press has found, whatever else closes in the picture.
  double nearest_m = reach_m;
  for (uint32_t i = 0; i < plan->count; ++i) {
    const sonde_plan_point *place = &plan->point[i];
    double distance_m = distance_from(judge, place);
    if (!(distance_m <= reach_m)) continue;
    if (distance_m < nearest_m || p.point == SONDE_PLAN_POINTS) nearest_m = distance_m, p.point = i;
    uint32_t other = sonde_segment_slot(&judge->map, place->segment);
    sonde_press_result result = show(judge, other, place, place->target.firm_n);
    if (hard || !sonde_press_is_valid(result)) continue;
    p.examined |= (uint64_t)1 << i;
    if (result == SONDE_PRESS_OPEN ? p.result != SONDE_PRESS_OPEN : !sonde_press_is_valid(p.result))
      p.result = result, slot = other;
  }
  if (hard) p.result = SONDE_PRESS_TOO_HARD;

  // Where it was, and the figures of the vein that it is about.
  const sonde_vein_view *view = &judge->view[slot], *main = &judge->view[0];
  p.vein_ratio = view->ratio, p.artery_ratio = view->artery_ratio, p.tilt_rad = view->tilt_rad;
  p.z_m = view->start_m.z;
  bool of_main = slot == 0;
  for (uint32_t i = 0; i < plan->count; ++i)
    of_main |=
        (p.examined >> i & 1) && sonde_segment_slot(&judge->map, plan->point[i].segment) == 0;
  if (isfinite(main->start_m.z) && of_main) {
    double along_m = sonde_vein_along(&judge->map, main->start_m.z);
    p.along_m = sonde_vein_course(&judge->map, &judge->first, along_m);
    p.segment = sonde_vein_segment_at(&judge->map, main->start_m.z);
  }
  if (isfinite(p.z_m) && slot != 0) p.segment = slot;
  return p;
}

bool sonde_press_is_astray(const sonde_judge *judge) {
  sonde_compression now = judge->pressing ? sonde_press_weigh(judge) : judge->now;
  return judge->pressing && isfinite(now.z_m) && now.point == SONDE_PLAN_POINTS;
}

static bool end_press(sonde_judge *judge) {
  SONDE_ASSERT(judge->pressing);
  const sonde_compression press = sonde_press_weigh(judge), *p = &press;
  judge->pressing = false;
  judge->trough_n = p->force_peak_n;
  sonde_motion_pressed(&judge->motion);

  // Counts by result and by place.
  judge->result_count[p->result]++;
  if (p->place < judge->plan.count) {
    judge->at_place[p->place]++;
    judge->hard_at_place[p->place] += p->result == SONDE_PRESS_TOO_HARD;
  }

  // A good press covers vein. Every place within reach is examined, not only the nearest one:
  // presses in any order do the same.
  if (sonde_press_is_valid(p->result)) {
    if (p->result == SONDE_PRESS_COMPLETE) judge->closed_sum += 1 - p->vein_ratio;
    if (p->segment != SONDE_SEGMENTS) judge->seen = p->segment;

    // What it showed of each segment: of the one that it is about, and of those of the places that
    // it examined. Places of the main vein speak for the segment that the plane cut.
    sonde_press_result shown[SONDE_SEGMENTS];
    for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k)
      shown[k] = k == p->segment ? p->result : SONDE_PRESS_INSUFFICIENT;
    for (uint32_t i = 0; i < judge->plan.count; ++i) {
      const sonde_plan_point *place = &judge->plan.point[i];
      uint32_t slot = sonde_segment_slot(&judge->map, place->segment);
      if (!(p->examined >> i & 1)) continue;
      judge->done[i] = true;
      uint32_t segment = slot ? slot : sonde_vein_segment_at(&judge->map, judge->view[0].start_m.z);
      if (segment != SONDE_SEGMENTS && segment != p->segment)
        shown[segment] = show(judge, slot, place, place->target.firm_n);
    }
    double cover_m = judge->plan.criteria.reach_m + COVER_EXTRA_M;
    if (isfinite(p->along_m))
      sonde_vein_mark(&judge->first, judge->covered, p->along_m - cover_m, p->along_m + cover_m);
    for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k) {
      judge->open[k] += shown[k] == SONDE_PRESS_OPEN;
      judge->complete[k] += shown[k] == SONDE_PRESS_COMPLETE;
    }
  }

  // The list of presses; what does not fit is counted all the same.
  if (judge->press_count == SONDE_COMPRESSIONS) return true;
  if (judge->press_count == judge->capacity) {
    uint32_t capacity = judge->capacity ? 2 * judge->capacity : 64;
    sonde_compression *more =
        sonde_realloc(judge->press, judge->capacity * sizeof *more, capacity * sizeof *more);
    if (!more) return false;
    judge->press = more;
    judge->capacity = capacity;
  }
  judge->press[judge->press_count++] = *p;
  return true;
}

// ---- snapshots

bool sonde_judge_feed(sonde_judge *judge, const sonde_snapshot *snapshot) {
  SONDE_ASSERT(judge && snapshot);
  const double none = (double)NAN;
  sonde_snapshot now = *snapshot, *s = &now;
  now.time_s += judge->before_s, now.restores += judge->restores_before;
  bool kept = true;
  if (!isfinite(s->time_s) || !isfinite(s->force_normal_n)) return true;
  if (judge->started && !(s->time_s > judge->last.time_s)) return true;
  if (!judge->started) judge->first_s = s->time_s;

  // Time in contact, by force.
  double mean_n = 0.5 * (s->force_normal_n + judge->last.force_normal_n);
  double step_s = s->time_s - judge->last.time_s;
  if (judge->started && mean_n >= CONTACT_N && step_s <= LONGEST_STEP_S) {
    judge->force_s[(uint32_t)fmin(mean_n / FORCE_BIN_N, FORCE_BINS - 1)] += step_s;
    judge->contact_s += step_s;
  }
  judge->force_peak_n = fmax(judge->force_peak_n, s->force_normal_n);
  judge->restores = s->restores;
  sonde_motion_feed(&judge->motion, s->time_s, s->world_from_probe.position);

  // Hysteresis between pressing and letting go.
  if (judge->pressing && s->force_normal_n < fmax(END_N, END_SHARE * judge->now.force_peak_n))
    kept = end_press(judge);
  if (!judge->pressing) {
    judge->trough_n = fmin(judge->trough_n, s->force_normal_n);
    if (s->force_normal_n >= BEGIN_N && s->force_normal_n >= judge->trough_n + RISE_N) {
      judge->pressing = true;
      judge->now = (sonde_compression){
          .start_s = s->time_s - judge->first_s,
          .segment = SONDE_SEGMENTS,
          .point = SONDE_PLAN_POINTS,
          .place = sonde_plan_nearest(&judge->plan, judge->held, s->world_from_probe.position),
          .z_m = none,
          .along_m = none,
          .vein_ratio = none,
          .artery_ratio = none,
          .artery_least = none,
          .tilt_rad = none};
      for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k)
        judge->view[k] = (sonde_vein_view){
            .ratio = none, .artery_ratio = none, .tilt_rad = none, .start_m = {none, none, none}};
    }
  }

  // The press under way: its greatest force, and for each segment the least area of its veins with
  // the artery and the tilt at that moment. fmin() leaves out what is not a number.
  sonde_compression *p = &judge->now;
  bool peak = judge->pressing && s->force_normal_n >= p->force_peak_n;
  if (peak) p->force_peak_n = s->force_normal_n, p->peak_s = s->time_s - judge->first_s;
  if (judge->pressing) {
    p->end_s = s->time_s - judge->first_s;
    p->artery_least = fmin(p->artery_least, s->artery_area_ratio);
  }
  for (uint32_t k = 0; k < judge->map.segment_count; ++k) {
    sonde_vein_view *view = &judge->view[k];
    sonde_vec3 rest_m = vec3(none, none, none);
    if (k > 0 && judge->map.segment[k].vein_count == 0) continue; // main vein: in the first
    view->now = sonde_segment_ratio(&judge->map, k, s, &rest_m);
    if (!judge->pressing) continue;
    bool seen = isfinite(view->now) && isfinite(rest_m.z);
    if (peak) view->seen_at_peak = seen;
    // where the probe was put: under the press tissue moves along the leg
    if (seen && isnan(view->start_m.z)) view->start_m = rest_m;
    if (seen && view->now < (isnan(view->ratio) ? INFINITY : view->ratio)) {
      view->ratio = view->now;
      view->artery_ratio = s->artery_area_ratio;
      view->tilt_rad = s->vein_tilt_rad;
      view->probe_y = q_rotate(s->world_from_probe.rotation, vec3(0, 1, 0));
    }
  }
  judge->last = *s;
  judge->started = true;
  return kept;
}

bool sonde_judge_hold(sonde_judge *judge, uint32_t held, const sonde_vein_map *map) {
  SONDE_ASSERT(judge && map && map->segment_count == judge->first.segment_count);
  bool kept = sonde_judge_finish(judge);
  const double none = (double)NAN;
  judge->map = *map;
  judge->held = held;
  // Time goes on; the way of the probe between the two is no path.
  judge->before_s = judge->started ? judge->last.time_s : 0;
  judge->restores_before = judge->restores;
  judge->motion.started = false;
  judge->last.force_normal_n = judge->trough_n = 0;
  judge->last.artery_area_ratio = none;
  for (uint32_t k = 0; k < SONDE_SEGMENTS; ++k) judge->view[k].now = none;
  return kept;
}

bool sonde_judge_finish(sonde_judge *judge) { return judge->pressing ? end_press(judge) : true; }

const sonde_compression *sonde_judge_compressions(const sonde_judge *judge, uint32_t *count) {
  SONDE_ASSERT(judge && count);
  *count = judge->press_count;
  return judge->press;
}

sonde_judge_now sonde_judge_state(const sonde_judge *judge) {
  static const sonde_press_state OF[] = {SONDE_PRESS_STATE_COMPLETE, SONDE_PRESS_STATE_OPEN,
                                         SONDE_PRESS_STATE_PRESSING, SONDE_PRESS_STATE_TOO_HARD,
                                         SONDE_PRESS_STATE_OFF_AXIS};
  sonde_judge_now now = {SONDE_PRESS_STATE_NONE, (double)NAN, (double)NAN, 0, 0};
  if (!judge->started) return now;
  if (judge->pressing) now.state = OF[sonde_press_weigh(judge).result];
  // The vein of the place at the probe.
  uint32_t place = judge->now.place;
  if (!judge->pressing)
    place = sonde_plan_nearest(&judge->plan, judge->held, judge->last.world_from_probe.position);
  bool placed = place < judge->plan.count;
  uint32_t segment = placed ? judge->plan.point[place].segment : 0;
  now.vein_ratio = judge->view[sonde_segment_slot(&judge->map, segment)].now;
  now.artery_ratio = judge->last.artery_area_ratio;
  now.force_n = judge->last.force_normal_n;
  now.time_s = judge->last.time_s - judge->first_s;
  return now;
}

sonde_segment_status sonde_judge_segment(const sonde_judge *judge, uint32_t segment) {
  SONDE_ASSERT(segment < judge->map.segment_count);
  sonde_segment_status status = {.open = judge->open[segment],
                                 .decision = judge->decision[segment]};
  for (uint32_t i = 0; i < judge->plan.count; ++i) {
    if (judge->plan.point[i].segment != segment) continue;
    status.points++;
    status.done += judge->done[i];
  }
  status.needed = status.points > 0;
  return status;
}

sonde_status sonde_judge_decide(sonde_judge *judge, uint32_t segment, sonde_decision decision,
                                sonde_error *error) {
  if (segment >= judge->map.segment_count || decision >= SONDE_DECISIONS)
    return sonde_fail(error, SONDE_ARGUMENT, "segment %u of %u, decision %d", segment,
                      judge->map.segment_count, (int)decision);
  judge->decision[segment] = decision;
  return SONDE_OK;
}
