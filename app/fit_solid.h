// sonde fit --solid: moduli of the hyperelastic solid from measurements, and what they predict.
#ifndef SONDE_APP_FIT_SOLID_H
#define SONDE_APP_FIT_SOLID_H

#include "app.h"
#include "sonde/fit_solid.h"

typedef struct fit_solid_job {
  const sonde_model_def *def;
  const sonde_site_table *sites;
  const sonde_measurements *measurements, *also; // `also` is empty when there are none
  const sonde_fit_solid_def *options;
  const char *at, *check; // lists of sites: fitted (NULL: all), predicted (NULL: none)
  uint32_t depths;        // of each curve; 0: all
  bool beside;            // what the springs say of the same rows with their site left out
  const char *output;     // table of moduli
  bool json;
} fit_solid_job;

sonde_status fit_solid_run(const fit_solid_job *job, sonde_error *error);

#endif
