// What stays of an exam: its journal first, then data, report and a row of the log, which can be
// derived from it again.
//
// keep_earlier         the trainee's exams before this one
// write_report, write_log   of an exam that was judged
// add_score            the note that says that the exam was finished
// put_away             everything that is not on the disk yet
// desk_keep, desk_watch_disk   what the page is told of it
#include "desk_parts.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double AGAIN_S = 1, TELL_AGAIN_S = 15;

static const char *name_of(const desk_exam *exam) {
  return exam->trainee[0] ? exam->trainee : "Guest"; // the log wants a name
}

static sonde_score_note note_of(const desk_exam *exam) {
  return (sonde_score_note){exam->id, name_of(exam), exam->protocol->id, exam->guidance,
                            exam->date};
}

// A report does not depend on when it is made.
static uint32_t keep_earlier(sonde_log_entry *list, uint32_t count, const desk_exam *exam) {
  enum { MOST = 50 };
  uint32_t kept = 0;
  for (uint32_t i = 0; i < count && kept < MOST; ++i)
    if (strcmp(list[i].date, exam->date) <= 0 && strcmp(list[i].id, exam->id) != 0)
      list[kept++] = list[i];
  return kept;
}

static sonde_status write_report(sonde_exam_log *log, desk_exam *exam, sonde_error *error) {
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
                              .comments = exam->comments.list,
                              .comment_count = exam->comments.count,
                              .recording = "exam.rec"};
  report.presses = sonde_judge_compressions(exam->judge, &report.press_count);
  sonde_status status =
      sonde_exam_log_list(log, name_of(exam), 0, &earlier, &report.earlier_count, error);
  if (status) return status;
  report.earlier_count = keep_earlier(earlier, report.earlier_count, exam);
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
  char path[DESK_PATH];
  desk_path(path, exam->directory, "report.html");
  status = sonde_exam_report_write(&report, path, error);
  sonde_free(earlier);
  return status;
}

static sonde_log_entry entry_of(const desk_exam *exam) {
  sonde_score_note note = note_of(exam);
  sonde_log_entry entry = sonde_log_entry_make(&exam->patient, &exam->score, &note);
  snprintf(entry.recording, sizeof entry.recording, "%s/exam.rec", exam->id);
  return entry;
}

static sonde_status write_log(sonde_exam_log *log, const desk_exam *exam, sonde_error *error) {
  bool there = false;
  sonde_log_entry entry = entry_of(exam);
  sonde_status status = sonde_exam_log_has(log, exam->id, &there, error);
  return status || there ? status : sonde_exam_log_add(log, &entry, error);
}

// The row is worth an attempt also without the files.
sonde_status desk_exam_save(sonde_exam_log *log, desk_exam *exam, sonde_error *error) {
  char json[DESK_PATH], csv[DESK_PATH];
  sonde_score_note note = note_of(exam);
  sonde_status status = SONDE_OK;
  desk_path(json, exam->directory, "exam.json");
  desk_path(csv, exam->directory, "exam.csv");
  if (!exam->filed) {
    status = sonde_score_save(exam->judge, &exam->patient, &exam->score, &note, json, csv, error);
    if (!status) status = write_report(log, exam, error);
    exam->filed = !status;
  }
  sonde_error own = {0};
  sonde_status logged = exam->logged ? SONDE_OK : write_log(log, exam, &own);
  exam->logged = !logged;
  if (!status && logged) *error = own;
  return status ? status : logged;
}

// ---- the journal ------------------------------------------------------------------------------

// The case as it was, so that a replay does not depend on the library of cases.
sonde_status desk_exam_setup_text(const desk_exam *exam, char **text, sonde_error *error) {
  char *patient = NULL;
  sonde_status status = sonde_case_text(&exam->patient, &patient, error);
  if (status) return status;
  cJSON *root = cJSON_CreateObject();
  cJSON_AddStringToObject(root, "exam", exam->id);
  cJSON_AddStringToObject(root, "trainee", name_of(exam));
  cJSON_AddStringToObject(root, "case", exam->patient.id);
  cJSON_AddStringToObject(root, "title", exam->patient.title);
  cJSON_AddStringToObject(root, "protocol", exam->protocol->id);
  cJSON_AddStringToObject(root, "guidance", exam->guidance);
  cJSON_AddStringToObject(root, "date", exam->date);
  cJSON_AddStringToObject(root, "patient", patient);
  char *printed = cJSON_PrintUnformatted(root);
  *text = printed ? strdup(printed) : NULL;
  cJSON_free(printed);
  cJSON_Delete(root);
  sonde_free(patient);
  return *text ? SONDE_OK : app_error(error, SONDE_MEMORY, "out of memory");
}

static sonde_status add_score(desk *d, const desk_exam *exam, sonde_error *error) {
  char *text = NULL;
  sonde_log_entry entry = entry_of(exam);
  sonde_status status = sonde_log_entry_text(&entry, &text, error);
  if (!status)
    status = sonde_session_note(d->session, SONDE_NOTE_SCORE, exam->seen_tick, text, error);
  sonde_free(text);
  return status;
}

// Inputs that are missing for good are told once; the rest of the exam is kept all the same.
static sonde_status finish_journal(desk *d, desk_exam *exam, sonde_error *error) {
  if (!exam->noted) {
    sonde_status status = add_score(d, exam, error);
    if (status) return status;
    exam->noted = true;
  }
  sonde_status status = sonde_session_finish(d->session, error);
  exam->in_journal = sonde_session_recording(d->session).finished;
  if (!status || !exam->in_journal) return status;
  sonde_page_tell(d->server, error->message);
  return SONDE_OK;
}

static sonde_status put_away(desk *d, desk_exam *exam, sonde_error *error) {
  sonde_error own = {0};
  sonde_status status = exam->in_journal ? SONDE_OK : finish_journal(d, exam, error);
  sonde_status saved = desk_exam_save(d->log, exam, &own);
  if (!status && saved) *error = own;
  return status ? status : saved;
}

static bool due(double now_s, const desk *d) {
  return !d->disk_told || now_s - d->disk_told_s >= TELL_AGAIN_S;
}

static void tell(desk *d, double now_s, const char *sentence) {
  sonde_page_tell(d->server, sentence);
  d->disk_told = true;
  d->disk_told_s = now_s;
}

void desk_keep(desk *d) {
  desk_exam *exam = d->exam;
  double now_s = app_seconds(CLOCK_MONOTONIC);
  bool kept = !exam || !exam->scored || (exam->in_journal && exam->filed && exam->logged);
  if (kept || !d->session || now_s < exam->again_s) return;
  sonde_error error = {0};
  char sentence[DESK_SENTENCE];
  if (!put_away(d, exam, &error)) {
    if (d->disk_told) sonde_page_tell(d->server, "The exam is on the disk now, all of it.");
    d->disk_told = false;
    desk_set_phase(d, d->phase, "");
    desk_tell_exams(d);
    return;
  }
  exam->again_s = now_s + AGAIN_S;
  snprintf(
      sentence, sizeof sentence,
      "%s is not on the disk yet: %.110s. Make room and stay on this result: it is tried again "
      "every second.",
      exam->in_journal ? "The report" : "The exam", error.message);
  if (due(now_s, d)) tell(d, now_s, sentence);
  desk_set_phase(d, d->phase, sentence);
}

void desk_watch_disk(desk *d) {
  char sentence[DESK_SENTENCE];
  if (!d->session || !d->exam || d->phase != DESK_RUNNING) return;
  sonde_recording_state state = sonde_session_recording(d->session);
  double now_s = app_seconds(CLOCK_MONOTONIC);
  if (state.lossy && !d->exam->gap_told) {
    d->exam->gap_told = true;
    sonde_page_tell(d->server, "From here on the recording of this exam is lost: its replay will "
                               "end here. Result and report are not affected.");
  }
  if (state.in_trouble && due(now_s, d)) {
    snprintf(sentence, sizeof sentence,
             "The disk does not take the recording (%s): %.0f s of the exam wait in memory. Make "
             "room; nothing is lost yet.",
             state.reason, state.unwritten_s);
    tell(d, now_s, sentence);
  }
  if (!state.in_trouble && d->disk_told) {
    sonde_page_tell(d->server, "The disk takes the recording again; what waited is written.");
    d->disk_told = false;
  }
}
