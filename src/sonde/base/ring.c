// Life of the record ring; push and pop live in ring.h.
#include "base/ring.h"

sonde_status sonde_ring_create(size_t record_bytes, size_t capacity, sonde_ring **out,
                               sonde_error *error) {
  *out = NULL;
  if (record_bytes == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "ring: record size is 0, expected 1 byte or more");
  if (capacity == 0 || (capacity & (capacity - 1)))
    return sonde_fail(error, SONDE_ARGUMENT, "ring: capacity is %zu, expected a power of two",
                      capacity);
  sonde_ring *ring = SONDE_NEW(sonde_ring, 1);
  unsigned char *records = sonde_calloc(capacity, record_bytes);
  if (!ring || !records) {
    sonde_free(ring);
    sonde_free(records);
    return sonde_fail_memory(error);
  }
  ring->record_bytes = record_bytes;
  ring->mask = capacity - 1;
  ring->records = records;
  atomic_init(&ring->head, 0);
  atomic_init(&ring->tail, 0);
  SONDE_ASSERT((ring->mask & capacity) == 0);
  *out = ring;
  return SONDE_OK;
}

void sonde_ring_destroy(sonde_ring *ring) {
  if (!ring) return;
  SONDE_ASSERT(atomic_load(&ring->head) - atomic_load(&ring->tail) <= ring->mask + 1);
  sonde_free(ring->records);
  sonde_free(ring);
}
