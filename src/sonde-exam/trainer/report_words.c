// What was asked and answered, what went well and what to work on, in words.
//
// card             one answer with its heading
// add              opens the list at its first item
// presses_in       presses of one result in a segment
// why_missed       what the presses showed where a clot was missed
// work_clot, work_segments, work_places, work_presses  what to do differently
// well             what was done as it should be
#include "trainer/report.h"

#include <stdarg.h>
#include <string.h>

// ---- the question -------------------------------------------------------------------------------

static void card(sonde_text *out, const char *look, const char *title, const char *foreign,
                 const char *fallback) {
  sonde_text_format(out, "<div class=\"card%s\"><h3>%s</h3><p>", look, title);
  sonde_text_escape(out, foreign && foreign[0] ? foreign : fallback);
  sonde_text_put(out, "</p></div>\n");
}

void sonde_debrief_question(sonde_debrief *page) {
  const sonde_exam_report *r = page->in;
  const sonde_score *score = r->score;
  sonde_text *out = &page->out;
  sonde_debrief_section(page, "question", "The patient and the answer");
  if (r->patient->history[0]) {
    sonde_text_put(out, "<p class=\"text\">");
    sonde_text_escape(out, r->patient->history);
    sonde_text_put(out, "</p>\n");
  }
  if (r->protocol && r->protocol->text[0]) {
    sonde_text_put(out, "<p class=\"quiet\">");
    sonde_text_escape(out, r->protocol->title);
    sonde_text_put(out, ": ");
    sonde_text_escape(out, r->protocol->text);
    sonde_text_put(out, "</p>\n");
  }
  sonde_text_put(out, "<div class=\"cards\">\n");
  card(out, score->correct ? " right" : " wrong",
       score->correct    ? "\u2713 Your answer, right"
       : score->answered ? "\u2717 Your answer, wrong"
                         : "\u2717 No answer",
       score->asked, "No answer");
  card(out, "", "The truth", score->truth[0] ? score->truth : r->patient->diagnosis,
       score->thrombosis ? "Deep vein thrombosis" : "No deep vein thrombosis");
  sonde_text_put(out, "</div>\n</section>\n");
}

// ---- advice -------------------------------------------------------------------------------------

// Items go to a text of their own, so that an empty list leaves nothing.
typedef struct advice {
  const sonde_debrief *page;
  sonde_text items;
} advice;

// %-directives of strings and integers; `title` is foreign text that comes first.
static void add(advice *a, const char *title, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static void add(advice *a, const char *title, const char *format, ...) {
  char words[512];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(words, sizeof words, format, arguments);
  va_end(arguments);
  sonde_text_put(&a->items, "<li>");
  if (title) {
    sonde_text_put(&a->items, "<b>");
    sonde_text_escape(&a->items, title);
    sonde_text_put(&a->items, "</b>: ");
  }
  sonde_text_escape(&a->items, words);
  sonde_text_put(&a->items, "</li>\n");
}

static uint32_t presses_in(const sonde_exam_report *r, uint32_t segment,
                           sonde_press_result result) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < r->press_count; ++i)
    count += r->presses[i].segment == segment && r->presses[i].result == result;
  return count;
}

static const char *plural(uint32_t count) { return count == 1 ? "" : "es"; }

static uint32_t segment_of(const sonde_exam_report *r, const char *name) {
  return sonde_vein_segment(r->map, name);
}

static void why_missed(const sonde_exam_report *r, const sonde_segment_verdict *v, char *out,
                       size_t size) {
  uint32_t segment = segment_of(r, v->name), total = 0;
  uint32_t open = presses_in(r, segment, SONDE_PRESS_OPEN);
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k)
    total += presses_in(r, segment, (sonde_press_result)k);
  if (total == 0)
    snprintf(out, size, "The segment was never pressed.");
  else if (open > 0)
    snprintf(
        out, size,
        "%u press%s at the force that closes a healthy vein there left it open: that is the sign.",
        open, plural(open));
  else
    snprintf(out, size,
             "None of the %u press%s there reached the force that closes a healthy vein: press on "
             "until then, and move in smaller steps.",
             total, plural(total));
}

static void work_segment(advice *a, const sonde_segment_verdict *v) {
  const sonde_exam_report *r = a->page->in;
  const char *title = sonde_segment_title(v->name);
  char why[256];
  if (v->truth == SONDE_DECISION_CLOT && v->decision != SONDE_DECISION_CLOT) {
    why_missed(r, v, why, sizeof why);
    if (v->needed || v->decision != SONDE_DECISION_NONE)
      add(a, title, "a clot was missed; your answer was \u201c%s\u201d. %s",
          sonde_decision_words(v->decision), why);
    else
      add(a, title, "there is a clot here, outside of what this protocol examines.");
  } else if (v->decision == SONDE_DECISION_CLOT && v->truth == SONDE_DECISION_COMPRESSIBLE) {
    uint32_t closed = presses_in(r, segment_of(r, v->name), SONDE_PRESS_COMPLETE);
    add(a, title, "was called a clot, but the vein there closes. %s",
        closed ? "One of your own presses closed it."
               : "Press with the force that closes a healthy vein there before calling it open.");
  } else if (v->needed && v->decision == SONDE_DECISION_NONE) {
    add(a, title, "was left undecided; a segment without an answer cannot count.");
  } else if (v->needed && !v->correct) {
    add(a, title, "your answer was \u201c%s\u201d; right is \u201c%s\u201d.",
        sonde_decision_words(v->decision), sonde_decision_words(v->truth));
  } else if (v->needed && !v->supported) {
    add(a, title, "the answer is right, but no press of the right kind shows it.");
  }
}

static void work_places(advice *a) {
  enum { NAMED = 6 };
  const sonde_debrief *page = a->page;
  const sonde_plan *plan = page->in->plan;
  uint32_t left = 0;
  char names[480] = "";
  for (uint32_t i = 0; i < plan->count; ++i) {
    if (page->vein.done[i]) continue;
    const char *comma = left ? ", " : "";
    size_t used = strlen(names);
    if (left++ < NAMED)
      snprintf(names + used, sizeof names - used, "%s%s", comma,
               plan->point[i].title[0] ? plan->point[i].title : "unnamed");
  }
  if (left > NAMED)
    add(a, "Places without a good press", "%.330s, and %u more.", names, left - NAMED);
  else if (left)
    add(a, "Places without a good press", "%.400s.", names);
  double gap_m = page->vein.gap_to_m - page->vein.gap_from_m;
  if (gap_m >= 0.01 && left < plan->count)
    add(a, "Longest gap", "%s cm of vein without a good press, from %s to %s cm.",
        sonde_fixed(1e2 * gap_m, 1).s, sonde_fixed(1e2 * page->vein.gap_from_m, 1).s,
        sonde_fixed(1e2 * page->vein.gap_to_m, 1).s);
}

static void work_presses(advice *a) {
  const sonde_metrics *m = &a->page->in->score->metrics;
  const sonde_criteria *c = &a->page->in->plan->criteria;
  uint32_t hard = m->presses[SONDE_PRESS_TOO_HARD], tilted = m->presses[SONDE_PRESS_OFF_AXIS];
  uint32_t little = m->presses[SONDE_PRESS_INSUFFICIENT];
  if (m->press_count == 0)
    add(a, "No compression",
        "press with the probe across the vein until its walls touch, place by "
        "place.");
  if (hard)
    add(a, "Too hard",
        "%u of %u presses were above the limit of their place. Stop as soon as the walls touch.",
        hard, m->press_count);
  if (tilted)
    add(a, "Off axis",
        "%u of %u presses. Keep the image plane across the vein, within %s degrees, and the vein "
        "in "
        "view while you press.",
        tilted, m->press_count, sonde_fixed(c->tilt_rad * 180 / SONDE_PI, 0).s);
  if (little)
    add(a, "Not far enough",
        "%u of %u presses. Press until the walls touch, or to the force of the place.", little,
        m->press_count);
  if (m->hints) add(a, "Hints", "you asked for %u; try the next one without.", m->hints);
}

static void well(advice *a) {
  const sonde_score *score = a->page->in->score;
  const sonde_metrics *m = &score->metrics;
  uint32_t right = 0, needed = 0;
  for (uint32_t i = 0; i < score->segment_count; ++i) {
    const sonde_segment_verdict *v = &score->segment[i];
    needed += v->needed;
    right += v->needed && v->correct && v->supported;
    if (v->truth == SONDE_DECISION_CLOT && v->correct && v->supported)
      add(a, sonde_segment_title(v->name), "the clot was found, and shown by a press.");
  }
  if (right)
    add(a, NULL, "%u of %u segments answered rightly, with a press to show it.", right, needed);
  if (m->points && m->points_done == m->points)
    add(a, NULL, "Every planned place was pressed well.");
  else if (m->coverage >= 0.9)
    add(a, NULL, "%s %% of the planned vein was examined.", sonde_fixed(100 * m->coverage, 0).s);
  if (m->presses[SONDE_PRESS_COMPLETE] && m->completeness >= 0.95)
    add(a, NULL, "Complete presses closed the vein to %s %% of its area on average.",
        sonde_fixed(100 * (1 - m->completeness), 0).s);
  if (m->press_count && m->presses[SONDE_PRESS_TOO_HARD] == 0)
    add(a, NULL, "No press was too hard.");
}

static void put_list(sonde_debrief *page, const char *title, const advice *a, const char *none) {
  sonde_text *out = &page->out;
  sonde_text_format(out, "<div><h3>%s</h3>\n", title);
  if (a->items.used) {
    sonde_text_put(out, "<ul>\n");
    sonde_text_append(out, &a->items);
    sonde_text_put(out, "</ul>\n");
  } else {
    sonde_text_format(out, "<p>%s</p>\n", none);
  }
  sonde_text_put(out, "</div>\n");
  if (a->items.failed) out->failed = true;
}

void sonde_debrief_advice(sonde_debrief *page) {
  const sonde_score *score = page->in->score;
  advice good = {.page = page}, work = {.page = page};
  well(&good);
  for (uint32_t i = 0; i < score->segment_count; ++i) work_segment(&work, &score->segment[i]);
  work_places(&work);
  work_presses(&work);
  sonde_debrief_section(page, "advice", "What to take away");
  sonde_text_put(&page->out, "<div class=\"two\">\n");
  put_list(page, "What to work on", &work,
           "Nothing: every answer was right and every press was good.");
  if (good.items.used) put_list(page, "What went well", &good, "");
  sonde_text_put(&page->out, "</div>\n</section>\n");
  sonde_text_clear(&good.items);
  sonde_text_clear(&work.items);
}
