// Inside of the anatomy room: where a scanned leg lies and how its surfaces are met.
#ifndef SONDE_SRC_ANATOMY_SCAN_H
#define SONDE_SRC_ANATOMY_SCAN_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/anatomy.h"

// A frame of the leg in the scan, x medial, y front, z down: a point p of it lies at
// origin + p.x x + p.y y + p.z z.
typedef struct scan_frame {
  sonde_vec3 origin, x, y, z;
  double low, high; // extent of a bone or skin along z, from the origin
} scan_frame;

static inline sonde_vec3 scan_point(const scan_frame *f, sonde_vec3 p) {
  return v_madd(v_madd(v_madd(f->origin, p.x, f->x), p.y, f->y), p.z, f->z);
}
static inline sonde_vec3 scan_local(const scan_frame *f, sonde_vec3 p) {
  sonde_vec3 d = v_sub(p, f->origin);
  return vec3(v_dot(d, f->x), v_dot(d, f->y), v_dot(d, f->z));
}

// The part of a direction that is perpendicular to a unit axis.
static inline sonde_vec3 scan_across(sonde_vec3 direction, sonde_vec3 axis) {
  return v_madd(direction, -v_dot(direction, axis), axis);
}

// Finds the extent of a mesh along z.
void scan_extent(const sonde_mesh *mesh, scan_frame *f);
// Finds the mean of a surface between two heights, by area, in the scan; false: there is none.
bool scan_slab_centre(const sonde_mesh *mesh, const scan_frame *f, double low, double high,
                      sonde_vec3 *centre);
// The medial, front and lower side of the leg in the scan, whose axes are known.
void scan_patient_axes(const sonde_leg_scan *scan, sonde_vec3 *medial, sonde_vec3 *front,
                       sonde_vec3 *down);
// Finds the frame along the femur's shaft and refuses what is no whole femur of that side.
sonde_status scan_femur_frame(const sonde_leg_scan *scan, scan_frame *f, sonde_error *error);
// Measures from a point of the frame along a direction to the first surface, m; NaN: there is none
// within reach.
double scan_cast(const sonde_surface_index *index, const scan_frame *f, sonde_vec3 from,
                 sonde_vec3 direction, double reach);
// Measures a section of the skin across z by rays from `middle`, which moves to its centroid;
// false: a ray met nothing, so that the girth lacks a piece.
bool scan_section(const sonde_surface_index *skin, const scan_frame *f, sonde_vec3 *middle,
                  double *girth_m);

#endif
