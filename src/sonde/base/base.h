// Inside of the base room: allocation, errors, assert. Rooms above the public headers use this.
#ifndef SONDE_SRC_BASE_H
#define SONDE_SRC_BASE_H

#include "base/link.h"
#include "sonde/base.h"

#include <stdio.h>
#include <stdlib.h>

// Asserts stay on in every build except one that defines SONDE_NO_ASSERT.
#ifdef SONDE_NO_ASSERT
#define SONDE_ASSERT(condition) ((void)0)
#else
#define SONDE_ASSERT(condition)                                                                    \
  ((condition) ? (void)0 : sonde_assert_failed(#condition, __FILE__, __LINE__))
#endif
SONDE_LINK _Noreturn void sonde_assert_failed(const char *condition, const char *file, int line);

#define SONDE_COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

// Zeroed memory for count items; NULL when out of memory or when the size overflows.
// A count of 0 returns a valid unique pointer.
SONDE_LINK void *sonde_calloc(size_t count, size_t size);
SONDE_LINK void *sonde_realloc(void *pointer, size_t old_bytes, size_t new_bytes);

// Typed helpers: `double *x = SONDE_NEW(double, n);`
#define SONDE_NEW(type, count) ((type *)sonde_calloc((count), sizeof(type)))

// The next array of a block that starts at base, at multiples of 64 bytes from there; moves *offset
// behind it. NULL base: only measures.
static inline void *sonde_carve(char *base, size_t *offset, size_t count, size_t size) {
  void *place = base ? base + *offset : NULL;
  *offset += (count * size + 63) & ~(size_t)63;
  return place;
}

// Where such a block begins in memory that is 63 bytes longer.
static inline char *sonde_whole_lines(void *memory) {
  return (char *)memory + (-(uintptr_t)memory & 63);
}

// Fills error (when not NULL) and returns status: `return sonde_fail(error, SONDE_IO, "...", ...)`.
SONDE_LINK sonde_status sonde_fail_at(sonde_error *error, sonde_status status, const char *where,
                                      const char *format, ...)
    __attribute__((format(printf, 4, 5)));
#define sonde_fail(error, status, ...) sonde_fail_at((error), (status), __func__, __VA_ARGS__)
// As sonde_fail() into `status`, unless it holds an earlier failure, which stays.
#define sonde_fail_once(status, error, failure, ...)                                               \
  ((status) = (status) ? (status) : sonde_fail((error), (failure), __VA_ARGS__))
#define sonde_fail_memory(error)                                                                   \
  sonde_fail_at((error), SONDE_MEMORY, __func__, "out of memory in %s", __func__)

// A number of a definition with the range that it has to lie in, bounds included.
typedef struct sonde_bounded {
  const char *name;
  double value, low, high;
} sonde_bounded;
static inline bool sonde_bounded_holds(sonde_bounded number) {
  return number.value >= number.low && number.value <= number.high;
}
// @return ARGUMENT "<name> is <value>, expected <low> to <high>" for the first of `count` numbers
// that is not within its range, or no number at all
SONDE_LINK sonde_status sonde_bounded_check(const sonde_bounded *numbers, size_t count,
                                            sonde_error *error);

// Whether an option struct has the version of this library.
// @return SONDE_ARGUMENT naming what was to be made
SONDE_LINK sonde_status sonde_def_check(const char *what, uint32_t version, sonde_error *error);

SONDE_LINK void sonde_log(sonde_log_level level, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

// Reports progress; true means go on. A NULL progress always goes on.
SONDE_LINK bool sonde_progress_report(const sonde_progress *progress, double fraction,
                                      const char *what);

#endif
