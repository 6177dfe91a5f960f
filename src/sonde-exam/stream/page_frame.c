// WebSocket frames: see page_frame.h.
#include "stream/page_frame.h"

#include <string.h>

enum { FIN = 0x80, RESERVED = 0x70, MASKED = 0x80, SHORT_MAX = 125 };

int page_ws_read(const unsigned char *bytes, size_t count, size_t limit, page_ws_head *head) {
  SONDE_ASSERT(bytes && head);
  *head = (page_ws_head){0};
  if (count < 2) return 0;
  // The first two bytes already forbid much: what is not masked (RFC 6455, 5.1), fragments of
  // control frames, and all messages but whole texts.
  const int opcode = bytes[0] & 0x0f, length7 = bytes[1] & 0x7f;
  const bool control = opcode >= PAGE_WS_CLOSE, whole = bytes[0] & FIN;
  if ((bytes[0] & RESERVED) || !(bytes[1] & MASKED) || opcode > PAGE_WS_PONG ||
      (opcode > PAGE_WS_BINARY && !control) || (control && (!whole || length7 > SHORT_MAX)))
    return PAGE_CLOSE_PROTOCOL;
  if (!control && (!whole || opcode != PAGE_WS_TEXT)) return PAGE_CLOSE_DATA;
  size_t length = (size_t)length7, extra = length == 126 ? 2 : length == 127 ? 8 : 0;
  if (count < 2 + extra) return 0;
  uint64_t payload = extra ? 0 : length;
  for (size_t i = 0; i < extra; ++i) payload = payload << 8 | bytes[2 + i];
  if (payload > limit) return PAGE_CLOSE_TOO_BIG;
  if (count < 2 + extra + 4) return 0;
  memcpy(head->mask, bytes + 2 + extra, 4);
  head->opcode = opcode;
  head->head = 2 + extra + 4;
  head->payload = (size_t)payload;
  return 0;
}

void page_ws_unmask(unsigned char *payload, size_t count, const unsigned char mask[4]) {
  for (size_t i = 0; i < count; ++i) payload[i] ^= mask[i % 4];
}

size_t page_ws_write(unsigned char head[PAGE_WS_HEAD_BYTES], int opcode, size_t payload) {
  SONDE_ASSERT(opcode > 0 && opcode <= PAGE_WS_PONG && head);
  size_t extra = payload <= SHORT_MAX ? 0 : payload < 65536 ? 2 : 8;
  head[0] = (unsigned char)(FIN | opcode);
  head[1] = (unsigned char)(extra == 0 ? payload : extra == 2 ? 126 : 127);
  for (size_t i = 0; i < extra; ++i)
    head[2 + i] = (unsigned char)((uint64_t)payload >> (8 * (extra - 1 - i)) & 0xff);
  return 2 + extra;
}
