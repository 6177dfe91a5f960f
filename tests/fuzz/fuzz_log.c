// Logs of exams (SQLite): any bytes are either a log, which is listed, or an error.
#include "fuzz.h"

static void list(sonde_exam_log *log) {
  sonde_log_entry *entries = NULL;
  sonde_log_count *counts = NULL;
  sonde_learning_point *points = NULL;
  uint32_t count = 0;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_exam_log_list(log, NULL, 0, &entries, &count, &error);
  for (uint32_t k = 0; !status && k < count; ++k)
    FUZZ_CHECK(memchr(entries[k].id, 0, sizeof entries[k].id) != NULL);
  if (!status) status = sonde_exam_log_curve(log, "ann", 0, &points, &count, &error);
  if (!status) status = sonde_exam_log_count(log, SONDE_LOG_BY_CASE, NULL, &counts, &count, &error);
  if (status) FUZZ_CHECK(error.status == status && error.message[0]);
  sonde_free(entries);
  sonde_free(points);
  sonde_free(counts);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  if (count == 0) return 0; // an empty file becomes a new log
  sonde_exam_log *log = NULL;
  sonde_error error = {SONDE_OK, "", ""};
  const char *path = fuzz_file("log.sqlite", bytes, count);
  if (fuzz_checked(sonde_exam_log_open(path, &log, &error), &error)) list(log);
  sonde_exam_log_close(log);
  unlink(fuzz_path("log.sqlite-journal"));
  unlink(fuzz_path("log.sqlite-wal"));
  return 0;
}
