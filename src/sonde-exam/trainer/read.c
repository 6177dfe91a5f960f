// Texts, stations and questions of cases, protocols and lessons, and the files of a directory.
#include "trainer/course.h"
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
  static const char *const STATION[] = {"station", "shift_mm", NULL};
  *station = (sonde_station){0};
  if (sonde_read_is_text(reader, at)) {
    station->shift_m = 1e-3 * sonde_read_real_at(reader, at, what, 0, 1000);
    return;
  }
  bool mark = sonde_read_find(reader, at, "landmark") != 0;
  bool stands = !mark && sonde_read_find(reader, at, "station") != 0;
  sonde_read_keys(reader, at, what, mark ? MARK : stands ? STATION : KEYS);
  if (mark) {
    sonde_read_member(reader, at, "landmark", true, station->landmark, sizeof station->landmark);
  } else if (stands) {
    sonde_read_member(reader, at, "station", true, station->station, sizeof station->station);
  } else {
    station->of_branch =
        !sonde_read_find(reader, at, "segment") && sonde_read_find(reader, at, "share");
    sonde_read_member(reader, at, "segment", !station->of_branch, station->segment,
                      sizeof station->segment);
    // What files of cases call the vein above the knee, where a thigh ends.
    if (strcmp(station->segment, "popliteal_near") == 0) strcpy(station->segment, "popliteal");
    station->share = sonde_read_real(reader, at, "share", 0, 1, 0.5);
  }
  station->shift_m = 1e-3 * sonde_read_real(reader, at, "shift_mm", -1000, 1000, 0);
}

void sonde_read_question(sonde_reader *reader, sonde_place at, sonde_question *q) {
  static const char *const KEYS[] = {"ask", "choices", "right", "why", NULL};
  sonde_read_keys(reader, at, "a question", KEYS);
  sonde_read_member(reader, at, "ask", true, q->ask, sizeof q->ask);
  sonde_read_member(reader, at, "why", true, q->why, sizeof q->why);
  sonde_place list = sonde_read_find(reader, at, "choices");
  q->choice_count = sonde_read_count(reader, list);
  if (q->choice_count < 2 || q->choice_count > SONDE_LESSON_CHOICES) {
    sonde_reader_fail(reader, at, SONDE_FORMAT, "%u choices, expected 2 to %d", q->choice_count,
                      SONDE_LESSON_CHOICES);
    q->choice_count = 0;
    return;
  }
  for (uint32_t i = 0; i < q->choice_count; ++i) {
    sonde_place item = sonde_read_item(reader, list, i);
    const char *text = sonde_read_text_at(reader, item, "a choice");
    if (text && strlen(text) >= sizeof q->choice[i])
      sonde_reader_fail(reader, item, SONDE_FORMAT, "a choice has %zu bytes, expected at most %zu",
                        strlen(text), sizeof q->choice[i] - 1);
    snprintf(q->choice[i], sizeof q->choice[i], "%s", text ? text : "");
  }
  q->right = sonde_read_integer(reader, at, "right", 1, q->choice_count, UINT32_MAX) - 1;
  if (!sonde_read_find(reader, at, "right"))
    sonde_reader_fail(reader, at, SONDE_FORMAT, "right is missing: the number of the right choice");
}

static int compare_names(const void *a, const void *b) { return strcmp(a, b); }

sonde_status sonde_load_directory(const char *directory, size_t item_bytes, sonde_item_load load,
                                  void **items, uint32_t *count, sonde_error *error) {
  SONDE_ASSERT(directory && items && count && item_bytes > 0);
  *items = NULL;
  *count = 0;
  char(*names)[NAME_BYTES] = sonde_calloc(FILES_MAX, NAME_BYTES);
  if (!names) return sonde_fail_memory(error);

  // The *.yaml of the directory, in the order of their names.
  uint32_t found = 0;
  sonde_status status = SONDE_OK;
  DIR *open = opendir(directory);
  if (!open) status = sonde_fail(error, SONDE_IO, "%s: %s", directory, strerror(errno));
  for (struct dirent *entry; !status && (entry = readdir(open));) {
    const char *name = entry->d_name;
    size_t length = strlen(name);
    if (length <= 5 || length >= NAME_BYTES || name[0] == '.' || strcmp(name + length - 5, ".yaml"))
      continue;
    if (found == FILES_MAX)
      status = sonde_fail(error, SONDE_ARGUMENT, "%s: more than %d files", directory, FILES_MAX);
    else
      snprintf(names[found++], NAME_BYTES, "%s", name);
  }
  if (open) closedir(open);
  SONDE_ASSERT(found <= FILES_MAX);
  qsort(names, found, NAME_BYTES, compare_names);

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
