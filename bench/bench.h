// What measuring programs share.
#ifndef SONDE_BENCH_H
#define SONDE_BENCH_H

#include "base/order.h"

#include <time.h>

// Processor time of this thread, s.
static inline double bench_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// Wall clock, for what several threads share.
static inline double bench_wall_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline void bench_sort(double *list, size_t count) {
  qsort(list, count, sizeof *list, sonde_compare_reals);
}

#endif
