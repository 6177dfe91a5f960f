// A secret in a file that only its owner can read.
//
// read_secret   from a file that is private; a file that others can read is no secret any more
// write_secret  under a name of its own first: the file is whole or absent
#include "page_token.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATH = 4096 };

// A kind of secret: its form, and how a new one is made.
typedef struct secret_kind {
  bool (*valid)(const char *text);
  sonde_status (*make)(char *text, sonde_error *error);
  size_t size;
  const char *what;
  bool kept; // a file without a usable one is the user's own, and not replaced
} secret_kind;

// False when there is no usable secret: absent, cut short, or readable by others.
static bool read_secret(const char *path, const secret_kind *kind, char *text) {
  struct stat about;
  int file = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (file < 0) return false;
  bool mine = fstat(file, &about) == 0 && S_ISREG(about.st_mode) && about.st_uid == geteuid() &&
              (about.st_mode & 077) == 0;
  ssize_t got = mine ? read(file, text, kind->size - 1) : 0;
  close(file);
  text[got > 0 ? got : 0] = 0;
  return kind->valid(text);
}

static bool write_secret(const char *path, const char *text) {
  assert(path[0] && text[0]);
  // The writer locks the temporary file as long as it lives; without a lock it is a killed
  // program's.
  char part[PATH + 32];
  snprintf(part, sizeof part, "%s.part-%06x", path, (unsigned)getpid() & 0xffffff);
  int file = open(part, O_CREAT | O_EXCL | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (file < 0) return false;
  (void)flock(file, LOCK_EX);
  bool whole = write(file, text, strlen(text)) == (ssize_t)strlen(text) && fsync(file) == 0;
  // Another program of the same user may have been first: then its token is the one to use.
  if (whole && link(part, path) && errno != EEXIST) whole = false;
  int problem = errno;
  unlink(part);
  close(file);
  errno = problem;
  return whole;
}

static sonde_status find_secret(const char *directory, const char *name, const secret_kind *kind,
                                char *text, sonde_error *error) {
  char path[PATH];
  assert(directory && name && kind->size > 1);
  if (snprintf(path, sizeof path, "%s/%s", directory, name) >= PATH)
    return app_error(error, SONDE_IO, "%.300s: the path is too long", directory);
  (void)sonde_file_remove_abandoned(path);
  if (read_secret(path, kind, text)) return SONDE_OK;
  if (kind->kept && access(path, F_OK) == 0)
    return app_error(error, SONDE_IO, "%.300s is not %s that only you can read (chmod 600)", path,
                     kind->what);
  unlink(path); // cut short, or not private
  sonde_status status = kind->make(text, error);
  if (status) return status;
  if (!write_secret(path, text))
    return app_error(error, errno == EACCES || errno == EROFS ? SONDE_IO : SONDE_DISK,
                     "%.300s cannot be written: %s", path, strerror(errno));
  return read_secret(path, kind, text)
             ? SONDE_OK
             : app_error(error, SONDE_IO, "%.300s is not %s that only you can read", path,
                         kind->what);
}

sonde_status page_token_find(const char *directory, const char *name, const char *variable,
                             char token[SONDE_PAGE_TOKEN], sonde_error *error) {
  static const secret_kind KIND = {sonde_page_token_valid, sonde_page_token_make, SONDE_PAGE_TOKEN,
                                   "a file", false};
  const char *given = getenv(variable);
  if (given && !sonde_page_token_valid(given))
    return app_error(error, SONDE_ARGUMENT, "%s must have %d digits from 0-9a-f", variable,
                     SONDE_PAGE_TOKEN - 1);
  if (!given) return find_secret(directory, name, &KIND, token, error);
  snprintf(token, SONDE_PAGE_TOKEN, "%s", given);
  return SONDE_OK;
}

static bool is_identity(const char *pem) {
  return strstr(pem, "PRIVATE KEY-----") && strstr(pem, "-----END CERTIFICATE-----");
}

sonde_status page_identity_find(const char *directory, const char *name,
                                char pem[SONDE_DOOR_IDENTITY], sonde_error *error) {
  static const secret_kind KIND = {is_identity, sonde_door_identity_make, SONDE_DOOR_IDENTITY,
                                   "a private key with its certificate", true};
  return find_secret(directory, name, &KIND, pem, error);
}
