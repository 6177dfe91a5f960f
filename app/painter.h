// Faces, lines and balls in space, painted from back to front into an SVG drawing.
#ifndef SONDE_APP_PAINTER_H
#define SONDE_APP_PAINTER_H

#include "sonde/sonde.h"

// A view: lengths in m, the drawing in pixels with y downwards.
typedef struct painter_camera {
  sonde_vec3 right, up, toward; // unit vectors; toward the viewer
  sonde_vec3 centre_m;          // drawn at (left, top)
  double distance_m;            // of the eye from the centre; INFINITY: a parallel projection
  double scale;                 // pixels per metre at the centre's depth
  double left, top;
} painter_camera;

// A box of pixels.
typedef struct painter_box {
  double left, top, width, height;
} painter_box;

// Axes of a view against `toward`, with `up` upwards as far as it can be.
painter_camera painter_look(sonde_vec3 toward, sonde_vec3 up, sonde_vec3 centre_m,
                            double distance_m);
// Pixels of a point; returns its depth towards the viewer, m.
double painter_project(const painter_camera *camera, sonde_vec3 point_m, double xy[2]);
// Sets scale, left and top such that all points lie in the box, in its middle.
void painter_fit(painter_camera *camera, const sonde_vec3 *points_m, uint32_t count,
                 painter_box box);

typedef struct painter painter;
sonde_status painter_create(const painter_camera *camera, painter **made, sonde_error *error);
void painter_destroy(painter *p);
// A face of one colour, cut into small pieces that are ordered each by itself.
void painter_face(painter *p, const sonde_vec3 corner_m[3], uint32_t rgb, double opacity);
// Whether a face is turned to the viewer: its corners run counter-clockwise.
bool painter_sees(const painter *p, const sonde_vec3 corner_m[3]);
// Paints a face that is turned to the viewer, lit from above the viewer's left shoulder.
void painter_lit_face(painter *p, const sonde_vec3 corner_m[3], uint32_t rgb, double opacity);
// A line, ordered as if it lay `nearer_m` towards the viewer.
void painter_line(painter *p, sonde_vec3 from_m, sonde_vec3 to_m, uint32_t rgb, double width_px,
                  double nearer_m);
void painter_ball(painter *p, sonde_vec3 centre_m, double radius_px, uint32_t rgb, double nearer_m);
// Paints what was given into the drawing and forgets it.
// @return MEMORY when a piece was left out for want of it
sonde_status painter_paint(painter *p, sonde_file *drawing, sonde_error *error);

#endif
