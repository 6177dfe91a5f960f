// sonde bench --haptics.
#ifndef SONDE_APP_BENCH_HAPTICS_H
#define SONDE_APP_BENCH_HAPTICS_H

#include <stdbool.h>

// Presses the model in real time with the simulated hand and a device's limits. csv: one row per
// tick, may be NULL. Returns the program's exit code.
int bench_haptics(const char *model_path, const char *device, double seconds, bool json,
                  const char *csv);

#endif
