// The pool of worker threads: each takes the next item until none is left or the run stops, while
// the caller reports progress ten times a second.
#include "base/parallel.h"

#include <pthread.h>
#include <time.h>
#include <unistd.h>

enum { MAX_WORKERS = 64 };

typedef struct pool {
  uint32_t items;
  sonde_parallel_fn work;
  void *user;
  atomic_uint next, done;
  atomic_bool stop;
  pthread_mutex_t mutex; // guards the members below
  pthread_cond_t changed;
  uint32_t running;
  uint32_t failed_item;
  sonde_status failure;
  sonde_error error;
} pool;

typedef struct worker {
  pool *pool;
  uint32_t index;
  pthread_t thread;
} worker;

static void *worker_main(void *argument) {
  worker *me = argument;
  pool *p = me->pool;
  while (!atomic_load(&p->stop)) {
    uint32_t item = atomic_fetch_add(&p->next, 1);
    if (item >= p->items) break;
    sonde_error error = {0};
    sonde_status status = p->work(p->user, me->index, item, &p->stop, &error);
    if (status && status != SONDE_CANCELLED) {
      pthread_mutex_lock(&p->mutex);
      if (!p->failure || item < p->failed_item) {
        p->failure = status;
        p->failed_item = item;
        p->error = error;
      }
      pthread_mutex_unlock(&p->mutex);
      atomic_store(&p->stop, true);
    }
    if (!status) atomic_fetch_add(&p->done, 1);
  }
  pthread_mutex_lock(&p->mutex);
  SONDE_ASSERT(p->running > 0);
  --p->running;
  pthread_cond_signal(&p->changed);
  pthread_mutex_unlock(&p->mutex);
  return NULL;
}

uint32_t sonde_parallel_workers(uint32_t wanted, uint32_t items) {
  long cores = sysconf(_SC_NPROCESSORS_ONLN);
  uint32_t count = wanted ? wanted : (cores > 0 ? (uint32_t)cores : 1u);
  if (count > items) count = items;
  if (count > MAX_WORKERS) count = MAX_WORKERS;
  return count ? count : 1u;
}

sonde_status sonde_parallel_run(uint32_t items, uint32_t workers, sonde_parallel_fn work,
                                void *user, const sonde_progress *progress, const char *what,
                                sonde_error *error) {
  SONDE_ASSERT(workers >= 1 && workers <= MAX_WORKERS);
  pool p = {.items = items, .work = work, .user = user};
  worker list[MAX_WORKERS];
  pthread_mutex_init(&p.mutex, NULL);
  pthread_cond_init(&p.changed, NULL);
  uint32_t started = 0;
  p.running = workers;
  for (; started < workers; ++started) {
    list[started] = (worker){.pool = &p, .index = started};
    if (pthread_create(&list[started].thread, NULL, worker_main, &list[started])) break;
  }

  bool cancelled = false;
  pthread_mutex_lock(&p.mutex);
  p.running -= workers - started;
  while (p.running) {
    struct timespec until; // in a tenth of a second
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += 100000000;
    until.tv_sec += until.tv_nsec / 1000000000;
    until.tv_nsec %= 1000000000;
    pthread_cond_timedwait(&p.changed, &p.mutex, &until);
    pthread_mutex_unlock(&p.mutex);
    double fraction = items ? (double)atomic_load(&p.done) / items : 1.0;
    if (!cancelled && !sonde_progress_report(progress, fraction, what)) {
      cancelled = true;
      atomic_store(&p.stop, true);
    }
    pthread_mutex_lock(&p.mutex);
  }
  pthread_mutex_unlock(&p.mutex);
  cancelled = cancelled && atomic_load(&p.done) < items;
  for (uint32_t k = 0; k < started; ++k) pthread_join(list[k].thread, NULL);
  pthread_cond_destroy(&p.changed);
  pthread_mutex_destroy(&p.mutex);
  if (!started) return sonde_fail(error, SONDE_MEMORY, "no thread could be started");
  if (p.failure) {
    if (error) *error = p.error;
    return p.failure;
  }
  if (cancelled)
    return sonde_fail(error, SONDE_CANCELLED, "cancelled after %u of %u parts",
                      atomic_load(&p.done), items);
  return SONDE_OK;
}
