// The loop around the tick.
#include "haptics/loop.h"

#include "base/base.h"
#include "base/clock.h"

#include <math.h>

unsigned sonde_loop_lateness_bin(double lateness_s) {
  static const double edge_s[SONDE_LATENESS_BINS - 1] = {
      10e-6, 20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 50e-3};
  unsigned bin = 0;
  while (bin < SONDE_LATENESS_BINS - 1 && !(lateness_s < edge_s[bin])) bin++;
  return bin;
}

static void add(_Atomic uint64_t *counter, uint64_t amount) {
  uint64_t value = atomic_load_explicit(counter, memory_order_relaxed);
  atomic_store_explicit(counter, value + amount, memory_order_relaxed);
}

void sonde_loop_run(sonde_loop *loop) {
  SONDE_ASSERT(loop->period_s > 0.0 && loop->tick != NULL);
  double start_s = sonde_clock_now();
  uint64_t period = 1; // index of the next wake-up: no rounding adds up
  while (!atomic_load_explicit(&loop->stop, memory_order_acquire)) {
    double due_s = start_s + (double)period * loop->period_s;
    sonde_clock_sleep_until(due_s);
    double woken_s = sonde_clock_now();
    loop->tick(loop->user);
    double done_s = sonde_clock_now(), compute_s = done_s - woken_s;
    add(&loop->lateness[sonde_loop_lateness_bin(woken_s - due_s)], 1);
    double sum = atomic_load_explicit(&loop->compute_sum_s, memory_order_relaxed);
    atomic_store_explicit(&loop->compute_sum_s, sum + compute_s, memory_order_relaxed);
    if (compute_s > atomic_load_explicit(&loop->compute_max_s, memory_order_relaxed))
      atomic_store_explicit(&loop->compute_max_s, compute_s, memory_order_relaxed);
    add(&loop->ticks, 1);
    period++;
    double behind = (done_s - start_s) / loop->period_s - (double)period;
    if (behind > 0.0) {
      uint64_t missed = (uint64_t)ceil(behind);
      add(&loop->misses, missed);
      period += missed;
    }
  }
}
