// Under a sanitizer the loops that only repeat run fewer times: the first rounds reach the code.
// ./test --long sets SONDE_TEST_LONG: then each test takes all the samples that it is made for.
#ifndef SONDE_TESTS_SANITIZED_H
#define SONDE_TESTS_SANITIZED_H

#include <stdlib.h>

#define SAMPLES(all, usual) (getenv("SONDE_TEST_LONG") ? (all) : (usual))

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define SANITIZED 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1
#endif

#ifdef SANITIZED
#define ROUNDS(all, sanitized) (sanitized)
#else
#define ROUNDS(all, sanitized) (all)
#endif

// Begins a test whose code others of its program reach: sanitizers leave it out.
#define NOT_SANITIZED()                                                                            \
  do {                                                                                             \
    if (ROUNDS(false, true)) skip();                                                               \
  } while (0)

#endif
