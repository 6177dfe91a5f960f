// What sonde validate can measure.
#ifndef SONDE_APP_VALIDATE_H
#define SONDE_APP_VALIDATE_H

#include <stdbool.h>

// Each prints its measures and returns the program's exit code.
int validate_image(bool quick, bool json);
// @param pressing a recorded motion, NULL: none @param sites pressed at, 0: all
int validate_haptics(const char *model, const char *pressing, long sites, bool json);

#endif
