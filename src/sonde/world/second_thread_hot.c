// Work for two threads, asked for on the tick path.
#include "world/second_thread_inside.h"

void sonde_second_thread_run(sonde_second_thread *second, void (*work)(void *with, uint32_t part),
                             void *with) {
  if (!second) {
    for (uint32_t part = 0; part < 2; ++part) work(with, part);
    return;
  }
  second->work = work, second->with = with;
  unsigned piece = atomic_fetch_add(&second->asked, 1) + 1;
  if (atomic_exchange(&second->asleep, false)) sem_post(&second->wake);
  work(with, 0);
  if (sonde_second_thread_take(second, piece)) {
    work(with, 1);
    return;
  }
  while (atomic_load_explicit(&second->done, memory_order_acquire) != piece)
    sonde_second_thread_pause();
}
