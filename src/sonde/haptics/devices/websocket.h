// A WebSocket client (RFC 6455) for a service on this machine: text messages, TCP_NODELAY, never
// waits once it is open.
#ifndef SONDE_SRC_WEBSOCKET_H
#define SONDE_SRC_WEBSOCKET_H

#include "sonde/base.h"

enum { SONDE_WEBSOCKET_ROOM = 65536 };

typedef struct sonde_websocket {
  int fd; // -1: closed
  uint64_t sent;
  size_t fill; // bytes in `in` that are not yet taken
  unsigned char in[SONDE_WEBSOCKET_ROOM];
  char message[SONDE_WEBSOCKET_ROOM + 1];
} sonde_websocket;

// Connects to 127.0.0.1 and shakes hands within half a second. @thread owner
sonde_status sonde_websocket_open(sonde_websocket *socket, uint16_t port, sonde_error *error);
void sonde_websocket_close(sonde_websocket *socket);
// false: the connection is lost.
bool sonde_websocket_send(sonde_websocket *socket, const char *text, size_t length);
// Next text message in socket->message. 1: one, 0: none yet, -1: the connection is lost.
int sonde_websocket_receive(sonde_websocket *socket);
// Waits for something to receive, at most so long.
void sonde_websocket_wait(const sonde_websocket *socket, int milliseconds);

#endif
