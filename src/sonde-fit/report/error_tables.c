// group_row:   statistics of one group of measurements.
// probe_table, depth_table, site_table: groups by probe, by depth, the worst sites.
#include "report/view.h"

#include "base/maths.h"

#include <string.h>

enum { WORST_SITES = 10 };

static const char *const MEASURES[] = {"n",       "MAE, N",    "SD, N",    "SD |e|, N",
                                       "RMSE, N", "bias, N",   "median",   "95th %",
                                       "max",     "% of mean", "of range", "of max"};

static void group_cells(sonde_report_view *view, const sonde_report_group *g) {
  const sonde_error_statistics *s = &g->errors;
  double range_n = g->most_n - g->least_n;
  const double values[] = {s->mae_n,  s->sd_n,         s->sd_abs_n,  s->rmse_n,
                           s->bias_n, s->median_abs_n, s->p95_abs_n, s->max_abs_n};
  sonde_cell(view, sonde_grouped(s->count));
  for (size_t i = 0; i < SONDE_COUNT_OF(values); ++i) sonde_cell(view, sonde_fixed(values[i], 3));
  sonde_cell(view, sonde_fixed(s->mae_percent, 2));
  sonde_cell(view, sonde_fixed(range_n > 0 ? 100 * s->mae_n / range_n : NAN, 2));
  sonde_cell(view, sonde_fixed(g->most_n > 0 ? 100 * s->mae_n / g->most_n : NAN, 2));
}

static void measure_head(sonde_report_view *view, const char *first) {
  enum { COUNT = SONDE_COUNT_OF(MEASURES) };
  const char *heads[COUNT + 1];
  heads[0] = first;
  memcpy(heads + 1, MEASURES, sizeof MEASURES);
  sonde_table_head(view, heads, COUNT + 1);
}

static void group_row(sonde_report_view *view, const char *name, sonde_report_pick pick,
                      bool strong) {
  sonde_report_group group;
  if (!sonde_view_group(view, view->main->model_n, pick, &group)) return;
  sonde_row_begin(view, strong);
  sonde_cell_text(view, name);
  group_cells(view, &group);
  sonde_row_end(view);
}

static void probe_table(sonde_report_view *view) {
  sonde_table_begin(view,
                    "Errors by probe. e = model \u2212 measurement; MAE: mean |e|; SD: standard "
                    "deviation of e; SD |e|: the same of |e|; median, 95th percentile and maximum "
                    "of |e| in N; the last "
                    "three columns: MAE as a share of the mean, of the range and of the largest "
                    "measured force.");
  measure_head(view, "<Probe");
  for (uint32_t p = 0; p < view->probe_count; ++p)
    group_row(view, view->probe[p], (sonde_report_pick){p, SONDE_ALL, SONDE_ALL}, false);
  if (view->probe_count > 1) group_row(view, "all", SONDE_PICK_ALL, true);
  sonde_table_end(view);
}

static void depth_cells(sonde_report_view *view, uint32_t probe, uint32_t bin) {
  sonde_report_group g;
  sonde_report_pick pick = {probe, SONDE_ALL, bin};
  if (!sonde_view_group(view, view->main->model_n, pick, &g)) {
    for (int i = 0; i < 6; ++i) sonde_cell_words(view, "");
    return;
  }
  sonde_cell(view, sonde_grouped(g.errors.count));
  sonde_cell(view, sonde_fixed(g.errors.mean_force_n, 2));
  sonde_cell(view, sonde_fixed(g.errors.mae_n, 3));
  sonde_cell(view, sonde_fixed(g.errors.sd_n, 3));
  sonde_cell(view, sonde_fixed(g.errors.mae_percent, 1));
  sonde_cell(view, sonde_fixed_signed(g.bias_percent, 1));
}

static void depth_table(sonde_report_view *view) {
  sonde_text *page = &view->page;
  sonde_table_begin(view, "Errors by depth. %: MAE over the mean force at that depth; bias: summed "
                          "errors over summed forces.");
  sonde_text_put(page, "<thead><tr><th rowspan=\"2\">Depth, mm</th>");
  for (uint32_t p = 0; p < view->probe_count; ++p) {
    sonde_text_put(page, "<th colspan=\"6\">");
    sonde_text_escape(page, view->probe[p]);
    sonde_text_put(page, "</th>");
  }
  sonde_text_put(page, "</tr>\n<tr>");
  for (uint32_t p = 0; p < view->probe_count; ++p)
    sonde_text_put(page, "<th>n</th><th>mean, N</th><th>MAE, N</th><th>SD, N</th><th>%</th>"
                         "<th>bias, %</th>");
  sonde_text_put(page, "</tr></thead>\n<tbody>\n");
  for (uint32_t bin = 0; bin < view->bin_count; ++bin) {
    sonde_report_group g;
    sonde_report_pick pick = {SONDE_ALL, SONDE_ALL, bin};
    if (!sonde_view_group(view, view->main->model_n, pick, &g)) continue;
    sonde_row_begin(view, false);
    sonde_cell(view, sonde_short(1e3 * bin * view->bin_m));
    for (uint32_t p = 0; p < view->probe_count; ++p) depth_cells(view, p, bin);
    sonde_row_end(view);
  }
  sonde_table_end(view);
}

typedef struct site_error {
  uint32_t site;
  double percent;
} site_error;

static int worst_first(const void *a, const void *b) {
  const site_error *x = a, *y = b;
  if (x->percent != y->percent) return x->percent > y->percent ? -1 : 1;
  return (x->site > y->site) - (x->site < y->site);
}

static uint32_t rank_sites(sonde_report_view *view, site_error *sites) {
  uint32_t count = 0;
  for (uint32_t s = 0; s < view->site_count; ++s) {
    sonde_report_group g;
    sonde_report_pick pick = {SONDE_ALL, s, SONDE_ALL};
    if (sonde_view_group(view, view->main->model_n, pick, &g) && isfinite(g.errors.mae_percent))
      sites[count++] = (site_error){s, g.errors.mae_percent};
  }
  qsort(sites, count, sizeof *sites, worst_first);
  return count;
}

static void site_table(sonde_report_view *view) {
  site_error *sites = SONDE_NEW(site_error, view->site_count);
  view->memory = view->memory || !sites;
  if (!sites) return;
  uint32_t count = rank_sites(view, sites);
  SONDE_ASSERT(count <= view->site_count);
  char caption[160];
  snprintf(caption, sizeof caption,
           count > WORST_SITES ? "The ten sites of %u with the largest MAE over their mean force; "
                                 "columns as above."
                               : "Errors at the %u sites; columns as above.",
           count);
  sonde_table_begin(view, caption);
  measure_head(view, "<Site");
  for (uint32_t i = 0; i < count && i < WORST_SITES; ++i) {
    char name[16];
    snprintf(name, sizeof name, "%u", view->sites[sites[i].site].id);
    group_row(view, name, (sonde_report_pick){SONDE_ALL, sites[i].site, SONDE_ALL}, false);
  }
  sonde_table_end(view);
  sonde_free(sites);
}

void sonde_report_error_tables(sonde_report_view *view) {
  if (!view->main || !sonde_view_errors(view, SONDE_PICK_ALL, view->scratch[0])) return;
  sonde_page_section(view, "tables", "Error tables");
  probe_table(view);
  depth_table(view);
  site_table(view);
}
