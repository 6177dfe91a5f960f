// A kept exam: any moment of it, played, with comments.
#include "exam_app_parts.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void show(exam_app *app) {
  assert(app->replay && app->replay->player);
  exam_replay *replay = app->replay;
  sonde_frame frame;
  if (!sonde_player_frame(replay->player, &frame)) return;
  if (frame.snapshot.tick == replay->shown_tick) return;
  sonde_session_controls controls = sonde_player_controls(replay->player);
  if (sonde_page_post(app->server, &frame, &controls)) replay->shown_tick = frame.snapshot.tick;
}

sonde_status exam_replay_open(exam_app *app, const char *id, sonde_error *error) {
  assert(id != NULL);
  // An id names one directory.
  if (!id[0] || strspn(id, "abcdefghijklmnopqrstuvwxyz0123456789-") != strlen(id))
    return app_error(error, SONDE_NOT_FOUND, "there is no such exam");
  if (app->phase == EXAM_RUNNING)
    return app_error(error, SONDE_ARGUMENT, "finish or leave the exam before a replay");
  exam_replay *replay = calloc(1, sizeof *replay);
  if (!replay) return app_error(error, SONDE_MEMORY, "out of memory");
  replay->speed = 1;
  exam_phase before = app->phase;
  exam_app_set_phase(app, EXAM_PREPARING, "The recording is being opened.");
  sonde_status status = SONDE_OK;
  // The exam that was just finished: its recording gets its end, its thigh stays in view.
  if (app->session && app->exam && strcmp(app->exam->id, id) == 0) {
    status = sonde_page_show_model(app->server, app->exam->setup.model, app->probes,
                                   app->probe_count, error);
    if (!status) exam_app_end_session(app);
  }
  if (!status) {
    // What the judge saw, the thigh, the recording and its comments.
    char directory[EXAM_PATH], path[EXAM_PATH], *data = NULL;
    size_t size = 0;
    sonde_case patient;
    exam_app_path(directory, app->exams, id);
    exam_app_path(replay->recording, directory, "exam.rec");
    snprintf(replay->id, sizeof replay->id, "%s", id);
    // An exam without an end has no data.
    if (!sonde_file_load(exam_app_path(path, directory, "exam.json"), &data, &size, NULL))
      (void)sonde_json_parse(data, size, NULL, &replay->result, NULL);
    sonde_free(data);

    sonde_json *setup = exam_read_setup(replay->recording);
    const char *text = sonde_json_as_text(sonde_json_member(setup, "patient"));
    if (text)
      status = sonde_case_parse(text, replay->recording, &patient, error);
    else // an exam from before the journal
      status = sonde_case_load(exam_app_path(path, directory, "case.yaml"), &patient, error);
    sonde_json_free(setup);
    if (!status) {
      snprintf(replay->title, sizeof replay->title, "%s", patient.title);
      status = sonde_case_build(&patient, exam_app_bundled(app), app->cases, &replay->setup, error);
      sonde_player_def def = {.path = replay->recording,
                              .model = replay->setup.model,
                              .findings = &replay->setup.findings,
                              .recover = true};
      if (!status) status = sonde_player_open(&def, &replay->player, error);
      if (!status) status = sonde_comments_load(replay->recording, &replay->comments, error);
    }
  }
  if (!status)
    status = sonde_page_show_model(app->server, replay->setup.model, app->probes, app->probe_count,
                                   error);
  if (status) {
    exam_replay_destroy(replay);
    bool bare = before != EXAM_REPLAY && !app->session;
    if (!bare || exam_app_practice(app, NULL)) exam_app_set_phase(app, before, "");
    return status;
  }
  // The session goes: its thigh is not shown any more.
  sonde_page_conceal(app->server, false, false);
  exam_app_end_session(app);
  exam_app_change(app, NULL, replay);
  status = sonde_player_seek(replay->player, 0.5, NULL, error);
  show(app);
  exam_app_set_phase(app, EXAM_REPLAY, "");
  return status;
}

// A machine that is too slow for the exam's pace plays slower; the page stays in step.
void exam_replay_turn(exam_app *app) {
  assert(app->replay && app->replay->player);
  const double most_s = 0.1; // of the exam, in one turn
  exam_replay *replay = app->replay;
  if (!replay->playing) return;
  double now_s = app_seconds(CLOCK_MONOTONIC);
  double to_s = replay->time_s + replay->speed * (now_s - replay->at_s);
  if (to_s > replay->time_s + most_s) to_s = replay->time_s + most_s;
  sonde_player_advance(replay->player, to_s);
  replay->time_s = to_s;
  replay->at_s = now_s;
  show(app);
  if (to_s >= sonde_player_info(replay->player)->duration_s) replay->playing = false;
}

sonde_status exam_replay_seek(exam_app *app, double time_s, sonde_error *error) {
  exam_replay *replay = app->replay;
  if (!replay) return app_error(error, SONDE_ARGUMENT, "there is no replay to seek in");
  sonde_status status = sonde_player_seek(replay->player, time_s, NULL, error);
  replay->time_s = sonde_player_time(replay->player);
  replay->at_s = app_seconds(CLOCK_MONOTONIC);
  show(app);
  return status;
}

sonde_status exam_app_comment(exam_app *app, const sonde_page_request *request,
                              sonde_error *error) {
  exam_replay *replay = app->replay;
  sonde_comment comment = {.time_s = request->time_s};
  snprintf(comment.author, sizeof comment.author, "%.*s", (int)sizeof comment.author - 1,
           request->name);
  snprintf(comment.text, sizeof comment.text, "%.*s", (int)sizeof comment.text - 1, request->text);
  if (replay) {
    sonde_status status = sonde_comments_add(replay->recording, &comment, error);
    if (status) return status;
    sonde_comments_clear(&replay->comments);
    return sonde_comments_load(replay->recording, &replay->comments, error);
  }
  bool shown = app->phase == EXAM_RUNNING || app->phase == EXAM_DONE;
  if (!shown || !app->exam || !app->session)
    return app_error(error, SONDE_ARGUMENT, "there is no exam to comment on");

  // While the exam runs and while its result is shown, into the recording that is being made or
  // that was ended with the exam; the report is then written again.
  exam *of = app->exam;
  sonde_comments *all = &of->comments;
  pthread_mutex_lock(&app->lock);
  comment.time_s = sonde_judge_state(of->judge).time_s;
  uint64_t tick = of->seen_tick;
  pthread_mutex_unlock(&app->lock);
  if (all->count == SONDE_MAX_COMMENTS)
    return app_error(error, SONDE_ARGUMENT, "an exam takes at most %d comments",
                     SONDE_MAX_COMMENTS);
  sonde_comment *list = realloc(all->list, (all->count + 1) * sizeof *list);
  if (!list) return app_error(error, SONDE_MEMORY, "out of memory");
  all->list = list;
  sonde_status status;
  if (of->in_journal) {
    char path[EXAM_PATH];
    status = sonde_comments_add(exam_app_path(path, of->directory, "exam.rec"), &comment, error);
  } else {
    char *text = sonde_comment_json(&comment, error);
    if (!text) return error->status;
    status = sonde_session_note(app->session, SONDE_NOTE_COMMENT, tick, text, error);
    sonde_free(text);
  }
  if (status) return status;
  list[all->count++] = comment;
  of->filed = false;
  return SONDE_OK;
}

void exam_replay_destroy(exam_replay *replay) {
  if (!replay) return;
  sonde_player_close(replay->player);
  sonde_comments_clear(&replay->comments);
  sonde_json_free(replay->result);
  sonde_case_setup_clear(&replay->setup);
  free(replay);
}
