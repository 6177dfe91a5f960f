// WebSocket frames (RFC 6455, section 5) as this server takes and sends them.
#ifndef SONDE_SRC_STREAM_PAGE_FRAME_H
#define SONDE_SRC_STREAM_PAGE_FRAME_H

#include "base/base.h"

enum {
  PAGE_WS_TEXT = 1,
  PAGE_WS_BINARY = 2,
  PAGE_WS_CLOSE = 8,
  PAGE_WS_PING = 9,
  PAGE_WS_PONG = 10,
  PAGE_WS_HEAD_BYTES = 14, // longest head
};

// Status codes of a closing frame (RFC 6455, 7.4.1).
enum {
  PAGE_CLOSE_NORMAL = 1000,
  PAGE_CLOSE_AWAY = 1001,
  PAGE_CLOSE_PROTOCOL = 1002,
  PAGE_CLOSE_DATA = 1003,
  PAGE_CLOSE_POLICY = 1008,
  PAGE_CLOSE_TOO_BIG = 1009
};

typedef struct page_ws_head {
  int opcode;
  size_t head, payload; // bytes
  unsigned char mask[4];
} page_ws_head;

// Reads the head of a client's frame from the first bytes of it. The length, the mask and the kind
// are judged as soon as they are there, before any payload is read: a frame longer than `limit`
// is refused by its head alone.
// @return 0: more bytes are needed or the head is whole (head > 0); else the status to close with
// @thread any
int page_ws_read(const unsigned char *bytes, size_t count, size_t limit, page_ws_head *head);
// Takes the mask off a payload. @thread any
void page_ws_unmask(unsigned char *payload, size_t count, const unsigned char mask[4]);
// Writes the head of a whole, unmasked frame; returns its size. @thread any
size_t page_ws_write(unsigned char head[PAGE_WS_HEAD_BYTES], int opcode, size_t payload);

#endif
