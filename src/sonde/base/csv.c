// Reader of CSV tables: lines of cells in their place in the text, blanks around them taken off,
// empty lines and comments (#) passed over.
#include "base/csv.h"

#include "base/bounds.h"

#include <math.h>
#include <string.h>

// The next line of the text, without its line end.
static char *take_line(sonde_csv *csv) {
  if (csv->cursor >= csv->end) return NULL;
  char *line = csv->cursor;
  SONDE_ASSERT(*csv->end == 0);
  char *stop = memchr(line, '\n', (size_t)(csv->end - line));
  if (!stop) stop = csv->end;
  csv->cursor = stop < csv->end ? stop + 1 : csv->end;
  *stop = 0;
  if (stop > line && stop[-1] == '\r') stop[-1] = 0;
  ++csv->line;
  return line;
}

// Splits a line into trimmed cells. Returns their number, of which at most CSV_COLUMNS are stored.
static uint32_t split(char *line, const char **cells) {
  uint32_t count = 0;
  for (char *start = line; start; ++count) {
    char *comma = strchr(start, ',');
    if (comma) *comma = 0;
    start += strspn(start, " \t");
    size_t length = strlen(start);
    while (length && strchr(" \t", start[length - 1])) start[--length] = 0;
    if (count < CSV_COLUMNS) cells[count] = start;
    start = comma ? comma + 1 : NULL;
  }
  SONDE_ASSERT(count > 0);
  return count;
}

// The next line that is neither empty nor a comment.
static char *next_content(sonde_csv *csv) {
  char *line = take_line(csv);
  while (line) {
    const char *first = line + strspn(line, " \t");
    if (*first && *first != '#') return line;
    line = take_line(csv);
  }
  return NULL;
}

// Names of the columns, all different.
static sonde_status read_header(sonde_csv *csv, sonde_error *error) {
  char *line = next_content(csv);
  if (!line)
    return sonde_fail(error, SONDE_FORMAT, "%s: is empty, expected a header line with column names",
                      csv->path);
  uint32_t count = split(line, csv->name);
  if (count > CSV_COLUMNS)
    return sonde_fail(error, SONDE_FORMAT, "%s:%u: %u columns, expected at most %d", csv->path,
                      csv->line, count, CSV_COLUMNS);
  csv->column_count = count;
  for (uint32_t i = 0; i < count; ++i)
    if (sonde_csv_column(csv, csv->name[i]) != i && csv->name[i][0])
      return sonde_fail(error, SONDE_FORMAT, "%s:%u: column '%s' appears twice, expected it once",
                        csv->path, csv->line, csv->name[i]);
  return SONDE_OK;
}

static sonde_status load(sonde_csv *csv, const char *path, sonde_error *error) {
  *csv = (sonde_csv){.path = path};
  size_t bytes;
  sonde_status status =
      sonde_bounded_load_text(path, &sonde_limits_table, &csv->text, &bytes, error);
  if (status) return status;
  csv->cursor = csv->text;
  csv->end = csv->text + bytes;
  if (bytes >= 3 && !memcmp(csv->text, "\xEF\xBB\xBF", 3)) csv->cursor += 3;
  return SONDE_OK;
}

sonde_status sonde_csv_open(sonde_csv *csv, const char *path, sonde_error *error) {
  sonde_status status = load(csv, path, error);
  return status ? status : read_header(csv, error);
}

sonde_status sonde_csv_open_after(sonde_csv *csv, const char *path,
                                  bool (*is_header)(const sonde_csv *csv, void *user), void *user,
                                  sonde_error *error) {
  sonde_status status = load(csv, path, error);
  if (!status) status = read_header(csv, error);
  while (!status && !is_header(csv, user)) status = read_header(csv, error);
  return status;
}

void sonde_csv_close(sonde_csv *csv) {
  sonde_free(csv->text);
  *csv = (sonde_csv){0};
}

uint32_t sonde_csv_column(const sonde_csv *csv, const char *name) {
  for (uint32_t i = 0; i < csv->column_count; ++i)
    if (!strcmp(csv->name[i], name)) return i;
  return UINT32_MAX;
}

sonde_status sonde_csv_require(const sonde_csv *csv, const char *const *names, uint32_t count,
                               uint32_t *columns, sonde_error *error) {
  for (uint32_t i = 0; i < count; ++i) {
    columns[i] = sonde_csv_column(csv, names[i]);
    if (columns[i] == UINT32_MAX)
      return sonde_fail(error, SONDE_FORMAT, "%s:%u: column '%s' is missing from the header",
                        csv->path, csv->line, names[i]);
  }
  return SONDE_OK;
}

sonde_status sonde_csv_next(sonde_csv *csv, bool *found, sonde_error *error) {
  char *line = next_content(csv);
  *found = line != NULL;
  if (!line) return SONDE_OK;
  uint32_t count = split(line, csv->cell);
  if (count != csv->column_count)
    return sonde_fail(error, SONDE_FORMAT, "%s:%u: %u cells, expected %u as in the header",
                      csv->path, csv->line, count, csv->column_count);
  return SONDE_OK;
}

sonde_status sonde_csv_real(const sonde_csv *csv, uint32_t column, double *value,
                            sonde_error *error) {
  SONDE_ASSERT(column < csv->column_count);
  const char *text = csv->cell[column], *end;
  *value = sonde_parse_real(text, &end);
  if (end == text || *end)
    return sonde_fail(error, SONDE_FORMAT, "%s:%u: column %s: expected a number, found '%.40s'",
                      csv->path, csv->line, csv->name[column], text);
  if (!isfinite(*value))
    return sonde_fail(error, SONDE_FORMAT,
                      "%s:%u: column %s: expected a finite number, found '%.40s'", csv->path,
                      csv->line, csv->name[column], text);
  return SONDE_OK;
}

sonde_status sonde_csv_index(const sonde_csv *csv, uint32_t column, uint32_t *value,
                             sonde_error *error) {
  SONDE_ASSERT(column < csv->column_count);
  const char *text = csv->cell[column], *end;
  double real = sonde_parse_real(text, &end);
  if (end == text || *end || !(real >= 0 && real <= 1e9) || floor(real) < real)
    return sonde_fail(error, SONDE_FORMAT,
                      "%s:%u: column %s: expected a whole number >= 0, found '%.40s'", csv->path,
                      csv->line, csv->name[column], text);
  *value = (uint32_t)real;
  return SONDE_OK;
}

uint32_t sonde_csv_lines_left(const sonde_csv *csv) {
  uint32_t lines = 1;
  for (const char *c = csv->cursor; c < csv->end; ++c) lines += *c == '\n';
  return lines;
}
