// Vectors and records in memory: rows of numbers become columns, lanes are gathered, closed up and
// spread. Points in single precision are records of four numbers, the fourth 0.
#ifndef SONDE_SRC_VECTOR_RECORDS_H
#define SONDE_SRC_VECTOR_RECORDS_H

#include "base/maths.h"
#include "base/vector.h"

// Four rows of four numbers, per 16 bytes: column[c] = the c-th numbers of the rows.
#define TRANSPOSE(vector, reg, mm)                                                                 \
  INLINE void vtranspose_##vector(const vector row[4], vector column[4]) {                         \
    reg low01 = mm##_unpacklo_ps((reg)row[0], (reg)row[1]),                                        \
        low23 = mm##_unpacklo_ps((reg)row[2], (reg)row[3]),                                        \
        high01 = mm##_unpackhi_ps((reg)row[0], (reg)row[1]),                                       \
        high23 = mm##_unpackhi_ps((reg)row[2], (reg)row[3]);                                       \
    column[0] = (vector)mm##_shuffle_ps(low01, low23, 0x44);                                       \
    column[1] = (vector)mm##_shuffle_ps(low01, low23, 0xee);                                       \
    column[2] = (vector)mm##_shuffle_ps(high01, high23, 0x44);                                     \
    column[3] = (vector)mm##_shuffle_ps(high01, high23, 0xee);                                     \
  }
#if defined(__SSE2__)
TRANSPOSE(float_x4, __m128, _mm)
#else
INLINE void vtranspose_float_x4(const float_x4 row[4], float_x4 column[4]) {
  const float_x4 a = row[0], b = row[1], c = row[2], d = row[3];
  for (int k = 0; k < 4; ++k) column[k] = (float_x4){a[k], b[k], c[k], d[k]};
}
#endif

INLINE float_x4 point_of(sonde_vec3 a) { return (float_x4){(float)a.x, (float)a.y, (float)a.z, 0}; }
// Columns m[0], m[1], m[2] times (x, y, z).
INLINE float_x4 transform_point(const float_x4 m[3], float_x4 a) {
  return m[0] * a[0] + m[1] * a[1] + m[2] * a[2];
}
INLINE float dot_points(float_x4 a, float_x4 b) {
  float_x4 p = a * b;
  return p[0] + p[1] + p[2];
}
INLINE float_x4 cross_points(float_x4 a, float_x4 b) {
  return (float_x4){a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
                    0};
}
// `otherwise` when a point has no direction.
INLINE float_x4 direction_of(float_x4 a, float_x4 otherwise) {
  float square = dot_points(a, a);
  return square > 1e-30f ? a * (1 / sqrtf(square)) : otherwise;
}
// Angle of (x, y), error 4e-7 rad: a quarter of it has a tangent below 0.42.
INLINE float_x4 vangle(float_x4 x, float_x4 y) {
  float_x4 r = vsqrt(x * x + y * y);
  float_x4 half = vabs(y) / vmax(r + vabs(x), vset_float_x4(1e-30f));
  float_x4 t = half / (1 + vsqrt(1 + half * half)), u = t * t;
  float_x4 p = 0.19961517305842502f + u * (-0.13722131260315293f + u * 0.07586774308787624f);
  float_x4 angle = 4 * t * (0.9999999631898905f + u * (-0.33332396678715026f + u * p));
  angle = vselect(x < 0, (float)SONDE_PI - angle, angle);
  return vselect(y < 0, -angle, angle);
}

#ifdef SONDE_KERNEL

#if defined(__AVX2__)
TRANSPOSE(float_x8, __m256, _mm256)
#endif
#if defined(__AVX512F__)
TRANSPOSE(float_x16, __m512, _mm512)
#define vtranspose vtranspose_float_x16
#elif defined(__AVX2__)
#define vtranspose vtranspose_float_x8
#else
#define vtranspose vtranspose_float_x4
#endif

// base[index].
INLINE floats vgather(const float *base, ints index) {
#if defined(__AVX512F__)
  return (floats)_mm512_i32gather_ps((__m512i)index, base, 4);
#else
  floats v;
  for (int k = 0; k < FLOATS; ++k) v[k] = base[index[k]];
  return v;
#endif
}

// base[index] for indices below FLOATS: a permutation is quicker than a gather.
INLINE floats vlook_up(const float *base, ints index) {
#if defined(__AVX512F__)
  return (floats)_mm512_permutexvar_ps((__m512i)index, (__m512)vload(base));
#elif defined(__AVX2__)
  return (floats)_mm256_permutevar8x32_ps((__m256)vload(base), (__m256i)index);
#elif defined(__SSE4_2__)
  index = index * 0x04040404 + 0x03020100; // their bytes
  return (floats)_mm_shuffle_epi8((__m128i)vload(base), (__m128i)index);
#else
  return vgather(base, index);
#endif
}

// p[0] in the first four lanes, p[1] in the next four, and so on; reads a whole vector.
INLINE floats vrepeat4(const float *p) {
#if VECTOR_BYTES == 64
  return vlook_up(p, (ints){0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3});
#elif VECTOR_BYTES == 32
  return vlook_up(p, (ints){0, 0, 0, 0, 1, 1, 1, 1});
#else
  return vset(*p);
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
#endif

// Lanes that a mask keeps, closed up; writes whole vectors.
INLINE void vcompress(uint32_t kept, floats a, float *to) {
#if defined(__AVX512F__)
  _mm512_storeu_ps(to, _mm512_maskz_compress_ps((__mmask16)kept, (__m512)a));
#elif defined(__SSE4_2__)
  for (unsigned k = 0; k < FLOATS / 4; ++k, kept >>= 4) {
    const __m128i order = _mm_load_si128((const __m128i *)(const void *)closed_up[kept & 15]);
#if defined(__AVX2__)
    const __m128 four = k ? _mm256_extractf128_ps((__m256)a, 1) : _mm256_castps256_ps128((__m256)a);
#else
    const __m128 four = (__m128)a;
#endif
    _mm_storeu_si128((__m128i *)(void *)to, _mm_shuffle_epi8(_mm_castps_si128(four), order));
    to += __builtin_popcount(kept & 15);
  }
#else
  if (kept == (1u << FLOATS) - 1) {
    vstore(to, a);
    return;
  }
  for (int k = 0; k < FLOATS; ++k) {
    *to = a[k];
    to += kept >> k & 1;
  }
#endif
}

// ---- records at 16 nodes --------------------------------------------------------------------

// Four numbers each of the records node[k], node[k + 4], .. side by side.
INLINE floats vload_rows(const float *base, unsigned stride, const int32_t *node, int k) {
#define ROW(i) _mm_load_ps(base + (size_t)node[k + 4 * (i)] * stride)
#if defined(__AVX512F__)
  __m512 z = _mm512_insertf32x4(_mm512_castps128_ps512(ROW(0)), ROW(1), 1);
  return (floats)_mm512_insertf32x4(_mm512_insertf32x4(z, ROW(2), 2), ROW(3), 3);
#elif defined(__AVX2__)
  return (floats)_mm256_insertf128_ps(_mm256_castps128_ps256(ROW(0)), ROW(1), 1);
#else
  return vload(base + (size_t)node[k] * stride);
#endif
#undef ROW
}

// The first four numbers of records of `stride` numbers: loads of whole records that are transposed
// in registers cost a fraction of gathers.
INLINE void vload_records(const float *base, unsigned stride, const int_x16 *nodes,
                          float_x16 out[4]) {
  for (int part = 0; part < 16 / FLOATS; ++part) {
    const int32_t *node = (const int32_t *)nodes + part * FLOATS;
    floats row[4], column[4];
    for (int k = 0; k < 4; ++k) row[k] = vload_rows(base, stride, node, k);
    vtranspose(row, column);
    for (int c = 0; c < 4; ++c) ((floats_near *)&out[c])[part] = column[c];
  }
}

// The first six of eight.
INLINE void vload_six(const float *base, const int_x16 *nodes, float_x16 out[6]) {
#if VECTOR_BYTES == 16
  vload_records(base, 8, nodes, out);
  for (int k = 0; k < 16; ++k)
    for (int c = 4; c < 6; ++c) out[c][k] = base[8 * (size_t)nodes[0][k] + (unsigned)c];
#else
#define RECORD(i) _mm256_load_ps(base + 8 * (size_t)node[i])
  for (int part = 0; part < 16 / FLOATS; ++part) {
    const int32_t *node = (const int32_t *)nodes + part * FLOATS;
    floats row[8], column[8];
#if defined(__AVX512F__)
    for (int k = 0; k < 8; ++k) {
      const int i = k < 4 ? k : k + 4;
      row[k] = (floats)_mm512_insertf32x8(_mm512_castps256_ps512(RECORD(i)), RECORD(i + 4), 1);
    }
#else
    for (int k = 0; k < 8; ++k) row[k] = (floats)RECORD(k);
#endif
    vtranspose(row, column);
    vtranspose(row + 4, column + 4);
    for (int c = 0; c < 6; ++c) {
#if defined(__AVX512F__)
      const __m512 a = (__m512)column[c % 4], b = (__m512)column[4 + c % 4];
      out[c] =
          (float_x16)(c < 4 ? _mm512_shuffle_f32x4(a, b, 0x88) : _mm512_shuffle_f32x4(a, b, 0xdd));
#else
      const __m256 a = (__m256)column[c % 4], b = (__m256)column[4 + c % 4];
      ((floats_near *)&out[c])[part] =
          (floats)(c < 4 ? _mm256_permute2f128_ps(a, b, 0x20) : _mm256_permute2f128_ps(a, b, 0x31));
#endif
    }
  }
#undef RECORD
#endif
}

// Four numbers per lane to consecutive records of `stride` numbers.
INLINE void vstore_records(float *base, unsigned stride, const float_x16 in[4]) {
  for (int part = 0; part < 16 / FLOATS; ++part) {
    floats row[4], column[4];
    float *to = base + (unsigned)part * FLOATS * stride;
    for (int c = 0; c < 4; ++c) column[c] = ((const floats_near *)&in[c])[part];
    vtranspose(column, row);
    for (unsigned k = 0; k < 4; ++k) {
#if defined(__AVX512F__)
      const __m512 four = (__m512)row[k];
      _mm_store_ps(to + k * stride, _mm512_castps512_ps128(four));
      _mm_store_ps(to + (4 + k) * stride, _mm512_extractf32x4_ps(four, 1));
      _mm_store_ps(to + (8 + k) * stride, _mm512_extractf32x4_ps(four, 2));
      _mm_store_ps(to + (12 + k) * stride, _mm512_extractf32x4_ps(four, 3));
#elif defined(__AVX2__)
      _mm_store_ps(to + k * stride, _mm256_castps256_ps128((__m256)row[k]));
      _mm_store_ps(to + (4 + k) * stride, _mm256_extractf128_ps((__m256)row[k], 1));
#else
      vstore(to + k * stride, row[k]);
#endif
    }
  }
}

#endif
#endif
