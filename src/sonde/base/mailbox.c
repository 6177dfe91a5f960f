// Life of the three-slot mailbox; writing and reading live in mailbox.h.
#include "base/mailbox.h"

sonde_status sonde_mailbox_create(size_t bytes, sonde_mailbox **out, sonde_error *error) {
  *out = NULL;
  if (bytes == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "mailbox: slot size is 0, expected 1 byte or more");
  if (bytes > SIZE_MAX / 4) return sonde_fail_memory(error);
  size_t slot_bytes = (bytes + SONDE_MAILBOX_ALIGN - 1) / SONDE_MAILBOX_ALIGN * SONDE_MAILBOX_ALIGN;
  sonde_mailbox *mailbox = SONDE_NEW(sonde_mailbox, 1);
  unsigned char *slots = sonde_calloc(3, slot_bytes);
  if (!mailbox || !slots) {
    sonde_free(mailbox);
    sonde_free(slots);
    return sonde_fail_memory(error);
  }
  SONDE_ASSERT(slot_bytes >= bytes);
  mailbox->slot_bytes = slot_bytes;
  mailbox->slots = slots;
  mailbox->back = 0;
  mailbox->front = 1;
  atomic_init(&mailbox->middle, 2);
  *out = mailbox;
  return SONDE_OK;
}

void sonde_mailbox_destroy(sonde_mailbox *mailbox) {
  if (!mailbox) return;
  SONDE_ASSERT(mailbox->back != mailbox->front);
  sonde_free(mailbox->slots);
  sonde_free(mailbox);
}
