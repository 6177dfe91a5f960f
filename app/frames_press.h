// Pressing a picture with the mechanical model.
#ifndef SONDE_APP_FRAMES_PRESS_H
#define SONDE_APP_FRAMES_PRESS_H

#include "frames_common.h"

typedef struct press_options {
  const char *model, *probe, *pathology;
  long site;
  double force_n, venous_pa, arterial_pa; // NaN: not asked for, as the next one
  double vein_mm[2];                      // where the vein is in the picture
} press_options;

// NOLINTBEGIN(bugprone-macro-parentheses): offsetof() takes no parentheses around a member
#define PRESS_OPTIONS(m)                                                                           \
  OPT_TEXT(                                                                                        \
      m.model, "press", "MODEL",                                                                   \
      "deform the picture as that thigh is deformed when its site is pressed; the top of the "     \
      "picture lies on the skin at rest"),                                                         \
      OPT_INTEGER(m.site, "site", "K", 0, 1000000, "with --press: number of the site"),            \
      OPT_REAL(m.force_n, "force-n", "F", 0.01, 200, 1, "with --press: settled force"),            \
      OPT_TEXT(m.probe, "probe", "NAME", "with --press: as of sonde-press(1)"),                    \
      OPT_TEXT(m.pathology, "case", "NAME", "with --press: as of sonde-press(1)"),                 \
      OPT_REAL(m.venous_pa, "venous-mmhg", "P", 0.1, 200, SONDE_PA_PER_MMHG,                       \
               "with --press: pressure in the vein; default of the case"),                         \
      OPT_REAL(m.arterial_pa, "arterial-mmhg", "P", 1, 300, SONDE_PA_PER_MMHG,                     \
               "with --press: pressure in the artery; default of the case"),                       \
      OPT_NUMBERS(                                                                                 \
          m.vein_mm, "vein-at", "X,Z", -INFINITY, INFINITY,                                        \
          "with --press: where the vein is in the picture, mm from the middle of its top; "        \
          "default where the model has it")
// NOLINTEND(bugprone-macro-parentheses)

typedef struct press_result {
  double force_n, depth_m, vein_area_ratio, artery_area_ratio; // NaN: not under the probe
} press_result;

// Presses the model until the force is reached and deforms the picture as the thigh.
sonde_status press_picture(const press_options *options, sonde_image *image, uint8_t *known,
                           press_result *result, sonde_error *error);

#endif
