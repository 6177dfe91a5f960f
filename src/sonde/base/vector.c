// Which instruction sets this processor runs.
#include "base/vector.h"

#include "base/base.h"

#include <string.h>

bool sonde_vectors_serve(const char *set, const char *wanted) {
  SONDE_ASSERT(set != NULL);
  if (wanted && strcmp(wanted, set) != 0) return false;
#ifdef __x86_64__
  if (strcmp(set, "avx512") == 0)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512bw");
  if (strcmp(set, "avx2") == 0) return __builtin_cpu_supports("avx2");
  if (strcmp(set, "sse4") == 0) return __builtin_cpu_supports("sse4.2");
#endif
  return strcmp(set, "base") == 0 || strcmp(set, "plain") == 0;
}
