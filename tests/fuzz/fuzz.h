// What every fuzz target shares: one input, and a file that holds it, because the readers take
// paths.
#ifndef SONDE_TESTS_FUZZ_H
#define SONDE_TESTS_FUZZ_H

#include "sonde/sonde.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count);

// Aborts when a promise of a reader is broken; the fuzzer and the driver report the input.
#define FUZZ_CHECK(condition)                                                                      \
  do {                                                                                             \
    if (!(condition)) {                                                                            \
      fprintf(stderr, "%s:%d: broken: %s\n", __FILE__, __LINE__, #condition);                      \
      abort();                                                                                     \
    }                                                                                              \
  } while (0)

// Writes the input to this process's file with that extension and returns its path.
static inline const char *fuzz_file(const char *extension, const uint8_t *bytes, size_t count) {
  static char path[128];
  snprintf(path, sizeof path, "/tmp/sonde_fuzz_%ld.%s", (long)getpid(), extension);
  FILE *stream = fopen(path, "wb");
  FUZZ_CHECK(stream && fwrite(bytes, 1, count, stream) == count && fclose(stream) == 0);
  return path;
}

// A failure has a status and a sentence.
static inline void fuzz_check_error(sonde_status status, const sonde_error *error) {
  FUZZ_CHECK(status > SONDE_OK && status < SONDE_STATUS_COUNT && error->status == status);
  FUZZ_CHECK(error->message[0] && memchr(error->message, 0, sizeof error->message));
}

#endif
