// Notes of a recording that nobody writes any more.
#include "exam/record.h"

#include "base/base.h"
#include "base/disk.h"

#include <errno.h>
#include <string.h>
#include <zlib.h>

sonde_status sonde_notes_load(const char *path, sonde_notes *notes, sonde_error *error) {
  SONDE_ASSERT(path && notes);
  sonde_recording recording;
  *notes = (sonde_notes){0};
  sonde_status status = sonde_recording_load(path, true, &recording, error);
  if (status) return status;
  // Sizes first, then the texts behind one another.
  const sonde_recording *r = &recording;
  sonde_record_note note;
  uint32_t count = 0;
  size_t bytes = 1;
  for (size_t at = r->start; sonde_recording_next_note(r, &at, &note); bytes += note.bytes + 1)
    ++count;
  notes->list = SONDE_NEW(sonde_note, count);
  char *text = notes->texts = SONDE_NEW(char, bytes);
  if (!notes->list || !notes->texts) status = sonde_fail_memory(error);
  for (size_t at = r->start; !status && sonde_recording_next_note(r, &at, &note);) {
    memcpy(text, note.text, note.bytes);
    notes->list[notes->count++] = (sonde_note){note.kind, note.tick, text};
    text += note.bytes + 1;
  }
  SONDE_ASSERT(status || notes->count == count);
  sonde_recording_clear(&recording);
  if (status) sonde_notes_clear(notes);
  return status;
}

void sonde_notes_clear(sonde_notes *notes) {
  sonde_free(notes->list);
  sonde_free(notes->texts);
  *notes = (sonde_notes){0};
}

const sonde_note *sonde_notes_last(const sonde_notes *notes, sonde_note_kind kind) {
  for (uint32_t i = notes->count; i > 0; --i)
    if (notes->list[i - 1].kind == kind) return &notes->list[i - 1];
  return NULL;
}

sonde_status sonde_notes_add(const char *path, sonde_note_kind kind, const char *text,
                             sonde_error *error) {
  SONDE_ASSERT(path && text && kind >= SONDE_NOTE_SETUP && kind <= SONDE_NOTE_WORKSHEET);
  sonde_journal *journal;
  sonde_recording recording;
  if (strlen(text) >= SONDE_NOTE_MOST_BYTES)
    return sonde_fail(error, SONDE_ARGUMENT, "a note of %zu bytes, expected less than %d",
                      strlen(text), SONDE_NOTE_MOST_BYTES);
  sonde_status status = sonde_journal_extend(path, &journal, error);
  if (status) return status;
  // The recording is read when its file is locked: another program may have added to it meanwhile.
  status = sonde_recording_load(path, true, &recording, error);
  if (!status && recording.version < SONDE_RECORD_JOURNAL)
    status = sonde_fail(error, SONDE_VERSION, "%s: version %d of a recording takes no notes", path,
                        recording.version);
  if (!status) {
    // One note and the block that closes it off, behind the last whole block.
    static const char zeros[8];
    unsigned char head[SONDE_RECORD_NOTE_BYTES], block[16];
    size_t length = strlen(text), pad = -length & 7;
    (void)sonde_record_put_note(head, kind, recording.told.ticks, length);
    uLong crc = crc32_z(recording.crc, head, sizeof head);
    crc = crc32_z(crc, (const unsigned char *)text, length);
    crc = crc32_z(crc, (const unsigned char *)zeros, pad);
    sonde_record_put_block(block, (uint32_t)crc, recording.block_ticks);
    int failure = sonde_journal_truncate(journal, recording.notes_end);
    if (!failure) {
      bool taken = sonde_journal_append(journal, head, sizeof head, true) &&
                   sonde_journal_append(journal, text, length, true) &&
                   sonde_journal_append(journal, zeros, pad, true) &&
                   sonde_journal_append(journal, block, sizeof block, true);
      failure = taken ? sonde_journal_flush(journal, true, true) : ENOMEM;
      if (failure) sonde_journal_forget(journal);
    }
    if (failure)
      status = sonde_fail(error, sonde_disk_status(failure), "%s: cannot be written: %s", path,
                          strerror(failure));
  }
  sonde_recording_clear(&recording);
  sonde_journal_close(journal);
  return status;
}

bool sonde_recording_is_open(const char *recording) { return sonde_journal_is_open(recording); }
