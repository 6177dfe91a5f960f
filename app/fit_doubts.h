// What `sonde fit` says about implausible measurements and results.
#ifndef SONDE_APP_FIT_DOUBTS_H
#define SONDE_APP_FIT_DOUBTS_H

#include "sonde/sonde.h"

// Refuses what is absurd, and what is implausible unless `accept`; error names file, line, curve.
sonde_status fit_doubts_decide(const sonde_doubts *doubts, const char *path, bool accept,
                               sonde_error *error);
// One line per doubt on stderr, from number `first` on.
void fit_doubts_print(const sonde_doubts *doubts, uint32_t first, const char *path);
// "warnings" into the open JSON object: sentences by kind.
void fit_doubts_print_json(const sonde_doubts *doubts, const char *path);
// The whole sentence with file, line and curve.
void fit_doubts_sentence(const sonde_doubt *doubt, const char *path, char *text, size_t room);

#endif
