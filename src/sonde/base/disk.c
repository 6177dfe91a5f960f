// System calls that change the disk, and the place where tests make them fail.
#include "base/disk.h"

#include "base/base.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { LINKS = 40 };

static sonde_disk_fault fault;
static void *fault_user;

void sonde_disk_set_fault(sonde_disk_fault wanted, void *user) {
  fault = wanted;
  fault_user = user;
}

static int fails(sonde_disk_call call, const char *path) {
  size_t bytes = 0;
  return fault ? fault(call, path, &bytes, fault_user) : 0;
}

int sonde_disk_open(const char *path, int flags, mode_t mode, int *descriptor) {
  SONDE_ASSERT(path && descriptor);
  int failure = fails(SONDE_DISK_OPEN, path);
  *descriptor = -1;
  if (failure) return failure;
  do *descriptor = open(path, flags | O_CLOEXEC, mode);
  while (*descriptor < 0 && errno == EINTR);
  return *descriptor < 0 ? errno : 0;
}

int sonde_disk_write(int descriptor, const void *bytes, size_t count, size_t *written) {
  SONDE_ASSERT(descriptor >= 0 && (bytes || count == 0) && written);
  const char *from = bytes;
  size_t allowed = count;
  int failure = fault ? fault(SONDE_DISK_WRITE, NULL, &allowed, fault_user) : 0;
  *written = 0;
  if (!failure) allowed = count;
  while (*written < allowed) {
    ssize_t done = write(descriptor, from + *written, allowed - *written);
    if (done < 0 && errno == EINTR) continue;
    if (done < 0) return errno;
    if (done == 0) return EIO;
    *written += (size_t)done;
  }
  return failure;
}

int sonde_disk_sync(int descriptor) {
  int failure = fails(SONDE_DISK_SYNC, NULL);
  if (failure) return failure;
  return fsync(descriptor) ? errno : 0;
}

int sonde_disk_sync_directory(const char *path) {
  char parent[4096];
  const char *slash = strrchr(path, '/');
  size_t length = slash ? (size_t)(slash - path) : 0;
  if (length >= sizeof parent) return ENAMETOOLONG;
  snprintf(parent, sizeof parent, "%.*s", (int)length, path);
  const char *name = !slash ? "." : length == 0 ? "/" : parent;
  int descriptor = open(name, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return errno == EACCES ? 0 : errno; // it may be written but not listed
  int failure = sonde_disk_sync(descriptor);
  close(descriptor);
  return failure == EINVAL || failure == ENOTSUP ? 0 : failure;
}

// The descriptor is gone also after a failure.
int sonde_disk_close(int descriptor) {
  int failure = fails(SONDE_DISK_CLOSE, NULL);
  return close(descriptor) && errno != EINTR && !failure ? errno : failure;
}

int sonde_disk_rename(const char *from, const char *to) {
  int failure = fails(SONDE_DISK_RENAME, to);
  if (failure) return failure;
  return rename(from, to) ? errno : 0;
}

int sonde_disk_remove(const char *path) {
  int failure = fails(SONDE_DISK_REMOVE, path);
  if (failure) return failure;
  return unlink(path) ? errno : 0;
}

int sonde_disk_directory(const char *path, mode_t mode) {
  int failure = fails(SONDE_DISK_DIRECTORY, path);
  if (failure) return failure;
  return mkdir(path, mode) ? errno : 0;
}

int sonde_disk_truncate(int descriptor, off_t bytes) {
  int failure = fails(SONDE_DISK_TRUNCATE, NULL);
  if (failure) return failure;
  return ftruncate(descriptor, bytes) ? errno : 0;
}

int sonde_disk_follow(const char *path, char target[PATH_MAX], int *descriptor) {
  char next[PATH_MAX], link[PATH_MAX], directory[PATH_MAX];
  char own[64]; // descriptors of this process: what /dev/stdout and /dev/fd/N lead to
  snprintf(own, sizeof own, "/proc/%ld/fd", (long)getpid());
  *descriptor = -1;
  if (snprintf(next, sizeof next, "%s", path) >= PATH_MAX) return ENAMETOOLONG;
  for (int hop = 0; hop < LINKS; ++hop) {
    char *slash = strrchr(next, '/');
    const char *name = slash ? slash + 1 : next;
    if (!name[0] || strcmp(name, ".") == 0 || strcmp(name, "..") == 0) return EISDIR;
    if (slash) *slash = 0;
    const char *parent = !slash ? "." : next[0] ? next : "/";
    if (!realpath(parent, directory)) return errno;
    char *end = NULL;
    long number = strtol(name, &end, 10);
    if (strcmp(directory, own) == 0 && end != name && *end == 0 && number >= 0 &&
        number <= INT_MAX) {
      *descriptor = (int)number;
      return 0;
    }
    bool root = strcmp(directory, "/") == 0;
    if (snprintf(target, PATH_MAX, "%s/%s", root ? "" : directory, name) >= PATH_MAX)
      return ENAMETOOLONG;
    ssize_t length = readlink(target, link, sizeof link - 1);
    if (length < 0) return errno == EINVAL || errno == ENOENT ? 0 : errno;
    link[length] = 0;
    bool absolute = link[0] == '/';
    if (snprintf(next, sizeof next, "%s%s%s", absolute ? "" : directory, absolute ? "" : "/",
                 link) >= PATH_MAX)
      return ENAMETOOLONG;
  }
  return ELOOP;
}

sonde_status sonde_disk_status(int failure) {
  static const int MENDABLE[] = {ENOENT, EACCES, EPERM,        ENOTDIR, EISDIR, EEXIST, ENOTEMPTY,
                                 EXDEV,  ELOOP,  ENAMETOOLONG, EROFS,   EINVAL, ENXIO,  ETXTBSY};
  for (size_t i = 0; i < SONDE_COUNT_OF(MENDABLE); ++i)
    if (failure == MENDABLE[i]) return SONDE_IO;
  return SONDE_DISK;
}
