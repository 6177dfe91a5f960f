// Time for real-time threads.
#ifndef SONDE_SRC_CLOCK_H
#define SONDE_SRC_CLOCK_H

#include "base/link.h"

// Seconds since an arbitrary moment; never goes back. @thread any (tick)
SONDE_LINK double sonde_clock_now(void);

// Processor time that the calling thread has spent, seconds. @thread any (tick)
SONDE_LINK double sonde_clock_cpu(void);

// Sleeps until sonde_clock_now() reaches `seconds`; returns at once when that is in the past.
// @thread any but the tick itself: only the scheduler around it
SONDE_LINK void sonde_clock_sleep_until(double seconds);

#endif
