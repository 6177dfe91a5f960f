// Motion records as tables.
#include "base/maths.h"
#include "base/csv.h"
#include "sonde/identify.h"

#include <string.h>

static const char *const PROTOCOLS[] = {"ramp-hold", "slide"};
static const double MM = 1e-3;
enum { COLUMNS = 5, FEWEST_SAMPLES = 50 };
static const char *const NAMES[COLUMNS] = {"time_s", "penetration_mm", "slide_mm", "normal_n",
                                           "tangential_n"};
// Beyond these a number is not a measurement.
static const double HIGHEST[COLUMNS] = {1e6, 500, 1000, 1e4, 1e4};

static sonde_status expected(const char *path, uint32_t line, const char *key, const char *what,
                             const char *value, sonde_error *error) {
  return sonde_fail(error, SONDE_FORMAT, "%s:%u: %s: expected %s, found '%.60s'", path, line, key,
                    what, value);
}

// Comments of another shape, and keys that mean nothing here, are left alone.
static sonde_status read_comment(const char *path, uint32_t line, const char *text,
                                 sonde_motion_record *record, sonde_error *error) {
  char key[32], value[256];
  if (sscanf(text, "# %31[a-z_]: %255[^\n]", key, value) != 2) return SONDE_OK;
  for (size_t n = strlen(value); n && (value[n - 1] == ' ' || value[n - 1] == '\t');)
    value[--n] = 0;
  double number = 0;
  const char *end;
  if (!strcmp(key, "protocol")) {
    for (int k = 0; k < 2; ++k)
      if (!strcmp(value, PROTOCOLS[k])) {
        record->protocol = (sonde_protocol_kind)k;
        return SONDE_OK;
      }
    return expected(path, line, key, "ramp-hold or slide", value, error);
  }
  if (!strcmp(key, "site")) {
    const char *rest;
    number = sonde_parse_real(value, &rest);
    if (rest == value || *rest || !(number >= 0 && number <= 1e6) || floor(number) < number)
      return expected(path, line, key, "a whole number", value, error);
    record->site = (uint32_t)number;
  } else if (!strcmp(key, "axis")) {
    if (strcmp(value, "u") != 0 && strcmp(value, "v") != 0)
      return expected(path, line, key, "u or v", value, error);
    record->axis = value[0];
  } else if (!strcmp(key, "gel_film")) {
    record->gel_film = sonde_parse_real(value, &end);
    if (end == value || *end || !(record->gel_film >= 0 && record->gel_film <= 100))
      return expected(path, line, key, "a number from 0 to 100", value, error);
  } else if (!strcmp(key, "probe")) {
    snprintf(record->probe, sizeof record->probe, "%s", value);
  } else if (!strcmp(key, "origin")) {
    record->synthetic = !strcmp(value, "synthetic");
  }
  return SONDE_OK;
}

static sonde_status read_rows(sonde_csv *csv, sonde_motion_record *record, sonde_error *error) {
  uint32_t columns[COLUMNS];
  bool found = true;
  sonde_status status = sonde_csv_require(csv, NAMES, COLUMNS, columns, error);
  if (status) return status;
  record->samples = SONDE_NEW(sonde_motion_sample, sonde_csv_lines_left(csv));
  if (!record->samples) return sonde_fail_memory(error);
  for (status = sonde_csv_next(csv, &found, error); !status && found;
       status = sonde_csv_next(csv, &found, error)) {
    double v[COLUMNS];
    for (int k = 0; k < COLUMNS; ++k) {
      status = sonde_csv_real(csv, columns[k], &v[k], error);
      if (status) return status;
      if (!(fabs(v[k]) <= HIGHEST[k]))
        return sonde_fail(error, SONDE_FORMAT, "%s:%u: column %s: %g, expected at most %g",
                          csv->path, csv->line, NAMES[k], v[k], HIGHEST[k]);
    }
    const sonde_motion_sample *last = record->count ? &record->samples[record->count - 1] : NULL;
    if (last && !(v[0] > last->time_s))
      return sonde_fail(error, SONDE_FORMAT,
                        "%s:%u: column time_s: %g after %g, expected increasing times", csv->path,
                        csv->line, v[0], last->time_s);
    record->samples[record->count++] =
        (sonde_motion_sample){v[0], MM * v[1], MM * v[2], v[3], v[4]};
  }
  if (!status && record->count < FEWEST_SAMPLES)
    return sonde_fail(error, SONDE_FORMAT, "%s: too short: %u samples, expected at least %d",
                      csv->path, record->count, FEWEST_SAMPLES);
  return status;
}

sonde_status sonde_motion_record_load(const char *path, sonde_motion_record *record,
                                      sonde_error *error) {
  *record = (sonde_motion_record){.site = UINT32_MAX, .axis = 'v'};
  sonde_csv csv;
  sonde_status status = sonde_csv_open(&csv, path, error);
  if (!status) {
    // The table has cut its text into lines; those before the header are untouched otherwise.
    uint32_t line = 1;
    for (const char *at = csv.text; !status && at < csv.name[0]; ++line) {
      const char *mark = strchr(at, '#');
      if (mark) status = read_comment(csv.path, line, mark, record, error);
      at += strlen(at);
      while (at < csv.name[0] && !*at) ++at;
    }
  }
  if (!status) status = read_rows(&csv, record, error);
  sonde_csv_close(&csv);
  if (status) sonde_motion_record_clear(record);
  return status;
}

sonde_status sonde_motion_record_save(const char *path, const sonde_motion_record *record,
                                      sonde_error *error) {
  SONDE_ASSERT(record->protocol <= SONDE_PROTOCOL_SLIDE);
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "# origin: %s\n# protocol: %s\n# axis: %c\n# gel_film: %.9g\n",
                    record->synthetic ? "synthetic" : "measured", PROTOCOLS[record->protocol],
                    record->axis, record->gel_film);
  if (record->site != UINT32_MAX) sonde_file_printf(file, "# site: %u\n", record->site);
  if (record->probe[0]) sonde_file_printf(file, "# probe: %s\n", record->probe);
  for (int k = 0; k < COLUMNS; ++k) sonde_file_printf(file, "%s%s", k ? "," : "", NAMES[k]);
  sonde_file_printf(file, "\n");
  for (uint32_t k = 0; k < record->count; ++k) {
    const sonde_motion_sample *s = &record->samples[k];
    sonde_file_printf(file, "%.6f,%.5f,%.5f,%.5f,%.5f\n", s->time_s, s->penetration_m / MM,
                      s->slide_m / MM, s->normal_n, s->tangential_n);
  }
  return sonde_file_commit(file, error);
}

void sonde_motion_record_clear(sonde_motion_record *record) {
  if (!record) return;
  sonde_free(record->samples);
  *record = (sonde_motion_record){0};
}
