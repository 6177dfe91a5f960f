// Pressing a picture with the mechanical model.
#ifndef SONDE_APP_FRAMES_PRESS_H
#define SONDE_APP_FRAMES_PRESS_H

#include "frames_common.h"

typedef struct press_options {
  const char *model, *site, *force, *probe, *pathology, *venous, *arterial, *vein_at;
} press_options;

#define PRESS_OPTION_LIST(o)                                                                       \
  {"--press", &(o).model, NULL}, {"--site", &(o).site, NULL}, {"--force-n", &(o).force, NULL},     \
      {"--probe", &(o).probe, NULL}, {"--case", &(o).pathology, NULL},                             \
      {"--venous-mmhg", &(o).venous, NULL}, {"--arterial-mmhg", &(o).arterial, NULL}, {            \
    "--vein-at", &(o).vein_at, NULL                                                                \
  }

typedef struct press_result {
  double force_n, depth_m, vein_area_ratio, artery_area_ratio; // NaN: not under the probe
} press_result;

// True when the options fit together; prints what does not.
bool press_check(const char *verb, const press_options *options);
// Presses the model until the force is reached and deforms the picture as the thigh.
sonde_status press_picture(const char *verb, const press_options *options, sonde_image *image,
                           uint8_t *known, press_result *result, sonde_error *error);

#endif
