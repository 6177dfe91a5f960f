// Sites on the skin: rows and columns over a chart, or a square lattice with the wanted number of
// points in a painted region.
#include "robot/sites_inside.h"

enum { MOST_SITES = 10000, OFFSETS = 6, PITCHES = 150 };
static const double PITCH_STEP = 0.004;      // of the expected pitch, between two trials
static const double SKIN_TOLERANCE_M = 5e-3; // between a painted region and the skin

sonde_sites_def sonde_sites_def_default(void) {
  return (sonde_sites_def){.columns = 8, .rows = 8, .smoothing_m = 5e-3};
}

// ---- one site -----------------------------------------------------------------------------

typedef struct sampler {
  const sonde_model *model;
  const sonde_sites_def *def;
  sonde_chart chart;
  sonde_region region;
  bool *inside; // [chart.rows * chart.columns] of a painted region
  sonde_site_table *table;
} sampler;

static sonde_status put_site(sampler *s, double row, double column, sonde_error *error) {
  sonde_site_table *table = s->table;
  sonde_surface_point at;
  if (!sonde_chart_hit(&s->chart, row, column, &at))
    return sonde_fail(error, SONDE_MISMATCH, "no skin at site %u", table->count);
  // Gaussian mean over the faces that look the same way.
  const sonde_mesh *skin = &s->model->surface;
  const uint32_t *near = skin->faces[at.face];
  sonde_vec3 own = vec3(0, 0, 0), sum;
  for (int k = 0; k < 3; ++k) own = v_madd(own, at.weight[k], s->model->normal[near[k]]);
  sum = v_scale(own, 1e-12);
  for (uint32_t f = 0; f < skin->face_count && s->def->smoothing_m > 0; ++f) {
    const uint32_t *v = skin->faces[f];
    sonde_vec3 a = skin->vertices[v[0]], b = skin->vertices[v[1]], c = skin->vertices[v[2]];
    double away =
        v_distance(v_scale(v_add(a, v_add(b, c)), 1.0 / 3), at.point_m) / s->def->smoothing_m;
    sonde_vec3 cross = v_cross(v_sub(b, a), v_sub(c, a));
    if (away < 4 && v_dot(cross, own) > 0) sum = v_madd(sum, exp(-0.5 * away * away), cross);
  }
  SONDE_ASSERT(v_finite(sum));
  sonde_vec3 axis = vec3(0, 0, 1), n = v_unit(sum, own);
  sonde_vec3 u = v_unit(v_cross(axis, n), vec3(1, 0, 0));
  table->sites[table->count] = (sonde_site){
      .id = table->count, .position_m = at.point_m, .normal = n, .u = u, .v = v_cross(n, u)};
  // Fat of the model below it.
  const uint32_t *v = s->model->surface.faces[at.face];
  double fat_m = 0;
  for (int k = 0; k < 3; ++k)
    fat_m += at.weight[k] * (s->model->muscle_depth_m[v[k]] - s->model->fat_depth_m[v[k]]);
  table->fat_depth_m[table->count++] = fat_m;
  return SONDE_OK;
}

// ---- bounds -------------------------------------------------------------------------------

static double share(uint32_t k, uint32_t count) {
  return count > 1 ? (double)k / (count - 1) : 0.5;
}

// ---- painted ------------------------------------------------------------------------------

// A square lattice of the unrolled region: points at ((i + offset_s) pitch, (j + offset_t) pitch).
typedef struct lattice {
  double pitch_m, offset_s, offset_t;
} lattice;

typedef struct extent {
  double area_m2, s_m, t_m; // of the region; its centre
  double low_m, high_m;     // range of s
} extent;

// Calls put_site for the lattice points inside the region, or only counts them and sums how far
// their middle is from the region's.
static sonde_status walk_lattice(sampler *s, const extent *e, lattice l, bool put, uint32_t *count,
                                 double *eccentricity_m, sonde_error *error) {
  const sonde_chart *c = &s->chart;
  double sum_s = 0, sum_t = 0, top = c->along_m[c->rows - 1];
  *count = 0;
  for (double t = l.offset_t * l.pitch_m; t <= top; t += l.pitch_m) {
    double row = sonde_chart_row(c, t);
    double low = sonde_chart_around(c, row, 0), high = sonde_chart_around(c, row, c->columns - 1);
    double first = (ceil(e->low_m / l.pitch_m) - 1 + l.offset_s) * l.pitch_m;
    for (double around = first; around <= high; around += l.pitch_m) {
      if (around < low) continue;
      double column = sonde_chart_column(c, row, around);
      if (!s->inside[(size_t)lround(row) * c->columns + (size_t)lround(column)]) continue;
      ++*count;
      sum_s += around - e->s_m;
      sum_t += t - e->t_m;
      sonde_status status = put ? put_site(s, row, column, error) : SONDE_OK;
      if (status) return status;
    }
  }
  *eccentricity_m = *count ? hypot(sum_s, sum_t) / *count : INFINITY;
  return SONDE_OK;
}

static sonde_status place_painted(sampler *s, sonde_error *error) {
  s->inside = SONDE_NEW(bool, (size_t)s->chart.rows * s->chart.columns);
  if (!s->inside) return sonde_fail_memory(error);
  // The region's grid points, area and centre in the chart.
  const sonde_chart *c = &s->chart;
  extent e = {.low_m = INFINITY, .high_m = -INFINITY};
  for (uint32_t j = 0; j < c->rows; ++j)
    for (uint32_t i = 0; i < c->columns; ++i) {
      size_t at = (size_t)j * c->columns + i;
      double around_m = c->around_m[at];
      s->inside[at] = sonde_region_holds(&s->region, c, c->point_m[at]);
      e.low_m = fmin(e.low_m, around_m);
      e.high_m = fmax(e.high_m, around_m);
      if (!s->inside[at] || i + 1 == c->columns || j + 1 == c->rows) continue;
      double cell = (c->around_m[at + 1] - around_m) * (c->along_m[j + 1] - c->along_m[j]);
      e.area_m2 += cell;
      e.s_m += cell * around_m;
      e.t_m += cell * c->along_m[j];
    }
  e.s_m /= fmax(e.area_m2, 1e-30);
  e.t_m /= fmax(e.area_m2, 1e-30);
  for (uint32_t k = 0; k < s->region.count; ++k) {
    double away_m = sonde_surface_closest(c->index, s->region.point_m[k]).distance_m;
    if (!(away_m <= SKIN_TOLERANCE_M))
      return sonde_fail(error, SONDE_MISMATCH,
                        "%s: point %u lies %.1f mm from the skin, expected at most %.1f mm",
                        s->def->painted, k, away_m * 1e3, SKIN_TOLERANCE_M * 1e3);
  }
  if (!(e.area_m2 > 0))
    return sonde_fail(error, SONDE_MISMATCH, "%s holds no skin, expected a region of it",
                      s->def->painted);
  // Pitches near that of one point per cell of equal area, in growing distance from it; of the
  // first that has a lattice of the wanted count, the lattice whose middle is nearest to the
  // region's.
  uint32_t wanted = s->def->columns * s->def->rows, nearest_count = 0, count;
  lattice found = {0};
  double expected_m = sqrt(e.area_m2 / wanted), least_m = INFINITY, eccentricity_m;
  SONDE_ASSERT(expected_m > 0);
  for (int k = 0; k < 2 * PITCHES && !(least_m < INFINITY); ++k) {
    double change = PITCH_STEP * (k % 2 ? -(k + 1) / 2 : k / 2);
    lattice l = {.pitch_m = expected_m * (1 + change)};
    for (int i = 0; i < OFFSETS * OFFSETS; ++i) {
      l.offset_s = (double)(i % OFFSETS) / OFFSETS;
      l.offset_t = (double)i / OFFSETS / OFFSETS;
      walk_lattice(s, &e, l, false, &count, &eccentricity_m, NULL);
      uint32_t miss = count > wanted ? count - wanted : wanted - count;
      uint32_t before = nearest_count > wanted ? nearest_count - wanted : wanted - nearest_count;
      if (miss < before) nearest_count = count;
      if (miss || eccentricity_m >= least_m) continue;
      least_m = eccentricity_m;
      found = l;
    }
  }
  if (!(least_m < INFINITY))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "no square lattice has %u points inside %s, expected a number such as %u",
                      wanted, s->def->painted, nearest_count);
  return walk_lattice(s, &e, found, true, &count, &eccentricity_m, error);
}

// ---- table --------------------------------------------------------------------------------

sonde_status sonde_sites_place(const sonde_model *model, const sonde_sites_def *def,
                               sonde_site_table *table, sonde_error *error) {
  *table = (sonde_site_table){0};
  if (def->columns < 1 || def->rows < 1 || (uint64_t)def->columns * def->rows > MOST_SITES)
    return sonde_fail(error, SONDE_ARGUMENT, "%u x %u sites, expected 1 to %d", def->columns,
                      def->rows, MOST_SITES);
  if (!(def->smoothing_m >= 0 && def->smoothing_m <= 0.1))
    return sonde_fail(error, SONDE_ARGUMENT, "smoothing_m is %g, expected 0 to 0.1",
                      def->smoothing_m);
  sonde_chart_bounds bounds = {def->angle_low_rad, def->angle_high_rad, def->z_low_m,
                               def->z_high_m};
  sampler s = {.model = model, .def = def, .table = table};
  sonde_status status = SONDE_OK;
  table->sites = SONDE_NEW(sonde_site, (size_t)def->columns * def->rows);
  table->fat_depth_m = SONDE_NEW(double, (size_t)def->columns * def->rows);
  if (!table->sites || !table->fat_depth_m) status = sonde_fail_memory(error);
  if (!status && def->painted) {
    sonde_vec3 origin_m;
    status = sonde_region_load(def->painted, &s.region, error);
    if (!status) status = sonde_chart_origin(model, &origin_m, error);
    if (!status) bounds = sonde_region_bounds(&s.region, origin_m);
  }
  if (!status) status = sonde_chart_create(model, &bounds, &s.chart, error);
  if (!status && def->painted) status = place_painted(&s, error);
  // Without a painted region: rows and columns of equal spacing between the bounds.
  const sonde_chart *chart = &s.chart;
  for (uint32_t j = 0; j < def->rows && !def->painted && !status; ++j) {
    double row = sonde_chart_row(chart, share(j, def->rows) * chart->along_m[chart->rows - 1]);
    double first = sonde_chart_around(chart, row, 0);
    double last = sonde_chart_around(chart, row, chart->columns - 1);
    for (uint32_t i = 0; i < def->columns && !status; ++i) {
      double around_m = first + share(i, def->columns) * (last - first);
      status = put_site(&s, row, sonde_chart_column(chart, row, around_m), error);
    }
  }
  SONDE_ASSERT(status || table->count == def->columns * def->rows);
  // A model without measured layers has one thickness everywhere (except close to the bone).
  double least_m = INFINITY, most_m = -INFINITY;
  for (uint32_t i = 0; i < table->count; ++i) {
    least_m = fmin(least_m, table->fat_depth_m[i]);
    most_m = fmax(most_m, table->fat_depth_m[i]);
  }
  for (uint32_t i = 0; i < table->count && !(most_m - least_m > 1e-9); ++i)
    table->fat_depth_m[i] = NAN;
  sonde_region_clear(&s.region);
  sonde_chart_clear(&s.chart);
  sonde_free(s.inside);
  if (status) sonde_site_table_clear(table);
  return status;
}

sonde_site_spacing sonde_site_spacing_of(const sonde_site_table *table) {
  sonde_site_spacing spacing = {0};
  double sum = 0, squares = 0;
  uint32_t n = table->count;
  if (n < 2) return spacing;
  spacing.least_m = INFINITY;
  for (uint32_t i = 0; i < n; ++i) {
    double nearest = INFINITY;
    for (uint32_t j = 0; j < n; ++j)
      if (j != i)
        nearest = fmin(nearest, v_distance(table->sites[i].position_m, table->sites[j].position_m));
    sum += nearest;
    squares += nearest * nearest;
    spacing.least_m = fmin(spacing.least_m, nearest);
    spacing.largest_m = fmax(spacing.largest_m, nearest);
  }
  spacing.mean_m = sum / n;
  SONDE_ASSERT(isfinite(spacing.mean_m));
  if (sum > 0)
    spacing.cv = sqrt(fmax(0, squares / n - spacing.mean_m * spacing.mean_m)) / spacing.mean_m;
  return spacing;
}
