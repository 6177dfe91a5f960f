// Little-endian numbers in byte buffers, whatever the machine's order.
#ifndef SONDE_SRC_EXAM_BYTES_H
#define SONDE_SRC_EXAM_BYTES_H

#include <stdint.h>
#include <string.h>

// A place in a buffer; the caller has checked that enough bytes follow.
typedef struct byte_writer {
  unsigned char *at;
} byte_writer;
typedef struct byte_reader {
  const unsigned char *at;
} byte_reader;

static inline void put_integer(byte_writer *w, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) *w->at++ = (unsigned char)(value >> (8 * i));
}
static inline void put_u32(byte_writer *w, uint32_t value) { put_integer(w, value, 4); }
static inline void put_u64(byte_writer *w, uint64_t value) { put_integer(w, value, 8); }
static inline void put_real(byte_writer *w, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  put_u64(w, bits);
}

static inline uint64_t get_integer(byte_reader *r, int bytes) {
  uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value |= (uint64_t)*r->at++ << (8 * i);
  return value;
}
static inline uint32_t get_u32(byte_reader *r) { return (uint32_t)get_integer(r, 4); }
static inline uint64_t get_u64(byte_reader *r) { return get_integer(r, 8); }
static inline double get_real(byte_reader *r) {
  uint64_t bits = get_u64(r);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

#endif
