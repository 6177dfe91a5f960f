// Coordinates on a region of the skin: a grid of points, cast from the axis of the leg, with the
// distance around the leg from the middle column and along it from the first row.
#include "robot/sites_inside.h"

static const double CELL_RAD = SONDE_PI / 180, CELL_M = 2e-3; // at most
static const double REACH_M = 1.0;
static const double ASIDE_RAD = 1e-6, ASIDE_M = 1e-7;

sonde_status sonde_chart_origin(const sonde_model *model, sonde_vec3 *origin_m,
                                sonde_error *error) {
  sonde_mass mass;
  sonde_status status = sonde_mesh_mass(&model->surface, 1, &mass, error);
  *origin_m = status ? vec3(0, 0, 0) : mass.centre_m;
  return status;
}

static double angle_at(const sonde_chart *chart, double column) {
  const sonde_chart_bounds *b = &chart->bounds;
  return b->angle_low_rad + (b->angle_high_rad - b->angle_low_rad) * column / (chart->columns - 1);
}

static double height_at(const sonde_chart *chart, double row) {
  const sonde_chart_bounds *b = &chart->bounds;
  return b->z_low_m + (b->z_high_m - b->z_low_m) * row / (chart->rows - 1);
}

// The skin on a ray from the axis outwards, moved a little when it slips between two faces.
bool sonde_chart_hit(const sonde_chart *chart, double row, double column,
                     sonde_surface_point *hit) {
  static const double ASIDE[][2] = {{0, 0}, {1, 1.7}, {-1.3, 1}, {0.9, -1.1}, {-1, -1.9}};
  double angle_rad = angle_at(chart, column), z_m = height_at(chart, row);
  for (size_t k = 0; k < SONDE_COUNT_OF(ASIDE); ++k) {
    double angle = angle_rad + ASIDE_RAD * ASIDE[k][0];
    sonde_vec3 from = vec3(chart->origin_m.x, chart->origin_m.y, z_m + ASIDE_M * ASIDE[k][1]);
    sonde_vec3 out = vec3(cos(angle), sin(angle), 0);
    if (sonde_surface_raycast(chart->index, from, out, REACH_M, hit)) return true;
  }
  return false;
}

// An odd number of grid lines, so that the middle one halves the width.
static uint32_t lines(double width, double cell) {
  SONDE_ASSERT(width > 0 && cell > 0);
  return 2 * (uint32_t)ceil(width / (2 * cell)) + 1;
}

sonde_status sonde_chart_create(const sonde_model *model, const sonde_chart_bounds *bounds,
                                sonde_chart *chart, sonde_error *error) {
  *chart = (sonde_chart){.bounds = *bounds};
  double turn = bounds->angle_high_rad - bounds->angle_low_rad,
         length = bounds->z_high_m - bounds->z_low_m;
  if (!(turn > 0 && turn <= 2 * SONDE_PI * (1 + 1e-12) && fabs(bounds->angle_low_rad) <= 100))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "angles from %g to %g degrees, expected a rising pair at most 360 apart",
                      bounds->angle_low_rad * 180 / SONDE_PI,
                      bounds->angle_high_rad * 180 / SONDE_PI);
  if (!(length > 0 && length <= 2 && fabs(bounds->z_low_m) <= 100))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "heights from %g to %g mm, expected a rising pair at most 2000 apart",
                      bounds->z_low_m * 1e3, bounds->z_high_m * 1e3);
  sonde_status status = sonde_chart_origin(model, &chart->origin_m, error);
  if (!status) status = sonde_surface_index_create(&model->surface, &chart->index, error);
  if (status) return status;
  chart->columns = lines(bounds->angle_high_rad - bounds->angle_low_rad, CELL_RAD);
  chart->rows = lines(bounds->z_high_m - bounds->z_low_m, CELL_M);
  size_t points = (size_t)chart->columns * chart->rows;
  chart->point_m = SONDE_NEW(sonde_vec3, points);
  chart->around_m = SONDE_NEW(double, points);
  chart->along_m = SONDE_NEW(double, chart->rows);
  if (!chart->point_m || !chart->around_m || !chart->along_m) status = sonde_fail_memory(error);
  // The points of the grid, then their distances.
  uint32_t middle = chart->columns / 2;
  for (uint32_t j = 0; j < chart->rows && !status; ++j) {
    sonde_vec3 *p = &chart->point_m[(size_t)j * chart->columns];
    double *around_m = &chart->around_m[(size_t)j * chart->columns];
    for (uint32_t i = 0; i < chart->columns && !status; ++i) {
      sonde_surface_point hit;
      if (sonde_chart_hit(chart, j, i, &hit))
        p[i] = hit.point_m;
      else
        status = sonde_fail(error, SONDE_MISMATCH,
                            "no skin at %.1f degrees around the axis and z = %.1f mm, expected a "
                            "region on the skin, which the axis does not leave",
                            angle_at(chart, i) * 180 / SONDE_PI, height_at(chart, j) * 1e3);
    }
    if (status) break;
    // Around the leg: from the middle column to both sides.
    for (uint32_t i = middle + 1; i < chart->columns; ++i)
      around_m[i] = around_m[i - 1] + v_distance(p[i], p[i - 1]);
    for (uint32_t i = middle; i-- > 0;) around_m[i] = around_m[i + 1] - v_distance(p[i], p[i + 1]);
    // Along the leg: down the middle column.
    if (j > 0)
      chart->along_m[j] =
          chart->along_m[j - 1] + v_distance(p[middle], (p - chart->columns)[middle]);
  }
  if (status) sonde_chart_clear(chart);
  return status;
}

void sonde_chart_clear(sonde_chart *chart) {
  sonde_surface_index_destroy(chart->index);
  sonde_free(chart->point_m);
  sonde_free(chart->around_m);
  sonde_free(chart->along_m);
  *chart = (sonde_chart){0};
}

double sonde_chart_row(const sonde_chart *chart, double along_m) {
  uint32_t j = 0;
  while (j + 2 < chart->rows && chart->along_m[j + 1] <= along_m) ++j;
  double step = chart->along_m[j + 1] - chart->along_m[j];
  SONDE_ASSERT(step > 0);
  return j + clamp((along_m - chart->along_m[j]) / step, 0, 1);
}

double sonde_chart_around(const sonde_chart *chart, double row, uint32_t column) {
  SONDE_ASSERT(row >= 0 && row <= chart->rows - 1 && column < chart->columns);
  uint32_t j = (uint32_t)fmin(row, chart->rows - 2);
  const double *s = &chart->around_m[(size_t)j * chart->columns + column];
  return s[0] + (row - j) * (s[chart->columns] - s[0]);
}

double sonde_chart_column(const sonde_chart *chart, double row, double around_m) {
  uint32_t low = 0, high = chart->columns - 1;
  while (high - low > 1) {
    uint32_t middle = (low + high) / 2;
    if (sonde_chart_around(chart, row, middle) <= around_m)
      low = middle;
    else
      high = middle;
  }
  double from = sonde_chart_around(chart, row, low), to = sonde_chart_around(chart, row, high);
  SONDE_ASSERT(to > from);
  return low + clamp((around_m - from) / (to - from), 0, 1);
}
