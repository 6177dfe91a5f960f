// `sonde fit --sample`: one specimen between two plates.
#ifndef SONDE_APP_FIT_SAMPLE_H
#define SONDE_APP_FIT_SAMPLE_H

#include "sonde/sonde.h"

typedef struct fit_sample_options {
  const char *path;
  double exponent;          // 0: chosen by held-out error
  double area_m2, height_m; // 0: those of the file
  bool accept_implausible, json;
} fit_sample_options;

// Fits, prints; returns the exit code.
int fit_sample_run(const fit_sample_options *options);

#endif
