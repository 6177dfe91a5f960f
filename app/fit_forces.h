// Forces of models that an estimation is compared with.
#ifndef SONDE_APP_FIT_FORCES_H
#define SONDE_APP_FIT_FORCES_H

#include "sonde/sonde.h"

// The least squares line F = k x through the origin for every curve. model_n: [data->count]
void fit_linear_forces(const sonde_measurements *data, double *model_n);

// What the simplified interaction's parameters of stage 2 give when neighbours may move: forces at
// every eighth site on the equilibrium of the whole skin, NaN elsewhere; all of them take minutes.
sonde_status fit_stage2_in_full(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *data, const sonde_fit_result *result,
                                const sonde_progress *progress, double *full_n, sonde_error *error);

#endif
