// Monotonic time for real-time threads.
#ifndef SONDE_SRC_CLOCK_H
#define SONDE_SRC_CLOCK_H

// Seconds since an arbitrary moment; never goes back. @thread any (tick)
double sonde_clock_now(void);

// Sleeps until sonde_clock_now() reaches `seconds`; returns at once when that is in the past.
// @thread any but the tick itself: only the scheduler around it
void sonde_clock_sleep_until(double seconds);

#endif
