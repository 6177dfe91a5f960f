// The finished exams of a class, for the board and for files.
#ifndef SONDE_APP_CLASS_RESULTS_H
#define SONDE_APP_CLASS_RESULTS_H

#include "app.h"

#include <pthread.h>

typedef struct class_results {
  char log[4200];           // the log of exams
  long long seen_ns;        // when it was changed last, as far as it was read
  pthread_mutex_t lock;     // of the exams, which the door's thread reads too
  sonde_log_entry *entries; // [count] newest first
  uint32_t count;
} class_results;

// Publishes the finished exams of the log, if it has changed: as JSON, as a table, as statements.
void class_results_tell(class_results *results, const char *home, sonde_door *door);
// That date and the exams of a trainee that ended since, oldest first, as one JSON object that
// the caller frees with sonde_free(); NULL when memory is short.
char *class_results_since(class_results *results, const char *trainee, const char *date);

#endif
