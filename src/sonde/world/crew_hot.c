// Work for two threads, asked for on the tick path.
#include "world/crew_inside.h"

void sonde_crew_run(sonde_crew *crew, void (*work)(void *with, uint32_t part), void *with) {
  if (!crew) {
    for (uint32_t part = 0; part < 2; ++part) work(with, part);
    return;
  }
  crew->work = work, crew->with = with;
  unsigned piece = atomic_fetch_add(&crew->asked, 1) + 1;
  if (atomic_exchange(&crew->asleep, false)) sem_post(&crew->wake);
  work(with, 0);
  if (sonde_crew_take(crew, piece)) {
    work(with, 1);
    return;
  }
  while (atomic_load_explicit(&crew->done, memory_order_acquire) != piece) sonde_crew_pause();
}
