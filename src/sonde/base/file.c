// Output files: whole or not at all beside their place, or straight into what cannot be replaced.
#include "base/base.h"
#include "base/disk.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { BUFFER = 1 << 16, NAME_KEPT = 200 };

struct sonde_file {
  int descriptor;
  int failure;     // first errno, 0 while all is well
  bool keep;       // what was written stays also after a failure
  char *path;      // as the caller gave it, for messages
  char *target;    // what the rename replaces; NULL: written straight
  char *temporary; // NULL: written straight
  char *memory;    // of a file in memory [memory_room]
  size_t memory_used, memory_room;
  size_t used;
  char buffer[BUFFER];
};

static void destroy(sonde_file *file) {
  if (!file) return;
  if (file->descriptor >= 0) (void)sonde_disk_close(file->descriptor);
  sonde_free(file->path);
  sonde_free(file->target);
  sonde_free(file->temporary);
  sonde_free(file->memory);
  sonde_free(file);
}

static char *copy_of(const char *text) {
  size_t bytes = strlen(text) + 1;
  char *copy = SONDE_NEW(char, bytes);
  if (copy) memcpy(copy, text, bytes);
  return copy;
}

// ---- opening --------------------------------------------------------------------------------

// A name that nobody has, with the mode of the file that it will replace or the usual one.
static int open_beside(sonde_file *file, const struct stat *old) {
  static atomic_uint counter;
  const char *name = strrchr(file->target, '/') + 1;
  size_t head = (size_t)(name - file->target), room = strlen(file->target) + 32;
  file->temporary = SONDE_NEW(char, room);
  if (!file->temporary) return ENOMEM;
  int failure = EEXIST;
  for (int attempt = 0; attempt < 100 && failure == EEXIST; ++attempt) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    uint64_t seed[4] = {(uint64_t)now.tv_sec, (uint64_t)now.tv_nsec, (uint64_t)getpid(),
                        atomic_fetch_add(&counter, 1)};
    unsigned mark = (unsigned)(sonde_hash(0, seed, sizeof seed) & 0xffffff);
    snprintf(file->temporary, room, "%.*s%.*s.part-%06x", (int)head, file->target, NAME_KEPT, name,
             mark);
    failure =
        sonde_disk_open(file->temporary, O_WRONLY | O_CREAT | O_EXCL, 0666, &file->descriptor);
  }
  if (!failure) (void)flock(file->descriptor, LOCK_EX | LOCK_NB); // says that it is being written
  if (!failure && old) {                                          // neither is worth a failure
    (void)!fchown(file->descriptor, old->st_uid, old->st_gid);
    (void)!fchmod(file->descriptor, old->st_mode & 0777);
  }
  return failure;
}

static int open_output(sonde_file *file) {
  char target[PATH_MAX];
  int own = -1, failure = sonde_disk_follow(file->path, target, &own);
  if (failure) return failure;
  if (own >= 0) {
    fflush(stdout); // its bytes come first
    file->descriptor = fcntl(own, F_DUPFD_CLOEXEC, 0);
    return file->descriptor < 0 ? errno : 0;
  }
  file->target = copy_of(target);
  if (!file->target) return ENOMEM;
  struct stat info;
  if (stat(target, &info) != 0) return errno == ENOENT ? open_beside(file, NULL) : errno;
  // A directory is refused, a regular file will be replaced; a pipe, a terminal and /dev/null are
  // written into.
  if (S_ISDIR(info.st_mode)) return EISDIR;
  if (!S_ISREG(info.st_mode))
    return sonde_disk_open(target, O_WRONLY | O_NOCTTY, 0, &file->descriptor);
  return access(target, W_OK) == 0 ? open_beside(file, &info) : errno;
}

static sonde_file *new_file(const char *path) {
  sonde_file *file = SONDE_NEW(sonde_file, 1);
  if (!file) return NULL;
  file->descriptor = -1;
  file->path = copy_of(path);
  if (file->path) return file;
  sonde_free(file);
  return NULL;
}

static sonde_status fail_to_write(const char *path, int failure, sonde_error *error) {
  return sonde_fail(error, sonde_disk_status(failure), "%s: cannot be written: %s", path,
                    strerror(failure));
}

sonde_status sonde_file_create(const char *path, sonde_file **out, sonde_error *error) {
  SONDE_ASSERT(path && out);
  *out = NULL;
  sonde_file *file = new_file(path);
  if (!file) return sonde_fail_memory(error);
  int failure = open_output(file);
  if (!failure) {
    *out = file;
    return SONDE_OK;
  }
  destroy(file);
  return failure == ENOMEM ? sonde_fail_memory(error) : fail_to_write(path, failure, error);
}

sonde_status sonde_file_check(const char *path, sonde_error *error) {
  SONDE_ASSERT(path);
  char target[PATH_MAX];
  struct stat info;
  int own = -1, failure = sonde_disk_follow(path, target, &own);
  if (!failure && own < 0) {
    bool exists = stat(target, &info) == 0;
    if (exists && S_ISDIR(info.st_mode)) failure = EISDIR;
    if (exists && !failure && access(target, W_OK) != 0) failure = errno;
    if (!failure && (!exists || S_ISREG(info.st_mode))) { // a temporary file will stand beside it
      strrchr(target, '/')[1] = 0;
      if (access(target, W_OK | X_OK) != 0) failure = errno;
    }
  }
  return failure ? fail_to_write(path, failure, error) : SONDE_OK;
}

sonde_status sonde_file_extend(const char *path, uint64_t keep, sonde_file **out,
                               sonde_error *error) {
  SONDE_ASSERT(path && out);
  *out = NULL;
  sonde_file *file = new_file(path);
  if (!file) return sonde_fail_memory(error);
  int failure = sonde_disk_open(path, O_WRONLY | O_CREAT | O_APPEND, 0666, &file->descriptor);
  struct stat info;
  if (!failure && fstat(file->descriptor, &info)) failure = errno;
  if (!failure && S_ISREG(info.st_mode)) {
    file->keep = true;
    SONDE_ASSERT(keep <= (uint64_t)info.st_size);
    failure = sonde_disk_truncate(file->descriptor, (off_t)keep);
  }
  if (!failure) {
    *out = file;
    return SONDE_OK;
  }
  destroy(file);
  return fail_to_write(path, failure, error);
}

// ---- writing --------------------------------------------------------------------------------

static void put(sonde_file *file, const void *bytes, size_t count) {
  size_t written;
  if (!file->failure && !file->memory)
    file->failure = sonde_disk_write(file->descriptor, bytes, count, &written);
  if (file->failure || !file->memory) return;
  while (file->memory_room - file->memory_used <= count) { // a 0 behind it fits too
    char *grown = sonde_realloc(file->memory, file->memory_room, 2 * file->memory_room);
    if (!grown) {
      file->failure = ENOMEM;
      return;
    }
    file->memory = grown;
    file->memory_room *= 2;
  }
  memcpy(file->memory + file->memory_used, bytes, count);
  file->memory_used += count;
}

static void put_buffer(sonde_file *file) {
  if (file->used) put(file, file->buffer, file->used);
  file->used = 0;
}

void sonde_file_write(sonde_file *file, const void *bytes, size_t count) {
  SONDE_ASSERT((file->descriptor >= 0 || file->memory) && (bytes || count == 0));
  if (count > BUFFER - file->used) put_buffer(file);
  if (count > BUFFER) {
    put(file, bytes, count);
  } else if (count) {
    memcpy(file->buffer + file->used, bytes, count);
    file->used += count;
  }
}

void sonde_file_printf(sonde_file *file, const char *format, ...) {
  SONDE_ASSERT(format);
  char line[2048], *text = line;
  va_list arguments, again;
  va_start(arguments, format);
  va_copy(again, arguments);
  int length = vsnprintf(line, sizeof line, format, arguments);
  if (length >= (int)sizeof line) {
    text = SONDE_NEW(char, (size_t)length + 1);
    if (text) vsnprintf(text, (size_t)length + 1, format, again);
  }
  va_end(again);
  va_end(arguments);
  if (length >= 0 && text)
    sonde_file_write(file, text, (size_t)length);
  else if (!file->failure)
    file->failure = text ? EILSEQ : ENOMEM;
  if (text != line) sonde_free(text);
}

sonde_status sonde_file_flush(sonde_file *file, sonde_error *error) {
  SONDE_ASSERT(file->descriptor >= 0);
  put_buffer(file);
  return file->failure ? fail_to_write(file->path, file->failure, error) : SONDE_OK;
}

const char *sonde_file_temporary(const sonde_file *file) { return file->temporary; }

sonde_status sonde_file_commit(sonde_file *file, sonde_error *error) {
  SONDE_ASSERT(file->descriptor >= 0);
  put_buffer(file);
  int failure = file->failure;
  bool stays = file->temporary || file->keep; // a pipe or a terminal cannot be synced
  if (!failure && stays) failure = sonde_disk_sync(file->descriptor);
  int closed = sonde_disk_close(file->descriptor);
  file->descriptor = -1;
  if (!failure) failure = closed;
  if (!failure && file->temporary) {
    failure = sonde_disk_rename(file->temporary, file->target);
    if (!failure) {
      sonde_free(file->temporary);
      file->temporary = NULL;
      failure = sonde_disk_sync_directory(file->target);
    }
  }
  sonde_status status = failure ? fail_to_write(file->path, failure, error) : SONDE_OK;
  if (file->temporary) (void)sonde_disk_remove(file->temporary);
  destroy(file);
  return status;
}

void sonde_file_discard(sonde_file *file) {
  if (!file) return;
  if (file->keep) put_buffer(file);
  if (file->temporary) (void)sonde_disk_remove(file->temporary);
  destroy(file);
}

uint32_t sonde_file_remove_abandoned(const char *path) {
  SONDE_ASSERT(path);
  char target[PATH_MAX];
  int own = -1;
  uint32_t removed = 0;
  if (sonde_disk_follow(path, target, &own) || own >= 0) return 0;
  char *name = strrchr(target, '/');
  if (!name) return 0;
  *name++ = 0;
  size_t kept = strlen(name) < NAME_KEPT ? strlen(name) : NAME_KEPT;
  DIR *list = opendir(target[0] ? target : "/");
  for (const struct dirent *entry; list && (entry = readdir(list));) {
    // A temporary file is called NAME.part-xxxxxx; its writer holds the lock as long as it lives.
    const char *mark = entry->d_name + kept;
    if (strncmp(entry->d_name, name, kept) != 0 || strncmp(mark, ".part-", 6) != 0 ||
        strspn(mark + 6, "0123456789abcdef") != 6 || mark[12] != 0)
      continue;
    char part[2 * PATH_MAX];
    snprintf(part, sizeof part, "%s/%s", target, entry->d_name);
    int descriptor = open(part, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    bool abandoned = descriptor >= 0 && flock(descriptor, LOCK_EX | LOCK_NB) == 0;
    if (descriptor >= 0) (void)close(descriptor);
    if (abandoned) removed += sonde_disk_remove(part) == 0;
  }
  if (list) closedir(list);
  return removed;
}

sonde_status sonde_file_in_memory(sonde_file **out, sonde_error *error) {
  SONDE_ASSERT(out);
  sonde_file *file = new_file("memory");
  *out = NULL;
  if (file) file->memory = SONDE_NEW(char, BUFFER);
  if (!file || !file->memory) {
    destroy(file);
    return sonde_fail_memory(error);
  }
  file->memory_room = BUFFER;
  *out = file;
  return SONDE_OK;
}

sonde_status sonde_file_take(sonde_file *file, char **bytes, size_t *count, sonde_error *error) {
  SONDE_ASSERT(file->memory && bytes && count);
  put_buffer(file);
  sonde_status status = file->failure ? sonde_fail_memory(error) : SONDE_OK;
  *bytes = NULL;
  *count = 0;
  if (!status) {
    *bytes = file->memory;
    *count = file->memory_used;
    file->memory[file->memory_used] = 0;
    file->memory = NULL;
  }
  destroy(file);
  return status;
}

static sonde_status make_one(const char *path, unsigned mode, sonde_error *error) {
  struct stat info;
  int failure = sonde_disk_directory(path, (mode_t)mode);
  if (failure == EEXIST) failure = stat(path, &info) == 0 && S_ISDIR(info.st_mode) ? 0 : ENOTDIR;
  if (!failure) return SONDE_OK;
  return sonde_fail(error, sonde_disk_status(failure),
                    "%s: cannot be made or used as a directory: %s", path, strerror(failure));
}

sonde_status sonde_directory_make(const char *path, unsigned mode, bool parents,
                                  sonde_error *error) {
  SONDE_ASSERT(path);
  char *part = copy_of(path);
  if (!part) return sonde_fail_memory(error);
  sonde_status status = SONDE_OK;
  for (char *c = part; parents && *c && !status; ++c) {
    if (*c != '/' || c == part) continue;
    *c = 0;
    if (access(part, F_OK) != 0) status = make_one(part, mode, error);
    *c = '/';
  }
  sonde_free(part);
  return status ? status : make_one(path, mode, error);
}
