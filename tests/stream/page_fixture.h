// A page's server with a synthetic source: it counts what reaches it.
#ifndef SONDE_TESTS_STREAM_PAGE_FIXTURE_H
#define SONDE_TESTS_STREAM_PAGE_FIXTURE_H

#include "stream/ws_client.h"

#include "base/clock.h"
#include "stream/page_server.h"

#include <stdatomic.h>

enum { NODES = 3, WIDTH = 256, HEIGHT = 256 };

// A condition that does not come fails a test after this time; a busy machine takes less.
enum { PATIENCE_S = 120 };

typedef struct synthetic {
  sonde_vec3 points[NODES];
  uint32_t faces[1][3];
  float skin[3 * NODES];
  uint8_t pixels[WIDTH * HEIGHT];
  sonde_model model;
  sonde_probe probe[2];
  const sonde_probe *probes[2];
  atomic_uint frames, goals, controls;
  sonde_pose goal;
  sonde_session_controls last;
} synthetic;

static inline bool next_frame(void *self, sonde_frame *frame) {
  synthetic *s = self;
  *frame = (sonde_frame){.skin_m = s->skin,
                         .pixels = s->pixels,
                         .width = WIDTH,
                         .height = HEIGHT,
                         .width_m = 0.06,
                         .height_m = 0.07};
  frame->snapshot.tick = atomic_fetch_add(&s->frames, 1) + 1;
  return true;
}
static inline void note_goal(void *self, sonde_pose pose) {
  synthetic *s = self;
  s->goal = pose;
  atomic_fetch_add(&s->goals, 1);
}
static inline void note_controls(void *self, const sonde_session_controls *controls) {
  synthetic *s = self;
  s->last = *controls;
  atomic_fetch_add(&s->controls, 1);
}
static inline sonde_session_controls first_controls(void *self) {
  (void)self;
  sonde_session_controls controls = {.echo = sonde_echo_settings_default()};
  assert_int_equal(sonde_pathology_preset("healthy", &controls.pathology, NULL), SONDE_OK);
  return controls;
}

typedef struct fixture {
  synthetic source;
  sonde_page_server *server;
  uint16_t port;
  char directory[64]; // of exams
  atomic_uint requests;
  sonde_page_request request; // the last one
} fixture;

static inline page_source source_of(synthetic *s) {
  return (page_source){s,         &s->model,     s->probes,      2,   40, false, next_frame,
                       note_goal, note_controls, first_controls, NULL};
}

static inline void note_request(void *user, const sonde_page_request *request) {
  fixture *f = user;
  f->request = *request;
  atomic_fetch_add(&f->requests, 1);
}

// One server for all tests. Each test starts with the source shown
// anew, no client, no text and counters at zero.
static inline int start_server(void **state) {
  fixture *f = SONDE_NEW(fixture, 1);
  synthetic *s = &f->source;
  s->faces[0][1] = 1;
  s->faces[0][2] = 2;
  s->model.surface = (sonde_mesh){NODES, 1, s->points, s->faces};
  snprintf(s->model.name, sizeof s->model.name, "Test thigh");
  snprintf(s->probe[0].name, sizeof s->probe[0].name, "point");
  snprintf(s->probe[1].name, sizeof s->probe[1].name, "linear");
  for (int i = 0; i < 2; ++i) s->probes[i] = &s->probe[i];
  page_source source = source_of(s);
  snprintf(f->directory, sizeof f->directory, "/tmp/sonde-exams-XXXXXX");
  if (!mkdtemp(f->directory)) return -1;
  sonde_page_def def = {.token = WS_TOKEN,
                        .watcher_token = WS_GUEST,
                        .exams_directory = f->directory,
                        .user = f,
                        .request = note_request};
  if (page_server_start(&def, &source, &f->server, NULL)) return -1;
  f->port = f->server->port;
  *state = f;
  return 0;
}

static inline int stop_server(void **state) {
  fixture *f = *state;
  sonde_page_stop(f->server);
  char path[128];
  snprintf(path, sizeof path, "%s/2026-a1/report.html", f->directory);
  unlink(path);
  snprintf(path, sizeof path, "%s/2026-a1", f->directory);
  rmdir(path);
  rmdir(f->directory);
  sonde_free(f);
  return 0;
}

static inline void set_patience(fixture *f, page_patience patience) {
  pthread_mutex_lock(&f->server->lock);
  f->server->patience = patience;
  pthread_mutex_unlock(&f->server->lock);
}

static inline void wait_for_clients(fixture *f, uint32_t count) {
  double end_s = sonde_clock_now() + PATIENCE_S;
  while (page_server_clients(f->server) != count && sonde_clock_now() < end_s) usleep(2000);
  assert_int_equal(page_server_clients(f->server), count);
}

static inline int set_up(void **state) {
  fixture *f = *state;
  page_source source = source_of(&f->source);
  wait_for_clients(f, 0);
  for (int i = 0; i < SONDE_PAGE_TOPICS; ++i)
    sonde_page_publish(f->server, (sonde_page_topic)i, NULL, NULL);
  if (page_server_show(f->server, &source, NULL)) return -1;
  atomic_store(&f->source.goals, 0);
  atomic_store(&f->source.controls, 0);
  atomic_store(&f->requests, 0);
  return 0;
}

// True as soon as *counter reaches the value, false when patience ends.
static inline bool reaches(atomic_uint *counter, unsigned value) {
  double end_s = sonde_clock_now() + PATIENCE_S;
  while (atomic_load(counter) < value && sonde_clock_now() < end_s) usleep(2000);
  return atomic_load(counter) >= value;
}

// `lines` are header fields, each with its end.
static inline int get_with(uint16_t port, const char *method, const char *path, const char *host,
                           const char *lines, char *head) {
  char request[512];
  snprintf(request, sizeof request, "%s %s HTTP/1.1\r\nHost: %s\r\n%s\r\n", method, path, host,
           lines);
  int s = tcp_connect(port, 0);
  int code = http_head(s, request, head, 2048);
  close(s);
  return code;
}

static inline int get(uint16_t port, const char *method, const char *path, const char *host,
                      char *head) {
  return get_with(port, method, path, host, "", head);
}

#define SERVER_TEST(name) cmocka_unit_test_setup(name, set_up)

#endif
