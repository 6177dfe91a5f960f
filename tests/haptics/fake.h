// What a test sees of a fake vendor library: the variable `fake` of each.
#ifndef SONDE_TESTS_FAKE_H
#define SONDE_TESTS_FAKE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>

typedef struct fake_control {
  atomic_bool plugged;
  atomic_int opened, closed, exchanges;
  _Atomic double force_n[3], position_m[3];
} fake_control;

extern fake_control fake;

#endif
