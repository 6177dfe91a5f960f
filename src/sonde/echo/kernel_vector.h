// Vectors as wide as the instruction set. Every operation is one IEEE operation per lane and sums
// run in one order: all sets give the same bits.
#ifndef SONDE_SRC_ECHO_KERNEL_VECTOR_H
#define SONDE_SRC_ECHO_KERNEL_VECTOR_H

#include "base/four.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

// Without optimisation gcc's intrinsics are macros whose masks it then warns about.
#if defined(__GNUC__) && !defined(__clang__) && !defined(__OPTIMIZE__)
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wconversion"
#endif

enum { W = VECTOR_BYTES / 4 };

// Of short loops whose bounds are known, so that their arrays stay in registers. Instrumented code
// would take minutes to compile.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define UNROLL
#elif !defined(__clang__)
#define UNROLL _Pragma("GCC unroll 4")
#elif __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define UNROLL
#else
#define UNROLL _Pragma("unroll")
#endif

// What was read before is read again: where sums fill the registers, kept numbers would push them
// out.
#define AFRESH __asm__ volatile("" ::: "memory")

typedef float vf __attribute__((vector_size(VECTOR_BYTES)));
typedef int32_t vi __attribute__((vector_size(VECTOR_BYTES)));
typedef uint32_t vu __attribute__((vector_size(VECTOR_BYTES)));
typedef uint8_t vb __attribute__((vector_size(VECTOR_BYTES / 4)));
typedef float vf_near __attribute__((vector_size(VECTOR_BYTES), aligned(4), may_alias));

INLINE vf load(const float *p) { return *(const vf_near *)p; }
INLINE void store(float *p, vf a) { *(vf_near *)p = a; }
INLINE vf all(float a) { return a - (vf){0}; }
INLINE vi all_of(int32_t a) { return a - (vi){0}; }
INLINE vi whole(vf a) { return __builtin_convertvector(a, vi); }
INLINE vf real(vi a) { return __builtin_convertvector(a, vf); }
INLINE vf pick(vi mask, vf yes, vf no) {
#if defined(__SSE4_1__) && !defined(__AVX2__)
  return (vf)_mm_blendv_ps((__m128)no, (__m128)yes, (__m128)mask);
#else
  return (vf)((mask & (vi)yes) | (~mask & (vi)no));
#endif
}
INLINE vi pick_of(vi mask, vi yes, vi no) { return (mask & yes) | (~mask & no); }
INLINE vf only(vi mask, vf a) { return (vf)(mask & (vi)a); }
// b where either is no number or both are equal, as the instructions have it.
INLINE vf larger(vf a, vf b) {
#if defined(__AVX512F__)
  return (vf)_mm512_max_ps((__m512)a, (__m512)b);
#elif defined(__AVX2__)
  return (vf)_mm256_max_ps((__m256)a, (__m256)b);
#else
  return pick(a > b, a, b);
#endif
}
INLINE vf smaller(vf a, vf b) {
#if defined(__AVX512F__)
  return (vf)_mm512_min_ps((__m512)a, (__m512)b);
#elif defined(__AVX2__)
  return (vf)_mm256_min_ps((__m256)a, (__m256)b);
#else
  return pick(a < b, a, b);
#endif
}
INLINE vf size_of(vf a) { return (vf)((vi)a & 0x7fffffff); }
INLINE vf below(vf a) { // largest whole number not above
#if defined(__SSE4_1__) && !defined(__AVX2__)
  return (vf)_mm_floor_ps((__m128)a);
#else
  vf i = real(whole(a));
  return i - only(i > a, all(1));
#endif
}

INLINE bool any(vi mask) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask) != 0;
#elif defined(__AVX2__)
  return _mm256_movemask_ps((__m256)mask) != 0;
#elif defined(__SSE2__)
  return _mm_movemask_ps((__m128)mask) != 0;
#else
  return (mask[0] | mask[1] | mask[2] | mask[3]) != 0;
#endif
}

INLINE vf root(vf a) {
#if defined(__AVX512F__)
  return (vf)_mm512_sqrt_ps((__m512)a);
#elif defined(__AVX2__)
  return (vf)_mm256_sqrt_ps((__m256)a);
#elif defined(__SSE2__)
  return (vf)_mm_sqrt_ps((__m128)a);
#else
  for (int k = 0; k < W; ++k) a[k] = __builtin_sqrtf(a[k]);
  return a;
#endif
}

INLINE vf gather(const float *base, vi index) {
#if defined(__AVX512F__)
  return (vf)_mm512_i32gather_ps((__m512i)index, base, 4);
#else
  vf v;
  for (int k = 0; k < W; ++k) v[k] = base[index[k]];
  return v;
#endif
}

// p[0] in the first four lanes, p[1] in the next four, and so on; reads a whole vector.
INLINE vf each4(const float *p) {
#if defined(__AVX512F__)
  const vi from = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};
  return (vf)_mm512_permutexvar_ps((__m512i)from, (__m512)load(p));
#elif defined(__AVX2__)
  const vi from = {0, 0, 0, 0, 1, 1, 1, 1};
  return (vf)_mm256_permutevar8x32_ps((__m256)load(p), (__m256i)from);
#else
  return all(*p);
#endif
}

#if defined(__SSE4_2__) && !defined(__AVX512F__)
// The bytes of lane k, and those of the lanes that four bits keep, closed up.
#define LANE(k) (0x03020100u + 0x04040404u * (k))
static const _Alignas(16) uint32_t closed_up[16][4] = {{0},
                                                       {LANE(0)},
                                                       {LANE(1)},
                                                       {LANE(0), LANE(1)},
                                                       {LANE(2)},
                                                       {LANE(0), LANE(2)},
                                                       {LANE(1), LANE(2)},
                                                       {LANE(0), LANE(1), LANE(2)},
                                                       {LANE(3)},
                                                       {LANE(0), LANE(3)},
                                                       {LANE(1), LANE(3)},
                                                       {LANE(0), LANE(1), LANE(3)},
                                                       {LANE(2), LANE(3)},
                                                       {LANE(0), LANE(2), LANE(3)},
                                                       {LANE(1), LANE(2), LANE(3)},
                                                       {LANE(0), LANE(1), LANE(2), LANE(3)}};
#undef LANE

INLINE void close_up(uint32_t bits, __m128 a, float *to) {
  __m128i order = _mm_load_si128((const __m128i *)(const void *)closed_up[bits]);
  _mm_storeu_si128((__m128i *)(void *)to, _mm_shuffle_epi8(_mm_castps_si128(a), order));
}
#endif

// Lanes of three vectors that a mask keeps, closed up; writes whole vectors. Returns their number.
INLINE uint32_t pack(vi mask, vf a, float *to_a, vf b, float *to_b, vf c, float *to_c) {
#if defined(__AVX512F__)
  const __mmask16 kept = _mm512_movepi32_mask((__m512i)mask);
  _mm512_storeu_ps(to_a, _mm512_maskz_compress_ps(kept, (__m512)a));
  _mm512_storeu_ps(to_b, _mm512_maskz_compress_ps(kept, (__m512)b));
  _mm512_storeu_ps(to_c, _mm512_maskz_compress_ps(kept, (__m512)c));
  return (uint32_t)__builtin_popcount(kept);
#elif defined(__AVX2__)
  const uint32_t bits = (uint32_t)_mm256_movemask_ps((__m256)mask), low = bits & 15;
  const uint32_t first = (uint32_t)__builtin_popcount(low);
  const vf *from[] = {&a, &b, &c};
  float *to[] = {to_a, to_b, to_c};
  for (int k = 0; k < 3; ++k) {
    close_up(low, _mm256_castps256_ps128((__m256)*from[k]), to[k]);
    close_up(bits >> 4, _mm256_extractf128_ps((__m256)*from[k], 1), to[k] + first);
  }
  return (uint32_t)__builtin_popcount(bits);
#elif defined(__SSE4_2__)
  const uint32_t bits = (uint32_t)_mm_movemask_ps((__m128)mask);
  close_up(bits, (__m128)a, to_a), close_up(bits, (__m128)b, to_b), close_up(bits, (__m128)c, to_c);
  return (uint32_t)__builtin_popcount(bits);
#else
  uint32_t count = 0, kept = 0;
  for (int k = 0; k < W; ++k) kept += (uint32_t)-mask[k];
  if (kept == W) {
    store(to_a, a), store(to_b, b), store(to_c, c);
    return W;
  }
  for (int k = 0; k < W; ++k) {
    to_a[count] = a[k], to_b[count] = b[k], to_c[count] = c[k];
    count += (uint32_t)-mask[k];
  }
  return count;
#endif
}

// Lanes of four vectors as records of four numbers: record 4 i + k
// at place k * (W / 4) + i.
INLINE void records(float *out, vf a, vf b, vf c, vf d) {
#if defined(__AVX512F__)
  __m512 ab = _mm512_unpacklo_ps((__m512)a, (__m512)b),
         cd = _mm512_unpacklo_ps((__m512)c, (__m512)d);
  __m512 AB = _mm512_unpackhi_ps((__m512)a, (__m512)b),
         CD = _mm512_unpackhi_ps((__m512)c, (__m512)d);
  _mm512_storeu_ps(out, _mm512_shuffle_ps(ab, cd, 0x44));
  _mm512_storeu_ps(out + 16, _mm512_shuffle_ps(ab, cd, 0xee));
  _mm512_storeu_ps(out + 32, _mm512_shuffle_ps(AB, CD, 0x44));
  _mm512_storeu_ps(out + 48, _mm512_shuffle_ps(AB, CD, 0xee));
#elif defined(__AVX2__)
  __m256 ab = _mm256_unpacklo_ps((__m256)a, (__m256)b),
         cd = _mm256_unpacklo_ps((__m256)c, (__m256)d);
  __m256 AB = _mm256_unpackhi_ps((__m256)a, (__m256)b),
         CD = _mm256_unpackhi_ps((__m256)c, (__m256)d);
  _mm256_storeu_ps(out, _mm256_shuffle_ps(ab, cd, 0x44));
  _mm256_storeu_ps(out + 8, _mm256_shuffle_ps(ab, cd, 0xee));
  _mm256_storeu_ps(out + 16, _mm256_shuffle_ps(AB, CD, 0x44));
  _mm256_storeu_ps(out + 24, _mm256_shuffle_ps(AB, CD, 0xee));
#else
  for (int k = 0; k < W; ++k) {
    const v4 record = {a[k], b[k], c[k], d[k]};
    store4(out + 4 * k, record);
  }
#endif
}
// Size of one number.
INLINE float size1(float a) { return a < 0 ? -a : a; }

// 2^a for |a| < 120, relative error 1e-7.
INLINE vf power2(vf a) {
  vf i = below(a), t = a - i;
  vf p = 0.0558632826591662f + t * (0.00894621466647436f + t * 0.0018951072909317184f);
  p = 0.9999998957631335f + t * (0.693154620003299f + t * (0.24014077009185858f + t * p));
  return (vf)((vi)p + (whole(i) << 23));
}

// 20 log10 of a > 0 within 0.01 dB: exponent bits and a polynomial in the mantissa.
INLINE vf decibels(vf a) {
  vi bits = (vi)a;
  vf exponent = real((bits >> 23) - 127);
  vf t = (vf)((bits & 0x7fffff) | 0x3f800000) - 1;
  vf log2m = t * (1.4419f + t * (-0.7096f + t * (0.4175f + t * (-0.1943f + t * 0.0445f))));
  return 6.0205999f * (exponent + log2m);
}

#endif
