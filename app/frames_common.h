// Shared by reconstruct and slice: a sequence with poses.
#ifndef SONDE_APP_FRAMES_COMMON_H
#define SONDE_APP_FRAMES_COMMON_H

#include "options.h"
#include "sonde/sweep_poses.h"

// What tells where the frames are.
typedef struct frames_options {
  const char *config, *world, *range, *clip;
  bool refine_poses;
} frames_options;

// Their rows in a command's table; m: the member.
// NOLINTBEGIN(bugprone-macro-parentheses): offsetof() takes no parentheses around a member
#define FRAMES_OPTIONS(m)                                                                          \
  OPT_TEXT(m.config, "config", "FILE",                                                             \
           "PLUS configuration (XML) with the ImageToProbe transform and the clip rectangle, or "  \
           "TUS-REC's calib_matrix.csv"),                                                          \
      OPT_TEXT(m.world, "world", "NAME",                                                           \
               "frame of reference of the poses; default the first of Reference, Tracker, World "  \
               "and Probe that the transforms reach"),                                             \
      OPT_TEXT(m.range, "frames", "A:B", "use only frames A to B"),                                \
      OPT_TEXT(m.clip, "clip", "X,Y,W,H",                                                          \
               "use only this part of every frame, in pixels; it replaces that of the "            \
               "configuration"),                                                                   \
      OPT_FLAG(m.refine_poses, "refine-poses",                                                     \
               "correct the poses by what the frames show: the tracker's jitter, its time offset " \
               "and the calibration; what the frames do not determine is kept")
// NOLINTEND(bugprone-macro-parentheses)

// Corrects the poses where the options say so, without the content of frame left_out
// (SONDE_WHOLE_FILE: none is left out); else leaves the findings zero.
sonde_status frames_refine(const frames_options *options, uint32_t left_out,
                           sonde_sequence *sequence, sonde_pose_findings *findings,
                           sonde_error *error);
// Prints them, or puts them into the JSON under way; nothing without frames.
void frames_show(const sonde_pose_findings *findings, bool json);
// Reads a sequence by its name's end: HDF5, else what sonde_sequence_load() reads.
sonde_status frames_read(const char *path, sonde_sequence *sequence, sonde_error *error);
// Loads, clips, locates and keeps the range; SONDE_ARGUMENT for options that do not fit.
sonde_status frames_load(const char *path, const frames_options *options, sonde_sequence *sequence,
                         sonde_located *located, sonde_error *error);
// "1,2,3": exactly count numbers.
bool frames_numbers(const char *text, int count, char separator, double *values);
#endif
