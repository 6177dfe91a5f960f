// Preloaded into a program: counts its calls that change files under DISK_FAULTS_UNDER, those of
// SQLite too, and lets one of them go wrong.
//   DISK_FAULTS_AT=K      the K-th call, from 0; absent: none
//   DISK_FAULTS_HOW       kill: the program dies before it; torn: half of a write happens, then it
//                         dies; full: this and all later ones fail with ENOSPC; once: only this one
//   DISK_FAULTS_COUNT     file that gets the number of calls when the program ends by itself
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { FILES = 4096 };

static atomic_bool ours[FILES]; // descriptors of files under the directory
static atomic_int calls;
static const char *under, *how;
static int at = -1;

#define REAL(type, name, ...) ((type(*)(__VA_ARGS__))real(#name))

static void *real(const char *name) {
  void *function = dlsym(RTLD_NEXT, name);
  if (!function) abort();
  return function;
}

__attribute__((constructor)) static void begin(void) {
  const char *number = getenv("DISK_FAULTS_AT");
  under = getenv("DISK_FAULTS_UNDER");
  how = getenv("DISK_FAULTS_HOW");
  at = number && how ? atoi(number) : -1;
}

__attribute__((destructor)) static void end(void) {
  const char *path = getenv("DISK_FAULTS_COUNT");
  FILE *file = path ? fopen(path, "w") : NULL;
  if (!file) return;
  fprintf(file, "%d\n", atomic_load(&calls));
  fclose(file);
}

static bool is_ours(const char *path) {
  return under && path && strncmp(path, under, strlen(under)) == 0;
}

static bool is_open_here(int file) { return file >= 0 && file < FILES && atomic_load(&ours[file]); }

// Whether this call fails; a kill does not return.
static bool strikes(bool is_write) {
  int number = atomic_fetch_add(&calls, 1);
  if (at < 0 || number < at) return false;
  if (strcmp(how, "kill") == 0 || (strcmp(how, "torn") == 0 && !is_write)) raise(SIGKILL);
  if (number > at && strcmp(how, "once") == 0) return false;
  if (number > at && strcmp(how, "torn") == 0) raise(SIGKILL);
  errno = ENOSPC;
  return true;
}

static int opened(const char *path, int file) {
  if (file >= 0 && file < FILES) atomic_store(&ours[file], is_ours(path));
  return file;
}

#define OPEN(name)                                                                                 \
  int name(const char *path, int flags, ...) {                                                     \
    va_list arguments;                                                                             \
    va_start(arguments, flags);                                                                    \
    mode_t mode = flags & O_CREAT ? va_arg(arguments, mode_t) : 0;                                 \
    va_end(arguments);                                                                             \
    if ((flags & O_ACCMODE) != O_RDONLY && is_ours(path) && strikes(false)) return -1;             \
    return opened(path, REAL(int, name, const char *, int, ...)(path, flags, mode));               \
  }
OPEN(open)
OPEN(open64)

// Half of the bytes of a call that fails reach the file.
ssize_t write(int file, const void *bytes, size_t count) {
  ssize_t (*next)(int, const void *, size_t) = REAL(ssize_t, write, int, const void *, size_t);
  if (!is_open_here(file) || !strikes(true)) return next(file, bytes, count);
  (void)!next(file, bytes, count / 2);
  if (count / 2 > 0 && strcmp(how, "torn") != 0) return (ssize_t)(count / 2);
  if (strcmp(how, "torn") == 0) raise(SIGKILL);
  errno = ENOSPC;
  return -1;
}

#define PWRITE(name, offset_type)                                                                  \
  ssize_t name(int file, const void *bytes, size_t count, offset_type offset) {                    \
    ssize_t (*next)(int, const void *, size_t, offset_type) =                                      \
        REAL(ssize_t, name, int, const void *, size_t, offset_type);                               \
    if (!is_open_here(file) || !strikes(true)) return next(file, bytes, count, offset);            \
    (void)!next(file, bytes, count / 2, offset);                                                   \
    if (strcmp(how, "torn") == 0) raise(SIGKILL);                                                  \
    errno = ENOSPC;                                                                                \
    return -1;                                                                                     \
  }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)

#define ON_FILE(name)                                                                              \
  int name(int file) {                                                                             \
    if (is_open_here(file) && strikes(false)) return -1;                                           \
    return REAL(int, name, int)(file);                                                             \
  }
ON_FILE(fsync)
ON_FILE(fdatasync)

#define TRUNCATE(name, size_type)                                                                  \
  int name(int file, size_type size) {                                                             \
    if (is_open_here(file) && strikes(false)) return -1;                                           \
    return REAL(int, name, int, size_type)(file, size);                                            \
  }
TRUNCATE(ftruncate, off_t)
TRUNCATE(ftruncate64, off64_t)

int rename(const char *from, const char *to) {
  if (is_ours(to) && strikes(false)) return -1;
  return REAL(int, rename, const char *, const char *)(from, to);
}

int unlink(const char *path) { // a full disk lets files go
  if (is_ours(path) && strikes(false) && strcmp(how, "full") != 0) return -1;
  return REAL(int, unlink, const char *)(path);
}

int mkdir(const char *path, mode_t mode) {
  if (is_ours(path) && strikes(false)) return -1;
  return REAL(int, mkdir, const char *, mode_t)(path, mode);
}

int close(int file) {
  bool here = is_open_here(file);
  if (here) (void)strikes(false);
  if (here) atomic_store(&ours[file], false);
  return REAL(int, close, int)(file);
}
