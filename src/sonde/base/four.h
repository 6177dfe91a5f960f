// Vectors of four floats, for code that is compiled once: points and their coordinates, four at a
// time. Every operation is one IEEE operation per lane.
#ifndef SONDE_SRC_FOUR_H
#define SONDE_SRC_FOUR_H

#include "base/maths.h"
#include "base/vector.h"

#include <stdint.h>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

typedef float v4 __attribute__((vector_size(16)));
typedef int32_t i4 __attribute__((vector_size(16)));
typedef float v4_near __attribute__((vector_size(16), aligned(4), may_alias));

INLINE v4 load4(const float *p) { return *(const v4_near *)p; }
INLINE void store4(float *p, v4 a) { *(v4_near *)p = a; }
INLINE v4 all4(float a) { return a - (v4){0}; }
INLINE v4 v4_of(sonde_vec3 a) { return (v4){(float)a.x, (float)a.y, (float)a.z, 0}; }
INLINE v4 size4(v4 a) { return (v4)((i4)a & 0x7fffffff); }
INLINE i4 whole4(v4 a) { return __builtin_convertvector(a, i4); }
// Columns m[0], m[1], m[2] times (x, y, z).
INLINE v4 times4(const v4 m[3], v4 a) { return m[0] * a[0] + m[1] * a[1] + m[2] * a[2]; }
INLINE float dot3(v4 a, v4 b) {
  v4 p = a * b;
  return p[0] + p[1] + p[2];
}
INLINE v4 cross4(v4 a, v4 b) {
  return (v4){a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0};
}
INLINE v4 unit4(v4 a, v4 otherwise) {
  float square = dot3(a, a);
  return square > 1e-30f ? a * (1 / sqrtf(square)) : otherwise;
}
INLINE v4 larger4(v4 a, v4 b) {
#if defined(__SSE2__)
  return (v4)_mm_max_ps((__m128)a, (__m128)b);
#else
  i4 mask = a > b;
  return (v4)((mask & (i4)a) | (~mask & (i4)b));
#endif
}
INLINE v4 smaller4(v4 a, v4 b) {
#if defined(__SSE2__)
  return (v4)_mm_min_ps((__m128)a, (__m128)b);
#else
  i4 mask = a < b;
  return (v4)((mask & (i4)a) | (~mask & (i4)b));
#endif
}
// A bit per lane of the mask.
INLINE uint32_t bits4(i4 mask) {
#if defined(__SSE2__)
  return (uint32_t)_mm_movemask_ps((__m128)mask);
#else
  return (uint32_t)((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
#endif
}
// Every lane of the mask.
INLINE bool all_set4(i4 mask) { return bits4(mask) == 15; }
INLINE v4 root4(v4 a) {
#if defined(__SSE2__)
  return (v4)_mm_sqrt_ps((__m128)a);
#else
  for (int k = 0; k < 4; ++k) a[k] = sqrtf(a[k]);
  return a;
#endif
}
INLINE v4 pick4(i4 mask, v4 yes, v4 no) { return (v4)((mask & (i4)yes) | (~mask & (i4)no)); }
// Four points as their x, y and z.
INLINE void coordinates4(const v4 point[4], v4 c[3]) {
#if defined(__SSE2__)
  __m128 low = _mm_unpacklo_ps((__m128)point[0], (__m128)point[1]),
         high = _mm_unpacklo_ps((__m128)point[2], (__m128)point[3]),
         deep = _mm_unpackhi_ps((__m128)point[0], (__m128)point[1]),
         deeper = _mm_unpackhi_ps((__m128)point[2], (__m128)point[3]);
  c[0] = (v4)_mm_movelh_ps(low, high), c[1] = (v4)_mm_movehl_ps(high, low);
  c[2] = (v4)_mm_movelh_ps(deep, deeper);
#else
  for (int k = 0; k < 3; ++k) c[k] = (v4){point[0][k], point[1][k], point[2][k], point[3][k]};
#endif
}
// Angle of (x, y), error 4e-7 rad: a quarter of it has a tangent below 0.42.
INLINE v4 angle4(v4 x, v4 y) {
  v4 r = root4(x * x + y * y), half = size4(y) / larger4(r + size4(x), all4(1e-30f));
  v4 t = half / (1 + root4(1 + half * half)), u = t * t;
  v4 p = 0.19961517305842502f + u * (-0.13722131260315293f + u * 0.07586774308787624f);
  v4 angle = 4 * t * (0.9999999631898905f + u * (-0.33332396678715026f + u * p));
  angle = pick4(x < 0, (float)SONDE_PI - angle, angle);
  return pick4(y < 0, -angle, angle);
}
// x, y and z of four points as four points.
INLINE void points4(const v4 c[3], v4 point[4]) {
#if defined(__SSE2__)
  __m128 zero = _mm_setzero_ps();
  __m128 low = _mm_unpacklo_ps((__m128)c[0], (__m128)c[1]),
         high = _mm_unpackhi_ps((__m128)c[0], (__m128)c[1]),
         deep = _mm_unpacklo_ps((__m128)c[2], zero), deeper = _mm_unpackhi_ps((__m128)c[2], zero);
  point[0] = (v4)_mm_movelh_ps(low, deep), point[1] = (v4)_mm_movehl_ps(deep, low);
  point[2] = (v4)_mm_movelh_ps(high, deeper), point[3] = (v4)_mm_movehl_ps(deeper, high);
#else
  for (int k = 0; k < 4; ++k) point[k] = (v4){c[0][k], c[1][k], c[2][k], 0};
#endif
}

#endif
