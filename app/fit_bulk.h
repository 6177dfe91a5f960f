// sonde fit --model of a volumetric kind: moduli sought, model written, figures printed.
#ifndef SONDE_APP_FIT_VOLUME_H
#define SONDE_APP_FIT_VOLUME_H

#include "app.h"
#include "sonde/fit_bulk.h"

extern const char *const fit_bulk_kinds[]; // in the order of sonde_model_kind, NULL at the end

typedef struct fit_bulk_job {
  const sonde_model_def *def;
  const sonde_site_table *sites;
  const sonde_measurements *measurements;
  const sonde_fit_bulk_def *options;
  const char *output;
  bool json;
} fit_bulk_job;

sonde_status fit_bulk_run(const fit_bulk_job *job, sonde_error *error);

#endif
