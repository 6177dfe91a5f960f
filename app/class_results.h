// The finished exams of a class, for the board and for files.
#ifndef SONDE_APP_CLASS_RESULTS_H
#define SONDE_APP_CLASS_RESULTS_H

#include "app.h"

typedef struct class_results {
  char log[4200];    // the log of exams
  long long seen_ns; // when it was changed last, as far as it was read
} class_results;

// Publishes the finished exams of the log, if it has changed: as JSON, as a table, as statements.
void class_results_tell(class_results *results, const char *home, sonde_door *door);

#endif
