// Figures of an exam so far.
#include "trainer/judge.h"

sonde_metrics sonde_judge_metrics(const sonde_judge *judge) {
  SONDE_ASSERT(judge && judge->plan.count <= SONDE_PLAN_POINTS);
  sonde_metrics m = {
      .points = judge->plan.count, .hints = judge->hints, .restores = judge->restores};

  // Shares of the vein that good presses cover, and the longest stretch that none does.
  uint32_t wanted = 0, both = 0, covered = 0, steps = sonde_vein_steps(&judge->first);
  for (uint32_t i = 0; i < steps; ++i) {
    wanted += judge->wanted[i];
    covered += judge->covered[i];
    both += judge->wanted[i] && judge->covered[i];
  }
  sonde_vein_run gap = sonde_vein_longest_gap(judge->wanted, judge->covered, steps);
  // A place on another vein is as much of it as a place on the main vein is of that one.
  double missed_m = 0;
  for (uint32_t i = 0; i < judge->plan.count; ++i) {
    const double stretch_m = 2 * judge->plan.criteria.reach_m;
    uint32_t stretch = (uint32_t)lround(stretch_m / JUDGE_BIN_M);
    if (sonde_segment_slot(&judge->map, judge->plan.point[i].segment) == 0) continue;
    wanted += stretch;
    both += judge->done[i] ? stretch : 0;
    if (!judge->done[i]) missed_m = stretch_m;
  }
  m.coverage = wanted ? (double)both / wanted : 0;
  m.vein_coverage = fmin(1, covered / fmin(judge->first.length_m / JUDGE_BIN_M, JUDGE_BINS));
  m.gap_m = fmax(missed_m, (gap.to - gap.from) * JUDGE_BIN_M);

  // Places and presses.
  for (uint32_t i = 0; i < judge->plan.count; ++i) m.points_done += judge->done[i];
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k)
    m.press_count += m.presses[k] = judge->result_count[k];
  uint32_t complete = m.presses[SONDE_PRESS_COMPLETE], open = m.presses[SONDE_PRESS_OPEN];
  SONDE_ASSERT(complete + open <= m.press_count);
  m.completeness = complete ? judge->closed_sum / complete : (double)NAN;
  m.valid_share = m.press_count ? (double)(complete + open) / m.press_count : (double)NAN;

  // The force below which 95 % of the contact time lies.
  double rest_s = 0.95 * judge->contact_s;
  m.force_p95_n = judge->contact_s > 0 ? FORCE_BINS * FORCE_BIN_N : (double)NAN;
  for (uint32_t i = 0; i < FORCE_BINS && judge->contact_s > 0; ++i) {
    if (judge->force_s[i] >= rest_s && judge->force_s[i] > 0) {
      m.force_p95_n = (i + rest_s / judge->force_s[i]) * FORCE_BIN_N;
      break;
    }
    rest_s -= judge->force_s[i];
  }
  m.force_peak_n = judge->force_peak_n;
  m.time_s = judge->started ? judge->last.time_s - judge->first_s : 0;
  m.contact_s = judge->contact_s;
  m.path_m = judge->motion.path_m;
  m.smoothness = sonde_motion_smoothness(&judge->motion);
  return m;
}
