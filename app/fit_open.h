// Whether a fitted model can be used, before it is written.
#ifndef SONDE_APP_FIT_OPEN_H
#define SONDE_APP_FIT_OPEN_H

#include "sonde/sonde.h"

// Builds what `sonde press` and `sonde run` need of the model and presses a probe at the site
// nearest the middle of all. @return what they would refuse it with
sonde_status fit_open_check(const sonde_model *model, const char *probe, sonde_error *error);
// Reads a file that was just written and compares it with the model; devices and pipes are left.
sonde_status fit_open_written(const sonde_model *model, const char *path, sonde_error *error);

#endif
