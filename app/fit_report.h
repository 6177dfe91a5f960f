// What `sonde fit` knows, put into a report.
#ifndef SONDE_APP_FIT_REPORT_H
#define SONDE_APP_FIT_REPORT_H

#include "fit_checks.h"

typedef struct fit_findings {
  const sonde_model *model; // with the last stage's parameters
  const sonde_site_table *sites;
  const sonde_measurements *data;
  const sonde_fit_result *result;
  const char *command_line;
  const char *exponent_from;          // who says the exponent of the normal springs
  const char *hold_out_name;          // NULL: none
  const sonde_error_report *hold_out; // NULL: none
  const sonde_error_report *also;     // probes that were never fitted, in the same folds; or NULL
  const fit_checks *checks;
  const sonde_doubts *doubts;
  const char *path; // of the measurements
} fit_findings;

// Settles the models of stage 2 and 3 in full, fits linear springs, and writes the page.
sonde_status fit_report_write(const fit_findings *findings, const char *directory,
                              const sonde_progress *progress, sonde_error *error);

#endif
