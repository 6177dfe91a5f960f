// The vein along its length: what was examined, what is there, and every press.
//
// mark_bins        a stretch of vein in steps
// find_gap         the longest planned stretch that was not covered
// find_clot        where the case has put one in the femoral vein
// draw_runs        a row of steps as boxes
// draw_names       number and name of each segment above the vein
// draw_tube, draw_clot, draw_points, draw_gap, draw_lesions
// draw_presses     force against place
// legend           shapes and colours
// segment_row      one line of the table
#include "report/chart.h"
#include "trainer/report.h"

#include <string.h>

static const double LEFT = 58, RIGHT = 16, TUBE_TOP = 46, TUBE_HEIGHT = 26, PLOT_TOP = 142,
                    PLOT_HEIGHT = 150;
static const char COVERED[] = "#9fd8c3", MISSED[] = "#fbd9b5", UNPLANNED[] = "#edf0f3",
                  CLOT[] = "#7b1e3a";

// ---- stretches ----------------------------------------------------------------------------------

// A step counts when its middle lies within, as the judge counts.
static void mark_bins(const sonde_debrief_vein *vein, bool *bins, double from_m, double to_m) {
  for (uint32_t i = 0; i < vein->bins; ++i) {
    double middle = (i + 0.5) * JUDGE_BIN_M;
    if (middle >= from_m && middle <= to_m) bins[i] = true;
  }
}

static void find_gap(sonde_debrief_vein *vein) {
  uint32_t run = 0, longest = 0;
  for (uint32_t i = 0; i < vein->bins; ++i) {
    run = vein->wanted[i] && !vein->covered[i] ? run + 1 : 0;
    if (run <= longest) continue;
    longest = run;
    vein->gap_from_m = (i + 1 - run) * JUDGE_BIN_M;
    vein->gap_to_m = (i + 1) * JUDGE_BIN_M;
  }
}

static void find_clot(const sonde_exam_report *r, sonde_debrief_vein *vein) {
  const sonde_case *patient = r->patient;
  double from_m = 0, to_m = r->map->length_m;
  if (!(patient->pathology.thrombus_fraction > 0)) return;
  if (!patient->extent.whole && (sonde_station_find(&patient->extent.from, r->map, &from_m, NULL) ||
                                 sonde_station_find(&patient->extent.to, r->map, &to_m, NULL)))
    return;
  vein->clot_from_m = fmin(from_m, to_m);
  vein->clot_to_m = fmax(from_m, to_m);
}

sonde_debrief_vein sonde_debrief_vein_make(const sonde_exam_report *r) {
  sonde_debrief_vein vein = {.bins = (uint32_t)fmin(r->map->length_m / JUDGE_BIN_M, JUDGE_BINS)};
  double reach = r->plan->criteria.reach_m;
  for (uint32_t i = 0; i < r->plan->count; ++i) {
    double at = r->plan->point[i].at.along_m;
    mark_bins(&vein, vein.wanted, at - reach, at + reach);
  }
  for (uint32_t i = 0; i < r->press_count; ++i) {
    const sonde_compression *p = &r->presses[i];
    bool valid = p->result == SONDE_PRESS_COMPLETE || p->result == SONDE_PRESS_OPEN;
    if (!valid || !isfinite(p->along_m)) continue;
    mark_bins(&vein, vein.covered, p->along_m - reach - COVER_EXTRA_M,
              p->along_m + reach + COVER_EXTRA_M);
    for (uint32_t k = 0; k < r->plan->count; ++k)
      vein.done[k] |= fabs(r->plan->point[k].at.along_m - p->along_m) <= reach;
  }
  find_gap(&vein);
  find_clot(r, &vein);
  return vein;
}

// ---- words and marks ----------------------------------------------------------------------------

const char *sonde_press_words(sonde_press_result result) {
  static const char *const WORDS[] = {"complete", "vein stays open", "not far enough", "too hard",
                                      "off axis"};
  _Static_assert(SONDE_COUNT_OF(WORDS) == SONDE_PRESS_RESULTS, "a word per result");
  SONDE_ASSERT(result < SONDE_PRESS_RESULTS);
  return WORDS[result];
}

// Of Okabe and Ito's palette; shapes say the same.
const char *sonde_press_colour(sonde_press_result result) {
  static const char *const COLOURS[] = {"#00795a", "#0072b2", "#946000", "#c2410c", "#8a4b78"};
  _Static_assert(SONDE_COUNT_OF(COLOURS) == SONDE_PRESS_RESULTS, "a colour per result");
  SONDE_ASSERT(result < SONDE_PRESS_RESULTS);
  return COLOURS[result];
}

void sonde_press_mark(sonde_text *out, double x, double y, sonde_press_result result) {
  // filled circle, ring, triangle down, filled triangle up, diamond
  static const char *const SHAPES[] = {"m-4.2 0a4.2 4.2 0 1 0 8.4 0a4.2 4.2 0 1 0-8.4 0z",
                                       "m-3.8 0a3.8 3.8 0 1 0 7.6 0a3.8 3.8 0 1 0-7.6 0z",
                                       "m-4.6-3.2h9.2l-4.6 7.6z", "m-4.8 3.4h9.6l-4.8-8z",
                                       "m0-5l4.6 5l-4.6 5l-4.6-5z"};
  bool filled = result == SONDE_PRESS_COMPLETE || result == SONDE_PRESS_TOO_HARD;
  const char *colour = sonde_press_colour(result);
  sonde_text_format(out, "<path d='M%s %s%s' fill='%s' stroke='%s' stroke-width='%s'/>\n",
                    sonde_coordinate(x).s, sonde_coordinate(y).s, SHAPES[result],
                    filled ? colour : "#fff", filled ? "#fff" : colour, filled ? ".8" : "1.8");
}

void sonde_debrief_place(sonde_debrief *page, const sonde_compression *press) {
  const sonde_vein_map *map = page->in->map;
  if (!isfinite(press->along_m)) {
    sonde_text_put(&page->out, "vein not in view");
    return;
  }
  if (press->segment < map->segment_count) {
    sonde_text_escape(&page->out, sonde_segment_title(map->segment[press->segment].name));
    sonde_text_put(&page->out, ", ");
  }
  sonde_text_format(&page->out, "%s cm", sonde_fixed(1e2 * press->along_m, 1).s);
}

// ---- the drawing --------------------------------------------------------------------------------

static double x_of(const sonde_debrief *page, double along_m) {
  return LEFT + (PAGE_WIDTH - LEFT - RIGHT) * clamp(along_m / page->in->map->length_m, 0, 1);
}

// Boxes for the steps that satisfy both rows as asked.
static void draw_runs(sonde_debrief *page, sonde_text *out, bool wanted, bool covered,
                      const char *colour) {
  const sonde_debrief_vein *vein = &page->vein;
  char look[64];
  snprintf(look, sizeof look, "fill='%s'", colour);
  for (uint32_t i = 0; i < vein->bins;) {
    uint32_t from = i;
    while (i < vein->bins && vein->covered[i] == covered && (covered || vein->wanted[i] == wanted))
      ++i;
    double left = x_of(page, from * JUDGE_BIN_M), right = x_of(page, i * JUDGE_BIN_M);
    if (i > from) sonde_svg_rect(out, left, TUBE_TOP, right - left, TUBE_HEIGHT, look);
    if (i == from) ++i;
  }
}

// From one end to the other, in metres along the vein.
static void ends_of(const sonde_debrief *page, uint32_t segment, double *from_m, double *to_m) {
  const sonde_segment *s = &page->in->map->segment[segment];
  double a = sonde_vein_along(page->in->map, s->from_m);
  double b = sonde_vein_along(page->in->map, s->to_m);
  *from_m = fmin(a, b);
  *to_m = fmax(a, b);
}

// The number always, the name where it has room.
static void draw_names(sonde_debrief *page, sonde_text *out) {
  const sonde_vein_map *map = page->in->map;
  for (uint32_t i = 0; i < map->segment_count; ++i) {
    double from_m, to_m;
    ends_of(page, i, &from_m, &to_m);
    double left = x_of(page, from_m), right = x_of(page, to_m), middle = 0.5 * (left + right);
    char text[96];
    snprintf(text, sizeof text, "%u  %.80s", i + 1, sonde_segment_title(map->segment[i].name));
    if (sonde_text_width(text, 12) > right - left - 8) snprintf(text, sizeof text, "%u", i + 1);
    sonde_svg_text(out, middle, 32, "class='middle' font-weight='600'", text);
    if (i > 0) {
      sonde_svg_line(out, left, 22, left, TUBE_TOP + TUBE_HEIGHT + 4, "stroke='#8b97a1'");
      sonde_svg_line(out, left, PLOT_TOP, left, PLOT_TOP + PLOT_HEIGHT, "stroke='#c5ccd2'");
    }
  }
}

static void draw_tube(sonde_debrief *page, sonde_text *out) {
  double left = x_of(page, 0), width = x_of(page, page->in->map->length_m) - left;
  sonde_svg_rect(out, left, TUBE_TOP, width, TUBE_HEIGHT, "fill='#edf0f3'");
  draw_runs(page, out, true, false, MISSED);
  draw_runs(page, out, true, true, COVERED);
  sonde_svg_words(out, LEFT - 8, TUBE_TOP + 17, "class='end'", "groin");
  sonde_svg_words(out, PAGE_WIDTH - RIGHT, TUBE_TOP - 6, "class='end'", "knee");
}

static void draw_clot(sonde_debrief *page, sonde_text *out) {
  const sonde_debrief_vein *vein = &page->vein;
  if (!(vein->clot_to_m > vein->clot_from_m)) return;
  double left = x_of(page, vein->clot_from_m), width = x_of(page, vein->clot_to_m) - left;
  char look[64];
  snprintf(look, sizeof look, "fill='%s' rx='5'", CLOT);
  sonde_svg_rect(out, left, TUBE_TOP + 6, width, TUBE_HEIGHT - 12, look);
  if (width > 40)
    sonde_svg_words(out, left + 0.5 * width, TUBE_TOP + 17, "class='middle light small'", "CLOT");
}

static void draw_outline(sonde_debrief *page, sonde_text *out) {
  double left = x_of(page, 0), width = x_of(page, page->in->map->length_m) - left;
  sonde_svg_rect(out, left, TUBE_TOP, width, TUBE_HEIGHT,
                 "fill='none' stroke='#5b6670' stroke-width='1.2'");
}

static void draw_points(sonde_debrief *page, sonde_text *out) {
  const sonde_plan *plan = page->in->plan;
  double y = TUBE_TOP + TUBE_HEIGHT + 11;
  for (uint32_t i = 0; i < plan->count; ++i)
    sonde_svg_circle(out, x_of(page, plan->point[i].at.along_m), y, 4,
                     page->vein.done[i] ? "fill='#1b2126'"
                                        : "fill='#fff' stroke='#1b2126' stroke-width='1.4'");
}

static void draw_gap(sonde_debrief *page, sonde_text *out) {
  double length_m = page->vein.gap_to_m - page->vein.gap_from_m;
  if (!(length_m >= 0.005)) return;
  double left = x_of(page, page->vein.gap_from_m), right = x_of(page, page->vein.gap_to_m);
  double y = TUBE_TOP + TUBE_HEIGHT + 26;
  char words[64];
  snprintf(words, sizeof words, "longest gap %s cm", sonde_fixed(1e2 * length_m, 1).s);
  static const char look[] = "stroke='#c2410c' stroke-width='1.4'";
  sonde_svg_line(out, left, y, right, y, look);
  sonde_svg_line(out, left, y - 4, left, y + 4, look);
  sonde_svg_line(out, right, y - 4, right, y + 4, look);
  double half = 0.5 * sonde_text_width(words, 12);
  double middle = clamp(0.5 * (left + right), LEFT + half, PAGE_WIDTH - RIGHT - half);
  sonde_svg_text(out, middle, y + 16, "class='middle' style=\"fill:#9a3412\"", words);
}

// The force of a place: from what closes a healthy vein to the limit, within reach of the place.
static void draw_target(const sonde_chart *chart, const sonde_plan *plan, uint32_t i) {
  const sonde_plan_point *point = &plan->point[i];
  double from = 1e2 * (point->at.along_m - plan->criteria.reach_m);
  double to = 1e2 * (point->at.along_m + plan->criteria.reach_m);
  double firm_n = point->target.firm_n, limit_n = point->target.limit_n;
  if (!isfinite(firm_n)) return;
  from = fmax(from, chart->x.low);
  to = fmin(to, chart->x.high);
  sonde_chart_box(chart, from, to, firm_n, limit_n, "fill='#d9f0e6'");
  double y = sonde_chart_y(chart, limit_n);
  sonde_svg_line(chart->out, sonde_chart_x(chart, from), y, sonde_chart_x(chart, to), y,
                 "stroke='#c2410c' stroke-width='1.6'");
}

static void draw_presses(sonde_debrief *page, sonde_text *out) {
  const sonde_exam_report *r = page->in;
  double most = 0;
  for (uint32_t i = 0; i < r->plan->count; ++i)
    most = fmax(most, 1.15 * r->plan->point[i].target.limit_n);
  for (uint32_t i = 0; i < r->press_count; ++i) most = fmax(most, r->presses[i].force_peak_n);
  sonde_chart chart = {.out = out,
                       .left = LEFT,
                       .top = PLOT_TOP,
                       .width = PAGE_WIDTH - LEFT - RIGHT,
                       .height = PLOT_HEIGHT,
                       .x = sonde_axis_tight(0, 1e2 * r->map->length_m, 10),
                       .y = sonde_axis_make(0, most > 0 ? most : 10, 5)};
  for (uint32_t i = 0; i < r->plan->count; ++i) draw_target(&chart, r->plan, i);
  sonde_chart_frame(&chart, NULL, "centimetres along the vein, from the groin to the knee",
                    "force (N)");
  for (uint32_t i = 0; i < r->press_count; ++i) {
    const sonde_compression *p = &r->presses[i];
    if (!sonde_chart_holds(&chart, 1e2 * p->along_m, p->force_peak_n)) continue;
    sonde_press_mark(out, sonde_chart_x(&chart, 1e2 * p->along_m),
                     sonde_chart_y(&chart, p->force_peak_n), p->result);
  }
}

static double key(sonde_text *out, double x, double y, const char *colour, const char *words) {
  char look[96];
  snprintf(look, sizeof look, "fill='%s' stroke='#8b97a1' stroke-width='.6'", colour);
  sonde_svg_rect(out, x, y - 9, 18, 10, look);
  sonde_svg_words(out, x + 24, y, "class='tick'", words);
  return x + 24 + sonde_text_width(words, 11) + 20;
}

static void legend(sonde_debrief *page, sonde_text *out) {
  double x = LEFT, y = PLOT_TOP + PLOT_HEIGHT + 60;
  for (int k = 0; k < SONDE_PRESS_RESULTS; ++k) {
    const char *words = sonde_press_words((sonde_press_result)k);
    sonde_press_mark(out, x + 6, y - 4, (sonde_press_result)k);
    sonde_svg_words(out, x + 16, y, "class='tick'", words);
    x += 16 + sonde_text_width(words, 11) + 20;
  }
  x = LEFT;
  y += 20;
  x = key(out, x, y, COVERED, "examined");
  x = key(out, x, y, MISSED, "planned, not examined");
  x = key(out, x, y, UNPLANNED, "not planned");
  if (page->vein.clot_to_m > page->vein.clot_from_m) x = key(out, x, y, CLOT, "clot");
  sonde_svg_circle(out, x + 6, y - 4, 4, "fill='#1b2126'");
  sonde_svg_circle(out, x + 18, y - 4, 4, "fill='#fff' stroke='#1b2126' stroke-width='1.4'");
  sonde_svg_words(out, x + 28, y, "class='tick'", "planned place, pressed well / not");
}

static void draw(sonde_debrief *page) {
  const sonde_exam_report *r = page->in;
  sonde_figure figure = {.name = "vein",
                         .title = "The vein along its length, and every press",
                         .width = PAGE_WIDTH,
                         .height = PLOT_TOP + PLOT_HEIGHT + 92};
  sonde_text *out = &figure.body;
  draw_tube(page, out);
  draw_clot(page, out);
  draw_outline(page, out);
  draw_names(page, out);
  draw_points(page, out);
  draw_gap(page, out);
  draw_presses(page, out);
  legend(page, out);
  uint32_t hidden = 0;
  for (uint32_t i = 0; i < r->press_count; ++i) hidden += isfinite(r->presses[i].along_m) ? 0 : 1;
  char caption[520];
  int used =
      snprintf(caption, sizeof caption,
               "Above, the vein from the groin to the knee, with what was examined%s. Below, "
               "each press by its place and its greatest force. A green box reaches from the force "
               "that closes a healthy vein at a place to the red line, the limit there: above "
               "it a press is too hard.",
               page->vein.clot_to_m > page->vein.clot_from_m ? " and what is there" : "");
  if (hidden && used > 0)
    snprintf(caption + used, sizeof caption - (size_t)used,
             " %u press%s without the vein in view cannot be drawn.", hidden,
             hidden == 1 ? "" : "es");
  sonde_debrief_drawing(page, &figure, caption);
}

// ---- the table ----------------------------------------------------------------------------------

const char *sonde_decision_words(sonde_decision decision) {
  static const char *const WORDS[] = {"not decided", "compressible", "clot", "not seen"};
  _Static_assert(SONDE_COUNT_OF(WORDS) == SONDE_DECISIONS, "a word per decision");
  SONDE_ASSERT(decision < SONDE_DECISIONS);
  return WORDS[decision];
}

static void segment_row(sonde_debrief *page, uint32_t index) {
  const sonde_segment_verdict *v = &page->in->score->segment[index];
  sonde_text *out = &page->out;
  bool asked = v->needed || v->decision != SONDE_DECISION_NONE;
  sonde_text_format(out, "<tr><th scope=\"row\">%u. ", index + 1);
  sonde_text_escape(out, sonde_segment_title(v->name));
  sonde_text_format(out, "</th><td>%s</td><td>%s</td>",
                    asked ? sonde_decision_words(v->decision) : "not part of this protocol",
                    v->truth == SONDE_DECISION_NONE ? "\u2013" : sonde_decision_words(v->truth));
  if (!asked)
    sonde_text_put(out, "<td>\u2013</td>");
  else
    sonde_text_format(out, "<td class=\"%s\">%s</td>", v->correct ? "yes" : "no",
                      v->decision == SONDE_DECISION_NONE ? "\u2717 not decided"
                      : !v->correct                      ? "\u2717 wrong"
                      : v->supported                     ? "\u2713 right"
                                                         : "\u2713 right, but not shown");
  sonde_text_format(out, "<td class=\"n\">%u of %u</td></tr>\n", v->done, v->points);
}

void sonde_debrief_along(sonde_debrief *page) {
  const sonde_score *score = page->in->score;
  SONDE_ASSERT(score->segment_count <= SONDE_SEGMENTS);
  sonde_debrief_section(page, "vein", "Along the vein");
  draw(page);
  sonde_text_put(&page->out,
                 "<h3>Segment by segment</h3>\n<div class=\"wide\"><table>\n<thead><tr><th>Segment"
                 "</th><th>Your answer</th><th>Truth</th><th>Verdict</th><th class=\"n\">Places "
                 "pressed well</th></tr></thead>\n<tbody>\n");
  for (uint32_t i = 0; i < score->segment_count; ++i) segment_row(page, i);
  sonde_text_put(&page->out,
                 "</tbody></table></div>\n<p class=\"quiet\">An answer is shown when "
                 "a press of the right kind in that segment supports it: one that closed "
                 "the vein, or one that left it open at the force that closes a healthy "
                 "vein there.</p>\n"
                 "</section>\n");
}
