// The sockets of the page's server: one thread waits for all of them with poll() and never for one.
// What a connection sends is bounded before it is stored: a head of a request by PAGE_HEAD_BYTES, a
// WebSocket frame by its own head. Every stage has an end (page_patience), and a full table makes
// room by closing the oldest connection that is no client, so that connections which never finish
// their request cost nobody else anything.
#include "stream/page_server.h"
#include "stream/port.h"

#include "base/clock.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

enum {
  ADMITTED = 64,               // new connections in one round
  ROUND_MS = 100,              // longest wait: the stages' ends are looked at ten times a second
  LEAST_BYTES_PER_S = 1 << 20, // that a client takes of a file that is mapped
  THROWN = 1 << 16,            // bytes read and thrown away in one round, of a connection that ends
};

sonde_status page_net_open(sonde_page_server *server, uint16_t port, sonde_error *error) {
  server->port = port;
  return stream_port_open("127.0.0.1", &server->port, &server->listener, &server->wake, error);
}

void page_wake(sonde_page_server *server) { stream_port_wake(server->wake); }

// ---- ends

static void enter(page_connection *c, page_stage stage) {
  c->stage = stage;
  c->stage_s = sonde_clock_now();
}

static void clear_out(page_connection *c) {
  if (c->out.mapped)
    munmap(c->out.owned, c->out.mapped);
  else
    sonde_free(c->out.owned);
  c->out.owned = NULL;
  c->out.mapped = c->out.head_size = c->out.body_size = c->out.done = 0;
}

static void drop(page_connection *c) {
  if (c->client) page_client_leave(c->client, c->heard_s);
  clear_out(c);
  sonde_free(c->in);
  close(c->socket);
  *c = (page_connection){.socket = -1};
}

// Nothing more is sent. Reading goes on for a moment: closing a socket with unread bytes would
// destroy what was sent last.
static void end_connection(page_connection *c) {
  SONDE_ASSERT(c->socket >= 0 && c->stage != PAGE_ENDS);
  if (c->client) page_client_leave(c->client, c->heard_s);
  c->client = NULL;
  clear_out(c);
  shutdown(c->socket, SHUT_WR);
  enter(c, PAGE_ENDS);
}

// ---- what goes out

// A connection that is to be closed is not listened to any more.
static bool listens(const page_connection *c) {
  return c->stage == PAGE_ASKS || (c->stage == PAGE_TALKS && !c->close_due);
}

static bool idle(const page_connection *c) {
  return c->out.done == c->out.head_size + c->out.body_size;
}

// False when the connection is lost. A full socket leaves the rest for later.
static bool send_out(page_connection *c) {
  page_out *out = &c->out;
  SONDE_ASSERT(out->head_size <= sizeof out->head && (out->body || !out->body_size));
  while (!idle(c)) {
    size_t head = out->done < out->head_size ? out->head_size - out->done : 0;
    size_t body = out->done < out->head_size ? 0 : out->done - out->head_size;
    struct iovec parts[2];
    size_t count = 0;
    if (head) parts[count++] = (struct iovec){out->head + out->done, head};
    if (body < out->body_size) // sendmsg() does not change what it sends
      parts[count++] = (struct iovec){(char *)(uintptr_t)out->body + body, out->body_size - body};
    struct msghdr message = {.msg_iov = parts, .msg_iovlen = count};
    ssize_t sent = sendmsg(c->socket, &message, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
    out->done += (size_t)sent;
  }
  return true;
}

// Sends what there is and what the socket takes.
static void feed(page_connection *c) {
  if (!send_out(c)) {
    drop(c);
    return;
  }
  if (c->stage == PAGE_ANSWERED && idle(c)) {
    if (!c->client) {
      end_connection(c);
      return;
    }
    enter(c, PAGE_TALKS);
    c->heard_s = c->pinged_s = c->stage_s;
  }
  // The next message of a client, if there is one. A frame that closes is the last.
  while (c->stage == PAGE_TALKS && idle(c)) {
    bool last = c->close_due != 0;
    clear_out(c);
    if (last) {
      unsigned char *status = (unsigned char *)c->pong; // a closing connection answers no ping
      status[0] = (unsigned char)(c->close_due >> 8 & 0xff);
      status[1] = (unsigned char)(c->close_due & 0xff);
      page_out_frame(&c->out, PAGE_WS_CLOSE, status, 2, NULL);
    } else if (c->pong_due) {
      page_out_frame(&c->out, PAGE_WS_PONG, c->pong, c->pong_size, NULL);
      c->pong_due = false;
    } else if (!page_client_next(c->client, &c->out)) {
      break;
    }
    if (!send_out(c)) {
      drop(c);
      return;
    }
    if (last) {
      end_connection(c);
      return;
    }
  }
  if (c->stage == PAGE_TALKS && c->client->leaving) drop(c);
}

// ---- what comes in

// One frame of a client; the status to close with, 0 to go on.
static int take_frame(page_connection *c, const page_ws_head *head, unsigned char *payload) {
  page_ws_unmask(payload, head->payload, head->mask);
  if (head->opcode == PAGE_WS_CLOSE) return PAGE_CLOSE_NORMAL;
  if (head->opcode == PAGE_WS_PING) {
    memcpy(c->pong, payload, head->payload);
    c->pong_size = head->payload;
    c->pong_due = true;
  }
  if (head->opcode != PAGE_WS_TEXT) return 0;
  return page_client_hear(c->client, (const char *)payload, head->payload) ? 0 : PAGE_CLOSE_POLICY;
}

// Room for a whole frame is always left: a frame that is not whole is shorter than the buffer.
static void hear(sonde_page_server *server, page_connection *c) {
  _Static_assert(PAGE_HEAD_BYTES > PAGE_COMMAND_BYTES + PAGE_WS_HEAD_BYTES, "a frame fits");
  SONDE_ASSERT(c->in_count < PAGE_HEAD_BYTES);
  ssize_t got = recv(c->socket, c->in + c->in_count, PAGE_HEAD_BYTES - c->in_count, 0);
  if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return;
  if (got <= 0) {
    drop(c);
    return;
  }
  c->in_count += (size_t)got;
  c->heard_s = sonde_clock_now();
  if (c->stage == PAGE_ASKS) {
    size_t size = page_request_size((const char *)c->in, c->in_count);
    if (size != 0 || c->in_count >= PAGE_HEAD_BYTES) {
      if (size == 0)
        page_http_refuse(&c->out, 431);
      else
        page_http_answer(server, (const char *)c->in, size, &c->out, &c->client);
      c->in_count -= size;
      memmove(c->in, c->in + size, c->in_count);
      enter(c, PAGE_ANSWERED);
    }
  }
  if (c->stage == PAGE_ANSWERED) feed(c);
  if (c->stage == PAGE_TALKS) {
    size_t used = 0;
    const size_t most = c->client->teacher ? PAGE_COMMAND_BYTES : PAGE_SHORT_BYTES;
    while (!c->close_due) {
      page_ws_head head;
      size_t left = c->in_count - used;
      c->close_due = page_ws_read(c->in + used, left, most, &head);
      if (c->close_due || !head.head || left < head.head + head.payload) break;
      c->close_due = take_frame(c, &head, c->in + used + head.head);
      used += head.head + head.payload;
    }
    c->in_count -= used;
    memmove(c->in, c->in + used, c->in_count);
    feed(c);
  }
}

// ---- new connections

static page_connection *find_place(sonde_page_server *server) {
  for (int i = 0; i < PAGE_CONNECTIONS; ++i)
    if (server->connection[i].socket < 0) return &server->connection[i];
  return NULL;
}

// What a new connection has sent already is read at once, so that it is not the oldest that waits.
static void admit(sonde_page_server *server) {
  for (int i = 0; i < ADMITTED; ++i) {
    int socket = accept4(server->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK), one = 1;
    bool full = socket < 0 ? errno == EMFILE || errno == ENFILE : !find_place(server);
    if (full) {
      // The oldest connection that is no client makes room.
      page_connection *oldest = NULL;
      for (page_connection *o = server->connection; o < server->connection + PAGE_CONNECTIONS; ++o)
        if (o->socket >= 0 && !o->client && (!oldest || o->accepted < oldest->accepted)) oldest = o;
      if (oldest) drop(oldest);
    }
    if (socket < 0) return;
    page_connection *c = find_place(server);
    unsigned char *in = c ? SONDE_NEW(unsigned char, PAGE_HEAD_BYTES) : NULL;
    if (!in) {
      close(socket);
      return;
    }
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    *c = (page_connection){.socket = socket, .in = in, .accepted = ++server->accepted};
    enter(c, PAGE_ASKS);
    hear(server, c);
  }
}

// ---- the thread

static void *run(void *argument) {
  sonde_page_server *server = argument;
  struct pollfd poll_list[PAGE_CONNECTIONS + 2];
  for (;;) {
    pthread_mutex_lock(&server->lock);
    bool stopping = server->stopping;
    page_roles_turn(server);
    const page_patience patience = server->patience;
    pthread_mutex_unlock(&server->lock);
    if (stopping) break;
    // Wait for sockets, for news of the program, at most for a round.
    poll_list[PAGE_CONNECTIONS] = (struct pollfd){.fd = server->listener, .events = POLLIN};
    poll_list[PAGE_CONNECTIONS + 1] = (struct pollfd){.fd = server->wake, .events = POLLIN};
    for (int i = 0; i < PAGE_CONNECTIONS; ++i) {
      const page_connection *c = &server->connection[i];
      bool writes = !idle(c), reads = listens(c) || c->stage == PAGE_ENDS;
      poll_list[i] = (struct pollfd){
          .fd = c->socket, .events = (short)((reads ? POLLIN : 0) | (writes ? POLLOUT : 0))};
    }
    poll(poll_list, PAGE_CONNECTIONS + 2, ROUND_MS);
    uint64_t woken;
    (void)!read(server->wake, &woken, sizeof woken);
    double now_s = sonde_clock_now();
    for (int i = 0; i < PAGE_CONNECTIONS; ++i) {
      page_connection *c = &server->connection[i];
      const int events = poll_list[i].revents;
      if (c->socket < 0) continue;
      if (c->stage == PAGE_ENDS && events) {
        // Reads on for a moment from a connection that ends.
        ssize_t got = 1;
        for (size_t all = 0; all < THROWN && got > 0; all += (size_t)got)
          got = recv(c->socket, c->in, PAGE_HEAD_BYTES, 0);
        if (got == 0 || (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR))
          drop(c);
      }
      if (c->stage == PAGE_ANSWERED || c->stage == PAGE_TALKS) feed(c); // news, or room to send
      if (c->socket >= 0 && listens(c) && (events & (POLLIN | POLLHUP | POLLERR))) hear(server, c);
      if (c->socket >= 0) {
        // Ends a connection that stays too long in its stage, and pings a client that is silent.
        // A large file takes its time: at least LEAST_BYTES_PER_S.
        const double sends_s = (double)c->out.mapped / LEAST_BYTES_PER_S;
        const double most_s[] = {[PAGE_ASKS] = patience.ask_s,
                                 [PAGE_ANSWERED] = patience.answer_s + sends_s,
                                 [PAGE_ENDS] = patience.end_s};
        if (c->stage != PAGE_TALKS) {
          if (now_s - c->stage_s > most_s[c->stage]) drop(c);
        } else if (now_s - c->heard_s > patience.silent_s) {
          drop(c);
        } else if (now_s - c->heard_s > patience.ping_s && now_s - c->pinged_s > patience.ping_s &&
                   idle(c)) {
          c->pinged_s = now_s;
          clear_out(c);
          page_out_frame(&c->out, PAGE_WS_PING, NULL, 0, NULL);
          feed(c);
        }
      }
    }
    if (poll_list[PAGE_CONNECTIONS].revents) admit(server);
  }
  // 1001 to every client whose last message is whole.
  for (page_connection *c = server->connection; c < server->connection + PAGE_CONNECTIONS; ++c) {
    if (c->socket >= 0 && c->stage == PAGE_TALKS && idle(c)) {
      c->close_due = PAGE_CLOSE_AWAY;
      feed(c);
    }
    if (c->socket >= 0) drop(c);
  }
  return NULL;
}

sonde_status page_net_start(sonde_page_server *server, sonde_error *error) {
  server->net_runs = pthread_create(&server->net, NULL, run, server) == 0;
  return server->net_runs ? SONDE_OK : sonde_fail(error, SONDE_MEMORY, "a thread could not start");
}

void page_net_stop(sonde_page_server *server) {
  if (server->net_runs) {
    page_wake(server);
    pthread_join(server->net, NULL);
  }
  if (server->listener >= 0) close(server->listener);
  if (server->wake >= 0) close(server->wake);
}
