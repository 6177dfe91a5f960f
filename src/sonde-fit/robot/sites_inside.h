// Shared by the parts of the site sampler: the unrolled skin and the painted region.
#ifndef SONDE_SRC_ROBOT_SITES_INSIDE_H
#define SONDE_SRC_ROBOT_SITES_INSIDE_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/robot.h"

// The leg's axis is parallel to z and passes through the origin's x and y.
typedef struct sonde_chart_bounds {
  double angle_low_rad, angle_high_rad; // high - low in (0, 2 pi]
  double z_low_m, z_high_m;
} sonde_chart_bounds;

// A part of the skin unrolled: s runs around the leg from the middle column, t along the middle
// column from the lowest row. Both are lengths on the skin.
typedef struct sonde_chart {
  sonde_surface_index *index;
  sonde_vec3 origin_m;
  sonde_chart_bounds bounds;
  uint32_t columns, rows; // of the grid below, >= 3
  sonde_vec3 *point_m;    // [rows * columns] on the skin
  double *around_m;       // [rows * columns] s
  double *along_m;        // [rows] t
} sonde_chart;

sonde_status sonde_chart_create(const sonde_model *model, const sonde_chart_bounds *bounds,
                                sonde_chart *chart, sonde_error *error);
void sonde_chart_clear(sonde_chart *chart);
// Origin of the axis: the centroid of the closed skin.
sonde_status sonde_chart_origin(const sonde_model *model, sonde_vec3 *origin_m, sonde_error *error);
// Grid row (a real number in [0, rows - 1]) at a t; t is clamped.
double sonde_chart_row(const sonde_chart *chart, double along_m);
// s of a grid column on a grid row.
double sonde_chart_around(const sonde_chart *chart, double row, uint32_t column);
// Grid column (a real number) at an s of a grid row; s is clamped.
double sonde_chart_column(const sonde_chart *chart, double row, double around_m);
// The skin there: a ray from the axis.
bool sonde_chart_hit(const sonde_chart *chart, double row, double column, sonde_surface_point *hit);

// Region of the skin that a file describes.
typedef struct sonde_region {
  sonde_surface_index *patch; // of a mesh; NULL for an outline
  uint32_t count;             // points of the patch or corners of the outline
  sonde_vec3 *point_m;
} sonde_region;

sonde_status sonde_region_load(const char *path, sonde_region *region, sonde_error *error);
void sonde_region_clear(sonde_region *region);
// The part of the chart that holds the region, and a little more.
sonde_chart_bounds sonde_region_bounds(const sonde_region *region, sonde_vec3 origin_m);
// Whether a point of the skin belongs to the region; angles are taken within the chart's bounds.
bool sonde_region_holds(const sonde_region *region, const sonde_chart *chart, sonde_vec3 point_m);

#endif
