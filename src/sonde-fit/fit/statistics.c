// Bias and mean errors of rows, whole and per probe.
#include "base/maths.h"
#include "base/order.h"
#include "fit/fit_inside.h"

#include <string.h>

// Mean and deviation about it, two passes.
static void spread(const double *values, uint32_t count, double *mean, double *sd) {
  double sum = 0.0, squares = 0.0;
  for (uint32_t i = 0; i < count; ++i) sum += values[i];
  *mean = sum / count;
  for (uint32_t i = 0; i < count; ++i) squares += (values[i] - *mean) * (values[i] - *mean);
  *sd = sqrt(squares / count);
}

// Fills the statistics from signed errors; errors become sorted |e|.
static void summarise(double *errors, uint32_t count, double force_sum_n,
                      sonde_error_statistics *s) {
  *s = (sonde_error_statistics){.count = count};
  if (!count) return;
  SONDE_ASSERT(isfinite(force_sum_n));
  spread(errors, count, &s->bias_n, &s->sd_n);
  double squares = 0.0;
  for (uint32_t i = 0; i < count; ++i) {
    squares += errors[i] * errors[i];
    errors[i] = fabs(errors[i]);
  }
  s->rmse_n = sqrt(squares / count);
  spread(errors, count, &s->mae_n, &s->sd_abs_n);
  s->mean_force_n = force_sum_n / count;
  s->mae_percent = s->mean_force_n > 0 ? 100.0 * s->mae_n / s->mean_force_n : NAN;
  qsort(errors, count, sizeof *errors, sonde_compare_reals);
  s->median_abs_n = sonde_percentile(errors, count, 0.5);
  s->p95_abs_n = sonde_percentile(errors, count, 0.95);
  s->max_abs_n = errors[count - 1];
}

sonde_status sonde_error_statistics_of(const double *model_n, const double *measured_n,
                                       uint32_t count, sonde_error_statistics *statistics,
                                       sonde_error *error) {
  double *errors = SONDE_NEW(double, count);
  if (!errors) return sonde_fail_memory(error);
  uint32_t used = 0;
  double force_sum_n = 0.0;
  for (uint32_t i = 0; i < count; ++i) {
    if (!isfinite(model_n[i])) continue;
    errors[used++] = model_n[i] - measured_n[i];
    force_sum_n += measured_n[i];
  }
  summarise(errors, used, force_sum_n, statistics);
  sonde_free(errors);
  return SONDE_OK;
}

uint32_t sonde_probe_index(char probe[][24], uint32_t *count, const char *name) {
  for (uint32_t p = 0; p < *count; ++p)
    if (!strcmp(probe[p], name)) return p;
  if (*count == SONDE_FIT_PROBES) return UINT32_MAX;
  snprintf(probe[*count], sizeof probe[0], "%s", name);
  return (*count)++;
}

// Statistics of the rows of one probe; NULL picks all.
static void pick(const sonde_datum *data, const double *model_n, uint32_t count, const char *probe,
                 double *scratch, sonde_error_statistics *statistics) {
  uint32_t used = 0;
  double force_sum_n = 0.0;
  for (uint32_t i = 0; i < count; ++i) {
    if (!isfinite(model_n[i]) || (probe && strcmp(data[i].probe, probe) != 0)) continue;
    scratch[used++] = model_n[i] - data[i].force_n;
    force_sum_n += data[i].force_n;
  }
  summarise(scratch, used, force_sum_n, statistics);
}

sonde_status sonde_error_report_of(const sonde_datum *data, const double *model_n, uint32_t count,
                                   sonde_error_report *report, sonde_error *error) {
  *report = (sonde_error_report){0};
  for (uint32_t i = 0; i < count; ++i)
    if (sonde_probe_index(report->probe, &report->probe_count, data[i].probe) == UINT32_MAX)
      return sonde_fail(error, SONDE_ARGUMENT, "more than %d probes in one set of measurements",
                        SONDE_FIT_PROBES);
  double *scratch = SONDE_NEW(double, count);
  if (!scratch) return sonde_fail_memory(error);
  pick(data, model_n, count, NULL, scratch, &report->all);
  for (uint32_t p = 0; p < report->probe_count; ++p)
    pick(data, model_n, count, report->probe[p], scratch, &report->probes[p]);
  SONDE_ASSERT(report->all.count <= count);
  report->left_out = count - report->all.count;
  sonde_free(scratch);
  return SONDE_OK;
}
