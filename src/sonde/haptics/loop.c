// Start and stop of the real-time loop.
#include "haptics/loop.h"

#include "base/base.h"

#include <errno.h>
#include <math.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

// mlockall acts on the process; loops of several sessions share it.
static atomic_int memory_locks;

typedef struct launch {
  sonde_loop *loop;
  pthread_mutex_t mutex;
  pthread_cond_t condition;
  bool ready;
} launch;

// Privileges are settled before start() returns, so that the flags need no atomics afterwards.
static void *thread_main(void *argument) {
  launch *start = argument;
  sonde_loop *loop = start->loop;
  pthread_mutex_lock(&start->mutex);
  struct sched_param param = {.sched_priority = 40};
  loop->realtime_priority = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param) == 0;

  // Locking faults in every mapped page (untouched stacks too): it is harmless only below a quarter
  // of the machine's memory. MCL_FUTURE is left out: beyond RLIMIT_MEMLOCK it would make later
  // allocations fail.
  unsigned long pages = 0;
  FILE *file = fopen("/proc/self/statm", "r");
  bool known = file && fscanf(file, "%lu", &pages) == 1;
  if (file) fclose(file);
  long total = known ? sysconf(_SC_PHYS_PAGES) : 0;
  bool small = total > 0 && pages < (unsigned long)total / 4;
  loop->memory_locked = small && mlockall(MCL_CURRENT) == 0;
  if (loop->memory_locked) atomic_fetch_add(&memory_locks, 1);

  static const char *const refused[2][2] = {
      {"real-time priority and memory locking were", "real-time priority was"},
      {"memory locking was", NULL}};
  const char *what = refused[loop->realtime_priority][loop->memory_locked];
  if (what)
    snprintf(loop->note, sizeof loop->note,
             "%s refused by the system: ticks may wake late (see docs/haptics.md)", what);
  start->ready = true;
  pthread_cond_signal(&start->condition);
  pthread_mutex_unlock(&start->mutex);
  sonde_loop_run(loop);
  return NULL;
}

sonde_status sonde_loop_start(double period_s, sonde_tick_fn tick, void *user, sonde_loop **out,
                              sonde_error *error) {
  SONDE_ASSERT(tick != NULL && out != NULL);
  *out = NULL;
  if (!(period_s >= 1e-4 && period_s <= 1.0))
    return sonde_fail(error, SONDE_ARGUMENT, "loop: the period is %g s, expected 1e-4 to 1",
                      period_s);
  sonde_loop *loop = SONDE_NEW(sonde_loop, 1);
  if (!loop) return sonde_fail_memory(error);
  loop->period_s = period_s;
  loop->tick = tick;
  loop->user = user;
  launch start = {loop, PTHREAD_MUTEX_INITIALIZER, PTHREAD_COND_INITIALIZER, false};
  int failure = pthread_create(&loop->thread, NULL, thread_main, &start);
  pthread_mutex_lock(&start.mutex);
  while (!failure && !start.ready) pthread_cond_wait(&start.condition, &start.mutex);
  pthread_mutex_unlock(&start.mutex);
  pthread_mutex_destroy(&start.mutex);
  pthread_cond_destroy(&start.condition);
  if (failure) {
    sonde_free(loop);
    return sonde_fail(error, SONDE_MEMORY, "loop: the thread could not be started: %s",
                      strerror(failure));
  }
  *out = loop;
  return SONDE_OK;
}

void sonde_loop_stop(sonde_loop *loop, sonde_loop_stats *stats) {
  if (stats) *stats = (sonde_loop_stats){0};
  if (!loop) return;
  atomic_store_explicit(&loop->stop, true, memory_order_release);
  pthread_join(loop->thread, NULL);
  if (stats) *stats = sonde_loop_read(loop);
  if (loop->memory_locked && atomic_fetch_sub(&memory_locks, 1) == 1) munlockall();
  sonde_free(loop);
}

static uint64_t read_counter(const _Atomic uint64_t *counter) {
  return atomic_load_explicit(counter, memory_order_relaxed);
}

sonde_loop_stats sonde_loop_read(const sonde_loop *loop) {
  SONDE_ASSERT(loop != NULL);
  sonde_loop_stats stats = {.ticks = read_counter(&loop->ticks),
                            .deadline_misses = read_counter(&loop->misses),
                            .realtime_priority = loop->realtime_priority,
                            .memory_locked = loop->memory_locked};
  for (int i = 0; i < SONDE_LATENESS_BINS; ++i)
    stats.lateness_histogram[i] = read_counter(&loop->lateness[i]);
  double sum_s = atomic_load_explicit(&loop->compute_sum_s, memory_order_relaxed);
  stats.compute_max_s = atomic_load_explicit(&loop->compute_max_s, memory_order_relaxed);
  stats.compute_mean_s = stats.ticks ? sum_s / (double)stats.ticks : 0.0;
  memcpy(stats.priority_note, loop->note, sizeof stats.priority_note);
  return stats;
}
