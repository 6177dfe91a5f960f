// A painted region of the skin: an outline from a CSV file, or a mesh cut out of the skin.
#include "base/csv.h"
#include "robot/sites_inside.h"

#include <string.h>
#include <strings.h>

static const double PATCH_TOLERANCE_M = 2e-3; // between the patch and the refined skin
static const double MARGIN_RAD = 0.02;

sonde_status sonde_region_load(const char *path, sonde_region *region, sonde_error *error) {
  *region = (sonde_region){0};
  const char *dot = strrchr(path, '.');
  bool outline = dot && !strcasecmp(dot, ".csv");
  if (outline) {
    static const char *const NAMES[3] = {"x_mm", "y_mm", "z_mm"};
    sonde_csv csv;
    uint32_t columns[3];
    sonde_status status = sonde_csv_open(&csv, path, error);
    if (!status) status = sonde_csv_require(&csv, NAMES, 3, columns, error);
    if (!status) {
      region->point_m = SONDE_NEW(sonde_vec3, sonde_csv_lines_left(&csv));
      if (!region->point_m) status = sonde_fail_memory(error);
    }
    bool found = !status;
    while (!status && found) {
      double mm[3];
      status = sonde_csv_next(&csv, &found, error);
      for (int k = 0; k < 3 && found && !status; ++k)
        status = sonde_csv_real(&csv, columns[k], &mm[k], error);
      if (found && !status)
        region->point_m[region->count++] = v_scale(vec3(mm[0], mm[1], mm[2]), 1e-3);
    }
    sonde_csv_close(&csv);
    if (!status && region->count < 3)
      status = sonde_fail(error, SONDE_FORMAT, "%s: %u corners, expected at least 3", path,
                          region->count);
    if (status) sonde_region_clear(region);
    return status;
  }
  sonde_mesh mesh = {0};
  sonde_status status = sonde_mesh_load(path, 1e-3, &mesh, error);
  if (!status) status = sonde_surface_index_create(&mesh, &region->patch, error);
  if (!status) {
    region->count = mesh.vertex_count;
    region->point_m = mesh.vertices;
    mesh.vertices = NULL;
    mesh.vertex_count = 0;
  }
  sonde_mesh_clear(&mesh);
  if (status) sonde_region_clear(region);
  return status;
}

void sonde_region_clear(sonde_region *region) {
  sonde_surface_index_destroy(region->patch);
  sonde_free(region->point_m);
  *region = (sonde_region){0};
}

// In [start, start + 2 pi).
static double angle_of(sonde_vec3 point, sonde_vec3 origin, double start_rad) {
  double turn = (atan2(point.y - origin.y, point.x - origin.x) - start_rad) / (2 * SONDE_PI);
  return start_rad + 2 * SONDE_PI * (turn - floor(turn));
}

sonde_chart_bounds sonde_region_bounds(const sonde_region *region, sonde_vec3 origin_m) {
  SONDE_ASSERT(region->count > 0);
  double x = 0, y = 0;
  for (uint32_t k = 0; k < region->count; ++k) {
    double angle = angle_of(region->point_m[k], origin_m, 0);
    x += cos(angle);
    y += sin(angle);
  }
  double start = atan2(y, x) - SONDE_PI; // the seam is opposite the region
  sonde_chart_bounds b = {INFINITY, -INFINITY, INFINITY, -INFINITY};
  for (uint32_t k = 0; k < region->count; ++k) {
    double angle = angle_of(region->point_m[k], origin_m, start);
    b.angle_low_rad = fmin(b.angle_low_rad, angle);
    b.angle_high_rad = fmax(b.angle_high_rad, angle);
    b.z_low_m = fmin(b.z_low_m, region->point_m[k].z);
    b.z_high_m = fmax(b.z_high_m, region->point_m[k].z);
  }
  b.angle_low_rad = fmax(b.angle_low_rad - MARGIN_RAD, start);
  b.angle_high_rad = fmin(b.angle_high_rad + MARGIN_RAD, start + 2 * SONDE_PI);
  return b;
}

bool sonde_region_holds(const sonde_region *region, const sonde_chart *chart, sonde_vec3 point_m) {
  SONDE_ASSERT(region->count > 0);
  if (region->patch)
    return sonde_surface_closest(region->patch, point_m).distance_m <= PATCH_TOLERANCE_M;
  // Crossings of the outline with the ray of growing angle from the point: odd inside.
  double start = chart->bounds.angle_low_rad, angle = angle_of(point_m, chart->origin_m, start);
  bool inside = false;
  for (uint32_t k = 0; k < region->count; ++k) {
    sonde_vec3 a = region->point_m[k], b = region->point_m[(k + 1) % region->count];
    if ((a.z > point_m.z) == (b.z > point_m.z)) continue;
    double from = angle_of(a, chart->origin_m, start), to = angle_of(b, chart->origin_m, start);
    inside ^= angle < from + (to - from) * (point_m.z - a.z) / (b.z - a.z);
  }
  return inside;
}
