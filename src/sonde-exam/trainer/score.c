// The score: what was found against what is there. Formulas: docs/trainer_theory.md, version
// SONDE_SCORE_VERSION.
#include "trainer/judge.h"

#include <string.h>

// A wrong or missing diagnosis scores at most this, below what passes.
static const double CAP = 49, PASS = 70;
static const double TIME_NONE_S = 1200;

// Findings: the mean over the segments of the plan. One open place shows a clot; that there is none
// takes every place.
static double share_of_findings(const sonde_score *score) {
  double sum = 0;
  uint32_t needed = 0;
  for (uint32_t i = 0; i < score->segment_count; ++i) {
    const sonde_segment_verdict *v = &score->segment[i];
    if (!v->needed) continue;
    needed++;
    SONDE_ASSERT(v->points > 0 && v->done <= v->points);
    if (!v->correct || !v->supported) continue;
    sum += v->decision == SONDE_DECISION_CLOT ? 1 : (double)v->done / v->points;
  }
  return needed ? sum / needed : 0;
}

void sonde_judge_score(const sonde_judge *judge, const sonde_case *truth, sonde_score *score) {
  SONDE_ASSERT(judge && truth && score);
  *score = (sonde_score){.metrics = sonde_judge_metrics(judge)};
  const sonde_metrics *m = &score->metrics;

  // Right and supported decisions, segment by segment.
  score->segment_count = judge->first.segment_count;
  for (uint32_t i = 0; i < score->segment_count; ++i) {
    sonde_segment_status status = sonde_judge_segment(judge, i);
    sonde_segment_verdict *v = &score->segment[i];
    const sonde_exam_segment *segment = &judge->first.segment[i];
    *v = (sonde_segment_verdict){.needed = status.needed,
                                 .decision = status.decision,
                                 .truth = sonde_case_truth(truth, segment->name),
                                 .kind = segment->kind,
                                 .from_m = segment->from_m,
                                 .to_m = segment->to_m,
                                 .points = status.points,
                                 .done = status.done};
    memcpy(v->name, segment->name, sizeof v->name);
    v->correct = v->decision != SONDE_DECISION_NONE && v->decision == v->truth;
    v->supported = v->decision == SONDE_DECISION_CLOT ? judge->open[i] > 0 : judge->complete[i] > 0;
  }

  // The diagnosis: one deep segment with a clot makes a thrombosis, its absence takes all segments
  // of the plan. A clot below the knee counts where the protocol asks for the calf.
  bool all = true, calf = false;
  for (uint32_t i = 0; i < score->segment_count; ++i)
    calf |= score->segment[i].kind == SONDE_SEGMENT_CALF && score->segment[i].needed;
  for (uint32_t i = 0; i < score->segment_count; ++i) {
    const sonde_segment_verdict *v = &score->segment[i];
    bool called = v->decision == SONDE_DECISION_CLOT;
    bool deep = v->kind != SONDE_SEGMENT_SUPERFICIAL;
    score->called_thrombosis |= called && deep;
    score->thrombosis |=
        v->truth == SONDE_DECISION_CLOT && deep && (calf || v->kind != SONDE_SEGMENT_CALF);
    if (v->needed) all &= v->decision == SONDE_DECISION_COMPRESSIBLE || (called && !deep);
  }
  score->answered = score->called_thrombosis || all;
  score->correct = score->answered && score->called_thrombosis == score->thrombosis;

  // The parts, each 0 to 1, and their weighted sum, which a wrong diagnosis caps.
  double unused_s = TIME_NONE_S - m->time_s;
  score->decisions = share_of_findings(score);
  score->coverage = m->coverage;
  score->technique = m->press_count ? m->valid_share : 0;
  // Force: what restraint earns counts only for the places that were examined, so that doing
  // nothing earns nothing.
  double sum = 0;
  for (uint32_t i = 0; i < judge->plan.count; ++i) {
    double presses = fmax(1, judge->at_place[i]);
    SONDE_ASSERT(judge->hard_at_place[i] <= judge->at_place[i]);
    if (judge->done[i]) sum += 1 - judge->hard_at_place[i] / presses;
  }
  score->force = judge->plan.count ? sum / judge->plan.count : 0;
  score->economy = m->coverage * clamp(unused_s / (TIME_NONE_S - SONDE_SCORE_TIME_S), 0, 1);
#define SONDE_SCORE_ADD(name, weight, title, text) score->score += (weight)*score->name;
  SONDE_SCORE_LIST(SONDE_SCORE_ADD)
#undef SONDE_SCORE_ADD
  SONDE_ASSERT(score->score >= 0 && score->score <= 100 + 1e-9);
  if (!score->correct) score->score = fmin(score->score, CAP);
  score->passed = score->correct && score->score >= PASS;

  // The result in one sentence.
  snprintf(score->truth, sizeof score->truth, "%s", truth->diagnosis);
  snprintf(score->asked, sizeof score->asked, "%s",
           score->called_thrombosis ? "Deep vein thrombosis"
           : score->answered        ? "No deep vein thrombosis where examined"
                                    : "No diagnosis: not every segment was decided");
  const char *verdict =
      score->passed              ? "Passed"
      : score->correct           ? "Right diagnosis, but the examination does not support it"
      : !score->answered         ? "Not passed: no diagnosis"
      : score->called_thrombosis ? "Not passed: a clot was called that is not there"
                                 : "Not passed: a clot was missed";
  snprintf(score->summary, sizeof score->summary,
           "%s. %.0f of 100 points; %u of %u places examined, %u of %u compressions valid.",
           verdict, score->score, m->points_done, m->points,
           m->presses[SONDE_PRESS_COMPLETE] + m->presses[SONDE_PRESS_OPEN], m->press_count);
}

// ---- series

void sonde_series_add(sonde_series *series, const sonde_score *score) {
  series->exams++;
  series->passed += score->passed;
  series->score_sum += score->score;
  series->unanswered += !score->answered;
  if (score->thrombosis) {
    if (score->called_thrombosis)
      series->true_positive++;
    else
      series->false_negative++;
  } else if (score->called_thrombosis) {
    series->false_positive++;
  } else if (score->answered) {
    series->true_negative++;
  }
}

static double share(uint32_t part, uint32_t rest) {
  return part + rest > 0 ? (double)part / (part + rest) : (double)NAN;
}

double sonde_series_sensitivity(const sonde_series *series) {
  return share(series->true_positive, series->false_negative);
}

double sonde_series_specificity(const sonde_series *series) {
  return share(series->true_negative, series->false_positive);
}
