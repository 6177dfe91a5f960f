// A WebSocket client for a service on this machine.
#include "haptics/devices/websocket.h"

#include "base/base.h"
#include "base/random.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { OP_TEXT = 1, OP_CLOSE = 8, OP_PING = 9, OP_PONG = 10, PATIENCE_MS = 500, SMALL = 2048 };

static bool ready(int fd, short events, int milliseconds) {
  struct pollfd entry = {.fd = fd, .events = events};
  return poll(&entry, 1, milliseconds) == 1 && (entry.revents & events);
}

void sonde_websocket_wait(const sonde_websocket *socket, int milliseconds) {
  if (socket->fd >= 0) ready(socket->fd, POLLIN, milliseconds);
}

// A failure leaves the socket open; sonde_websocket_open() closes it.
static sonde_status connect_to(sonde_websocket *ws, uint16_t port, sonde_error *error) {
  ws->fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (ws->fd < 0) return sonde_fail(error, SONDE_IO, "no socket: %s", strerror(errno));
  int on = 1, problem = 0;
  setsockopt(ws->fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(ws->fd, (const struct sockaddr *)(const void *)&address, sizeof address) != 0 &&
      errno != EINPROGRESS)
    problem = errno;
  socklen_t size = sizeof problem;
  if (!problem && !ready(ws->fd, POLLOUT, PATIENCE_MS)) problem = ETIMEDOUT;
  if (!problem) getsockopt(ws->fd, SOL_SOCKET, SO_ERROR, &problem, &size);
  if (problem)
    return sonde_fail(error, SONDE_DEVICE, "no service answers on port %u: %s", (unsigned)port,
                      strerror(problem));

  // The handshake ends with an empty line; what follows it stays in the buffer.
  char request[256];
  int length = snprintf(request, sizeof request,
                        "GET / HTTP/1.1\r\nHost: localhost:%u\r\nUpgrade: websocket\r\n"
                        "Connection: Upgrade\r\nSec-WebSocket-Key: c29uZGUgaGFwdGljcyBvayE=\r\n"
                        "Sec-WebSocket-Version: 13\r\n\r\n",
                        (unsigned)port);
  if (send(ws->fd, request, (size_t)length, MSG_NOSIGNAL) != length)
    return sonde_fail(error, SONDE_IO, "the service on port %u hung up", (unsigned)port);
  const unsigned char *end = NULL;
  while (!end && ws->fill < SMALL && ready(ws->fd, POLLIN, PATIENCE_MS)) {
    ssize_t n = recv(ws->fd, ws->in + ws->fill, SMALL - ws->fill, 0);
    if (n <= 0) break;
    ws->fill += (size_t)n;
    end = memmem(ws->in, ws->fill, "\r\n\r\n", 4);
  }
  if (!end || ws->fill < 12 || memcmp(ws->in, "HTTP/1.1 101", 12) != 0)
    return sonde_fail(error, SONDE_DEVICE, "port %u is not a WebSocket service", (unsigned)port);
  size_t used = (size_t)(end - ws->in) + 4;
  memmove(ws->in, ws->in + used, ws->fill - used);
  ws->fill -= used;
  return SONDE_OK;
}

sonde_status sonde_websocket_open(sonde_websocket *ws, uint16_t port, sonde_error *error) {
  SONDE_ASSERT(ws != NULL && port != 0);
  ws->fd = -1;
  ws->fill = 0;
  sonde_status status = connect_to(ws, port, error);
  if (status) sonde_websocket_close(ws);
  return status;
}

void sonde_websocket_close(sonde_websocket *ws) {
  if (ws->fd >= 0) close(ws->fd);
  ws->fd = -1;
  ws->fill = 0;
}

// A frame that does not fit the socket's buffer means that the other side has stopped reading.
static bool send_frame(sonde_websocket *ws, int op, const void *data, size_t length) {
  unsigned char frame[SMALL + 8];
  if (ws->fd < 0 || length > SMALL) return false;
  size_t at = 0;
  frame[at++] = (unsigned char)(0x80 | op);
  if (length < 126) {
    frame[at++] = (unsigned char)(0x80 | length);
  } else {
    frame[at++] = 0x80 | 126;
    frame[at++] = (unsigned char)(length >> 8);
    frame[at++] = (unsigned char)length;
  }
  uint64_t mask = sonde_random_bits(0x5e, ws->sent++);
  for (int i = 0; i < 4; ++i) frame[at++] = (unsigned char)(mask >> (8 * i));
  const unsigned char *from = data;
  for (size_t i = 0; i < length; ++i)
    frame[at + i] = from[i] ^ (unsigned char)(mask >> (8 * (i & 3)));
  ssize_t n = send(ws->fd, frame, at + length, MSG_NOSIGNAL | MSG_DONTWAIT);
  return n == (ssize_t)(at + length);
}

bool sonde_websocket_send(sonde_websocket *ws, const char *text, size_t length) {
  SONDE_ASSERT(text != NULL);
  return send_frame(ws, OP_TEXT, text, length);
}

static bool fill(sonde_websocket *ws) {
  ssize_t n = recv(ws->fd, ws->in + ws->fill, sizeof ws->in - ws->fill, MSG_DONTWAIT);
  if (n > 0) ws->fill += (size_t)n;
  return n > 0 || (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR));
}

// Its operation and payload; 0: not all of it is there, -1: nonsense.
static int take_frame(sonde_websocket *ws, size_t *length) {
  if (ws->fill < 2) return 0;
  size_t head = 2, size = ws->in[1] & 0x7f;
  if (ws->in[1] & 0x80 || !(ws->in[0] & 0x80)) return -1; // masked or in parts: not from a server
  if (size == 126) {
    head = 4;
    if (ws->fill < head) return 0;
    size = (size_t)ws->in[2] << 8 | ws->in[3];
  }
  if (size == 127 || head + size > sizeof ws->in) return -1; // more than a state can be
  if (ws->fill < head + size) return 0;
  int op = ws->in[0] & 0x0f;
  memcpy(ws->message, ws->in + head, size);
  ws->message[size] = '\0';
  *length = size;
  ws->fill -= head + size;
  memmove(ws->in, ws->in + head + size, ws->fill);
  return op ? op : -1;
}

int sonde_websocket_receive(sonde_websocket *ws) {
  if (ws->fd < 0) return -1;
  bool alive = ws->fill < sizeof ws->in ? fill(ws) : true;
  for (size_t length;;) {
    int op = take_frame(ws, &length);
    if (op == OP_TEXT) return 1;
    if (op < 0 || op == OP_CLOSE) return -1;
    if (op == OP_PING && !send_frame(ws, OP_PONG, ws->message, length)) return -1;
    if (op == 0) return alive ? 0 : -1;
  }
}
