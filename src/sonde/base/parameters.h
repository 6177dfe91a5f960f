// Structs whose numbers are drawn or given: their lists of parameters (sonde/base.h).
#ifndef SONDE_SRC_PARAMETERS_H
#define SONDE_SRC_PARAMETERS_H

#include "base/link.h"
#include "sonde/base.h"

// Makes every member of the list NaN, which stands for a number that nobody gave.
SONDE_LINK void sonde_parameters_forget(void *of, const sonde_parameter *list, size_t count);
// Checks the ranges of the members; `complete`: NaN is out of range too, not just unknown.
// @return ARGUMENT naming parameter and range
SONDE_LINK sonde_status sonde_parameters_check(const void *of, const sonde_parameter *list,
                                               size_t count, bool complete, sonde_error *error);

#endif
