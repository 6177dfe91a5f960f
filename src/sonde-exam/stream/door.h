// Inside of a class's door. One thread waits for all sockets and never for one; every connection
// has two buffers of fixed size, a limit for the time of each stage, and a place that a newer one
// may take until the learner's program has let it in.
#ifndef SONDE_SRC_STREAM_DOOR_H
#define SONDE_SRC_STREAM_DOOR_H

#include "sonde/stream_door.h"
#include "stream/page_server.h"

#include <openssl/ssl.h>
#include <stdatomic.h>

enum {
  DOOR_CONNECTIONS = 256,
  DOOR_BUFFER = 32768, // bytes on their way in one direction of a connection
};

// It greets (TLS), asks (the head of its request comes), joins (a code is looked at after a while),
// is relayed (to a learner's program), is answered (by the door itself), or ends: nothing more is
// sent, what still comes is thrown away.
typedef enum door_stage {
  DOOR_GREETS,
  DOOR_ASKS,
  DOOR_JOINS,
  DOOR_RELAYS,
  DOOR_ANSWERED,
  DOOR_ENDS
} door_stage;

typedef struct door_buffer {
  unsigned char bytes[DOOR_BUFFER];
  size_t from, to; // what is in it
} door_buffer;

typedef struct door_connection {
  int socket, inner; // of the client, -1: free place; of the learner's program, -1: none
  SSL *tls;
  bool tls_writes; // TLS waits for room in the socket
  door_stage stage;
  double accepted_s, stage_s, moved_s; // when it came, when the stage began, when a byte moved
  uint64_t accepted;                   // order of arrival
  uint32_t peer;                       // IPv4 address
  bool heard;                          // the learner's program has answered
  bool let_in;                         // by the learner's program, as a WebSocket
  bool inner_ended;
  door_buffer *in, *out; // to the program, to the client
  page_out answer;
  char name[SONDE_DOOR_NAME], code[SONDE_DOOR_CODE]; // of who joins
  bool watches;
} door_connection;

// What a learning management system may read a learner's results by; empty: nobody has linked one.
typedef struct door_ticket {
  char text[SONDE_DOOR_TICKET];
  int64_t since_unix_s; // when it was linked
} door_ticket;

struct sonde_door {
  sonde_door_def def;
  _Atomic double ask_s, code_s; // how long a client may greet and ask; until a code is looked at
  char code[SONDE_DOOR_CODE], teacher_token[PAGE_SECRET_TEXT];
  SSL_CTX *context;
  int listener, wake;
  uint16_t port;
  pthread_t thread;
  bool runs;
  atomic_bool stopping;
  atomic_uint_fast64_t wrong;
  pthread_mutex_t lock; // of the texts
  char *text[SONDE_DOOR_TEXTS];
  uint64_t accepted;   // this, the tickets and the connections belong to the thread
  door_ticket *ticket; // [def.places]
  door_connection connection[DOOR_CONNECTIONS];
};

// door_tls.c. A context with key and certificates from PEM; NULL with an error.
SSL_CTX *door_context_make(const char *identity, sonde_error *error);

// door_net.c: the thread.
void *door_run(void *door);
void door_enter(door_connection *c, door_stage stage);
// Connects to a learner's program; false: nobody listens there.
bool door_reach(door_connection *c, uint16_t port);

// door_http.c. A whole head of `size` bytes stands at the beginning of c->in: changes the stage.
void door_answer(sonde_door *door, door_connection *c, size_t size);
// Looks at the code of a connection that joins.
void door_admit(sonde_door *door, door_connection *c);
// An answer that is one sentence.
void door_refuse(door_connection *c, int code, const char *sentence);

#endif
