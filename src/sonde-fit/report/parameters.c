// interval_words: "a to b", an en dash when unknown.
// columns_of:     which intervals the report has at all.
// site_panel:     one parameter over the sites with its intervals.
#include "report/view.h"

#include "base/maths.h"

#include <string.h>

sonde_report_interval sonde_report_value(double value) {
  return (sonde_report_interval){value, NAN, NAN, NAN, NAN};
}

typedef struct interval_columns {
  bool bounds, bootstrap;
} interval_columns;

static void columns_of(const sonde_report_interval *i, interval_columns *columns) {
  columns->bounds = columns->bounds || isfinite(i->lower) || isfinite(i->upper);
  columns->bootstrap =
      columns->bootstrap || isfinite(i->bootstrap_lower) || isfinite(i->bootstrap_upper);
}

static void interval_words(sonde_report_view *view, double lower, double upper, int digits) {
  sonde_number low = sonde_significant(lower, digits), high = sonde_significant(upper, digits);
  bool any = isfinite(lower) || isfinite(upper);
  if (any)
    sonde_text_format(&view->page, "<td>%s to %s</td>", isfinite(lower) ? low.s : "?",
                      isfinite(upper) ? high.s : "?");
  else
    sonde_text_put(&view->page, "<td>\u2013</td>");
}

static void interval_cells(sonde_report_view *view, const sonde_report_interval *i, double factor,
                           interval_columns columns) {
  sonde_cell(view, sonde_significant(factor * i->value, 4));
  if (columns.bounds) interval_words(view, factor * i->lower, factor * i->upper, 4);
  if (columns.bootstrap)
    interval_words(view, factor * i->bootstrap_lower, factor * i->bootstrap_upper, 4);
}

static void parameter_table(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  interval_columns columns = {false, false};
  const char *heads[6];
  uint32_t count = 0;
  bool notes = false;
  for (uint32_t i = 0; i < r->parameter_count; ++i) {
    columns_of(&r->parameters[i].estimate, &columns);
    notes = notes || r->parameters[i].note;
  }
  heads[count++] = "<Parameter";
  heads[count++] = "Value";
  if (columns.bounds) heads[count++] = "95 % interval";
  if (columns.bootstrap) heads[count++] = "95 % bootstrap";
  heads[count++] = "<Unit";
  if (notes) heads[count++] = "<Note";
  SONDE_ASSERT(count <= SONDE_COUNT_OF(heads));
  sonde_table_begin(view, "Parameters of the whole model.");
  sonde_table_head(view, heads, count);
  for (uint32_t i = 0; i < r->parameter_count; ++i) {
    const sonde_report_parameter *p = &r->parameters[i];
    sonde_row_begin(view, false);
    sonde_cell_text(view, p->name);
    interval_cells(view, &p->estimate, 1, columns);
    sonde_cell_text(view, p->unit);
    if (notes) sonde_cell_text(view, p->note);
    sonde_row_end(view);
  }
  sonde_table_end(view);
}

// ---- sites --------------------------------------------------------------------------------------

typedef struct site_column {
  const char *head;
  double factor;
} site_column;
enum { SITE_COLUMNS = 4 };
static const site_column SITE_COLUMN[SITE_COLUMNS] = {
    {"k\u2080, kPa/mm", 1e-6}, {"x\u2098, mm", 1e3}, {"G, N/m", 1}, {"g\u2098", 1}};

static const sonde_report_interval *column_of(const sonde_report_site *s, int column) {
  const sonde_report_interval *const of[SITE_COLUMNS] = {&s->k0_n_m3, &s->xm_m, &s->shear_n_m,
                                                         &s->shear_limit};
  return of[column];
}

static void site_table(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  interval_columns columns = {false, false};
  bool sheared = r->site_parameter_count > 0 && r->site_parameters[0].shear_n_m.value > 0;
  int shown = sheared ? SITE_COLUMNS : 2;
  for (uint32_t i = 0; i < r->site_parameter_count; ++i)
    for (int k = 0; k < shown; ++k) columns_of(column_of(&r->site_parameters[i], k), &columns);
  const char *heads[1 + 3 * SITE_COLUMNS];
  uint32_t count = 0;
  heads[count++] = "Site";
  for (int k = 0; k < shown; ++k) {
    heads[count++] = SITE_COLUMN[k].head;
    if (columns.bounds) heads[count++] = "95 % interval";
    if (columns.bootstrap) heads[count++] = "95 % bootstrap";
  }
  SONDE_ASSERT(count <= SONDE_COUNT_OF(heads));
  sonde_text_put(&view->page, "<details><summary>Parameters of every site</summary>\n");
  sonde_table_begin(
      view,
      sheared ? "Parameters of the sites: normal springs k\u2080, x\u2098, shear layer G, g\u2098."
              : "Parameters of the sites: p(s) = k\u2080 s/(1 \u2212 s/x\u2098).");
  sonde_table_head(view, heads, count);
  for (uint32_t i = 0; i < r->site_parameter_count; ++i) {
    const sonde_report_site *s = &r->site_parameters[i];
    sonde_row_begin(view, false);
    sonde_text_format(&view->page, "<td>%u</td>", s->site);
    for (int k = 0; k < shown; ++k)
      interval_cells(view, column_of(s, k), SITE_COLUMN[k].factor, columns);
    sonde_row_end(view);
  }
  sonde_table_end(view);
  sonde_text_put(&view->page, "</details>\n");
}

static const sonde_report_interval *pick_of(const sonde_report_site *site, bool xm) {
  return xm ? &site->xm_m : &site->k0_n_m3;
}

static sonde_axis value_axis(const sonde_fit_report *r, bool xm, double factor) {
  double least = INFINITY, most = -INFINITY;
  for (uint32_t i = 0; i < r->site_parameter_count; ++i) {
    const sonde_report_interval *v = pick_of(&r->site_parameters[i], xm);
    // A wide interval must not squeeze the values: it is cut at three times the value.
    const double ends[3] = {v->value, fmax(v->lower, v->value / 3), fmin(v->upper, v->value * 3)};
    for (int k = 0; k < 3; ++k)
      if (isfinite(ends[k]))
        least = fmin(least, factor * ends[k]), most = fmax(most, factor * ends[k]);
  }
  return sonde_axis_make(least, most, 6);
}

// An interval that is open on one side goes on to the edge of the plot.
static void draw_interval(const sonde_chart *chart, double x, double low, double high,
                          const char *look) {
  if (!isfinite(low) && !isfinite(high)) return;
  double bottom = isfinite(low) ? fmax(low, chart->y.low) : chart->y.low;
  double top = isfinite(high) ? fmin(high, chart->y.high) : chart->y.high;
  if (!(bottom < top)) return;
  double at = sonde_chart_x(chart, x);
  sonde_svg_line(chart->out, at, sonde_chart_y(chart, top), at, sonde_chart_y(chart, bottom), look);
}

static void site_panel(sonde_report_view *view, sonde_figure *figure, bool xm) {
  const sonde_fit_report *r = view->in;
  double factor = xm ? 1e3 : 1e-6, most_id = 1;
  for (uint32_t i = 0; i < r->site_parameter_count; ++i)
    most_id = fmax(most_id, r->site_parameters[i].site);
  sonde_chart chart = {&figure->body,
                       62,
                       xm ? 308 : 28,
                       740,
                       200,
                       sonde_axis_tight(-1, most_id + 1, 16),
                       value_axis(r, xm, factor)};
  sonde_chart_frame(&chart, xm ? "x\u2098" : "k\u2080", "site", xm ? "mm" : "kPa/mm");
  for (uint32_t i = 0; i < r->site_parameter_count; ++i) {
    const sonde_report_interval *v = pick_of(&r->site_parameters[i], xm);
    double x = r->site_parameters[i].site;
    draw_interval(&chart, x - 0.12, factor * v->lower, factor * v->upper,
                  "stroke='#0072b2' stroke-width='1.6'");
    draw_interval(&chart, x + 0.12, factor * v->bootstrap_lower, factor * v->bootstrap_upper,
                  "stroke='#d55e00' stroke-width='1.6'");
    sonde_chart_mark(&chart, x, factor * v->value, 0, "#222222");
  }
}

static void site_figure(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  interval_columns columns = {false, false};
  for (uint32_t i = 0; i < r->site_parameter_count; ++i) {
    columns_of(&r->site_parameters[i].k0_n_m3, &columns);
    columns_of(&r->site_parameters[i].xm_m, &columns);
  }
  sonde_figure *figure = sonde_figure_begin(view, "sites", "Parameters of the sites", 830, 560);
  site_panel(view, figure, false);
  site_panel(view, figure, true);
  double x = 520;
  if (columns.bounds)
    x += sonde_legend(&figure->body, x, 18, SONDE_SAMPLE_LINE, "#0072b2", "95 % interval");
  if (columns.bootstrap)
    sonde_legend(&figure->body, x, 18, SONDE_SAMPLE_LINE, "#d55e00", "95 % bootstrap");
  bool any = columns.bounds || columns.bootstrap;
  sonde_figure_place(view, figure,
                     any ? "Circles are estimates, lines their intervals, drawn up to three times "
                           "the value. Where the lines of two sites do not overlap, the "
                           "thigh differs there by more than the estimation's uncertainty."
                         : "Circles are estimates; this report gives no intervals for them.");
}

void sonde_report_parameters(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  if (!r->parameter_count && !r->site_parameter_count) return;
  sonde_page_section(view, "parameters", "Parameters");
  if (r->parameter_count) parameter_table(view);
  if (!r->site_parameter_count) return;
  site_figure(view);
  site_table(view);
}
