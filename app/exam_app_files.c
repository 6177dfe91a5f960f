// What stays of an exam: its journal first, then data, report and a row of the log, which can be
// derived from it again.
#include "exam_app_parts.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double RETRY_S = 1, TELL_AGAIN_S = 15;

static const char *name_of(const exam *of) {
  return of->trainee[0] ? of->trainee : "Guest"; // the log wants a name
}

static sonde_score_note note_of(const exam *of) {
  return (sonde_score_note){of->id,       name_of(of), of->protocol->id,
                            of->guidance, of->date,    of->tissue};
}

static sonde_log_entry entry_of(const exam *of) {
  sonde_score_note note = note_of(of);
  sonde_log_entry entry = sonde_log_entry_make(&of->patient, &of->score, &note);
  snprintf(entry.recording, sizeof entry.recording, "%s/exam.rec", of->id);
  return entry;
}

// ---- files and log

// The row is worth an attempt also without the files.
sonde_status exam_save(sonde_exam_log *log, exam *of, sonde_error *error) {
  assert(of->judge && of->directory[0]);
  sonde_status status = SONDE_OK, logged = SONDE_OK;
  if (!of->filed) {
    char json[EXAM_PATH], csv[EXAM_PATH];
    sonde_score_note note = note_of(of);
    const bool written = of->sheet.written;
    status = sonde_score_save(of->judge, &of->patient, &of->score, &note,
                              written ? &of->sheet : NULL, written ? &of->verdict : NULL,
                              exam_app_path(json, of->directory, "exam.json"),
                              exam_app_path(csv, of->directory, "exam.csv"), error);
    if (!status) {
      enum { MOST = 50 };
      char path[EXAM_PATH];
      uint32_t chosen[SONDE_EXAM_PICTURES], count, kept = 0;
      sonde_exam_picture pictures[SONDE_EXAM_PICTURES];
      sonde_log_entry *earlier = NULL;
      sonde_exam_report report = {.patient = &of->patient,
                                  .protocol = of->protocol,
                                  .map = &of->setups.held[0].map,
                                  .plan = &of->plan,
                                  .score = &of->score,
                                  .note = note_of(of),
                                  .pictures = pictures,
                                  .samples = of->sample,
                                  .sample_count = of->sample_count,
                                  .comments = of->comments.list,
                                  .comment_count = of->comments.count,
                                  .recording = "exam.rec"};

      if (of->sheet.written) report.worksheet = &of->sheet, report.verdict = &of->verdict;
      // The trainee's exams before this one: a report does not depend on when it is made.
      status = sonde_exam_log_list(log, name_of(of), 0, &earlier, &count, error);
      if (!status) {
        for (uint32_t i = 0; i < count && kept < MOST; ++i)
          if (strcmp(earlier[i].date, of->date) <= 0 && strcmp(earlier[i].id, of->id) != 0)
            earlier[kept++] = earlier[i];
        report.earlier = earlier;
        report.earlier_count = kept;

        report.presses = sonde_judge_compressions(of->judge, &report.press_count);
        count = sonde_exam_report_choose(report.presses, report.press_count, SONDE_EXAM_PICTURES,
                                         chosen);
        for (uint32_t i = 0; i < count; ++i)
          for (uint32_t k = 0; k < of->picture_count; ++k)
            if (of->picture[k].press == chosen[i])
              pictures[report.picture_count++] = of->picture[k];
        status = sonde_exam_report_write(&report, exam_app_path(path, of->directory, "report.html"),
                                         error);
        sonde_free(earlier);
      }
    }
    if (!status) status = exam_sheet_save(of, error);
    of->filed = !status;
  }
  sonde_error own = {0};
  if (!of->logged) {
    bool there = false;
    sonde_log_entry entry = entry_of(of);
    logged = sonde_exam_log_has(log, of->id, &there, &own);
    if (!logged && !there) logged = sonde_exam_log_add(log, &entry, &own);
  }
  of->logged = !logged;
  if (!status && logged) *error = own;
  return status ? status : logged;
}

// ---- the journal

sonde_status exam_note_text(const char *const (*texts)[2], size_t count, char **text,
                            sonde_error *error) {
  assert(count == 0 || texts != NULL);
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  size_t length;
  *text = NULL;
  sonde_status status = sonde_file_in_memory(&out.file, error);
  if (status) return status;
  sonde_json_begin_object(&out, NULL);
  for (size_t i = 0; i < count; ++i) sonde_json_put_text(&out, texts[i][0], texts[i][1]);
  sonde_json_end(&out);
  return sonde_file_take(out.file, text, &length, error);
}

// The case as it was, so that a replay does not depend on the library of cases.
sonde_status exam_setup_text(const exam *of, sonde_limb_position position, char **text,
                             sonde_error *error) {
  char *patient = NULL;
  *text = NULL;
  sonde_status status = sonde_case_text(&of->patient, &patient, error);
  if (status) return status;
  const char *const texts[][2] = {{"exam", of->id},
                                  {"trainee", name_of(of)},
                                  {"case", of->patient.id},
                                  {"title", of->patient.title},
                                  {"protocol", of->protocol->id},
                                  {"guidance", of->guidance},
                                  {"date", of->date},
                                  {"tissue", of->tissue},
                                  {"position", sonde_position_key(position)},
                                  {"patient", patient}};
  status = exam_note_text(texts, sizeof texts / sizeof texts[0], text, error);
  sonde_free(patient);
  return status;
}

// ---- the disk

static void tell_disk(exam_app *app, double now_s, const char *sentence) {
  assert(sentence[0]);
  if (app->disk_told && now_s - app->disk_told_s < TELL_AGAIN_S) return;
  sonde_page_tell(app->server, sentence);
  app->disk_told = true;
  app->disk_told_s = now_s;
}

void exam_app_keep(exam_app *app) {
  exam *of = app->exam;
  double now_s = app_seconds(CLOCK_MONOTONIC);
  bool kept = !of || !of->scored || (of->in_journal && of->filed && of->logged);
  if (kept || !app->session || now_s < of->retry_s) return;
  sonde_error error = {0}, own = {0};
  sonde_status status = SONDE_OK;
  // The note that says that the exam was finished, and the journal's end. Inputs that are missing
  // for good are told once; the rest of the exam is kept all the same.
  if (!of->in_journal && !of->noted) {
    char *text = NULL;
    sonde_log_entry entry = entry_of(of);
    status = sonde_log_entry_text(&entry, &text, &error);
    if (!status)
      status = sonde_session_note(app->session, SONDE_NOTE_SCORE, of->seen_tick, text, &error);
    sonde_free(text);
    of->noted = !status;
  }
  if (!of->in_journal && !status) {
    status = sonde_session_finish(app->session, &error);
    of->in_journal = sonde_session_recording(app->session).finished;
    if (status && of->in_journal) {
      sonde_page_tell(app->server, error.message);
      status = SONDE_OK;
    }
  }
  sonde_status saved = exam_save(app->log, of, &own);
  if (!status && saved) error = own;
  if (!status && !saved) {
    if (app->disk_told) sonde_page_tell(app->server, "The exam is on the disk now, all of it.");
    app->disk_told = false;
    exam_app_set_phase(app, app->phase, "");
    exam_app_tell_exams(app);
    return;
  }
  char sentence[EXAM_SENTENCE];
  of->retry_s = now_s + RETRY_S;
  snprintf(
      sentence, sizeof sentence,
      "%s is not on the disk yet: %.110s. Make room and stay on this result: it is tried again "
      "every second.",
      of->in_journal ? "The report" : "The exam", error.message);
  tell_disk(app, now_s, sentence);
  exam_app_set_phase(app, app->phase, sentence);
}

void exam_app_watch_disk(exam_app *app) {
  char sentence[EXAM_SENTENCE];
  if (!app->session || !app->exam || app->phase != EXAM_RUNNING) return;
  sonde_recording_state state = sonde_session_recording(app->session);
  if (state.lossy && !app->exam->gap_told) {
    app->exam->gap_told = true;
    sonde_page_tell(app->server, "From here on the recording of this exam is lost: its replay will "
                                 "end here. Result and report are not affected.");
  }
  if (state.in_trouble) {
    snprintf(sentence, sizeof sentence,
             "The disk does not take the recording (%s): %.0f s of the exam wait in memory. Make "
             "room; nothing is lost yet.",
             state.reason, state.unwritten_s);
    tell_disk(app, app_seconds(CLOCK_MONOTONIC), sentence);
  }
  if (!state.in_trouble && app->disk_told) {
    sonde_page_tell(app->server, "The disk takes the recording again; what waited is written.");
    app->disk_told = false;
  }
}
