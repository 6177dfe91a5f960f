// The second thread of large bodies: it waits for work, and sleeps where none comes.
#include "world/crew_inside.h"

#include <string.h>

enum { PATIENCE = 20000 }; // turns of the loop before it sleeps: some of a millisecond

// The number of the next piece of work after `last`.
static unsigned wait_for_work(sonde_crew *crew, unsigned last) {
  for (int k = 0; k < PATIENCE; ++k) {
    unsigned asked = atomic_load_explicit(&crew->asked, memory_order_acquire);
    if (asked != last) return asked;
    sonde_crew_pause();
  }
  atomic_store(&crew->asleep, true);
  bool called = atomic_load(&crew->asked) != last && atomic_exchange(&crew->asleep, false);
  while (!called && sem_wait(&crew->wake) != 0) {
  }
  return atomic_load_explicit(&crew->asked, memory_order_acquire);
}

static void *serve(void *with) {
  sonde_crew *crew = with;
  for (unsigned last = 0;;) {
    last = wait_for_work(crew, last);
    if (atomic_load_explicit(&crew->over, memory_order_relaxed)) return NULL;
    if (!sonde_crew_take(crew, last)) continue;
    crew->work(crew->with, 1);
    atomic_store_explicit(&crew->done, last, memory_order_release);
  }
}

sonde_status sonde_crew_create(sonde_crew **out, sonde_error *error) {
  *out = NULL;
  sonde_crew *crew = SONDE_NEW(sonde_crew, 1);
  if (!crew) return sonde_fail_memory(error);
  sem_init(&crew->wake, 0, 0);
  int failure = pthread_create(&crew->thread, NULL, serve, crew);
  if (failure != 0) {
    sem_destroy(&crew->wake);
    sonde_free(crew);
    return sonde_fail(error, SONDE_MEMORY, "cannot start a second thread: %s", strerror(failure));
  }
  *out = crew;
  return SONDE_OK;
}

void sonde_crew_destroy(sonde_crew *crew) {
  if (!crew) return;
  atomic_store_explicit(&crew->over, true, memory_order_relaxed);
  atomic_fetch_add(&crew->asked, 1);
  if (atomic_exchange(&crew->asleep, false)) sem_post(&crew->wake);
  pthread_join(crew->thread, NULL);
  sem_destroy(&crew->wake);
  sonde_free(crew);
}
