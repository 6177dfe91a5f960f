// Lines of sight: parallel ones of a flat face, which may lean, or the fan of a curved face, each
// line along the face's normal where it starts. A line is known by where it leaves the face, along
// the face from its middle; coordinates are the probe's, x across and z into the body.
#ifndef SONDE_SRC_ECHO_LINES_H
#define SONDE_SRC_ECHO_LINES_H

#include "base/maths.h"
#include "sonde/echo_scanner.h"

typedef struct sight_lines {
  double radius_m;  // of a curved face, 0: flat
  double steer_rad; // lean of a flat face's lines towards +x
} sight_lines;

// The place on the line that leaves the face at `along_m`; depth from the face, of a curved face
// along the line, else along z.
static inline sonde_vec3 sight_place(sight_lines l, double along_m, double depth_m) {
  if (!(l.radius_m > 0)) return vec3(along_m + depth_m * tan(l.steer_rad), 0, depth_m);
  const double r = l.radius_m + depth_m, angle = along_m / l.radius_m;
  return vec3(r * sin(angle), 0, r * cos(angle) - l.radius_m);
}

// The line and the depth of a place: x along the face, z depth, y as it was.
static inline sonde_vec3 sight_find(sight_lines l, sonde_vec3 place) {
  if (!(l.radius_m > 0)) return vec3(place.x - place.z * tan(l.steer_rad), place.y, place.z);
  const double from = place.z + l.radius_m, angle = atan2(place.x, from);
  return vec3(angle * l.radius_m, place.y, sqrt(place.x * place.x + from * from) - l.radius_m);
}

// The way of the sound on a line, into the body; unit.
static inline sonde_vec3 sight_beam(sight_lines l, double along_m) {
  const double angle = l.radius_m > 0 ? along_m / l.radius_m : l.steer_rad;
  return vec3(sin(angle), 0, cos(angle));
}

// z of the upper edge of a picture: the outer lines of a curved face start above its middle.
static inline double sight_top(double radius_m, double aperture_m) {
  return radius_m > 0 ? radius_m * (cos(0.5 * aperture_m / radius_m) - 1) : 0;
}

// Width of the lines of a scanner on a probe whose face is so wide.
static inline double sight_aperture(const sonde_scanner *scanner, double half_x_m) {
  return scanner && scanner->aperture_m > 0 ? scanner->aperture_m : 2 * half_x_m;
}

#endif
