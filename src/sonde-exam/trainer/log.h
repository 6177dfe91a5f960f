// What the files of the log share.
#ifndef SONDE_SRC_TRAINER_LOG_H
#define SONDE_SRC_TRAINER_LOG_H

#include "base/base.h"
#include "sonde/trainer_log.h"

#include <math.h>
#include <stdarg.h>

// Copies a text (NULL: empty), cut between two characters where it is too long.
void sonde_log_copy(char *to, size_t size, const char *utf8);

#endif
