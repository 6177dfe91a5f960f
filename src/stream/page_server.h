// Inside of the page server: who sends what when. The lock guards everything below it.
//
// Threads: the server's workers (HTTP and one per WebSocket) parse and set marks; one pump takes
// the session's newest frame and encodes it; one sender per client writes to its socket, so that a
// slow client blocks nobody. A client holds at most PAGE_IN_FLIGHT unacknowledged frames; newer
// frames replace the one in `latest`, so no queue can grow.
#ifndef SONDE_SRC_STREAM_PAGE_SERVER_H
#define SONDE_SRC_STREAM_PAGE_SERVER_H

#include "sonde/stream.h"
#include "stream/page_message.h"

#include <civetweb.h>
#include <pthread.h>

enum {
  PAGE_CLIENTS = 4,
  PAGE_IN_FLIGHT = 2,
  PAGE_RATE_PER_S = 300,   // messages per second that a client may send
  PAGE_BURST = 600,        // and at once
  PAGE_REFUSED_MAX = 2000, // messages beyond the rate before the connection is closed
};

typedef struct page_buffer {
  unsigned char *bytes;
  size_t size, capacity;
} page_buffer;

// What the server serves: a session, or a synthetic source in the tests.
typedef struct page_source {
  void *self;
  const sonde_model *model;
  const sonde_probe *const *probes; // [probe_count]
  uint32_t probe_count;
  double force_limit_n;
  bool (*frame)(void *self, sonde_frame *frame); // called by the pump only
  void (*goal)(void *self, sonde_pose pose);     // these three: one thread at a time
  void (*control)(void *self, const sonde_session_controls *controls);
  sonde_session_controls (*controls_now)(void *self);
  void (*release)(void *self); // frees self when it is no longer shown; may be NULL
} page_source;

// Geometry of a source, encoded once. Shared by the senders, so that a slow one holds up nobody.
typedef struct page_scene {
  uint32_t references; // under the lock
  uint32_t message_count;
  page_buffer *messages; // [message_count]
} page_scene;

typedef struct page_client {
  sonde_page_server *server;
  struct mg_connection *connection; // NULL: free slot
  pthread_t sender;
  bool leaving;
  uint64_t joined;      // order of arrival; the smallest controls
  uint32_t greeted;     // generation whose hello and geometry were sent; 0: none
  uint32_t told_serial; // of the controls
  uint32_t told_topic[SONDE_PAGE_TOPICS];
  bool told_control; // what it was told about its role
  bool pong_due, note_due;
  uint32_t pong_id;
  char note[200];
  uint32_t sent[PAGE_IN_FLIGHT]; // sequence numbers, newest first
  uint32_t acked;
  uint64_t frames;            // sent in all
  page_buffer out;            // the sender's own copy of a frame
  double tokens, tokens_at_s; // of the rate limit
  uint32_t refused;
} page_client;

// Newest text of a topic.
typedef struct page_topic {
  char *text; // NULL: none
  uint32_t serial;
} page_topic;

struct sonde_page_server {
  sonde_page_def def;
  pthread_mutex_t source_lock; // the pump and sonde_page_show; taken before the lock
  page_source source;          // changed under both locks
  bool hide_areas;             // under the source's lock
  page_scene *scene;           // of source
  uint32_t generation;         // counts scenes, from 1
  page_topic topic[SONDE_PAGE_TOPICS];
  char exams_directory[512]; // empty: none
  char data_directory[512];  // empty: serve from memory
  struct mg_context *http;
  uint16_t port;
  pthread_t pump;
  pthread_mutex_t lock;
  pthread_cond_t news;
  bool stopping, pump_runs;
  page_buffer latest, spare; // newest encoded frame (size 0: none of this scene); the pump writes
                             // into spare and swaps
  uint32_t sequence;         // of latest; 0: none yet
  sonde_session_controls controls;
  bool hide_case;
  double gel_m3; // told to the clients; NaN without gel
  uint32_t controls_serial;
  uint64_t joined;
  page_client client[PAGE_CLIENTS];
};

// Encodes the geometry of a source; one reference. NULL without memory.
page_scene *page_scene_create(const page_source *source);
// Under the lock.
void page_scene_unref(page_scene *scene);

// Shows a source; on failure the one before stays and this one is not released.
sonde_status page_server_show(sonde_page_server *server, const page_source *source,
                              sonde_error *error);
// Starts a server for a source; sonde_page_stop() ends it and releases the source.
sonde_status page_server_start(const sonde_page_def *def, const page_source *source,
                               sonde_page_server **server, sonde_error *error);

// Answers requests other than the WebSocket (civetweb's begin_request callback).
int page_http_request(struct mg_connection *connection);
// Only the loopback names with our port pass; a browser that was lured by a foreign name sends that
// name as Host (DNS rebinding).
bool page_host_allowed(const char *host, uint16_t port);
// An absent Origin (not a browser) passes; a present one must be this very page.
bool page_origin_allowed(const char *origin, uint16_t port);

// WebSocket handlers.
int page_client_connect(const struct mg_connection *connection, void *server);
void page_client_ready(struct mg_connection *connection, void *server);
int page_client_data(struct mg_connection *connection, int bits, char *data, size_t size,
                     void *server);
void page_client_close(const struct mg_connection *connection, void *server);

// Under the lock.
bool page_client_controls(const page_client *client);
bool page_client_greeted(const page_client *client);
bool page_client_wants_frame(const page_client *client);
bool page_buffer_reserve(page_buffer *buffer, size_t capacity);

// What a command does; the lock is held.
void page_command_apply(sonde_page_server *server, page_client *client,
                        const page_command *command);
void page_client_note(page_client *client, const char *sentence);

#endif
