// A scanned leg among the options of a command: surfaces or a volume of labels.
#ifndef SONDE_APP_LEG_SCAN_H
#define SONDE_APP_LEG_SCAN_H

#include "options.h"

typedef struct leg_scan_files {
  const char *skin, *femur, *muscle, *labels, *names;
  int axes; // -1: not given
} leg_scan_files;

extern const char *const LEG_SCAN_AXES[];

// The options of the member `scan`; the names of files begin with `prefix`.
#define LEG_SCAN_OPTIONS(prefix, more)                                                             \
  OPT_TEXT(scan.skin, prefix "skin", "FILE", "skin of a leg, " more),                              \
      OPT_TEXT(scan.femur, prefix "femur", "FILE",                                                 \
               "whole femur in the same frame; without it the skin's upper end is the groin"),     \
      OPT_TEXT(scan.muscle, prefix "muscle", "FILE",                                               \
               "envelope of the muscles; without it fat comes from parameters"),                   \
      OPT_TEXT(scan.labels, prefix "labels", "FILE",                                               \
               "volume of labels (.nii, .nii.gz) instead of the surfaces"),                        \
      OPT_TEXT(                                                                                    \
          scan.names, "label-names", "FILE",                                                       \
          "a number and a name on each line, with one of the words background, tissue, skin, "     \
          "fat, muscle, femur, bone, vein, artery; default 1 skin, 2 fat, 3 muscle, 4 bone, "      \
          "5 vein, 6 artery"),                                                                     \
      OPT_WORD(scan.axes, "axes", "AXES", LEG_SCAN_AXES,                                           \
               "where x and y of the surfaces run: ras (right, front) or lps (left, back); z to "  \
               "the head; labels are ras")

// Says which options do not go together. @return APP_OK or APP_BAD_INPUT
int leg_scan_check(const char *verb, const char *prefix, const leg_scan_files *files);

// Reads the files. @param[out] part released by sonde_leg_labels_clear(), also after a failure
sonde_status leg_scan_load(const leg_scan_files *files, sonde_leg_labels *part, sonde_error *error);

// What has been read, as the library takes it.
sonde_leg_scan leg_scan_of(const leg_scan_files *files, const sonde_leg_labels *part, bool left);

static inline bool leg_scan_given(const leg_scan_files *files) {
  return files->skin || files->labels;
}

#endif
