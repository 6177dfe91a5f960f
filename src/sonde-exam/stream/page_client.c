// One WebSocket client: what it may say, and what it is told.
#include "stream/page_server.h"

#include "base/clock.h"
#include "base/maths.h"

#include <string.h>

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

void page_out_frame(page_out *out, int opcode, const void *body, size_t size, void *owned) {
  unsigned char head[PAGE_WS_HEAD_BYTES];
  *out = (page_out){.body = body, .body_size = size, .owned = owned};
  out->head_size = page_ws_write(head, opcode, size);
  memcpy(out->head, head, out->head_size);
}

static void drop_scene(page_client *client) {
  if (client->scene) page_scene_unref(client->scene);
  client->scene = NULL;
}

// Under the lock: the next message of a client, the most urgent first. An `out` without bytes:
// there is none. @return false when it could not be built
static bool take_message(page_client *client, page_out *out) {
  sonde_page_server *server = client->server;
  const page_source *source = &server->source;
  const page_role role = page_client_role(client), told = client->told_role;
  int topic = SONDE_PAGE_EXAM; // the first whose newest text the client has not got
  while (topic < SONDE_PAGE_STATUS &&
         (!server->topic[topic].text || client->told_topic[topic] == server->topic[topic].serial ||
          (topic == SONDE_PAGE_DRAFT && !client->teacher)))
    ++topic;
  const page_buffer *latest = &server->latest;
  const bool greeted = page_client_greeted(client);
  // Binary messages: the geometry behind the hello, one mesh or line at a time.
  if (greeted && client->scene && client->scene_next < client->scene->message_count) {
    const page_buffer *message = &client->scene->messages[client->scene_next++];
    page_out_frame(out, PAGE_WS_BINARY, message->bytes, message->size, NULL);
    return true;
  }
  drop_scene(client); // all of it is sent, or it is the scene of another source
  bool news = client->told_serial != server->controls_serial || told.is != role.is ||
              told.holder != role.holder || told.may != role.may || told.controls != role.controls;
  if (greeted && !news && topic == SONDE_PAGE_STATUS && !client->note_due && !client->pong_due) {
    if (latest->size == 0 || server->sequence <= client->sent[0] ||
        !page_client_wants_frame(client))
      return true;
    // The newest frame is copied for the sender and counted as in flight.
    if (!page_buffer_reserve(&client->out, latest->size)) return false;
    memcpy(client->out.bytes, latest->bytes, latest->size);
    client->out.size = latest->size;
    for (int i = PAGE_IN_FLIGHT - 1; i > 0; --i) client->sent[i] = client->sent[i - 1];
    client->sent[0] = server->sequence;
    ++client->frames;
    page_out_frame(out, PAGE_WS_BINARY, client->out.bytes, client->out.size, NULL);
    return true;
  }
  // Texts.
  sonde_json_out text = {.layout = SONDE_JSON_COMPACT};
  if (sonde_file_in_memory(&text.file, NULL)) return false;
  if (!greeted) {
    page_write_hello(&text, &(page_hello){source->model, source->probes, source->probe_count,
                                          source->force_limit_n,
                                          server->topic[SONDE_PAGE_GREETING].text, role.controls});
    client->greeted = server->generation;
    client->told_serial = 0;
    client->scene = server->scene;
    client->scene_next = 0;
    ++client->scene->references;
  } else if (news) {
    uint32_t probe = server->controls.probe;
    page_write_controls(
        &text, &server->controls, probe < source->probe_count ? source->probes[probe]->name : "",
        (page_hidden){server->hide_case, v_norm2(source->model->gravity.up) > 0, source->fan},
        server->gel_m3, role);
    client->told_serial = server->controls_serial;
    client->told_role = role;
  } else if (topic < SONDE_PAGE_STATUS) {
    sonde_file_printf(text.file, "%s", server->topic[topic].text);
    client->told_topic[topic] = server->topic[topic].serial;
  } else {
    sonde_json_begin_object(&text, NULL);
    sonde_json_put_text(&text, "type", client->note_due ? "error" : "pong");
    if (client->note_due)
      sonde_json_put_text(&text, "message", client->note);
    else
      sonde_json_put_integer(&text, "id", client->pong_id);
    sonde_json_end(&text);
    *(client->note_due ? &client->note_due : &client->pong_due) = false;
  }
  char *bytes = NULL;
  size_t count = 0;
  if (sonde_file_take(text.file, &bytes, &count, NULL)) return false;
  page_out_frame(out, PAGE_WS_TEXT, bytes, count, bytes);
  return true;
}

bool page_client_next(page_client *client, page_out *out) {
  sonde_page_server *server = client->server;
  pthread_mutex_lock(&server->lock);
  SONDE_ASSERT(out->head_size == 0 && client->here);
  if (!client->leaving && !take_message(client, out)) client->leaving = true;
  pthread_mutex_unlock(&server->lock);
  return out->head_size > 0;
}

page_client *page_client_join(sonde_page_server *server, const char *id, page_who who) {
  pthread_mutex_lock(&server->lock);
  page_client *client = NULL;
  const bool guest = who == PAGE_WATCHER;
  int alike = 0;
  for (int i = 0; i < PAGE_CLIENTS; ++i) {
    if (!server->client[i].here && !client) client = &server->client[i];
    alike += server->client[i].here && server->client[i].guest == guest;
  }
  if (alike >= (guest ? PAGE_GUESTS : PAGE_CLIENTS - PAGE_GUESTS)) client = NULL;
  if (client) {
    page_buffer kept = client->out; // the buffer serves the next client of the slot
    *client = (page_client){.server = server, .here = true, .out = kept};
    client->joined = ++server->joined;
    client->teacher = who == PAGE_TEACHER;
    client->guest = guest;
    snprintf(client->id, sizeof client->id, "%s", id);
    page_roles_join(client);
    client->tokens = PAGE_BURST;
    client->tokens_at_s = sonde_clock_now();
  }
  pthread_mutex_unlock(&server->lock);
  return client;
}

bool page_client_hear(page_client *client, const char *data, size_t size) {
  sonde_page_server *server = client->server;
  page_command command;
  sonde_error problem = {0};
  pthread_mutex_lock(&server->lock);
  bool stays = !client->leaving;
  // Messages come from a bucket of tokens that refills at PAGE_RATE_PER_S.
  double now_s = sonde_clock_now();
  client->tokens += (now_s - client->tokens_at_s) * PAGE_RATE_PER_S;
  client->tokens_at_s = now_s;
  if (client->tokens > PAGE_BURST) client->tokens = PAGE_BURST;
  if (stays && client->tokens < 1) {
    if (client->refused == 0) page_client_note(client, "too many messages per second");
    stays = ++client->refused < PAGE_REFUSED_MAX;
  } else if (stays) {
    client->tokens -= 1;
    if (page_parse_command(data, size, &command, &problem)) {
      page_client_note(client, problem.message);
    } else if (command.type == PAGE_COMMAND_ACK) {
      // Acknowledgements of frames that were never sent are ignored.
      if (command.id > client->acked && command.id <= client->sent[0]) client->acked = command.id;
    } else if (command.type == PAGE_COMMAND_PING) {
      client->pong_id = command.id;
      client->pong_due = true;
    } else {
      page_command_apply(server, client, &command);
    }
  }
  pthread_mutex_unlock(&server->lock);
  return stays;
}

void page_client_leave(page_client *client, double heard_s) {
  sonde_page_server *server = client->server;
  pthread_mutex_lock(&server->lock);
  drop_scene(client);
  page_roles_leave(client, heard_s);
  pthread_mutex_unlock(&server->lock);
}
