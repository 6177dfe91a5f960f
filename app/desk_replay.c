// A kept exam at the desk: any moment of it, played, with comments.
//
// is_id                an id names one directory
// press_of, load_presses   what the judge saw, from the exam's data
// load_thigh, open_player   parts of a replay
// show                 the image in view to the page
// end_exam, take_over  from a session to a replay
#include "desk_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static bool is_id(const char *id) {
  return id[0] && strspn(id, "abcdefghijklmnopqrstuvwxyz0123456789-") == strlen(id);
}

// In the page's words.
static cJSON *press_of(const cJSON *kept) {
  static const char *const KEYS[][2] = {{"peak_s", "t_s"},
                                        {"z_mm", "z_mm"},
                                        {"segment", "segment"},
                                        {"result", "result"},
                                        {"force_peak_n", "force_n"}};
  cJSON *press = cJSON_CreateObject();
  for (size_t i = 0; i < sizeof KEYS / sizeof KEYS[0]; ++i) {
    cJSON *value = cJSON_Duplicate(cJSON_GetObjectItemCaseSensitive(kept, KEYS[i][0]), true);
    cJSON_AddItemToObject(press, KEYS[i][1], value ? value : cJSON_CreateNull());
  }
  return press;
}

static void load_presses(desk_replay *replay, const char *directory) {
  char path[DESK_PATH], *text = NULL;
  size_t size = 0;
  if (sonde_file_load(desk_path(path, directory, "exam.json"), &text, &size, NULL))
    return; // an exam without an end has none
  cJSON *root = cJSON_ParseWithLength(text, size);
  const cJSON *kept;
  replay->presses = cJSON_CreateArray();
  cJSON_ArrayForEach(kept, cJSON_GetObjectItemCaseSensitive(root, "presses"))
      cJSON_AddItemToArray(replay->presses, press_of(kept));
  cJSON_Delete(root);
  sonde_free(text);
}

static sonde_status load_thigh(desk *d, desk_replay *replay, const char *directory,
                               sonde_error *error) {
  char path[DESK_PATH];
  sonde_case patient;
  cJSON *setup = NULL;
  sonde_status status;
  const char *text = NULL;
  if (desk_read_setup(desk_path(path, directory, "exam.rec"), &setup))
    text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(setup, "patient"));
  if (text)
    status = sonde_case_parse(text, path, &patient, error);
  else // an exam from before the journal
    status = sonde_case_load(desk_path(path, directory, "case.yaml"), &patient, error);
  cJSON_Delete(setup);
  if (status) return status;
  snprintf(replay->title, sizeof replay->title, "%s", patient.title);
  const char *bundled = d->def.bundled_path ? d->def.bundled_path : d->def.model_path;
  return sonde_case_build(&patient, bundled, d->cases, &replay->setup, error);
}

static sonde_status open_player(desk_replay *replay, const char *directory, sonde_error *error) {
  desk_path(replay->recording, directory, "exam.rec");
  sonde_player_def def = {.path = replay->recording,
                          .model = replay->setup.model,
                          .findings = &replay->setup.findings,
                          .recover = true};
  return sonde_player_open(&def, &replay->player, error);
}

static void show(desk *d) {
  desk_replay *replay = d->replay;
  sonde_frame frame;
  if (!sonde_player_frame(replay->player, &frame)) return;
  if (frame.snapshot.tick == replay->shown_tick) return;
  sonde_session_controls controls = sonde_player_controls(replay->player);
  if (sonde_page_post(d->server, &frame, &controls)) replay->shown_tick = frame.snapshot.tick;
}

// The session goes: its thigh is not shown any more.
static sonde_status take_over(desk *d, desk_replay *replay, sonde_error *error) {
  sonde_status status =
      sonde_page_show_model(d->server, replay->setup.model, d->probes, d->probe_count, error);
  if (status) return status;
  sonde_page_conceal(d->server, false, false);
  desk_end_session(d);
  desk_change(d, NULL, replay);
  return SONDE_OK;
}

// The exam that was just finished: its recording gets its end, its thigh stays in view.
static sonde_status end_exam(desk *d, sonde_error *error) {
  sonde_status status =
      sonde_page_show_model(d->server, d->exam->setup.model, d->probes, d->probe_count, error);
  if (!status) desk_end_session(d);
  return status;
}

static sonde_status build(desk *d, desk_replay *replay, const char *id, sonde_error *error) {
  char directory[DESK_PATH];
  desk_path(directory, d->exams, id);
  snprintf(replay->id, sizeof replay->id, "%s", id);
  load_presses(replay, directory);
  sonde_status status = load_thigh(d, replay, directory, error);
  if (!status) status = open_player(replay, directory, error);
  if (!status) status = sonde_comments_load(replay->recording, &replay->comments, error);
  return status;
}

sonde_status desk_replay_open(desk *d, const char *id, sonde_error *error) {
  if (!is_id(id)) return app_error(error, SONDE_NOT_FOUND, "there is no such exam");
  if (d->phase == DESK_RUNNING)
    return app_error(error, SONDE_ARGUMENT, "finish or leave the exam before a replay");
  desk_replay *replay = calloc(1, sizeof *replay);
  if (!replay) return app_error(error, SONDE_MEMORY, "out of memory");
  replay->speed = 1;
  desk_phase before = d->phase;
  desk_set_phase(d, DESK_PREPARING, "The recording is being opened.");
  sonde_status status = SONDE_OK;
  if (d->session && d->exam && strcmp(d->exam->id, id) == 0) status = end_exam(d, error);
  if (!status) status = build(d, replay, id, error);
  if (!status) status = take_over(d, replay, error);
  if (status) {
    desk_replay_destroy(replay);
    bool bare = before != DESK_REPLAY && !d->session;
    if (!bare || desk_practice(d, NULL)) desk_set_phase(d, before, "");
    return status;
  }
  status = sonde_player_seek(replay->player, 0.5, NULL, error);
  show(d);
  desk_set_phase(d, DESK_REPLAY, "");
  return status;
}

// A machine that is too slow for the exam's pace plays slower; the page stays in step.
void desk_replay_turn(desk *d) {
  const double most_s = 0.1; // of the exam, in one turn
  desk_replay *replay = d->replay;
  if (!replay->playing) return;
  double now_s = app_seconds(CLOCK_MONOTONIC);
  double to_s = replay->time_s + replay->speed * (now_s - replay->at_s);
  if (to_s > replay->time_s + most_s) to_s = replay->time_s + most_s;
  sonde_player_advance(replay->player, to_s);
  replay->time_s = to_s;
  replay->at_s = now_s;
  show(d);
  if (to_s >= sonde_player_info(replay->player)->duration_s) replay->playing = false;
}

sonde_status desk_replay_seek(desk *d, double time_s, sonde_error *error) {
  desk_replay *replay = d->replay;
  if (!replay) return app_error(error, SONDE_ARGUMENT, "there is no replay to seek in");
  sonde_status status = sonde_player_seek(replay->player, time_s, NULL, error);
  replay->time_s = sonde_player_time(replay->player);
  replay->at_s = app_seconds(CLOCK_MONOTONIC);
  show(d);
  return status;
}

static sonde_comment comment_of(const sonde_page_request *request, double time_s) {
  sonde_comment comment = {.time_s = time_s};
  snprintf(comment.author, sizeof comment.author, "%.*s", (int)sizeof comment.author - 1,
           request->name);
  snprintf(comment.text, sizeof comment.text, "%.*s", (int)sizeof comment.text - 1, request->text);
  return comment;
}

static sonde_status comment_replay(desk_replay *replay, const sonde_page_request *request,
                                   sonde_error *error) {
  sonde_comment comment = comment_of(request, request->time_s);
  sonde_status status = sonde_comments_add(replay->recording, &comment, error);
  if (status) return status;
  sonde_comments_clear(&replay->comments);
  return sonde_comments_load(replay->recording, &replay->comments, error);
}

// Into the recording that is being made, or that was ended with the exam.
static sonde_status put_comment(desk *d, const sonde_comment *comment, uint64_t tick,
                                sonde_error *error) {
  char path[DESK_PATH];
  if (d->exam->in_journal)
    return sonde_comments_add(desk_path(path, d->exam->directory, "exam.rec"), comment, error);
  char *text = sonde_comment_json(comment, error);
  if (!text) return error->status;
  sonde_status status = sonde_session_note(d->session, SONDE_NOTE_COMMENT, tick, text, error);
  sonde_free(text);
  return status;
}

// While the exam runs and while its result is shown; the report is then written again.
static sonde_status comment_exam(desk *d, const sonde_page_request *request, sonde_error *error) {
  desk_exam *exam = d->exam;
  sonde_comments *all = &exam->comments;
  pthread_mutex_lock(&d->lock);
  double time_s = sonde_judge_state(exam->judge).time_s;
  uint64_t tick = exam->seen_tick;
  pthread_mutex_unlock(&d->lock);
  if (all->count == SONDE_MAX_COMMENTS)
    return app_error(error, SONDE_ARGUMENT, "an exam takes at most %d comments",
                     SONDE_MAX_COMMENTS);
  sonde_comment comment = comment_of(request, time_s);
  sonde_comment *list = realloc(all->list, (all->count + 1) * sizeof *list);
  if (!list) return app_error(error, SONDE_MEMORY, "out of memory");
  all->list = list;
  sonde_status status = put_comment(d, &comment, tick, error);
  if (status) return status;
  list[all->count++] = comment;
  exam->filed = false;
  return SONDE_OK;
}

sonde_status desk_comment(desk *d, const sonde_page_request *request, sonde_error *error) {
  if (d->replay) return comment_replay(d->replay, request, error);
  bool shown = d->phase == DESK_RUNNING || d->phase == DESK_DONE;
  if (shown && d->exam && d->session) return comment_exam(d, request, error);
  return app_error(error, SONDE_ARGUMENT, "there is no exam to comment on");
}

void desk_replay_destroy(desk_replay *replay) {
  if (!replay) return;
  sonde_player_close(replay->player);
  sonde_comments_clear(&replay->comments);
  cJSON_Delete(replay->presses);
  sonde_case_setup_clear(&replay->setup);
  free(replay);
}
