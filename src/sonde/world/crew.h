// A second thread that takes its part of a piece of work. It waits in a loop for some of a
// millisecond, then asleep.
#ifndef SONDE_SRC_CREW_H
#define SONDE_SRC_CREW_H

#include "base/base.h"

typedef struct sonde_crew sonde_crew;

// @thread owner
sonde_status sonde_crew_create(sonde_crew **crew, sonde_error *error);
// NULL is ignored. @thread owner
void sonde_crew_destroy(sonde_crew *crew);
// work(with, 0) on this thread and work(with, 1) on the other, or, where that one has not begun by
// then, and for NULL, one after the other; returns when both have ended. @thread tick, one at a
// time
void sonde_crew_run(sonde_crew *crew, void (*work)(void *with, uint32_t part), void *with);

#endif
