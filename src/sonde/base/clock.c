// Clocks and absolute sleep (an absolute wake-up time does not drift).
#include "base/clock.h"
#include "base/base.h"

#include <errno.h>
#include <math.h>
#include <time.h>

static double seconds_of(clockid_t clock) {
  struct timespec now;
  clock_gettime(clock, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double sonde_clock_now(void) { return seconds_of(CLOCK_MONOTONIC); }

double sonde_clock_cpu(void) { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }

void sonde_clock_sleep_until(double seconds) {
  SONDE_ASSERT(isfinite(seconds));
  if (seconds <= 0.0) return;
  struct timespec target;
  target.tv_sec = (time_t)seconds;
  target.tv_nsec = (long)ceil(1e9 * (seconds - (double)target.tv_sec)); // never early
  if (target.tv_nsec >= 1000000000L) {
    target.tv_nsec -= 1000000000L;
    target.tv_sec += 1;
  }
  SONDE_ASSERT(target.tv_nsec >= 0 && target.tv_nsec < 1000000000L);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &target, NULL) == EINTR) continue;
}
