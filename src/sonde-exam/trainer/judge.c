// The judge: from snapshots to compressions, and what they examine.
#include "trainer/judge.h"

#include <string.h>

// A press begins above this force, when it has risen by this much since the last; it ends below a
// share of its peak.
static const double BEGIN_N = 3, RISE_N = 2, END_SHARE = 0.5, END_N = 1.5;
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
    if (sonde_press_is_valid(presses[i].result) &&
        fabs(presses[i].along_m - plan->point[place].at.along_m) <= plan->criteria.reach_m)
      return true;
  return false;
}

// ---- a judge

sonde_status sonde_judge_create(const sonde_vein_map *map, const sonde_plan *plan,
                                sonde_judge **out, sonde_error *error) {
  SONDE_ASSERT(map && plan && out && plan->count <= SONDE_PLAN_POINTS);
  sonde_judge *judge = *out = SONDE_NEW(sonde_judge, 1);
  if (!judge) return sonde_fail_memory(error);
  judge->map = *map;
  judge->plan = *plan;
  judge->hint_s = -INFINITY;
  judge->seen = SONDE_SEGMENTS;
  for (uint32_t i = 0; i < plan->count; ++i) {
    double at_m = plan->point[i].at.along_m, reach_m = plan->criteria.reach_m;
    sonde_vein_mark(map, judge->wanted, at_m - reach_m, at_m + reach_m);
  }
  return SONDE_OK;
}

void sonde_judge_destroy(sonde_judge *judge) {
  if (!judge) return;
  sonde_free(judge->press);
  sonde_free(judge);
}

// ---- one press

// The place nearest to the vein in view, to the probe when none is: its force applies.
static void settle_place(sonde_judge *judge, double z_m) {
  judge->now.place = sonde_plan_nearest(&judge->plan, sonde_vein_along(&judge->map, z_m));
}

sonde_force_target sonde_press_target(const sonde_judge *judge) {
  const double none = (double)NAN;
  uint32_t place = judge->now.place;
  if (place >= judge->plan.count) return (sonde_force_target){none, none, none};
  return judge->plan.point[place].target;
}

// Comparisons with NaN are false: without a force target nothing is too hard, and nothing firm.
sonde_press_result sonde_press_classify(const sonde_judge *judge) {
  const sonde_compression *p = &judge->now;
  const sonde_criteria *c = &judge->plan.criteria;
  sonde_force_target target = sonde_press_target(judge);
  if (p->force_peak_n > target.limit_n) return SONDE_PRESS_TOO_HARD;
  if (!judge->seen_at_peak || !(p->tilt_rad <= c->tilt_rad)) return SONDE_PRESS_OFF_AXIS;
  if (p->vein_ratio <= c->closed_ratio) return SONDE_PRESS_COMPLETE;
  if (p->vein_ratio >= c->open_ratio && p->force_peak_n >= target.firm_n) return SONDE_PRESS_OPEN;
  return SONDE_PRESS_INSUFFICIENT;
}

static void locate(const sonde_judge *judge, sonde_compression *p) {
  if (!isfinite(p->z_m)) return;
  p->along_m = sonde_vein_along(&judge->map, p->z_m);
  p->segment = sonde_vein_segment_at(&judge->map, p->z_m);
  double nearest = judge->plan.criteria.reach_m;
  for (uint32_t i = 0; i < judge->plan.count; ++i) {
    double distance = fabs(judge->plan.point[i].at.along_m - p->along_m);
    if (distance <= nearest) nearest = distance, p->point = i;
  }
}

bool sonde_press_is_astray(const sonde_judge *judge) {
  sonde_compression now = judge->now;
  if (!judge->pressing || !isfinite(now.z_m)) return false;
  locate(judge, &now);
  return now.point == SONDE_PLAN_POINTS;
}

static bool end_press(sonde_judge *judge) {
  sonde_compression *p = &judge->now;
  SONDE_ASSERT(judge->pressing);
  p->result = sonde_press_classify(judge);
  locate(judge, p);
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
  if (sonde_press_is_valid(p->result) && isfinite(p->along_m)) {
    double reach_m = judge->plan.criteria.reach_m, cover_m = reach_m + COVER_EXTRA_M;
    sonde_vein_mark(&judge->map, judge->covered, p->along_m - cover_m, p->along_m + cover_m);
    for (uint32_t i = 0; i < judge->plan.count; ++i)
      judge->done[i] |= fabs(judge->plan.point[i].at.along_m - p->along_m) <= reach_m;
    if (p->result == SONDE_PRESS_COMPLETE) judge->closed_sum += 1 - p->vein_ratio;
    if (p->segment != SONDE_SEGMENTS) {
      judge->seen = p->segment;
      judge->open[p->segment] += p->result == SONDE_PRESS_OPEN;
      judge->complete[p->segment] += p->result == SONDE_PRESS_COMPLETE;
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
  sonde_snapshot s = *snapshot;
  bool kept = true;
  s.vein_area_ratio = sonde_vein_ratio(snapshot);
  if (!isfinite(s.time_s) || !isfinite(s.force_normal_n)) return true;
  if (judge->started && !(s.time_s > judge->last.time_s)) return true;
  if (!judge->started) judge->first_s = s.time_s;

  // Time in contact, by force.
  double mean_n = 0.5 * (s.force_normal_n + judge->last.force_normal_n);
  double step_s = s.time_s - judge->last.time_s;
  if (judge->started && mean_n >= CONTACT_N && step_s <= LONGEST_STEP_S) {
    judge->force_s[(uint32_t)fmin(mean_n / FORCE_BIN_N, FORCE_BINS - 1)] += step_s;
    judge->contact_s += step_s;
  }
  judge->force_peak_n = fmax(judge->force_peak_n, s.force_normal_n);
  judge->restores = s.restores;
  sonde_motion_feed(&judge->motion, s.time_s, s.world_from_probe.position);

  // Hysteresis between pressing and letting go.
  if (judge->pressing && s.force_normal_n < fmax(END_N, END_SHARE * judge->now.force_peak_n))
    kept = end_press(judge);
  if (!judge->pressing) {
    judge->trough_n = fmin(judge->trough_n, s.force_normal_n);
    if (s.force_normal_n >= BEGIN_N && s.force_normal_n >= judge->trough_n + RISE_N) {
      judge->pressing = true;
      judge->seen_at_peak = false;
      judge->now = (sonde_compression){.start_s = s.time_s - judge->first_s,
                                       .segment = SONDE_SEGMENTS,
                                       .point = SONDE_PLAN_POINTS,
                                       .z_m = none,
                                       .along_m = none,
                                       .vein_ratio = none,
                                       .artery_ratio = none,
                                       .artery_least = none,
                                       .tilt_rad = none};
      settle_place(judge, s.world_from_probe.position.z);
    }
  }

  // The press under way: its greatest force, and the least area of the vein with the artery and the
  // tilt at that moment. fmin() leaves out what is not a number.
  if (judge->pressing) {
    sonde_compression *p = &judge->now;
    bool seen = isfinite(s.vein_area_ratio) && isfinite(s.vein_rest_m.z);
    if (s.force_normal_n >= p->force_peak_n) {
      p->force_peak_n = s.force_normal_n;
      p->peak_s = s.time_s - judge->first_s;
      judge->seen_at_peak = seen;
    }
    p->end_s = s.time_s - judge->first_s;
    p->artery_least = fmin(p->artery_least, s.artery_area_ratio);
    // where the probe was put: under the press tissue moves along the leg
    if (seen && isnan(p->z_m)) {
      p->z_m = s.vein_rest_m.z;
      settle_place(judge, p->z_m);
    }
    if (seen && s.vein_area_ratio < (isnan(p->vein_ratio) ? INFINITY : p->vein_ratio)) {
      p->vein_ratio = s.vein_area_ratio;
      p->artery_ratio = s.artery_area_ratio;
      p->tilt_rad = s.vein_tilt_rad;
    }
  }
  judge->last = s;
  judge->started = true;
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
  if (judge->pressing) now.state = OF[sonde_press_classify(judge)];
  now.vein_ratio = judge->last.vein_area_ratio;
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
