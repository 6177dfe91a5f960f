// Where points went, in words: every part of the score that is not full names segment, place, press
// and reason.
#include "trainer/judge.h"

#include <stdarg.h>
#include <string.h>

// Rounding leaves less than this of a lost point.
static const double NOTHING = 1e-9;
// Of a list of places or presses this many are named.
enum { NAMED = 4 };

// Adds to a text, after "; " when something is there already.
static void say(char *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(char *text, const char *format, ...) {
  size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  if (used && used < SONDE_SCORE_WORDS - 3) used += (size_t)snprintf(text + used, 3, "; ");
  vsnprintf(text + used, SONDE_SCORE_WORDS - used, format, arguments);
  va_end(arguments);
}

static const char *title_of(const sonde_plan *plan, uint32_t place) {
  return place < plan->count ? plan->point[place].title : "vein not in view";
}

void sonde_score_explain(const sonde_score *score, const sonde_plan *plan,
                         const sonde_compression *presses, uint32_t count,
                         sonde_score_part part[SONDE_SCORE_PARTS]) {
  SONDE_ASSERT(score && plan && part && (presses || count == 0));
  enum { FINDINGS, COVERAGE, TECHNIQUE, FORCE, TIME };
  _Static_assert(TIME + 1 == SONDE_SCORE_PARTS, "a paragraph per part");
  const sonde_metrics *m = &score->metrics;
  static const char *const WHY[] = {[SONDE_PRESS_INSUFFICIENT] = "not far enough",
                                    [SONDE_PRESS_TOO_HARD] = "too hard",
                                    [SONDE_PRESS_OFF_AXIS] = "not straight across the vein"};
  uint32_t k = 0;
#define SONDE_SCORE_PART(name, weight, title, text)                                                \
  part[k++] = (sonde_score_part){#name, title, text, (weight)*score->name, weight, ""};
  SONDE_SCORE_LIST(SONDE_SCORE_PART)
#undef SONDE_SCORE_PART
  SONDE_ASSERT(k == SONDE_SCORE_PARTS);
  for (k = 0; k < SONDE_SCORE_PARTS; ++k) {
    char *text = part[k].lost;
    if (part[k].points >= part[k].of - NOTHING) continue;
    for (uint32_t i = 0; k == FINDINGS && i < score->segment_count; ++i) {
      const sonde_segment_verdict *v = &score->segment[i];
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
    if (k == TECHNIQUE && m->press_count == 0) say(text, "no press");
    for (int r = SONDE_PRESS_INSUFFICIENT; k == TECHNIQUE && r < SONDE_PRESS_RESULTS; ++r) {
      if (m->presses[r] == 0) continue;
      say(text, "%u of %u presses %s", m->presses[r], m->press_count, WHY[r]);
      uint32_t before = SONDE_PLAN_POINTS + 1, named = 0;
      for (uint32_t i = 0; i < count && named < NAMED; ++i) {
        if (presses[i].result != (sonde_press_result)r || presses[i].place == before) continue;
        before = presses[i].place;
        size_t used = strlen(text);
        snprintf(text + used, SONDE_SCORE_WORDS - used, "%s%s", named++ ? ", " : ": ",
                 title_of(plan, before));
      }
    }

    // Presses above the limit that lie in a part of the list which was not kept are counted by the
    // metrics all the same.
    uint32_t said = 0, hard = m->presses[SONDE_PRESS_TOO_HARD];
    for (uint32_t i = 0; k == FORCE && i < count && said < NAMED; ++i) {
      const sonde_compression *p = &presses[i];
      if (p->result != SONDE_PRESS_TOO_HARD || p->place >= plan->count) continue;
      say(text, "%s: %.1f N, limit %.0f N", title_of(plan, p->place), p->force_peak_n,
          plan->point[p->place].target.limit_n);
      ++said;
    }
    if (k == FORCE && hard > said) say(text, "and %u more presses above the limit", hard - said);

    // The places without a good press.
    uint32_t missed = 0;
    for (uint32_t i = 0; (k == COVERAGE || k == FORCE) && i < plan->count; ++i)
      if (!sonde_place_is_done(plan, i, presses, count) && ++missed <= NAMED)
        say(text, "%s: not examined", title_of(plan, i));
    if (missed > NAMED) say(text, "and %u more places not examined", missed - NAMED);
    if (k == COVERAGE) say(text, "longest stretch without a good press: %.0f mm", 1e3 * m->gap_m);
    if (k == TIME && m->time_s > SONDE_SCORE_TIME_S)
      say(text, "%.0f s, full points up to %.0f s", m->time_s, SONDE_SCORE_TIME_S);
    if (k == TIME && m->coverage < 1)
      say(text, "counted for the %.0f %% of the planned vein that was examined", 100 * m->coverage);
  }
}
