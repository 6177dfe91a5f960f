// Shared by the tests of the identify room: the sphere, records by hand, temporary files.
#ifndef SONDE_TESTS_IDENTIFY_H
#define SONDE_TESTS_IDENTIFY_H

#include "../fixture.h"
#include "../sanitized.h"
#include "base/random.h"
#include "sonde/identify.h"

#include <stdio.h>
#include <unistd.h>

static inline void assert_ok(sonde_status status, const sonde_error *error) {
  if (status) fail_msg("status %d: %s", (int)status, error->message);
}

static inline void assert_says(const sonde_error *error, const char *part) {
  if (!strstr(error->message, part)) fail_msg("'%s' is not in '%s'", part, error->message);
}

// Name of a file that no other test process uses.
static inline const char *temporary_path(void) {
  static char path[256];
  snprintf(path, sizeof path, "%s/identify_test_%d", SONDE_BINARY_DIR, (int)getpid());
  return path;
}

static inline const char *write_temporary(const char *text) {
  FILE *file = fopen(temporary_path(), "wb");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  return temporary_path();
}

#endif
