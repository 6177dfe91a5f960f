// Smooth fields over the image plane, in line and depth.
#ifndef SONDE_SRC_ECHO_PLANE_H
#define SONDE_SRC_ECHO_PLANE_H

typedef enum plane_field {
  PLANE_THETA, // radians, unwrapped around the picture's centre
  PLANE_S,
  PLANE_DEPTH,
  PLANE_FAT,
  PLANE_MUSCLE,
  PLANE_R,
  PLANE_VEIN_SHORT, // coordinates in the vessel's deformed cross-section over its semi-axes
  PLANE_VEIN_LONG,
  PLANE_ARTERY_SHORT,
  PLANE_ARTERY_LONG,
  PLANE_VEIN_HALF_SHORT, // semi-axes, m
  PLANE_VEIN_HALF_LONG,
  PLANE_ARTERY_HALF_SHORT,
  PLANE_ARTERY_HALF_LONG,
  PLANE_CLOT, // 1 where a thrombus lies
  PLANE_FIELDS
} plane_field;

#endif
