// Inside of the page server: who sends what when. The lock guards everything below it.
//
// Threads: one takes the session's newest frame and encodes it (the pump); one owns every socket
// and never waits for a single one of them (page_net.c), so that no client blocks another. A client
// holds at most PAGE_IN_FLIGHT unacknowledged frames; newer frames replace the one in `latest`, so
// no queue can grow. A connection buffers at most PAGE_HEAD_BYTES of what it receives.
#ifndef SONDE_SRC_STREAM_PAGE_SERVER_H
#define SONDE_SRC_STREAM_PAGE_SERVER_H

#include "sonde/stream.h"
#include "stream/page_frame.h"
#include "stream/page_message.h"
#include "stream/page_request.h"
#include "stream/page_secret.h"

#include <pthread.h>

enum {
  PAGE_CLIENTS = 6,
  PAGE_GUESTS = 2, // of them, who came with the watcher's token: they take nobody else's place
  PAGE_CONNECTIONS = 128, // of all kinds; the oldest that is no client makes room for another
  PAGE_REPLY_HEAD = 1024, // bytes, head of an answer
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
  bool fan;                                      // the scanner's face is curved
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

// What a socket is being sent: a head, then a body. The body is borrowed unless `owned` is set.
typedef struct page_out {
  char head[PAGE_REPLY_HEAD];
  size_t head_size, body_size, done; // bytes; `done` counts head and body
  const void *body;
  void *owned;   // freed when all is sent
  size_t mapped; // bytes of `owned` when it is a file in memory; 0: it is allocated
} page_out;

typedef struct page_client {
  sonde_page_server *server;
  bool here;                 // false: free slot
  bool leaving;              // to be closed
  uint64_t joined;           // order of arrival
  char id[PAGE_SECRET_TEXT]; // that its page chose, the same after a reload; empty: none
  bool teacher, guest;       // came with the teacher's, with the watcher's token
  uint32_t greeted;          // generation whose hello was sent; 0: none
  page_scene *scene;         // geometry under way; one reference; NULL: none
  uint32_t scene_next;       // its message to be sent next
  uint32_t told_serial;      // of the controls
  uint32_t told_topic[SONDE_PAGE_TOPICS];
  page_role told_role;
  bool pong_due, note_due;
  uint32_t pong_id;
  char note[200];
  uint32_t sent[PAGE_IN_FLIGHT]; // sequence numbers, newest first
  uint32_t acked;
  uint64_t frames;            // sent in all
  page_buffer out;            // its own copy of a frame
  double tokens, tokens_at_s; // of the rate limit
  uint32_t refused;
} page_client;

// What a connection does: it asks (the head of its request comes), it is answered, it talks (a
// WebSocket), or it ends: nothing is sent to it any more, what it still sends is thrown away.
typedef enum page_stage { PAGE_ASKS, PAGE_ANSWERED, PAGE_TALKS, PAGE_ENDS } page_stage;

// A socket. Belongs to the thread of page_net.c.
typedef struct page_connection {
  int socket; // -1: free
  page_stage stage;
  double stage_s, heard_s, pinged_s; // when the stage began, a byte came, a ping was sent
  uint64_t accepted;                 // order of arrival
  unsigned char *in;                 // [PAGE_HEAD_BYTES] received, not yet used
  size_t in_count;
  page_out out;
  page_client *client;     // of a WebSocket
  bool pong_due;           // answer to a ping
  unsigned char pong[128]; // its payload
  size_t pong_size;
  int close_due; // status to close with; 0: none
} page_connection;

// How long a connection may take, s.
typedef struct page_patience {
  double ask_s;    // for the head of a request
  double answer_s; // to take the answer
  double end_s;    // to close
  double ping_s;   // a client that said nothing for so long is asked whether it is there
  double silent_s; // one that said nothing for so long is closed
  double return_s; // for the learner's page to come back, since it was heard last
} page_patience;

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
  char token[PAGE_SECRET_TEXT], teacher_token[PAGE_SECRET_TEXT];
  char watcher_token[PAGE_SECRET_TEXT]; // empty: nobody comes only to watch
  page_client *owner;                   // the learner's; NULL: gone
  page_client *borrower;                // who controls in the owner's place; NULL: nobody does
  char owner_id[PAGE_SECRET_TEXT];      // of the owner, also when it is gone
  double owner_until_s;                 // how long it is waited for
  page_patience patience;
  int listener, wake; // sockets; `wake` ends a wait of the sockets' thread
  uint16_t port;
  pthread_t pump, net;
  pthread_mutex_t lock;
  bool stopping, pump_runs, net_runs;
  page_buffer latest, spare; // newest encoded frame (size 0: none of this scene); the pump writes
                             // into spare and swaps
  uint32_t sequence;         // of latest; 0: none yet
  sonde_session_controls controls;
  bool hide_case;
  double gel_m3; // told to the clients; NaN without gel
  uint32_t controls_serial;
  uint64_t joined;
  page_client client[PAGE_CLIENTS];
  uint64_t accepted;                            // belongs to page_net.c, as do
  page_connection connection[PAGE_CONNECTIONS]; // these
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

// Wakes the sockets' thread: there is something to send. @thread any
uint32_t page_server_clients(sonde_page_server *server);
void page_wake(sonde_page_server *server);

// page_net.c: opens the port, then starts and ends the thread of the sockets.
sonde_status page_net_open(sonde_page_server *server, uint16_t port, sonde_error *error);
sonde_status page_net_start(sonde_page_server *server, sonde_error *error);
void page_net_stop(sonde_page_server *server);

// page_http.c: the answer to a whole head of a request; a request of the WebSocket that may come in
// is answered by 101 and sets *client, which then belongs to the connection.
void page_http_answer(sonde_page_server *server, const char *head, size_t size, page_out *out,
                      page_client **client);
// Body of an answer. `policy` NULL: the page's own; `owned` is freed when all is sent, NULL:
// nothing; `mapped` bytes of it are a file's, 0: it is allocated.
typedef struct page_body {
  const char *type, *policy;
  const void *bytes;
  size_t size, mapped;
  void *owned;
  bool gzip;
  bool shared; // scripts of any other site may read it: a secret in the request says whose it is
} page_body;
// Fills an answer with the security headers that all answers have.
void page_http_send(page_out *out, int code, const char *reason, const page_body *body);
// Refuses a request that is not even a head.
void page_http_refuse(page_out *out, int code);
// Only the loopback names with our port pass; a browser that was lured by a foreign name sends that
// name as Host (DNS rebinding).
bool page_host_allowed(const char *host, uint16_t port);
// An absent Origin (not a browser) passes; a present one must be this very page.
bool page_origin_allowed(const char *origin, uint16_t port);

// page_client.c. A new client, NULL when there is no free slot. Takes the lock.
page_client *page_client_join(sonde_page_server *server, const char *id, page_who who);
// A whole text message of a client; false ends the connection. Takes the lock.
bool page_client_hear(page_client *client, const char *data, size_t size);
// The message that is to be sent next; false when there is none. Takes the lock.
bool page_client_next(page_client *client, page_out *out);
// The connection, which was heard last at that time, is gone. Takes the lock.
void page_client_leave(page_client *client, double heard_s);
void page_out_frame(page_out *out, int opcode, const void *body, size_t size, void *owned);

// Under the lock.
bool page_client_controls(const page_client *client);
page_role page_client_role(const page_client *client);
void page_roles_join(page_client *client);
void page_roles_leave(page_client *client, double heard_s);
void page_roles_turn(sonde_page_server *server); // now and then: a wait may be over
void page_roles_act(page_client *client, page_may action);
bool page_client_greeted(const page_client *client);
bool page_client_wants_frame(const page_client *client);
bool page_buffer_reserve(page_buffer *buffer, size_t capacity);

// What a command does; the lock is held.
void page_command_apply(sonde_page_server *server, page_client *client,
                        const page_command *command);
void page_client_note(page_client *client, const char *sentence);

#endif
