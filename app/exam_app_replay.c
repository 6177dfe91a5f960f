// A kept exam: any moment of it, played, with comments.
#include "exam_app_export.h"

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

// To a moment of the part; one before its first image shows that image.
static sonde_status go_to(exam_replay *replay, double time_s, sonde_error *error) {
  assert(replay->player);
  sonde_frame frame;
  sonde_status status = sonde_player_seek(replay->player, time_s, NULL, error);
  if (!status && !sonde_player_frame(replay->player, &frame))
    (void)sonde_player_next_image(replay->player, false);
  return status;
}

// The player of a part stands before its first tick, its leg is shown.
static sonde_status play_part(exam_app *app, exam_replay *replay, uint32_t part,
                              sonde_error *error) {
  assert(part < replay->part_count);
  if (replay->player && replay->part == part) return SONDE_OK;
  char path[EXAM_PATH];
  const sonde_case_setup *setup = &replay->setups.held[replay->parts[part].held];
  sonde_player *player = NULL;
  sonde_player_def def = {.path = exam_part_path(path, replay->directory, part + 1),
                          .model = setup->model,
                          .findings = &setup->findings,
                          .recover = true};
  sonde_status status = sonde_player_open(&def, &player, error);
  if (!status)
    status = sonde_page_show_model(app->server, setup->model, app->probes, app->probe_count, error);
  if (status) {
    sonde_player_close(player);
    return status;
  }
  sonde_player_close(replay->player);
  replay->player = player, replay->part = part;
  replay->shown_tick = UINT64_MAX;
  return SONDE_OK;
}

// Case, parts and comments of a kept exam.
static sonde_status read_replay(exam_app *app, const char *id, exam_replay *replay,
                                sonde_error *error) {
  char path[EXAM_PATH], *data = NULL;
  size_t size = 0;
  sonde_case patient;
  exam_app_path(replay->directory, app->exams, id);
  exam_part_path(path, replay->directory, 1);
  snprintf(replay->id, sizeof replay->id, "%s", id);
  bool known;
  sonde_status status = exam_part_case(path, &patient, &known, error);
  if (!status && !known) // an exam from before the journal
    status = sonde_case_load(exam_app_path(path, replay->directory, "case.yaml"), &patient, error);
  if (status) return status;
  snprintf(replay->title, sizeof replay->title, "%s", patient.title);
  // An exam without an end has no data.
  if (!sonde_file_load(exam_app_path(path, replay->directory, "exam.json"), &data, &size, NULL))
    (void)sonde_json_parse(data, size, NULL, &replay->result, NULL);
  sonde_free(data);

  // Each part on the leg in its position.
  const uint32_t found = exam_part_count(replay->directory);
  for (uint32_t part = 0; part < (found ? found : 1) && !status; ++part) {
    sonde_case turned = patient;
    sonde_recording_info info;
    exam_replay_part *to = &replay->parts[part];
    (void)exam_part_position(replay->directory, part + 1, &turned.position);
    status = sonde_recording_inspect(exam_part_path(path, replay->directory, part + 1), true, &info,
                                     error);
    if (status) break;
    if (part > 0) to->start_s = to[-1].start_s + to[-1].length_s;
    to->length_s = info.duration_s;
    sonde_exam_setups *all = &replay->setups;
    to->held = sonde_exam_setups_find(all, turned.position);
    replay->part_count++;
    if (to->held < all->count) continue;
    if (all->count == SONDE_EXAM_SETUPS)
      status = app_error(error, SONDE_FORMAT, "%.300s: more than %d positions", replay->directory,
                         SONDE_EXAM_SETUPS);
    if (!status)
      status = sonde_case_build(&turned, exam_app_bundled(app), app->cases, &all->held[all->count],
                                error);
    all->count += !status;
  }
  return status ? status : exam_part_comments(replay->directory, &replay->comments, error);
}

sonde_status exam_replay_open(exam_app *app, const char *id, sonde_error *error) {
  assert(id != NULL);
  if (!exam_is_id(id)) return app_error(error, SONDE_NOT_FOUND, "there is no such exam");
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
    status = sonde_page_show_model(app->server, app->exam->setups.held[app->exam->held].model,
                                   app->probes, app->probe_count, error);
    if (!status) exam_app_end_session(app);
  }
  if (!status) status = read_replay(app, id, replay, error);
  if (!status) status = play_part(app, replay, 0, error);
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
  status = go_to(replay, 0.5, error);
  show(app);
  exam_app_set_phase(app, EXAM_REPLAY, "");
  return status;
}

double exam_replay_length(const exam_replay *replay) {
  const exam_replay_part *last = &replay->parts[replay->part_count - 1];
  return last->start_s + last->length_s;
}

double exam_replay_time(const exam_replay *replay) {
  return replay->parts[replay->part].start_s + sonde_player_time(replay->player);
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
  const uint32_t before = replay->part;
  const exam_replay_part *part = &replay->parts[before];
  sonde_error error = {0};
  if (to_s > part->start_s + part->length_s && replay->part + 1 < replay->part_count &&
      play_part(app, replay, replay->part + 1, &error)) {
    sonde_page_tell(app->server, error.message);
    replay->playing = false;
    return;
  }
  if (replay->part > before) now_s = app_seconds(CLOCK_MONOTONIC); // that took its time
  sonde_player_advance(replay->player, to_s - replay->parts[replay->part].start_s);
  replay->time_s = to_s;
  replay->at_s = now_s;
  show(app);
  if (to_s >= exam_replay_length(replay)) replay->playing = false;
}

sonde_status exam_replay_seek(exam_app *app, double time_s, sonde_error *error) {
  exam_replay *replay = app->replay;
  if (!replay) return app_error(error, SONDE_ARGUMENT, "there is no replay to seek in");
  uint32_t part = 0;
  while (part + 1 < replay->part_count && time_s >= replay->parts[part + 1].start_s) ++part;
  sonde_status status = play_part(app, replay, part, error);
  if (!status) status = go_to(replay, time_s - replay->parts[part].start_s, error);
  replay->time_s = exam_replay_time(replay);
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
    char path[EXAM_PATH];
    sonde_status status =
        sonde_comments_add(exam_part_path(path, replay->directory, 1), &comment, error);
    if (status) return status;
    sonde_comments_clear(&replay->comments);
    return exam_part_comments(replay->directory, &replay->comments, error);
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
  sonde_exam_setups_clear(&replay->setups);
  free(replay);
}
