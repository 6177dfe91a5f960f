// Shared by the tests of the fit room: cmocka, temporary files, checks of errors.
#ifndef SONDE_TESTS_FIT_H
#define SONDE_TESTS_FIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sonde/fit.h"

#define DATA_DIR SONDE_SOURCE_DIR "/data/thigh/"

// Writes text to a fresh file and returns its name (static storage, overwritten by the next call).
static inline const char *write_temporary(const char *text) {
  static char path[256];
  snprintf(path, sizeof path, "%s/fit_test_%d.csv", SONDE_BINARY_DIR, (int)getpid());
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  return path;
}

// Group teardown: the file goes.
static inline int remove_temporary(void **state) {
  (void)state;
  unlink(write_temporary(""));
  return 0;
}

#define assert_near(a, b, tolerance)                                                               \
  do {                                                                                             \
    double near_a = (a), near_b = (b), near_t = (tolerance);                                       \
    if (!(fabs(near_a - near_b) <= near_t))                                                        \
      fail_msg("%s = %.17g, expected %.17g within %g", #a, near_a, near_b, near_t);                \
  } while (0)

static inline void assert_ok(sonde_status status, const sonde_error *error) {
  if (status) fail_msg("status %d: %s", (int)status, error->message);
}

static inline void assert_says(const sonde_error *error, const char *part) {
  if (!strstr(error->message, part)) fail_msg("'%s' is not in '%s'", part, error->message);
}

#endif
