// A second thread that takes its part of a piece of work. It waits in a loop for some of a
// millisecond, then asleep.
#ifndef SONDE_SRC_SECOND_THREAD_H
#define SONDE_SRC_SECOND_THREAD_H

#include "base/base.h"

typedef struct sonde_second_thread sonde_second_thread;

// @thread owner
sonde_status sonde_second_thread_create(sonde_second_thread **second, sonde_error *error);
// NULL is ignored. @thread owner
void sonde_second_thread_destroy(sonde_second_thread *second);
// work(with, 0) on this thread and work(with, 1) on the other, or, where that one has not begun by
// then, and for NULL, one after the other; returns when both have ended. @thread tick, one at a
// time
void sonde_second_thread_run(sonde_second_thread *second, void (*work)(void *with, uint32_t part),
                             void *with);

#endif
