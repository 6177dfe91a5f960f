// spread_of: mean and standard deviation of an offset over the curves.
#include "fit_tables.h"

#include "app.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct spread {
  double mean, sd;
} spread;

static spread spread_of(const sonde_fit_result *r, bool tare) {
  spread s = {0, 0};
  for (uint32_t c = 0; c < r->curve_count; ++c)
    s.mean += (tare ? r->curves[c].tare_n : 1e3 * r->curves[c].zero_m) / r->curve_count;
  for (uint32_t c = 0; c < r->curve_count; ++c) {
    double off = (tare ? r->curves[c].tare_n : 1e3 * r->curves[c].zero_m) - s.mean;
    s.sd += off * off / r->curve_count;
  }
  s.sd = sqrt(s.sd);
  return s;
}

// Root mean square over the rows of one curve's repeats about their mean.
static double scatter_of(const sonde_measurements *m) {
  double sum = 0;
  for (uint32_t i = 0; i < m->count; ++i) sum += m->scatter_n[i] * m->scatter_n[i] / m->count;
  return sqrt(sum);
}

void fit_tables_print(const sonde_measurements *m, const sonde_fit_def *def,
                      const sonde_fit_result *r) {
  if (m->unloading) printf("%u rows of unloading are left out\n", m->unloading);
  if (m->scatter_n)
    printf("up to %u repeats of a curve; standard deviation of their mean %.3g N\n", m->repeats,
           scatter_of(m));
  spread zero = spread_of(r, false), tare = spread_of(r, true);
  if (def->zero_sd_m > 0)
    printf("contact zero of the curves: %+.3f mm, standard deviation %.3f mm\n", zero.mean,
           zero.sd);
  if (def->tare_sd_n > 0)
    printf("tare of the curves: %+.3f N, standard deviation %.3f N\n", tare.mean, tare.sd);
}

void fit_tables_print_json(const sonde_measurements *m, const sonde_fit_def *def,
                           const sonde_fit_result *r) {
  spread zero = spread_of(r, false), tare = spread_of(r, true);
  app_json_integer("unloading_rows", m->unloading);
  app_json_integer("repeats", m->repeats);
  if (m->scatter_n) app_json_real("repeat_mean_sd_n", scatter_of(m));
  if (def->zero_sd_m > 0) {
    app_json_real("zero_mean_mm", zero.mean);
    app_json_real("zero_sd_mm", zero.sd);
  }
  if (def->tare_sd_n > 0) {
    app_json_real("tare_mean_n", tare.mean);
    app_json_real("tare_sd_n", tare.sd);
  }
}

void fit_tables_correct(const sonde_fit_result *r, sonde_model *model) {
  for (uint32_t i = 0; i < model->datum_count; ++i) {
    sonde_datum *d = &model->data[i];
    for (uint32_t c = 0; c < r->curve_count; ++c) {
      const sonde_curve_fit *curve = &r->curves[c];
      if (curve->site != d->site || strcmp(curve->probe, d->probe) != 0) continue;
      d->penetration_m = fmax(d->penetration_m - curve->zero_m, 0);
      d->force_n -= curve->tare_n;
    }
  }
}
