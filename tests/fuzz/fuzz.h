// What every fuzz target shares: one input, whether the reader accepted it, and a file that holds
// it, because the readers take paths.
#ifndef SONDE_TESTS_FUZZ_H
#define SONDE_TESTS_FUZZ_H

#include "sonde/sonde.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count);

// Set by a target when the reader accepted the input. Every seed must be accepted: a seed of an
// old version of a format never gets beyond the reader's first lines.
extern bool fuzz_accepted;
// Set by the driver while it runs a seed that no variant changed: all work is done on it.
extern bool fuzz_is_seed;

// Aborts when a promise of a reader is broken; the fuzzer and the driver report the input.
#define FUZZ_CHECK(condition)                                                                      \
  do {                                                                                             \
    if (!(condition)) {                                                                            \
      fprintf(stderr, "%s:%d: broken: %s\n", __FILE__, __LINE__, #condition);                      \
      abort();                                                                                     \
    }                                                                                              \
  } while (0)

// Directory of this process for files that the readers open. Made at the first call; removed at the
// end of the process by fuzz_common.c.
const char *fuzz_directory(void);
// Path of a name in that directory; one of a few static texts, overwritten by later calls.
const char *fuzz_path(const char *name);
// Writes bytes to that name and returns its path.
const char *fuzz_file(const char *name, const uint8_t *bytes, size_t count);
// The input as text with a 0 behind it, freed by the caller; NULL when it has a byte 0.
char *fuzz_text(const uint8_t *bytes, size_t count);

// A failure has a status and a sentence. Records whether the reader accepted the input; returns
// that.
bool fuzz_checked(sonde_status status, const sonde_error *error);

// A small leg with vessels and one site, made once per process. Its checksum is constant.
sonde_model *fuzz_leg(void);
// The path of the same leg saved as a model file.
const char *fuzz_leg_file(void);
// A pose that presses the leg's site by depth_m.
sonde_pose fuzz_press(const sonde_model *model, double depth_m);
// Advances a model under the linear probe by a few steps and settles nothing: bounded work.
void fuzz_step_model(const sonde_model *model, const sonde_world_def *def);
// A picture of a model of 32 x 32 pixels with these findings; NULL is the leg, whose inside is made
// once: the inside of another model takes most of a second.
void fuzz_picture(const sonde_model *model, const sonde_pathology *pathology,
                  const sonde_findings *findings);
// Whether this input is among the share of 1/one_of of all inputs on which expensive work is done.
bool fuzz_chosen(const uint8_t *bytes, size_t count, uint64_t one_of);
// A session on the leg, driven by a script that presses it; images of 32 x 32 pixels.
sonde_session *fuzz_session(const char *record_path, sonde_device *device);

#endif
