// Scanners by name or file.
#ifndef SONDE_APP_SCANNER_CHOICE_H
#define SONDE_APP_SCANNER_CHOICE_H

#include "app.h"

// The scanner "plain", a scanner that ships, or a file.
sonde_status scanner_choose(const char *name, sonde_scanner *scanner, sonde_error *error);

#endif
