// Measures beside their targets, as sonde validate prints them.
#ifndef SONDE_APP_VALIDATE_LIST_H
#define SONDE_APP_VALIDATE_LIST_H

#include <stdbool.h>

enum { VALIDATE_MOST = 64 };

typedef struct validate_measure {
  char name[48], target[40];
  double value, least, most;
  bool pass;
} validate_measure;

typedef struct validate_list {
  bool json;
  const char *working; // what the progress line says between two measures; NULL: nothing
  int count, failed;
  validate_measure list[VALIDATE_MOST];
} validate_list;

// Passes from `least` to `most`; infinite: no bound on that side. The target in words; NULL: its
// bound. Prints a line at once unless the list is for JSON.
void validate_note(validate_list *l, const char *name, double value, double least, double most,
                   const char *target);
// Prints the JSON object, or how many passed. Returns whether all did.
bool validate_end(const validate_list *l);

#endif
