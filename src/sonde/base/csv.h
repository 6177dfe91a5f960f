// Comma separated text with a header line: cells by column name, errors with file, line and column.
#ifndef SONDE_SRC_CSV_H
#define SONDE_SRC_CSV_H

#include "base/link.h"
#include "base/base.h"

enum { CSV_COLUMNS = 64 };

// One open table. Names and cells point into text.
typedef struct sonde_csv {
  const char *path;
  char *text, *cursor, *end;
  uint32_t line; // of the row in cells, 1-based
  uint32_t column_count;
  const char *name[CSV_COLUMNS];
  const char *cell[CSV_COLUMNS];
} sonde_csv;

// Loads the file and reads the header line. Close also after a failure.
SONDE_LINK sonde_status sonde_csv_open(sonde_csv *csv, const char *path, sonde_error *error);
// The same for a table whose header follows other lines: the first line whose cells (in csv->name)
// is_header() accepts. FORMAT when there is none.
SONDE_LINK sonde_status sonde_csv_open_after(sonde_csv *csv, const char *path,
                                             bool (*is_header)(const sonde_csv *csv, void *user),
                                             void *user, sonde_error *error);
SONDE_LINK void sonde_csv_close(sonde_csv *csv);
// Column of a name; UINT32_MAX when there is none.
SONDE_LINK uint32_t sonde_csv_column(const sonde_csv *csv, const char *name);
// Finds every name of a list; FORMAT names the first missing one.
SONDE_LINK sonde_status sonde_csv_require(const sonde_csv *csv, const char *const *names,
                                          uint32_t count, uint32_t *columns, sonde_error *error);
// Reads the next row; *found is false at the end.
SONDE_LINK sonde_status sonde_csv_next(sonde_csv *csv, bool *found, sonde_error *error);
// Finite real number of the current row.
SONDE_LINK sonde_status sonde_csv_real(const sonde_csv *csv, uint32_t column, double *value,
                                       sonde_error *error);
// Whole number from 0 to 10^9.
SONDE_LINK sonde_status sonde_csv_index(const sonde_csv *csv, uint32_t column, uint32_t *value,
                                        sonde_error *error);
// Number of data rows from the cursor on, at most (empty and comment lines included).
SONDE_LINK uint32_t sonde_csv_lines_left(const sonde_csv *csv);

#endif
