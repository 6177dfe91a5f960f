#ifndef SONDE_SRC_SECOND_THREAD_INSIDE_H
#define SONDE_SRC_SECOND_THREAD_INSIDE_H

#include "world/second_thread.h"

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

struct sonde_second_thread {
  pthread_t thread;
  sem_t wake;
  void (*work)(void *with, uint32_t part);
  void *with;
  char before[64];   // what one thread writes apart from what the other writes
  atomic_uint asked; // pieces of work
  atomic_bool over;
  char between[64];
  atomic_uint taken;  // pieces whose second part has somebody who does it
  atomic_uint done;   // the last one that the second thread did
  atomic_bool asleep; // or about to be: whoever clears it says whether it is woken
};

// The second part of a piece of work goes to whoever comes first.
static inline bool sonde_second_thread_take(sonde_second_thread *second, unsigned piece) {
  unsigned before = piece - 1;
  return atomic_compare_exchange_strong(&second->taken, &before, piece);
}

// Tells the processor that this is a loop that waits.
static inline void sonde_second_thread_pause(void) {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  __asm__ volatile("yield");
#endif
}

#endif
