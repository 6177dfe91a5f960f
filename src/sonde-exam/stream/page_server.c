// The page's server: start, the pump of frames, commands, stop.
#include "stream/page_server.h"

#include "base/clock.h"

#include <math.h>
#include <string.h>

// Encodes into `spare` and makes it the newest.
static bool publish_frame(sonde_page_server *server, const sonde_frame *whole) {
  sonde_frame told = *whole;
  if (server->hide_areas) {
    told.snapshot.vein_area_ratio = told.snapshot.artery_area_ratio = (double)NAN;
    told.snapshot.vein_short_m = (double)NAN;
  }
  const sonde_mesh *rest = &server->source.model->surface;
  page_buffer *spare = &server->spare;
  size_t size = page_encode_frame(&told, rest, server->sequence + 1, NULL, 0);
  if (!page_buffer_reserve(spare, size)) return false;
  spare->size = page_encode_frame(&told, rest, server->sequence + 1, spare->bytes, spare->capacity);
  pthread_mutex_lock(&server->lock);
  // Under the lock. It dries slowly: clients are told of a change that they could see.
  const double visible_m3 = 0.25e-6;
  bool same = fabs(told.snapshot.gel_volume_m3 - server->gel_m3) < visible_m3 ||
              (isnan(told.snapshot.gel_volume_m3) && isnan(server->gel_m3));
  if (!same) {
    server->gel_m3 = told.snapshot.gel_volume_m3;
    ++server->controls_serial;
  }
  page_buffer newest = *spare;
  *spare = server->latest;
  server->latest = newest;
  ++server->sequence;
  page_wake(server);
  pthread_mutex_unlock(&server->lock);
  return true;
}

static void *pump_run(void *argument) {
  sonde_page_server *server = argument;
  for (;;) {
    pthread_mutex_lock(&server->lock);
    bool stopping = server->stopping;
    pthread_mutex_unlock(&server->lock);
    if (stopping) return NULL;
    pthread_mutex_lock(&server->source_lock);
    // Only frames that are waited for are taken.
    const page_source *source = &server->source;
    bool waits = false;
    pthread_mutex_lock(&server->lock);
    for (int i = 0; i < PAGE_CLIENTS; ++i)
      if (page_client_wants_frame(&server->client[i])) waits = true;
    pthread_mutex_unlock(&server->lock);
    sonde_frame frame;
    bool sent = source->frame && waits && source->frame(source->self, &frame) &&
                publish_frame(server, &frame);
    double pause_s = sent ? 0.002 : 0.005;
    pthread_mutex_unlock(&server->source_lock);
    sonde_clock_sleep_until(sonde_clock_now() + pause_s);
  }
}

static void apply_controls(sonde_page_server *server, page_client *client,
                           const page_command *command) {
  sonde_session_controls next = server->controls;
  const page_source *source = &server->source;
  if (command->probe[0]) {
    uint32_t i = 0;
    while (i < source->probe_count && strcmp(source->probes[i]->name, command->probe) != 0) ++i;
    if (i == source->probe_count) {
      page_client_note(client, "there is no probe of that name");
      return;
    }
    next.probe = i;
  }
  if (command->pathology[0] && server->hide_case) {
    page_client_note(client, "the case is the exam's");
    return;
  }
  if (command->pathology[0] && sonde_pathology_preset(command->pathology, &next.pathology, NULL)) {
    page_client_note(client, "there is no case of that name");
    return;
  }
  if (command->posture[0] && !page_posture_parse(command->posture, &next.posture)) {
    page_client_note(client, "a posture is supine, sitting or standing");
    return;
  }
  page_command_take(command, &next);
  server->controls = next;
}

void page_command_apply(sonde_page_server *server, page_client *client,
                        const page_command *command) {
  const page_source *source = &server->source;
  // Everyone who was let in may stop, ask for control, comment and list, a teacher edits cases; the
  // rest is for the client that controls.
  const sonde_page_ask ask = command->request.ask;
  if (command->type == PAGE_COMMAND_REQUEST && ask == SONDE_PAGE_EDIT && !client->teacher) {
    page_client_note(client, "cases are edited from the teacher's address");
    return;
  }
  bool is_free =
      command->type == PAGE_COMMAND_REQUEST
          ? ask == SONDE_PAGE_COMMENT || ask == SONDE_PAGE_LIST_EXAMS || ask == SONDE_PAGE_EDIT
          : command->type == PAGE_COMMAND_STOP || command->type == PAGE_COMMAND_ROLE;
  if (!is_free && !page_client_controls(client)) {
    page_client_note(client, "another page controls the probe; this one only watches");
    return;
  }
  if (command->type == PAGE_COMMAND_ROLE) {
    page_roles_act(client, command->action);
    return;
  }
  if (command->type == PAGE_COMMAND_REQUEST) {
    if (server->def.request) server->def.request(server->def.user, &command->request);
    return;
  }
  if (command->type == PAGE_COMMAND_GOAL) { // a goal of the moment before is no mistake
    if (source->goal) source->goal(source->self, command->goal);
    return;
  }
  if (!source->control) {
    page_client_note(client, "what is shown is a replay or a thigh at rest: no control acts on it");
    return;
  }
  if (command->type == PAGE_COMMAND_CONTROLS) {
    apply_controls(server, client, command);
  } else if (command->type == PAGE_COMMAND_GEL) {
    server->controls.gel_put += command->gel_put;
    server->controls.gel_wipe += command->gel_wipe;
  } else if (command->type == PAGE_COMMAND_HAND) {
    server->controls.squeeze += command->squeeze;
    server->controls.deep_breath += command->deep_breath;
  } else if (command->type == PAGE_COMMAND_STOP) {
    server->controls.stop = true;
  } else {
    SONDE_ASSERT(command->type == PAGE_COMMAND_RESUME);
    server->controls.stop = false;
    ++server->controls.resume;
  }
  ++server->controls_serial;
  source->control(source->self, &server->controls);
}

// The scene is encoded before the locks are taken; a frame of the scene before is never shown with
// this one.
sonde_status page_server_show(sonde_page_server *server, const page_source *source,
                              sonde_error *error) {
  page_scene *scene = page_scene_create(source);
  if (!scene) return sonde_fail_memory(error);
  pthread_mutex_lock(&server->source_lock);
  pthread_mutex_lock(&server->lock);
  page_source before = server->source;
  page_scene_unref(server->scene);
  server->source = *source;
  server->scene = scene;
  ++server->generation;
  server->latest.size = 0;
  if (source->controls_now) server->controls = source->controls_now(source->self);
  ++server->controls_serial;
  page_wake(server);
  pthread_mutex_unlock(&server->lock);
  pthread_mutex_unlock(&server->source_lock);
  if (before.release) before.release(before.self);
  return SONDE_OK;
}

sonde_status sonde_page_show_model(sonde_page_server *server, const sonde_model *model,
                                   const sonde_probe *probes, uint32_t probe_count,
                                   sonde_error *error) {
  SONDE_ASSERT(server && model && (probes || probe_count == 0));
  const sonde_probe **list = SONDE_NEW(const sonde_probe *, probe_count + 1);
  if (!list) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < probe_count; ++i) list[i] = &probes[i];
  page_source source = {.self = list,
                        .model = model,
                        .probes = list,
                        .probe_count = probe_count,
                        .force_limit_n = server->source.force_limit_n,
                        .release = sonde_free};
  sonde_status status = page_server_show(server, &source, error);
  if (status) sonde_free(list);
  return status;
}

bool sonde_page_post(sonde_page_server *server, const sonde_frame *frame,
                     const sonde_session_controls *controls) {
  SONDE_ASSERT(server && frame && controls);
  pthread_mutex_lock(&server->source_lock);
  pthread_mutex_lock(&server->lock);
  bool changed = memcmp(&server->controls, controls, sizeof *controls) != 0;
  server->controls = *controls;
  if (changed) ++server->controls_serial;
  pthread_mutex_unlock(&server->lock);
  bool posted = publish_frame(server, frame);
  pthread_mutex_unlock(&server->source_lock);
  return posted;
}

sonde_status sonde_page_publish(sonde_page_server *server, sonde_page_topic topic, const char *json,
                                sonde_error *error) {
  SONDE_ASSERT(server && topic < SONDE_PAGE_TOPICS);
  size_t size = json ? strlen(json) + 1 : 0;
  char *copy = json ? SONDE_NEW(char, size) : NULL;
  if (json && !copy) return sonde_fail_memory(error);
  if (json) memcpy(copy, json, size);
  pthread_mutex_lock(&server->lock);
  page_topic *slot = &server->topic[topic];
  bool same = json && slot->text && strcmp(json, slot->text) == 0;
  if (!same) {
    char *before = slot->text;
    slot->text = copy;
    ++slot->serial;
    copy = before;
    page_wake(server);
  }
  pthread_mutex_unlock(&server->lock);
  sonde_free(copy);
  return SONDE_OK;
}

void sonde_page_conceal(sonde_page_server *server, bool pathology, bool areas) {
  pthread_mutex_lock(&server->source_lock);
  pthread_mutex_lock(&server->lock);
  server->hide_case = pathology;
  server->hide_areas = areas;
  ++server->controls_serial;
  page_wake(server);
  pthread_mutex_unlock(&server->lock);
  pthread_mutex_unlock(&server->source_lock);
}

void sonde_page_tell(sonde_page_server *server, const char *sentence) {
  pthread_mutex_lock(&server->lock);
  for (int i = 0; i < PAGE_CLIENTS; ++i)
    if (server->client[i].here) page_client_note(&server->client[i], sentence);
  page_wake(server);
  pthread_mutex_unlock(&server->lock);
}

static sonde_status copy_token(char kept[PAGE_SECRET_TEXT], const char *token, sonde_error *error) {
  if (!token) return sonde_page_token_make(kept, error);
  if (!sonde_page_token_valid(token))
    return sonde_fail(error, SONDE_ARGUMENT, "a page's token must have %d digits from 0-9a-f",
                      SONDE_PAGE_TOKEN - 1);
  snprintf(kept, PAGE_SECRET_TEXT, "%s", token);
  return SONDE_OK;
}

sonde_status page_server_start(const sonde_page_def *def, const page_source *source,
                               sonde_page_server **server_out, sonde_error *error) {
  SONDE_ASSERT(def && source && server_out && source->model && source->frame && source->goal);
  *server_out = NULL;
  sonde_page_server *server = SONDE_NEW(sonde_page_server, 1);
  if (!server) return sonde_fail_memory(error);
  server->def = *def;
  if (def->data_directory)
    snprintf(server->data_directory, sizeof server->data_directory, "%s", def->data_directory);
  if (def->exams_directory)
    snprintf(server->exams_directory, sizeof server->exams_directory, "%s", def->exams_directory);
  server->def.data_directory = server->def.exams_directory = server->def.model_path = NULL;
  server->def.token = server->def.teacher_token = server->def.watcher_token = NULL;
  server->patience = (page_patience){
      .ask_s = 10, .answer_s = 30, .end_s = 2, .ping_s = 2, .silent_s = 6, .return_s = 60};
  pthread_mutex_init(&server->lock, NULL);
  pthread_mutex_init(&server->source_lock, NULL);
  server->listener = server->wake = -1;
  for (int i = 0; i < PAGE_CONNECTIONS; ++i) server->connection[i].socket = -1;
  sonde_status status = copy_token(server->token, def->token, error);
  if (!status) status = copy_token(server->teacher_token, def->teacher_token, error);
  if (!status && def->watcher_token)
    status = copy_token(server->watcher_token, def->watcher_token, error);
  if (!status) status = page_net_open(server, def->port, error);
  if (!status) status = page_server_show(server, source, error);
  if (!status) status = page_net_start(server, error);
  if (!status) {
    server->pump_runs = pthread_create(&server->pump, NULL, pump_run, server) == 0;
    if (!server->pump_runs) status = sonde_fail(error, SONDE_MEMORY, "a thread could not start");
  }
  if (status) {
    server->source.release = NULL; // still the caller's
    sonde_page_stop(server);
  } else {
    *server_out = server;
  }
  return status;
}

void sonde_page_address(const sonde_page_server *server, bool teacher,
                        char address[SONDE_PAGE_ADDRESS]) {
  SONDE_ASSERT(server && address);
  snprintf(address, SONDE_PAGE_ADDRESS, "http://127.0.0.1:%u/#%s", (unsigned)server->port,
           teacher ? server->teacher_token : server->token);
}

void sonde_page_link(const sonde_page_server *server, const char *path,
                     char link[SONDE_PAGE_LINK]) {
  char key[PAGE_SECRET_TEXT];
  SONDE_ASSERT(server && path && link && strlen(path) < PAGE_PATH_TEXT);
  page_document_key(server->token, path, key);
  snprintf(link, SONDE_PAGE_LINK, "%s?key=%s", path, key);
}

uint32_t page_server_clients(sonde_page_server *server) {
  SONDE_ASSERT(server);
  uint32_t count = 0;
  pthread_mutex_lock(&server->lock);
  for (int i = 0; i < PAGE_CLIENTS; ++i)
    if (server->client[i].here) ++count;
  pthread_mutex_unlock(&server->lock);
  return count;
}

void sonde_page_stop(sonde_page_server *server) {
  if (!server) return;
  pthread_mutex_lock(&server->lock);
  server->stopping = true;
  pthread_mutex_unlock(&server->lock);
  if (server->pump_runs) pthread_join(server->pump, NULL);
  page_net_stop(server);
  for (int i = 0; i < PAGE_CLIENTS; ++i) sonde_free(server->client[i].out.bytes);
  sonde_free(server->latest.bytes);
  sonde_free(server->spare.bytes);
  pthread_mutex_destroy(&server->lock);
  pthread_mutex_destroy(&server->source_lock);
  page_scene_unref(server->scene);
  for (int i = 0; i < SONDE_PAGE_TOPICS; ++i) sonde_free(server->topic[i].text);
  if (server->source.release) server->source.release(server->source.self);
  sonde_free(server);
}
