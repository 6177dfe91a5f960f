// Ring of fixed-size records between one writing and one reading thread. Push and pop are inline,
// never wait, never allocate: the tick thread may call them.
#ifndef SONDE_SRC_RING_H
#define SONDE_SRC_RING_H

#include "base/link.h"
#include "base/base.h"

#include <stdatomic.h>
#include <string.h>

enum { SONDE_CACHE_LINE = 64 };

// head and tail count records since creation and wrap with size_t; head - tail is the fill. Each
// side keeps its own copy of the other's counter, so that it touches the shared line only when
// the ring looks full or empty.
typedef struct sonde_ring {
  size_t record_bytes, mask; // mask: capacity - 1
  unsigned char *records;
  char pad_a[SONDE_CACHE_LINE];
  atomic_size_t head; // records pushed; written by the writer
  size_t tail_seen;   // writer's copy of tail
  char pad_b[SONDE_CACHE_LINE];
  atomic_size_t tail; // records popped; written by the reader
  size_t head_seen;   // reader's copy of head
} sonde_ring;

// A ring for `capacity` records (a power of two) of `record_bytes` each. @thread owner
SONDE_LINK sonde_status sonde_ring_create(size_t record_bytes, size_t capacity, sonde_ring **ring,
                                          sonde_error *error);
// NULL is ignored; neither thread may use the ring any more. @thread owner
SONDE_LINK void sonde_ring_destroy(sonde_ring *ring);

// Copies one record in; false when the ring is full. @thread writer (tick)
static inline bool sonde_ring_push(sonde_ring *ring, const void *record) {
  size_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
  if (head - ring->tail_seen > ring->mask) {
    ring->tail_seen = atomic_load_explicit(&ring->tail, memory_order_acquire);
    if (head - ring->tail_seen > ring->mask) return false;
  }
  memcpy(ring->records + (head & ring->mask) * ring->record_bytes, record, ring->record_bytes);
  atomic_store_explicit(&ring->head, head + 1, memory_order_release);
  return true;
}

// Copies the oldest record out; false when the ring is empty. @thread reader
static inline bool sonde_ring_pop(sonde_ring *ring, void *record) {
  size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
  if (tail == ring->head_seen) {
    ring->head_seen = atomic_load_explicit(&ring->head, memory_order_acquire);
    if (tail == ring->head_seen) return false;
  }
  memcpy(record, ring->records + (tail & ring->mask) * ring->record_bytes, ring->record_bytes);
  atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
  return true;
}

#endif
