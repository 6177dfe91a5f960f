// The mock service: one client at a time, blocking reads with a short timeout.
#include "mock_haply.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

static bool readable(int fd) {
  struct pollfd entry = {.fd = fd, .events = POLLIN};
  return poll(&entry, 1, 20) == 1;
}

static bool read_all(mock_haply *mock, int fd, unsigned char *to, size_t size) {
  while (size > 0) {
    if (mock->stop || mock->hang_up) return false;
    if (!readable(fd)) continue;
    ssize_t n = recv(fd, to, size, 0);
    if (n <= 0) return false;
    to += n;
    size -= (size_t)n;
  }
  return true;
}

static bool shake(mock_haply *mock, int fd) {
  char text[2048] = "";
  for (size_t at = 0; at + 1 < sizeof text && !strstr(text, "\r\n\r\n"); ++at)
    if (!read_all(mock, fd, (unsigned char *)text + at, 1)) return false;
  if (!strstr(text, "Upgrade: websocket") || !strstr(text, "Sec-WebSocket-Key")) return false;
  static const char answer[] = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                               "Connection: Upgrade\r\nSec-WebSocket-Accept: x\r\n\r\n";
  return send(fd, answer, sizeof answer - 1, MSG_NOSIGNAL) > 0;
}

static void send_state(mock_haply *mock, int fd) {
  char text[512], frame[600];
  int length =
      mock->control.plugged
          ? snprintf(text, sizeof text,
                     "{\"inverse3\":[{\"device_id\":\"049D\",\"state\":{\"cursor_position\":{\"x\":"
                     "%.6f,\"y\":%.6f,\"z\":%.6f},\"cursor_velocity\":{\"x\":0,\"y\":0,\"z\":0}}}],"
                     "\"wireless_verse_grip\":[{\"state\":{\"orientation\":{\"w\":0.70710678,"
                     "\"x\":0,\"y\":0,\"z\":0.70710678},\"buttons\":{\"a\":true,\"b\":false}}}]}",
                     mock->control.position_m[0], mock->control.position_m[1],
                     mock->control.position_m[2])
          : snprintf(text, sizeof text, "{\"inverse3\":[]}");
  if (mock->torn && mock->control.exchanges % 2) length /= 2;
  frame[0] = (char)0x81;
  frame[1] = 126;
  frame[2] = (char)(length >> 8);
  frame[3] = (char)length;
  memcpy(frame + 4, text, (size_t)length);
  // in two pieces: the client has to put frames together
  size_t first = mock->torn ? 7 : (size_t)length + 4;
  send(fd, frame, first, MSG_NOSIGNAL);
  if (first < (size_t)length + 4) send(fd, frame + first, (size_t)length + 4 - first, MSG_NOSIGNAL);
}

static bool take_command(mock_haply *mock, int fd) {
  unsigned char head[4], mask[4];
  char text[4096];
  if (!read_all(mock, fd, head, 2) || !(head[1] & 0x80)) return false; // clients must mask
  size_t length = head[1] & 0x7f;
  if (length == 126) {
    if (!read_all(mock, fd, head + 2, 2)) return false;
    length = (size_t)head[2] << 8 | head[3];
  }
  if (length >= sizeof text || !read_all(mock, fd, mask, 4)) return false;
  if (!read_all(mock, fd, (unsigned char *)text, length)) return false;
  for (size_t i = 0; i < length; ++i) text[i] = (char)(text[i] ^ mask[i & 3]);
  text[length] = '\0';
  const char *values = strstr(text, "\"set_cursor_force\":{\"values\":{\"x\":");
  double f[3];
  if (!strstr(text, "\"device_id\":\"049D\"") || !values ||
      sscanf(values, "\"set_cursor_force\":{\"values\":{\"x\":%lf,\"y\":%lf,\"z\":%lf", &f[0],
             &f[1], &f[2]) != 3)
    return false;
  for (int i = 0; i < 3; ++i) mock->control.force_n[i] = f[i];
  return true;
}

static void serve(mock_haply *mock, int fd) {
  int on = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  if (!shake(mock, fd)) return;
  mock->control.opened++;
  send_state(mock, fd); // the service speaks first
  while (!mock->stop && take_command(mock, fd)) {
    mock->control.exchanges++;
    if (!mock->silent) send_state(mock, fd);
  }
  mock->control.closed++;
}

static void *thread_main(void *self) {
  mock_haply *mock = self;
  while (!mock->stop) {
    if (!readable(mock->listener)) continue;
    int fd = accept(mock->listener, NULL, NULL);
    if (fd < 0) continue;
    mock->hang_up = false;
    serve(mock, fd);
    close(fd);
  }
  return NULL;
}

bool mock_haply_start(mock_haply *mock) {
  memset(mock, 0, sizeof *mock);
  struct sockaddr_in address = {.sin_family = AF_INET};
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  mock->listener = socket(AF_INET, SOCK_STREAM, 0);
  struct sockaddr *a = (struct sockaddr *)(void *)&address;
  if (mock->listener < 0 || bind(mock->listener, a, size) || listen(mock->listener, 4) ||
      getsockname(mock->listener, a, &size))
    return false;
  mock->port = ntohs(address.sin_port);
  return pthread_create(&mock->thread, NULL, thread_main, mock) == 0;
}

void mock_haply_stop(mock_haply *mock) {
  mock->stop = true;
  pthread_join(mock->thread, NULL);
  close(mock->listener);
}
