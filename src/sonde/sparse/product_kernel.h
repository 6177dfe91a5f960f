// Products of dense.h for one instruction set. Every number is summed in the order of `depth`: all
// sets, and plain loops, give the same bits.
//
// share           a number of the first matrix
// block, single   part of a product
// strip, all      its rows from one on, all of them
#ifndef SONDE_SRC_PRODUCT_KERNEL_H
#define SONDE_SRC_PRODUCT_KERNEL_H

#include "sparse/dense.h"

#include "base/vector.h"

enum { V = VECTOR_BYTES / 8, HIGH = 4, SUMS = 8 }; // the sums of a block stay in registers

// What a(row, k) counts in the sum.
INLINE double share(const sonde_product *p, const double *a, int row, uint32_t k, bool weighted) {
  double x = a[(size_t)row * p->a_row + k * p->a_step];
  return weighted ? p->weight[k] * x : x;
}

// `high` rows and V `wide` columns of c.
INLINE void block(const sonde_product *p, double *c, const double *a, const double *b, int high,
                  int wide, bool subtract, bool weighted) {
  lot sum[SUMS];
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < wide; ++w) sum[r * wide + w] = ((const lot *)(c + (size_t)r * p->c_row))[w];
  for (uint32_t k = 0; k < p->depth; ++k, b += p->b_row)
    for (int r = 0; r < high; ++r) {
      double x = share(p, a, r, k, weighted);
      for (int w = 0; w < wide; ++w) {
        lot part = x * ((const lot *)b)[w];
        sum[r * wide + w] = subtract ? sum[r * wide + w] - part : sum[r * wide + w] + part;
      }
    }
  for (int r = 0; r < high; ++r)
    for (int w = 0; w < wide; ++w) ((lot *)(c + (size_t)r * p->c_row))[w] = sum[r * wide + w];
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

INLINE void strip(const sonde_product *p, uint32_t row, int high, bool subtract, bool weighted) {
  double *c = p->c + row * p->c_row;
  const double *a = p->a + row * p->a_row;
  uint32_t j = 0, wide = SUMS / (uint32_t)high;
  for (; j + V * wide <= p->columns; j += V * wide)
    block(p, c + j, a, p->b + j, high, (int)wide, subtract, weighted);
  for (; j + V <= p->columns; j += V) block(p, c + j, a, p->b + j, high, 1, subtract, weighted);
  for (; j < p->columns; ++j)
    for (int r = 0; r < high; ++r)
      single(p, c + (size_t)r * p->c_row + j, a + (size_t)r * p->a_row, p->b + j, subtract,
             weighted);
}

INLINE void all(const sonde_product *p, bool subtract, bool weighted) {
  uint32_t i = 0;
  for (; i + HIGH <= p->rows; i += HIGH) strip(p, i, HIGH, subtract, weighted);
  for (; i < p->rows; ++i) strip(p, i, 1, subtract, weighted);
}

#endif
