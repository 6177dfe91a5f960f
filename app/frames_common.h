// Shared by reconstruct and slice: a sequence with poses.
#ifndef SONDE_APP_FRAMES_COMMON_H
#define SONDE_APP_FRAMES_COMMON_H

#include "fit_common.h"

// What tells where the frames are.
typedef struct frames_options {
  const char *config, *world, *range, *clip;
} frames_options;

#define FRAMES_OPTION_LIST(o)                                                                      \
  {"--config", &(o).config, NULL}, {"--world", &(o).world, NULL}, {"--frames", &(o).range, NULL},  \
  {                                                                                                \
    "--clip", &(o).clip, NULL                                                                      \
  }

#define FRAMES_HELP                                                                                \
  "  --config FILE      PLUS configuration (XML) with ImageToProbe and the clip rectangle\n"       \
  "  --world NAME       frame of reference; default Reference, Tracker, World or Probe\n"          \
  "  --frames A:B       use only frames A to B\n"                                                  \
  "  --clip X,Y,W,H     use only this part of every frame, pixels\n"

// Loads, clips, locates and keeps the range; SONDE_ARGUMENT for options that do not fit.
sonde_status frames_load(const char *path, const frames_options *options, sonde_sequence *sequence,
                         sonde_located *located, sonde_error *error);
// "1,2,3": exactly count numbers.
bool frames_numbers(const char *text, int count, char separator, double *values);
sonde_status frames_fail(sonde_error *error, sonde_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
