// Inside of the 1 kHz loop: shared by its cold start and its hot run.
#ifndef SONDE_SRC_LOOP_H
#define SONDE_SRC_LOOP_H

#include "sonde/haptics.h"

#include <pthread.h>
#include <stdatomic.h>

enum { SONDE_LATENESS_BINS = 12 };

// Counters are written by the loop's thread alone and read by any.
struct sonde_loop {
  double period_s;
  sonde_tick_fn tick;
  void *user;
  pthread_t thread;
  atomic_bool stop;
  _Atomic uint64_t ticks, misses, lateness[SONDE_LATENESS_BINS];
  _Atomic double compute_max_s, compute_sum_s;
  bool realtime_priority, memory_locked; // set before the thread runs free
  char note[160];
};

// Runs until loop->stop; the body of the thread.
void sonde_loop_run(sonde_loop *loop);
// Bin of a wake-up lateness.
unsigned sonde_loop_lateness_bin(double lateness_s);

#endif
