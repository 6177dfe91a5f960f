// Shared by fit and predict: the error table and its JSON form.
#ifndef SONDE_APP_FIT_COMMON_H
#define SONDE_APP_FIT_COMMON_H

#include "app.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

static inline void app_print_statistics(const char *name, const sonde_error_statistics *s) {
  printf("  %-10s %6u %8.3f %8.3f %8.3f %10.3f %8.2f %%\n", name, s->count, s->mae_n, s->sd_n,
         s->rmse_n, s->mean_force_n, s->mae_percent);
}

static inline void app_print_report(const char *title, const sonde_error_report *r) {
  printf("%s\n  %-10s %6s %8s %8s %8s %10s %10s\n", title, "probe", "count", "MAE N", "SD N",
         "RMSE N", "mean N", "MAE");
  for (uint32_t p = 0; p < r->probe_count; ++p) app_print_statistics(r->probe[p], &r->probes[p]);
  app_print_statistics("all", &r->all);
}

static inline void app_json_statistics(const char *key, const sonde_error_statistics *s) {
  app_json_object(key);
  app_json("count:%u mae_n:%g sd_n:%g rmse_n:%g mean_force_n:%g mae_percent:%g", s->count, s->mae_n,
           s->sd_n, s->rmse_n, s->mean_force_n, s->mae_percent);
  app_json_close();
}

// "interaction", "all" and "probes" into the open object.
static inline void app_json_report(const char *interaction, const sonde_error_report *r) {
  app_json_text("interaction", interaction);
  app_json_statistics("all", &r->all);
  app_json_object("probes");
  for (uint32_t p = 0; p < r->probe_count; ++p) app_json_statistics(r->probe[p], &r->probes[p]);
  app_json_close();
}

#endif
