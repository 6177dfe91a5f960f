// Messages of OpenIGTLink (protocol 3, header versions 1 and 2), big-endian.
#ifndef SONDE_SRC_STREAM_IGTL_MESSAGE_H
#define SONDE_SRC_STREAM_IGTL_MESSAGE_H

#include "sonde/exam.h"

enum {
  IGTL_HEAD_BYTES = 58,   // version, type, device, time stamp, body's size, CRC
  IGTL_VERSIONS = 2,      // of the header
  IGTL_REPLY_BYTES = 256, // most of an answer
};

// Tables of the CRC-64 of ECMA-182 (x^64 + ... with 0x42F0E1EBA9EA3693), for eight bytes at a time.
typedef struct igtl_crc {
  uint64_t table[8][256];
} igtl_crc;

void igtl_crc_begin(igtl_crc *crc);
// From 0, highest bit first, nothing inverted.
uint64_t igtl_crc_of(const igtl_crc *crc, const unsigned char *bytes, size_t count);

// How messages are headed.
typedef struct igtl_style {
  const igtl_crc *crc;
  int version;     // of the header, 1 or 2
  uint32_t number; // of the frame, from 1
  double unix_s;   // time stamp: seconds since 1970
} igtl_style;

// All messages of a frame behind each other. Returns their size and writes them only when they fit.
size_t igtl_encode_frame(const sonde_frame *frame, const igtl_style *style, unsigned char *bytes,
                         size_t capacity);

// What a client may ask for.
typedef enum igtl_asked { IGTL_NOTHING, IGTL_STATUS, IGTL_CAPABILITY } igtl_asked;
size_t igtl_encode_reply(igtl_asked what, const igtl_style *style,
                         unsigned char bytes[IGTL_REPLY_BYTES]);

// A client's message so far.
typedef struct igtl_heard {
  int version;
  igtl_asked asked;
  uint64_t body; // bytes that follow
} igtl_heard;
// False when it is no header of this protocol.
bool igtl_head_read(const unsigned char bytes[IGTL_HEAD_BYTES], igtl_heard *heard);

#endif
