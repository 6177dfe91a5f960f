// A file that only grows: bytes go to the system at every flush and to the disk at every sync. What
// the disk does not take stays in memory, up to a bound, and is written when the disk takes it
// again; nothing that was written is ever removed. One thread at a time.
#ifndef SONDE_SRC_JOURNAL_H
#define SONDE_SRC_JOURNAL_H

#include "sonde/base.h"

enum {
  SONDE_JOURNAL_PENDING =
      32 << 20,                   // bytes that wait for the disk at most: seven minutes of an exam
  SONDE_JOURNAL_RESERVE = 4 << 20 // more of them for what is small and must not be lost
};

typedef struct sonde_journal sonde_journal;

// Makes a file under its own name. A file that is there already and not empty gets the name
// PATH.old; links are followed; what is not a regular file is written into.
sonde_status sonde_journal_create(const char *path, sonde_journal **journal, sonde_error *error);
// Opens a file to go on with it: sonde_journal_truncate() says where before the first bytes.
// @return SONDE_DEVICE while another program or another part of this one writes the file
sonde_status sonde_journal_extend(const char *path, sonde_journal **journal, sonde_error *error);
// Cuts off what comes after the first `bytes`, which no reader can use. @return 0 or an errno
int sonde_journal_truncate(sonde_journal *journal, uint64_t bytes);
// True for a file that can be read back.
bool sonde_journal_is_file(const sonde_journal *journal);
// @param important may use the reserve @return false when there is no room: the bytes are not taken
bool sonde_journal_append(sonde_journal *journal, const void *bytes, size_t count, bool important);
// Hands all bytes over to the system, and with `sync` to the disk. After a failure it does nothing
// for half a second unless `now`. @return 0 when all was taken, the errno of the trouble otherwise
int sonde_journal_flush(sonde_journal *journal, bool sync, bool now);
// Takes back what was appended since the last sync, from the file too as far as the disk allows.
void sonde_journal_forget(sonde_journal *journal);
// Closes and frees; bytes that wait are lost. NULL is ignored.
void sonde_journal_close(sonde_journal *journal);
// Removes the file that was just made and gives an older one its name back; frees.
void sonde_journal_undo(sonde_journal *journal);
// Whether somebody writes the file.
bool sonde_journal_is_open(const char *path);

#endif
