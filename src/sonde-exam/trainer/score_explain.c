// Where points went, in words: every part of the score that is not full names segment, place, press
// and reason.
// say:           adds to a text, after "; " when something is there already.
// lost_findings, lost_coverage, lost_technique, lost_force, lost_time: one part each.
#include "trainer/judge.h"

#include <stdarg.h>
#include <string.h>

// Rounding leaves less than this of a lost point.
static const double NOTHING = 1e-9;
// Of a list of places or presses this many are named.
enum { NAMED = 4 };

typedef struct account {
  const sonde_score *score;
  const sonde_plan *plan;
  const sonde_compression *press;
  uint32_t count;
} account;

static void say(char *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(char *text, const char *format, ...) {
  size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  if (used && used < SONDE_SCORE_WORDS - 3) used += (size_t)snprintf(text + used, 3, "; ");
  vsnprintf(text + used, SONDE_SCORE_WORDS - used, format, arguments);
  va_end(arguments);
}

static const char *title_of(const account *a, uint32_t place) {
  return place < a->plan->count ? a->plan->point[place].title : "vein not in view";
}

static void lost_findings(const account *a, char *text) {
  for (uint32_t i = 0; i < a->score->segment_count; ++i) {
    const sonde_segment_verdict *v = &a->score->segment[i];
    const char *title = sonde_segment_title(v->name);
    if (!v->needed) continue;
    if (v->decision == SONDE_DECISION_NONE)
      say(text, "%s: no finding", title);
    else if (!v->correct)
      say(text, "%s: wrong finding", title);
    else if (!v->supported)
      say(text, "%s: no press shows the finding", title);
    else if (v->decision == SONDE_DECISION_COMPRESSIBLE && v->done < v->points)
      say(text, "%s: %u of %u places pressed well", title, v->done, v->points);
  }
}

// The places without a good press.
static uint32_t places_missed(const account *a, bool missed[SONDE_PLAN_POINTS]) {
  uint32_t count = 0;
  double reach_m = a->plan->criteria.reach_m;
  for (uint32_t i = 0; i < a->plan->count; ++i) {
    missed[i] = true;
    for (uint32_t k = 0; k < a->count; ++k)
      if (sonde_press_is_valid(a->press[k].result) &&
          fabs(a->press[k].along_m - a->plan->point[i].at.along_m) <= reach_m)
        missed[i] = false;
    count += missed[i];
  }
  return count;
}

static void name_missed(const account *a, char *text) {
  bool missed[SONDE_PLAN_POINTS];
  uint32_t left = places_missed(a, missed), said = 0;
  for (uint32_t i = 0; i < a->plan->count && said < NAMED; ++i)
    if (missed[i]) say(text, "%s: not examined", title_of(a, i)), ++said;
  if (left > said) say(text, "and %u more places not examined", left - said);
}

static void lost_coverage(const account *a, char *text) {
  name_missed(a, text);
  say(text, "longest stretch without a good press: %.0f mm", 1e3 * a->score->metrics.gap_m);
}

static void lost_technique(const account *a, char *text) {
  static const char *const WHY[] = {[SONDE_PRESS_INSUFFICIENT] = "not far enough",
                                    [SONDE_PRESS_TOO_HARD] = "too hard",
                                    [SONDE_PRESS_OFF_AXIS] = "not straight across the vein"};
  const sonde_metrics *m = &a->score->metrics;
  if (m->press_count == 0) say(text, "no press");
  for (int k = SONDE_PRESS_INSUFFICIENT; k < SONDE_PRESS_RESULTS; ++k) {
    if (m->presses[k] == 0) continue;
    say(text, "%u of %u presses %s", m->presses[k], m->press_count, WHY[k]);
    uint32_t before = SONDE_PLAN_POINTS + 1, said = 0;
    for (uint32_t i = 0; i < a->count && said < NAMED; ++i) {
      if (a->press[i].result != (sonde_press_result)k || a->press[i].place == before) continue;
      before = a->press[i].place;
      size_t used = strlen(text);
      snprintf(text + used, SONDE_SCORE_WORDS - used, "%s%s", said++ ? ", " : ": ",
               title_of(a, before));
    }
  }
}

// Presses above the limit that lie in a part of the list which was not kept are counted by the
// metrics all the same.
static void lost_force(const account *a, char *text) {
  uint32_t said = 0, hard = a->score->metrics.presses[SONDE_PRESS_TOO_HARD];
  for (uint32_t i = 0; i < a->count && said < NAMED; ++i) {
    const sonde_compression *p = &a->press[i];
    if (p->result != SONDE_PRESS_TOO_HARD || p->place >= a->plan->count) continue;
    say(text, "%s: %.1f N, limit %.0f N", title_of(a, p->place), p->force_peak_n,
        a->plan->point[p->place].target.limit_n);
    ++said;
  }
  if (hard > said) say(text, "and %u more presses above the limit", hard - said);
  name_missed(a, text);
}

static void lost_time(const account *a, char *text) {
  if (a->score->metrics.time_s > SONDE_SCORE_TIME_S)
    say(text, "%.0f s, full points up to %.0f s", a->score->metrics.time_s, SONDE_SCORE_TIME_S);
  if (a->score->metrics.coverage < 1)
    say(text, "counted for the %.0f %% of the planned vein that was examined",
        100 * a->score->metrics.coverage);
}

void sonde_score_explain(const sonde_score *score, const sonde_plan *plan,
                         const sonde_compression *presses, uint32_t count,
                         sonde_score_part part[SONDE_SCORE_PARTS]) {
  static void (*const LOST[])(const account *, char *) = {lost_findings, lost_coverage,
                                                          lost_technique, lost_force, lost_time};
  _Static_assert(SONDE_COUNT_OF(LOST) == SONDE_SCORE_PARTS, "a function per part");
  SONDE_ASSERT(score && plan && part && (presses || count == 0));
  account a = {score, plan, presses, count};
  uint32_t k = 0;
#define SONDE_SCORE_PART(name, weight, title, text)                                                \
  part[k++] = (sonde_score_part){#name, title, text, (weight)*score->name, weight, ""};
  SONDE_SCORE_LIST(SONDE_SCORE_PART)
#undef SONDE_SCORE_PART
  SONDE_ASSERT(k == SONDE_SCORE_PARTS);
  for (k = 0; k < SONDE_SCORE_PARTS; ++k)
    if (part[k].points < part[k].of - NOTHING) LOST[k](&a, part[k].lost);
}
