// The search for the scanner whose pictures have the texture of some stills.
#ifndef SONDE_APP_SCANNER_FIT_H
#define SONDE_APP_SCANNER_FIT_H

#include "settled.h"
#include "texture.h"

enum { SCANNER_FIT_MODELS = 8 };

typedef struct scanner_fit {
  const char *model[SCANNER_FIT_MODELS];
  uint32_t models, views; // views of each model
  uint32_t evaluations;
  uint64_t seed;
  sonde_scanner scanner; // where the search begins and what it found
  double before, after;  // mean squared distance of the quantiles, in spreads of the stills
  double real_dark;      // share of the stills' patches that are too dark
  double real[TEXTURE_FEATURES][TEXTURE_QUANTILES], found[TEXTURE_FEATURES][TEXTURE_QUANTILES];
} scanner_fit;

// `real` holds the stills' quantiles. Shows progress. @return ARGUMENT, NOT_FOUND, MEMORY
sonde_status scanner_fit_run(scanner_fit *fit, sonde_error *error);

#endif
