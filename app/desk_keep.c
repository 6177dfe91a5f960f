// What stays of an exam: data, report, a row of the log.
#include "desk_parts.h"

#include <stdio.h>
#include <string.h>

static const char *name_of(const desk_exam *exam) {
  return exam->trainee[0] ? exam->trainee : "Guest"; // the log wants a name
}

static sonde_score_note note_of(const desk_exam *exam) {
  return (sonde_score_note){exam->id, name_of(exam), exam->protocol->id, exam->guidance,
                            exam->date};
}

// The earlier exams of the trainee are those in the log so far.
static sonde_status write_report(desk *d, desk_exam *exam, sonde_error *error) {
  sonde_log_entry *earlier = NULL;
  sonde_exam_report report = {.patient = &exam->patient,
                              .protocol = exam->protocol,
                              .map = &exam->setup.map,
                              .plan = &exam->plan,
                              .score = &exam->score,
                              .note = note_of(exam),
                              .pictures = exam->picture,
                              .picture_count = exam->picture_count,
                              .samples = exam->sample,
                              .sample_count = exam->sample_count,
                              .recording = "exam.rec"};
  report.presses = sonde_judge_compressions(exam->judge, &report.press_count);
  sonde_status status =
      sonde_exam_log_list(d->log, name_of(exam), 50, &earlier, &report.earlier_count, error);
  if (status) return status;
  report.earlier = earlier;
  uint32_t chosen[SONDE_EXAM_PICTURES];
  sonde_exam_picture pictures[SONDE_EXAM_PICTURES];
  uint32_t count =
      sonde_exam_report_choose(report.presses, report.press_count, SONDE_EXAM_PICTURES, chosen);
  uint32_t found = 0;
  for (uint32_t i = 0; i < count; ++i)
    for (uint32_t k = 0; k < exam->picture_count; ++k)
      if (exam->picture[k].press == chosen[i]) pictures[found++] = exam->picture[k];
  report.pictures = pictures;
  report.picture_count = found;
  char path[4200];
  snprintf(path, sizeof path, "%s/report.html", exam->directory);
  status = sonde_exam_report_write(&report, path, error);
  sonde_free(earlier);
  return status;
}

static sonde_status write_log(desk *d, desk_exam *exam, sonde_error *error) {
  sonde_score_note note = note_of(exam);
  sonde_log_entry entry = sonde_log_entry_make(&exam->patient, &exam->score, &note);
  snprintf(entry.recording, sizeof entry.recording, "%s/exam.rec", exam->id);
  return sonde_exam_log_add(d->log, &entry, error);
}

sonde_status desk_exam_save(desk *d, desk_exam *exam, sonde_error *error) {
  char json[4200], csv[4200];
  sonde_score_note note = note_of(exam);
  snprintf(json, sizeof json, "%s/exam.json", exam->directory);
  snprintf(csv, sizeof csv, "%s/exam.csv", exam->directory);
  sonde_status status =
      sonde_score_save(exam->judge, &exam->patient, &exam->score, &note, json, csv, error);
  if (!status) status = write_report(d, exam, error);
  return status ? status : write_log(d, exam, error);
}
