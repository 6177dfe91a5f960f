// Atomic output files (temporary neighbour, then rename) and whole-file input.
#include "base/base.h"

#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct sonde_file {
  FILE *stream;
  char *path, *temporary;
  int failure; // first errno, 0 while all is well
};

static void destroy(sonde_file *file) {
  if (!file) return;
  if (file->stream) fclose(file->stream);
  sonde_free(file->path);
  sonde_free(file->temporary);
  sonde_free(file);
}

static char *join(const char *a, const char *b) {
  SONDE_ASSERT(a && b);
  size_t bytes = strlen(a) + strlen(b) + 1;
  char *text = SONDE_NEW(char, bytes);
  if (text) snprintf(text, bytes, "%s%s", a, b);
  return text;
}

sonde_status sonde_file_create(const char *path, sonde_file **out, sonde_error *error) {
  SONDE_ASSERT(path && out);
  *out = NULL;
  sonde_file *file = SONDE_NEW(sonde_file, 1);
  if (!file) return sonde_fail_memory(error);
  file->path = join(path, "");
  file->temporary = join(path, ".part-XXXXXX");
  if (!file->path || !file->temporary) {
    destroy(file);
    return sonde_fail_memory(error);
  }
  int descriptor = mkstemp(file->temporary);
  if (descriptor >= 0) {
    mode_t mask = umask(0);
    umask(mask);
    (void)!fchmod(descriptor, 0666 & ~mask);
    file->stream = fdopen(descriptor, "wb");
  }
  if (!file->stream) {
    int reason = errno;
    destroy(file);
    return sonde_fail(error, SONDE_IO, "%s: cannot be written: %s", path, strerror(reason));
  }
  *out = file;
  return SONDE_OK;
}

void sonde_file_write(sonde_file *file, const void *bytes, size_t count) {
  SONDE_ASSERT(file->stream && (bytes || count == 0));
  if (count && fwrite(bytes, 1, count, file->stream) != count && !file->failure)
    file->failure = errno ? errno : EIO;
}

void sonde_file_printf(sonde_file *file, const char *format, ...) {
  SONDE_ASSERT(file->stream && format);
  va_list arguments;
  va_start(arguments, format);
  if (vfprintf(file->stream, format, arguments) < 0 && !file->failure)
    file->failure = errno ? errno : EIO;
  va_end(arguments);
}

void sonde_file_flush(sonde_file *file) {
  SONDE_ASSERT(file->stream);
  if (fflush(file->stream) && !file->failure) file->failure = errno ? errno : EIO;
}

sonde_status sonde_file_commit(sonde_file *file, sonde_error *error) {
  SONDE_ASSERT(file->stream);
  int failure = file->failure;
  if (!failure && fflush(file->stream)) failure = errno;
  if (!failure && fsync(fileno(file->stream))) failure = errno;
  if (fclose(file->stream) && !failure) failure = errno;
  file->stream = NULL;
  if (!failure && rename(file->temporary, file->path)) failure = errno;
  sonde_status status = SONDE_OK;
  if (failure) {
    status =
        sonde_fail(error, SONDE_IO, "%s: cannot be written: %s", file->path, strerror(failure));
    unlink(file->temporary);
  }
  destroy(file);
  return status;
}

void sonde_file_discard(sonde_file *file) {
  if (!file) return;
  unlink(file->temporary);
  destroy(file);
}

static sonde_status read_all(FILE *stream, const char *path, char **bytes, size_t *count,
                             sonde_error *error) {
  size_t used = 0, room = 1 << 16;
  char *buffer = SONDE_NEW(char, room + 1);
  while (buffer) {
    used += fread(buffer + used, 1, room - used, stream);
    SONDE_ASSERT(used <= room);
    if (used < room) break;
    char *grown = sonde_realloc(buffer, room, 2 * room + 1);
    if (!grown) sonde_free(buffer);
    buffer = grown;
    room *= 2;
  }
  if (!buffer) return sonde_fail_memory(error);
  if (ferror(stream)) {
    sonde_free(buffer);
    return sonde_fail(error, SONDE_IO, "%s: cannot be read: %s", path, strerror(errno));
  }
  buffer[used] = 0;
  *bytes = buffer;
  *count = used;
  return SONDE_OK;
}

sonde_status sonde_file_load(const char *path, char **bytes, size_t *count, sonde_error *error) {
  *bytes = NULL;
  *count = 0;
  struct stat info;
  FILE *stream = fopen(path, "rb");
  if (!stream)
    return sonde_fail(error, SONDE_IO, "%s: cannot be opened: %s", path, strerror(errno));
  if (fstat(fileno(stream), &info) == 0 && S_ISDIR(info.st_mode)) {
    fclose(stream);
    return sonde_fail(error, SONDE_IO, "%s: is a directory, expected a file", path);
  }
  sonde_status status = read_all(stream, path, bytes, count, error);
  fclose(stream);
  return status;
}
