// The log of exams in one SQLite file.
#include "trainer/log.h"

#include "base/disk.h"
#include "base/maths.h"
#include "sonde/base_json.h"

#include <errno.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <string.h>

// "Sond": tells a log from other SQLite files.
enum { APPLICATION = 0x536f6e64, WAIT_MS = 5000, SQL_SIZE = 2048 };

struct sonde_exam_log {
  sqlite3 *base;
  char path[512]; // for messages
};

typedef enum column_kind { COLUMN_TEXT, COLUMN_REAL, COLUMN_COUNT, COLUMN_FLAG } column_kind;

typedef struct column {
  const char *name;
  column_kind kind;
  size_t offset, size;
} column;

#define TEXT(member)                                                                               \
  { #member, COLUMN_TEXT, offsetof(sonde_log_entry, member), sizeof((sonde_log_entry *)0)->member }
#define FLAG(member)                                                                               \
  { #member, COLUMN_FLAG, offsetof(sonde_log_entry, member), sizeof(bool) }
#define REAL(name, member)                                                                         \
  { name, COLUMN_REAL, offsetof(sonde_log_entry, member), sizeof(double) }
#define COUNT(name, member)                                                                        \
  { name, COLUMN_COUNT, offsetof(sonde_log_entry, member), sizeof(uint32_t) }

// One row of this table is one column of the file's.
static const column COLUMNS[] = {
    TEXT(id),
    TEXT(trainee),
    TEXT(case_id),
    TEXT(case_title),
    TEXT(protocol),
    TEXT(guidance),
    TEXT(date),
    TEXT(recording),
    REAL("score", score),
    FLAG(passed),
    FLAG(correct),
    FLAG(answered),
    FLAG(called_thrombosis),
    FLAG(thrombosis),
    FLAG(interrupted),
    REAL("seconds", metrics.time_s),
    REAL("contact_s", metrics.contact_s),
    REAL("coverage", metrics.coverage),
    REAL("vein_coverage", metrics.vein_coverage),
    REAL("gap_m", metrics.gap_m),
    COUNT("points", metrics.points),
    COUNT("points_done", metrics.points_done),
    COUNT("presses", metrics.press_count),
    COUNT("presses_complete", metrics.presses[SONDE_PRESS_COMPLETE]),
    COUNT("presses_open", metrics.presses[SONDE_PRESS_OPEN]),
    COUNT("presses_insufficient", metrics.presses[SONDE_PRESS_INSUFFICIENT]),
    COUNT("presses_too_hard", metrics.presses[SONDE_PRESS_TOO_HARD]),
    COUNT("presses_off_axis", metrics.presses[SONDE_PRESS_OFF_AXIS]),
    REAL("completeness", metrics.completeness),
    REAL("valid_share", metrics.valid_share),
    REAL("force_peak_n", metrics.force_peak_n),
    REAL("force_p95_n", metrics.force_p95_n),
    REAL("path_m", metrics.path_m),
    REAL("smoothness", metrics.smoothness),
    COUNT("hints", metrics.hints)};
enum { COLUMN_TOTAL = SONDE_COUNT_OF(COLUMNS) };

_Static_assert(SONDE_PRESS_RESULTS == 5, "the log has a column per result of a press");

// ---- SQLite -------------------------------------------------------------------------------------

static sonde_status sql_fail(const sonde_exam_log *log, sonde_error *error) {
  const char *words = sqlite3_errmsg(log->base);
  switch (sqlite3_errcode(log->base) & 0xff) {
  case SQLITE_NOMEM: return sonde_fail_memory(error);
  case SQLITE_NOTADB:
    return sonde_fail(error, SONDE_FORMAT, "%s: is not a log of exams; expected an SQLite file",
                      log->path);
  case SQLITE_CORRUPT:
  case SQLITE_ERROR: // a table or column is missing
    return sonde_fail(error, SONDE_FORMAT, "%s: the log of exams is damaged: %s; it stays as it is",
                      log->path, words);
  case SQLITE_BUSY:
  case SQLITE_LOCKED:
    return sonde_fail(error, SONDE_IO, "%s: another program kept the log for more than %d s",
                      log->path, WAIT_MS / 1000);
  case SQLITE_FULL:
  case SQLITE_IOERR: return sonde_fail(error, SONDE_DISK, "%s: %s", log->path, words);
  default: break;
  }
  int failure = sqlite3_system_errno(log->base);
  // The log is open, so its directory is there: SQLite could not make the journal beside it and
  // then looked whether there is one.
  if ((sqlite3_errcode(log->base) & 0xff) == SQLITE_CANTOPEN && failure == ENOENT)
    return sonde_fail(error, SONDE_DISK, "%s: its journal cannot be written", log->path);
  return sonde_fail(error, failure ? sonde_disk_status(failure) : SONDE_IO, "%s: %s%s%s", log->path,
                    words, failure ? ": " : "", failure ? strerror(failure) : "");
}

static sonde_status run(sonde_exam_log *log, const char *sql, sonde_error *error) {
  SONDE_ASSERT(log->base && sql);
  return sqlite3_exec(log->base, sql, NULL, NULL, NULL) ? sql_fail(log, error) : SONDE_OK;
}

static sonde_status prepare(sonde_exam_log *log, const char *sql, sqlite3_stmt **statement,
                            sonde_error *error) {
  int code = sqlite3_prepare_v2(log->base, sql, -1, statement, NULL);
  SONDE_ASSERT(code || *statement);
  return code ? sql_fail(log, error) : SONDE_OK;
}

static sonde_status integer_of(sonde_exam_log *log, const char *sql, int64_t *value,
                               sonde_error *error) {
  sqlite3_stmt *statement = NULL;
  sonde_status status = prepare(log, sql, &statement, error);
  if (!status && sqlite3_step(statement) != SQLITE_ROW) status = sql_fail(log, error);
  if (!status) *value = sqlite3_column_int64(statement, 0);
  sqlite3_finalize(statement);
  return status;
}

// ---- opening ------------------------------------------------------------------------------------

typedef struct file_kind {
  int64_t application, version, tables;
} file_kind;

static sonde_status kind_of(sonde_exam_log *log, file_kind *kind, sonde_error *error) {
  sonde_status status = integer_of(log, "PRAGMA application_id", &kind->application, error);
  if (!status) status = integer_of(log, "PRAGMA user_version", &kind->version, error);
  if (!status) status = integer_of(log, "SELECT count(*) FROM sqlite_schema", &kind->tables, error);
  return status;
}

// What file this is, in one transaction: another program may be making the tables between two
// questions.
static sonde_status look(sonde_exam_log *log, file_kind *kind, sonde_error *error) {
  sonde_status status = run(log, "BEGIN", error);
  if (status) return status;
  status = kind_of(log, kind, error);
  sqlite3_exec(log->base, "ROLLBACK", NULL, NULL, NULL);
  return status;
}

static bool is_new(const file_kind *kind) {
  return kind->application == 0 && kind->version == 0 && kind->tables == 0;
}

// Adds to a statement that must fit.
static void put(char *sql, size_t *used, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static void put(char *sql, size_t *used, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  int length = vsnprintf(sql + *used, SQL_SIZE - *used, format, arguments);
  va_end(arguments);
  SONDE_ASSERT(length >= 0 && *used + (size_t)length < SQL_SIZE);
  *used += (size_t)length;
}

static sonde_status open_and_check(sonde_exam_log *log, const char *path, sonde_error *error) {
  file_kind kind = {0};
  int code = sqlite3_open_v2(path, &log->base, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, NULL);
  if (!log->base) return sonde_fail_memory(error);
  // SQLite does not say why it cannot open: the same attempt does. What succeeds at the second one
  // was the machine's.
  if (code == SQLITE_CANTOPEN) {
    int descriptor, failure = sonde_disk_open(path, O_RDWR | O_CREAT, 0666, &descriptor);
    if (!failure) (void)sonde_disk_close(descriptor);
    return sonde_fail(error, failure ? sonde_disk_status(failure) : SONDE_DISK,
                      "%s: the log of exams cannot be opened: %s", path,
                      failure ? strerror(failure) : "the disk failed once");
  }
  if (code) return sql_fail(log, error);
  sqlite3_extended_result_codes(log->base, 1);
  sqlite3_busy_timeout(log->base, WAIT_MS);
  // The file's own code is not trusted.
  sqlite3_db_config(log->base, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
  sqlite3_db_config(log->base, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);

  sonde_status status = look(log, &kind, error);
  if (!status && is_new(&kind)) {
    // The tables of a new log. Looks again once the file is ours: another program may have made
    // them meanwhile.
    static const char *const TYPES[] = {[COLUMN_TEXT] = "TEXT NOT NULL",
                                        [COLUMN_REAL] = "REAL", // NULL: not measured
                                        [COLUMN_COUNT] = "INTEGER NOT NULL",
                                        [COLUMN_FLAG] = "INTEGER NOT NULL"};
    char sql[SQL_SIZE];
    size_t used = 0;
    file_kind table = {0};
    status = run(log, "BEGIN IMMEDIATE", error);
    if (!status) {
      status = kind_of(log, &table, error);
      if (!status && is_new(&table)) {
        put(sql, &used, "CREATE TABLE exams (number INTEGER PRIMARY KEY");
        for (uint32_t i = 0; i < COLUMN_TOTAL; ++i)
          put(sql, &used, ", %s %s%s", COLUMNS[i].name, TYPES[COLUMNS[i].kind],
              i == 0 ? " UNIQUE" : "");
        put(sql, &used, ") STRICT; CREATE INDEX exams_of_trainee ON exams (trainee, date);");
        put(sql, &used, "PRAGMA application_id = %d; PRAGMA user_version = %d;", APPLICATION,
            SONDE_LOG_VERSION);
        status = run(log, sql, error);
      }
      if (!status) status = run(log, "COMMIT", error);
      if (status) sqlite3_exec(log->base, "ROLLBACK", NULL, NULL, NULL);
    }
    if (!status) status = look(log, &kind, error);
  }
  if (status) return status;
  if (kind.application != APPLICATION)
    return sonde_fail(error, SONDE_FORMAT,
                      "%s: is an SQLite file of something else; expected a log of exams",
                      log->path);
  if (kind.version != SONDE_LOG_VERSION)
    return sonde_fail(error, SONDE_VERSION, "%s: log of exams of version %lld; expected %d",
                      log->path, (long long)kind.version, SONDE_LOG_VERSION);

  sqlite3_stmt *statement = NULL;
  status = prepare(log, "PRAGMA quick_check(1)", &statement, error);
  if (!status && sqlite3_step(statement) != SQLITE_ROW) status = sql_fail(log, error);
  if (!status) {
    const char *words = (const char *)sqlite3_column_text(statement, 0);
    if (!words || strcmp(words, "ok") != 0)
      status =
          sonde_fail(error, SONDE_FORMAT, "%s: the log of exams is damaged: %s; it stays as it is",
                     log->path, words ? words : "unreadable");
  }
  sqlite3_finalize(statement);
  return status;
}

sonde_status sonde_exam_log_open(const char *path, sonde_exam_log **out, sonde_error *error) {
  SONDE_ASSERT(path && out);
  *out = NULL;
  if (!path[0]) return sonde_fail(error, SONDE_ARGUMENT, "expected the path of a log of exams");
  sonde_exam_log *log = SONDE_NEW(sonde_exam_log, 1);
  if (!log) return sonde_fail_memory(error);
  snprintf(log->path, sizeof log->path, "%s", path);
  sonde_status status = open_and_check(log, path, error);
  if (status)
    sonde_exam_log_close(log);
  else
    *out = log;
  return status;
}

void sonde_exam_log_close(sonde_exam_log *log) {
  if (!log) return;
  int code = sqlite3_close(log->base); // refuses while a statement is unfinished
  SONDE_ASSERT(code == SQLITE_OK);
  sonde_free(log);
}

// ---- entries ------------------------------------------------------------------------------------

// Names of all columns, or as many numbered parameters, with commas between.
static void put_columns(char *sql, size_t *used, bool names) {
  for (uint32_t i = 0; i < COLUMN_TOTAL; ++i) {
    const char *comma = i ? ", " : "";
    if (names)
      put(sql, used, "%s%s", comma, COLUMNS[i].name);
    else
      put(sql, used, "%s?%u", comma, i + 1);
  }
}

// What the table could not say in words.
static sonde_status check_entry(const sonde_log_entry *entry, sonde_error *error) {
  if (!entry->id[0] || !entry->trainee[0] || !entry->case_id[0])
    return sonde_fail(error, SONDE_ARGUMENT,
                      "exam '%s' of '%s' on case '%s'; expected an id, a trainee and a case",
                      entry->id, entry->trainee, entry->case_id);
  static const char FORM[] = "dddd-dd-ddTdd:dd:ddZ";
  bool dated = true;
  for (size_t i = 0; dated && i < sizeof FORM; ++i) { // the end too
    bool digit = entry->date[i] >= '0' && entry->date[i] <= '9';
    dated = FORM[i] == 'd' ? digit : entry->date[i] == FORM[i];
  }
  if (!dated)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "exam %s: date '%s'; expected the form 2026-11-22T04:40:00Z", entry->id,
                      entry->date);
  if (!(entry->score >= 0 && entry->score <= 100))
    return sonde_fail(error, SONDE_ARGUMENT, "exam %s: score %g; expected 0 to 100", entry->id,
                      entry->score);
  return SONDE_OK;
}

sonde_status sonde_exam_log_add(sonde_exam_log *log, const sonde_log_entry *entry,
                                sonde_error *error) {
  SONDE_ASSERT(log && entry);
  sonde_status status = check_entry(entry, error);
  if (status) return status;
  char sql[SQL_SIZE];
  size_t used = 0;
  put(sql, &used, "INSERT INTO exams (");
  put_columns(sql, &used, true);
  put(sql, &used, ") VALUES (");
  put_columns(sql, &used, false);
  put(sql, &used, ")");
  sqlite3_stmt *statement = NULL;
  status = prepare(log, sql, &statement, error);
  int code = SQLITE_OK;
  for (int i = 0; !status && i < COLUMN_TOTAL && !code; ++i) {
    const column *c = &COLUMNS[i];
    const void *member = (const char *)entry + c->offset;
    switch (c->kind) {
    case COLUMN_TEXT: code = sqlite3_bind_text(statement, i + 1, member, -1, SQLITE_STATIC); break;
    case COLUMN_FLAG: code = sqlite3_bind_int(statement, i + 1, *(const bool *)member); break;
    case COLUMN_COUNT:
      code = sqlite3_bind_int64(statement, i + 1, *(const uint32_t *)member);
      break;
    case COLUMN_REAL: code = sqlite3_bind_double(statement, i + 1, *(const double *)member); break;
    } // NaN: NULL
  }
  if (!status && (code || sqlite3_step(statement) != SQLITE_DONE)) {
    bool twice = sqlite3_extended_errcode(log->base) == SQLITE_CONSTRAINT_UNIQUE;
    status = twice ? sonde_fail(error, SONDE_ARGUMENT, "%s: exam '%s' is in the log already",
                                log->path, entry->id)
                   : sql_fail(log, error);
  }
  sqlite3_finalize(statement);
  return status;
}

sonde_status sonde_exam_log_has(sonde_exam_log *log, const char *id, bool *found,
                                sonde_error *error) {
  SONDE_ASSERT(log && id && found);
  sqlite3_stmt *statement = NULL;
  sonde_status status = prepare(log, "SELECT 1 FROM exams WHERE id = ?1", &statement, error);
  if (status) return status;
  int code = sqlite3_bind_text(statement, 1, id, -1, SQLITE_STATIC);
  if (!code) code = sqlite3_step(statement);
  *found = code == SQLITE_ROW;
  if (code != SQLITE_ROW && code != SQLITE_DONE) status = sql_fail(log, error);
  sqlite3_finalize(statement);
  return status;
}

// ---- entries as text ----------------------------------------------------------------------------

sonde_status sonde_log_entry_text(const sonde_log_entry *entry, char **text, sonde_error *error) {
  SONDE_ASSERT(entry && text);
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  size_t count;
  *text = NULL;
  sonde_status status = sonde_file_in_memory(&out.file, error);
  if (status) return status;
  sonde_json_begin_object(&out, NULL);
  for (const column *c = COLUMNS; c < COLUMNS + COLUMN_TOTAL; ++c) {
    const void *member = (const char *)entry + c->offset;
    if (c->kind == COLUMN_TEXT) sonde_json_put_text(&out, c->name, member);
    if (c->kind == COLUMN_FLAG) sonde_json_put_bool(&out, c->name, *(const bool *)member);
    if (c->kind == COLUMN_COUNT) sonde_json_put_integer(&out, c->name, *(const uint32_t *)member);
    if (c->kind == COLUMN_REAL && isfinite(*(const double *)member))
      sonde_json_put_real(&out, c->name, *(const double *)member, 0);
  }
  sonde_json_end(&out);
  return sonde_file_take(out.file, text, &count, error);
}

sonde_status sonde_log_entry_parse(const char *text, sonde_log_entry *entry, sonde_error *error) {
  SONDE_ASSERT(text && entry);
  *entry = (sonde_log_entry){0};
  sonde_json *root = NULL;
  if (sonde_json_parse(text, strlen(text), NULL, &root, NULL) ||
      sonde_json_kind_of(root) != SONDE_JSON_OBJECT) {
    sonde_json_free(root);
    return sonde_fail(error, SONDE_FORMAT, "an entry of the log of exams is not a JSON object");
  }
  for (const column *c = COLUMNS; c < COLUMNS + COLUMN_TOTAL; ++c) {
    void *member = (char *)entry + c->offset;
    const sonde_json *item = sonde_json_member(root, c->name);
    const char *found = sonde_json_as_text(item);
    double number = sonde_json_as_number(item);
    if (c->kind == COLUMN_TEXT) sonde_log_copy(member, c->size, found ? found : "");
    if (c->kind == COLUMN_FLAG) *(bool *)member = sonde_json_kind_of(item) == SONDE_JSON_TRUE;
    if (c->kind == COLUMN_COUNT)
      *(uint32_t *)member = number >= 0 && number <= UINT32_MAX ? (uint32_t)number : 0;
    if (c->kind == COLUMN_REAL) *(double *)member = number;
  }
  sonde_json_free(root);
  return check_entry(entry, error) ? SONDE_FORMAT : SONDE_OK;
}

typedef void (*read_row_fn)(sqlite3_stmt *statement, void *item);

static double real_or_nan(sqlite3_stmt *statement, int place) {
  if (sqlite3_column_type(statement, place) == SQLITE_NULL) return (double)NAN;
  return sqlite3_column_double(statement, place);
}

static void read_entry(sqlite3_stmt *statement, void *item) {
  for (int i = 0; i < COLUMN_TOTAL; ++i) {
    const column *c = &COLUMNS[i];
    void *member = (char *)item + c->offset;
    switch (c->kind) {
    case COLUMN_TEXT:
      sonde_log_copy(member, c->size, (const char *)sqlite3_column_text(statement, i));
      break;
    case COLUMN_FLAG: *(bool *)member = sqlite3_column_int(statement, i) != 0; break;
    case COLUMN_COUNT:
      *(uint32_t *)member =
          (uint32_t)clamp((double)sqlite3_column_int64(statement, i), 0, UINT32_MAX);
      break;
    case COLUMN_REAL: *(double *)member = real_or_nan(statement, i); break;
    }
  }
}

// All rows of a statement whose first parameter is a trainee and whose second is a most.
static sonde_status read_rows(sonde_exam_log *log, const char *sql, const char *trainee,
                              int64_t most, size_t size, read_row_fn read, void **items,
                              uint32_t *count, sonde_error *error) {
  uint32_t room = 0;
  sqlite3_stmt *statement = NULL;
  sonde_status status = prepare(log, sql, &statement, error);
  int bound = status ? SQLITE_OK : sqlite3_bind_int64(statement, 2, most);
  if (!status && !bound && trainee) // unbound: NULL
    bound = sqlite3_bind_text(statement, 1, trainee, -1, SQLITE_STATIC);
  if (!status && bound) status = sql_fail(log, error);
  int code = SQLITE_DONE;
  while (!status && (code = sqlite3_step(statement)) == SQLITE_ROW) {
    if (*count == room) {
      uint32_t more = room ? 2 * room : 16;
      void *grown = sonde_realloc(*items, room * size, more * size);
      if (!grown) {
        status = sonde_fail_memory(error);
        break;
      }
      *items = grown;
      room = more;
    }
    char *item = (char *)*items + *count * size;
    memset(item, 0, size);
    read(statement, item);
    ++*count;
  }
  if (!status && code != SQLITE_DONE) status = sql_fail(log, error);
  sqlite3_finalize(statement);
  if (!status) return SONDE_OK;
  sonde_free(*items);
  *items = NULL;
  *count = 0;
  return status;
}

sonde_status sonde_exam_log_list(sonde_exam_log *log, const char *trainee, uint32_t most,
                                 sonde_log_entry **entries, uint32_t *count, sonde_error *error) {
  SONDE_ASSERT(log && entries && count);
  char sql[SQL_SIZE];
  size_t used = 0;
  void *items = NULL;
  *count = 0;
  put(sql, &used, "SELECT ");
  put_columns(sql, &used, true);
  put(sql, &used,
      " FROM exams WHERE ?1 IS NULL OR trainee = ?1 ORDER BY date DESC, number DESC LIMIT ?2");
  sonde_status status = read_rows(log, sql, trainee, most ? (int64_t)most : -1,
                                  sizeof(sonde_log_entry), read_entry, &items, count, error);
  *entries = items;
  return status;
}

static void read_count(sqlite3_stmt *statement, void *item) {
  sonde_log_count *c = item;
  sonde_log_copy(c->name, sizeof c->name, (const char *)sqlite3_column_text(statement, 0));
  sonde_log_copy(c->title, sizeof c->title, (const char *)sqlite3_column_text(statement, 1));
  c->exams = (uint32_t)sqlite3_column_int64(statement, 2);
  c->finished = (uint32_t)sqlite3_column_int64(statement, 3);
  c->passed = (uint32_t)sqlite3_column_int64(statement, 4);
  c->score_best = real_or_nan(statement, 5);
  c->score_mean = real_or_nan(statement, 6);
  sonde_log_copy(c->last, sizeof c->last, (const char *)sqlite3_column_text(statement, 7));
  SONDE_ASSERT(c->finished <= c->exams && c->passed <= c->finished);
}

#define COUNTS                                                                                     \
  ", count(*), sum(NOT interrupted), sum(passed AND NOT interrupted),"                             \
  " max(score) FILTER (WHERE NOT interrupted), avg(score) FILTER (WHERE NOT interrupted),"         \
  " max(date) FROM exams AS e WHERE ?1 IS NULL OR trainee = ?1 "

sonde_status sonde_exam_log_count(sonde_exam_log *log, sonde_log_by by, const char *trainee,
                                  sonde_log_count **counts, uint32_t *count, sonde_error *error) {
  SONDE_ASSERT(log && counts && count);
  static const char BY_TRAINEE[] = "SELECT trainee, ''" COUNTS "GROUP BY trainee ORDER BY trainee"
                                   " LIMIT ?2";
  static const char BY_CASE[] =
      "SELECT case_id, (SELECT case_title FROM exams WHERE case_id = e.case_id"
      " ORDER BY number DESC LIMIT 1)" COUNTS "GROUP BY case_id ORDER BY case_id LIMIT ?2";
  void *items = NULL;
  *count = 0;
  sonde_status status = read_rows(log, by == SONDE_LOG_BY_CASE ? BY_CASE : BY_TRAINEE, trainee, -1,
                                  sizeof(sonde_log_count), read_count, &items, count, error);
  *counts = items;
  return status;
}
