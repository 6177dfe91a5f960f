// Shared by reconstruct and slice: a sequence with poses.
#ifndef SONDE_APP_FRAMES_COMMON_H
#define SONDE_APP_FRAMES_COMMON_H

#include "options.h"

// What tells where the frames are.
typedef struct frames_options {
  const char *config, *world, *range, *clip;
} frames_options;

// Their rows in a command's table; m: the member.
// NOLINTBEGIN(bugprone-macro-parentheses): offsetof() takes no parentheses around a member
#define FRAMES_OPTIONS(m)                                                                          \
  OPT_TEXT(m.config, "config", "FILE",                                                             \
           "PLUS configuration (XML) with the ImageToProbe transform and the clip rectangle"),     \
      OPT_TEXT(m.world, "world", "NAME",                                                           \
               "frame of reference of the poses; default the first of Reference, Tracker, World "  \
               "and Probe that the transforms reach"),                                             \
      OPT_TEXT(m.range, "frames", "A:B", "use only frames A to B"),                                \
      OPT_TEXT(m.clip, "clip", "X,Y,W,H",                                                          \
               "use only this part of every frame, in pixels; it replaces that of the "            \
               "configuration")
// NOLINTEND(bugprone-macro-parentheses)

// Loads, clips, locates and keeps the range; SONDE_ARGUMENT for options that do not fit.
sonde_status frames_load(const char *path, const frames_options *options, sonde_sequence *sequence,
                         sonde_located *located, sonde_error *error);
// "1,2,3": exactly count numbers.
bool frames_numbers(const char *text, int count, char separator, double *values);
#endif
