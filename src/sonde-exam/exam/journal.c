// A file that only grows, and what waits for a disk that is full.
#include "exam/journal.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/disk.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static const double RETRY_S = 0.5;
enum { ROOM = 1 << 16, SYNC_BYTES = 1 << 20 };

struct sonde_journal {
  int descriptor;
  bool regular, replaced;
  char path[PATH_MAX]; // what a link leads to
  off_t synced;        // bytes of the file that are on the disk
  // behind them: `written` bytes that the system has, then those that it does not have
  unsigned char *bytes;
  size_t count, written, room;
  int trouble; // of the last attempt
  double retry_s;
};

static sonde_status fail(const char *path, int failure, sonde_error *error) {
  return sonde_fail(error, sonde_disk_status(failure), "%s: cannot be written: %s", path,
                    strerror(failure));
}

static sonde_journal *new_journal(void) {
  sonde_journal *journal = SONDE_NEW(sonde_journal, 1);
  if (!journal) return NULL;
  journal->descriptor = -1;
  journal->room = ROOM;
  journal->bytes = SONDE_NEW(unsigned char, ROOM);
  if (journal->bytes) return journal;
  sonde_free(journal);
  return NULL;
}

static void old_name(const sonde_journal *journal, char name[PATH_MAX + 8]) {
  snprintf(name, PATH_MAX + 8, "%s.old", journal->path);
}

static int open_new(sonde_journal *journal, const char *path) {
  char aside[PATH_MAX + 8];
  struct stat info;
  int own = -1, failure = sonde_disk_follow(path, journal->path, &own);
  if (failure) return failure;
  if (own >= 0) {
    journal->descriptor = fcntl(own, F_DUPFD_CLOEXEC, 0);
    return journal->descriptor < 0 ? errno : 0;
  }
  bool there = stat(journal->path, &info) == 0;
  journal->regular = !there || S_ISREG(info.st_mode);
  if (there && journal->regular && info.st_size > 0) {
    old_name(journal, aside);
    failure = sonde_disk_rename(journal->path, aside);
    if (failure) return failure;
    journal->replaced = true;
  }
  int flags = O_WRONLY | O_NOCTTY | (journal->regular ? O_CREAT : 0);
  failure = sonde_disk_open(journal->path, flags, 0666, &journal->descriptor);
  if (!failure && journal->regular) failure = sonde_disk_sync_directory(journal->path);
  return failure;
}

static bool lock(const sonde_journal *journal) {
  return flock(journal->descriptor, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

sonde_status sonde_journal_create(const char *path, sonde_journal **out, sonde_error *error) {
  SONDE_ASSERT(path && out);
  *out = NULL;
  sonde_journal *journal = new_journal();
  if (!journal) return sonde_fail_memory(error);
  int failure = open_new(journal, path);
  if (!failure) {
    if (journal->regular) (void)lock(journal); // nobody else knows the file
    *out = journal;
    return SONDE_OK;
  }
  if (journal->descriptor >= 0 || journal->replaced)
    sonde_journal_undo(journal);
  else
    sonde_journal_close(journal);
  return fail(path, failure, error);
}

sonde_status sonde_journal_extend(const char *path, sonde_journal **out, sonde_error *error) {
  SONDE_ASSERT(path && out);
  *out = NULL;
  sonde_journal *journal = new_journal();
  if (!journal) return sonde_fail_memory(error);
  journal->regular = true;
  snprintf(journal->path, sizeof journal->path, "%s", path);
  int failure = sonde_disk_open(path, O_WRONLY, 0, &journal->descriptor);
  if (!failure && lock(journal)) {
    *out = journal;
    return SONDE_OK;
  }
  sonde_journal_close(journal);
  if (failure) return fail(path, failure, error);
  return sonde_fail(error, SONDE_DEVICE, "%s: is being recorded", path);
}

int sonde_journal_truncate(sonde_journal *journal, uint64_t bytes) {
  SONDE_ASSERT(journal->count == 0);
  int failure = sonde_disk_truncate(journal->descriptor, (off_t)bytes);
  if (!failure && lseek(journal->descriptor, (off_t)bytes, SEEK_SET) < 0) failure = errno;
  journal->synced = (off_t)bytes;
  return failure;
}

bool sonde_journal_is_file(const sonde_journal *journal) { return journal->regular; }

bool sonde_journal_append(sonde_journal *journal, const void *bytes, size_t count, bool important) {
  SONDE_ASSERT(bytes != NULL);
  size_t bound = (size_t)SONDE_JOURNAL_PENDING + (important ? SONDE_JOURNAL_RESERVE : 0);
  if (journal->count + count > bound) return false;
  size_t room = journal->room;
  while (room < journal->count + count) room *= 2;
  if (room > journal->room) {
    unsigned char *grown = sonde_realloc(journal->bytes, journal->room, room);
    if (!grown) return false;
    journal->bytes = grown;
    journal->room = room;
  }
  memcpy(journal->bytes + journal->count, bytes, count);
  journal->count += count;
  return true;
}

int sonde_journal_flush(sonde_journal *journal, bool sync, bool now) {
  SONDE_ASSERT(journal->written <= journal->count);
  if (journal->trouble && !now && sonde_clock_now() < journal->retry_s) return journal->trouble;
  size_t written = 0;
  int failure = 0;
  if (journal->count > journal->written)
    failure = sonde_disk_write(journal->descriptor, journal->bytes + journal->written,
                               journal->count - journal->written, &written);
  journal->written += written;
  if (!failure && (sync || journal->written >= SYNC_BYTES)) {
    failure = journal->regular ? sonde_disk_sync(journal->descriptor) : 0;
    if (!failure) {
      journal->synced += (off_t)journal->written;
      journal->count -= journal->written;
      memmove(journal->bytes, journal->bytes + journal->written, journal->count);
      journal->written = 0;
    } else if (lseek(journal->descriptor, journal->synced, SEEK_SET) >= 0) {
      journal->written = 0; // what could not be brought to the disk may be gone: written again
    }
  }
  journal->trouble = failure;
  if (failure) journal->retry_s = sonde_clock_now() + RETRY_S;
  return failure;
}

void sonde_journal_forget(sonde_journal *journal) {
  (void)sonde_disk_truncate(journal->descriptor, journal->synced);
  (void)lseek(journal->descriptor, journal->synced, SEEK_SET);
  journal->count = journal->written = 0;
}

void sonde_journal_close(sonde_journal *journal) {
  if (!journal) return;
  if (journal->descriptor >= 0) (void)sonde_disk_close(journal->descriptor);
  sonde_free(journal->bytes);
  sonde_free(journal);
}

void sonde_journal_undo(sonde_journal *journal) {
  char aside[PATH_MAX + 8];
  if (!journal) return;
  old_name(journal, aside);
  if (journal->regular && journal->replaced)
    (void)sonde_disk_rename(aside, journal->path);
  else if (journal->regular)
    (void)sonde_disk_remove(journal->path);
  sonde_journal_close(journal);
}

bool sonde_journal_is_open(const char *path) {
  SONDE_ASSERT(path != NULL);
  int descriptor = open(path, O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  bool open_elsewhere = flock(descriptor, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  close(descriptor);
  return open_elsewhere;
}
