// Cases and protocols by name or path.
#include "exam_common.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void directory_of(const char *asked, const char *name, char *path, size_t size) {
  assert(size > 1);
  if (asked)
    snprintf(path, size, "%s", asked);
  else if (!app_data_directory(name, path, size))
    path[0] = 0;
}

exam_library exam_library_find(const char *cases, const char *protocols) {
  exam_library library;
  char searched[1024];
  directory_of(cases, "cases", library.cases, sizeof library.cases);
  directory_of(protocols, "protocols", library.protocols, sizeof library.protocols);
  directory_of(NULL, "course", library.course, sizeof library.course);
  library.has_bundled =
      app_bundled_model(library.bundled, sizeof library.bundled, searched, sizeof searched);
  return library;
}

static bool is_path(const char *word) { return strchr(word, '/') || strstr(word, ".yaml"); }

sonde_status exam_find_case(const exam_library *library, const char *word, sonde_case *out,
                            char *directory, size_t size, sonde_error *error) {
  snprintf(directory, size, "%s", library->cases);
  if (is_path(word)) {
    const char *slash = strrchr(word, '/');
    snprintf(directory, size, "%.*s", slash ? (int)(slash - word) : 1, slash ? word : ".");
    return sonde_case_load(word, out, error);
  }
  sonde_case *cases = NULL;
  uint32_t count = 0, k = 0;
  if (!library->cases[0])
    return app_error(error, SONDE_NOT_FOUND, "the cases that ship were not found");
  sonde_status status = sonde_case_list(library->cases, &cases, &count, error);
  while (k < count && strcmp(cases[k].id, word) != 0) ++k;
  if (!status && k == count)
    status = app_error(error, SONDE_NOT_FOUND, "no case '%s' in %.300s (sonde cases lists them)",
                       word, library->cases);
  if (!status) *out = cases[k];
  sonde_free(cases);
  return status;
}

sonde_status exam_find_protocol(const exam_library *library, const char *word,
                                sonde_exam_protocol *out, sonde_error *error) {
  if (is_path(word)) return sonde_exam_protocol_load(word, out, error);
  sonde_exam_protocol *all = NULL;
  uint32_t count = 0, k = 0;
  if (!library->protocols[0])
    return app_error(error, SONDE_NOT_FOUND, "the protocols that ship were not found");
  sonde_status status = sonde_exam_protocol_list(library->protocols, &all, &count, error);
  char known[200] = "";
  for (uint32_t i = 0; i < count; ++i) {
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s%s", i ? ", " : "", all[i].id);
  }
  while (k < count && strcmp(all[k].id, word) != 0) ++k;
  if (!status && k == count)
    status = app_error(error, SONDE_NOT_FOUND, "no protocol '%s', expected %s", word, known);
  if (!status) *out = all[k];
  sonde_free(all);
  return status;
}
