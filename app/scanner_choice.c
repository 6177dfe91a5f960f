// Scanners by name or file.
#include "scanner_choice.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

sonde_status scanner_choose(const char *name, sonde_scanner *scanner, sonde_error *error) {
  char directory[4096], path[5120];
  assert(scanner != NULL);
  assert(name != NULL);
  if (strcmp(name, "plain") == 0) {
    *scanner = sonde_scanner_plain();
    return SONDE_OK;
  }
  if (strchr(name, '/') || strchr(name, '.'))
    return sonde_scanner_load(name, scanner, NULL, 0, error);
  app_data_directory("scanners", directory, sizeof directory);
  snprintf(path, sizeof path, "%s/%.256s.yaml", directory, name);
  if (access(path, R_OK) != 0)
    return app_error(error, SONDE_NOT_FOUND,
                     "no scanner '%s'; expected plain, one that `sonde scanner list` names, or a "
                     "file with a dot or a slash in its name",
                     name);
  return sonde_scanner_load(path, scanner, NULL, 0, error);
}
