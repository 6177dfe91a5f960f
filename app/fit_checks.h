// What `sonde fit` can say about a result of stage 3 besides its errors.
#ifndef SONDE_APP_FIT_CHECKS_H
#define SONDE_APP_FIT_CHECKS_H

#include "sonde/sonde.h"

typedef struct fit_checks {
  // Wanted.
  bool profile, identify, layers;
  const sonde_measurements *also; // for the layers: predicted only; NULL: none
  uint32_t starts;
  uint64_t seed;
  // Found.
  sonde_fit_profile shear;
  sonde_fit_identifiability parts;
  sonde_fit_starts ends;
  sonde_fit_layer layer[SONDE_FIT_LAYERS];
} fit_checks;

sonde_status fit_checks_run(fit_checks *checks, const sonde_model *model,
                            const sonde_site_table *sites, const sonde_measurements *data,
                            const sonde_fit_def *def, const sonde_fit_result *result,
                            const sonde_progress *progress, sonde_error *error);
void fit_checks_print(const fit_checks *checks);
void fit_checks_print_json(const fit_checks *checks);
// "linear only", or "all probes".
void fit_checks_name(const sonde_fit_part *part, char name[40]);
// What a law of the layer is called.
const char *fit_checks_layer(sonde_layer kind);

#endif
