// Kernels that are compiled once for each instruction set: "avx512" (F, DQ and BW), "avx2", "sse4"
// (4.2), "base" (what the compiler takes without asking) and, where there are such, "plain" loops.
#ifndef SONDE_SRC_VECTOR_H
#define SONDE_SRC_VECTOR_H

#include "base/link.h"

#include <stdbool.h>

#define INLINE static inline __attribute__((always_inline))

// Of the widest vectors of the set that is being compiled.
#if defined(__AVX512F__)
#define VECTOR_BYTES 64
#elif defined(__AVX2__)
#define VECTOR_BYTES 32
#else
#define VECTOR_BYTES 16
#endif

// As many doubles as fit into one, at the address of any double.
typedef double lot __attribute__((vector_size(VECTOR_BYTES), aligned(8), may_alias));

// This processor runs the set, and `wanted` is its name or NULL for any.
SONDE_LINK bool sonde_vectors_serve(const char *set, const char *wanted);

#endif
