// The report of an estimation as JSON; web/src/report/fit.ts draws it. Lengths leave in mm, all
// else in the unit that its key names; what is not finite leaves as null.
#include "sonde/fit_report.h"

#include "base/maths.h"
#include "base/order.h"
#include "sonde/fit_distribution.h"
#include "fit/fit_inside.h"
#include "sonde/base_json.h"
#include "sonde/files.h"

#include <string.h>

enum { EVERY = UINT32_MAX, BARS = 64, DENSITIES = 241, DIGITS = 9, PLACES = 6 };

typedef struct report_site {
  uint32_t id;
  sonde_vec3 position_m, normal, along; // along: axis v of the footprint, zero when not known
  double fat_m;                         // NaN when not known
} report_site;

// The measurements, sorted out into probes, sites and bins of depth.
typedef struct report {
  const sonde_fit_report *in;
  const sonde_report_stage *main; // the one of the figures; NULL without stages
  uint32_t rows, probe_count, site_count, bin_count;
  char probe[SONDE_FIT_PROBES][24];
  uint32_t *probe_of, *site_of, *bin_of; // [rows]
  double *scratch;                       // [3 rows]
  report_site *sites; // those of the table or the model, then those of the data alone
  double bin_m;       // width of a bin, which is centred on its multiple
  sonde_json_out out;
  bool lacks_memory; // some statistics are missing for want of it
} report;

// Rows of one probe, site and bin; EVERY: of any.
typedef struct choice {
  uint32_t probe, site, bin;
} choice;

sonde_report_interval sonde_report_value(double value) {
  return (sonde_report_interval){value, NAN, NAN, NAN, NAN};
}

// The smallest of 1, 2, 5 times a power of ten that is not below `least`.
static double round_up(double least) {
  SONDE_ASSERT(least > 0 && isfinite(least));
  double power = pow(10, floor(log10(least)));
  static const double LEADING[] = {1, 2, 5};
  for (size_t i = 0; i < SONDE_COUNT_OF(LEADING); ++i)
    if (LEADING[i] * power >= least * (1 - 1e-9)) return LEADING[i] * power;
  return 10 * power;
}

static sonde_status sort_rows(report *r, sonde_error *error) {
  const sonde_site_table *table = r->in->sites;
  const sonde_model *model = r->in->model;
  const sonde_measurements *data = r->in->data;
  bool listed = table && table->count;
  uint32_t known = listed ? table->count : model ? model->site_count : 0;
  r->probe_of = SONDE_NEW(uint32_t, r->rows);
  r->site_of = SONDE_NEW(uint32_t, r->rows);
  r->bin_of = SONDE_NEW(uint32_t, r->rows);
  r->scratch = SONDE_NEW(double, 3 * (size_t)r->rows);
  r->sites = SONDE_NEW(report_site, (size_t)known + r->rows);
  if (!r->probe_of || !r->site_of || !r->bin_of || !r->scratch || !r->sites)
    return sonde_fail_memory(error);

  // Sites of the table, or of the model.
  for (; r->site_count < known; ++r->site_count) {
    const sonde_site *s = listed ? &table->sites[r->site_count] : &model->sites[r->site_count];
    double fat_m = listed && table->fat_depth_m ? table->fat_depth_m[r->site_count] : NAN;
    r->sites[r->site_count] = (report_site){s->id, s->position_m, s->normal, s->v, fat_m};
  }

  // Probes in the order of their first measurement; sites that only the data name.
  double deepest_m = 0;
  for (uint32_t i = 0; i < r->rows; ++i) {
    const sonde_datum *d = &data->data[i];
    r->probe_of[i] = sonde_probe_index(r->probe, &r->probe_count, d->probe);
    if (r->probe_of[i] == UINT32_MAX)
      return sonde_fail(error, SONDE_ARGUMENT, "report: more than %d probes, the next is '%s'",
                        SONDE_FIT_PROBES, d->probe);
    uint32_t site = 0;
    while (site < r->site_count && r->sites[site].id != d->site) ++site;
    if (site == r->site_count)
      r->sites[r->site_count++] =
          (report_site){d->site, data->position_m[i], data->normal[i], {0, 0, 0}, NAN};
    r->site_of[i] = site;
    deepest_m = fmax(deepest_m, d->penetration_m);
  }

  // Bins of depth: a round number of millimetres, at most 17 bins.
  r->bin_m = 1e-3 * round_up(fmax(1e3 * deepest_m / 16, 1));
  for (uint32_t i = 0; i < r->rows; ++i) {
    r->bin_of[i] = (uint32_t)fmax(floor(data->data[i].penetration_m / r->bin_m + 0.5), 0);
    if (r->bin_of[i] >= r->bin_count) r->bin_count = r->bin_of[i] + 1;
  }
  return SONDE_OK;
}

// ---- values -------------------------------------------------------------------------------------

static void put(report *r, const char *key, double value) {
  sonde_json_put_real(&r->out, key, value, DIGITS);
}

// What is NULL or empty leaves no trace.
static void put_words(report *r, const char *key, const char *utf8) {
  if (utf8 && *utf8) sonde_json_put_text(&r->out, key, utf8);
}

static void put_list(report *r, const char *key, const double *values, uint32_t count,
                     double factor, int digits) {
  SONDE_ASSERT(values || !count);
  sonde_json_begin_list(&r->out, key);
  for (uint32_t i = 0; i < count; ++i)
    sonde_json_put_real(&r->out, NULL, factor * values[i], digits);
  sonde_json_end(&r->out);
}

static void put_vector(report *r, const char *key, sonde_vec3 v, double factor) {
  put_list(r, key, (const double[]){v.x, v.y, v.z}, 3, factor, PLACES);
}

static void put_interval(report *r, const char *key, const sonde_report_interval *i,
                         double factor) {
  sonde_json_begin_object(&r->out, key);
  put(r, "value", factor * i->value);
  put(r, "lower", factor * i->lower);
  put(r, "upper", factor * i->upper);
  put(r, "bootstrap_lower", factor * i->bootstrap_lower);
  put(r, "bootstrap_upper", factor * i->bootstrap_upper);
  sonde_json_end(&r->out);
}

// ---- errors -------------------------------------------------------------------------------------

// Forces of the chosen rows for which the model has one: into model[] and force[], which are
// scratch.
static uint32_t choose(report *r, const double *model_n, choice c, double **model, double **force) {
  SONDE_ASSERT(model_n && (c.probe == EVERY || c.probe < r->probe_count));
  uint32_t count = 0;
  *model = r->scratch;
  *force = r->scratch + r->rows;
  for (uint32_t i = 0; i < r->rows; ++i) {
    if (!isfinite(model_n[i]) || (c.probe != EVERY && c.probe != r->probe_of[i]) ||
        (c.site != EVERY && c.site != r->site_of[i]) || (c.bin != EVERY && c.bin != r->bin_of[i]))
      continue;
    (*model)[count] = model_n[i];
    (*force)[count++] = r->in->data->data[i].force_n;
  }
  return count;
}

// Statistics of the chosen rows' errors, model minus measurement; false and nothing without a row.
static bool put_errors(report *r, const char *key, const double *model_n, choice c, int32_t site) {
  double *model, *force, least_n = INFINITY, most_n = -INFINITY, sum_n = 0;
  sonde_error_statistics s;
  uint32_t count = choose(r, model_n, c, &model, &force), relative = 0;
  if (!count) return false;
  if (sonde_error_statistics_of(model, force, count, &s, NULL)) {
    r->lacks_memory = true;
    return false;
  }
  double *percent = r->scratch + 2 * (size_t)r->rows;
  for (uint32_t i = 0; i < count; ++i) {
    least_n = fmin(least_n, force[i]), most_n = fmax(most_n, force[i]), sum_n += force[i];
    if (force[i] > 0) percent[relative++] = 100 * (model[i] / force[i] - 1);
  }
  qsort(percent, relative, sizeof *percent, sonde_compare_reals);
  sonde_json_begin_object(&r->out, key);
  if (site >= 0) sonde_json_put_integer(&r->out, "site", site);
  sonde_json_put_integer(&r->out, "count", s.count);
  put(r, "mean_n", s.mean_force_n);
  put(r, "mae_n", s.mae_n);
  put(r, "sd_n", s.sd_n);
  put(r, "sd_abs_n", s.sd_abs_n);
  put(r, "rmse_n", s.rmse_n);
  put(r, "bias_n", s.bias_n);
  put(r, "median_abs_n", s.median_abs_n);
  put(r, "p95_abs_n", s.p95_abs_n);
  put(r, "max_abs_n", s.max_abs_n);
  put(r, "percent_of_mean", s.mae_percent);
  put(r, "percent_of_range", most_n > least_n ? 100 * s.mae_n / (most_n - least_n) : NAN);
  put(r, "percent_of_largest", most_n > 0 ? 100 * s.mae_n / most_n : NAN);
  put(r, "bias_percent", sum_n > 0 ? 100 * count * s.bias_n / sum_n : NAN);
  put(r, "low_percent", relative ? sonde_percentile(percent, relative, 0.25) : NAN);
  put(r, "high_percent", relative ? sonde_percentile(percent, relative, 0.75) : NAN);
  sonde_json_end(&r->out);
  return true;
}

// One entry per probe, null where it has no row.
static void put_probe_errors(report *r, const double *model_n, uint32_t bin) {
  sonde_json_begin_list(&r->out, "probes");
  for (uint32_t p = 0; p < r->probe_count; ++p)
    if (!put_errors(r, NULL, model_n, (choice){p, EVERY, bin}, -1)) put(r, NULL, NAN);
  sonde_json_end(&r->out);
}

// Bars of a round width after Freedman and Diaconis over the middle 99 % of the errors, zero in
// sight, and the distributions that describe the errors best, as the share of the errors that each
// expects per bar.
static void put_histogram(report *r) {
  double *errors, *force;
  uint32_t count = choose(r, r->main->model_n, (choice){EVERY, EVERY, EVERY}, &errors, &force);
  if (!count) return;
  for (uint32_t i = 0; i < count; ++i) errors[i] -= force[i];
  qsort(errors, count, sizeof *errors, sonde_compare_reals);
  double low = fmin(sonde_percentile(errors, count, 0.005), 0);
  double high = fmax(sonde_percentile(errors, count, 0.995), 0);
  double quartiles = sonde_percentile(errors, count, 0.75) - sonde_percentile(errors, count, 0.25);
  double width = fmax(2 * quartiles / cbrt(count), (high - low) / (BARS - 4));
  double step_n = round_up(fmax(width, 1e-12)), first = floor(low / step_n);
  uint32_t bars = (uint32_t)(floor(high / step_n) + 1 - first), outside = 0, bar[BARS] = {0};
  SONDE_ASSERT(bars >= 1 && bars <= BARS);
  for (uint32_t i = 0; i < count; ++i) {
    double place = floor(errors[i] / step_n) - first;
    if (place >= 0 && place < bars)
      ++bar[(uint32_t)place];
    else
      ++outside;
  }
  sonde_json_begin_object(&r->out, "histogram");
  put(r, "from_n", first * step_n);
  put(r, "step_n", step_n);
  sonde_json_begin_list(&r->out, "count");
  for (uint32_t b = 0; b < bars; ++b) sonde_json_put_integer(&r->out, NULL, bar[b]);
  sonde_json_end(&r->out);
  sonde_json_put_integer(&r->out, "outside", outside);
  sonde_json_begin_list(&r->out, "distributions");
  for (int k = 0; k < SONDE_DISTRIBUTIONS; ++k) {
    sonde_distribution d;
    double share[DENSITIES];
    if (!sonde_distribution_fit((sonde_distribution_kind)k, errors, count, &d)) continue;
    for (int i = 0; i < DENSITIES; ++i)
      share[i] = step_n * sonde_distribution_density(
                              &d, step_n * (first + (double)bars * i / (DENSITIES - 1)));
    sonde_json_begin_object(&r->out, NULL);
    sonde_json_put_text(&r->out, "name", sonde_distribution_name(d.kind));
    put(r, "centre_n", d.place);
    put(r, "scale_n", d.scale);
    if (d.kind == SONDE_STUDENT) put(r, "freedom", d.freedom);
    put(r, "log_likelihood", d.log_likelihood);
    put(r, "aic", d.aic);
    put_list(r, "share_per_bar", share, DENSITIES, 1, PLACES);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  sonde_json_end(&r->out);
}

// The measurements as columns with the main stage's force and its band; every stage against them;
// the main one by probe, depth and site.
static void put_measurements(report *r) {
  static const choice ALL = {EVERY, EVERY, EVERY};
  const sonde_datum *data = r->in->data->data;
  sonde_json_begin_object(&r->out, "rows");
  sonde_json_begin_list(&r->out, "site");
  for (uint32_t i = 0; i < r->rows; ++i) sonde_json_put_integer(&r->out, NULL, data[i].site);
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "probe");
  for (uint32_t i = 0; i < r->rows; ++i) sonde_json_put_integer(&r->out, NULL, r->probe_of[i]);
  sonde_json_end(&r->out);
  for (uint32_t i = 0; i < r->rows; ++i) r->scratch[i] = data[i].penetration_m;
  put_list(r, "depth_mm", r->scratch, r->rows, 1e3, PLACES);
  for (uint32_t i = 0; i < r->rows; ++i) r->scratch[i] = data[i].force_n;
  put_list(r, "force_n", r->scratch, r->rows, 1, PLACES);
  if (r->main) put_list(r, "model_n", r->main->model_n, r->rows, 1, PLACES);
  if (r->in->band_n) put_list(r, "band_n", r->in->band_n, r->rows, 1, PLACES);
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "stages");
  for (uint32_t k = 0; k < r->in->stage_count; ++k) {
    const sonde_report_stage *s = &r->in->stages[k];
    uint32_t missing = 0;
    for (uint32_t i = 0; i < r->rows; ++i) missing += isfinite(s->model_n[i]) ? 0u : 1u;
    sonde_json_begin_object(&r->out, NULL);
    sonde_json_put_text(&r->out, "name", s->name);
    sonde_json_put_integer(&r->out, "parameters", s->parameters);
    sonde_json_put_integer(&r->out, "missing", missing);
    sonde_json_put_bool(&r->out, "main", s == r->main);
    put_probe_errors(r, s->model_n, EVERY);
    put_errors(r, "all", s->model_n, ALL, -1);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  if (!r->main) return;
  sonde_json_begin_object(&r->out, "errors");
  put_errors(r, "all", r->main->model_n, ALL, -1);
  put_probe_errors(r, r->main->model_n, EVERY);
  put(r, "bin_mm", 1e3 * r->bin_m);
  sonde_json_begin_list(&r->out, "depths");
  for (uint32_t bin = 0; bin < r->bin_count; ++bin) {
    sonde_json_begin_object(&r->out, NULL);
    put(r, "depth_mm", 1e3 * bin * r->bin_m);
    put_probe_errors(r, r->main->model_n, bin);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "sites");
  for (uint32_t s = 0; s < r->site_count; ++s)
    put_errors(r, NULL, r->main->model_n, (choice){EVERY, s, EVERY}, (int32_t)r->sites[s].id);
  sonde_json_end(&r->out);
  put_histogram(r);
  sonde_json_end(&r->out);
}

// ---- skin
// ----------------------------------------------------------------------------------------

// Pearson's correlation of the thickness of the fat with k0 or xm over the sites where both are
// known; NaN for fewer than 8 sites.
static double correlate_fat(const report *r, bool xm) {
  SONDE_ASSERT(r->in->model);
  double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (uint32_t i = 0; i < r->site_count; ++i) {
    const sonde_site *site = sonde_model_site(r->in->model, r->sites[i].id);
    if (!site || !isfinite(r->sites[i].fat_m)) continue;
    double a = r->sites[i].fat_m, b = xm ? site->xm_m : site->k0_n_m3;
    ++n, x += a, y += b, xx += a * a, yy += b * b, xy += a * b;
  }
  double spread = (n * xx - x * x) * (n * yy - y * y);
  return n >= 8 && spread > 1e-12 * n * n * xx * yy ? (n * xy - x * y) / sqrt(spread) : NAN;
}

static void put_field(report *r, const char *name, const double *values, double factor) {
  if (values) put_list(r, name, values, r->in->model->surface.vertex_count, factor, 4);
}

// The skin with the parameters at its nodes; the shear layer's where they differ from place to
// place.
static void put_skin(report *r) {
  const sonde_model *m = r->in->model;
  if (!m || !m->surface.face_count || !m->normal || !m->k0_n_m3 || !m->xm_m) return;
  bool varies = false;
  for (uint32_t i = 0; m->shear_share && i < m->surface.vertex_count; ++i)
    varies = varies || fabs(m->shear_share[i] - 1) > 1e-6;
  sonde_json_begin_object(&r->out, "skin");
  sonde_json_begin_list(&r->out, "position_mm");
  for (uint32_t i = 0; i < m->surface.vertex_count; ++i)
    for (int k = 0; k < 3; ++k)
      sonde_json_put_real(&r->out, NULL, 1e3 * v_coordinate(m->surface.vertices[i], k), 5);
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "face");
  for (uint32_t f = 0; f < m->surface.face_count; ++f)
    for (int k = 0; k < 3; ++k) sonde_json_put_integer(&r->out, NULL, m->surface.faces[f][k]);
  sonde_json_end(&r->out);
  put_field(r, "k0_kpa_mm", m->k0_n_m3, 1e-6);
  put_field(r, "xm_mm", m->xm_m, 1e3);
  put_field(r, "shear_n_m", varies ? m->shear_share : NULL, m->law.shear_stiffness_n_m);
  put_field(r, "shear_limit", varies ? m->limit_share : NULL, m->law.shear_limit);
  put_field(r, "muscle_depth_mm", m->muscle_depth_m, 1e3);
  put(r, "fat_correlates_with_k0", correlate_fat(r, false));
  put(r, "fat_correlates_with_xm", correlate_fat(r, true));
  sonde_json_end(&r->out);
}

// ---- estimates ----------------------------------------------------------------------------------

// First crossing of the threshold from the estimate towards smaller (side < 0) or larger values;
// NaN without one.
static double cross_threshold(const sonde_report_profile *p, double threshold, int side) {
  SONDE_ASSERT(p->count >= 2 && threshold > 0 && (side == 1 || side == -1));
  for (uint32_t k = 1; k < p->count; ++k) {
    uint32_t a = side > 0 ? k - 1 : p->count - k, b = side > 0 ? k : p->count - 1 - k;
    if ((p->x[b] - p->estimate) * side <= 0) continue;
    if (p->rise[a] <= threshold && p->rise[b] > threshold)
      return p->x[a] + (p->x[b] - p->x[a]) * (threshold - p->rise[a]) / (p->rise[b] - p->rise[a]);
  }
  return NAN;
}

// How well the data determine the estimates: correlation, profiles of the likelihood, relative
// deviations by data.
static void put_inference(report *r) {
  static const double CHI2_95 = 3.841458820694124; // one degree of freedom
  const sonde_fit_report *in = r->in;
  if (in->correlation_count && in->correlation) {
    sonde_json_begin_object(&r->out, "correlation");
    sonde_json_begin_list(&r->out, "names");
    for (uint32_t i = 0; in->correlation_names && i < in->correlation_count; ++i) {
      const char *name = in->correlation_names[i];
      sonde_json_put_text(&r->out, NULL, name ? name : "");
    }
    sonde_json_end(&r->out);
    put_list(r, "values", in->correlation, in->correlation_count * in->correlation_count, 1,
             DIGITS);
    sonde_json_end(&r->out);
  }
  sonde_json_begin_list(&r->out, "profiles");
  for (uint32_t i = 0; i < in->profile_count; ++i) {
    const sonde_report_profile *p = &in->profiles[i];
    if (p->count < 2 || !p->x || !p->rise) continue;
    double threshold = p->threshold > 0 ? p->threshold : CHI2_95;
    sonde_json_begin_object(&r->out, NULL);
    put_words(r, "name", p->name);
    put_words(r, "unit", p->unit);
    put_list(r, "x", p->x, p->count, 1, DIGITS);
    put_list(r, "rise", p->rise, p->count, 1, DIGITS);
    if (p->quadratic) put_list(r, "quadratic", p->quadratic, p->count, 1, DIGITS);
    put(r, "estimate", p->estimate);
    put(r, "threshold", threshold);
    put(r, "lower", cross_threshold(p, threshold, -1));
    put(r, "upper", cross_threshold(p, threshold, 1));
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "identifiability");
  for (uint32_t i = 0; i < in->identifiability_count; ++i) {
    sonde_json_begin_object(&r->out, NULL);
    put_words(r, "parameter", in->identifiability[i].parameter);
    put_words(r, "data", in->identifiability[i].data);
    put(r, "relative_sd", in->identifiability[i].relative_sd);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "holdouts");
  for (uint32_t i = 0; i < in->holdout_count; ++i) {
    const sonde_report_holdout *h = &in->holdouts[i];
    sonde_json_begin_object(&r->out, NULL);
    put_words(r, "left_out", h->left_out);
    put_words(r, "probe", h->probe);
    put(r, "mae_n", h->mae_n);
    put(r, "sd_n", h->sd_n);
    put(r, "percent", h->percent);
    put(r, "training_percent", h->training_percent);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "timings");
  for (uint32_t i = 0; i < in->timing_count; ++i) {
    sonde_json_begin_object(&r->out, NULL);
    put_words(r, "name", in->timings[i].name);
    put(r, "seconds", in->timings[i].seconds);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
}

static void put_report(report *r) {
  const sonde_fit_report *in = r->in;
  const char *provenance = in->provenance ? in->provenance
                           : in->model    ? in->model->provenance
                                          : NULL;
  sonde_json_begin_object(&r->out, NULL);
  sonde_json_put_text(&r->out, "kind", "fit");
  put_words(r, "title", in->title);
  put_words(r, "model", in->model ? in->model->name : NULL);
  put_words(r, "provenance", provenance);
  put_words(r, "date", in->date);
  put_words(r, "version", in->version);
  put_words(r, "command_line", in->command_line);
  sonde_json_put_bool(
      &r->out, "synthetic",
      provenance && (strcasestr(provenance, "synthetic") || strcasestr(provenance, "computed")));
  sonde_json_begin_list(&r->out, "notes");
  for (uint32_t i = 0; i < in->note_count; ++i) sonde_json_put_text(&r->out, NULL, in->notes[i]);
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "probes");
  for (uint32_t p = 0; p < r->probe_count; ++p) sonde_json_put_text(&r->out, NULL, r->probe[p]);
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "sites");
  for (uint32_t s = 0; s < r->site_count; ++s) {
    sonde_json_begin_object(&r->out, NULL);
    sonde_json_put_integer(&r->out, "id", r->sites[s].id);
    put_vector(r, "position_mm", r->sites[s].position_m, 1e3);
    put_vector(r, "normal", r->sites[s].normal, 1);
    put_vector(r, "along", r->sites[s].along, 1);
    put(r, "fat_mm", 1e3 * r->sites[s].fat_m);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  if (r->rows) put_measurements(r);
  put_skin(r);
  sonde_json_begin_list(&r->out, "parameters");
  for (uint32_t i = 0; i < in->parameter_count; ++i) {
    sonde_json_begin_object(&r->out, NULL);
    put_words(r, "name", in->parameters[i].name);
    put_words(r, "unit", in->parameters[i].unit);
    put_words(r, "note", in->parameters[i].note);
    put_interval(r, "estimate", &in->parameters[i].estimate, 1);
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  sonde_json_begin_list(&r->out, "site_parameters");
  for (uint32_t i = 0; i < in->site_parameter_count; ++i) {
    const sonde_report_site *s = &in->site_parameters[i];
    sonde_json_begin_object(&r->out, NULL);
    sonde_json_put_integer(&r->out, "site", s->site);
    put_interval(r, "k0_kpa_mm", &s->k0_n_m3, 1e-6);
    put_interval(r, "xm_mm", &s->xm_m, 1e3);
    if (s->shear_n_m.value > 0) {
      put_interval(r, "shear_n_m", &s->shear_n_m, 1);
      put_interval(r, "shear_limit", &s->shear_limit, 1);
    }
    sonde_json_end(&r->out);
  }
  sonde_json_end(&r->out);
  put_inference(r);
  sonde_json_end(&r->out);
}

sonde_status sonde_fit_report_write(const sonde_fit_report *in, const char *directory,
                                    sonde_error *error) {
  SONDE_ASSERT(in && directory);
  if (in->stage_count > SONDE_REPORT_STAGES)
    return sonde_fail(error, SONDE_ARGUMENT, "report: %u stages, expected at most %d",
                      in->stage_count, SONDE_REPORT_STAGES);
  if ((in->stage_count || in->band_n) && !in->data)
    return sonde_fail(error, SONDE_ARGUMENT, "report: forces of a model without measurements");
  if (in->band_n && !in->stage_count)
    return sonde_fail(error, SONDE_ARGUMENT, "report: a prediction band without a stage");
  for (uint32_t i = 0; i < in->stage_count; ++i)
    if (!in->stages || !in->stages[i].name || !in->stages[i].model_n)
      return sonde_fail(error, SONDE_ARGUMENT, "report: stage %u needs a name and forces", i);
  for (uint32_t i = 0; in->data && i < in->data->count; ++i) {
    const sonde_datum *d = &in->data->data[i];
    if (!isfinite(d->force_n) || !isfinite(d->penetration_m) || !memchr(d->probe, 0, 24))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "report: measurement %u: expected a finite force and depth and a "
                        "terminated name",
                        i);
  }

  report r = {.in = in, .rows = in->data ? in->data->count : 0};
  char *json = NULL, *path = NULL;
  size_t length = 0, room = strlen(directory) + sizeof "/index.html";
  sonde_status status = sort_rows(&r, error);
  for (uint32_t i = 0; i < in->stage_count && !status; ++i)
    if (!r.main || !r.main->is_main) r.main = &in->stages[i];
  if (!status) status = sonde_file_in_memory(&r.out.file, error);
  if (!status) {
    put_report(&r);
    status = sonde_file_take(r.out.file, &json, &length, error);
    if (!status && r.lacks_memory) status = sonde_fail_memory(error);
  }
  if (!status && !(path = SONDE_NEW(char, room))) status = sonde_fail_memory(error);
  if (!status) status = sonde_directory_make(directory, 0777, false, error);
  if (!status) {
    snprintf(path, room, "%s/index.html", directory);
    const char *title = in->title ? in->title : "Estimation report";
    status = sonde_report_write(path, title, json, length, error);
  }
  sonde_free(path);
  sonde_free(json);
  sonde_free(r.probe_of);
  sonde_free(r.site_of);
  sonde_free(r.bin_of);
  sonde_free(r.scratch);
  sonde_free(r.sites);
  return status;
}
