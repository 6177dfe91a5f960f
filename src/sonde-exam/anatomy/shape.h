// Inside of the anatomy room: tubes as tables over angle and height, and what is built from them.
#ifndef SONDE_SRC_ANATOMY_SHAPE_H
#define SONDE_SRC_ANATOMY_SHAPE_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/anatomy.h"

#define SONDE_LEAST_MUSCLE_M 0.012 // between fat and femur

enum { SONDE_TUBE_ROWS = 121, SONDE_TUBE_COLUMNS = 180 };

// A closed surface around a middle line, cut flat at both ends: radius at equal angles about the
// middle and equal heights from 0 to length.
typedef struct sonde_tube {
  double length_m;
  double x_m[SONDE_TUBE_ROWS], y_m[SONDE_TUBE_ROWS]; // middle
  double radius_m[SONDE_TUBE_ROWS][SONDE_TUBE_COLUMNS];
} sonde_tube;

struct sonde_thigh_shape {
  sonde_tube skin, femur;
  double fat_m[SONDE_TUBE_ROWS][SONDE_TUBE_COLUMNS]; // thickness along the skin's normal
};

static inline double tube_angle(uint32_t column) {
  return 2 * SONDE_PI * column / SONDE_TUBE_COLUMNS;
}

// A table value at any angle and height, linear between its entries.
double sonde_tube_lookup(const sonde_tube *tube, double (*table)[SONDE_TUBE_COLUMNS], double angle,
                         double z_m);
double sonde_tube_radius(const sonde_tube *tube, double angle, double z_m);
sonde_vec3 sonde_tube_point(const sonde_tube *tube, double angle, double z_m);
// Outward unit normal, over a few entries of the table.
sonde_vec3 sonde_tube_normal(const sonde_tube *tube, double angle, double z_m);
// Angle of a point about the middle at its height, and how far outside the tube it lies.
double sonde_tube_angle_of(const sonde_tube *tube, sonde_vec3 point_m);
double sonde_tube_outside(const sonde_tube *tube, sonde_vec3 point_m);
double sonde_tube_girth(const sonde_tube *tube, double z_m);
// Closed, outward mesh with nearly equilateral faces of about that edge.
sonde_status sonde_tube_mesh(const sonde_tube *tube, double edge_m, sonde_mesh *mesh,
                             sonde_error *error);

// Fills the fat table from the four sides of the parameters.
void sonde_shape_fill_fat(const sonde_thigh *thigh, sonde_thigh_shape *shape);
// Places the parameters' femur beside the middles of the skin's sections, which a generated thigh
// has on a straight line from the medial side at the groin, by `swing`, to the femur at the knee.
void sonde_shape_place_femur(const sonde_thigh *thigh, sonde_thigh_shape *shape);
double sonde_shape_swing(const sonde_thigh *thigh);
double sonde_shape_fat(const sonde_thigh_shape *shape, sonde_vec3 point_m);
// Least muscle between fat and femur over the shape, and where.
double sonde_shape_least_muscle(const sonde_thigh_shape *shape, const sonde_thigh *thigh,
                                double *z_m);

// Checks every range of the parameters. @return ARGUMENT naming parameter and range
sonde_status sonde_thigh_check(const sonde_thigh *thigh, sonde_error *error);

// The vessels of a thigh as they are placed.
typedef struct sonde_course {
  sonde_vessel vein, artery;
  uint32_t branch_count;
  sonde_branch branch[SONDE_BRANCHES];
  double angle_rad[SONDE_VESSEL_POINTS]; // of the skin above the vein's points
  double skin_z_m[SONDE_VESSEL_POINTS];
} sonde_course;

// Places all vessels below `skin`, a mesh of the shape.
sonde_status sonde_course_place(const sonde_thigh *thigh, const sonde_thigh_shape *shape,
                                const sonde_mesh *skin, sonde_course *course, sonde_error *error);
// Share of the thigh's length at which named parts of the course begin.
double sonde_course_junction(void);
double sonde_course_confluence(const sonde_thigh *thigh);
// The vein's angle (of the skin above it) at a share of the length.
double sonde_course_angle(const sonde_thigh *thigh, double share);

#endif
