// Little-endian numbers in byte buffers, whatever the machine's order: a writer that never passes
// the end of its buffer, and a reader.
#ifndef SONDE_SRC_BASE_BYTES_H
#define SONDE_SRC_BASE_BYTES_H

#include "base/base.h"

#include <string.h>

// Bytes beyond `capacity` are counted but not stored, so that a first pass without a buffer
// (bytes NULL, capacity 0) measures the message.
typedef struct bytes_cursor {
  unsigned char *bytes;
  size_t capacity;
  size_t count; // bytes asked for so far
} bytes_cursor;

static inline bool bytes_fit(const bytes_cursor *cursor) {
  return cursor->count <= cursor->capacity;
}

static inline void bytes_put(bytes_cursor *cursor, const void *data, size_t size) {
  if (cursor->count <= cursor->capacity && size <= cursor->capacity - cursor->count)
    memcpy(cursor->bytes + cursor->count, data, size);
  cursor->count += size;
}

static inline void bytes_u16(bytes_cursor *cursor, uint16_t value) {
  unsigned char b[2] = {(unsigned char)(value & 0xff), (unsigned char)(value >> 8)};
  bytes_put(cursor, b, sizeof b);
}

static inline void bytes_u32(bytes_cursor *cursor, uint32_t value) {
  bytes_u16(cursor, (uint16_t)(value & 0xffff));
  bytes_u16(cursor, (uint16_t)(value >> 16));
}

static inline void bytes_u64(bytes_cursor *cursor, uint64_t value) {
  bytes_u32(cursor, (uint32_t)(value & 0xffffffffu));
  bytes_u32(cursor, (uint32_t)(value >> 32));
}

static inline void bytes_f32(bytes_cursor *cursor, double value) {
  float narrow = (float)value;
  uint32_t bits;
  memcpy(&bits, &narrow, sizeof bits);
  bytes_u32(cursor, bits);
}

static inline void bytes_f64(bytes_cursor *cursor, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  bytes_u64(cursor, bits);
}

// A place in a buffer; the caller has checked that enough bytes follow.
typedef struct bytes_reader {
  const unsigned char *at;
} bytes_reader;

static inline uint64_t bytes_take(bytes_reader *reader, int bytes) {
  uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value |= (uint64_t)*reader->at++ << (8 * i);
  return value;
}
static inline uint32_t bytes_take_u32(bytes_reader *reader) {
  return (uint32_t)bytes_take(reader, 4);
}
static inline uint64_t bytes_take_u64(bytes_reader *reader) { return bytes_take(reader, 8); }
static inline double bytes_take_f32(bytes_reader *reader) {
  uint32_t bits = bytes_take_u32(reader);
  float value;
  memcpy(&value, &bits, sizeof value);
  return (double)value;
}
static inline double bytes_take_f64(bytes_reader *reader) {
  uint64_t bits = bytes_take_u64(reader);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

#endif
