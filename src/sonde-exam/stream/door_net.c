// The sockets of a class's door.
#include "stream/door.h"
#include "stream/port.h"

#include "base/clock.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <openssl/err.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
  ADMITTED = 16,  // new connections in one round: a handshake costs a millisecond
  TURNS = 32,     // buffers that one connection moves in one round
  ROUND_MS = 100, // longest wait: the stages' ends are looked at ten times a second
};
// How long a connection may take, s: to take a byte that waits for it, to become a WebSocket or
// end, to take an answer, to close.
static const double MOVE_S = 30, RELAY_S = 60, ANSWER_S = 30, END_S = 1;

void door_enter(door_connection *c, door_stage stage) {
  c->stage = stage;
  c->stage_s = c->moved_s = sonde_clock_now();
}

static void drop(door_connection *c) {
  SONDE_ASSERT(c->socket >= 0);
  SSL_free(c->tls);
  close(c->socket);
  if (c->inner >= 0) close(c->inner);
  sonde_free(c->answer.owned);
  sonde_free(c->in);
  sonde_free(c->out);
  *c = (door_connection){.socket = -1, .inner = -1};
}

// Nothing more is sent. Reading goes on for a moment: closing a socket with unread bytes would
// destroy what was sent last.
static void end_connection(door_connection *c) {
  SSL_shutdown(c->tls);
  ERR_clear_error();
  shutdown(c->socket, SHUT_WR);
  door_enter(c, DOOR_ENDS);
}

// What a call of TLS moved: bytes, 0 when it waits, -1 when the connection is lost.
static ssize_t moved(door_connection *c, int got) {
  int problem = got > 0 ? SSL_ERROR_NONE : SSL_get_error(c->tls, got);
  ERR_clear_error();
  c->tls_writes = problem == SSL_ERROR_WANT_WRITE;
  if (problem == SSL_ERROR_WANT_WRITE || problem == SSL_ERROR_WANT_READ) return 0;
  if (got > 0) c->moved_s = sonde_clock_now();
  return got > 0 ? got : -1;
}

// Bytes that fit behind what is in the buffer.
static size_t room(door_buffer *b) {
  SONDE_ASSERT(b->from <= b->to && b->to <= DOOR_BUFFER);
  if (b->from) memmove(b->bytes, b->bytes + b->from, b->to - b->from);
  b->to -= b->from;
  b->from = 0;
  return DOOR_BUFFER - b->to;
}

// Takes what the client sent. False: the connection is lost, and dropped.
static bool take(door_connection *c, ssize_t *got) {
  size_t space = room(c->in);
  *got = space ? moved(c, SSL_read(c->tls, c->in->bytes + c->in->to, (int)space)) : 0;
  if (*got > 0) c->in->to += (size_t)*got;
  if (*got >= 0) return true;
  drop(c);
  return false;
}

bool door_reach(door_connection *c, uint16_t port) {
  struct sockaddr_in address = {
      .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  int one = 1;
  c->inner = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (c->inner < 0) return false;
  setsockopt(c->inner, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
  return connect(c->inner, (struct sockaddr *)&address, sizeof address) == 0 ||
         errno == EINPROGRESS;
}

static bool waits(void) {
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOTCONN ||
         errno == EINPROGRESS;
}

// Moves bytes between a client and a learner's program, as many as both take now. A program that
// ends the connection ends the client's, once it has all. True: there may be more at once.
static bool relay(door_connection *c) {
  for (int i = 0; i < TURNS; ++i) {
    ssize_t in = 0, sent = 0, heard = 0, out = 0;
    if (!take(c, &in)) return false;
    if (c->in->to > c->in->from && !c->inner_ended) {
      sent = send(c->inner, c->in->bytes + c->in->from, c->in->to - c->in->from, MSG_NOSIGNAL);
      if (sent < 0 && !waits()) c->inner_ended = true;
      if (sent > 0) c->in->from += (size_t)sent;
    }
    size_t space = room(c->out);
    if (space && !c->inner_ended) {
      heard = recv(c->inner, c->out->bytes + c->out->to, space, 0);
      if (heard == 0 || (heard < 0 && !waits())) c->inner_ended = true;
      if (heard > 0) c->out->to += (size_t)heard;
      // A program that takes a WebSocket knows the client's token.
      if (heard > 0 && !c->heard)
        c->let_in = heard >= 12 && memcmp(c->out->bytes, "HTTP/1.1 101", 12) == 0;
      c->heard |= heard > 0;
    }
    size_t due = c->out->to - c->out->from;
    if (due) out = moved(c, SSL_write(c->tls, c->out->bytes + c->out->from, (int)due));
    if (out < 0) {
      drop(c);
      return false;
    }
    c->out->from += (size_t)out;
    if (c->inner_ended && !c->heard) {
      door_refuse(c, 502, "the learner's program is not there yet\n");
      return true;
    }
    if (c->inner_ended && c->out->from == c->out->to) {
      end_connection(c);
      return false;
    }
    if (in <= 0 && sent <= 0 && heard <= 0 && out == 0) return false;
  }
  return true;
}

// Sends the door's own answer.
static void answer(door_connection *c) {
  page_out *a = &c->answer;
  while (a->done < a->head_size + a->body_size) {
    bool head = a->done < a->head_size;
    const char *from = head ? a->head + a->done : (const char *)a->body + (a->done - a->head_size);
    size_t left = head ? a->head_size - a->done : a->head_size + a->body_size - a->done;
    ssize_t out = moved(c, SSL_write(c->tls, from, (int)(left < DOOR_BUFFER ? left : DOOR_BUFFER)));
    if (out < 0) drop(c);
    if (out <= 0) return;
    a->done += (size_t)out;
  }
  end_connection(c);
}

// Does what the connection's stage allows now. True: there may be more to do at once.
static bool turn(sonde_door *door, door_connection *c) {
  ssize_t got = 1;
  if (c->stage == DOOR_GREETS) {
    ssize_t done = moved(c, SSL_accept(c->tls));
    if (done < 0) {
      drop(c);
      return false;
    }
    if (done > 0) c->stage = DOOR_ASKS;
  }
  if (c->stage == DOOR_ASKS) {
    if (!take(c, &got)) return false;
    size_t most = c->in->to < PAGE_HEAD_BYTES ? c->in->to : PAGE_HEAD_BYTES;
    size_t size = page_request_size((const char *)c->in->bytes, most);
    if (size)
      door_answer(door, c, size);
    else if (c->in->to >= PAGE_HEAD_BYTES)
      door_refuse(c, 431, "the head of the request is too long\n");
  }
  if (c->stage == DOOR_ANSWERED) answer(c);
  if (c->socket >= 0 && c->stage == DOOR_RELAYS) return relay(c);
  if (c->socket >= 0 && c->stage == DOOR_ENDS) {
    got = recv(c->socket, c->in->bytes, DOOR_BUFFER, 0);
    if (got == 0 || (got < 0 && !waits())) drop(c);
  }
  return false;
}

// Ends a connection that stays too long in its stage, and looks at a code when its time has come.
static void mind(sonde_door *door, door_connection *c, double now_s) {
  const double in_stage_s = now_s - c->stage_s;
  bool late = false;
  if (c->stage == DOOR_GREETS || c->stage == DOOR_ASKS)
    late = now_s - c->accepted_s > atomic_load(&door->ask_s);
  if (c->stage == DOOR_JOINS && in_stage_s > atomic_load(&door->code_s)) door_admit(door, c);
  if (c->stage == DOOR_RELAYS)
    late = (!c->let_in && in_stage_s > RELAY_S) ||
           (c->out->to > c->out->from && now_s - c->moved_s > MOVE_S);
  if (c->stage == DOOR_ANSWERED) late = now_s - c->stage_s > ANSWER_S;
  if (c->stage == DOOR_ENDS) late = in_stage_s > END_S;
  if (late)
    drop(c);
  else if (c->stage == DOOR_ANSWERED)
    answer(c);
}

// A full table: of the address that has most connections which no program has let in, the oldest
// makes room, so that a stranger's many cost the others none.
static door_connection *find_place(sonde_door *door) {
  door_connection *worst = NULL;
  uint32_t most = 0;
  for (int i = 0; i < DOOR_CONNECTIONS; ++i) {
    door_connection *c = &door->connection[i];
    if (c->socket < 0) return c;
    uint32_t alike = 0;
    for (int k = 0; k < DOOR_CONNECTIONS; ++k)
      alike += !door->connection[k].let_in && door->connection[k].peer == c->peer;
    if (c->let_in || alike < most || (alike == most && worst && worst->accepted < c->accepted))
      continue;
    worst = c;
    most = alike;
  }
  if (worst) drop(worst);
  return worst;
}

static void admit(sonde_door *door) {
  for (int i = 0; i < ADMITTED; ++i) {
    struct sockaddr_in from = {0};
    socklen_t size = sizeof from;
    int one = 1, socket = accept4(door->listener, (struct sockaddr *)&from, &size,
                                  SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (socket < 0) return;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    door_connection *c = find_place(door);
    SSL *tls = c ? SSL_new(door->context) : NULL;
    door_buffer *in = tls ? SONDE_NEW(door_buffer, 1) : NULL;
    door_buffer *out = in ? SONDE_NEW(door_buffer, 1) : NULL;
    if (!out || SSL_set_fd(tls, socket) != 1) {
      sonde_free(out);
      sonde_free(in);
      SSL_free(tls);
      close(socket);
      return;
    }
    SSL_set_accept_state(tls);
    *c = (door_connection){.socket = socket,
                           .inner = -1,
                           .tls = tls,
                           .in = in,
                           .out = out,
                           .peer = from.sin_addr.s_addr,
                           .accepted_s = sonde_clock_now(),
                           .accepted = ++door->accepted};
    door_enter(c, DOOR_GREETS);
    turn(door, c);
  }
}

// What to wait for; a socket without anything to wait for is left out, or its end would be reported
// over and over.
static struct pollfd interest(int socket, bool reads, bool writes) {
  short events = (short)((reads ? POLLIN : 0) | (writes ? POLLOUT : 0));
  return (struct pollfd){.fd = events ? socket : -1, .events = events};
}

void *door_run(void *argument) {
  sonde_door *door = argument;
  enum { ALL = 2 * DOOR_CONNECTIONS };
  struct pollfd list[ALL + 2];
  sigset_t pipe_signal; // TLS writes to sockets that may be gone
  sigemptyset(&pipe_signal);
  sigaddset(&pipe_signal, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &pipe_signal, NULL);
  bool more = false; // some connection has moved its share and may have more
  while (!atomic_load(&door->stopping)) {
    list[ALL] = (struct pollfd){.fd = door->listener, .events = POLLIN};
    list[ALL + 1] = (struct pollfd){.fd = door->wake, .events = POLLIN};
    for (int i = 0; i < DOOR_CONNECTIONS; ++i) {
      const door_connection *c = &door->connection[i];
      bool here = c->socket >= 0, relays = here && c->stage == DOOR_RELAYS;
      bool reads = here && (relays ? c->in->to - c->in->from < DOOR_BUFFER
                                   : c->stage != DOOR_JOINS && c->stage != DOOR_ANSWERED);
      bool writes = here && (c->tls_writes || c->stage == DOOR_ANSWERED ||
                             (relays && c->out->to > c->out->from));
      list[2 * i] = interest(c->socket, reads, writes);
      list[2 * i + 1] =
          interest(c->inner, relays && !c->inner_ended && c->out->to - c->out->from < DOOR_BUFFER,
                   relays && !c->inner_ended && c->in->to > c->in->from);
    }
    poll(list, ALL + 2, more ? 0 : ROUND_MS);
    const bool again = more;
    more = false;
    double now_s = sonde_clock_now();
    for (int i = 0; i < DOOR_CONNECTIONS; ++i) {
      door_connection *c = &door->connection[i];
      if (c->socket < 0) continue;
      if (list[2 * i].revents || list[2 * i + 1].revents || again) more |= turn(door, c);
      if (c->socket >= 0) mind(door, c, now_s);
    }
    if (list[ALL].revents) admit(door);
  }
  for (int i = 0; i < DOOR_CONNECTIONS; ++i)
    if (door->connection[i].socket >= 0) drop(&door->connection[i]);
  return NULL;
}
