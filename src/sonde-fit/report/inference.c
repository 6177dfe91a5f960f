// heat_cells:   the matrix as runs of equal colour, one path per colour.
// heat_numbers, heat_names: what has room.
// draw_key:     colour bar from -1 to 1.
// crossing:     where a profile passes the threshold, beside the estimate.
// draw_profile: one panel.
// draw_bars:    relative deviations per parameter and data.
#include "report/view.h"

#include "base/maths.h"

#include <string.h>

// ---- correlation --------------------------------------------------------------------------------

enum { TINTS = 41 };

static double cell_of(uint32_t n) {
  SONDE_ASSERT(n > 0);
  return fmin(560.0 / n, 64);
}

static int tint_of(double correlation) {
  if (!isfinite(correlation)) return -1;
  return (int)lround((clamp(correlation, -1, 1) + 1) / 2 * (TINTS - 1));
}

static void heat_cells(sonde_text *out, const double *matrix, uint32_t n, double left, double top) {
  double cell = cell_of(n);
  for (int tint = -1; tint < TINTS; ++tint) {
    char look[48];
    snprintf(look, sizeof look, "fill='%s'",
             tint < 0 ? "#bbbbbb" : sonde_colour_diverging(2.0 * tint / (TINTS - 1) - 1).s);
    sonde_path path = {0};
    for (uint32_t i = 0; i < n; ++i)
      for (uint32_t j = 0; j < n;) {
        uint32_t from = j;
        while (j < n && tint_of(matrix[(size_t)i * n + j]) == tint) ++j;
        if (j > from) {
          if (!path.out) path = sonde_path_begin(out, look);
          sonde_path_box(&path, left + from * cell, top + i * cell, (j - from) * cell, cell);
        } else {
          ++j;
        }
      }
    if (path.out) sonde_path_end(&path);
  }
}

static void heat_numbers(sonde_text *out, const double *matrix, uint32_t n, double left,
                         double top) {
  double cell = cell_of(n);
  if (cell < 28) return;
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < n; ++j)
      sonde_svg_text(out, left + (j + 0.5) * cell, top + (i + 0.5) * cell + 4,
                     fabs(matrix[(size_t)i * n + j]) > 0.75 ? "class='tick middle light'"
                                                            : "class='tick middle'",
                     sonde_fixed(matrix[(size_t)i * n + j], 2).s);
}

// Every name when they have room, else every k-th, so that none overlap.
static void heat_names(sonde_text *out, const char *const *names, uint32_t n, double left,
                       double top) {
  double cell = cell_of(n);
  uint32_t every = (uint32_t)ceil(10 / cell);
  SONDE_ASSERT(every >= 1);
  const char *size = cell < 13 ? "class='small end'" : "class='tick end'";
  const char *up = cell < 13 ? "class='small'" : "class='tick'";
  for (uint32_t i = 0; names && i < n; i += every) {
    double middle = (i + 0.5) * cell;
    if (!names[i]) continue;
    sonde_svg_text(out, left - 6, top + middle + 3.5, size, names[i]);
    sonde_svg_text_up(out, left + middle + 3.5, top - 6, up, names[i]);
  }
}

static void draw_key(sonde_text *out, double x, double y) {
  enum { PARTS = TINTS, TALL = 6 * PARTS }; // whole pixels: no seams
  for (int i = 0; i < PARTS; ++i) {
    char look[48];
    snprintf(look, sizeof look, "fill='%s'", sonde_colour_diverging(1 - 2.0 * i / (PARTS - 1)).s);
    sonde_svg_rect(out, x, y + (double)TALL * i / PARTS, 14, (double)TALL / PARTS, look);
  }
  for (int i = 0; i <= 4; ++i) {
    double at = y + TALL * i / 4.0;
    sonde_svg_line(out, x + 14, at, x + 18, at, "class='axis'");
    sonde_svg_text(out, x + 22, at + 4, "class='tick'", sonde_fixed(1 - 0.5 * i, 1).s);
  }
  sonde_svg_text(out, x + 8, y - 12, "class='tick middle'", "correlation");
}

static double widest_name(const char *const *names, uint32_t n) {
  double widest = 20;
  for (uint32_t i = 0; names && i < n; ++i)
    if (names[i]) widest = fmax(widest, sonde_text_width(names[i], 11));
  return fmin(widest, 160);
}

void sonde_report_correlation(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  uint32_t n = r->correlation_count;
  if (!n || !r->correlation) return;
  sonde_page_section(view, "correlation", "Correlation of the estimates");
  double names = widest_name(r->correlation_names, n), left = names + 14, top = names + 14;
  double side = n * cell_of(n), height = fmax(side, 290);
  sonde_figure *figure =
      sonde_figure_begin(view, "correlation", "Correlation of the estimated parameters",
                         left + side + 100, top + height + 12);
  heat_cells(&figure->body, r->correlation, n, left, top);
  sonde_svg_rect(&figure->body, left, top, side, side, "class='axis'");
  heat_numbers(&figure->body, r->correlation, n, left, top);
  heat_names(&figure->body, r->correlation_names, n, left, top);
  draw_key(&figure->body, left + side + 40, top + 24);
  sonde_figure_place(view, figure,
                     "Blue: an error in one estimate comes with an opposite error in the other; "
                     "orange: both err the same way; grey: unknown. Strong colour away from the "
                     "diagonal says that the data fix a combination of the two better than either "
                     "alone.");
}

// ---- profile likelihood -------------------------------------------------------------------------

static const double CHI2_95 = 3.841458820694124;

static double threshold_of(const sonde_report_profile *p) {
  return p->threshold > 0 ? p->threshold : CHI2_95;
}

// First crossing from the estimate towards smaller (side < 0) or larger x; NaN when there is none.
static double crossing(const sonde_report_profile *p, int side) {
  double threshold = threshold_of(p);
  for (uint32_t k = 1; k < p->count; ++k) {
    uint32_t a = side > 0 ? k - 1 : p->count - k, b = side > 0 ? k : p->count - 1 - k;
    if ((p->x[b] - p->estimate) * side <= 0) continue;
    double inner = p->rise[a], outer = p->rise[b];
    if (!(inner <= threshold && outer > threshold)) continue;
    return p->x[a] + (p->x[b] - p->x[a]) * (threshold - inner) / (outer - inner);
  }
  return NAN;
}

static void finite_range(const double *x, uint32_t count, double *least, double *most) {
  *least = INFINITY;
  *most = -INFINITY;
  for (uint32_t i = 0; i < count; ++i)
    if (isfinite(x[i])) *least = fmin(*least, x[i]), *most = fmax(*most, x[i]);
}

static void draw_profile(sonde_figure *figure, const sonde_report_profile *p, uint32_t place) {
  double least, most, threshold = threshold_of(p);
  SONDE_ASSERT(p->count >= 2 && threshold > 0);
  char label[128];
  finite_range(p->x, p->count, &least, &most);
  sonde_chart chart = {&figure->body,
                       62 + 420.0 * (place % 2),
                       30 + 280.0 * (place / 2),
                       330,
                       190,
                       sonde_axis_tight(least, most, 5),
                       sonde_axis_make(0, 2.6 * threshold, 5)};
  snprintf(label, sizeof label, "%s%s%s", p->name ? p->name : "", p->unit && *p->unit ? ", " : "",
           p->unit ? p->unit : "");
  sonde_chart_frame(&chart, p->name, label, "rise of 2 \u00d7 cost");
  double low = crossing(p, -1), high = crossing(p, 1);
  sonde_chart_box(&chart, low, high, 0, threshold, "fill='#0072b2' fill-opacity='.10'");
  sonde_chart_clip(&chart);
  if (p->quadratic)
    sonde_chart_line(&chart, p->x, p->quadratic, p->count, "#888", "stroke-dasharray='2 3'");
  sonde_chart_line(&chart, p->x, p->rise, p->count, "#0072b2", NULL);
  sonde_chart_unclip(&chart);
  for (uint32_t i = 0; i < p->count; ++i)
    sonde_chart_mark(&chart, p->x[i], p->rise[i], 0, "#0072b2");
  sonde_chart_across(&chart, threshold, "class='dash'");
  sonde_chart_upright(&chart, p->estimate, "class='zero'");
  if (isfinite(low) || isfinite(high))
    snprintf(label, sizeof label, "%s to %s", isfinite(low) ? sonde_significant(low, 3).s : "?",
             isfinite(high) ? sonde_significant(high, 3).s : "?");
  else
    snprintf(label, sizeof label, "no bound within the range");
  sonde_svg_text(&figure->body, chart.left + chart.width, chart.top - 10, "class='tick end'",
                 label);
}

void sonde_report_profiles(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  uint32_t drawn = 0, count = 0;
  bool quadratic = false;
  for (uint32_t i = 0; i < r->profile_count; ++i) {
    const sonde_report_profile *p = &r->profiles[i];
    if (p->count < 2 || !p->x || !p->rise) continue;
    ++count;
    quadratic = quadratic || p->quadratic;
  }
  if (!count) return;
  sonde_page_section(view, "profiles", "Profile likelihood");
  sonde_figure *figure = sonde_figure_begin(view, "profiles", "Profile likelihood", 830,
                                            280.0 * ((count + 1) / 2) + 8);
  for (uint32_t i = 0; i < r->profile_count; ++i) {
    const sonde_report_profile *p = &r->profiles[i];
    if (p->count >= 2 && p->x && p->rise) draw_profile(figure, p, drawn++);
  }
  sonde_text caption = {0};
  sonde_text_format(
      &caption,
      "Each parameter is held at the value on the axis while all others are estimated "
      "again; the curve is how much worse the fit becomes. Where it stays below the "
      "dashed line lies the 95\u00a0%% interval (shaded, written above).%s A flat curve "
      "would mean that the data do not determine the parameter.",
      quadratic ? " Dotted: what the covariance alone would say; where both agree the "
                  "problem is nearly linear."
                : "");
  sonde_figure_place(view, figure, caption.bytes ? caption.bytes : "");
  view->memory = view->memory || caption.failed;
  sonde_text_clear(&caption);
}

// ---- identifiability ----------------------------------------------------------------------------

static const char *data_of(const sonde_report_identifiability *row) {
  return row->data ? row->data : "";
}

static double name_width(const sonde_fit_report *r) {
  double widest = 60;
  for (uint32_t i = 0; i < r->identifiability_count; ++i)
    widest = fmax(widest, sonde_text_width(data_of(&r->identifiability[i]), 12));
  return fmin(widest + 12, 260);
}

// A group's title stands above its first bar.
static bool begins_group(const sonde_fit_report *r, uint32_t i) {
  const char *name = r->identifiability[i].parameter;
  const char *before = i ? r->identifiability[i - 1].parameter : NULL;
  return name && (!before || strcmp(name, before) != 0);
}

static void draw_bars(sonde_figure *figure, const sonde_fit_report *r, double left, double most) {
  double y = 8, width = figure->width - left - 130;
  SONDE_ASSERT(most > 0 && width > 0);
  for (uint32_t i = 0; i < r->identifiability_count; ++i) {
    const sonde_report_identifiability *row = &r->identifiability[i];
    if (begins_group(r, i)) {
      sonde_svg_text(&figure->body, 0, y + 18, "class='head'", row->parameter);
      y += 28;
    }
    bool known = isfinite(row->relative_sd) && row->relative_sd >= 0;
    double length = known ? width * row->relative_sd / most : width;
    char words[64];
    snprintf(words, sizeof words, known ? "%s %%" : "not determined",
             sonde_significant(100 * row->relative_sd, 3).s);
    sonde_svg_text(&figure->body, left - 10, y + 14, "class='end'", data_of(row));
    sonde_svg_rect(&figure->body, left, y + 2, length, 16,
                   known ? "fill='#0072b2' fill-opacity='.75'"
                         : "fill='none' stroke='#d55e00' stroke-dasharray='4 3'");
    sonde_svg_text(&figure->body, left + length + 8, y + 14, "class='tick'", words);
    sonde_svg_line(&figure->body, left, y - 3, left, y + 23, "class='axis'");
    y += 26;
  }
}

void sonde_report_identifiability_section(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  uint32_t groups = 0;
  double most = 0;
  if (!r->identifiability_count) return;
  for (uint32_t i = 0; i < r->identifiability_count; ++i) {
    groups += begins_group(r, i);
    if (isfinite(r->identifiability[i].relative_sd))
      most = fmax(most, r->identifiability[i].relative_sd);
  }
  sonde_page_section(view, "identifiability", "What the data determine");
  sonde_figure *figure = sonde_figure_begin(view, "identifiability", "Identifiability by data", 830,
                                            20.0 + 28 * groups + 26.0 * r->identifiability_count);
  draw_bars(figure, r, name_width(r), most > 0 ? most : 1);
  sonde_figure_place(view, figure,
                     "Relative standard deviation of the estimate (from the curvature of the cost) "
                     "with part of the data and with all. A long bar: these data alone leave the "
                     "parameter open; if the bar for all data is much shorter than either, the "
                     "probes determine it together.");
}
