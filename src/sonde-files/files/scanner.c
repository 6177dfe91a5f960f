// Scanners as YAML files: a key per number of sonde_scanner_numbers(), and the sliders.
#include "base/base.h"
#include "base/bounds.h"
#include "files/yaml.h"
#include "sonde/files_scanner.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

enum { MOST_KEYS = 64 };

static double *number_at(sonde_scanner *scanner, const sonde_scanner_number *number) {
  return (double *)(void *)((char *)scanner + number->offset);
}

sonde_scanner sonde_scanner_plain(void) {
  sonde_scanner plain = {0};
  uint32_t count;
  const sonde_scanner_number *numbers = sonde_scanner_numbers(&count);
  for (uint32_t k = 0; k < count; ++k)
    *number_at(&plain, &numbers[k]) = numbers[k].plain * numbers[k].si;
  return plain;
}

sonde_status sonde_scanner_load(const char *path, sonde_scanner *scanner, char *title, size_t size,
                                sonde_error *error) {
  SONDE_ASSERT(path != NULL && scanner != NULL);
  uint32_t count;
  size_t length;
  const sonde_scanner_number *numbers = sonde_scanner_numbers(&count);
  const char *keys[MOST_KEYS] = {"sonde_scanner", "title", "sliders_db"};
  SONDE_ASSERT(count + 4 <= MOST_KEYS);
  for (uint32_t k = 0; k < count; ++k) keys[3 + k] = numbers[k].key;
  char *text = NULL;
  sonde_reader *reader = NULL;
  *scanner = sonde_scanner_plain();
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_yaml, &text, &length, error);
  if (!status) status = sonde_reader_create(text, path, &reader, error);
  if (!status) {
    sonde_place root = sonde_reader_root(reader);
    sonde_read_keys(reader, root, "a scanner", keys);
    sonde_read_version(reader, root, "sonde_scanner", "scanner", SONDE_SCANNER_VERSION);
    const char *words = sonde_read_text(reader, root, "title", true);
    if (title && words) snprintf(title, size, "%s", words);
    for (uint32_t k = 0; k < count; ++k) {
      const sonde_scanner_number *n = &numbers[k];
      double value = sonde_read_real(reader, root, n->key, n->low, n->high, n->plain);
      *number_at(scanner, n) = value * n->si;
    }
    sonde_place sliders = sonde_read_find(reader, root, "sliders_db");
    if (sliders && sonde_read_count(reader, sliders) != SONDE_SCANNER_SLIDERS)
      sonde_reader_fail(reader, sliders, SONDE_FORMAT, "%u sliders, expected %d",
                        sonde_read_count(reader, sliders), SONDE_SCANNER_SLIDERS);
    for (uint32_t k = 0; sliders && k < SONDE_SCANNER_SLIDERS && sonde_reader_good(reader); ++k)
      scanner->slider_db[k] =
          sonde_read_real_at(reader, sonde_read_item(reader, sliders, k), "slider", -12, 12);
    status = sonde_reader_status(reader, error);
  }
  sonde_reader_destroy(reader);
  sonde_free(text);
  return status;
}

sonde_status sonde_scanner_find(const char *name, const char *directory, sonde_scanner *scanner,
                                sonde_error *error) {
  SONDE_ASSERT(name && scanner);
  char path[5120];
  *scanner = sonde_scanner_plain();
  if (strcmp(name, "plain") == 0) return SONDE_OK;
  if (strchr(name, '/') || strchr(name, '.'))
    return sonde_scanner_load(name, scanner, NULL, 0, error);
  snprintf(path, sizeof path, "%.4800s/%.256s.yaml", directory ? directory : ".", name);
  if (access(path, R_OK) != 0)
    return sonde_fail(error, SONDE_NOT_FOUND,
                      "no scanner '%s', expected plain, the name of one that ships, or a file with "
                      "a dot or a slash in its name",
                      name);
  return sonde_scanner_load(path, scanner, NULL, 0, error);
}

sonde_status sonde_scanner_save(const sonde_scanner *scanner, const char *title, const char *path,
                                sonde_error *error) {
  SONDE_ASSERT(scanner != NULL && title != NULL && path != NULL);
  uint32_t count;
  const sonde_scanner_number *numbers = sonde_scanner_numbers(&count);
  sonde_scanner copy = *scanner;
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "sonde_scanner: %d\ntitle: \"", SONDE_SCANNER_VERSION);
  for (const char *c = title; *c; ++c)
    sonde_file_printf(file, *c == '"' || *c == '\\' ? "\\%c" : "%c", *c == '\n' ? ' ' : *c);
  sonde_file_printf(file, "\"\n");
  for (uint32_t k = 0; k < count; ++k)
    sonde_file_printf(file, "%s: %.7g\n", numbers[k].key,
                      *number_at(&copy, &numbers[k]) / numbers[k].si);
  sonde_file_printf(file, "sliders_db: [");
  for (int k = 0; k < SONDE_SCANNER_SLIDERS; ++k)
    sonde_file_printf(file, "%s%.3g", k ? ", " : "", scanner->slider_db[k]);
  sonde_file_printf(file, "]\n");
  return sonde_file_commit(file, error);
}
