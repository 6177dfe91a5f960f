// The package of SCORM 1.2 by which a learning management system opens a class and keeps its
// scores.
#ifndef SONDE_APP_CLASS_SCORM_H
#define SONDE_APP_CLASS_SCORM_H

#include "app.h"

// Writes the package: a manifest that holds the class's address, and the page that the system
// shows. A file of that name stays as it was when something fails.
// Returns IO, or NOT_FOUND for a program that was built without pages.
sonde_status class_scorm_write(const char *path, const char *address, sonde_error *error);

#endif
