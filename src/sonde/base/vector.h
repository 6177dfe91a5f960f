// Vectors: numbers side by side on which one instruction works. Kernels that use them are compiled
// once for each instruction set: "avx512" (F, DQ and BW), "avx2", "sse4" (4.2), "base" (what the
// compiler takes without asking) and, where there are such, "plain" loops. Every operation is one
// IEEE operation per lane and sums run in one order: all sets give the same bits. A mask is a
// vector of integers whose lanes are 0 or -1, as comparisons make it.
#ifndef SONDE_SRC_VECTOR_H
#define SONDE_SRC_VECTOR_H

#include "base/link.h"

#include <stdbool.h>
#include <stdint.h>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

// Without optimisation gcc's intrinsics are macros whose masks it then warns about.
#if defined(__GNUC__) && !defined(__clang__) && !defined(__OPTIMIZE__)
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wconversion"
#endif

#define INLINE static inline __attribute__((always_inline))

// Short loops whose bounds are known keep their arrays in registers. Instrumented code would take
// minutes to compile.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define UNROLL
#elif !defined(__clang__)
#define UNROLL _Pragma("GCC unroll 4")
#elif __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define UNROLL
#else
#define UNROLL _Pragma("unroll")
#endif

// Numbers that were read before are read again: where sums fill the registers, kept numbers would
// push the sums out.
#define READ_AFRESH __asm__ volatile("" ::: "memory")

// Width of the widest vectors of the set that is being compiled.
#if defined(__AVX512F__)
#define VECTOR_BYTES 64
#elif defined(__AVX2__)
#define VECTOR_BYTES 32
#else
#define VECTOR_BYTES 16
#endif

typedef float float_x4 __attribute__((vector_size(16)));
typedef float float_x8 __attribute__((vector_size(32)));
typedef float float_x16 __attribute__((vector_size(64)));
typedef double double_x2 __attribute__((vector_size(16)));
typedef double double_x4 __attribute__((vector_size(32)));
typedef double double_x8 __attribute__((vector_size(64)));
typedef double double_x16 __attribute__((vector_size(128)));
typedef int32_t int_x4 __attribute__((vector_size(16)));
typedef int32_t int_x8 __attribute__((vector_size(32)));
typedef int32_t int_x16 __attribute__((vector_size(64)));
#ifdef __clang__
typedef long long vector_long; // of 64 bits, as comparisons of doubles make them
#else
typedef long vector_long;
#endif
typedef vector_long long_x2 __attribute__((vector_size(16)));
typedef vector_long long_x4 __attribute__((vector_size(32)));
typedef vector_long long_x8 __attribute__((vector_size(64)));
typedef vector_long long_x16 __attribute__((vector_size(128)));

// As wide as the set.
enum { FLOATS = VECTOR_BYTES / 4, DOUBLES = VECTOR_BYTES / 8 };
typedef float floats __attribute__((vector_size(VECTOR_BYTES)));
typedef double doubles __attribute__((vector_size(VECTOR_BYTES)));
typedef int32_t ints __attribute__((vector_size(VECTOR_BYTES)));

// Operations, each for every vector type V. Generic ones take V from their vector, masks or
// integers from theirs.
//
// vload_V(p), vset_V(a)    from memory at any number; with `a` in every lane; vload(p), vset(a),
//                          vset_ints(a): as wide as the set
// vstore(p, a)             to memory
// vselect(mask, yes, no)   lanes of one or the other
// vonly(mask, a)           `a`, or 0 where the mask is not set
// vabs(a), vfloor(a)       magnitude; the largest whole number not above
// vint(a), vreal(i)        to integers, towards zero, and back
// vmax(a, b), vmin(a, b)   `b` where either is no number or both are equal, as instructions have it
// vsqrt(a)                 square root
// vdot(a, b)               scalar products of a[3] and b[3]
// vsum(a), vsum_pairs(a)   sum of the lanes, from the first to the last; of neighbours first
// vwiden(a)                float_x16 as double_x16
// vbits(mask)              a bit per lane
// vany(mask), vall(mask)   some lane, every lane is set
// vinverse_sqrt(a)         of floats: 1/sqrt(a) within 5e-7 of itself for a > 0
// V_near                   the type V at the address of any number
#define VECTOR float_x4
#define MASK int_x4
#define NUMBER float
#define INTEGER int32_t
#if defined(__SSE2__)
#define INSTRUCTION(name) _mm_##name##_ps
#define REGISTER __m128
#define MASK_BITS(mask) _mm_movemask_ps((__m128)(mask))
#endif
#include "base/vector_operations.h"

// Wider vectors pass between inlined functions of kernels only.
#ifdef SONDE_KERNEL
#define VECTOR float_x8
#define MASK int_x8
#define NUMBER float
#define INTEGER int32_t
#if defined(__AVX2__)
#define INSTRUCTION(name) _mm256_##name##_ps
#define REGISTER __m256
#define MASK_BITS(mask) _mm256_movemask_ps((__m256)(mask))
#endif
#include "base/vector_operations.h"

#define VECTOR float_x16
#define MASK int_x16
#define NUMBER float
#define INTEGER int32_t
#if defined(__AVX512F__)
#define INSTRUCTION(name) _mm512_##name##_ps
#define REGISTER __m512
#define MASK_BITS(mask) _mm512_test_epi32_mask((__m512i)(mask), (__m512i)(mask))
#endif
#include "base/vector_operations.h"

#define VECTOR double_x2
#define MASK long_x2
#define NUMBER double
#define INTEGER int64_t
#if defined(__SSE2__)
#define INSTRUCTION(name) _mm_##name##_pd
#define REGISTER __m128d
#define MASK_BITS(mask) _mm_movemask_pd((__m128d)(mask))
#endif
#include "base/vector_operations.h"

#define VECTOR double_x4
#define MASK long_x4
#define NUMBER double
#define INTEGER int64_t
#if defined(__AVX2__)
#define INSTRUCTION(name) _mm256_##name##_pd
#define REGISTER __m256d
#define MASK_BITS(mask) _mm256_movemask_pd((__m256d)(mask))
#endif
#include "base/vector_operations.h"

#define VECTOR double_x8
#define MASK long_x8
#define NUMBER double
#define INTEGER int64_t
#if defined(__AVX512F__)
#define INSTRUCTION(name) _mm512_##name##_pd
#define REGISTER __m512d
#define MASK_BITS(mask) _mm512_test_epi64_mask((__m512i)(mask), (__m512i)(mask))
#endif
#include "base/vector_operations.h"

#define VECTOR double_x16
#define MASK long_x16
#define NUMBER double
#define INTEGER int64_t
#include "base/vector_operations.h"

INLINE double_x16 vwiden(float_x16 a) { return __builtin_convertvector(a, double_x16); }
INLINE float vsum_pairs(float_x8 a) {
  return ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7]));
}

// clang-format off
#define VECTORS(name) float_x4: name##_float_x4, float_x8: name##_float_x8, \
  float_x16: name##_float_x16, double_x2: name##_double_x2, double_x4: name##_double_x4, \
  double_x8: name##_double_x8, double_x16: name##_double_x16
#define MASKS(name) int_x4: name##_int_x4, int_x8: name##_int_x8, int_x16: name##_int_x16, \
  long_x2: name##_long_x2, long_x4: name##_long_x4, long_x8: name##_long_x8, \
  long_x16: name##_long_x16
#else
#define VECTORS(name) float_x4: name##_float_x4
#define MASKS(name) int_x4: name##_int_x4
#endif
// clang-format on

#define vstore(p, a) _Generic((a), VECTORS(vstore))(p, a)
#define vselect(mask, yes, no) _Generic((yes), VECTORS(vselect), MASKS(vselect))(mask, yes, no)
#define vonly(mask, a) _Generic((a), VECTORS(vonly))(mask, a)
#define vabs(a) _Generic((a), VECTORS(vabs))(a)
#define vfloor(a) _Generic((a), VECTORS(vfloor))(a)
#define vint(a) _Generic((a), VECTORS(vint))(a)
#define vreal(i) _Generic((i), MASKS(vreal))(i)
#define vmax(a, b) _Generic((a), VECTORS(vmax))(a, b)
#define vmin(a, b) _Generic((a), VECTORS(vmin))(a, b)
#define vsqrt(a) _Generic((a), VECTORS(vsqrt))(a)
#define vinverse_sqrt(a) _Generic((a), VECTORS(vinverse_sqrt))(a)
#define vdot(a, b) _Generic((a)[0], VECTORS(vdot))(a, b)
#define vsum(a) _Generic((a), VECTORS(vsum))(a)
#define vbits(mask) _Generic((mask), MASKS(vbits))(mask)
#define vany(mask) (vbits(mask) != 0)
#define vall(mask) (vbits(mask) == (1u << sizeof(mask) / sizeof((mask)[0])) - 1)

// Vectors as wide as the set.
typedef floats floats_near __attribute__((aligned(4), may_alias));
typedef doubles doubles_near __attribute__((aligned(8), may_alias));
INLINE floats vload(const float *p) { return *(const floats_near *)p; }
INLINE floats vset(float a) { return a - (floats){0}; }
INLINE ints vset_ints(int32_t a) { return a - (ints){0}; }

// This processor runs the set, and `wanted` is its name or NULL for any.
SONDE_LINK bool sonde_vectors_serve(const char *set, const char *wanted);

#endif
