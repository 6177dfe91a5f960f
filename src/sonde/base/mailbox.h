// "Latest" mailbox of three slots between one writing and one reading thread. The writer fills its
// slot and swaps it with the middle one; the reader swaps the middle one with its own. Neither ever
// waits; older unread states are overwritten.
#ifndef SONDE_SRC_MAILBOX_H
#define SONDE_SRC_MAILBOX_H

#include "base/link.h"
#include "base/base.h"

#include <stdatomic.h>

typedef struct sonde_mailbox {
  size_t slot_bytes; // multiple of SONDE_MAILBOX_ALIGN
  unsigned char *slots;
  atomic_uint middle; // slot index, plus SONDE_MAILBOX_FRESH when published and not yet read
  unsigned back;      // slot of the writer
  unsigned front;     // slot of the reader
} sonde_mailbox;

enum { SONDE_MAILBOX_ALIGN = 64, SONDE_MAILBOX_FRESH = 4 };

// Three zeroed slots of `bytes` each. @thread owner
SONDE_LINK sonde_status sonde_mailbox_create(size_t bytes, sonde_mailbox **mailbox,
                                             sonde_error *error);
// NULL is ignored; neither thread may use the mailbox any more. @thread owner
SONDE_LINK void sonde_mailbox_destroy(sonde_mailbox *mailbox);

// Slot to fill before the next publish; holds an old state until then. @thread writer (tick)
static inline void *sonde_mailbox_write_slot(sonde_mailbox *mailbox) {
  return mailbox->slots + mailbox->back * mailbox->slot_bytes;
}

// Makes the write slot the newest state; the next write slot is another one. @thread writer (tick)
static inline void sonde_mailbox_publish(sonde_mailbox *mailbox) {
  unsigned fresh = mailbox->back | SONDE_MAILBOX_FRESH;
  unsigned old = atomic_exchange_explicit(&mailbox->middle, fresh, memory_order_acq_rel);
  mailbox->back = old & 3u;
}

// Newest published slot, or NULL when nothing is new since the last read. The slot stays valid and
// unchanged until the next read that returns a slot. @thread reader
static inline const void *sonde_mailbox_read(sonde_mailbox *mailbox) {
  if (!(atomic_load_explicit(&mailbox->middle, memory_order_relaxed) & SONDE_MAILBOX_FRESH))
    return NULL;
  unsigned old = atomic_exchange_explicit(&mailbox->middle, mailbox->front, memory_order_acq_rel);
  mailbox->front = old & 3u;
  return mailbox->slots + mailbox->front * mailbox->slot_bytes;
}

#endif
