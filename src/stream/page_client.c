// One WebSocket client: what it may say, and its sender.
//
// page_client_controls, page_client_wants_frame   its role and its room for a frame
// find, claim, let_go       slots; a slot is found by its connection
// take_token                the rate limit
// acknowledge               a frame reached the screen
// next_job, do_job, run     the sender: one message at a time, the socket never under the lock
// page_client_*             civetweb's WebSocket handlers
#include "stream/page_server.h"

#include "base/clock.h"

#include <string.h>

enum { WS_TEXT = 1, WS_BINARY = 2, WS_CLOSE = 8 };

bool page_client_controls(const page_client *client) {
  const sonde_page_server *server = client->server;
  for (int i = 0; i < PAGE_CLIENTS; ++i) {
    const page_client *other = &server->client[i];
    if (other->connection && other->joined < client->joined) return false;
  }
  return true;
}

bool page_client_greeted(const page_client *client) {
  return client->greeted == client->server->generation;
}

bool page_client_wants_frame(const page_client *client) {
  return client->connection && page_client_greeted(client) && !client->leaving &&
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

static page_client *find(sonde_page_server *server, const struct mg_connection *connection) {
  for (int i = 0; i < PAGE_CLIENTS; ++i)
    if (server->client[i].connection == connection) return &server->client[i];
  return NULL;
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
  if (client->told_serial != server->controls_serial ||
      client->told_control != page_client_controls(client))
    return JOB_CONTROLS;
  if (due_topic(client) < SONDE_PAGE_TOPICS) return JOB_TOPIC;
  if (client->note_due) return JOB_NOTE;
  if (client->pong_due) return JOB_PONG;
  if (server->latest.size > 0 && server->sequence > client->sent[0] &&
      page_client_wants_frame(client))
    return JOB_FRAME;
  return JOB_NONE;
}

static bool send_message(page_client *client, int opcode, const void *bytes, size_t size) {
  SONDE_ASSERT(client->connection);
  return mg_websocket_write(client->connection, opcode, bytes, size) > 0;
}

// Sends and frees the text; false when it could not be built or sent.
static bool send_text(page_client *client, page_text *text) {
  bool sent = !text->failed && text->text && send_message(client, WS_TEXT, text->text, text->count);
  page_text_clear(text);
  return sent;
}

// The lock is held only while the hello is written.
static bool greet(page_client *client) {
  sonde_page_server *server = client->server;
  const page_source *source = &server->source;
  page_scene *scene = server->scene;
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
  ++scene->references;
  pthread_mutex_unlock(&server->lock);
  bool good = send_text(client, &text);
  for (uint32_t i = 0; good && i < scene->message_count; ++i)
    good = send_message(client, WS_BINARY, scene->messages[i].bytes, scene->messages[i].size);
  pthread_mutex_lock(&server->lock);
  page_scene_unref(scene);
  return good;
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

// Called with the lock held; it is released while the socket is written and held again on return.
static bool do_job(page_client *client, job what) {
  sonde_page_server *server = client->server;
  page_text text = {0};
  if (what == JOB_GREET) return greet(client);
  bool good = true, controls = page_client_controls(client);
  if (what == JOB_CONTROLS) {
    page_write_controls(&text, &server->controls, probe_name(server, server->controls.probe),
                        server->hide_case, server->gel_m3, controls);
    client->told_serial = server->controls_serial;
    client->told_control = controls;
  } else if (what == JOB_TOPIC) {
    int topic = due_topic(client);
    page_write_raw(&text, server->topic[topic].text);
    client->told_topic[topic] = server->topic[topic].serial;
  } else if (what == JOB_NOTE) {
    page_write_note(&text, "error", client->note);
    client->note_due = false;
  } else if (what == JOB_PONG) {
    page_write_pong(&text, client->pong_id);
    client->pong_due = false;
  } else if (what == JOB_FRAME) {
    good = take_frame(client);
  }
  pthread_mutex_unlock(&server->lock);
  if (what != JOB_FRAME)
    good = send_text(client, &text);
  else if (good)
    good = send_message(client, WS_BINARY, client->out.bytes, client->out.size);
  pthread_mutex_lock(&server->lock);
  return good;
}

static void *run(void *argument) {
  page_client *client = argument;
  sonde_page_server *server = client->server;
  pthread_mutex_lock(&server->lock);
  while (!client->leaving && !server->stopping) {
    job what = next_job(client);
    if (what == JOB_NONE)
      pthread_cond_wait(&server->news, &server->lock);
    else if (!do_job(client, what))
      client->leaving = true;
  }
  bool say_goodbye = server->stopping && !client->leaving;
  pthread_mutex_unlock(&server->lock);
  static const char GOING_AWAY[2] = {0x03, (char)0xE9}; // status 1001
  if (say_goodbye) send_message(client, WS_CLOSE, GOING_AWAY, sizeof GOING_AWAY);
  return NULL;
}

int page_client_connect(const struct mg_connection *connection, void *argument) {
  sonde_page_server *server = argument;
  if (!page_origin_allowed(mg_get_header(connection, "Origin"), server->port)) return 1;
  pthread_mutex_lock(&server->lock);
  bool full = !find(server, NULL) || server->stopping;
  pthread_mutex_unlock(&server->lock);
  return full ? 1 : 0;
}

void page_client_ready(struct mg_connection *connection, void *argument) {
  sonde_page_server *server = argument;
  pthread_mutex_lock(&server->lock);
  page_client *client = server->stopping ? NULL : find(server, NULL);
  if (client) {
    page_buffer kept = client->out; // the buffer serves the next client of the slot
    *client = (page_client){.server = server, .connection = connection, .out = kept};
    client->joined = ++server->joined;
    client->tokens = PAGE_BURST;
    client->tokens_at_s = sonde_clock_now();
    if (pthread_create(&client->sender, NULL, run, client) != 0) client->connection = NULL;
  }
  pthread_mutex_unlock(&server->lock);
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
    return size <= PAGE_COMMAND_BYTES;
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

int page_client_data(struct mg_connection *connection, int bits, char *data, size_t size,
                     void *argument) {
  sonde_page_server *server = argument;
  int opcode = bits & 0x0f;
  if (opcode >= WS_CLOSE) return opcode == WS_CLOSE ? 0 : 1; // ping and pong: civetweb answers
  bool whole = (bits & 0x80) != 0;
  pthread_mutex_lock(&server->lock);
  page_client *client = find(server, connection);
  bool keep =
      client && !client->leaving && whole && opcode == WS_TEXT && hear(server, client, data, size);
  pthread_cond_broadcast(&server->news);
  pthread_mutex_unlock(&server->lock);
  return keep ? 1 : 0;
}

void page_client_close(const struct mg_connection *connection, void *argument) {
  sonde_page_server *server = argument;
  pthread_mutex_lock(&server->lock);
  page_client *client = find(server, connection);
  if (client) client->leaving = true;
  pthread_cond_broadcast(&server->news);
  pthread_mutex_unlock(&server->lock);
  if (!client) return;
  pthread_join(client->sender, NULL); // the connection is invalid after this handler
  pthread_mutex_lock(&server->lock);
  client->connection = NULL;
  pthread_cond_broadcast(&server->news); // the next one may control now
  pthread_mutex_unlock(&server->lock);
}
