// Practice, exams and replays behind one page: sessions, phases, requests.
#include "exam_app_draft.h"
#include "exam_app_export.h"
#include "exam_app_lesson.h"
#include "page_token.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double TELL_EVERY_S = 0.2;

const char *exam_app_path(char path[EXAM_PATH], const char *directory, const char *name) {
  assert(directory[0] && name[0]);
  if (snprintf(path, EXAM_PATH, "%s/%s", directory, name) >= EXAM_PATH) path[0] = 0;
  return path;
}

const char *exam_app_bundled(const exam_app *app) {
  return app->def.bundled_path ? app->def.bundled_path : app->def.model_path;
}

void exam_app_set_phase(exam_app *app, exam_phase phase, const char *message) {
  pthread_mutex_lock(&app->lock);
  app->phase = phase;
  snprintf(app->message, sizeof app->message, "%.*s", EXAM_SENTENCE - 1, message);
  pthread_mutex_unlock(&app->lock);
  exam_app_tell_exam(app);
}

void exam_app_case_alias(const exam_app *app, const char *id, char alias[EXAM_ALIAS]) {
  alias[0] = 0;
  for (uint32_t i = 0; i < app->case_count; ++i)
    if (strcmp(app->case_list[i].id, id) == 0) snprintf(alias, EXAM_ALIAS, "patient-%u", i + 1);
}

// ---- sessions

// The server must not show it any more. An exam that the log lacks by then gets its row, but not
// one in the middle of which the patient turns.
static void end_session(exam_app *app, sonde_session *session) {
  assert(session != NULL);
  sonde_error error = {0};
  exam_recovered found;
  bool recorded = sonde_session_recording(session).recording;
  sonde_session_stop(session);
  if (sonde_session_destroy(session, &error)) sonde_page_tell(app->server, error.message);
  const bool turns = app->exam && app->exam->turns;
  if (recorded && !turns) exam_recover_log(app->exams, app->log, &found);
}

void exam_app_end_session(exam_app *app) {
  sonde_session *session = app->session;
  app->session = NULL;
  if (session) end_session(app, session);
}

sonde_status exam_app_run_session(exam_app *app, sonde_session_def *def, const sonde_site *start,
                                  sonde_error *error) {
  assert(def->model);
  sonde_session *before = app->session, *next = NULL;
  sonde_device device = {0};
  // One hand cannot hold two devices: the session before ends first.
  if (before && strcmp(app->def.device_name, "page") != 0) {
    sonde_status status = sonde_page_show_model(app->server, def->model, NULL, 0, error);
    if (status) return status;
    exam_app_end_session(app);
    before = NULL;
  }
  sonde_status status = app->def.make_device(app->def.user, start, def, &device, error);
  if (!status) status = sonde_session_create(def, &device, &next, error);
  if (device.destroy) device.destroy(device.self); // not moved: creation failed
  if (!status && app->server) status = sonde_page_show(app->server, next, error);
  if (status) {
    sonde_session_destroy(next, NULL);
    return status;
  }
  app->session = next;
  if (before) end_session(app, before);
  return app->server ? sonde_session_start(next, error) : SONDE_OK;
}

static sonde_status start_practice(exam_app *app, sonde_error *error) {
  sonde_session_def def = app->def.practice;
  def.model = app->def.model;
  def.model_path = app->def.model_path;
  return exam_app_run_session(app, &def, &app->def.start, error);
}

void exam_app_change(exam_app *app, exam *next, exam_replay *replay) {
  assert(!next || !replay);
  exam *exam_before = app->exam;
  exam_replay *replay_before = app->replay;
  pthread_mutex_lock(&app->lock);
  app->exam = next;
  pthread_mutex_unlock(&app->lock);
  app->replay = replay;
  exam_film_destroy(app->film);
  exam_draft_destroy(app->draft);
  app->film = NULL, app->draft = NULL;
  exam_destroy(exam_before);
  exam_replay_destroy(replay_before);
}

sonde_status exam_app_practice(exam_app *app, sonde_error *error) {
  sonde_status status = start_practice(app, error);
  if (status) return status;
  sonde_page_conceal(app->server, false, false);
  exam_app_change(app, NULL, NULL);
  exam_app_set_phase(app, EXAM_PRACTICE, "");
  return SONDE_OK;
}

// ---- requests

// Called by the page's threads, one at a time.
static void take_request(void *user, const sonde_page_request *request) {
  exam_app *app = user;
  pthread_mutex_lock(&app->lock);
  if (app->request_count < EXAM_REQUESTS)
    app->request[(app->request_first + app->request_count++) % EXAM_REQUESTS] = *request;
  pthread_mutex_unlock(&app->lock);
}

// A note of the exam that runs, at the last image that the judge saw.
static sonde_status put_note(exam_app *app, sonde_note_kind kind, const char *const (*texts)[2],
                             size_t count, uint64_t tick, sonde_error *error) {
  assert(app->session && (count == 0 || texts != NULL));
  char *text = NULL;
  sonde_status status = exam_note_text(texts, count, &text, error);
  if (!status) status = sonde_session_note(app->session, kind, tick, text, error);
  sonde_free(text);
  return status;
}

static sonde_status answer(exam_app *app, const sonde_page_request *request, sonde_error *error) {
  switch (request->ask) {
  case SONDE_PAGE_START_EXAM:
  case SONDE_PAGE_START_LESSON: return exam_start(app, request, error);
  case SONDE_PAGE_DEMONSTRATE: return exam_film_open(app, request->id, error);
  case SONDE_PAGE_NEXT:
    if (app->film) app->film->read_until_s = 0;
    return SONDE_OK;
  case SONDE_PAGE_DECIDE: {
    sonde_decision decision;
    if (app->phase != EXAM_RUNNING)
      return app_error(error, SONDE_ARGUMENT, "there is no exam to decide in");
    if (!sonde_decision_parse(request->text, &decision))
      return app_error(error, SONDE_ARGUMENT,
                       "a decision must be compressible, clot, not_seen or empty");
    pthread_mutex_lock(&app->lock);
    uint32_t segment = sonde_vein_segment(&app->exam->setups.held[0].map, request->id);
    sonde_status status = sonde_judge_decide(app->exam->judge, segment, decision, error);
    uint64_t tick = app->exam->seen_tick;
    pthread_mutex_unlock(&app->lock);
    const char *const texts[][2] = {{"segment", request->id}, {"decision", request->text}};
    return status ? status : put_note(app, SONDE_NOTE_DECISION, texts, 2, tick, error);
  }
  case SONDE_PAGE_HINT: {
    if (app->phase != EXAM_RUNNING || strcmp(app->exam->guidance, "hints") != 0)
      return app_error(error, SONDE_ARGUMENT, "hints belong to an exam with hints");
    pthread_mutex_lock(&app->lock);
    sonde_judge_hint(app->exam->judge);
    uint64_t tick = app->exam->seen_tick;
    pthread_mutex_unlock(&app->lock);
    return put_note(app, SONDE_NOTE_HINT, NULL, 0, tick, error);
  }
  case SONDE_PAGE_WORKSHEET: return exam_app_write_sheet(app, request->entry, error);
  case SONDE_PAGE_EXPORT: return exam_export_ask(app, request, error);
  case SONDE_PAGE_EDIT: return exam_edit(app, request->entry, error);
  case SONDE_PAGE_POSITION: return exam_turn(app, request->id, error);
  case SONDE_PAGE_FINISH_EXAM: return exam_finish(app, error);
  case SONDE_PAGE_LEAVE_EXAM: return exam_app_practice(app, error);
  case SONDE_PAGE_LIST_EXAMS: exam_app_tell_exams(app); return SONDE_OK;
  case SONDE_PAGE_OPEN_REPLAY: return exam_replay_open(app, request->id, error);
  case SONDE_PAGE_SEEK: return exam_replay_seek(app, request->time_s, error);
  case SONDE_PAGE_PLAY:
    if (app->phase == EXAM_FILM) {
      app->film->playing = request->playing && !app->film->over;
      app->film->speed = request->speed;
      return SONDE_OK;
    }
    if (app->phase != EXAM_REPLAY)
      return app_error(error, SONDE_ARGUMENT, "there is no replay to play");
    app->replay->playing = request->playing;
    app->replay->speed = request->speed;
    app->replay->time_s = exam_replay_time(app->replay);
    app->replay->at_s = app_seconds(CLOCK_MONOTONIC);
    return SONDE_OK;
  default: return exam_app_comment(app, request, error);
  }
}

void exam_app_turn(exam_app *app) {
  bool asked = false;
  for (;;) {
    sonde_page_request request;
    sonde_error error = {0};
    pthread_mutex_lock(&app->lock);
    bool any = app->request_count > 0;
    if (any) {
      request = app->request[app->request_first];
      app->request_first = (app->request_first + 1) % EXAM_REQUESTS;
      --app->request_count;
    }
    pthread_mutex_unlock(&app->lock);
    if (!any) break;
    if (answer(app, &request, &error)) sonde_page_tell(app->server, error.message);
    asked = true;
  }
  if (app->phase == EXAM_REPLAY) exam_replay_turn(app);
  if (app->phase == EXAM_FILM) exam_film_turn(app);
  exam_export_turn(app);
  exam_app_watch_disk(app);
  exam_app_keep(app);
  double now_s = app_seconds(CLOCK_MONOTONIC);
  if (!asked && now_s - app->published_s < TELL_EVERY_S) return;
  app->published_s = now_s;
  exam_app_tell_exam(app);
  if (asked) exam_app_tell_sheet(app);
  exam_app_tell_replay(app);
}

// ---- the application

sonde_status exam_app_create(const exam_app_def *def, exam_app **out, sonde_error *error) {
  assert(def->cases && def->protocols);
  exam_app *app = calloc(1, sizeof *app);
  *out = NULL;
  if (!app) return error->status = SONDE_MEMORY;
  app->def = *def;
  pthread_mutex_init(&app->lock, NULL);
  snprintf(app->cases, sizeof app->cases, "%s", def->cases);
  snprintf(app->own_cases, sizeof app->own_cases, "%s", def->own_cases);
  snprintf(app->protocols, sizeof app->protocols, "%s", def->protocols);
  snprintf(app->exams, sizeof app->exams, "%s", def->exams);
  snprintf(app->trainee, sizeof app->trainee, "%s", def->trainee);
  // Cases, protocols, the log, and the probes that a replay shows.
  char path[EXAM_PATH];
  sonde_status status = exam_app_load_cases(app, error);
  if (!status)
    status =
        sonde_exam_protocol_list(app->protocols, &app->protocol_list, &app->protocol_count, error);
  if (!status && def->course) status = sonde_course_load(def->course, &app->course, error);
  if (!status) status = sonde_directory_make(app->exams, 0700, true, error);
  if (!status)
    status = sonde_exam_log_open(exam_app_path(path, app->exams, "exams.sqlite"), &app->log, error);
  if (!status) {
    const char *const *names = app->def.practice.probe_names;
    if (!names) names = sonde_probe_names();
    uint32_t count = 0;
    while (names[count]) ++count;
    app->probes = calloc(count, sizeof *app->probes);
    if (!app->probes) {
      status = app_error(error, SONDE_MEMORY, "out of memory");
    } else {
      for (uint32_t i = 0; i < count && !status; ++i) {
        status = sonde_probe_create(names[i], &app->probes[i], error);
        app->probe_count += !status;
      }
    }
  }
  if (!status) status = start_practice(app, error);
  if (!status) {
    char token[SONDE_PAGE_TOKEN], teacher[SONDE_PAGE_TOKEN];
    status = page_token_find(app->exams, "page.token", "SONDE_PAGE_TOKEN", token, error);
    if (!status)
      status = page_token_find(app->exams, "teacher.token", "SONDE_TEACHER_TOKEN", teacher, error);
    if (!status) {
      sonde_page_def page = {.port = app->def.port,
                             .token = token,
                             .teacher_token = teacher,
                             .watcher_token = getenv("SONDE_WATCHER_TOKEN"),
                             .model_path = app->def.model_path,
                             .force_limit_n = app->def.force_limit_n,
                             .exams_directory = app->exams,
                             .user = app,
                             .request = take_request};
      status = sonde_page_start(&page, app->session, &app->server, error);
      if (!status) {
        exam_recovered found;
        exam_recover_log(app->exams, app->log, &found);
        if (found.unreadable)
          fprintf(stderr, "sonde run: %u of %u exams in %s cannot be read: %s\n", found.unreadable,
                  found.exams, app->exams, found.worst);
        if (found.finished)
          fprintf(stderr,
                  "sonde run: %u finished exams were not in the log; "
                  "sonde exam --recover %s makes their reports\n",
                  found.finished, app->exams);
        exam_app_tell_greeting(app);
        exam_app_tell_exam(app);
        status = sonde_session_start(app->session, error);
      }
    }
  }
  if (status)
    exam_app_destroy(app, NULL);
  else
    *out = app;
  return status;
}

void exam_app_address(const exam_app *app, bool teacher, char address[SONDE_PAGE_ADDRESS]) {
  sonde_page_address(app->server, teacher, address);
}

sonde_status exam_app_destroy(exam_app *app, sonde_error *error) {
  if (!app) return SONDE_OK;
  if (app->exam) app->exam->retry_s = 0;
  exam_app_keep(app); // the last attempt
  exam_export_end(app);
  sonde_page_stop(app->server);
  if (app->session) sonde_session_stop(app->session);
  sonde_status status = sonde_session_destroy(app->session, error);
  exam_destroy(app->exam);
  exam_replay_destroy(app->replay);
  exam_film_destroy(app->film);
  exam_draft_destroy(app->draft);
  sonde_course_clear(&app->course);
  sonde_exam_log_close(app->log);
  for (uint32_t i = 0; i < app->probe_count; ++i) sonde_probe_clear(&app->probes[i]);
  free(app->probes);
  free(app->case_list);
  sonde_free(app->protocol_list);
  pthread_mutex_destroy(&app->lock);
  free(app);
  return status;
}
