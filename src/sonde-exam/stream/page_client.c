// One WebSocket client: what it may say, and what it is told.
#include "stream/page_server.h"

#include "base/clock.h"

#include <string.h>

static bool same_role(page_role a, page_role b) {
  return a.is == b.is && a.holder == b.holder && a.may == b.may && a.controls == b.controls;
}

bool page_client_greeted(const page_client *client) {
  return client->greeted == client->server->generation;
}

bool page_client_wants_frame(const page_client *client) {
  return client->here && page_client_greeted(client) && !client->leaving &&
         client->sent[PAGE_IN_FLIGHT - 1] <= client->acked;
}

bool page_buffer_reserve(page_buffer *buffer, size_t capacity) {
  if (capacity <= buffer->capacity) return true;
  unsigned char *bytes = SONDE_NEW(unsigned char, capacity);
  if (!bytes) return false;
  sonde_free(buffer->bytes);
  *buffer = (page_buffer){bytes, 0, capacity};
  return true;
}

void page_client_note(page_client *client, const char *sentence) {
  snprintf(client->note, sizeof client->note, "%.*s", (int)sizeof client->note - 1, sentence);
  client->note_due = true;
}

// Messages come from a bucket that refills at PAGE_RATE_PER_S.
static bool take_token(page_client *client, double now_s) {
  client->tokens += (now_s - client->tokens_at_s) * PAGE_RATE_PER_S;
  client->tokens_at_s = now_s;
  if (client->tokens > PAGE_BURST) client->tokens = PAGE_BURST;
  if (client->tokens < 1) return false;
  client->tokens -= 1;
  return true;
}

// Acknowledgements of frames that were never sent are ignored.
static void acknowledge(page_client *client, uint32_t sequence) {
  if (sequence > client->acked && sequence <= client->sent[0]) client->acked = sequence;
}

typedef enum job {
  JOB_NONE,
  JOB_GREET,
  JOB_GEOMETRY,
  JOB_CONTROLS,
  JOB_TOPIC,
  JOB_NOTE,
  JOB_PONG,
  JOB_FRAME
} job;

// A topic whose newest text the client has not got, SONDE_PAGE_TOPICS when there is none.
static int due_topic(const page_client *client) {
  const sonde_page_server *server = client->server;
  for (int i = SONDE_PAGE_EXAM; i < SONDE_PAGE_STATUS; ++i)
    if (server->topic[i].text && client->told_topic[i] != server->topic[i].serial) return i;
  return SONDE_PAGE_TOPICS;
}

static job next_job(const page_client *client) {
  const sonde_page_server *server = client->server;
  if (!page_client_greeted(client)) return JOB_GREET;
  if (client->scene && client->scene_next < client->scene->message_count) return JOB_GEOMETRY;
  if (client->told_serial != server->controls_serial ||
      !same_role(client->told_role, page_client_role(client)))
    return JOB_CONTROLS;
  if (due_topic(client) < SONDE_PAGE_TOPICS) return JOB_TOPIC;
  if (client->note_due) return JOB_NOTE;
  if (client->pong_due) return JOB_PONG;
  if (server->latest.size > 0 && server->sequence > client->sent[0] &&
      page_client_wants_frame(client))
    return JOB_FRAME;
  return JOB_NONE;
}

void page_out_frame(page_out *out, int opcode, const void *body, size_t size, void *owned) {
  unsigned char head[PAGE_WS_HEAD_BYTES];
  *out = (page_out){.body = body, .body_size = size, .owned = owned};
  out->head_size = page_ws_write(head, opcode, size);
  memcpy(out->head, head, out->head_size);
}

// Hands the text over; false when it could not be built.
static bool send_text(page_out *out, page_text *text) {
  bool whole = !text->failed && text->text;
  if (whole)
    page_out_frame(out, PAGE_WS_TEXT, text->text, text->count, text->text);
  else
    page_text_clear(text);
  return whole;
}

static void drop_scene(page_client *client) {
  if (client->scene) page_scene_unref(client->scene);
  client->scene = NULL;
}

// The hello; the geometry follows, message by message.
static bool greet(page_client *client, page_out *out) {
  sonde_page_server *server = client->server;
  const page_source *source = &server->source;
  page_hello hello = {source->model,
                      source->probes,
                      source->probe_count,
                      source->force_limit_n,
                      server->topic[SONDE_PAGE_GREETING].text,
                      page_client_controls(client)};
  page_text text = {0};
  page_write_hello(&text, &hello);
  client->greeted = server->generation;
  client->told_serial = 0;
  drop_scene(client);
  client->scene = server->scene;
  client->scene_next = 0;
  ++client->scene->references;
  return send_text(out, &text);
}

static bool send_geometry(page_client *client, page_out *out) {
  const page_buffer *message = &client->scene->messages[client->scene_next++];
  page_out_frame(out, PAGE_WS_BINARY, message->bytes, message->size, NULL);
  return true;
}

static const char *probe_name(const sonde_page_server *server, uint32_t probe) {
  return probe < server->source.probe_count ? server->source.probes[probe]->name : "";
}

// Copies the newest frame for the sender and counts it as in flight.
static bool take_frame(page_client *client) {
  const page_buffer *latest = &client->server->latest;
  if (!page_buffer_reserve(&client->out, latest->size)) return false;
  memcpy(client->out.bytes, latest->bytes, latest->size);
  client->out.size = latest->size;
  for (int i = PAGE_IN_FLIGHT - 1; i > 0; --i) client->sent[i] = client->sent[i - 1];
  client->sent[0] = client->server->sequence;
  ++client->frames;
  return true;
}

// Under the lock.
static bool do_job(page_client *client, job what, page_out *out) {
  sonde_page_server *server = client->server;
  page_text text = {0};
  if (what == JOB_GREET) return greet(client, out);
  if (what == JOB_GEOMETRY) return send_geometry(client, out);
  drop_scene(client); // all of it is sent
  if (what == JOB_FRAME) {
    if (!take_frame(client)) return false;
    page_out_frame(out, PAGE_WS_BINARY, client->out.bytes, client->out.size, NULL);
    return true;
  }
  page_role role = page_client_role(client);
  if (what == JOB_CONTROLS) {
    page_write_controls(&text, &server->controls, probe_name(server, server->controls.probe),
                        server->hide_case, server->gel_m3, role);
    client->told_serial = server->controls_serial;
    client->told_role = role;
  } else if (what == JOB_TOPIC) {
    int topic = due_topic(client);
    page_write_raw(&text, server->topic[topic].text);
    client->told_topic[topic] = server->topic[topic].serial;
  } else if (what == JOB_NOTE) {
    page_write_note(&text, "error", client->note);
    client->note_due = false;
  } else {
    SONDE_ASSERT(what == JOB_PONG);
    page_write_pong(&text, client->pong_id);
    client->pong_due = false;
  }
  return send_text(out, &text);
}

bool page_client_next(page_client *client, page_out *out) {
  sonde_page_server *server = client->server;
  pthread_mutex_lock(&server->lock);
  job what = client->leaving ? JOB_NONE : next_job(client);
  if (what != JOB_NONE && !do_job(client, what, out)) {
    client->leaving = true;
    what = JOB_NONE;
  }
  pthread_mutex_unlock(&server->lock);
  return what != JOB_NONE;
}

page_client *page_client_join(sonde_page_server *server, const char *id, bool teacher) {
  pthread_mutex_lock(&server->lock);
  page_client *client = NULL;
  for (int i = 0; i < PAGE_CLIENTS && !client; ++i)
    if (!server->client[i].here) client = &server->client[i];
  if (client) {
    page_buffer kept = client->out; // the buffer serves the next client of the slot
    *client = (page_client){.server = server, .here = true, .out = kept};
    client->joined = ++server->joined;
    client->teacher = teacher;
    snprintf(client->id, sizeof client->id, "%s", id);
    page_roles_join(client);
    client->tokens = PAGE_BURST;
    client->tokens_at_s = sonde_clock_now();
  }
  pthread_mutex_unlock(&server->lock);
  return client;
}

// Under the lock. @return false to close the connection
static bool hear(sonde_page_server *server, page_client *client, const char *data, size_t size) {
  if (!take_token(client, sonde_clock_now())) {
    if (client->refused == 0) page_client_note(client, "too many messages per second");
    return ++client->refused < PAGE_REFUSED_MAX;
  }
  page_command command;
  sonde_error problem = {0};
  if (page_parse_command(data, size, &command, &problem)) {
    page_client_note(client, problem.message);
    return true;
  }
  if (command.type == PAGE_COMMAND_ACK) {
    acknowledge(client, command.id);
  } else if (command.type == PAGE_COMMAND_PING) {
    client->pong_id = command.id;
    client->pong_due = true;
  } else {
    page_command_apply(server, client, &command);
  }
  return true;
}

bool page_client_hear(page_client *client, const char *data, size_t size) {
  sonde_page_server *server = client->server;
  pthread_mutex_lock(&server->lock);
  bool keep = !client->leaving && hear(server, client, data, size);
  pthread_mutex_unlock(&server->lock);
  return keep;
}

void page_client_leave(page_client *client, double heard_s) {
  sonde_page_server *server = client->server;
  pthread_mutex_lock(&server->lock);
  drop_scene(client);
  page_roles_leave(client, heard_s);
  pthread_mutex_unlock(&server->lock);
}
