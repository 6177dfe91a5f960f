// A bare WebSocket client on a socket, so that a test can be as rude as it likes.
#ifndef SONDE_TESTS_STREAM_WS_CLIENT_H
#define SONDE_TESTS_STREAM_WS_CLIENT_H

#include "base/test.h"

#include <arpa/inet.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

static inline int tcp_connect(uint16_t port, int receive_buffer) {
  int s = socket(AF_INET, SOCK_STREAM, 0);
  assert_true(s >= 0);
  struct timeval limit = {.tv_sec = 120}; // what never comes fails the test
  setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  if (receive_buffer) setsockopt(s, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
  struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  assert_int_equal(connect(s, (struct sockaddr *)&address, sizeof address), 0);
  return s;
}

static inline bool read_all(int s, void *bytes, size_t count) {
  unsigned char *at = bytes;
  while (count > 0) {
    ssize_t got = recv(s, at, count, 0);
    if (got <= 0) return false;
    at += got;
    count -= (size_t)got;
  }
  return true;
}

// Sends a request and reads the head of the answer (at most size - 1 bytes). Returns the code.
static inline int http_head(int s, const char *request, char *head, size_t size) {
  assert_int_equal(send(s, request, strlen(request), MSG_NOSIGNAL), strlen(request));
  size_t count = 0;
  while (count + 1 < size && recv(s, head + count, 1, 0) == 1) {
    ++count;
    if (count >= 4 && memcmp(head + count - 4, "\r\n\r\n", 4) == 0) break;
  }
  head[count] = 0;
  return count > 12 ? atoi(head + 9) : 0;
}

static const char WS_TOKEN[] = "00112233445566778899aabbccddeeff"; // of the servers in these tests

static const char WS_GUEST[] = "0123456789abcdef0123456789abcdef"; // who may only watch

// Opens a WebSocket with the given header lines. @return socket, or minus the HTTP code that
// refused
static inline int ws_open_with(uint16_t port, const char *host, const char *lines,
                               int receive_buffer) {
  char request[640], head[1024];
  snprintf(request, sizeof request,
           "GET /ws HTTP/1.1\r\nHost: %s\r\n%sUpgrade: websocket\r\nConnection: Upgrade\r\n"
           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n",
           host, lines);
  int s = tcp_connect(port, receive_buffer), code = http_head(s, request, head, sizeof head);
  // RFC 6455, 1.3: the answer to the key of its example
  if (code == 101 && strstr(head, "Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n"))
    return s;
  close(s);
  return code == 101 ? -1 : -code;
}

// With the token and the given Host and Origin (which may be NULL).
static inline int ws_open_as(uint16_t port, const char *host, const char *origin,
                             int receive_buffer) {
  char lines[256], origin_line[128] = "";
  if (origin) snprintf(origin_line, sizeof origin_line, "Origin: %s\r\n", origin);
  snprintf(lines, sizeof lines, "%sSec-WebSocket-Protocol: sonde, %s\r\n", origin_line, WS_TOKEN);
  return ws_open_with(port, host, lines, receive_buffer);
}

static inline int ws_open(uint16_t port) {
  char host[32];
  snprintf(host, sizeof host, "127.0.0.1:%u", (unsigned)port);
  return ws_open_as(port, host, NULL, 0);
}

// One masked frame. `first` is the first byte: FIN and opcode.
static inline void ws_send_frame(int s, unsigned first, const char *data, size_t count) {
  static const unsigned char MASK[4] = {0x12, 0x34, 0x56, 0x78};
  unsigned char *frame = malloc(count + 8), *at = frame;
  assert_non_null(frame);
  *at++ = (unsigned char)first;
  if (count < 126) {
    *at++ = (unsigned char)(0x80 | count);
  } else {
    assert_true(count < 65536);
    *at++ = 0x80 | 126;
    *at++ = (unsigned char)(count >> 8);
    *at++ = (unsigned char)(count & 0xff);
  }
  memcpy(at, MASK, 4);
  at += 4;
  for (size_t i = 0; i < count; ++i) *at++ = (unsigned char)(data[i] ^ MASK[i % 4]);
  (void)!send(s, frame, (size_t)(at - frame), MSG_NOSIGNAL); // the server may have closed it
  free(frame);
}

static inline void ws_say(int s, const char *text) { ws_send_frame(s, 0x81, text, strlen(text)); }

// One message from the server, freed by the caller. *opcode 8 or 0: closed.
static inline unsigned char *ws_read(int s, int *opcode, size_t *count) {
  unsigned char head[2], more[8];
  *opcode = 0;
  *count = 0;
  if (!read_all(s, head, 2)) return NULL;
  size_t size = head[1] & 0x7f;
  size_t extra = size == 126 ? 2 : size == 127 ? 8 : 0;
  if (extra > 0) {
    if (!read_all(s, more, extra)) return NULL;
    size = 0;
    for (size_t i = 0; i < extra; ++i) size = size << 8 | more[i];
  }
  unsigned char *data = malloc(size + 1);
  assert_non_null(data);
  if (!read_all(s, data, size)) {
    free(data);
    return NULL;
  }
  data[size] = 0;
  *opcode = head[0] & 0x0f;
  *count = size;
  return data;
}

// Reads until a text message that contains `needle`; false when the connection ends first.
static inline bool ws_expect(int s, const char *needle) {
  for (;;) {
    int opcode;
    size_t count;
    unsigned char *data = ws_read(s, &opcode, &count);
    if (!data) return false;
    bool found = opcode == 1 && strstr((char *)data, needle) != NULL;
    free(data);
    if (found) return true;
    if (opcode == 8) return false;
  }
}

// The status with which the server closes the connection, 0 when it ends without one.
static inline int ws_close_status(int s) {
  for (;;) {
    int opcode;
    size_t count;
    unsigned char *data = ws_read(s, &opcode, &count);
    if (!data) return 0;
    int status = opcode == 8 && count >= 2 ? data[0] << 8 | data[1] : 0;
    free(data);
    if (opcode == 8) return status;
  }
}

#endif
