// Practice, exams and replays behind one page.
//
// take_request            what the page's threads leave
// end_session             the session before, with its recording
// desk_run_session        another thigh
// answer                  one request
// create_*                parts of a desk, in this order
// desk_create, desk_turn, desk_destroy
#include "desk_parts.h"
#include "page_token.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double TELL_EVERY_S = 0.2;

// Called by the page's threads, one at a time.
static void take_request(void *user, const sonde_page_request *request) {
  desk *d = user;
  pthread_mutex_lock(&d->lock);
  if (d->request_count < DESK_REQUESTS)
    d->request[(d->request_first + d->request_count++) % DESK_REQUESTS] = *request;
  pthread_mutex_unlock(&d->lock);
}

static bool next_request(desk *d, sonde_page_request *request) {
  pthread_mutex_lock(&d->lock);
  bool any = d->request_count > 0;
  if (any) {
    *request = d->request[d->request_first];
    d->request_first = (d->request_first + 1) % DESK_REQUESTS;
    --d->request_count;
  }
  pthread_mutex_unlock(&d->lock);
  return any;
}

const char *desk_path(char path[DESK_PATH], const char *directory, const char *name) {
  if (snprintf(path, DESK_PATH, "%s/%s", directory, name) >= DESK_PATH) path[0] = 0;
  return path;
}

void desk_set_phase(desk *d, desk_phase phase, const char *message) {
  pthread_mutex_lock(&d->lock);
  d->phase = phase;
  snprintf(d->message, sizeof d->message, "%.*s", DESK_SENTENCE - 1, message);
  pthread_mutex_unlock(&d->lock);
  desk_tell_exam(d);
}

void desk_case_alias(const desk *d, const char *id, char alias[DESK_ALIAS]) {
  alias[0] = 0;
  for (uint32_t i = 0; i < d->case_count; ++i)
    if (strcmp(d->case_list[i].id, id) == 0) snprintf(alias, DESK_ALIAS, "patient-%u", i + 1);
}

const sonde_case *desk_find_case(const desk *d, const char *alias) {
  for (uint32_t i = 0; i < d->case_count; ++i) {
    char name[DESK_ALIAS];
    snprintf(name, sizeof name, "patient-%u", i + 1);
    if (strcmp(name, alias) == 0) return &d->case_list[i];
  }
  return NULL;
}

const sonde_exam_protocol *desk_find_protocol(const desk *d, const char *id) {
  for (uint32_t i = 0; i < d->protocol_count; ++i)
    if (strcmp(d->protocol_list[i].id, id) == 0) return &d->protocol_list[i];
  return NULL;
}

// ---- sessions

static sonde_status make_session(desk *d, sonde_session_def *def, const sonde_site *start,
                                 sonde_session **session, sonde_error *error) {
  sonde_device device = {0};
  sonde_status status = d->def.make_device(d->def.user, start, def, &device, error);
  if (!status) status = sonde_session_create(def, &device, session, error);
  if (device.destroy) device.destroy(device.self); // not moved: creation failed
  return status;
}

// The server must not show it any more. An exam that the log lacks by then gets its row.
static void end_session(desk *d, sonde_session *session) {
  sonde_error error = {0};
  desk_recovered found;
  bool recorded = sonde_session_recording(session).recording;
  sonde_session_stop(session);
  if (sonde_session_destroy(session, &error)) sonde_page_tell(d->server, error.message);
  if (recorded) desk_recover(d->exams, d->log, &found);
}

void desk_end_session(desk *d) {
  sonde_session *session = d->session;
  d->session = NULL;
  if (session) end_session(d, session);
}

sonde_status desk_run_session(desk *d, sonde_session_def *def, const sonde_site *start,
                              sonde_error *error) {
  sonde_session *before = d->session;
  bool shared = strcmp(d->def.device_name, "page") != 0; // one hand cannot hold two devices
  if (before && shared) {
    sonde_status status = sonde_page_show_model(d->server, def->model, NULL, 0, error);
    if (status) return status;
    desk_end_session(d);
    before = NULL;
  }
  sonde_session *next = NULL;
  sonde_status status = make_session(d, def, start, &next, error);
  if (!status && d->server) status = sonde_page_show(d->server, next, error);
  if (status) {
    sonde_session_destroy(next, NULL);
    return status;
  }
  d->session = next;
  if (before) end_session(d, before);
  return d->server ? sonde_session_start(next, error) : SONDE_OK;
}

static sonde_status start_practice(desk *d, sonde_error *error) {
  sonde_session_def def = d->def.practice;
  def.model = d->def.model;
  def.model_path = d->def.model_path;
  return desk_run_session(d, &def, &d->def.start, error);
}

void desk_change(desk *d, desk_exam *exam, desk_replay *replay) {
  desk_exam *exam_before = d->exam;
  desk_replay *replay_before = d->replay;
  pthread_mutex_lock(&d->lock);
  d->exam = exam;
  pthread_mutex_unlock(&d->lock);
  d->replay = replay;
  desk_exam_destroy(exam_before);
  desk_replay_destroy(replay_before);
}

sonde_status desk_practice(desk *d, sonde_error *error) {
  sonde_status status = start_practice(d, error);
  if (status) return status;
  sonde_page_conceal(d->server, false, false);
  desk_change(d, NULL, NULL);
  desk_set_phase(d, DESK_PRACTICE, "");
  return SONDE_OK;
}

// ---- requests

// A note of the exam that runs, at the last image that the judge saw.
static sonde_status note(desk *d, sonde_note_kind kind, cJSON *root, uint64_t tick,
                         sonde_error *error) {
  char *text = cJSON_PrintUnformatted(root);
  cJSON_Delete(root);
  if (!text) return app_error(error, SONDE_MEMORY, "out of memory");
  sonde_status status = sonde_session_note(d->session, kind, tick, text, error);
  cJSON_free(text);
  return status;
}

static sonde_status decide(desk *d, const sonde_page_request *request, sonde_error *error) {
  sonde_decision decision;
  if (d->phase != DESK_RUNNING)
    return app_error(error, SONDE_ARGUMENT, "there is no exam to decide in");
  if (!sonde_decision_parse(request->text, &decision))
    return app_error(error, SONDE_ARGUMENT,
                     "a decision must be compressible, clot, not_seen or empty");
  pthread_mutex_lock(&d->lock);
  uint32_t segment = sonde_vein_segment(&d->exam->setup.map, request->id);
  sonde_status status = sonde_judge_decide(d->exam->judge, segment, decision, error);
  uint64_t tick = d->exam->seen_tick;
  pthread_mutex_unlock(&d->lock);
  if (status) return status;
  cJSON *root = cJSON_CreateObject();
  cJSON_AddStringToObject(root, "segment", request->id);
  cJSON_AddStringToObject(root, "decision", request->text);
  return note(d, SONDE_NOTE_DECISION, root, tick, error);
}

static sonde_status hint(desk *d, sonde_error *error) {
  if (d->phase != DESK_RUNNING || strcmp(d->exam->guidance, "hints") != 0)
    return app_error(error, SONDE_ARGUMENT, "hints belong to an exam with hints");
  pthread_mutex_lock(&d->lock);
  sonde_judge_hint(d->exam->judge);
  uint64_t tick = d->exam->seen_tick;
  pthread_mutex_unlock(&d->lock);
  return note(d, SONDE_NOTE_HINT, cJSON_CreateObject(), tick, error);
}

static sonde_status play(desk *d, const sonde_page_request *request, sonde_error *error) {
  if (d->phase != DESK_REPLAY)
    return app_error(error, SONDE_ARGUMENT, "there is no replay to play");
  d->replay->playing = request->playing;
  d->replay->speed = request->speed;
  d->replay->time_s = sonde_player_time(d->replay->player);
  d->replay->at_s = app_seconds(CLOCK_MONOTONIC);
  return SONDE_OK;
}

static sonde_status answer(desk *d, const sonde_page_request *request, sonde_error *error) {
  switch (request->ask) {
  case SONDE_PAGE_START_EXAM: return desk_exam_start(d, request, error);
  case SONDE_PAGE_DECIDE: return decide(d, request, error);
  case SONDE_PAGE_HINT: return hint(d, error);
  case SONDE_PAGE_FINISH_EXAM: return desk_exam_finish(d, error);
  case SONDE_PAGE_LEAVE_EXAM: return desk_practice(d, error);
  case SONDE_PAGE_LIST_EXAMS: desk_tell_exams(d); return SONDE_OK;
  case SONDE_PAGE_OPEN_REPLAY: return desk_replay_open(d, request->id, error);
  case SONDE_PAGE_SEEK: return desk_replay_seek(d, request->time_s, error);
  case SONDE_PAGE_PLAY: return play(d, request, error);
  default: return desk_comment(d, request, error);
  }
}

void desk_turn(desk *d) {
  sonde_page_request request;
  bool asked = false;
  while (next_request(d, &request)) {
    sonde_error error = {0};
    if (answer(d, &request, &error)) sonde_page_tell(d->server, error.message);
    asked = true;
  }
  if (d->phase == DESK_REPLAY) desk_replay_turn(d);
  desk_watch_disk(d);
  desk_keep(d);
  double now_s = app_seconds(CLOCK_MONOTONIC);
  if (!asked && now_s - d->published_s < TELL_EVERY_S) return;
  d->published_s = now_s;
  desk_tell_exam(d);
  desk_tell_replay(d);
}

// ---- the desk

static sonde_status create_library(desk *d, sonde_error *error) {
  char path[DESK_PATH];
  sonde_status status = sonde_case_list(d->cases, &d->case_list, &d->case_count, error);
  if (!status)
    status = sonde_exam_protocol_list(d->protocols, &d->protocol_list, &d->protocol_count, error);
  if (!status) status = sonde_directory_make(d->exams, 0700, true, error);
  if (status) return status;
  return sonde_exam_log_open(desk_path(path, d->exams, "exams.sqlite"), &d->log, error);
}

static sonde_status create_probes(desk *d, sonde_error *error) {
  const char *const *names = d->def.practice.probe_names;
  if (!names) names = sonde_probe_names();
  uint32_t count = 0;
  while (names[count]) ++count;
  d->probes = calloc(count, sizeof *d->probes);
  if (!d->probes) return app_error(error, SONDE_MEMORY, "out of memory");
  for (uint32_t i = 0; i < count; ++i) {
    sonde_status status = sonde_probe_create(names[i], &d->probes[i], error);
    if (status) return status;
    d->probe_count = i + 1;
  }
  return SONDE_OK;
}

static sonde_status create_page(desk *d, sonde_error *error) {
  char token[SONDE_PAGE_TOKEN], teacher[SONDE_PAGE_TOKEN];
  sonde_status status = page_token_find(d->exams, "page.token", "SONDE_PAGE_TOKEN", token, error);
  if (!status)
    status = page_token_find(d->exams, "teacher.token", "SONDE_TEACHER_TOKEN", teacher, error);
  if (status) return status;
  sonde_page_def page = {.port = d->def.port,
                         .token = token,
                         .teacher_token = teacher,
                         .model_path = d->def.model_path,
                         .force_limit_n = d->def.force_limit_n,
                         .exams_directory = d->exams,
                         .user = d,
                         .request = take_request};
  status = sonde_page_start(&page, d->session, &d->server, error);
  if (status) return status;
  desk_recovered found;
  desk_recover(d->exams, d->log, &found);
  if (found.unreadable)
    fprintf(stderr, "sonde run: %u of %u exams in %s cannot be read: %s\n", found.unreadable,
            found.exams, d->exams, found.worst);
  if (found.finished)
    fprintf(stderr,
            "sonde run: %u finished exams were not in the log; "
            "sonde exam --recover %s makes their reports\n",
            found.finished, d->exams);
  desk_tell_greeting(d);
  desk_tell_exam(d);
  return sonde_session_start(d->session, error);
}

sonde_status desk_create(const desk_def *def, desk **out, sonde_error *error) {
  desk *d = calloc(1, sizeof *d);
  *out = NULL;
  if (!d) return error->status = SONDE_MEMORY;
  d->def = *def;
  pthread_mutex_init(&d->lock, NULL);
  snprintf(d->cases, sizeof d->cases, "%s", def->cases);
  snprintf(d->protocols, sizeof d->protocols, "%s", def->protocols);
  snprintf(d->exams, sizeof d->exams, "%s", def->exams);
  snprintf(d->trainee, sizeof d->trainee, "%s", def->trainee);
  sonde_status status = create_library(d, error);
  if (!status) status = create_probes(d, error);
  if (!status) status = start_practice(d, error);
  if (!status) status = create_page(d, error);
  if (status)
    desk_destroy(d, NULL);
  else
    *out = d;
  return status;
}

void desk_address(const desk *d, bool teacher, char address[SONDE_PAGE_ADDRESS]) {
  sonde_page_address(d->server, teacher, address);
}

sonde_status desk_destroy(desk *d, sonde_error *error) {
  if (!d) return SONDE_OK;
  if (d->exam) d->exam->again_s = 0;
  desk_keep(d); // the last attempt
  sonde_page_stop(d->server);
  if (d->session) sonde_session_stop(d->session);
  sonde_status status = sonde_session_destroy(d->session, error);
  desk_exam_destroy(d->exam);
  desk_replay_destroy(d->replay);
  sonde_exam_log_close(d->log);
  for (uint32_t i = 0; i < d->probe_count; ++i) sonde_probe_clear(&d->probes[i]);
  free(d->probes);
  sonde_free(d->case_list);
  sonde_free(d->protocol_list);
  pthread_mutex_destroy(&d->lock);
  free(d);
  return status;
}
