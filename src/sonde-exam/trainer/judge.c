// The judge: from snapshots to compressions.
// want:            the stretch of vein that the plan examines.
// begin, look:     a press starts; one snapshot of it.
// sonde_press_classify: complete, open, insufficient, too hard, off axis.
// locate, cover, keep: what a finished press has examined.
// watch:           hysteresis between pressing and letting go.
// spend:           contact time by force.
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

static uint32_t bin_of(double along_m) {
  double bin = floor(along_m / JUDGE_BIN_M);
  return (uint32_t)clamp(bin, 0, JUDGE_BINS - 1);
}

static void mark(const sonde_judge *judge, bool *bins, double from_m, double to_m) {
  double end_m = fmin(judge->map.length_m, JUDGE_BIN_M * JUDGE_BINS);
  if (!(to_m > 0 && from_m < end_m)) return;
  // a bin counts when its middle lies within
  for (uint32_t i = bin_of(from_m); i <= bin_of(fmin(to_m, end_m)); ++i) {
    double middle = ((double)i + 0.5) * JUDGE_BIN_M;
    if (middle >= from_m && middle <= to_m && middle <= end_m) bins[i] = true;
  }
}

static void want(sonde_judge *judge) {
  double reach = judge->plan.criteria.reach_m;
  for (uint32_t i = 0; i < judge->plan.count; ++i) {
    double at = judge->plan.point[i].at.along_m;
    mark(judge, judge->wanted, at - reach, at + reach);
  }
}

sonde_status sonde_judge_create(const sonde_vein_map *map, const sonde_plan *plan,
                                sonde_judge **out, sonde_error *error) {
  SONDE_ASSERT(map && plan && out);
  sonde_judge *judge = *out = SONDE_NEW(sonde_judge, 1);
  if (!judge) return sonde_fail_memory(error);
  judge->map = *map;
  judge->plan = *plan;
  judge->hint_s = -INFINITY;
  judge->seen = SONDE_SEGMENTS;
  want(judge);
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

static void begin(sonde_judge *judge, const sonde_snapshot *s) {
  judge->pressing = true;
  judge->seen_at_peak = false;
  judge->now = (sonde_compression){.start_s = s->time_s - judge->first_s,
                                   .segment = SONDE_SEGMENTS,
                                   .point = SONDE_PLAN_POINTS,
                                   .z_m = (double)NAN,
                                   .along_m = (double)NAN,
                                   .vein_ratio = (double)NAN,
                                   .artery_ratio = (double)NAN,
                                   .artery_least = (double)NAN,
                                   .tilt_rad = (double)NAN};
  settle_place(judge, s->world_from_probe.position.z);
}

// fmin() leaves out what is not a number.
static void look(sonde_judge *judge, const sonde_snapshot *s) {
  sonde_compression *p = &judge->now;
  bool seen = isfinite(s->vein_area_ratio) && isfinite(s->vein_rest_m.z);
  if (s->force_normal_n >= p->force_peak_n) {
    p->force_peak_n = s->force_normal_n;
    p->peak_s = s->time_s - judge->first_s;
    judge->seen_at_peak = seen;
  }
  p->end_s = s->time_s - judge->first_s;
  p->artery_least = fmin(p->artery_least, s->artery_area_ratio);
  // where the probe was put: under the press tissue moves along the leg
  if (seen && isnan(p->z_m)) {
    p->z_m = s->vein_rest_m.z;
    settle_place(judge, p->z_m);
  }
  if (!seen || s->vein_area_ratio >= (isnan(p->vein_ratio) ? INFINITY : p->vein_ratio)) return;
  p->vein_ratio = s->vein_area_ratio;
  p->artery_ratio = s->artery_area_ratio;
  p->tilt_rad = s->vein_tilt_rad;
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

// Every place within reach is examined, not only the nearest one: presses in any order do the same.
static void cover(sonde_judge *judge, const sonde_compression *p) {
  judge->result_count[p->result]++;
  if (p->place < judge->plan.count) {
    judge->at_place[p->place]++;
    judge->hard_at_place[p->place] += p->result == SONDE_PRESS_TOO_HARD;
  }
  if (!sonde_press_is_valid(p->result) || !isfinite(p->along_m)) return;
  double reach = judge->plan.criteria.reach_m;
  mark(judge, judge->covered, p->along_m - reach - COVER_EXTRA_M,
       p->along_m + reach + COVER_EXTRA_M);
  for (uint32_t i = 0; i < judge->plan.count; ++i)
    judge->done[i] |= fabs(judge->plan.point[i].at.along_m - p->along_m) <= reach;
  if (p->result == SONDE_PRESS_COMPLETE) judge->closed_sum += 1 - p->vein_ratio;
  if (p->segment == SONDE_SEGMENTS) return;
  judge->seen = p->segment;
  if (p->result == SONDE_PRESS_OPEN)
    judge->open[p->segment]++;
  else
    judge->complete[p->segment]++;
}

static bool keep(sonde_judge *judge, const sonde_compression *p) {
  if (judge->press_count == SONDE_COMPRESSIONS) return true; // still counted
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

static bool end(sonde_judge *judge) {
  judge->now.result = sonde_press_classify(judge);
  locate(judge, &judge->now);
  cover(judge, &judge->now);
  judge->pressing = false;
  judge->trough_n = judge->now.force_peak_n;
  sonde_motion_pressed(&judge->motion);
  return keep(judge, &judge->now);
}

// ---- snapshots

static bool watch(sonde_judge *judge, const sonde_snapshot *s) {
  double force = s->force_normal_n;
  bool kept = true;
  if (judge->pressing && force < fmax(END_N, END_SHARE * judge->now.force_peak_n))
    kept = end(judge);
  if (!judge->pressing) {
    judge->trough_n = fmin(judge->trough_n, force);
    if (force >= BEGIN_N && force >= judge->trough_n + RISE_N) begin(judge, s);
  }
  if (judge->pressing) look(judge, s);
  return kept;
}

static void spend(sonde_judge *judge, const sonde_snapshot *s) {
  double force = 0.5 * (s->force_normal_n + judge->last.force_normal_n);
  double step_s = s->time_s - judge->last.time_s;
  if (!(force >= CONTACT_N) || step_s > LONGEST_STEP_S) return;
  double bin = fmin(force / FORCE_BIN_N, FORCE_BINS - 1);
  judge->force_s[(uint32_t)bin] += step_s;
  judge->contact_s += step_s;
}

bool sonde_judge_feed(sonde_judge *judge, const sonde_snapshot *snapshot) {
  SONDE_ASSERT(judge && snapshot);
  sonde_snapshot all = *snapshot;
  const sonde_snapshot *s = &all;
  all.vein_area_ratio = sonde_vein_ratio(snapshot);
  if (!isfinite(s->time_s) || !isfinite(s->force_normal_n)) return true;
  if (judge->started && !(s->time_s > judge->last.time_s)) return true;
  if (judge->started)
    spend(judge, s);
  else
    judge->first_s = s->time_s;
  judge->force_peak_n = fmax(judge->force_peak_n, s->force_normal_n);
  judge->restores = s->restores;
  sonde_motion_feed(&judge->motion, s->time_s, s->world_from_probe.position);
  bool kept = watch(judge, s);
  judge->last = *s;
  judge->started = true;
  return kept;
}

bool sonde_judge_finish(sonde_judge *judge) { return judge->pressing ? end(judge) : true; }

const sonde_compression *sonde_judge_compressions(const sonde_judge *judge, uint32_t *count) {
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
