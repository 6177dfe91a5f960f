// Entries from scores, and what a list of entries says about learning.
#include "trainer/log.h"

#include <string.h>
#include <time.h>

void sonde_log_copy(char *to, size_t size, const char *utf8) {
  SONDE_ASSERT(to && size > 0);
  size_t length = utf8 ? strlen(utf8) : 0;
  if (length >= size) {
    length = size - 1;
    while (length && ((unsigned char)utf8[length] & 0xc0) == 0x80) --length; // within a character
  }
  if (length) memcpy(to, utf8, length);
  to[length] = 0;
}

void sonde_log_date(int64_t unix_s, char date[24]) {
  time_t seconds = (time_t)unix_s;
  struct tm parts = {0};
  if (!gmtime_r(&seconds, &parts) || parts.tm_year > 9999 - 1900 || parts.tm_year < -1900)
    parts = (struct tm){.tm_mday = 1, .tm_year = 70};
  size_t length = strftime(date, 24, "%Y-%m-%dT%H:%M:%SZ", &parts);
  SONDE_ASSERT(length > 0);
}

sonde_log_entry sonde_log_entry_make(const sonde_case *patient, const sonde_score *score,
                                     const sonde_score_note *note) {
  SONDE_ASSERT(patient && score && note);
  sonde_log_entry e = {.score = score->score,
                       .passed = score->passed,
                       .correct = score->correct,
                       .answered = score->answered,
                       .called_thrombosis = score->called_thrombosis,
                       .thrombosis = score->thrombosis,
                       .metrics = score->metrics};
  sonde_log_copy(e.id, sizeof e.id, note->exam);
  sonde_log_copy(e.trainee, sizeof e.trainee, note->trainee);
  sonde_log_copy(e.case_id, sizeof e.case_id, patient->id);
  sonde_log_copy(e.case_title, sizeof e.case_title, patient->title);
  sonde_log_copy(e.protocol, sizeof e.protocol, note->protocol);
  sonde_log_copy(e.guidance, sizeof e.guidance, note->guidance);
  sonde_log_copy(e.date, sizeof e.date, note->date);
  if (!note->date) sonde_log_date((int64_t)time(NULL), e.date);
  return e;
}

// ---- learning -----------------------------------------------------------------------------------

uint32_t sonde_learning_curve(const sonde_log_entry *entries, uint32_t count, uint32_t window,
                              sonde_learning_point *points) {
  SONDE_ASSERT(count == 0 || (entries && points));
  double last[SONDE_LOG_WINDOW_MAX];
  uint32_t used = 0, most = window ? window : SONDE_LOG_WINDOW;
  if (most > SONDE_LOG_WINDOW_MAX) most = SONDE_LOG_WINDOW_MAX;
  for (uint32_t i = count; i-- > 0;) {
    const sonde_log_entry *e = &entries[i];
    if (e->interrupted) continue;
    last[used % most] = e->score;
    sonde_learning_point *p = &points[used++];
    *p = (sonde_learning_point){.number = used, .score = e->score, .passed = e->passed};
    // The median of the window's scores, by insertion.
    double sorted[SONDE_LOG_WINDOW_MAX];
    uint32_t within = used < most ? used : most;
    for (uint32_t k = 0; k < within; ++k) {
      uint32_t j = k;
      for (; j > 0 && sorted[j - 1] > last[k]; --j) sorted[j] = sorted[j - 1];
      sorted[j] = last[k];
    }
    p->median = 0.5 * (sorted[(within - 1) / 2] + sorted[within / 2]);
    memcpy(p->date, e->date, sizeof p->date);
  }
  return used;
}

sonde_status sonde_exam_log_curve(sonde_exam_log *log, const char *trainee, uint32_t window,
                                  sonde_learning_point **points, uint32_t *count,
                                  sonde_error *error) {
  SONDE_ASSERT(trainee && points && count);
  sonde_log_entry *entries = NULL;
  uint32_t entry_count = 0;
  *points = NULL;
  *count = 0;
  sonde_status status = sonde_exam_log_list(log, trainee, 0, &entries, &entry_count, error);
  if (status) return status;
  *points = SONDE_NEW(sonde_learning_point, entry_count);
  if (*points)
    *count = sonde_learning_curve(entries, entry_count, window, *points);
  else
    status = sonde_fail_memory(error);
  sonde_free(entries);
  return status;
}

sonde_status sonde_exam_log_series(sonde_exam_log *log, const char *trainee, sonde_series *series,
                                   sonde_error *error) {
  SONDE_ASSERT(series);
  sonde_log_entry *entries = NULL;
  uint32_t count = 0;
  *series = (sonde_series){0};
  sonde_status status = sonde_exam_log_list(log, trainee, 0, &entries, &count, error);
  for (uint32_t i = 0; i < count; ++i) {
    const sonde_log_entry *e = &entries[i];
    sonde_score score = {.score = e->score,
                         .correct = e->correct,
                         .answered = e->answered,
                         .called_thrombosis = e->called_thrombosis,
                         .thrombosis = e->thrombosis,
                         .passed = e->passed};
    if (!e->interrupted) sonde_series_add(series, &score);
  }
  sonde_free(entries);
  return status;
}
