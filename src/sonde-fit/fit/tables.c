// Tables of sites and measurements: read, checked, written.
#include "base/maths.h"
#include "base/csv.h"
#include "fit/fit_inside.h"
#include "fit/repeats.h"
#include "geometry/internal.h"

#include <string.h>

static const double METRES_PER_MM = 1e-3;
static const double NORMAL_TOLERANCE_RAD = SONDE_PI / 6;      // measured normals are smoothed ones
static const double FORCE_LIMIT_N = 1e6, DEPTH_LIMIT_M = 1.0; // beyond: not a measurement

// ---- sites --------------------------------------------------------------------------------

enum { SITE_ID, SITE_X, SITE_N = 4, SITE_U = 7, SITE_V = 10, SITE_COLUMNS = 13 };
static const char *const SITE_NAMES[SITE_COLUMNS] = {
    "site", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "ux", "uy", "uz", "vx", "vy", "vz"};

static sonde_status read_vector(const sonde_csv *csv, const uint32_t *columns, sonde_vec3 *vector,
                                sonde_error *error) {
  double *parts[3] = {&vector->x, &vector->y, &vector->z};
  for (int i = 0; i < 3; ++i) {
    sonde_status status = sonde_csv_real(csv, columns[i], parts[i], error);
    if (status) return status;
  }
  return SONDE_OK;
}

// Makes *vector a unit vector orthogonal to the unit vector n (when given).
static sonde_status read_direction(const sonde_csv *csv, const uint32_t *columns,
                                   const sonde_vec3 *n, sonde_vec3 *vector, sonde_error *error) {
  sonde_status status = read_vector(csv, columns, vector, error);
  if (status) return status;
  double length = v_norm(*vector);
  sonde_vec3 across = n ? v_madd(*vector, -v_dot(*n, *vector), *n) : *vector;
  if (!(length > 1e-9) || !(v_norm(across) > 0.5 * length))
    return sonde_fail(
        error, SONDE_FORMAT, "%s:%u: columns %s..%s: expected a direction%s, found %s", csv->path,
        csv->line, csv->name[columns[0]], csv->name[columns[2]], n ? " across the normal" : "",
        length > 1e-9 ? "one along the normal" : "the zero vector");
  *vector = v_unit(across, across);
  SONDE_ASSERT(v_finite(*vector));
  return SONDE_OK;
}

uint32_t sonde_site_find(const sonde_site_table *table, uint32_t id) {
  if (id < table->count && table->sites[id].id == id) return id;
  for (uint32_t i = 0; i < table->count; ++i)
    if (table->sites[i].id == id) return i;
  return UINT32_MAX;
}

sonde_status sonde_site_table_load(const char *path, sonde_site_table *table, sonde_error *error) {
  *table = (sonde_site_table){0};
  sonde_csv csv;
  sonde_status status = sonde_csv_open(&csv, path, error);
  if (status) goto done;
  uint32_t room = sonde_csv_lines_left(&csv);
  table->sites = SONDE_NEW(sonde_site, room);
  table->fat_depth_m = SONDE_NEW(double, room);
  uint32_t columns[SITE_COLUMNS], fat_column = sonde_csv_column(&csv, "fat_mm");
  status = table->sites && table->fat_depth_m
               ? sonde_csv_require(&csv, SITE_NAMES, SITE_COLUMNS, columns, error)
               : sonde_fail_memory(error);
  while (!status) {
    bool found;
    status = sonde_csv_next(&csv, &found, error);
    if (status || !found) break;
    sonde_site *site = &table->sites[table->count];
    double *fat_m = &table->fat_depth_m[table->count];
    status = sonde_csv_index(&csv, columns[SITE_ID], &site->id, error);
    if (!status) status = read_vector(&csv, columns + SITE_X, &site->position_m, error);
    if (!status) status = read_direction(&csv, columns + SITE_N, NULL, &site->normal, error);
    if (!status) status = read_direction(&csv, columns + SITE_U, &site->normal, &site->u, error);
    if (!status) status = read_direction(&csv, columns + SITE_V, &site->normal, &site->v, error);
    *fat_m = NAN;
    if (!status && fat_column != UINT32_MAX)
      status = sonde_csv_real(&csv, fat_column, fat_m, error);
    if (status) break;
    site->position_m = v_scale(site->position_m, METRES_PER_MM);
    *fat_m *= METRES_PER_MM;
    if (sonde_site_find(table, site->id) != UINT32_MAX)
      status = sonde_fail(error, SONDE_FORMAT, "%s:%u: column site: site %u appears twice",
                          csv.path, csv.line, site->id);
    table->count += !status;
  }
  if (!status && !table->count)
    status =
        sonde_fail(error, SONDE_FORMAT, "%s: has no rows, expected at least one site", csv.path);
done:
  sonde_csv_close(&csv);
  if (status) sonde_site_table_clear(table);
  return status;
}

sonde_status sonde_site_table_save(const char *path, const sonde_site_table *table,
                                   sonde_error *error) {
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  bool fat = table->fat_depth_m != NULL;
  for (uint32_t i = 0; i < table->count && fat; ++i) fat = isfinite(table->fat_depth_m[i]);
  for (int i = 0; i < SITE_COLUMNS; ++i)
    sonde_file_printf(file, "%s%s", i ? "," : "", SITE_NAMES[i]);
  sonde_file_printf(file, fat ? ",fat_mm\n" : "\n");
  for (uint32_t i = 0; i < table->count; ++i) {
    const sonde_site *s = &table->sites[i];
    sonde_file_printf(file, "%u,%.6f,%.6f,%.6f", s->id, s->position_m.x / METRES_PER_MM,
                      s->position_m.y / METRES_PER_MM, s->position_m.z / METRES_PER_MM);
    const sonde_vec3 axes[3] = {s->normal, s->u, s->v};
    for (int k = 0; k < 3; ++k)
      sonde_file_printf(file, ",%.9f,%.9f,%.9f", axes[k].x, axes[k].y, axes[k].z);
    if (fat) sonde_file_printf(file, ",%.4f", table->fat_depth_m[i] / METRES_PER_MM);
    sonde_file_printf(file, "\n");
  }
  return sonde_file_commit(file, error);
}

void sonde_site_table_clear(sonde_site_table *table) {
  if (!table) return;
  sonde_free(table->sites);
  sonde_free(table->fat_depth_m);
  *table = (sonde_site_table){0};
}

// Distance from the skin and angle to its normal at the closest point.
static void place_on_surface(const sonde_model *model, const sonde_surface_index *index,
                             const sonde_site *site, double *distance_m, double *angle_rad) {
  sonde_surface_point at = sonde_surface_closest(index, site->position_m);
  const uint32_t *v = model->surface.faces[at.face];
  sonde_vec3 normal = vec3(0, 0, 0);
  for (int k = 0; k < 3; ++k) normal = v_madd(normal, at.weight[k], model->normal[v[k]]);
  *distance_m = at.distance_m;
  *angle_rad = atan2(v_norm(v_cross(normal, site->normal)), v_dot(normal, site->normal));
  SONDE_ASSERT(*angle_rad >= 0 && *angle_rad <= SONDE_PI);
}

sonde_status sonde_sites_check_on_surface(const sonde_model *model, const sonde_site_table *sites,
                                          double tolerance_m, sonde_error *error) {
  sonde_surface_index *index = NULL;
  sonde_status status = sonde_surface_index_create(&model->surface, &index, error);
  if (status) return status;
  uint32_t off = 0, first = 0;
  double distance_m = 0, angle_rad = 0;
  for (uint32_t i = 0; i < sites->count; ++i) {
    place_on_surface(model, index, &sites->sites[i], &distance_m, &angle_rad);
    bool fits = distance_m <= tolerance_m && angle_rad <= NORMAL_TOLERANCE_RAD;
    if (!fits && !off++) first = i;
  }
  if (off) {
    const sonde_site *site = &sites->sites[first];
    place_on_surface(model, index, site, &distance_m, &angle_rad);
    status = distance_m <= tolerance_m
                 ? sonde_fail(error, SONDE_MISMATCH,
                              "site %u: its normal is %.0f degrees off the skin's%s, expected at "
                              "most %.0f; %u of %u sites do not fit",
                              site->id, angle_rad * 180 / SONDE_PI,
                              angle_rad > SONDE_PI / 2 ? " and points inward" : "",
                              NORMAL_TOLERANCE_RAD * 180 / SONDE_PI, off, sites->count)
                 : sonde_fail(error, SONDE_MISMATCH,
                              "site %u lies %.1f mm from the skin, expected at most %.1f mm; %u of "
                              "%u sites do not fit: do sites and surface belong together, both in "
                              "mm?",
                              site->id, distance_m * 1e3, tolerance_m * 1e3, off, sites->count);
  }
  sonde_surface_index_destroy(index);
  return status;
}

// ---- measurements -------------------------------------------------------------------------

enum { ROW_SITE, ROW_PROBE, ROW_X, ROW_N = 5, ROW_DEPTH = 8, ROW_FORCE, ROW_COLUMNS };
static const char *const ROW_NAMES[ROW_COLUMNS] = {
    "site", "probe", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "penetration_mm", "force_n"};

static sonde_status load_row(const sonde_csv *csv, const uint32_t *columns,
                             const sonde_site_table *sites, uint32_t row, sonde_measurements *m,
                             sonde_error *error) {
  sonde_datum *datum = &m->data[row];
  SONDE_ASSERT(row == m->count);
  sonde_status status = sonde_csv_index(csv, columns[ROW_SITE], &datum->site, error);
  if (status) return status;
  // Built-in names and rectangles; a table cannot name a mesh file.
  char known[160] = "";
  const char *found = csv->cell[columns[ROW_PROBE]];
  double half_x_m, half_y_m;
  bool good = sonde_probe_rectangle(found, &half_x_m, &half_y_m) && strlen(found) < 24;
  for (const char *const *p = sonde_probe_names(); *p; ++p) {
    good |= strcmp(*p, found) == 0;
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s, ", *p);
  }
  if (!good)
    return sonde_fail(error, SONDE_FORMAT,
                      "%s:%u: column probe: unknown probe '%.40s', expected %sor rect:AxB (sides "
                      "in mm, at most 23 characters)",
                      csv->path, csv->line, found, known);
  snprintf(datum->probe, sizeof datum->probe, "%s", found);
  status = read_vector(csv, columns + ROW_X, &m->position_m[row], error);
  if (!status) status = read_direction(csv, columns + ROW_N, NULL, &m->normal[row], error);
  if (!status) status = sonde_csv_real(csv, columns[ROW_DEPTH], &datum->penetration_m, error);
  if (!status) status = sonde_csv_real(csv, columns[ROW_FORCE], &datum->force_n, error);
  if (status) return status;
  m->line[row] = csv->line;
  m->position_m[row] = v_scale(m->position_m[row], METRES_PER_MM);
  datum->penetration_m *= METRES_PER_MM;
  if (datum->penetration_m < 0 || datum->penetration_m > DEPTH_LIMIT_M)
    return sonde_fail(error, SONDE_FORMAT,
                      "%s:%u: column penetration_mm: expected a depth >= 0 and <= 1000, found "
                      "'%.40s'",
                      csv->path, csv->line, csv->cell[columns[ROW_DEPTH]]);
  if (fabs(datum->force_n) > FORCE_LIMIT_N)
    return sonde_fail(error, SONDE_FORMAT,
                      "%s:%u: column force_n: expected a force of at most 1e6 N, found '%.40s'",
                      csv->path, csv->line, csv->cell[columns[ROW_FORCE]]);
  if (!sites) return SONDE_OK;
  uint32_t index = sonde_site_find(sites, datum->site);
  if (index == UINT32_MAX)
    return sonde_fail(error, SONDE_FORMAT,
                      "%s:%u: column site: site %u is not in the sites file, expected one of its "
                      "%u sites",
                      csv->path, csv->line, datum->site, sites->count);
  double away_m = v_distance(m->position_m[row], sites->sites[index].position_m);
  if (!(away_m <= SONDE_SITE_TOLERANCE_M))
    return sonde_fail(error, SONDE_MISMATCH,
                      "%s:%u: columns x_mm..z_mm: site %u lies %.1f mm from where the sites file "
                      "has it, expected at most %.0f mm",
                      csv->path, csv->line, datum->site, away_m * 1e3,
                      SONDE_SITE_TOLERANCE_M * 1e3);
  return SONDE_OK;
}

// What identifies a row, with the line it stands on.
typedef struct row_key {
  const sonde_datum *datum;
  uint32_t line, repeat;
} row_key;

static int compare_data(const sonde_datum *a, const sonde_datum *b) {
  if (a->site != b->site) return a->site < b->site ? -1 : 1;
  int names = strcmp(a->probe, b->probe);
  if (names) return names;
  return (a->penetration_m > b->penetration_m) - (a->penetration_m < b->penetration_m);
}

static int compare_keys(const void *a, const void *b) {
  const row_key *p = a, *q = b;
  int order = compare_data(p->datum, q->datum);
  if (!order) order = (p->repeat > q->repeat) - (p->repeat < q->repeat);
  return order ? order : (p->line > q->line) - (p->line < q->line);
}

static sonde_status load_rows(sonde_csv *csv, const sonde_site_table *sites, row_key *keys,
                              sonde_measurements *m, sonde_error *error) {
  uint32_t columns[ROW_COLUMNS];
  // Columns that tell rows of one curve apart; UINT32_MAX: absent.
  uint32_t phase = sonde_csv_column(csv, "phase"), repeat = sonde_csv_column(csv, "repeat");
  sonde_status status = sonde_csv_require(csv, ROW_NAMES, ROW_COLUMNS, columns, error);
  bool found = !status;
  while (!status) {
    row_key *key = &keys[m->count];
    status = sonde_csv_next(csv, &found, error);
    if (status || !found) break;
    *key = (row_key){&m->data[m->count], csv->line, 0};
    status = load_row(csv, columns, sites, m->count, m, error);
    if (status) break;
    bool loading = true;
    if (phase != UINT32_MAX && !sonde_phase_of(csv->cell[phase], &loading))
      return sonde_fail(error, SONDE_FORMAT,
                        "%s:%u: column phase: expected loading or unloading, found '%.40s'",
                        csv->path, csv->line, csv->cell[phase]);
    if (repeat != UINT32_MAX) status = sonde_csv_index(csv, repeat, &key->repeat, error);
    if (status) break;
    m->count += loading;
    m->unloading += !loading;
  }
  if (status) return status;
  if (!m->count)
    return sonde_fail(error, SONDE_FORMAT, "%s: has no rows, expected at least one measurement",
                      csv->path);
  // Each depth of a curve stands once.
  qsort(keys, m->count, sizeof *keys, compare_keys);
  for (uint32_t i = 1; i < m->count; ++i) {
    const sonde_datum *d = keys[i].datum;
    if (compare_data(keys[i - 1].datum, d) == 0 && keys[i - 1].repeat == keys[i].repeat)
      return sonde_fail(error, SONDE_FORMAT,
                        "%s:%u: repeats line %u: site %u, probe %s, penetration_mm %.4f, expected "
                        "each once, or a column repeat or phase that tells them apart",
                        csv->path, keys[i].line, keys[i - 1].line, d->site, d->probe,
                        d->penetration_m * 1e3);
  }
  // Single negative forces are noise; a negative mean is the other sign convention.
  double sum_n = 0;
  for (uint32_t i = 0; i < m->count; ++i) sum_n += m->data[i].force_n;
  if (!(sum_n >= 0))
    return sonde_fail(error, SONDE_FORMAT,
                      "%s: column force_n: the mean is %.3g N, expected forces that push the probe "
                      "out, > 0; is the sign reversed?",
                      csv->path, sum_n / m->count);
  if (repeat == UINT32_MAX) return SONDE_OK;
  // Repeats become their mean curve.
  uint32_t count = m->count;
  sonde_repeat_row *row = SONDE_NEW(sonde_repeat_row, count);
  if (!row) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < count; ++i) {
    size_t at = (size_t)(keys[i].datum - m->data);
    row[i] = (sonde_repeat_row){m->data[at], m->position_m[at], m->normal[at], keys[i].line,
                                keys[i].repeat};
  }
  status = sonde_measurements_average(row, count, m, error);
  sonde_free(row);
  return status;
}

sonde_status sonde_measurements_create(sonde_measurements *m, uint32_t room, sonde_error *error) {
  *m = (sonde_measurements){0};
  m->data = SONDE_NEW(sonde_datum, room);
  m->position_m = SONDE_NEW(sonde_vec3, room);
  m->normal = SONDE_NEW(sonde_vec3, room);
  m->line = SONDE_NEW(uint32_t, room);
  if (m->data && m->position_m && m->normal && m->line) return SONDE_OK;
  sonde_measurements_clear(m);
  return sonde_fail_memory(error);
}

sonde_status sonde_measurements_load(const char *path, const sonde_site_table *sites,
                                     sonde_measurements *m, sonde_error *error) {
  *m = (sonde_measurements){0};
  sonde_csv csv;
  row_key *keys = NULL;
  sonde_status status = sonde_csv_open(&csv, path, error);
  if (status) goto done;
  uint32_t room = sonde_csv_lines_left(&csv);
  status = sonde_measurements_create(m, room, error);
  if (status) goto done;
  keys = SONDE_NEW(row_key, room);
  status = keys ? load_rows(&csv, sites, keys, m, error) : sonde_fail_memory(error);
done:
  sonde_free(keys);
  sonde_csv_close(&csv);
  if (status) sonde_measurements_clear(m);
  return status;
}

sonde_status sonde_measurements_save(const char *path, const sonde_measurements *m,
                                     sonde_error *error) {
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  if (m->remark[0]) sonde_file_printf(file, "# %.*s\n", (int)strcspn(m->remark, "\r\n"), m->remark);
  for (int i = 0; i < ROW_COLUMNS; ++i)
    sonde_file_printf(file, "%s%s", ROW_NAMES[i], i + 1 < ROW_COLUMNS ? "," : "\n");
  for (uint32_t i = 0; i < m->count; ++i) {
    const sonde_datum *d = &m->data[i];
    sonde_vec3 p = v_scale(m->position_m[i], 1.0 / METRES_PER_MM), n = m->normal[i];
    sonde_file_printf(file, "%u,%s,%.4f,%.4f,%.4f,%.6f,%.6f,%.6f,%.4f,%.4f\n", d->site, d->probe,
                      p.x, p.y, p.z, n.x, n.y, n.z, d->penetration_m / METRES_PER_MM, d->force_n);
  }
  return sonde_file_commit(file, error);
}

void sonde_measurements_clear(sonde_measurements *m) {
  if (!m) return;
  sonde_free(m->data);
  sonde_free(m->position_m);
  sonde_free(m->normal);
  sonde_free(m->scatter_n);
  sonde_free(m->line);
  *m = (sonde_measurements){0};
}
