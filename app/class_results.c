// The finished exams of a class, read from the log when it has changed.
#include "class_results.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static void publish(sonde_door *door, sonde_door_text which, sonde_file *file) {
  char *text = NULL;
  size_t size;
  if (sonde_file_take(file, &text, &size, NULL)) return;
  (void)sonde_door_publish(door, which, text, NULL);
  sonde_free(text);
}

static void put_outcome(sonde_json_out *out, const sonde_log_entry *e) {
  assert(!e->interrupted);
  sonde_json_put_real(out, "score", e->score, 6);
  sonde_json_put_bool(out, "passed", e->passed);
  sonde_json_put_bool(out, "correct", e->correct);
  sonde_json_put_real(out, "seconds", e->metrics.time_s, 6);
}

void class_results_tell(class_results *results, const char *home, sonde_door *door) {
  struct stat about;
  sonde_exam_log *log = NULL;
  sonde_log_entry *entries = NULL;
  uint32_t count = 0;
  assert(results->log[0]);
  assert(home[0] && door);
  if (stat(results->log, &about)) return; // no exam yet
  const long long changed_ns = 1000000000LL * about.st_mtim.tv_sec + about.st_mtim.tv_nsec;
  if (changed_ns == results->seen_ns) return;
  sonde_status status = sonde_exam_log_open(results->log, &log, NULL);
  if (!status) status = sonde_exam_log_list(log, NULL, 0, &entries, &count, NULL);
  sonde_exam_log_close(log);
  sonde_json_out list = {.layout = SONDE_JSON_COMPACT}, one = {.layout = SONDE_JSON_COMPACT};
  sonde_file *table = NULL;
  if (!status) status = sonde_file_in_memory(&list.file, NULL);
  if (!status) status = sonde_file_in_memory(&one.file, NULL);
  if (!status) status = sonde_file_in_memory(&table, NULL);
  if (!status) {
    results->seen_ns = changed_ns;
    sonde_json_begin_object(&list, NULL);
    sonde_json_begin_list(&list, "exams");
    sonde_file_printf(table, "date,learner,case,title,protocol,guidance,score,passed,right,"
                             "seconds,hints\r\n");
    for (uint32_t i = 0; i < count; ++i) {
      const sonde_log_entry *e = &entries[i];
      sonde_door_statement(e, home, &one);
      sonde_file_printf(one.file, "\n");
      if (e->interrupted) continue; // an interrupted exam has neither score nor answer
      sonde_json_begin_object(&list, NULL);
      sonde_json_put_text(&list, "id", e->id);
      sonde_json_put_text(&list, "trainee", e->trainee);
      sonde_json_put_text(&list, "case", e->case_id);
      sonde_json_put_text(&list, "title", e->case_title);
      sonde_json_put_text(&list, "protocol", e->protocol);
      sonde_json_put_text(&list, "guidance", e->guidance);
      sonde_json_put_text(&list, "date", e->date);
      put_outcome(&list, e);
      sonde_json_put_integer(&list, "hints", e->metrics.hints);
      sonde_json_end(&list);
      const char *const texts[] = {e->date,       e->trainee,  e->case_id,
                                   e->case_title, e->protocol, e->guidance};
      for (size_t k = 0; k < sizeof texts / sizeof texts[0]; ++k) {
        sonde_csv_put_text(table, texts[k]);
        sonde_file_printf(table, ",");
      }
      sonde_file_printf(table, "%.1f,%d,%d,%.1f,%u\r\n", e->score, e->passed, e->correct,
                        e->metrics.time_s, (unsigned)e->metrics.hints);
    }
    sonde_json_end(&list);
    sonde_json_end(&list);
    publish(door, SONDE_DOOR_RESULTS, list.file);
    publish(door, SONDE_DOOR_STATEMENTS, one.file);
    publish(door, SONDE_DOOR_TABLE, table);
  } else {
    sonde_file_discard(list.file);
    sonde_file_discard(one.file);
    sonde_file_discard(table);
    sonde_free(entries);
    return;
  }
  pthread_mutex_lock(&results->lock);
  sonde_free(results->entries);
  results->entries = entries, results->count = count;
  pthread_mutex_unlock(&results->lock);
}

char *class_results_since(class_results *results, const char *trainee, const char *date) {
  assert(trainee[0] && date);
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  char *text = NULL;
  size_t size;
  if (sonde_file_in_memory(&out.file, NULL)) return NULL;
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_text(&out, "since", date);
  sonde_json_begin_list(&out, "exams");
  pthread_mutex_lock(&results->lock);
  for (uint32_t i = results->count; i-- > 0;) {
    const sonde_log_entry *e = &results->entries[i];
    if (e->interrupted || strcmp(e->trainee, trainee) != 0 || strcmp(e->date, date) < 0) continue;
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "id", e->id);
    sonde_json_put_text(&out, "title", e->case_title);
    put_outcome(&out, e);
    sonde_json_end(&out);
  }
  pthread_mutex_unlock(&results->lock);
  sonde_json_end(&out);
  sonde_json_end(&out);
  return sonde_file_take(out.file, &text, &size, NULL) ? NULL : text;
}
