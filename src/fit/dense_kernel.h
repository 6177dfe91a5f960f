// Product of dense matrices for one instruction set, included once for each. Every number is summed
// in the order of `depth`: all sets, and plain loops, give the same bits.
#include "fit/dense.h"

#include "base/base.h"

#include <string.h>

#define INLINE static inline __attribute__((always_inline))
typedef double four __attribute__((vector_size(32)));

INLINE four load(const double *from) {
  four v;
  memcpy(&v, from, sizeof v);
  return v;
}

INLINE void store(double *to, four v) { memcpy(to, &v, sizeof v); }

// What a(row, k) counts in the sum.
INLINE double share(const sonde_product *p, const double *a, int row, uint32_t k, bool weighted) {
  double x = a[(size_t)row * p->a_row + k * p->a_step];
  return weighted ? p->weight[k] * x : x;
}

// `high` rows and 4 `wide` columns of c.
INLINE void block(const sonde_product *p, double *c, const double *a, const double *b, int high,
                  int wide, bool subtract, bool weighted) {
  four sum[4][2];
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < wide; ++w) sum[r][w] = load(c + (size_t)r * p->c_row + 4 * w);
  for (uint32_t k = 0; k < p->depth; ++k, b += p->b_row)
    for (int r = 0; r < high; ++r) {
      double x = share(p, a, r, k, weighted);
      for (int w = 0; w < wide; ++w) {
        four part = x * load(b + 4 * w);
        sum[r][w] = subtract ? sum[r][w] - part : sum[r][w] + part;
      }
    }
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < wide; ++w) store(c + (size_t)r * p->c_row + 4 * w, sum[r][w]);
}

INLINE void single(const sonde_product *p, double *c, const double *a, const double *b,
                   bool subtract, bool weighted) {
  double sum = *c;
  for (uint32_t k = 0; k < p->depth; ++k) {
    double part = share(p, a, 0, k, weighted) * b[k * p->b_row];
    sum = subtract ? sum - part : sum + part;
  }
  *c = sum;
}

#ifdef __AVX2__
enum { WIDE = 2 };
#else
enum { WIDE = 1 };
#endif

INLINE void strip(const sonde_product *p, uint32_t row, int high, bool subtract, bool weighted) {
  double *c = p->c + row * p->c_row;
  const double *a = p->a + row * p->a_row;
  uint32_t j = 0;
  for (; j + 4 * WIDE <= p->columns; j += 4 * WIDE)
    block(p, c + j, a, p->b + j, high, WIDE, subtract, weighted);
  for (; j + 4 <= p->columns; j += 4) block(p, c + j, a, p->b + j, high, 1, subtract, weighted);
  for (; j < p->columns; ++j)
    for (int r = 0; r < high; ++r)
      single(p, c + (size_t)r * p->c_row + j, a + (size_t)r * p->a_row, p->b + j, subtract,
             weighted);
}

INLINE void all(const sonde_product *p, bool subtract, bool weighted) {
  uint32_t i = 0;
  for (; i + 4 <= p->rows; i += 4) strip(p, i, 4, subtract, weighted);
  for (; i < p->rows; ++i) strip(p, i, 1, subtract, weighted);
}

static void multiply(const sonde_product *p) {
  SONDE_ASSERT(p->c && p->a && p->b);
  if (p->weight)
    all(p, p->subtract, true);
  else if (p->subtract)
    all(p, true, false);
  else
    all(p, false, false);
}

const sonde_dense_kernels DENSE_KERNELS = {DENSE_NAME, multiply};
