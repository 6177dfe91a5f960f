// Solids for tests: bricks on a structured grid under any map, and mixed conditions on the
// condensed nodes.
#ifndef SONDE_TEST_BLOCKS_H
#define SONDE_TEST_BLOCKS_H

#include "base/base.h"
#include "sparse/dense.h"
#include "interior/solid.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>
#include <cmocka.h>

typedef struct block {
  sonde_solid solid;
  uint32_t count[3]; // nodes along i, j, k
  unsigned char *last;
  double *load; // [3*nodes] force or displacement at the last nodes
  bool *given;  // [3*nodes] displacement is prescribed
  double *reaction;
} block;

static inline uint32_t block_node(const block *b, uint32_t i, uint32_t j, uint32_t k) {
  return (k * b->count[1] + j) * b->count[0] + i;
}

static inline block block_create(uint32_t ni, uint32_t nj, uint32_t nk, double shear, double bulk) {
  block b = {.count = {ni, nj, nk}};
  uint32_t n = ni * nj * nk, h = 0;
  assert_int_equal(sonde_solid_allocate(&b.solid, n, (ni - 1) * (nj - 1) * (nk - 1), NULL), 0);
  b.last = SONDE_NEW(unsigned char, n);
  b.load = SONDE_NEW(double, 3 * n), b.given = SONDE_NEW(bool, 3 * n);
  b.reaction = SONDE_NEW(double, 3 * n);
  for (uint32_t k = 0; k + 1 < nk; ++k)
    for (uint32_t j = 0; j + 1 < nj; ++j)
      for (uint32_t i = 0; i + 1 < ni; ++i) {
        sonde_solid_hex *e = &b.solid.hex[h++];
        *e = (sonde_solid_hex){.shear_pa = shear, .bulk_pa = bulk};
        for (uint32_t c = 0; c < 4; ++c) {
          uint32_t di = c == 1 || c == 2, dj = c >= 2;
          e->node[c] = block_node(&b, i + di, j + dj, k);
          e->node[c + 4] = block_node(&b, i + di, j + dj, k + 1);
        }
      }
  return b;
}

// A prescribed displacement along one axis; the node becomes one of the last.
static inline void block_give(block *b, uint32_t node, int axis, double value) {
  b->last[node] = 1;
  b->given[3 * node + (uint32_t)axis] = true;
  b->load[3 * node + (uint32_t)axis] = value;
}

// Factors, solves the last nodes for their mixed conditions, recovers the rest.
static inline void block_solve(block *b) {
  sonde_solid *s = &b->solid;
  sonde_error error;
  if (sonde_solid_connect(s, b->last, NULL, &error) != SONDE_OK) fail_msg("%s", error.message);
  assert_true(sonde_solid_factor(s));
  uint32_t side = 3 * s->last_count, first = s->unknown_count - s->last_count;
  const double *condensed = sonde_numeric_condensed(&s->numeric);
  double *a = SONDE_NEW(double, (size_t)side *side), *x = SONDE_NEW(double, side), stiff = 0;
  for (uint32_t j = 0; j < side; ++j)
    for (uint32_t i = j; i < side; ++i) a[(size_t)i * side + j] = condensed[(size_t)j * side + i];
  for (uint32_t i = 0; i < side; ++i) stiff = fmax(stiff, 1e8 * a[(size_t)i * side + i]);
  for (uint32_t node = 0; node < s->node_count; ++node)
    for (uint32_t axis = 0; axis < 3; ++axis) {
      if (!b->last[node] || s->unknown[node] == SONDE_HELD_CORNER) continue;
      uint32_t row = 3 * (s->unknown[node] - first) + axis;
      bool given = b->given[3 * node + axis];
      x[row] = b->load[3 * node + axis] * (given ? stiff : 1);
      if (given) a[(size_t)row * side + row] += stiff;
    }
  assert_true(sonde_cholesky(a, side));
  sonde_cholesky_solve(a, side, x);
  for (uint32_t i = 0; i < side; ++i) s->x[3 * first + i] = (float)x[i];
  for (uint32_t node = 0; node < s->node_count; ++node)
    for (uint32_t axis = 0; axis < 3; ++axis) {
      if (!b->given[3 * node + axis] || s->unknown[node] == SONDE_HELD_CORNER) continue;
      double u = x[3 * (s->unknown[node] - first) + axis];
      b->reaction[3 * node + axis] = stiff * (b->load[3 * node + axis] - u);
    }
  sonde_numeric_recover(&s->numeric, &s->x, 1);
  sonde_free(a);
  sonde_free(x);
}

static inline void block_clear(block *b) {
  sonde_solid_clear(&b->solid);
  sonde_free(b->last);
  sonde_free(b->load);
  sonde_free(b->given);
  sonde_free(b->reaction);
}

// Bulk over shear modulus of a Poisson's ratio.
static inline double block_bulk(double poisson) {
  return 2 * (1 + poisson) / (3 * (1 - 2 * poisson));
}

#endif
