// Under a sanitizer the loops that only repeat run fewer times: the first rounds reach the code.
#ifndef SONDE_TESTS_SANITIZED_H
#define SONDE_TESTS_SANITIZED_H

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

#endif
