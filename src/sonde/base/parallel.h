// Independent items shared among threads; the outcome does not depend on their number.
#ifndef SONDE_SRC_PARALLEL_H
#define SONDE_SRC_PARALLEL_H

#include "base/link.h"
#include "base/base.h"

#include <stdatomic.h>

// Works on one item with the scratch of one worker. Looks at *stop between long steps and returns
// CANCELLED when it is set; such an item counts as not done.
typedef sonde_status (*sonde_parallel_fn)(void *user, uint32_t worker, uint32_t item,
                                          const atomic_bool *stop, sonde_error *error);

// Workers for `items` items: `wanted`, or one per online core when 0.
SONDE_LINK uint32_t sonde_parallel_workers(uint32_t wanted, uint32_t items);

// Runs all items. Progress is reported from the calling thread.
// @return CANCELLED by progress; else the failure of the lowest item that failed
SONDE_LINK sonde_status sonde_parallel_run(uint32_t items, uint32_t workers, sonde_parallel_fn work,
                                           void *user, const sonde_progress *progress,
                                           const char *what, sonde_error *error);

#endif
