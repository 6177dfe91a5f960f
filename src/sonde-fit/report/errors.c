// bars_of:       counts of the errors in bins of a round width.
// draw_bars, draw_overlays, draw_key: the histogram with the fitted distributions.
// distribution_table: what was fitted.
// depth_axis, draw_depth_probe: bias by depth, one panel per probe.
// running_median: of errors over the model's force, in equal groups.
#include "report/view.h"

#include "base/maths.h"
#include "report/distribution.h"

#include <string.h>

static const double CORRIDOR_PERCENT = 8;
static const char *const OVERLAY[SONDE_DISTRIBUTIONS] = {"#0072b2", "#d55e00", "#009e73"};
static const char *const OVERLAY_DASH[SONDE_DISTRIBUTIONS] = {"", "stroke-dasharray='7 3'",
                                                              "stroke-dasharray='2 3'"};

// ---- histogram ----------------------------------------------------------------------------------

enum { BARS = 64, OVERLAY_POINTS = 241 };

typedef struct histogram {
  double step_n;
  long first; // the first bar begins at first * step_n
  uint32_t bars, outside, total;
  uint32_t count[BARS];
  double share_percent[BARS];
} histogram;

// Width after Freedman and Diaconis; the middle 99 % of the errors, zero in sight.
static void bars_of(const double *sorted, uint32_t count, histogram *h) {
  SONDE_ASSERT(count > 0 && sorted[0] <= sorted[count - 1]);
  double low = fmin(sonde_percentile(sorted, count, 0.005), 0);
  double high = fmax(sonde_percentile(sorted, count, 0.995), 0);
  double quartiles = sonde_percentile(sorted, count, 0.75) - sonde_percentile(sorted, count, 0.25);
  double width = fmax(2 * quartiles / cbrt(count), (high - low) / (BARS - 4));
  *h = (histogram){.total = count, .step_n = sonde_nice_step(fmax(width, 1e-12))};
  h->first = (long)floor(low / h->step_n);
  h->bars = (uint32_t)((long)floor(high / h->step_n) + 1 - h->first);
  SONDE_ASSERT(h->bars <= BARS);
  for (uint32_t i = 0; i < count; ++i) {
    double place = floor(sorted[i] / h->step_n) - (double)h->first;
    if (place >= 0 && place < h->bars)
      ++h->count[(uint32_t)place];
    else
      ++h->outside;
  }
  for (uint32_t b = 0; b < h->bars; ++b) h->share_percent[b] = 100.0 * h->count[b] / count;
}

static double tallest(const histogram *h, const sonde_distribution *fits, const bool *fitted) {
  double most = 0;
  for (uint32_t b = 0; b < h->bars; ++b) most = fmax(most, h->share_percent[b]);
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k)
    if (fitted[k])
      most = fmax(most, fmin(1.6 * most, 100 * h->step_n *
                                             sonde_distribution_density(&fits[k], fits[k].place)));
  return most;
}

static void draw_bars(const sonde_chart *chart, const histogram *h) {
  for (uint32_t b = 0; b < h->bars; ++b) {
    double from = (double)(h->first + (long)b) * h->step_n;
    if (h->count[b])
      sonde_chart_box(chart, from, from + h->step_n, 0, h->share_percent[b],
                      "fill='#cfd8de' stroke='#8fa1ad' stroke-width='.8'");
  }
}

// The share that a distribution expects in a bar is its density times the bar's width.
static void draw_overlay(const sonde_chart *chart, const histogram *h, const sonde_distribution *d,
                         int index) {
  double x[OVERLAY_POINTS], y[OVERLAY_POINTS];
  for (int i = 0; i < OVERLAY_POINTS; ++i) {
    x[i] = chart->x.low + (chart->x.high - chart->x.low) * i / (OVERLAY_POINTS - 1);
    y[i] = 100 * h->step_n * sonde_distribution_density(d, x[i]);
  }
  sonde_chart_line(chart, x, y, OVERLAY_POINTS, OVERLAY[index], OVERLAY_DASH[index]);
}

static void draw_key(const sonde_chart *chart, const bool *fitted) {
  double x = chart->left + chart->width - 150, y = chart->top + 16;
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k) {
    if (!fitted[k]) continue;
    char look[120];
    snprintf(look, sizeof look, "stroke='%s' stroke-width='1.8' %s", OVERLAY[k], OVERLAY_DASH[k]);
    sonde_svg_line(chart->out, x, y - 4, x + 26, y - 4, look);
    sonde_svg_text(chart->out, x + 32, y, "class='tick'",
                   sonde_distribution_name((sonde_distribution_kind)k));
    y += 18;
  }
}

static void distribution_table(sonde_report_view *view, const sonde_distribution *fits,
                               const bool *fitted) {
  static const char *const HEADS[] = {"<Distribution",      "Centre, N",      "Scale, N",
                                      "Degrees of freedom", "Log-likelihood", "AIC",
                                      "AIC above best"};
  double best = INFINITY;
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k)
    if (fitted[k]) best = fmin(best, fits[k].aic);
  if (!isfinite(best)) return;
  sonde_table_begin(view, "Distributions fitted to the errors by maximum likelihood. Scale: "
                          "standard deviation of the normal, mean distance from the centre of the "
                          "Laplace, scale of the t. The lower the AIC, the better the "
                          "description.");
  sonde_table_head(view, HEADS, SONDE_COUNT_OF(HEADS));
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k) {
    if (!fitted[k]) continue;
    sonde_row_begin(view, fits[k].aic <= best);
    sonde_cell_text(view, sonde_distribution_name(fits[k].kind));
    sonde_cell(view, sonde_fixed(fits[k].place, 4));
    sonde_cell(view, sonde_fixed(fits[k].scale, 4));
    sonde_cell_words(view, k == SONDE_STUDENT ? sonde_significant(fits[k].freedom, 3).s : "");
    sonde_cell(view, sonde_fixed(fits[k].log_likelihood, 1));
    sonde_cell(view, sonde_fixed(fits[k].aic, 1));
    sonde_cell(view, sonde_fixed(fits[k].aic - best, 1));
    sonde_row_end(view);
  }
  sonde_table_end(view);
}

static void histogram_caption(sonde_report_view *view, sonde_figure *figure, const histogram *h) {
  sonde_text caption = {0};
  sonde_text_format(&caption,
                    "Errors (model minus measurement) of %s forces in bars of %s\u00a0N. Lines are "
                    "distributions fitted to the errors themselves, not to the bars. Bars far from "
                    "the middle that stand above the normal line are large errors that a normal "
                    "distribution would not expect.",
                    sonde_grouped(h->total).s, sonde_significant(h->step_n, 1).s);
  if (h->outside)
    sonde_text_format(&caption, " %s errors (%s\u00a0%%) lie outside the drawn range.",
                      sonde_grouped(h->outside).s,
                      sonde_significant(100.0 * h->outside / h->total, 2).s);
  sonde_figure_place(view, figure, caption.bytes ? caption.bytes : "");
  view->memory = view->memory || caption.failed;
  sonde_text_clear(&caption);
}

static void histogram_figure(sonde_report_view *view) {
  double *errors = view->scratch[0];
  uint32_t count = sonde_view_errors(view, SONDE_PICK_ALL, errors);
  if (!count) return;
  histogram h;
  sonde_distribution fits[SONDE_DISTRIBUTIONS];
  bool fitted[SONDE_DISTRIBUTIONS];
  bars_of(errors, count, &h);
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k)
    fitted[k] = sonde_distribution_fit((sonde_distribution_kind)k, errors, count, &fits[k]);
  sonde_figure *figure =
      sonde_figure_begin(view, "histogram", "Distribution of the errors", 830, 390);
  double from = (double)h.first * h.step_n, to = from + h.bars * h.step_n;
  sonde_chart chart = {&figure->body,
                       62,
                       20,
                       740,
                       315,
                       sonde_axis_tight(from, to, 12),
                       sonde_axis_make(0, tallest(&h, fits, fitted), 6)};
  sonde_chart_frame(&chart, NULL, "error, N", "share of measurements per bar, %");
  draw_bars(&chart, &h);
  sonde_chart_upright(&chart, 0, "class='zero'");
  sonde_chart_clip(&chart);
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k)
    if (fitted[k]) draw_overlay(&chart, &h, &fits[k], k);
  sonde_chart_unclip(&chart);
  draw_key(&chart, fitted);
  histogram_caption(view, figure, &h);
  distribution_table(view, fits, fitted);
}

// ---- relative error by depth --------------------------------------------------------------------

static double deepest_bin_mm(const sonde_report_view *view) {
  return 1e3 * view->bin_m * (view->bin_count - 0.5);
}

static sonde_axis percent_axis(sonde_report_view *view) {
  double least = -12, most = 12;
  for (uint32_t p = 0; p < view->probe_count; ++p)
    for (uint32_t bin = 1; bin < view->bin_count; ++bin) {
      sonde_report_group g;
      sonde_report_pick pick = {p, SONDE_ALL, bin};
      if (!sonde_view_group(view, view->main->model_n, pick, &g)) continue;
      if (isfinite(g.low_percent)) least = fmin(least, fmax(g.low_percent, -100));
      if (isfinite(g.high_percent)) most = fmax(most, fmin(g.high_percent, 150));
      if (isfinite(g.bias_percent)) {
        least = fmin(least, fmax(g.bias_percent, -100));
        most = fmax(most, fmin(g.bias_percent, 150));
      }
    }
  return sonde_axis_make(least, most, 7);
}

static void draw_depth_probe(sonde_report_view *view, const sonde_chart *chart, uint32_t probe) {
  double x[SONDE_REPORT_BINS], y[SONDE_REPORT_BINS];
  uint32_t count = 0;
  const char *colour = sonde_palette(probe);
  char look[80];
  snprintf(look, sizeof look, "fill='%s' fill-opacity='.25'", colour);
  sonde_chart_box(chart, chart->x.low, chart->x.high, -CORRIDOR_PERCENT, CORRIDOR_PERCENT,
                  "fill='#f0efe6'");
  sonde_chart_across(chart, CORRIDOR_PERCENT, "class='dash'");
  sonde_chart_across(chart, -CORRIDOR_PERCENT, "class='dash'");
  sonde_chart_across(chart, 0, "class='zero'");
  for (uint32_t bin = 1; bin < view->bin_count; ++bin) {
    sonde_report_group g;
    sonde_report_pick pick = {probe, SONDE_ALL, bin};
    if (!sonde_view_group(view, view->main->model_n, pick, &g)) continue;
    double middle = 1e3 * bin * view->bin_m, half = 300 * view->bin_m;
    sonde_chart_box(chart, middle - half, middle + half, g.low_percent, g.high_percent, look);
    x[count] = middle;
    y[count++] = g.bias_percent;
  }
  sonde_chart_clip(chart);
  sonde_chart_line(chart, x, y, count, colour, NULL);
  sonde_chart_unclip(chart);
  for (uint32_t i = 0; i < count; ++i) sonde_chart_mark(chart, x[i], y[i], probe, colour);
}

static void depth_figure(sonde_report_view *view) {
  enum { PANEL = 230, GAP = 62 };
  double height = 30 + (double)view->probe_count * (PANEL + GAP);
  sonde_figure *figure = sonde_figure_begin(view, "depth", "Relative error by depth", 830, height);
  sonde_axis percent = percent_axis(view);
  for (uint32_t p = 0; p < view->probe_count; ++p) {
    char title[64];
    snprintf(title, sizeof title, "probe %s", view->probe[p]);
    sonde_chart chart = {&figure->body, 62,    28 + (double)p * (PANEL + GAP),
                         740,           PANEL, sonde_axis_tight(0, deepest_bin_mm(view), 16),
                         percent};
    bool last = p + 1 == view->probe_count;
    sonde_chart_frame(&chart, title, last ? "penetration, mm" : NULL, "error over force, %");
    draw_depth_probe(view, &chart, p);
  }
  sonde_figure_place(view, figure,
                     "Marks: summed errors over summed forces at each depth, which is the bias "
                     "there; positive means that the model is too stiff. Boxes hold the middle "
                     "half of the single relative errors. Dashed lines mark \u00b18\u00a0%. Forces "
                     "at small depths are small, so that a few hundredths of a newton weigh much "
                     "here and little in the mean error.");
}

// ---- residuals ----------------------------------------------------------------------------------

typedef struct fitted_pair {
  double force_n, error_n;
} fitted_pair;

static int compare_pairs(const void *a, const void *b) {
  const fitted_pair *x = a, *y = b;
  int order = (x->force_n > y->force_n) - (x->force_n < y->force_n);
  return order ? order : (x->error_n > y->error_n) - (x->error_n < y->error_n);
}

// Median error of equal groups of rows ordered by the model's force.
static uint32_t running_median(const sonde_report_view *view, uint32_t probe, fitted_pair *pairs,
                               double *x, double *y, uint32_t groups) {
  uint32_t count = 0, made = 0;
  for (uint32_t i = 0; i < view->rows; ++i)
    if (view->row_probe[i] == probe && isfinite(view->main->model_n[i]))
      pairs[count++] =
          (fitted_pair){view->main->model_n[i], view->main->model_n[i] - view->force_n[i]};
  qsort(pairs, count, sizeof *pairs, compare_pairs);
  if (count < 4 * groups) return 0;
  for (uint32_t g = 0; g < groups; ++g) {
    uint32_t from = g * count / groups, to = (g + 1) * count / groups, used = 0;
    double sum = 0;
    for (uint32_t i = from; i < to; ++i) {
      sum += pairs[i].force_n;
      view->scratch[2][used++] = pairs[i].error_n;
    }
    qsort(view->scratch[2], used, sizeof(double), sonde_compare_reals);
    x[made] = sum / used;
    y[made++] = sonde_percentile(view->scratch[2], used, 0.5);
  }
  return made;
}

static void draw_residuals(sonde_report_view *view, const sonde_chart *chart) {
  enum { GROUPS = 12 };
  double x[GROUPS], y[GROUPS];
  for (uint32_t p = 0; p < view->probe_count; ++p) {
    uint32_t used = 0;
    for (uint32_t i = 0; i < view->rows; ++i) {
      if (view->row_probe[i] != p || !isfinite(view->main->model_n[i])) continue;
      view->scratch[0][used] = view->main->model_n[i];
      view->scratch[1][used++] = view->main->model_n[i] - view->force_n[i];
    }
    sonde_chart_dots(chart, view->scratch[0], view->scratch[1], used, sonde_palette(p), 3, p & 1);
  }
  fitted_pair *pairs = SONDE_NEW(fitted_pair, view->rows);
  view->memory = view->memory || !pairs;
  sonde_chart_clip(chart);
  for (uint32_t p = 0; pairs && p < view->probe_count; ++p) {
    uint32_t made = running_median(view, p, pairs, x, y, GROUPS);
    sonde_chart_line(chart, x, y, made, "#fff", "style='stroke-width:5px'");
    sonde_chart_line(chart, x, y, made, sonde_palette(p), "style='stroke-width:2.6px'");
  }
  sonde_chart_unclip(chart);
  sonde_free(pairs);
}

static void residual_figure(sonde_report_view *view) {
  double most = 0, least_error = 0, most_error = 0;
  for (uint32_t i = 0; i < view->rows; ++i) {
    double model_n = view->main->model_n[i];
    if (!isfinite(model_n)) continue;
    most = fmax(most, model_n);
    least_error = fmin(least_error, model_n - view->force_n[i]);
    most_error = fmax(most_error, model_n - view->force_n[i]);
  }
  sonde_figure *figure =
      sonde_figure_begin(view, "residuals", "Error against the model's force", 830, 420);
  sonde_chart chart = {&figure->body,
                       62,
                       40,
                       740,
                       325,
                       sonde_axis_make(0, most, 10),
                       sonde_axis_make(least_error, most_error, 7)};
  sonde_chart_frame(&chart, NULL, "force of the model, N", "error, N");
  sonde_chart_across(&chart, 0, "class='zero'");
  draw_residuals(view, &chart);
  double x = chart.left;
  for (uint32_t p = 0; p < view->probe_count; ++p) {
    char name[64];
    snprintf(name, sizeof name, "probe %s", view->probe[p]);
    x += sonde_legend(&figure->body, x, 22, SONDE_SAMPLE_LINE, sonde_palette(p), name);
  }
  sonde_figure_place(view, figure,
                     "One dot per measurement; lines are medians of groups of equal size. A line "
                     "that leaves zero is an error of the model's shape rather than scatter; dots "
                     "that fan out to the right are errors that grow with the force.");
}

void sonde_report_errors(sonde_report_view *view) {
  if (!view->main || !sonde_view_errors(view, SONDE_PICK_ALL, view->scratch[0])) return;
  sonde_page_section(view, "errors", "Errors");
  histogram_figure(view);
  depth_figure(view);
  residual_figure(view);
}
