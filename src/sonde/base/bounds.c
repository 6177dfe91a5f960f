// Limits of input and the bounded reading of files.
#include "base/bounds.h"

#include "base/disk.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

#define MIB ((uint64_t)1 << 20)

const sonde_input_limits sonde_limits_yaml = {"a YAML file", 4 * MIB, 500000, 32};
const sonde_input_limits sonde_limits_json = {"a JSON file", 4 * MIB, 200000, 32};
const sonde_input_limits sonde_limits_xml = {"an XML file", 4 * MIB, 0, 0};
const sonde_input_limits sonde_limits_table = {"a table", 1024 * MIB, 0, 0};
const sonde_input_limits sonde_limits_mesh = {"a mesh", 1024 * MIB, 50000000, 0};
const sonde_input_limits sonde_limits_image = {"an image file", 16384 * MIB, 200000, 0};
const sonde_input_limits sonde_limits_model = {"a model file", 4096 * MIB, 100000, 16};
const sonde_input_limits sonde_limits_recording = {"a recording", 4096 * MIB, 10000, 16};
const sonde_input_limits sonde_limits_snapshot = {"a snapshot", 4096 * MIB, 0, 0};

static sonde_status fail_size(const char *path, const sonde_input_limits *bounds,
                              sonde_error *error) {
  return sonde_fail(error, SONDE_FORMAT,
                    "%.300s: is larger than %s may be: expected at most %g MiB", path, bounds->what,
                    (double)bounds->most_bytes / (double)MIB);
}

sonde_status sonde_bounded_load(const char *path, const sonde_input_limits *bounds, char **bytes,
                                size_t *count, sonde_error *error) {
  SONDE_ASSERT(path && bounds && bounds->most_bytes > 0);
  *bytes = NULL;
  *count = 0;
  struct stat facts;
  FILE *stream = fopen(path, "rb");
  if (!stream)
    return sonde_fail(error, sonde_disk_status(errno), "%.300s: cannot be opened: %s", path,
                      strerror(errno));
  bool known = fstat(fileno(stream), &facts) == 0;
  if (known && S_ISDIR(facts.st_mode)) {
    fclose(stream);
    return sonde_fail(error, SONDE_IO, "%.300s: is a directory, expected a file", path);
  }
  if (known && S_ISREG(facts.st_mode) && (uint64_t)facts.st_size > bounds->most_bytes) {
    fclose(stream);
    return fail_size(path, bounds, error);
  }

  // The buffer doubles while the file goes on; a pipe does not tell its size.
  size_t used = 0, room = 1 << 16;
  char *buffer = SONDE_NEW(char, room + 1);
  while (buffer) {
    used += fread(buffer + used, 1, room - used, stream);
    SONDE_ASSERT(used <= room);
    if (used < room || used > bounds->most_bytes) break;
    char *grown = sonde_realloc(buffer, room, 2 * room + 1);
    if (!grown) sonde_free(buffer);
    buffer = grown;
    room *= 2;
  }
  sonde_status status = SONDE_OK;
  if (!buffer)
    status = sonde_fail_memory(error);
  else if (used > bounds->most_bytes)
    status = fail_size(path, bounds, error);
  else if (ferror(stream))
    status = sonde_fail(error, sonde_disk_status(errno), "%.300s: cannot be read: %s", path,
                        strerror(errno));
  fclose(stream);
  if (status) {
    sonde_free(buffer);
    return status;
  }
  buffer[used] = 0;
  *bytes = buffer;
  *count = used;
  return SONDE_OK;
}

sonde_status sonde_file_load(const char *path, char **bytes, size_t *count, sonde_error *error) {
  static const sonde_input_limits ANY = {"a file", 16384 * MIB, 0, 0};
  return sonde_bounded_load(path, &ANY, bytes, count, error);
}

uint32_t sonde_line_of(const char *text, const char *at) {
  uint32_t line = 1;
  for (; text < at; ++text) line += *text == '\n';
  return line;
}

sonde_status sonde_bounded_load_text(const char *path, const sonde_input_limits *bounds,
                                     char **text, size_t *count, sonde_error *error) {
  sonde_status status = sonde_bounded_load(path, bounds, text, count, error);
  const char *zero = status ? NULL : memchr(*text, 0, *count);
  if (!zero) return status;
  status = sonde_fail(error, SONDE_FORMAT, "%.300s:%u: contains a zero byte, expected text", path,
                      sonde_line_of(*text, zero));
  sonde_free(*text);
  *text = NULL;
  *count = 0;
  return status;
}
