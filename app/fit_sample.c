// One specimen between two plates: the springs of n = 1, 2, 3 and of a free n; the one that
// predicts best what was left out, and the others beside it.
#include "fit_sample.h"

#include "app.h"
#include "fit_doubts.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

enum { LAWS = 4 };
static const double EXPONENT[LAWS] = {1, 2, 3, 0};

typedef struct findings {
  sonde_sample sample;
  sonde_sample_law law[LAWS];
  int best; // among those that a model file can hold, or the one that was asked for
  sonde_doubts doubts;
} findings;

// Of the specimen's material at small compression; NaN without its sizes.
static double modulus_kpa(const sonde_sample *s, const sonde_sample_law *l) {
  bool known = s->area_m2 > 0 && s->height_m > 0;
  return known ? 1e-3 * l->stiffness_n_m * s->height_m / s->area_m2 : NAN;
}

static void print_json_law(const char *key, const sonde_sample *s, const sonde_sample_law *l) {
  app_json_object(key);
  app_json("exponent:%g stiffness_n_mm:%g asymptote_mm:%g a_per_n:%g b_mm_per_n:%g "
           "modulus_kpa:%g mae_n:%g rms_n:%g mae_percent:%g rms_percent:%g held_out_percent:%g "
           "converged:%hhd",
           l->exponent, 1e-3 * l->stiffness_n_m, 1e3 * l->asymptote_m,
           -1 / (l->stiffness_n_m * l->asymptote_m), 1e3 / l->stiffness_n_m, modulus_kpa(s, l),
           l->mae_n, l->rms_n, l->mae_percent, l->rms_percent, l->held_out_percent, l->converged);
  app_json_close();
}

int fit_sample_run(const fit_sample_options *o) {
  assert(o->path);
  findings f = {0};
  sonde_error error = {0};
  sonde_status status = sonde_sample_load(o->path, &f.sample, &error);
  if (o->area_m2 > 0) f.sample.area_m2 = o->area_m2;
  if (o->height_m > 0) f.sample.height_m = o->height_m;
  if (!status) status = sonde_sample_examine(&f.sample, &f.doubts, &error);
  if (!status) status = fit_doubts_decide(&f.doubts, o->path, o->accept_implausible, &error);
  if (!status) fit_doubts_print(&f.doubts, 0, o->path);
  for (int k = 0; k < LAWS && !status; ++k)
    status = sonde_fit_sample(&f.sample, EXPONENT[k], &f.law[k], &error);
  for (int k = 0; k < LAWS - 1 && !status; ++k)
    if (o->exponent > 0 ? EXPONENT[k] == o->exponent
                        : f.law[k].held_out_percent < f.law[f.best].held_out_percent)
      f.best = k;
  if (!status && o->json) {
    static const char *const KEY[LAWS] = {"n1", "n2", "n3", "free"};
    app_json_begin();
    app_json("count:%u exponent:%g", f.sample.count, f.law[f.best].exponent);
    for (int k = 0; k < LAWS; ++k) print_json_law(KEY[k], &f.sample, &f.law[k]);
    print_json_law("chosen", &f.sample, &f.law[f.best]);
    fit_doubts_print_json(&f.doubts, o->path);
    app_json_end();
  }
  if (!status && !o->json) {
    const sonde_sample_law *best = &f.law[f.best], *one = &f.law[0];
    printf("%s: %u rows to %.4g mm\n", o->path, f.sample.count,
           1e3 * f.sample.compression_m[f.sample.count - 1]);
    printf("  %-6s %10s %9s %9s %10s %10s %10s\n", "n", "K N/mm", "x_m mm", "MAE N", "of mean",
           "RMS/peak", "left out");
    for (int k = 0; k < LAWS; ++k)
      printf("  %-6.3f %10.4g %9.2f %9.3f %8.2f %% %8.2f %% %8.2f %%%s\n", f.law[k].exponent,
             1e-3 * f.law[k].stiffness_n_m, 1e3 * f.law[k].asymptote_m, f.law[k].mae_n,
             f.law[k].mae_percent, f.law[k].rms_percent, f.law[k].held_out_percent,
             k == f.best     ? "  chosen"
             : k == LAWS - 1 ? "  n estimated"
                             : "");
    printf("n = 1: f = x/(a x + b) with a = %.5g 1/N, b = %.5g mm/N\n",
           -1 / (one->stiffness_n_m * one->asymptote_m), 1e3 / one->stiffness_n_m);
    if (isfinite(modulus_kpa(&f.sample, best)))
      printf("modulus at small compression %.4g kPa\n", modulus_kpa(&f.sample, best));
  }
  sonde_sample_clear(&f.sample);
  return status ? app_fail("fit", &error) : APP_OK;
}
