// Shared by the readers of cases and protocols: texts, stations, directories.
// compare_names:  order of file names.
// list_names:     the *.yaml of a directory, sorted.
#include "trainer/trainer.h"

#include <dirent.h>
#include <errno.h>
#include <string.h>

enum { FILES_MAX = 512, NAME_BYTES = 256 };

void sonde_read_member(sonde_reader *reader, sonde_place map, const char *key, bool needed,
                       char *to, size_t size) {
  SONDE_ASSERT(size > 1);
  const char *text = sonde_read_text(reader, map, key, needed);
  if (!text) return;
  size_t length = strlen(text);
  while (length > 0 && (text[length - 1] == '\n' || text[length - 1] == ' ')) length--;
  if (length >= size) {
    sonde_reader_fail(reader, sonde_read_find(reader, map, key), SONDE_FORMAT,
                      "%s has %zu bytes, expected at most %zu", key, length, size - 1);
    return;
  }
  memcpy(to, text, length);
  to[length] = 0;
}

void sonde_read_station(sonde_reader *reader, sonde_place at, const char *what,
                        sonde_station *station) {
  static const char *const KEYS[] = {"segment", "share", "shift_mm", NULL};
  static const char *const MARK[] = {"landmark", "shift_mm", NULL};
  *station = (sonde_station){0};
  if (sonde_read_is_text(reader, at)) {
    station->shift_m = 1e-3 * sonde_read_real_at(reader, at, what, 0, 1000);
    return;
  }
  bool mark = sonde_read_find(reader, at, "landmark") != 0;
  sonde_read_keys(reader, at, what, mark ? MARK : KEYS);
  if (mark) {
    sonde_read_member(reader, at, "landmark", true, station->landmark, sizeof station->landmark);
  } else {
    sonde_read_member(reader, at, "segment", true, station->segment, sizeof station->segment);
    station->share = sonde_read_real(reader, at, "share", 0, 1, 0.5);
  }
  station->shift_m = 1e-3 * sonde_read_real(reader, at, "shift_mm", -1000, 1000, 0);
}

static int compare_names(const void *a, const void *b) { return strcmp(a, b); }

static bool is_yaml(const char *name) {
  size_t length = strlen(name);
  return length > 5 && length < NAME_BYTES && name[0] != '.' &&
         strcmp(name + length - 5, ".yaml") == 0;
}

// @param names [FILES_MAX] of NAME_BYTES each
static sonde_status list_names(const char *directory, char (*names)[NAME_BYTES], uint32_t *count,
                               sonde_error *error) {
  DIR *open = opendir(directory);
  if (!open) return sonde_fail(error, SONDE_IO, "%s: %s", directory, strerror(errno));
  sonde_status status = SONDE_OK;
  *count = 0;
  for (struct dirent *entry; !status && (entry = readdir(open));) {
    if (!is_yaml(entry->d_name)) continue;
    if (*count == FILES_MAX)
      status = sonde_fail(error, SONDE_ARGUMENT, "%s: more than %d files", directory, FILES_MAX);
    else
      snprintf(names[(*count)++], NAME_BYTES, "%s", entry->d_name);
  }
  closedir(open);
  qsort(names, *count, NAME_BYTES, compare_names);
  return status;
}

sonde_status sonde_load_directory(const char *directory, size_t item_bytes, sonde_item_load load,
                                  void **items, uint32_t *count, sonde_error *error) {
  SONDE_ASSERT(directory && items && count);
  *items = NULL;
  *count = 0;
  char(*names)[NAME_BYTES] = sonde_calloc(FILES_MAX, NAME_BYTES);
  if (!names) return sonde_fail_memory(error);
  uint32_t found = 0;
  sonde_status status = list_names(directory, names, &found, error);
  char *all = status ? NULL : sonde_calloc(found, item_bytes);
  if (!status && !all) status = sonde_fail_memory(error);
  for (uint32_t i = 0; i < found && !status; ++i) {
    char path[4096];
    snprintf(path, sizeof path, "%.3800s/%s", directory, names[i]);
    status = load(path, all + i * item_bytes, error);
  }
  sonde_free(names);
  if (status) {
    sonde_free(all);
    return status;
  }
  *items = all;
  *count = found;
  return SONDE_OK;
}

void sonde_json_text(sonde_file *file, const char *text) {
  sonde_file_printf(file, "\"");
  for (const unsigned char *c = (const unsigned char *)text; *c; ++c) {
    if (*c == '"' || *c == '\\')
      sonde_file_printf(file, "\\%c", *c);
    else if (*c < 0x20)
      sonde_file_printf(file, "\\u%04x", *c);
    else
      sonde_file_write(file, c, 1);
  }
  sonde_file_printf(file, "\"");
}

void sonde_json_real(sonde_file *file, double value) {
  if (isfinite(value))
    sonde_file_printf(file, "%.9g", value);
  else
    sonde_file_printf(file, "null");
}
