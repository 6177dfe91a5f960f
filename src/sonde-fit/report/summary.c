// key:            one of the large figures at the top.
// corridor:       the depths at which a probe's bias leaves the corridor.
// words_about_*:  sentences of the summary.
// stage_row:      one stage in the table, probe by probe.
#include "report/view.h"

#include "base/maths.h"

#include <string.h>

static const double CORRIDOR_PERCENT = 8;

static void key(sonde_report_view *view, const char *value, const char *unit, const char *meaning) {
  sonde_text_format(&view->page, "<div><b>%s %s</b><span>%s</span></div>\n", value, unit, meaning);
}

static void words_about_all(sonde_report_view *view, const sonde_report_group *all) {
  sonde_text *page = &view->page;
  const sonde_error_statistics *s = &all->errors;
  sonde_text_put(page, "<p>The model of \u201c");
  sonde_text_escape(page, view->main->name);
  sonde_text_put(page, "\u201d");
  if (view->main->parameters) sonde_text_format(page, " (%u parameters)", view->main->parameters);
  sonde_text_format(page, " was compared with %s forces measured at %u sites under %u probe%s. ",
                    sonde_grouped(s->count).s, view->site_count, view->probe_count,
                    view->probe_count == 1 ? "" : "s");
  sonde_text_format(
      page,
      "On average it misses a force by %s\u00a0N (mean absolute error, MAE), which is "
      "%s\u00a0%% of the mean force of %s\u00a0N. Half of the errors are below "
      "%s\u00a0N, 95\u00a0%% below %s\u00a0N; the largest is %s\u00a0N. ",
      sonde_significant(s->mae_n, 3).s, sonde_significant(s->mae_percent, 3).s,
      sonde_significant(s->mean_force_n, 3).s, sonde_significant(s->median_abs_n, 3).s,
      sonde_significant(s->p95_abs_n, 3).s, sonde_significant(s->max_abs_n, 3).s);
  sonde_text_format(page,
                    "Errors scatter by %s\u00a0N (standard deviation, SD) about a bias of "
                    "%s\u00a0N. An error is model minus measurement throughout.",
                    sonde_significant(s->sd_n, 3).s, sonde_significant(s->bias_n, 2).s);
  if (s->count < view->rows)
    sonde_text_format(page, " For %s measurements the model has no force; they are left out.",
                      sonde_grouped(view->rows - s->count).s);
  sonde_text_put(page, "</p>\n");
}

static void corridor(sonde_report_view *view, uint32_t probe) {
  uint32_t outside = 0, known = 0;
  for (uint32_t bin = 1; bin < view->bin_count; ++bin) {
    sonde_report_group group;
    sonde_report_pick pick = {probe, SONDE_ALL, bin};
    if (!sonde_view_group(view, view->main->model_n, pick, &group)) continue;
    ++known;
    if (!(fabs(group.bias_percent) > CORRIDOR_PERCENT)) continue;
    sonde_text_format(&view->page, "%s%s\u00a0mm (%s\u00a0%%)",
                      outside ? ", " : "; its bias leaves the corridor of \u00b18\u00a0% at ",
                      sonde_short(bin * view->bin_m * 1e3).s,
                      sonde_fixed_signed(group.bias_percent, 1).s);
    ++outside;
  }
  if (known && !outside)
    sonde_text_put(&view->page, "; its bias stays within \u00b18\u00a0% at every depth");
}

static void words_about_probes(sonde_report_view *view) {
  sonde_text_put(&view->page, "<ul>\n");
  for (uint32_t p = 0; p < view->probe_count; ++p) {
    sonde_report_group group;
    sonde_report_pick pick = {p, SONDE_ALL, SONDE_ALL};
    if (!sonde_view_group(view, view->main->model_n, pick, &group)) continue;
    sonde_text_put(&view->page, "<li>Probe <b>");
    sonde_text_escape(&view->page, view->probe[p]);
    sonde_text_format(&view->page, "</b>: %s\u00a0N, %s\u00a0%% of its mean force",
                      sonde_significant(group.errors.mae_n, 3).s,
                      sonde_significant(group.errors.mae_percent, 3).s);
    corridor(view, p);
    sonde_text_put(&view->page, ".</li>\n");
  }
  sonde_text_put(&view->page, "</ul>\n");
}

static void words_about_holdouts(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  uint32_t worst = 0;
  if (!r->holdout_count) return;
  for (uint32_t i = 1; i < r->holdout_count; ++i)
    if (r->holdouts[i].percent > r->holdouts[worst].percent) worst = i;
  sonde_text_format(&view->page,
                    "<p>On data it had not seen, the largest error is %s\u00a0%% of the "
                    "mean force (left out: ",
                    sonde_significant(r->holdouts[worst].percent, 3).s);
  sonde_text_escape(&view->page, r->holdouts[worst].left_out);
  if (r->holdouts[worst].probe) {
    sonde_text_put(&view->page, "; seen under probe ");
    sonde_text_escape(&view->page, r->holdouts[worst].probe);
  }
  sonde_text_put(&view->page, ").</p>\n");
}

void sonde_report_summary(sonde_report_view *view) {
  sonde_report_group all;
  if (!view->main || !sonde_view_group(view, view->main->model_n, SONDE_PICK_ALL, &all)) return;
  sonde_page_section(view, "summary", "Summary");
  sonde_text_put(&view->page, "<div class=\"key\">\n");
  key(view, sonde_significant(all.errors.mae_n, 3).s, "N", "mean absolute error");
  key(view, sonde_significant(all.errors.mae_percent, 3).s, "%", "of the mean force");
  key(view, sonde_significant(all.errors.sd_n, 3).s, "N", "standard deviation of the error");
  key(view, sonde_significant(all.errors.p95_abs_n, 3).s, "N", "95 % of errors are smaller");
  sonde_text_put(&view->page, "</div>\n");
  words_about_all(view, &all);
  words_about_probes(view);
  words_about_holdouts(view);
}

// ---- stages -------------------------------------------------------------------------------------

static void stage_cells(sonde_report_view *view, const double *model_n, uint32_t probe) {
  sonde_report_group group;
  sonde_report_pick pick = {probe, SONDE_ALL, SONDE_ALL};
  bool any = sonde_view_group(view, model_n, pick, &group);
  const sonde_error_statistics *s = &group.errors;
  sonde_cell(view, sonde_fixed(any ? s->mae_n : NAN, 3));
  sonde_cell(view, sonde_fixed(any ? s->sd_n : NAN, 3));
  sonde_cell(view, sonde_fixed(any ? s->mae_percent : NAN, 2));
}

static uint32_t missing_of(const sonde_report_view *view, const sonde_report_stage *stage) {
  uint32_t missing = 0;
  for (uint32_t i = 0; i < view->rows; ++i) missing += isfinite(stage->model_n[i]) ? 0u : 1u;
  return missing;
}

static bool any_missing(const sonde_report_view *view) {
  for (uint32_t i = 0; i < view->in->stage_count; ++i)
    if (missing_of(view, &view->in->stages[i])) return true;
  return false;
}

static void stage_row(sonde_report_view *view, const sonde_report_stage *stage) {
  sonde_row_begin(view, stage == view->main);
  sonde_cell_text(view, stage->name);
  sonde_cell_words(view, stage->parameters ? sonde_grouped(stage->parameters).s : "");
  for (uint32_t p = 0; p < view->probe_count; ++p) stage_cells(view, stage->model_n, p);
  if (view->probe_count > 1) stage_cells(view, stage->model_n, SONDE_ALL);
  if (any_missing(view)) sonde_cell(view, sonde_grouped(missing_of(view, stage)));
  sonde_row_end(view);
}

static void stage_head(sonde_report_view *view) {
  sonde_text *page = &view->page;
  uint32_t groups = view->probe_count + (view->probe_count > 1);
  sonde_text_put(page, "<thead><tr><th class=\"l\" rowspan=\"2\">Model</th>"
                       "<th rowspan=\"2\">Parameters</th>");
  for (uint32_t p = 0; p < groups; ++p) {
    sonde_text_put(page, "<th colspan=\"3\">");
    sonde_text_escape(page, p < view->probe_count ? view->probe[p] : "all probes");
    sonde_text_put(page, "</th>");
  }
  sonde_text_put(page,
                 any_missing(view) ? "<th rowspan=\"2\">No force</th></tr>\n<tr>" : "</tr>\n<tr>");
  for (uint32_t p = 0; p < groups; ++p)
    sonde_text_put(page, "<th>MAE, N</th><th>SD, N</th><th>%</th>");
  sonde_text_put(page, "</tr></thead>\n<tbody>\n");
}

void sonde_report_stages(sonde_report_view *view) {
  if (!view->in->stage_count || !view->rows) return;
  sonde_page_section(view, "stages", "Stages of the estimation");
  sonde_table_begin(view,
                    any_missing(view)
                        ? "Errors of every stage against the same measurements. %: MAE over the "
                          "mean force of the probe. No force: measurements for which the model "
                          "found no equilibrium, left out of that row. The figures show the marked "
                          "row."
                        : "Errors of every stage against the same measurements. %: MAE over the "
                          "mean force of the probe. The figures show the marked row.");
  stage_head(view);
  for (uint32_t i = 0; i < view->in->stage_count; ++i) stage_row(view, &view->in->stages[i]);
  sonde_table_end(view);
}

// ---- hold-outs, timing --------------------------------------------------------------------------

void sonde_report_holdouts(sonde_report_view *view) {
  static const char *const HEADS[] = {"<Left out",           "<Probe", "MAE, N", "SD, N", "MAE, %",
                                      "MAE of seen data, %", "Ratio"};
  const sonde_fit_report *r = view->in;
  if (!r->holdout_count) return;
  sonde_page_section(view, "holdout", "Data that were held out");
  sonde_table_begin(view, "Errors on data that the estimation did not see. %: MAE over the mean "
                          "force of the same data. A ratio near 1 says that the model predicts as "
                          "well as it fits.");
  sonde_table_head(view, HEADS, SONDE_COUNT_OF(HEADS));
  for (uint32_t i = 0; i < r->holdout_count; ++i) {
    const sonde_report_holdout *h = &r->holdouts[i];
    sonde_row_begin(view, false);
    sonde_cell_text(view, h->left_out);
    sonde_cell_text(view, h->probe);
    sonde_cell(view, sonde_fixed(h->mae_n, 3));
    sonde_cell(view, sonde_fixed(h->sd_n, 3));
    sonde_cell(view, sonde_fixed(h->percent, 2));
    sonde_cell(view, sonde_fixed(h->training_percent, 2));
    double ratio = h->training_percent > 0 ? h->percent / h->training_percent : NAN;
    sonde_cell(view, sonde_fixed(ratio, 2));
    sonde_row_end(view);
  }
  sonde_table_end(view);
}

void sonde_report_end_matter(sonde_report_view *view) {
  static const char *const HEADS[] = {"<Step", "Seconds"};
  const sonde_fit_report *r = view->in;
  double sum_s = 0;
  if (!r->timing_count) return;
  sonde_page_section(view, "timing", "Time");
  sonde_table_begin(view, "Elapsed time on the machine that made this report.");
  sonde_table_head(view, HEADS, SONDE_COUNT_OF(HEADS));
  for (uint32_t i = 0; i < r->timing_count; ++i) {
    sonde_row_begin(view, false);
    sonde_cell_text(view, r->timings[i].name);
    sonde_cell(view, sonde_fixed(r->timings[i].seconds, 2));
    sonde_row_end(view);
    sum_s += r->timings[i].seconds;
  }
  if (r->timing_count > 1) {
    sonde_row_begin(view, true);
    sonde_cell_text(view, "together");
    sonde_cell(view, sonde_fixed(sum_s, 2));
    sonde_row_end(view);
  }
  sonde_table_end(view);
}
