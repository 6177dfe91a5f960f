// A token in a file that only its owner can read.
//
// read_token   from a file that is private; a file that others can read is no secret any more
// write_token  under a name of its own first: the file is whole or absent
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

// False when there is no usable token: absent, cut short, or readable by others.
static bool read_token(const char *path, char token[SONDE_PAGE_TOKEN]) {
  struct stat about;
  int file = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (file < 0) return false;
  bool mine = fstat(file, &about) == 0 && S_ISREG(about.st_mode) && about.st_uid == geteuid() &&
              (about.st_mode & 077) == 0;
  ssize_t got = mine ? read(file, token, SONDE_PAGE_TOKEN - 1) : 0;
  close(file);
  token[got > 0 ? got : 0] = 0;
  return sonde_page_token_valid(token);
}

static bool write_token(const char *path, const char *token) {
  assert(path[0] && token[0]);
  // The writer locks the temporary file as long as it lives; without a lock it is a killed
  // program's.
  char part[PATH + 32];
  snprintf(part, sizeof part, "%s.part-%06x", path, (unsigned)getpid() & 0xffffff);
  int file = open(part, O_CREAT | O_EXCL | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (file < 0) return false;
  (void)flock(file, LOCK_EX);
  bool whole = write(file, token, strlen(token)) == (ssize_t)strlen(token) && fsync(file) == 0;
  // Another program of the same user may have been first: then its token is the one to use.
  if (whole && link(part, path) && errno != EEXIST) whole = false;
  int problem = errno;
  unlink(part);
  close(file);
  errno = problem;
  return whole;
}

sonde_status page_token_find(const char *directory, const char *name, const char *variable,
                             char token[SONDE_PAGE_TOKEN], sonde_error *error) {
  assert(directory && name);
  char path[PATH];
  const char *given = getenv(variable);
  if (given && !sonde_page_token_valid(given))
    return app_error(error, SONDE_ARGUMENT, "%s must have %d digits from 0-9a-f", variable,
                     SONDE_PAGE_TOKEN - 1);
  if (given) {
    snprintf(token, SONDE_PAGE_TOKEN, "%s", given);
    return SONDE_OK;
  }
  if (snprintf(path, sizeof path, "%s/%s", directory, name) >= PATH)
    return app_error(error, SONDE_IO, "%.300s: the path is too long", directory);
  (void)sonde_file_remove_abandoned(path);
  if (read_token(path, token)) return SONDE_OK;
  unlink(path); // cut short, or not private
  sonde_status status = sonde_page_token_make(token, error);
  if (status) return status;
  if (!write_token(path, token))
    return app_error(error, errno == EACCES || errno == EROFS ? SONDE_IO : SONDE_DISK,
                     "%.300s cannot be written: %s", path, strerror(errno));
  return read_token(path, token)
             ? SONDE_OK
             : app_error(error, SONDE_IO, "%.300s is not a file that only you can read", path);
}
