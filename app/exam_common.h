// Cases, protocols and single exams: what `sonde exam` and `sonde cases` share.
#ifndef SONDE_APP_EXAM_COMMON_H
#define SONDE_APP_EXAM_COMMON_H

#include "app.h"

// Where cases and protocols come from.
typedef struct exam_library {
  char cases[1100], protocols[1100], course[1100], bundled[1024];
  bool has_bundled;
} exam_library;

// @param cases,protocols directories asked for, NULL: those that ship
exam_library exam_library_find(const char *cases, const char *protocols);
// A case by id or by path; `directory` receives where its model files lie.
sonde_status exam_find_case(const exam_library *library, const char *word, sonde_case *out,
                            char *directory, size_t size, sonde_error *error);
sonde_status exam_find_protocol(const exam_library *library, const char *word,
                                sonde_exam_protocol *out, sonde_error *error);

typedef struct compare_options {
  const exam_library *library;
  const sonde_exam_protocol *protocol;
  const char *only;      // id of one case; NULL: all
  const char *directory; // NULL: nothing is written
  long seed, seeds;
  bool json, solid;
} compare_options;
// Every case by every operator; prints the table and each metric's separation.
int exam_compare(const compare_options *options);

// Brings the log, results and reports of a directory of exams up to what their journals say.
int exam_recover(const exam_library *library, const char *directory, bool json);

#endif
