// check_stages, check_data: what the report must fulfil.
// says:         whether a text holds a word, in any case of letters.
// take_sites:   the table's sites or the model's, then those that only the data name.
// take_probes:  the probes in order of first appearance.
// take_bins:    width of the depth bins.
#include "report/view.h"

#include "base/maths.h"
#include "fit/fit_inside.h"

#include <ctype.h>
#include <string.h>

static sonde_status check_stages(const sonde_fit_report *r, sonde_error *error) {
  if (r->stage_count > SONDE_REPORT_STAGES)
    return sonde_fail(error, SONDE_ARGUMENT, "report: %u stages, expected at most %d",
                      r->stage_count, SONDE_REPORT_STAGES);
  if ((r->stage_count || r->band_n) && !r->data)
    return sonde_fail(error, SONDE_ARGUMENT, "report: forces of a model without measurements");
  if (r->band_n && !r->stage_count)
    return sonde_fail(error, SONDE_ARGUMENT, "report: a prediction band without a stage");
  for (uint32_t i = 0; i < r->stage_count; ++i)
    if (!r->stages || !r->stages[i].name || !r->stages[i].model_n)
      return sonde_fail(error, SONDE_ARGUMENT, "report: stage %u needs a name and forces", i);
  return SONDE_OK;
}

static sonde_status check_data(const sonde_fit_report *r, sonde_error *error) {
  for (uint32_t i = 0; r->data && i < r->data->count; ++i) {
    const sonde_datum *d = &r->data->data[i];
    if (!isfinite(d->force_n) || !isfinite(d->penetration_m) || !memchr(d->probe, 0, 24))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "report: measurement %u: expected a finite force and depth and a "
                        "terminated name",
                        i);
  }
  return SONDE_OK;
}

static bool says(const char *text, const char *word) {
  size_t length = strlen(word);
  for (const char *p = text; p && *p; ++p)
    if (strncasecmp(p, word, length) == 0) return true;
  return false;
}

static uint32_t find_site(const sonde_report_view *view, uint32_t id) {
  if (id < view->site_count && view->sites[id].id == id) return id;
  for (uint32_t i = 0; i < view->site_count; ++i)
    if (view->sites[i].id == id) return i;
  return SONDE_ALL;
}

static sonde_report_place place_of(const sonde_site *site, double fat_m) {
  return (sonde_report_place){site->id, site->position_m, site->normal, site->v, fat_m};
}

static void take_sites(sonde_report_view *view) {
  const sonde_site_table *table = view->in->sites;
  const sonde_model *model = view->in->model;
  if (table && table->count) {
    for (uint32_t i = 0; i < table->count; ++i)
      view->sites[view->site_count++] =
          place_of(&table->sites[i], table->fat_depth_m ? table->fat_depth_m[i] : NAN);
  } else if (model) {
    for (uint32_t i = 0; i < model->site_count; ++i)
      view->sites[view->site_count++] = place_of(&model->sites[i], NAN);
  }
  const sonde_measurements *data = view->in->data;
  for (uint32_t i = 0; i < view->rows; ++i) {
    uint32_t site = find_site(view, data->data[i].site);
    if (site == SONDE_ALL) {
      site = view->site_count++;
      view->sites[site] = (sonde_report_place){
          data->data[i].site, data->position_m[i], data->normal[i], {0, 0, 0}, NAN};
    }
    view->row_site[i] = site;
  }
}

static sonde_status take_probes(sonde_report_view *view, sonde_error *error) {
  for (uint32_t i = 0; i < view->rows; ++i) {
    const char *name = view->in->data->data[i].probe;
    uint32_t p = sonde_probe_index(view->probe, &view->probe_count, name);
    if (p == UINT32_MAX)
      return sonde_fail(error, SONDE_ARGUMENT, "report: more than %d probes, the next is '%s'",
                        SONDE_FIT_PROBES, name);
    view->row_probe[i] = p;
  }
  return SONDE_OK;
}

// Millimetres in steps of 1, 2 or 5 that give at most 16 bins, and never less than 1 mm.
static void take_bins(sonde_report_view *view) {
  double deepest_m = 0;
  for (uint32_t i = 0; i < view->rows; ++i) deepest_m = fmax(deepest_m, view->depth_m[i]);
  view->bin_m = 1e-3 * sonde_nice_step(fmax(1e3 * deepest_m / 16, 1));
  view->bin_count = sonde_view_bin(view, deepest_m) + 1;
  SONDE_ASSERT(view->bin_count <= SONDE_REPORT_BINS);
}

uint32_t sonde_view_bin(const sonde_report_view *view, double depth_m) {
  SONDE_ASSERT(view->bin_m > 0);
  double place = floor(depth_m / view->bin_m + 0.5);
  return place > 0 ? (uint32_t)place : 0;
}

static bool allocate(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  size_t sites =
      view->rows + (r->sites ? r->sites->count : 0) + (r->model ? r->model->site_count : 0);
  view->figures = SONDE_NEW(sonde_figure, SONDE_REPORT_FIGURES);
  view->row_probe = SONDE_NEW(uint32_t, view->rows);
  view->row_site = SONDE_NEW(uint32_t, view->rows);
  view->depth_m = SONDE_NEW(double, view->rows);
  view->force_n = SONDE_NEW(double, view->rows);
  view->sites = SONDE_NEW(sonde_report_place, sites);
  bool scratch = true;
  for (int i = 0; i < 3; ++i) {
    view->scratch[i] = SONDE_NEW(double, view->rows);
    scratch = scratch && view->scratch[i];
  }
  return view->figures && view->row_probe && view->row_site && view->depth_m && view->force_n &&
         view->sites && scratch;
}

static void choose_main(sonde_report_view *view) {
  const sonde_fit_report *r = view->in;
  for (uint32_t i = 0; i < r->stage_count; ++i)
    if (!view->main || !view->main->is_main) view->main = &r->stages[i];
  SONDE_ASSERT(!r->stage_count == !view->main);
}

sonde_status sonde_view_open(const sonde_fit_report *report, sonde_report_view *view,
                             sonde_error *error) {
  *view = (sonde_report_view){.in = report, .rows = report->data ? report->data->count : 0};
  sonde_status status = check_stages(report, error);
  if (!status) status = check_data(report, error);
  if (!status && !allocate(view)) status = sonde_fail_memory(error);
  if (!status) status = take_probes(view, error);
  if (!status) {
    for (uint32_t i = 0; i < view->rows; ++i) {
      view->depth_m[i] = report->data->data[i].penetration_m;
      view->force_n[i] = report->data->data[i].force_n;
    }
    take_sites(view);
    take_bins(view);
    choose_main(view);
    const char *provenance = report->provenance ? report->provenance
                             : report->model    ? report->model->provenance
                                                : NULL;
    view->synthetic = says(provenance, "synthetic") || says(provenance, "computed");
  } else {
    sonde_view_close(view);
  }
  return status;
}

void sonde_view_close(sonde_report_view *view) {
  for (uint32_t i = 0; i < view->figure_count; ++i) sonde_text_clear(&view->figures[i].body);
  for (int i = 0; i < 3; ++i) sonde_free(view->scratch[i]);
  sonde_free(view->figures);
  sonde_free(view->row_probe);
  sonde_free(view->row_site);
  sonde_free(view->depth_m);
  sonde_free(view->force_n);
  sonde_free(view->sites);
  sonde_text_clear(&view->page);
  sonde_text_clear(&view->contents);
  *view = (sonde_report_view){0};
}

// ---- groups of rows -----------------------------------------------------------------------------

bool sonde_view_picks(const sonde_report_view *view, sonde_report_pick pick, uint32_t row) {
  SONDE_ASSERT(row < view->rows);
  return (pick.probe == SONDE_ALL || view->row_probe[row] == pick.probe) &&
         (pick.site == SONDE_ALL || view->row_site[row] == pick.site) &&
         (pick.bin == SONDE_ALL || sonde_view_bin(view, view->depth_m[row]) == pick.bin);
}

uint32_t sonde_view_errors(sonde_report_view *view, sonde_report_pick pick, double *out) {
  uint32_t count = 0;
  for (uint32_t i = 0; view->main && i < view->rows; ++i)
    if (isfinite(view->main->model_n[i]) && sonde_view_picks(view, pick, i))
      out[count++] = view->main->model_n[i] - view->force_n[i];
  qsort(out, count, sizeof *out, sonde_compare_reals);
  return count;
}

static void relative_spread(const double *model_n, const double *force_n, uint32_t count,
                            double *scratch, sonde_report_group *group) {
  uint32_t used = 0;
  for (uint32_t i = 0; i < count; ++i)
    if (force_n[i] > 0) scratch[used++] = 100 * (model_n[i] / force_n[i] - 1);
  qsort(scratch, used, sizeof *scratch, sonde_compare_reals);
  group->low_percent = used ? sonde_percentile(scratch, used, 0.25) : NAN;
  group->high_percent = used ? sonde_percentile(scratch, used, 0.75) : NAN;
}

bool sonde_view_group(sonde_report_view *view, const double *model_n, sonde_report_pick pick,
                      sonde_report_group *group) {
  double *model = view->scratch[0], *force = view->scratch[1], sum_n = 0, errors_n = 0;
  uint32_t count = 0;
  *group = (sonde_report_group){.least_n = INFINITY, .most_n = -INFINITY};
  for (uint32_t i = 0; i < view->rows; ++i) {
    if (!isfinite(model_n[i]) || !sonde_view_picks(view, pick, i)) continue;
    model[count] = model_n[i];
    force[count++] = view->force_n[i];
    sum_n += view->force_n[i];
    errors_n += model_n[i] - view->force_n[i];
    group->least_n = fmin(group->least_n, view->force_n[i]);
    group->most_n = fmax(group->most_n, view->force_n[i]);
  }
  if (!count) return false;
  if (sonde_error_statistics_of(model, force, count, &group->errors, NULL)) view->memory = true;
  group->bias_percent = sum_n > 0 ? 100 * errors_n / sum_n : NAN;
  relative_spread(model, force, count, view->scratch[2], group);
  return true;
}
