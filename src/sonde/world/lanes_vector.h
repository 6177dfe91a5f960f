// Vectors of 16 floats in the instructions of one set: selections, roots, and the turning of
// records into vectors. Every operation is one IEEE operation per lane: all sets give the same
// bits.
#ifndef SONDE_SRC_LANES_VECTOR_H
#define SONDE_SRC_LANES_VECTOR_H

#include "world/lanes.h"

#include "base/vector.h"

#if defined(__AVX512F__) || defined(__AVX2__) || defined(__SSE2__)
#include <immintrin.h>
#endif

// Without optimisation gcc's intrinsics are macros whose masks it then warns about.
#if defined(__GNUC__) && !defined(__clang__) && !defined(__OPTIMIZE__)
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wconversion"
#endif

typedef double lane_double __attribute__((vector_size(128)));

INLINE sonde_lane all(float a) { return a - (sonde_lane){0}; }

INLINE sonde_lane pick(sonde_lane_index mask, sonde_lane yes, sonde_lane no) {
  return (sonde_lane)((mask & (sonde_lane_index)yes) | (~mask & (sonde_lane_index)no));
}
INLINE sonde_lane larger(sonde_lane a, sonde_lane b) { return pick(a > b, a, b); }
INLINE sonde_lane smaller(sonde_lane a, sonde_lane b) { return pick(a < b, a, b); }

// 1/sqrt(a) within 5e-7 of itself for a > 0: the exponent's half as a first guess, then two steps
// of Newton's method with the constants that make their largest error least (Moroz et al., 2018).
// A fraction of a root and a division, and the same bits everywhere.
INLINE sonde_lane inverse_root(sonde_lane a) {
  sonde_lane y = (sonde_lane)(0x5f200000 - ((sonde_lane_index)a >> 1));
  y = y * (1.68191391f - 0.703952009f * a * y * y);
  y = y * (1.50000036f - 0.500000053f * a * y * y);
  return y;
}

// Lanes whose mask is set.
INLINE uint32_t bits(sonde_lane_index mask) {
#if defined(__AVX512DQ__)
  return (uint32_t)_mm512_movepi32_mask((__m512i)mask);
#elif defined(__SSE2__)
  union {
    sonde_lane_index whole;
    __m128 part[4];
  } of = {mask};
  uint32_t set = 0;
  for (int k = 0; k < 4; ++k) set |= (uint32_t)_mm_movemask_ps(of.part[k]) << (4 * k);
  return set;
#else
  uint32_t set = 0;
  for (int k = 0; k < SONDE_LANES; ++k) set |= (uint32_t)(mask[k] & 1) << k;
  return set;
#endif
}

// Columns of four rows of four numbers each, per 128 bits: out[c] = the c-th numbers.
#if defined(__AVX512F__) || defined(__AVX2__)
#if defined(__AVX512F__)
typedef __m512 wide;
#define WIDE(operation) _mm512_##operation
#else
typedef __m256 wide;
#define WIDE(operation) _mm256_##operation
#endif
INLINE wide pair_low(wide a, wide b) {
  return WIDE(castpd_ps)(WIDE(unpacklo_pd)(WIDE(castps_pd)(a), WIDE(castps_pd)(b)));
}
INLINE wide pair_high(wide a, wide b) {
  return WIDE(castpd_ps)(WIDE(unpackhi_pd)(WIDE(castps_pd)(a), WIDE(castps_pd)(b)));
}
INLINE void turn4(const wide row[4], wide out[4]) {
  wide low01 = WIDE(unpacklo_ps)(row[0], row[1]), low23 = WIDE(unpacklo_ps)(row[2], row[3]);
  wide high01 = WIDE(unpackhi_ps)(row[0], row[1]), high23 = WIDE(unpackhi_ps)(row[2], row[3]);
  out[0] = pair_low(low01, low23);
  out[1] = pair_high(low01, low23);
  out[2] = pair_low(high01, high23);
  out[3] = pair_high(high01, high23);
}
#endif
#if defined(__AVX512F__)
// Rows k, k+4, k+8 and k+12 of the list side by side.
INLINE __m512 rows4(const float *base, const int32_t *node, int k) {
  __m512 z = _mm512_castps128_ps512(_mm_load_ps(base + (size_t)node[k] * SONDE_QUAD));
  z = _mm512_insertf32x4(z, _mm_load_ps(base + (size_t)node[k + 4] * SONDE_QUAD), 1);
  z = _mm512_insertf32x4(z, _mm_load_ps(base + (size_t)node[k + 8] * SONDE_QUAD), 2);
  return _mm512_insertf32x4(z, _mm_load_ps(base + (size_t)node[k + 12] * SONDE_QUAD), 3);
}
INLINE __m512 rows8(const float *base, const int32_t *node, int k) {
  __m512 z = _mm512_castps256_ps512(_mm256_load_ps(base + (size_t)node[k] * SONDE_RECORD));
  return _mm512_insertf32x8(z, _mm256_load_ps(base + (size_t)node[k + 4] * SONDE_RECORD), 1);
}
#elif defined(__AVX2__)
INLINE __m256 rows4(const float *base, const int32_t *node, int k) {
  __m256 z = _mm256_castps128_ps256(_mm_load_ps(base + (size_t)node[k] * SONDE_QUAD));
  return _mm256_insertf128_ps(z, _mm_load_ps(base + (size_t)node[k + 4] * SONDE_QUAD), 1);
}
#endif

// The four numbers at each of 16 nodes: loads of whole records, turned in registers, cost a
// fraction of gathers.
INLINE void read_quads(const float *base, const sonde_lane_index *nodes, sonde_lane out[4]) {
  const int32_t *node = (const int32_t *)nodes;
#if defined(__AVX512F__)
  __m512 row[4], column[4];
  for (int k = 0; k < 4; ++k) row[k] = rows4(base, node, k);
  turn4(row, column);
  for (int c = 0; c < 4; ++c) out[c] = (sonde_lane)column[c];
#elif defined(__AVX2__)
  for (int half = 0; half < 2; ++half) {
    __m256 row[4], column[4];
    for (int k = 0; k < 4; ++k) row[k] = rows4(base, node + 8 * half, k);
    turn4(row, column);
    for (int c = 0; c < 4; ++c) ((__m256 *)&out[c])[half] = column[c];
  }
#else
  for (int c = 0; c < 4; ++c)
    for (int l = 0; l < SONDE_LANES; ++l) out[c][l] = base[node[l] * SONDE_QUAD + c];
#endif
}

// The first six numbers of a record at 16 nodes.
INLINE void read_records(const float *base, const sonde_lane_index *nodes, sonde_lane out[6]) {
  const int32_t *node = (const int32_t *)nodes;
#if defined(__AVX512F__)
  __m512 row[8], column[8];
  for (int k = 0; k < 4; ++k) {
    row[k] = rows8(base, node, k);
    row[4 + k] = rows8(base, node, 8 + k);
  }
  turn4(row, column);
  turn4(row + 4, column + 4);
  for (int c = 0; c < 4; ++c) {
    out[c] = (sonde_lane)_mm512_shuffle_f32x4(column[c], column[4 + c], 0x88);
    if (c < 2) out[4 + c] = (sonde_lane)_mm512_shuffle_f32x4(column[c], column[4 + c], 0xdd);
  }
#elif defined(__AVX2__)
  for (int half = 0; half < 2; ++half) {
    __m256 row[8], column[8];
    for (int k = 0; k < 8; ++k)
      row[k] = _mm256_load_ps(base + (size_t)node[8 * half + k] * SONDE_RECORD);
    turn4(row, column);
    turn4(row + 4, column + 4);
    for (int c = 0; c < 4; ++c) {
      ((__m256 *)&out[c])[half] = _mm256_permute2f128_ps(column[c], column[4 + c], 0x20);
      if (c < 2)
        ((__m256 *)&out[4 + c])[half] = _mm256_permute2f128_ps(column[c], column[4 + c], 0x31);
    }
  }
#else
  for (int c = 0; c < 6; ++c)
    for (int l = 0; l < SONDE_LANES; ++l) out[c][l] = base[node[l] * SONDE_RECORD + c];
#endif
}

// Four numbers per lane to consecutive records of `stride` numbers.
INLINE void write_records(float *base, int stride, const sonde_lane in[4]) {
#if defined(__AVX512F__)
  __m512 row[4], column[4];
  for (int c = 0; c < 4; ++c) column[c] = (__m512)in[c];
  turn4(column, row);
  for (int k = 0; k < 4; ++k) {
    _mm_store_ps(base + k * stride, _mm512_castps512_ps128(row[k]));
    _mm_store_ps(base + (4 + k) * stride, _mm512_extractf32x4_ps(row[k], 1));
    _mm_store_ps(base + (8 + k) * stride, _mm512_extractf32x4_ps(row[k], 2));
    _mm_store_ps(base + (12 + k) * stride, _mm512_extractf32x4_ps(row[k], 3));
  }
#elif defined(__AVX2__)
  for (int half = 0; half < 2; ++half) {
    __m256 row[4], column[4];
    for (int c = 0; c < 4; ++c) column[c] = ((const __m256 *)&in[c])[half];
    turn4(column, row);
    for (int k = 0; k < 4; ++k) {
      _mm_store_ps(base + (8 * half + k) * stride, _mm256_castps256_ps128(row[k]));
      _mm_store_ps(base + (8 * half + 4 + k) * stride, _mm256_extractf128_ps(row[k], 1));
    }
  }
#else
  for (int l = 0; l < SONDE_LANES; ++l)
    for (int c = 0; c < 4; ++c) base[l * stride + c] = in[c][l];
#endif
}

// Adds the lanes of a sum in one order.
INLINE double total(lane_double a) {
  double sum = 0;
  for (int k = 0; k < SONDE_LANES; ++k) sum += a[k];
  return sum;
}
INLINE lane_double widen(sonde_lane a) { return __builtin_convertvector(a, lane_double); }

INLINE sonde_lane dot(const sonde_lane a[3], const sonde_lane b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#endif
