// What a pixel of a picture shows.
#ifndef SONDE_SRC_ECHO_TRUTH_H
#define SONDE_SRC_ECHO_TRUTH_H

#include "base/link.h"
#include "sonde/echo.h"

typedef struct sonde_truth_pixel {
  sonde_label label;
  uint32_t vessel;         // 1 + number of the vessel whose wall, lumen or clot it is, else 0
  sonde_vec3 point_m;      // world: where the tissue is
  sonde_vec3 rest_m;       // and where it is at rest
  sonde_vec3 velocity_m_s; // world: of flowing blood, else 0
} sonde_truth_pixel;

// A pixel of the last picture; false beside its lines. @thread of the renderer, not during an
// update of the interior
SONDE_LINK bool sonde_truth_at(const sonde_echo *echo, const sonde_image *image, uint32_t column,
                               uint32_t row, sonde_truth_pixel *pixel);
// Where the last picture draws a point of the world, in the probe frame. @thread of the renderer
SONDE_LINK sonde_vec3 sonde_truth_drawn_at(const sonde_echo *echo, sonde_vec3 point_m);
// The pose of the last picture. @thread of the renderer
SONDE_LINK sonde_pose sonde_truth_pose(const sonde_echo *echo);
// What its lines span.
typedef struct sonde_truth_view {
  double radius_m;            // of a curved face, 0: flat
  double aperture_m, depth_m; // from the first line to the last along the face; from the face
} sonde_truth_view;
SONDE_LINK sonde_truth_view sonde_truth_view_of(const sonde_echo *echo); // @thread of the renderer

#endif
