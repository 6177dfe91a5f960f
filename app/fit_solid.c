// sonde fit --solid: fits the layers' moduli at some sites and predicts others.
#include "fit_solid.h"

#include "fit_common.h"
#include "options.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char *const LAYER[] = {SONDE_SOLID_LAYER_NAMES};

// Rows that are compared with the solid, and what is said of them.
typedef struct part {
  const char *title, *key;
  sonde_measurements rows;
  double *solid_n, *springs_n; // springs: NULL without --beside
  sonde_error_report solid, springs;
} part;

enum { FITTED, LEFT_OUT, NEVER, PARTS };

// Ids of sites between commas.
static sonde_status read_sites(const char *option, const char *text, const sonde_site_table *table,
                               uint32_t *list, uint32_t *count, sonde_error *error) {
  double *number = calloc(table->count, sizeof *number);
  if (!number) return error->status = SONDE_MEMORY;
  *count = app_read_numbers(text, 0, 1e6, number, table->count);
  bool whole = *count > 0;
  for (uint32_t k = 0; k < *count; ++k)
    list[k] = (uint32_t)number[k], whole = whole && number[k] == floor(number[k]);
  free(number);
  return whole ? SONDE_OK
               : app_error(error, SONDE_ARGUMENT,
                           "--%s: expected at most %u numbers of sites with commas between", option,
                           table->count);
}

// Sites of the table that are measured and not in the list.
static void others(const sonde_site_table *table, const sonde_measurements *m, const uint32_t *list,
                   uint32_t count, uint32_t *rest, uint32_t *rest_count) {
  *rest_count = 0;
  for (uint32_t k = 0; k < table->count; ++k) {
    const uint32_t id = table->sites[k].id;
    bool taken = false, measured = false;
    for (uint32_t i = 0; i < count; ++i) taken |= list[i] == id;
    for (uint32_t i = 0; i < m->count; ++i) measured |= m->data[i].site == id;
    if (measured && !taken) rest[(*rest_count)++] = id;
  }
}

// The rows of the three parts: sites that are fitted, sites that are only predicted, rows of probes
// that are never fitted, at both.
static sonde_status choose_rows(const fit_solid_job *job, part parts[PARTS], sonde_error *error) {
  const sonde_site_table *table = job->sites;
  uint32_t *list = calloc(4 * (size_t)table->count + 4, sizeof *list), count[3] = {0};
  if (!list) return SONDE_MEMORY;
  uint32_t *fitted = list, *checked = list + table->count, *measured = list + 2 * table->count;
  sonde_status status = SONDE_OK;
  if (job->at) status = read_sites("at", job->at, table, fitted, &count[0], error);
  if (!status && job->check && strcmp(job->check, "all") != 0)
    status = read_sites("check", job->check, table, checked, &count[1], error);
  else if (!status && job->check && job->at)
    others(table, job->measurements, fitted, count[0], checked, &count[1]);
  if (!status)
    status = sonde_measurements_select(job->measurements, table, job->at ? fitted : NULL, count[0],
                                       job->depths, &parts[FITTED].rows, error);
  if (!status && count[1])
    status = sonde_measurements_select(job->measurements, table, checked, count[1], job->depths,
                                       &parts[LEFT_OUT].rows, error);
  // Of the other probes every site counts, unless some were chosen.
  if (!status && job->also->count) {
    others(table, job->also, NULL, 0, measured, &count[2]);
    uint32_t some = 0;
    for (uint32_t k = 0; k < count[2]; ++k) {
      bool wanted = !job->at;
      for (uint32_t i = 0; i < count[0]; ++i) wanted |= fitted[i] == measured[k];
      for (uint32_t i = 0; i < count[1]; ++i) wanted |= checked[i] == measured[k];
      if (wanted) measured[some++] = measured[k];
    }
    if (some)
      status = sonde_measurements_select(job->also, table, measured, some, job->depths,
                                         &parts[NEVER].rows, error);
  }
  free(list);
  return status;
}

// What the springs of stage 3 say of each part with its site left out: of probes that are fitted
// linearised, of others by refits.
static sonde_status ask_springs(const fit_solid_job *job, const sonde_model *model,
                                part parts[PARTS], sonde_error *error) {
  const sonde_measurements *m = job->measurements, *also = job->also;
  const sonde_progress progress = app_progress();
  sonde_fit_def def = sonde_fit_def_default();
  def.stages = 3;
  sonde_fit_result result = {0};
  double *left_out_n = calloc(m->count + also->count, sizeof *left_out_n);
  if (!left_out_n) return SONDE_MEMORY;
  sonde_status status = sonde_fit(model, job->sites, m, &def, &progress, &result, error);
  if (!status && also->count)
    status = sonde_fit_hold_out_also(model, job->sites, m, also, &def, &result, &progress,
                                     left_out_n, error);
  for (uint32_t i = 0; i < m->count && !status; ++i)
    left_out_n[i] = result.confidence.one_out_n ? result.confidence.one_out_n[i] : NAN;
  for (int k = 0; k < PARTS && !status; ++k) {
    const sonde_measurements *from = k == NEVER ? also : m;
    const double *force_n = k == NEVER ? left_out_n + m->count : left_out_n;
    for (uint32_t i = 0; i < parts[k].rows.count; ++i) {
      const sonde_datum *d = &parts[k].rows.data[i];
      for (uint32_t j = 0; j < from->count; ++j)
        if (from->data[j].site == d->site && from->data[j].penetration_m == d->penetration_m &&
            !strcmp(from->data[j].probe, d->probe))
          parts[k].springs_n[i] = force_n[j];
    }
  }
  app_progress_end();
  sonde_fit_result_clear(&result);
  free(left_out_n);
  return status;
}

// What the fit predicts, and what the springs do; errors of both.
static sonde_status predict_parts(const fit_solid_job *job, const sonde_model *model,
                                  const sonde_fit_solid_result *found, part parts[PARTS],
                                  sonde_error *error) {
  sonde_fit_solid_def def = *job->options;
  sonde_status status = SONDE_OK;
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) def.contact.layer[k] = found->layer[k];
  for (int k = LEFT_OUT; k < PARTS && !status; ++k) {
    part *p = &parts[k];
    if (!p->rows.count) continue;
    const sonde_progress progress = app_progress();
    status = sonde_predict_solid(model, job->sites, &p->rows, &def, &progress, p->solid_n, error);
    app_progress_end();
  }
  if (!status && job->beside) status = ask_springs(job, model, parts, error);
  for (int k = 0; k < PARTS && !status; ++k) {
    part *p = &parts[k];
    const uint32_t count = p->rows.count;
    if (count) status = sonde_error_report_of(p->rows.data, p->solid_n, count, &p->solid, error);
    if (count && !status && p->springs_n)
      status = sonde_error_report_of(p->rows.data, p->springs_n, count, &p->springs, error);
  }
  return status;
}

// ---- printing -------------------------------------------------------------------------------

static void print(const fit_solid_job *job, const sonde_fit_solid_result *r, const part *parts) {
  for (int k = 0; k < PARTS; ++k) {
    const part *p = &parts[k];
    if (!p->rows.count) continue;
    app_print_report(p->title, &p->solid);
    printf("  rms of ln(model/measured) %.2f %%\n",
           100 * sonde_ln_rms(p->rows.data, p->solid_n, p->rows.count));
    if (!p->springs_n) continue;
    app_print_report("  the springs, with the site left out", &p->springs);
    printf("  rms of ln(model/measured) %.2f %%\n",
           100 * sonde_ln_rms(p->rows.data, p->springs_n, p->rows.count));
  }
  printf("layer    shear modulus kPa (95 %%)            exponent (95 %%)\n");
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    const double value[2] = {1e-3 * r->layer[k].shear_pa, r->layer[k].exponent};
    printf("%-7s", LAYER[k]);
    for (int i = 0; i < 2; ++i) {
      const double wide = exp(1.96 * r->certainty.ln_sd[k][i]);
      printf(" %7.4g (%.3g to %.3g)%s", value[i], value[i] / wide, value[i] * wide,
             r->certainty.measured[k][i] ? "" : " not identified: mostly the prior");
    }
    printf("\n");
  }
  double zero = 0, tare = 0;
  for (uint32_t c = 0; c < r->curve_count; ++c)
    zero += 1e3 * r->curves[c].zero_m / r->curve_count,
        tare += r->curves[c].tare_n / r->curve_count;
  if (job->options->zero_sd_m > 0) printf("contact zero of the curves: mean %+.3f mm\n", zero);
  if (job->options->tare_sd_n > 0) printf("tare of the curves: mean %+.4f N\n", tare);
}

static void print_json(const fit_solid_job *job, const sonde_fit_solid_result *r,
                       const part *parts) {
  app_json_begin();
  for (int k = 0; k < PARTS; ++k) {
    const part *p = &parts[k];
    if (!p->rows.count) continue;
    app_json_object(p->key);
    app_json_report("solid", &p->solid);
    app_json_real("ln_rms", sonde_ln_rms(p->rows.data, p->solid_n, p->rows.count));
    if (p->springs_n) {
      app_json_object("springs");
      app_json_report("full", &p->springs);
      app_json_real("ln_rms", sonde_ln_rms(p->rows.data, p->springs_n, p->rows.count));
      app_json_close();
    }
    app_json_close();
  }
  app_json_object("moduli");
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    const sonde_moduli_certainty *c = &r->certainty;
    app_json_object(LAYER[k]);
    app_json("shear_kpa:%g ln_shear_sd:%g shear_measured:%hhd", 1e-3 * r->layer[k].shear_pa,
             c->ln_sd[k][0], c->measured[k][0]);
    app_json("exponent:%g ln_exponent_sd:%g exponent_measured:%hhd", r->layer[k].exponent,
             c->ln_sd[k][1], c->measured[k][1]);
    app_json_close();
  }
  app_json_close();
  app_json_array("curves");
  for (uint32_t c = 0; c < r->curve_count; ++c) {
    const sonde_curve_fit *curve = &r->curves[c];
    app_json_object(NULL);
    app_json("site:%u probe:%s rows:%u zero_mm:%g tare_n:%g", curve->site, curve->probe,
             curve->count, 1e3 * curve->zero_m, curve->tare_n);
    app_json_close();
  }
  app_json_close();
  app_json(
      "start_ln_rms:%g rows:%u steps:%u trials:%u converged:%hhd processor_s:%g moduli_file:%s",
      r->start_rms, r->row_count, r->steps, r->trials, r->converged,
      app_seconds(CLOCK_PROCESS_CPUTIME_ID), job->output);
  app_json_end();
}

sonde_status fit_solid_run(const fit_solid_job *job, sonde_error *error) {
  assert(job->sites->count > 0 && job->measurements->count > 0);
  part parts[PARTS] = {{.title = "fitted", .key = "fitted"},
                       {.title = "sites that were left out", .key = "left_out"},
                       {.title = "probes that were never fitted", .key = "never_fitted"}};
  sonde_fit_solid_result found = {0};
  sonde_model *model = NULL;
  sonde_progress progress = app_progress();
  sonde_status status = sonde_model_build(job->def, &model, error);
  if (!status) status = choose_rows(job, parts, error);
  for (int k = 0; k < PARTS && !status; ++k) {
    const uint32_t count = parts[k].rows.count;
    parts[k].solid_n = calloc(count + 1, sizeof(double));
    parts[k].springs_n = job->beside ? calloc(count + 1, sizeof(double)) : NULL;
    if (!parts[k].solid_n || (job->beside && !parts[k].springs_n)) status = SONDE_MEMORY;
  }
  if (!status)
    status = sonde_fit_solid(model, job->sites, &parts[FITTED].rows, job->options, &progress,
                             &found, parts[FITTED].solid_n, error);
  app_progress_end();
  char remark[300];
  snprintf(remark, sizeof remark, "%s; %u rows, rms of ln(model/measured) %.3g",
           job->def->provenance, found.row_count, found.rms);
  if (!status)
    status = sonde_moduli_save(job->output, found.layer, &found.certainty, remark, error);
  if (!status) status = predict_parts(job, model, &found, parts, error);
  if (!status && job->json) print_json(job, &found, parts);
  if (!status && !job->json) {
    print(job, &found, parts);
    printf("%u of %u rows, rms of ln(model/measured) %.2f %% at the start, %u steps%s\n",
           found.row_count, parts[FITTED].rows.count, 100 * found.start_rms, found.steps,
           found.converged ? "" : ", the limit of steps");
    printf("wrote %s after %.0f s of processor time\n", job->output,
           app_seconds(CLOCK_PROCESS_CPUTIME_ID));
  }
  for (int k = 0; k < PARTS; ++k) {
    sonde_measurements_clear(&parts[k].rows);
    free(parts[k].solid_n);
    free(parts[k].springs_n);
  }
  sonde_fit_solid_result_clear(&found);
  sonde_model_destroy(model);
  return status;
}
