// The report of an estimation: collects its results, and the forces that only the report needs.
#include "fit_report.h"

#include "fit_doubts.h"
#include "fit_forces.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { STAGES = 5, HOLDOUTS = 3 * SONDE_FIT_PROBES, NOTES = 5 + SONDE_DOUBTS, NOTE = 900 };

typedef struct builder {
  const fit_findings *in;
  sonde_fit_report report;
  sonde_report_stage stage[STAGES];
  sonde_report_parameter parameter[9];
  sonde_report_holdout holdout[HOLDOUTS];
  sonde_report_timing timing[3];
  sonde_report_profile profile;
  sonde_report_identifiability determined[4 * (SONDE_FIT_PROBES + 1)];
  char part_name[SONDE_FIT_PROBES + 1][40];
  sonde_report_site *site;
  double correlation[16];
  double *stage2_full_n, *linear_n;
  const char *note[NOTES];
  char date[32], text[NOTES][NOTE];
} builder;

// ---- parts of the report ------------------------------------------------------------------------

static void add_stage(builder *b, const char *name, uint32_t parameters, const double *model_n,
                      bool is_main) {
  if (!model_n) return;
  assert(b->report.stage_count < STAGES);
  b->stage[b->report.stage_count++] = (sonde_report_stage){name, parameters, model_n, is_main};
}

// The 95 % interval of a positive parameter whose logarithm has this standard deviation.
static sonde_report_interval spread(double value, double ln_sd) {
  assert(!(ln_sd < 0));
  sonde_report_interval i = sonde_report_value(value);
  i.lower = value * exp(-1.96 * ln_sd);
  i.upper = value * exp(1.96 * ln_sd);
  return i;
}

static void add_parameters(builder *b) {
  static const char *const GIVEN = "given: these data do not determine it";
  static const char *const LEFT_OUT = "by leaving sites out";
  static const char *const NAMES[] = {"ln G", "ln gm", "mean ln k0", "mean ln xm"};
  const sonde_fit_result *r = b->in->result;
  const sonde_fit_confidence *c = &r->confidence;
  b->report.parameters = b->parameter;
  if (r->stage_n[1])
    b->parameter[b->report.parameter_count++] = (sonde_report_parameter){
        "edge stiffness of stage 2", "N/m", spread(r->stage2_edge_n_m, r->edge_sd_log),
        "simplified interaction"};
  if (!c->band_n) return; // what follows is known after stage 3

  sonde_report_interval g = spread(r->law.shear_stiffness_n_m, c->ln_shear_sd);
  sonde_report_interval gm = spread(r->law.shear_limit, c->ln_limit_sd);
  g.bootstrap_lower = c->shear_95[0], g.bootstrap_upper = c->shear_95[1];
  gm.bootstrap_lower = c->limit_95[0], gm.bootstrap_upper = c->limit_95[1];
  const sonde_report_parameter whole[] = {
      {"shear stiffness G", "N/m", g, "bootstrap over sites, linearised"},
      {"shear limit gm", "slope", gm, NULL},
      {"exponent of the normal springs", "", sonde_report_value(r->law.normal_exponent),
       b->in->exponent_from},
      {"tangential stiffness", "N/m\u00b3", sonde_report_value(r->law.tangential_stiffness_n_m3),
       GIVEN},
      {"in-plane stiffness of the skin", "N/m", sonde_report_value(r->law.inplane_stiffness_n_m),
       GIVEN},
      {"smoothness of ln k0 and ln xm per site spacing", "", sonde_report_value(c->smoothness_sd),
       LEFT_OUT},
      {"smoothness of ln G and ln gm per site spacing", "",
       sonde_report_value(c->shear_smoothness_sd), LEFT_OUT}};
  memcpy(&b->parameter[b->report.parameter_count], whole, sizeof whole);
  b->report.parameter_count += sizeof whole / sizeof *whole;

  for (uint32_t s = 0; s < r->site_count; ++s)
    b->site[s] = (sonde_report_site){
        r->sites[s].id, spread(r->sites[s].k0_n_m3, c->ln_k0_sd[s]),
        spread(r->sites[s].xm_m, c->ln_xm_sd[s]),
        spread(r->law.shear_stiffness_n_m * r->sites[s].shear_share, c->ln_site_shear_sd[s]),
        spread(r->law.shear_limit * r->sites[s].limit_share, c->ln_site_limit_sd[s])};
  b->report.site_parameters = b->site;
  b->report.site_parameter_count = r->site_count;
  for (int k = 0; k < 16; ++k) b->correlation[k] = c->correlation[k / 4][k % 4];
  b->report.correlation_names = NAMES;
  b->report.correlation = b->correlation;
  b->report.correlation_count = 4;
  b->report.band_n = c->band_n;
}

// The profile of G, and how well parts of the data determine each parameter: rows of one parameter
// stand together.
static void add_checks(builder *b) {
  static const char *const NAMES[] = {"shear stiffness G", "shear limit gm",
                                      "k0, mean of the sites", "xm, mean of the sites"};
  const sonde_fit_profile *p = &b->in->checks->shear;
  const sonde_fit_identifiability *parts = &b->in->checks->parts;
  b->profile = (sonde_report_profile){"shear stiffness G", "N/m",       p->count,
                                      p->shear_n_m,        p->rise,     p->quadratic,
                                      p->estimate_n_m,     p->threshold};
  b->report.profiles = &b->profile;
  b->report.profile_count = p->count > 0;
  for (uint32_t k = 0; k < parts->count; ++k) fit_checks_name(&parts->part[k], b->part_name[k]);
  b->report.identifiability = b->determined;
  for (int k = 0; k < 4; ++k)
    for (uint32_t i = 0; i < parts->count; ++i)
      b->determined[b->report.identifiability_count++] =
          (sonde_report_identifiability){NAMES[k], b->part_name[i], parts->part[i].ln_sd[k]};
}

static void add_holdout(builder *b, const char *what, const sonde_error_report *out) {
  const sonde_error_report *seen = &b->in->result->stage3;
  b->report.holdouts = b->holdout;
  for (uint32_t p = 0; p < out->probe_count && b->report.holdout_count < HOLDOUTS; ++p) {
    if (!out->probes[p].count) continue;
    double training = NAN;
    for (uint32_t q = 0; q < seen->probe_count; ++q)
      if (!strcmp(seen->probe[q], out->probe[p])) training = seen->probes[q].mae_percent;
    b->holdout[b->report.holdout_count++] = (sonde_report_holdout){what,
                                                                   out->probe[p],
                                                                   out->probes[p].mae_n,
                                                                   out->probes[p].sd_n,
                                                                   out->probes[p].mae_percent,
                                                                   training};
  }
}

// ---- notes --------------------------------------------------------------------------------------

// Appends to the note that is being written; what has no room is cut off.
__attribute__((format(printf, 2, 3))) static void say(builder *b, const char *format, ...) {
  assert(b->report.note_count < NOTES);
  char *text = b->text[b->report.note_count];
  size_t used = strlen(text);
  va_list values;
  va_start(values, format);
  vsnprintf(text + used, NOTE - used, format, values);
  va_end(values);
}

static void end_note(builder *b) {
  assert(b->report.note_count < sizeof b->note / sizeof *b->note);
  b->note[b->report.note_count] = b->text[b->report.note_count];
  ++b->report.note_count;
}

static void add_notes(builder *b) {
  const sonde_fit_confidence *c = &b->in->result->confidence;
  const fit_checks *checks = b->in->checks;
  if (c->tried_count) {
    say(b, "Error of sites left out one by one (linearised), by smoothness:");
    for (uint32_t k = 0; k < c->tried_count; ++k)
      say(b, " %g: %.2f %%%s", c->tried_sd[k], c->tried_percent[k],
          k + 1 < c->tried_count ? "," : ".");
    end_note(b);
  }
  if (checks->parts.count > 1) {
    say(b, "Correlation of ln G with mean ln k0, and condition of the correlations of G, gm, k0 "
           "and xm:");
    for (uint32_t k = 0; k < checks->parts.count; ++k)
      say(b, " %s %+.2f, %.3g%s", b->part_name[k], checks->parts.part[k].correlation[0][2],
          checks->parts.part[k].condition, k + 1 < checks->parts.count ? ";" : ".");
    end_note(b);
  }
  if (checks->layers) {
    say(b, "Laws of the layer between neighbours, each refitted; MAE, seen (sites left out, "
           "linearised):");
    for (int k = 0; k < SONDE_FIT_LAYERS; ++k) {
      const sonde_fit_layer *l = &checks->layer[k];
      for (uint32_t p = 0; p < l->seen.probe_count; ++p)
        say(b, "%s%s %s %.2f %% (%.2f %%)",
            p   ? ", "
            : k ? "; "
                : " ",
            p ? "" : fit_checks_layer(l->kind), l->seen.probe[p], l->seen.probes[p].mae_percent,
            l->one_out.probes[p].mae_percent);
    }
    end_note(b);
  }
  for (uint32_t k = 0; k < b->in->doubts->count; ++k) {
    char sentence[NOTE];
    fit_doubts_sentence(&b->in->doubts->doubt[k], b->in->path, sentence, sizeof sentence);
    say(b, "Warning: %s", sentence);
    end_note(b);
  }
  if (b->in->data->remark[0]) {
    say(b, "%s", b->in->data->remark);
    end_note(b);
  }
  b->report.notes = b->note;
}

sonde_status fit_report_write(const fit_findings *in, const char *directory,
                              const sonde_progress *progress, sonde_error *error) {
  const sonde_fit_result *r = in->result;
  builder *b = calloc(1, sizeof *b);
  double *full_n = calloc(in->data->count, sizeof *full_n);
  double *linear_n = calloc(in->data->count, sizeof *linear_n);
  sonde_report_site *site = calloc(r->site_count, sizeof *site);
  sonde_status status = b && full_n && linear_n && site ? SONDE_OK : SONDE_MEMORY;
  if (!status && r->stage_n[1])
    status = fit_stage2_in_full(in->model, in->sites, in->data, r, progress, full_n, error);
  if (!status) {
    bool three = r->stage_n[2] != NULL;
    *b = (builder){.in = in, .site = site};
    b->report = (sonde_fit_report){.title = "Estimation report",
                                   .provenance = in->model->provenance,
                                   .command_line = in->command_line,
                                   .version = sonde_version(),
                                   .model = in->model,
                                   .sites = in->sites,
                                   .data = in->data,
                                   .stages = b->stage,
                                   .timings = b->timing};
    time_t now = time(NULL);
    struct tm parts;
    if (gmtime_r(&now, &parts) && strftime(b->date, sizeof b->date, "%Y-%m-%d %H:%M UTC", &parts))
      b->report.date = b->date;
    fit_linear_forces(in->data, linear_n);
    add_stage(b, "linear springs, curve by curve", r->stage1_parameters / 2, linear_n, false);
    add_stage(b, "stage 1, eq. (1) curve by curve", r->stage1_parameters, r->stage_n[0],
              !r->stage_n[1]);
    add_stage(b, "stage 2 in its simplified interaction (the paper)", r->stage2_parameters,
              r->stage_n[1], !three);
    add_stage(b, "stage 2's parameters in the full model (every eighth site)", r->stage2_parameters,
              r->stage_n[1] ? full_n : NULL, false);
    add_stage(b, "stage 3, full model", r->parameters, r->stage_n[2], three);
    add_parameters(b);
    add_checks(b);
    if (r->confidence.one_out_n)
      add_holdout(b, "one site at a time (linearised)", &r->confidence.one_out);
    if (in->hold_out) add_holdout(b, in->hold_out_name, in->hold_out);
    if (in->also) add_holdout(b, "sites, refitted; probe never fitted", in->also);
    static const char *const NAMES[] = {"stage 1", "stage 2", "stage 3"};
    for (int k = 0; k < 3; ++k)
      if (r->stage_n[k])
        b->timing[b->report.timing_count++] = (sonde_report_timing){NAMES[k], r->seconds[k]};
    add_notes(b);
    status = sonde_fit_report_write(&b->report, directory, error);
  }
  free(b);
  free(full_n);
  free(linear_n);
  free(site);
  return status;
}
