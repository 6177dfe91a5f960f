// spread:      sites far apart from one another, the same for equal input.
// collect:     one curve's rows by depth, with the model's forces and the band.
// rank_curves: by how stiff they are, for colours that mean something.
// draw_*:      the figure of one probe.
#include "report/view.h"

#include "base/maths.h"

#include <string.h>

enum { CURVES = 11, POINTS = 200 };

// One curve; the model's begins with the origin.
typedef struct curve {
  uint32_t site, count; // place in the view's list; points without the origin
  double depth_mm[POINTS + 1], force_n[POINTS + 1], model_n[POINTS + 1];
  double low_n[POINTS + 1], high_n[POINTS + 1];
  double stiffness; // force over depth at half the deepest common depth
} curve;

static bool measured(const sonde_report_view *view, uint32_t site, uint32_t probe) {
  for (uint32_t i = 0; i < view->rows; ++i)
    if (view->row_site[i] == site && view->row_probe[i] == probe) return true;
  return false;
}

// Farthest-point choice: the first measured site, then always the one farthest from those chosen.
static uint32_t spread(const sonde_report_view *view, uint32_t probe, uint32_t chosen[CURVES]) {
  uint32_t count = 0;
  while (count < CURVES) {
    uint32_t best = SONDE_ALL;
    double best_m = count ? 0 : -1;
    for (uint32_t s = 0; s < view->site_count; ++s) {
      double away_m = INFINITY;
      for (uint32_t k = 0; k < count; ++k) {
        bool same = chosen[k] == s;
        double d = v_distance(view->sites[s].position_m, view->sites[chosen[k]].position_m);
        away_m = fmin(away_m, same ? -1 : isfinite(d) ? d : 0);
      }
      if (count == 0) away_m = best == SONDE_ALL ? 0 : -1;
      if (away_m > best_m && measured(view, s, probe)) best = s, best_m = away_m;
    }
    if (best == SONDE_ALL) break;
    chosen[count++] = best;
  }
  return count;
}

static void insert(curve *c, double depth_mm, double force_n, double model_n, double band_n) {
  uint32_t at = c->count + 1;
  SONDE_ASSERT(c->count < POINTS);
  for (; at > 1 && c->depth_mm[at - 1] > depth_mm; --at) {
    c->depth_mm[at] = c->depth_mm[at - 1];
    c->force_n[at] = c->force_n[at - 1];
    c->model_n[at] = c->model_n[at - 1];
    c->low_n[at] = c->low_n[at - 1];
    c->high_n[at] = c->high_n[at - 1];
  }
  c->depth_mm[at] = depth_mm;
  c->force_n[at] = force_n;
  c->model_n[at] = model_n;
  c->low_n[at] = model_n - band_n;
  c->high_n[at] = model_n + band_n;
  ++c->count;
}

static void collect(const sonde_report_view *view, uint32_t site, uint32_t probe, curve *c) {
  *c = (curve){.site = site};
  const double *model_n = view->main ? view->main->model_n : NULL;
  for (uint32_t i = 0; i < view->rows && c->count < POINTS; ++i) {
    if (view->row_site[i] != site || view->row_probe[i] != probe) continue;
    insert(c, 1e3 * view->depth_m[i], view->force_n[i], model_n ? model_n[i] : NAN,
           view->in->band_n ? view->in->band_n[i] : NAN);
  }
}

static double force_at(const curve *c, double depth_mm) {
  for (uint32_t i = 1; i <= c->count; ++i) {
    double span = c->depth_mm[i] - c->depth_mm[i - 1];
    if (c->depth_mm[i] < depth_mm || span <= 0) continue;
    double t = (depth_mm - c->depth_mm[i - 1]) / span;
    return (1 - t) * c->force_n[i - 1] + t * c->force_n[i];
  }
  return c->force_n[c->count];
}

static int stiffer_first(const void *a, const void *b) {
  const curve *x = a, *y = b;
  if (x->stiffness != y->stiffness) return x->stiffness > y->stiffness ? -1 : 1;
  return (x->site > y->site) - (x->site < y->site);
}

static void rank_curves(curve *curves, uint32_t count) {
  SONDE_ASSERT(count >= 1 && count <= CURVES);
  double common_mm = INFINITY;
  for (uint32_t i = 0; i < count; ++i)
    common_mm = fmin(common_mm, curves[i].depth_mm[curves[i].count]);
  for (uint32_t i = 0; i < count; ++i) curves[i].stiffness = force_at(&curves[i], common_mm);
  qsort(curves, count, sizeof *curves, stiffer_first);
}

static sonde_chart chart_of(sonde_text *out, const curve *curves, uint32_t count) {
  double deepest_mm = 0, most_n = 0;
  for (uint32_t i = 0; i < count; ++i)
    for (uint32_t k = 1; k <= curves[i].count; ++k) {
      const curve *c = &curves[i];
      deepest_mm = fmax(deepest_mm, c->depth_mm[k]);
      most_n = fmax(most_n, c->force_n[k]);
      if (isfinite(c->model_n[k])) most_n = fmax(most_n, fmin(c->model_n[k], 2 * c->force_n[k]));
    }
  return (sonde_chart){.out = out,
                       .left = 62,
                       .top = 22,
                       .width = 590,
                       .height = 390,
                       .x = sonde_axis_make(0, deepest_mm, 10),
                       .y = sonde_axis_make(0, most_n, 8)};
}

// Colours by rank keep clear of the lightest end, which is lost on white.
static sonde_colour colour_of(uint32_t rank, uint32_t count) {
  return sonde_colour_sequential(count > 1 ? 0.82 * rank / (count - 1) : 0, 1);
}

static void draw_curve(const sonde_chart *chart, const curve *c, const char *colour) {
  SONDE_ASSERT(c->count >= 1 && c->depth_mm[0] == 0);
  sonde_chart_clip(chart);
  sonde_chart_band(chart, c->depth_mm, c->low_n, c->high_n, c->count + 1, colour);
  sonde_chart_line(chart, c->depth_mm, c->model_n, c->count + 1, colour, NULL);
  sonde_chart_unclip(chart);
  for (uint32_t i = 1; i <= c->count; ++i)
    sonde_chart_mark(chart, c->depth_mm[i], c->force_n[i], 0, colour);
}

static void draw_legend(const sonde_report_view *view, const sonde_chart *chart,
                        const curve *curves, uint32_t count) {
  double x = chart->left + chart->width + 18, y = chart->top + 14;
  sonde_svg_text(chart->out, x, y, "class='head'", "Sites, stiffest first");
  for (uint32_t i = 0; i < count; ++i) {
    char name[32];
    snprintf(name, sizeof name, "site %u", view->sites[curves[i].site].id);
    sonde_legend(chart->out, x, y + 22 + 19 * i, view->main ? SONDE_SAMPLE_BOTH : SONDE_SAMPLE_MARK,
                 colour_of(i, count).s, name);
  }
  y += 22 + 19 * count + 14;
  sonde_legend(chart->out, x, y, SONDE_SAMPLE_MARK, "#444444", "measured");
  if (view->main) sonde_legend(chart->out, x, y + 19, SONDE_SAMPLE_LINE, "#444444", "model");
  if (view->in->band_n)
    sonde_legend(chart->out, x, y + 38, SONDE_SAMPLE_BOX, "#444444", "95 % band");
}

static void draw_probe(sonde_report_view *view, uint32_t probe, curve *curves) {
  uint32_t chosen[CURVES], count = spread(view, probe, chosen);
  for (uint32_t i = 0; i < count; ++i) collect(view, chosen[i], probe, &curves[i]);
  if (!count) return;
  rank_curves(curves, count);
  sonde_figure *figure = sonde_figure_begin_for(view, "curves", "Force against penetration, probe ",
                                                view->probe[probe], 830, 470);
  sonde_chart chart = chart_of(&figure->body, curves, count);
  sonde_chart_frame(&chart, NULL, "penetration, mm", "force, N");
  for (uint32_t i = count; i-- > 0;) draw_curve(&chart, &curves[i], colour_of(i, count).s);
  draw_legend(view, &chart, curves, count);
  sonde_text caption = {0};
  sonde_text_format(&caption, "%u of %u sites, spread over the measured area. Circles are measured",
                    count, view->site_count);
  if (view->main) sonde_text_put(&caption, ", lines are the model");
  if (view->in->band_n)
    sonde_text_put(&caption, ", the shaded band should hold 95\u00a0% of new measurements");
  sonde_text_put(&caption, ". Colours run from stiff (dark) to soft. A curve that bends upwards "
                           "says that the tissue stiffens as it is compressed; how far the curves "
                           "lie apart shows how much the thigh differs from place to place.");
  sonde_figure_place(view, figure, caption.bytes ? caption.bytes : "");
  view->memory = view->memory || caption.failed;
  sonde_text_clear(&caption);
}

void sonde_report_curves(sonde_report_view *view) {
  if (!view->rows) return;
  curve *curves = SONDE_NEW(curve, CURVES);
  view->memory = view->memory || !curves;
  if (!curves) return;
  sonde_page_section(view, "curves", "Force curves");
  for (uint32_t p = 0; p < view->probe_count; ++p) draw_probe(view, p, curves);
  sonde_free(curves);
}
