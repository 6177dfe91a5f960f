// Batches of numbers for kernels: vectors of 64 bytes, 16 floats, or 8 doubles where
// SONDE_REAL_DOUBLE is defined, or one double where SONDE_REAL_SCALAR is. The operations are those
// of base/vector.h; records of four or eight numbers per node are loaded whole and transposed.
#ifndef SONDE_SRC_BATCH_H
#define SONDE_SRC_BATCH_H

#ifndef SONDE_KERNEL
#define SONDE_KERNEL
#endif
#if defined(__GNUC__) // vectors are passed between inlined functions only
#pragma GCC diagnostic ignored "-Wpsabi"
#endif
#include "base/vector_records.h"

#ifdef SONDE_REAL_SCALAR
typedef double real;
typedef double reals;
typedef bool wholes;
INLINE reals all(real a) { return a; }
INLINE reals pick(wholes mask, reals yes, reals no) { return mask ? yes : no; }
INLINE reals larger(reals a, reals b) { return a > b ? a : b; }
INLINE reals smaller(reals a, reals b) { return a < b ? a : b; }
INLINE uint32_t bits(wholes mask) { return mask; }
INLINE reals dot(const reals a[3], const reals b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
#else
// Nodes in a batch, numbers in a record of a node; sums run in double precision.
#ifdef SONDE_REAL_DOUBLE
typedef double real;
typedef int64_t whole;
enum { SONDE_BATCH = 8, SONDE_RECORD = 8, SONDE_QUAD = 4 };
#define BY_REAL(name) name##_double
typedef double_x8 reals;
typedef long_x8 wholes;
typedef double_x4 quad;
typedef double_x8 wide_sum;
INLINE wide_sum widen(reals a) { return a; }
INLINE reals all(real a) { return vset_double_x8(a); }
#else
typedef float real;
typedef int32_t whole;
enum { SONDE_BATCH = 16, SONDE_RECORD = 8, SONDE_QUAD = 4 };
#define BY_REAL(name) name##_float
typedef float_x16 reals;
typedef int_x16 wholes;
typedef float_x4 quad;
typedef double_x16 wide_sum;
INLINE wide_sum widen(reals a) { return vwiden(a); }
INLINE reals all(real a) { return vset_float_x16(a); }
#endif
INLINE reals pick(wholes mask, reals yes, reals no) { return vselect(mask, yes, no); }
INLINE reals larger(reals a, reals b) { return pick(a > b, a, b); }
INLINE reals smaller(reals a, reals b) { return pick(a < b, a, b); }
INLINE uint32_t bits(wholes mask) { return vbits(mask); }
INLINE double total(wide_sum a) { return vsum(a); }
INLINE reals dot(const reals a[3], const reals b[3]) { return vdot(a, b); }

#ifdef SONDE_REAL_DOUBLE
#if defined(__AVX2__)
// Columns of four rows of four numbers each.
INLINE void transpose4(const __m256d row[4], __m256d out[4]) {
  __m256d low01 = _mm256_unpacklo_pd(row[0], row[1]), low23 = _mm256_unpacklo_pd(row[2], row[3]);
  __m256d high01 = _mm256_unpackhi_pd(row[0], row[1]), high23 = _mm256_unpackhi_pd(row[2], row[3]);
  out[0] = _mm256_permute2f128_pd(low01, low23, 0x20);
  out[1] = _mm256_permute2f128_pd(high01, high23, 0x20);
  out[2] = _mm256_permute2f128_pd(low01, low23, 0x31);
  out[3] = _mm256_permute2f128_pd(high01, high23, 0x31);
}
#endif

// The first `count` numbers, at most eight, of records of `stride` numbers at the nodes of a batch.
INLINE void read_rows(const double *base, int stride, const wholes *nodes, int count, reals *out) {
  const whole *node = (const whole *)nodes;
#if defined(__AVX2__)
  for (int half = 0; half < 2; ++half)
    for (int from = 0; from < count; from += 4) {
      __m256d row[4], column[4];
      for (int k = 0; k < 4; ++k)
        row[k] = _mm256_load_pd(base + node[4 * half + k] * stride + from);
      transpose4(row, column);
      for (int c = 0; c < 4 && from + c < count; ++c) ((__m256d *)&out[from + c])[half] = column[c];
    }
#else
  for (int c = 0; c < count; ++c)
    for (int l = 0; l < SONDE_BATCH; ++l) out[c][l] = base[node[l] * stride + c];
#endif
}
INLINE void read_quads(const real *base, const wholes *nodes, reals out[4]) {
  read_rows(base, SONDE_QUAD, nodes, 4, out);
}
INLINE void read_records(const real *base, const wholes *nodes, reals out[6]) {
  read_rows(base, SONDE_RECORD, nodes, 6, out);
}

INLINE void write_records(real *base, int stride, const reals in[4]) {
#if defined(__AVX2__)
  for (int half = 0; half < 2; ++half) {
    __m256d row[4], column[4];
    for (int c = 0; c < 4; ++c) column[c] = ((const __m256d *)&in[c])[half];
    transpose4(column, row);
    for (int k = 0; k < 4; ++k) _mm256_store_pd(base + (4 * half + k) * stride, row[k]);
  }
#else
  for (int l = 0; l < SONDE_BATCH; ++l)
    for (int c = 0; c < 4; ++c) base[l * stride + c] = in[c][l];
#endif
}
#else
// The four numbers at each node of a batch; the first six of a record; four numbers per node to
// consecutive records of `stride` numbers.
INLINE void read_quads(const real *base, const wholes *nodes, reals out[4]) {
  vload_records(base, SONDE_QUAD, nodes, out);
}
INLINE void read_records(const real *base, const wholes *nodes, reals out[6]) {
  vload_six(base, nodes, out);
}
INLINE void write_records(real *base, int stride, const reals in[4]) {
  vstore_records(base, (unsigned)stride, in);
}
#endif
#endif // of batches

// sqrt(a) and 1/sqrt(a) for a > 0: of floats both within 5e-7.
INLINE reals root_and_inverse(reals a, reals *inverse) {
#if defined(SONDE_REAL_SCALAR) || defined(SONDE_REAL_DOUBLE)
#ifdef SONDE_REAL_SCALAR
  reals length = __builtin_sqrt(a);
#else
  reals length = vsqrt(a);
#endif
  *inverse = 1 / length;
  return length;
#else
  *inverse = vinverse_sqrt(a);
  return a * *inverse;
#endif
}

#endif
