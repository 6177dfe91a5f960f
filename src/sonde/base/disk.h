// Calls that change the disk. Every file that the project writes goes through them, so that a test
// can let any single one fail (sonde_disk_set_fault). Each returns 0 or an errno.
#ifndef SONDE_SRC_DISK_H
#define SONDE_SRC_DISK_H

#include "base/link.h"
#include "sonde/base.h"

#include <limits.h>
#include <sys/types.h>

typedef enum sonde_disk_call {
  SONDE_DISK_OPEN,
  SONDE_DISK_WRITE,
  SONDE_DISK_SYNC,
  SONDE_DISK_CLOSE,
  SONDE_DISK_RENAME,
  SONDE_DISK_REMOVE,
  SONDE_DISK_DIRECTORY,
  SONDE_DISK_TRUNCATE
} sonde_disk_call;

// Asked before every call: 0 lets it happen, an errno makes it fail. A write can be shortened: the
// first *bytes of it happen, then it fails. Set while no other thread writes; NULL: none.
typedef int (*sonde_disk_fault)(sonde_disk_call call, const char *path, size_t *bytes, void *user);
void sonde_disk_set_fault(sonde_disk_fault fault, void *user);

// @param flags of open(2); close-on-exec is added
SONDE_LINK int sonde_disk_open(const char *path, int flags, mode_t mode, int *descriptor);
// @param[out] written what reached the system, also after a failure
SONDE_LINK int sonde_disk_write(int descriptor, const void *bytes, size_t count, size_t *written);
SONDE_LINK int sonde_disk_sync(int descriptor);
// The entries of the directory in which `path` lies; a file system that cannot sync directories is
// no failure.
SONDE_LINK int sonde_disk_sync_directory(const char *path);
SONDE_LINK int sonde_disk_close(int descriptor);
SONDE_LINK int sonde_disk_rename(const char *from, const char *to);
SONDE_LINK int sonde_disk_remove(const char *path);
int sonde_disk_directory(const char *path, mode_t mode);
SONDE_LINK int sonde_disk_truncate(int descriptor, off_t bytes);

// Where a path leads, one symbolic link after the other; the last one may lead to a file that does
// not exist yet.
// @param[out] target the file's own path @param[out] descriptor >= 0: the path names this open file
//   (/dev/stdout, /dev/fd/N) and there is no target
SONDE_LINK int sonde_disk_follow(const char *path, char target[PATH_MAX], int *descriptor);

// SONDE_IO for what another path or another permission would mend, SONDE_DISK for a disk that is
// full or fails and a system that has run out of something.
SONDE_LINK sonde_status sonde_disk_status(int failure);

#endif
