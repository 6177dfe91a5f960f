// The exponent of the normal springs that predicts left-out measurements best.
#include "sonde/fit_confidence.h"

#include "base/base.h"
#include "base/maths.h"

typedef struct share {
  const sonde_progress *whole;
  uint32_t index;
} share;

static bool share_progress(double fraction, const char *what, void *user) {
  const share *s = user;
  return s->whole->report((s->index + fraction) / SONDE_FIT_EXPONENTS, what, s->whole->user);
}

static double held_out_percent(const sonde_error_report *one_out) {
  double sum = 0;
  for (uint32_t p = 0; p < one_out->probe_count; ++p) sum += one_out->probes[p].mae_percent;
  return one_out->probe_count && isfinite(sum) ? sum / one_out->probe_count : INFINITY;
}

sonde_status sonde_fit_exponents(const sonde_model *model, const sonde_site_table *sites,
                                 const sonde_measurements *m, const sonde_fit_def *def,
                                 const sonde_progress *progress, sonde_fit_exponent *tried,
                                 sonde_fit_result *result, sonde_error *error) {
  *result = (sonde_fit_result){0};
  double least = INFINITY;
  for (uint32_t k = 0; k < SONDE_FIT_EXPONENTS; ++k) {
    sonde_fit_def one = *def;
    sonde_fit_result found;
    share part = {progress, k};
    const sonde_progress reports = {share_progress, &part};
    one.stages = 3;
    one.normal_exponent = k + 1;
    sonde_status status = sonde_fit(model, sites, m, &one,
                                    progress && progress->report ? &reports : NULL, &found, error);
    if (status) {
      sonde_fit_result_clear(result);
      return status;
    }
    tried[k] = (sonde_fit_exponent){.exponent = one.normal_exponent,
                                    .mae_percent = held_out_percent(&found.stage3),
                                    .held_out_percent = held_out_percent(&found.confidence.one_out),
                                    .converged = found.converged};
    bool better = k == 0 || tried[k].held_out_percent < least;
    if (better) least = tried[k].held_out_percent;
    sonde_fit_result_clear(better ? result : &found);
    if (better) *result = found;
  }
  SONDE_ASSERT(result->law.normal_exponent >= 1);
  return SONDE_OK;
}
