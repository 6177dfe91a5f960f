// Options of `sonde image` about what a case adds to a thigh.
#ifndef SONDE_APP_IMAGE_FINDINGS_H
#define SONDE_APP_IMAGE_FINDINGS_H

#include "sonde/sonde.h"

#include <stdbool.h>

// Where a lesion is asked for: in the image plane before the probe presses.
typedef struct image_lesion {
  sonde_lesion_kind kind;
  double x_m, depth_m, width_m, height_m;
} image_lesion;

typedef struct image_findings {
  uint32_t lesion_count;
  image_lesion lesion[SONDE_LESIONS];
  sonde_findings rest; // branches, webs, oedema
} image_findings;

// KIND:X:DEPTH:WIDTH:HEIGHT in mm. @return false after a message
bool image_findings_lesion(image_findings *f, const char *text);
// BRANCH:CASE. @return false after a message
bool image_findings_clot(image_findings *f, const char *text);
// Places the lesions below a probe at rest and hands everything to the interior.
sonde_status image_findings_apply(const image_findings *f, sonde_pose at_rest,
                                  sonde_interior *interior, sonde_error *error);

#endif
