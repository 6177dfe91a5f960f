// The server of OpenIGTLink. Whoever posts a frame encodes it and offers it to every socket, none
// of which blocks; one thread waits with poll() for new clients, for what they say and for sockets
// that have room again. A frame that is being sent stays whole; of those behind it only the newest
// waits, so that nothing queues up and a client that does not read costs nobody else anything.
#include "sonde/stream_igtl.h"
#include "stream/igtl_message.h"
#include "stream/port.h"

#include "base/base.h"
#include "base/clock.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum {
  CLIENTS = SONDE_IGTL_CLIENTS + 1, // the last one is the reader that is pushed to
  PUSHED = CLIENTS - 1,
  FRAMES = CLIENTS + 2, // each client may hold one, beside the newest and the one being made
  ROUND_MS = 100,
  SEND_BUFFER = 1 << 19, // bytes; the kernel doubles it: frames in it are no longer the newest
  BODY_MOST = 1 << 24,   // bytes of a client's message
  READ_BYTES = 1 << 12,  // at once
  READS = 16,            // of a client in one round
};
static const double STUCK_S = 30;  // a client that takes nothing for so long is closed
static const double AGAIN_S = 1.0; // between two attempts to reach the reader that is pushed to

typedef struct encoded {
  uint32_t users;
  struct {
    unsigned char *bytes;
    size_t size, capacity; // size 0: not made
  } form[IGTL_VERSIONS];
} encoded;

typedef struct client {
  int socket;      // -1: free
  bool connecting; // to the reader that is pushed to
  bool lost;       // to be closed by the sockets' thread
  int version;     // that it is spoken to with
  // what it says
  unsigned char head[IGTL_HEAD_BYTES];
  size_t head_count;
  uint64_t skip; // bytes of a body that are still to come
  // what it is sent
  encoded *out, *next; // being sent; waiting
  int form;            // of `out`
  size_t done;         // bytes
  unsigned char reply[IGTL_REPLY_BYTES];
  size_t reply_size, reply_done;
  double moved_s; // when its socket took something, or nothing was due
} client;

struct sonde_igtl_server {
  igtl_crc crc;
  int listener, wake;
  uint16_t port;
  bool pushes;
  struct sockaddr_in push; // address of the reader that is pushed to
  double push_s;           // time of the next attempt
  double unix_s;           // time of day at time 0 of the clock
  pthread_t thread;
  bool runs;
  pthread_mutex_t lock; // guards what follows
  bool stopping;
  client client[CLIENTS];
  encoded frame[FRAMES];
  sonde_igtl_counts counts;
};

static void release(encoded **frame) {
  SONDE_ASSERT(!*frame || (*frame)->users > 0);
  if (*frame) --(*frame)->users;
  *frame = NULL;
}

// ---- what goes out, under the lock

static bool busy(const client *c) { return c->out || c->next || c->reply_done < c->reply_size; }

// Hands the socket what it takes. False: it is full, or lost.
static bool hand_over(client *c, const unsigned char *bytes, size_t size, size_t *done) {
  while (*done < size) {
    ssize_t sent = send(c->socket, bytes + *done, size - *done, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) {
      c->lost = errno != EAGAIN && errno != EWOULDBLOCK;
      return false;
    }
    *done += (size_t)sent;
    c->moved_s = sonde_clock_now();
  }
  return true;
}

// The frame that was begun, then an answer, then the newest frame.
static void feed(sonde_igtl_server *server, client *c) {
  if (c->socket < 0 || c->connecting || c->lost) return;
  for (;;) {
    if (c->out) {
      if (!hand_over(c, c->out->form[c->form].bytes, c->out->form[c->form].size, &c->done)) return;
      release(&c->out);
      ++server->counts.sent;
    }
    if (!hand_over(c, c->reply, c->reply_size, &c->reply_done)) return;
    c->reply_size = c->reply_done = 0;
    if (!c->next) break;
    c->out = c->next;
    c->next = NULL;
    c->done = 0;
    c->form = c->out->form[c->version - 1].size ? c->version - 1 : 0;
  }
  c->moved_s = sonde_clock_now();
}

static double now_unix(const sonde_igtl_server *server) {
  return server->unix_s + sonde_clock_now();
}

bool sonde_igtl_post(sonde_igtl_server *server, const sonde_frame *frame) {
  SONDE_ASSERT(server && frame);
  bool wanted[IGTL_VERSIONS] = {false}, any = false, made = true, waits = false;
  encoded *spare = server->frame;
  pthread_mutex_lock(&server->lock);
  igtl_style style = {.crc = &server->crc, .unix_s = now_unix(server)};
  style.number = (uint32_t)++server->counts.frames;
  for (const client *c = server->client; c < server->client + CLIENTS; ++c) {
    if (c->socket < 0 || c->connecting) continue;
    any = wanted[0] = true; // a client may change to version 2 before it takes this one
    if (c->version > 1) wanted[1] = true;
  }
  while (spare->users > 0) ++spare;
  SONDE_ASSERT(spare < server->frame + FRAMES);
  spare->users = any;
  pthread_mutex_unlock(&server->lock);
  if (!any) return true;
  for (int k = 0; k < IGTL_VERSIONS && made; ++k) {
    spare->form[k].size = 0;
    if (!wanted[k]) continue;
    style.version = k + 1;
    size_t size = igtl_encode_frame(frame, &style, spare->form[k].bytes, spare->form[k].capacity);
    if (size > spare->form[k].capacity) {
      sonde_free(spare->form[k].bytes);
      spare->form[k].bytes = SONDE_NEW(unsigned char, size);
      spare->form[k].capacity = spare->form[k].bytes ? size : 0;
      made = spare->form[k].bytes;
      if (made) igtl_encode_frame(frame, &style, spare->form[k].bytes, size);
    }
    spare->form[k].size = made ? size : 0;
  }
  pthread_mutex_lock(&server->lock);
  for (client *c = server->client; c < server->client + CLIENTS && made; ++c) {
    if (c->socket < 0 || c->connecting) continue;
    if (c->next) ++server->counts.replaced;
    release(&c->next);
    if (c->lost) continue; // one that waits to be closed holds no frame but the one it was sent
    c->next = spare;
    ++spare->users;
    feed(server, c);
    if (busy(c) || c->lost) waits = true;
  }
  --spare->users;
  pthread_mutex_unlock(&server->lock);
  if (waits) stream_port_wake(server->wake);
  return made;
}

// ---- what comes in, under the lock

// Takes messages apart. What they hold is not looked at: their head tells the version that the
// client speaks, and what it asks for.
static void hear(sonde_igtl_server *server, client *c) {
  unsigned char bytes[READ_BYTES];
  for (int round = 0; round < READS && !c->lost; ++round) {
    ssize_t got = recv(c->socket, bytes, sizeof bytes, MSG_DONTWAIT);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      c->lost = got == 0 || (errno != EAGAIN && errno != EWOULDBLOCK);
      return;
    }
    for (size_t at = 0, count = (size_t)got; at < count && !c->lost;) {
      size_t left = count - at;
      if (c->skip > 0) {
        size_t skipped = left < c->skip ? left : (size_t)c->skip;
        c->skip -= skipped;
        at += skipped;
        continue;
      }
      size_t taken = IGTL_HEAD_BYTES - c->head_count;
      if (taken > left) taken = left;
      memcpy(c->head + c->head_count, bytes + at, taken);
      c->head_count += taken;
      at += taken;
      if (c->head_count < IGTL_HEAD_BYTES) continue;
      igtl_heard heard;
      c->lost = !igtl_head_read(c->head, &heard) || heard.body > BODY_MOST;
      c->head_count = 0;
      c->skip = heard.body;
      if (heard.version > c->version) c->version = heard.version;
      // An answer that waits is enough.
      if (heard.asked && c->reply_done == c->reply_size && !c->lost) {
        igtl_style style = {.crc = &server->crc, .version = c->version, .unix_s = now_unix(server)};
        c->reply_size = igtl_encode_reply(heard.asked, &style, c->reply);
        c->reply_done = 0;
        feed(server, c);
      }
    }
  }
}

// ---- clients come and go, under the lock

static void drop(sonde_igtl_server *server, client *c) {
  if (!c->connecting) --server->counts.clients;
  release(&c->out);
  release(&c->next);
  close(c->socket);
  *c = (client){.socket = -1};
}

static void join(sonde_igtl_server *server, client *c) {
  const int one = 1, room = SEND_BUFFER;
  setsockopt(c->socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
  setsockopt(c->socket, SOL_SOCKET, SO_SNDBUF, &room, sizeof room);
  c->connecting = false;
  c->version = 1;
  c->moved_s = sonde_clock_now();
  ++server->counts.clients;
  ++server->counts.joined;
}

static void attend(sonde_igtl_server *server, client *c, int events) {
  if (c->connecting && events) {
    int problem = 0;
    socklen_t size = sizeof problem;
    if (getsockopt(c->socket, SOL_SOCKET, SO_ERROR, &problem, &size) || problem)
      drop(server, c);
    else
      join(server, c);
    return;
  }
  if (c->connecting) return;
  if (events & (POLLIN | POLLHUP | POLLERR)) hear(server, c);
  feed(server, c);
  if (c->lost || (busy(c) && sonde_clock_now() - c->moved_s > STUCK_S)) drop(server, c);
}

static void *run(void *argument) {
  sonde_igtl_server *server = argument;
  struct pollfd list[CLIENTS + 2];
  pthread_mutex_lock(&server->lock);
  while (!server->stopping) {
    // Reaches for the reader that is pushed to, once a second.
    client *reader = &server->client[PUSHED];
    const double now_s = sonde_clock_now();
    if (server->pushes && reader->socket < 0 && now_s >= server->push_s) {
      server->push_s = now_s + AGAIN_S;
      reader->socket = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
      reader->connecting = reader->socket >= 0;
      if (reader->connecting) {
        if (!connect(reader->socket, (struct sockaddr *)&server->push, sizeof server->push))
          join(server, reader);
        else if (errno != EINPROGRESS)
          drop(server, reader);
      }
    }
    for (int i = 0; i < CLIENTS; ++i) {
      const client *c = &server->client[i];
      const bool writes = c->socket >= 0 && (c->connecting || busy(c));
      list[i] = (struct pollfd){.fd = c->socket, .events = writes ? POLLIN | POLLOUT : POLLIN};
    }
    list[CLIENTS] = (struct pollfd){.fd = server->listener, .events = POLLIN};
    list[CLIENTS + 1] = (struct pollfd){.fd = server->wake, .events = POLLIN};
    pthread_mutex_unlock(&server->lock);
    poll(list, CLIENTS + 2, ROUND_MS);
    uint64_t woken;
    (void)!read(server->wake, &woken, sizeof woken);
    pthread_mutex_lock(&server->lock);
    for (int i = 0; i < CLIENTS; ++i)
      if (server->client[i].socket >= 0) attend(server, &server->client[i], list[i].revents);
    for (int socket = list[CLIENTS].revents ? 0 : -1; socket >= 0;) {
      socket = accept4(server->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
      int k = 0;
      while (k < PUSHED && server->client[k].socket >= 0) ++k;
      if (socket >= 0 && k < PUSHED) {
        server->client[k].socket = socket;
        join(server, &server->client[k]);
      } else if (socket >= 0) {
        close(socket);
      }
    }
  }
  pthread_mutex_unlock(&server->lock);
  return NULL;
}

// ---- start and stop

static sonde_status find_reader(sonde_igtl_server *server, const char *push, sonde_error *error) {
  char host[256];
  const char *colon = strrchr(push, ':');
  char *end = NULL;
  const long port = colon ? strtol(colon + 1, &end, 10) : 0;
  if (!colon || colon == push || (size_t)(colon - push) >= sizeof host || end == colon + 1 ||
      *end || port < 1 || port > UINT16_MAX)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "'%.200s' is no reader to push to, expected HOST:PORT as in localhost:18944",
                      push);
  snprintf(host, sizeof host, "%.*s", (int)(colon - push), push);
  const struct addrinfo hints = {.ai_family = AF_INET, .ai_socktype = SOCK_STREAM};
  struct addrinfo *found = NULL;
  int problem = getaddrinfo(host, NULL, &hints, &found);
  if (problem)
    return sonde_fail(error, SONDE_NOT_FOUND, "no computer '%.200s' to push to: %s", host,
                      gai_strerror(problem));
  memcpy(&server->push, found->ai_addr, sizeof server->push);
  server->push.sin_port = htons((uint16_t)port);
  freeaddrinfo(found);
  server->pushes = true;
  return SONDE_OK;
}

sonde_status sonde_igtl_start(const sonde_igtl_def *def, sonde_igtl_server **out,
                              sonde_error *error) {
  SONDE_ASSERT(def && out && (def->listen || def->push));
  *out = NULL;
  sonde_igtl_server *server = SONDE_NEW(sonde_igtl_server, 1);
  if (!server) return sonde_fail_memory(error);
  igtl_crc_begin(&server->crc);
  pthread_mutex_init(&server->lock, NULL);
  for (int i = 0; i < CLIENTS; ++i) server->client[i].socket = -1;
  struct timespec day;
  clock_gettime(CLOCK_REALTIME, &day);
  server->unix_s = (double)day.tv_sec + 1e-9 * (double)day.tv_nsec - sonde_clock_now();
  // Who only pushes needs the means to wake its thread too; nobody knows that port.
  server->port = def->listen ? def->port : 0;
  sonde_status status = stream_port_open(def->address ? def->address : "127.0.0.1", &server->port,
                                         &server->listener, &server->wake, error);
  if (!status && def->push) status = find_reader(server, def->push, error);
  if (!status && !def->listen) {
    close(server->listener);
    server->listener = -1;
    server->port = 0;
  }
  if (!status) {
    server->runs = pthread_create(&server->thread, NULL, run, server) == 0;
    if (!server->runs) status = sonde_fail(error, SONDE_MEMORY, "a thread could not start");
  }
  if (status)
    sonde_igtl_stop(server);
  else
    *out = server;
  return status;
}

uint16_t sonde_igtl_port(const sonde_igtl_server *server) { return server->port; }

sonde_igtl_counts sonde_igtl_counted(sonde_igtl_server *server) {
  SONDE_ASSERT(server);
  pthread_mutex_lock(&server->lock);
  sonde_igtl_counts counts = server->counts;
  pthread_mutex_unlock(&server->lock);
  return counts;
}

void sonde_igtl_stop(sonde_igtl_server *server) {
  if (!server) return;
  pthread_mutex_lock(&server->lock);
  server->stopping = true;
  pthread_mutex_unlock(&server->lock);
  if (server->runs) {
    stream_port_wake(server->wake);
    pthread_join(server->thread, NULL);
  }
  for (int i = 0; i < CLIENTS; ++i)
    if (server->client[i].socket >= 0) drop(server, &server->client[i]);
  for (int i = 0; i < FRAMES; ++i)
    for (int k = 0; k < IGTL_VERSIONS; ++k) sonde_free(server->frame[i].form[k].bytes);
  if (server->listener >= 0) close(server->listener);
  if (server->wake >= 0) close(server->wake);
  pthread_mutex_destroy(&server->lock);
  sonde_free(server);
}
