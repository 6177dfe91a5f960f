// Figures of an exam so far.
// stretches:  covered shares and the longest gap.
// percentile: of the force over contact time.
#include "trainer/judge.h"

static void stretches(const sonde_judge *judge, sonde_metrics *m) {
  uint32_t wanted = 0, both = 0, covered = 0, run = 0, longest = 0;
  double bins = fmin(judge->map.length_m / JUDGE_BIN_M, JUDGE_BINS);
  for (uint32_t i = 0; i < JUDGE_BINS && i < bins; ++i) {
    wanted += judge->wanted[i];
    covered += judge->covered[i];
    both += judge->wanted[i] && judge->covered[i];
    run = judge->wanted[i] && !judge->covered[i] ? run + 1 : 0;
    if (run > longest) longest = run;
  }
  m->coverage = wanted ? (double)both / wanted : 0;
  m->vein_coverage = fmin(1, covered / bins);
  m->gap_m = longest * JUDGE_BIN_M;
}

static double percentile(const sonde_judge *judge, double share) {
  if (!(judge->contact_s > 0)) return (double)NAN;
  double left = share * judge->contact_s;
  for (uint32_t i = 0; i < FORCE_BINS; ++i) {
    if (judge->force_s[i] >= left && judge->force_s[i] > 0)
      return (i + left / judge->force_s[i]) * FORCE_BIN_N;
    left -= judge->force_s[i];
  }
  return FORCE_BINS * FORCE_BIN_N;
}

sonde_metrics sonde_judge_metrics(const sonde_judge *judge) {
  sonde_metrics m = {
      .points = judge->plan.count, .hints = judge->hints, .restores = judge->restores};
  stretches(judge, &m);
  for (uint32_t i = 0; i < judge->plan.count; ++i) m.points_done += judge->done[i];
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k)
    m.press_count += m.presses[k] = judge->result_count[k];
  uint32_t complete = m.presses[SONDE_PRESS_COMPLETE], open = m.presses[SONDE_PRESS_OPEN];
  SONDE_ASSERT(complete + open <= m.press_count);
  m.completeness = complete ? judge->closed_sum / complete : (double)NAN;
  m.valid_share = m.press_count ? (double)(complete + open) / m.press_count : (double)NAN;
  m.force_peak_n = judge->force_peak_n;
  m.force_p95_n = percentile(judge, 0.95);
  m.time_s = judge->started ? judge->last.time_s - judge->first_s : 0;
  m.contact_s = judge->contact_s;
  m.path_m = judge->motion.path_m;
  m.smoothness = sonde_motion_smoothness(&judge->motion);
  return m;
}
