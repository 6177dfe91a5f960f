// What the table of measurements brought besides its rows: repeats, unloading, offsets of curves.
#ifndef SONDE_APP_FIT_TABLES_H
#define SONDE_APP_FIT_TABLES_H

#include "sonde/sonde.h"

void fit_tables_print(const sonde_measurements *data, const sonde_fit_def *def,
                      const sonde_fit_result *result);
void fit_tables_print_json(const sonde_measurements *data, const sonde_fit_def *def,
                           const sonde_fit_result *result);
// The model keeps the measurements at the depths and forces that stage 3 found them to have.
void fit_tables_correct(const sonde_fit_result *result, sonde_model *model);

#endif
