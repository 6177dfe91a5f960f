// Scanners by name or file.
#include "scanner_choice.h"

sonde_status scanner_choose(const char *name, sonde_scanner *scanner, sonde_error *error) {
  char directory[4096];
  app_data_directory("scanners", directory, sizeof directory);
  return sonde_scanner_find(name, directory, scanner, error);
}
