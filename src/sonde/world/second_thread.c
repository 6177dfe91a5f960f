// The second thread of large bodies: it waits for work, and sleeps where none comes.
#include "world/second_thread_inside.h"

#include <string.h>

enum { PATIENCE = 20000 }; // turns of the loop before it sleeps: some of a millisecond

// The number of the next piece of work after `last`.
static unsigned wait_for_work(sonde_second_thread *second, unsigned last) {
  for (int k = 0; k < PATIENCE; ++k) {
    unsigned asked = atomic_load_explicit(&second->asked, memory_order_acquire);
    if (asked != last) return asked;
    sonde_second_thread_pause();
  }
  atomic_store(&second->asleep, true);
  bool called = atomic_load(&second->asked) != last && atomic_exchange(&second->asleep, false);
  while (!called && sem_wait(&second->wake) != 0) {
  }
  return atomic_load_explicit(&second->asked, memory_order_acquire);
}

static void *serve(void *with) {
  sonde_second_thread *second = with;
  for (unsigned last = 0;;) {
    last = wait_for_work(second, last);
    if (atomic_load_explicit(&second->over, memory_order_relaxed)) return NULL;
    if (!sonde_second_thread_take(second, last)) continue;
    second->work(second->with, 1);
    atomic_store_explicit(&second->done, last, memory_order_release);
  }
}

sonde_status sonde_second_thread_create(sonde_second_thread **out, sonde_error *error) {
  *out = NULL;
  sonde_second_thread *second = SONDE_NEW(sonde_second_thread, 1);
  if (!second) return sonde_fail_memory(error);
  sem_init(&second->wake, 0, 0);
  int failure = pthread_create(&second->thread, NULL, serve, second);
  if (failure != 0) {
    sem_destroy(&second->wake);
    sonde_free(second);
    return sonde_fail(error, SONDE_MEMORY, "cannot start a second thread: %s", strerror(failure));
  }
  *out = second;
  return SONDE_OK;
}

void sonde_second_thread_destroy(sonde_second_thread *second) {
  if (!second) return;
  atomic_store_explicit(&second->over, true, memory_order_relaxed);
  atomic_fetch_add(&second->asked, 1);
  if (atomic_exchange(&second->asleep, false)) sem_post(&second->wake);
  pthread_join(second->thread, NULL);
  sem_destroy(&second->wake);
  sonde_free(second);
}
