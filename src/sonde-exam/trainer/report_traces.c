// Force and vein over time, and this exam among the trainee's earlier ones.
//
// reduce           at most so many points, keeping every peak of force and the least vein
// bands            presses behind the curves
// draw_traces      two plots over one time
// gather           this exam and the finished ones before it, newest first
// draw_curve       scores, their median, this exam
// compare          what the curve says, in words
// row              one exam
#include "report/chart.h"
#include "trainer/log.h"
#include "trainer/report.h"

#include <string.h>

enum { POINTS = 900, LISTED = 8 };

// ---- traces -------------------------------------------------------------------------------------

typedef struct traces {
  double time[POINTS], force[POINTS], vein[POINTS];
  uint32_t count;
} traces;

static void reduce(const sonde_exam_sample *samples, uint32_t count, traces *t) {
  uint32_t per = (count + POINTS - 1) / POINTS;
  for (uint32_t from = 0; from < count; from += per) {
    uint32_t end = from + per < count ? from + per : count, k = t->count++;
    SONDE_ASSERT(k < POINTS);
    t->time[k] = 0.5 * (samples[from].time_s + samples[end - 1].time_s);
    t->force[k] = t->vein[k] = (double)NAN;
    for (uint32_t i = from; i < end; ++i) {
      t->force[k] = fmax(t->force[k], samples[i].force_n); // fmax leaves NaN out
      t->vein[k] = fmin(t->vein[k], 100 * samples[i].vein_ratio);
    }
  }
}

static double largest(const double *values, uint32_t count, double least) {
  for (uint32_t i = 0; i < count; ++i) least = fmax(least, values[i]);
  return isfinite(least) ? least : 1;
}

static void bands(const sonde_debrief *page, const sonde_chart *chart, double scale) {
  const sonde_exam_report *r = page->in;
  for (uint32_t i = 0; i < r->press_count; ++i) {
    const sonde_compression *p = &r->presses[i];
    char look[64];
    snprintf(look, sizeof look, "fill='%s' fill-opacity='.16'", sonde_press_colour(p->result));
    if (p->end_s * scale >= chart->x.low && p->start_s * scale <= chart->x.high)
      sonde_chart_box(chart, p->start_s * scale, p->end_s * scale, chart->y.low, chart->y.high,
                      look);
  }
}

// During each press the limit of its place.
static void limits(const sonde_debrief *page, const sonde_chart *chart, double scale) {
  const sonde_exam_report *r = page->in;
  for (uint32_t i = 0; i < r->press_count; ++i) {
    const sonde_compression *p = &r->presses[i];
    if (p->place >= r->plan->count) continue;
    double limit_n = r->plan->point[p->place].target.limit_n;
    double from = fmax(p->start_s * scale, chart->x.low),
           to = fmin(p->end_s * scale, chart->x.high);
    if (!isfinite(limit_n) || !(from < to)) continue;
    double y = sonde_chart_y(chart, limit_n);
    sonde_svg_line(chart->out, sonde_chart_x(chart, from), y, sonde_chart_x(chart, to), y,
                   "stroke='#c2410c' stroke-width='1.6'");
  }
}

static void draw_traces(sonde_debrief *page, traces *t, sonde_text *out) {
  const sonde_plan *plan = page->in->plan;
  double last = t->time[t->count - 1], scale = last - t->time[0] > 180 ? 1.0 / 60 : 1;
  for (uint32_t i = 0; i < t->count; ++i) t->time[i] *= scale;
  sonde_axis time = sonde_axis_tight(t->time[0], t->time[t->count - 1], 10);
  double limit = 1;
  for (uint32_t i = 0; i < plan->count; ++i)
    limit = fmax(limit, 1.1 * plan->point[i].target.limit_n);
  sonde_chart force = {.out = out,
                       .left = 58,
                       .top = 26,
                       .width = PAGE_WIDTH - 74,
                       .height = 130,
                       .x = time,
                       .y = sonde_axis_make(0, largest(t->force, t->count, limit), 4)};
  sonde_chart vein = force;
  vein.top = 216;
  vein.height = 100;
  vein.y = sonde_axis_make(0, largest(t->vein, t->count, 100), 4);
  bands(page, &force, scale);
  bands(page, &vein, scale);
  sonde_chart_frame(&force, "Force", NULL, "N");
  limits(page, &force, scale);
  sonde_chart_frame(&vein, "Area of the vein", scale < 1 ? "minutes" : "seconds", "% of rest");
  sonde_chart_clip(&force);
  sonde_chart_line(&force, t->time, t->force, t->count, "#1b2126", NULL);
  sonde_chart_unclip(&force);
  sonde_chart_clip(&vein);
  sonde_chart_line(&vein, t->time, t->vein, t->count, "#0b5cad", NULL);
  sonde_chart_unclip(&vein);
}

sonde_status sonde_debrief_traces(sonde_debrief *page, sonde_error *error) {
  const sonde_exam_report *r = page->in;
  if (r->sample_count < 2) return SONDE_OK;
  traces *t = SONDE_NEW(traces, 1);
  if (!t) return sonde_fail_memory(error);
  sonde_figure figure = {.name = "traces",
                         .title = "Force of the probe and area of the vein over time",
                         .width = PAGE_WIDTH,
                         .height = 362};
  reduce(r->samples, r->sample_count, t);
  draw_traces(page, t, &figure.body);
  sonde_debrief_section(page, "traces", "Force and vein over time");
  sonde_debrief_drawing(
      page, &figure,
      "Shaded: presses, in the colours of the vein's drawing. Red: the limit of the "
      "place, above which a press is too hard. The blue line is broken where the vein was not in "
      "the image.");
  sonde_text_put(&page->out, "</section>\n");
  sonde_free(t);
  return SONDE_OK;
}

// ---- earlier exams ------------------------------------------------------------------------------

typedef struct history {
  sonde_log_entry *entries; // [count] newest first; the first one is this exam
  sonde_learning_point *points;
  uint32_t count, point_count;
  const char *patient_id;
} history;

static sonde_status gather(const sonde_exam_report *r, history *h, sonde_error *error) {
  h->entries = SONDE_NEW(sonde_log_entry, (size_t)r->earlier_count + 1);
  h->points = SONDE_NEW(sonde_learning_point, (size_t)r->earlier_count + 1);
  if (!h->entries || !h->points) return sonde_fail_memory(error);
  sonde_log_entry *now = &h->entries[h->count++];
  sonde_score_note note = r->note;
  if (!note.date) note.date = "";
  *now = sonde_log_entry_make(r->patient, r->score, &note);
  now->interrupted = r->interrupted;
  for (uint32_t i = 0; i < r->earlier_count; ++i) {
    const sonde_log_entry *e = &r->earlier[i];
    bool later = now->date[0] && strcmp(e->date, now->date) > 0;
    if (strcmp(e->id, now->id) != 0 && !later) h->entries[h->count++] = *e;
  }
  h->point_count = sonde_learning_curve(h->entries, h->count, 0, h->points);
  return SONDE_OK;
}

static void draw_curve(const history *h, bool interrupted, sonde_text *out) {
  enum { SHOWN = 200 };
  double x[SHOWN], y[SHOWN];
  uint32_t count = h->point_count < SHOWN ? h->point_count : SHOWN;
  uint32_t from = h->point_count - count;
  for (uint32_t i = 0; i < count; ++i) {
    x[i] = h->points[from + i].number;
    y[i] = h->points[from + i].median;
  }
  sonde_chart chart = {.out = out,
                       .left = 58,
                       .top = 14,
                       .width = PAGE_WIDTH - 74,
                       .height = 130,
                       .x = {x[0] - 0.5, x[count - 1] + 0.5, 1, (long)x[0], (long)x[count - 1]},
                       .y = sonde_axis_make(0, 100, 4)};
  if (count > 20) chart.x = sonde_axis_tight(x[0] - 0.5, x[count - 1] + 0.5, 12);
  sonde_chart_frame(&chart, NULL, "exam", "score");
  sonde_chart_line(&chart, x, y, count, "#0b5cad", "stroke-opacity='.55'");
  for (uint32_t i = 0; i < count; ++i) {
    const sonde_learning_point *p = &h->points[from + i];
    bool now = i + 1 == count && !interrupted;
    char look[96];
    snprintf(look, sizeof look, "fill='%s' stroke='%s' stroke-width='1.8'",
             p->passed ? "#00795a" : "#fff", p->passed ? "#00795a" : "#b3261e");
    double px = sonde_chart_x(&chart, x[i]), py = sonde_chart_y(&chart, p->score);
    sonde_svg_circle(out, px, py, now ? 6 : 4, look);
    if (now) sonde_svg_circle(out, px, py, 10, "fill='none' stroke='#1b2126' stroke-width='1.2'");
  }
}

static void compare(const sonde_exam_report *r, const history *h, sonde_text *out) {
  uint32_t same = 0;
  double best = 0;
  for (uint32_t i = 1; i < h->count; ++i) {
    if (strcmp(h->entries[i].case_id, h->patient_id) != 0 || h->entries[i].interrupted) continue;
    best = same++ ? fmax(best, h->entries[i].score) : h->entries[i].score;
  }
  sonde_text_put(out, "<p>");
  if (h->point_count >= 2 && !r->interrupted) {
    const sonde_learning_point *now = &h->points[h->point_count - 1];
    sonde_text_format(out,
                      "Exam %u. The median of your last five is %s points; before this exam it was "
                      "%s. ",
                      now->number, sonde_fixed(now->median, 0).s,
                      sonde_fixed(h->points[h->point_count - 2].median, 0).s);
  }
  if (same)
    sonde_text_format(out,
                      "You have examined this patient %u time%s before, with %s points at best.",
                      same, same == 1 ? "" : "s", sonde_fixed(best, 0).s);
  else
    sonde_text_put(out, "This patient was new to you.");
  sonde_text_put(out, "</p>\n");
}

static void row(sonde_text *out, const sonde_log_entry *e, bool now) {
  const sonde_metrics *m = &e->metrics;
  char day[17];
  sonde_log_copy(day, sizeof day, e->date);
  if (strlen(day) == 16 && day[10] == 'T') day[10] = ' ';
  sonde_text_put(out, now ? "<tr class=\"this\"><th scope=\"row\">" : "<tr><th scope=\"row\">");
  sonde_text_escape(out, e->case_title);
  sonde_text_put(out, now ? " (this exam)</th><td class=\"day\">" : "</th><td class=\"day\">");
  sonde_text_escape(out, day);
  sonde_text_format(out, "</td><td class=\"n\">%s</td><td class=\"%s\">%s</td>",
                    sonde_fixed(e->score, 0).s,
                    e->interrupted ? "quiet"
                    : e->passed    ? "yes"
                                   : "no",
                    e->interrupted ? "interrupted"
                    : e->passed    ? "\u2713 passed"
                    : e->correct   ? "\u2717 not passed"
                                   : "\u2717 wrong diagnosis");
  sonde_text_format(
      out,
      "<td class=\"n\">%s %%</td><td class=\"n\">%s %%</td><td class=\"n\">%s min</td>"
      "</tr>\n",
      sonde_fixed(100 * m->coverage, 0).s, sonde_fixed(100 * m->valid_share, 0).s,
      sonde_fixed(m->time_s / 60, 1).s);
}

static void put_history(sonde_debrief *page, const history *h) {
  sonde_text *out = &page->out;
  sonde_figure figure = {
      .name = "curve", .title = "Your scores, exam by exam", .width = PAGE_WIDTH, .height = 190};
  compare(page->in, h, out);
  if (h->point_count >= 2) {
    draw_curve(h, page->in->interrupted, &figure.body);
    sonde_debrief_drawing(
        page, &figure,
        "Each exam that was finished: filled, passed; hollow, not passed; the outer "
        "ring marks this one. The line is the median of the last five.");
  }
  sonde_text_put(out, "<div class=\"wide\"><table>\n<thead><tr><th>Patient</th><th>Date (UTC)</th>"
                      "<th class=\"n\">Score</th><th>Result</th><th class=\"n\">Coverage</th>"
                      "<th class=\"n\">Good presses</th><th class=\"n\">Time</th></tr></thead>\n"
                      "<tbody>\n");
  for (uint32_t i = 0; i < h->count && i <= LISTED; ++i) row(out, &h->entries[i], i == 0);
  sonde_text_put(out, "</tbody></table></div>\n");
  if (h->count > LISTED + 1)
    sonde_text_format(out, "<p class=\"quiet\">and %u earlier ones.</p>\n", h->count - LISTED - 1);
}

sonde_status sonde_debrief_earlier(sonde_debrief *page, sonde_error *error) {
  history h = {.patient_id = page->in->patient->id};
  sonde_status status = gather(page->in, &h, error);
  if (!status) {
    sonde_debrief_section(page, "earlier", "Compared with your earlier exams");
    if (h.count > 1)
      put_history(page, &h);
    else
      sonde_text_put(&page->out, "<p>This is the first exam in your log.</p>\n");
    sonde_text_put(&page->out, "</section>\n");
  }
  sonde_free(h.entries);
  sonde_free(h.points);
  return status;
}
