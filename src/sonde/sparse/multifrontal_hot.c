// Numbers of the multifrontal factor, front by front: assembly, elimination, storage; solutions.
#include "sparse/multifrontal.h"

#include "base/base.h"
#include "base/vector.h"

#include <string.h>

enum { PANEL = 32 }; // columns that are eliminated at a time

static size_t order_of(const sonde_symbolic *s, const sonde_piece *p) {
  return s->block * ((size_t)p->count + p->boundary_count);
}

// Of the working front; the condensed matrix is left without gaps.
static size_t stride_of(const sonde_numeric *f, size_t n) {
  return f->now < f->symbolic->pieces.count ? sonde_front_stride((uint32_t)n) : n;
}

// Multiplications, about, of assembling a front of order n and of eliminating columns of it.
static uint64_t assembly_cost(const sonde_piece *p, size_t n) {
  return n * n + 20000 * (uint64_t)p->entry_count;
}

static uint64_t panel_cost(size_t n, uint32_t from, uint32_t to) {
  return (to - from) * (n - from) * (n - from) / 2;
}

// The same walk as sonde_numeric_step() without the numbers.
uint32_t sonde_symbolic_steps(const sonde_symbolic *s, uint64_t budget) {
  SONDE_ASSERT(s != NULL && budget > 0);
  uint32_t steps = 1;
  uint64_t spent = 0;
  for (uint32_t t = 0; t <= s->pieces.count; ++t) {
    const sonde_piece *p = &s->pieces.list[t];
    size_t n = order_of(s, p), own = (size_t)s->block * p->count;
    if (spent >= budget) spent = 0, ++steps;
    spent += assembly_cost(p, n);
    for (uint32_t from = 0; from < own && t < s->pieces.count; from += PANEL) {
      if (spent >= budget) spent = 0, ++steps;
      spent += panel_cost(n, from, from + PANEL < own ? from + PANEL : (uint32_t)own);
    }
  }
  return steps;
}

// ---- factorisation ------------------------------------------------------------------------

#define NUMBER double
#include "sparse/multifrontal_front.h"
#define NUMBER float
#include "sparse/multifrontal_front.h"

void sonde_numeric_begin(sonde_numeric *f, const sonde_symbolic *symbolic,
                         const sonde_matrix_source *source) {
  SONDE_ASSERT(f->factor_room >= symbolic->factor_size);
  SONDE_ASSERT(symbolic->elements ? source->element != NULL : source->value != NULL);
  f->symbolic = symbolic;
  f->source = *source;
  f->now = f->column = 0;
  f->top = 0;
  f->assembled = f->failed = false;
}

bool sonde_numeric_step(sonde_numeric *f, uint64_t budget) {
  SONDE_ASSERT(f != NULL && f->symbolic != NULL);
  const sonde_pieces *pieces = &f->symbolic->pieces;
  for (uint64_t spent = 0; spent < budget && !f->failed;) {
    const sonde_piece *p = &pieces->list[f->now];
    size_t n = order_of(f->symbolic, p), own = (size_t)f->symbolic->block * p->count;
    if (!f->assembled) {
      if (f->single)
        assemble_float(f, p);
      else
        assemble_double(f, p);
      f->assembled = true, f->column = 0;
      spent += assembly_cost(p, n);
      continue;
    }
    if (f->now == pieces->count) return true; // the condensed matrix stays in the working front
    uint32_t to = f->column + PANEL < own ? f->column + PANEL : (uint32_t)own;
    f->failed = !(f->single ? f->kernels->eliminate_single(f->front, (uint32_t)n, f->column, to)
                            : f->kernels->eliminate(f->front, (uint32_t)n, f->column, to));
    spent += panel_cost(n, f->column, to);
    f->column = to;
    if (to < own) continue;
    if (f->single)
      store_float(f, p);
    else
      store_double(f, p);
    ++f->now, f->assembled = false;
  }
  return f->failed || (f->now == pieces->count && f->assembled);
}

bool sonde_numeric_factor(sonde_numeric *f, const sonde_symbolic *symbolic,
                          const sonde_matrix_source *source) {
  sonde_numeric_begin(f, symbolic, source);
  while (!sonde_numeric_step(f, UINT64_MAX)) {
  }
  return !f->failed;
}

const double *sonde_numeric_condensed(const sonde_numeric *f) {
  SONDE_ASSERT(f->now == f->symbolic->pieces.count && f->assembled && !f->single);
  return f->front;
}

const float *sonde_numeric_condensed_single(const sonde_numeric *f) {
  SONDE_ASSERT(f->now == f->symbolic->pieces.count && f->assembled && f->single);
  return f->front;
}

// ---- solution -----------------------------------------------------------------------------

// `part` holds the right-hand side and the solution of a piece, then the unknowns of its boundary.
INLINE void recover_piece(const sonde_numeric *f, const sonde_piece *p, float *x, uint32_t block) {
  const uint32_t *order = f->symbolic->pieces.order + p->first;
  const uint32_t *boundary = f->symbolic->pieces.boundary + p->boundary;
  uint32_t own = block * p->count, width = sonde_front_width(own);
  float *right = f->part, *solved = right + width, *rest = solved + width;
  for (uint32_t j = 0; j < width; ++j) right[j] = 0;
  for (uint32_t i = 0; i < p->boundary_count; ++i)
    for (uint32_t a = 0; a < block; ++a)
      rest[block * i + a] = x[block * (size_t)f->symbolic->pieces.order[boundary[i]] + a];
  f->kernels->backward(f->factor + p->factor, own, block * p->boundary_count, right, solved, rest);
  for (uint32_t i = 0; i < p->count; ++i)
    for (uint32_t a = 0; a < block; ++a) x[block * (size_t)order[i] + a] = solved[block * i + a];
}

// All solutions piece by piece: a piece of the factor comes from memory once.
void sonde_numeric_recover(const sonde_numeric *f, float *const *x, uint32_t count) {
  SONDE_ASSERT(f != NULL && x != NULL);
  for (uint32_t t = f->symbolic->pieces.count; t-- > 0;)
    for (uint32_t k = 0; k < count; ++k)
      if (f->symbolic->block == 1)
        recover_piece(f, &f->symbolic->pieces.list[t], x[k], 1);
      else
        recover_piece(f, &f->symbolic->pieces.list[t], x[k], 3);
}

// Takes x to or from the order of the pieces, in `gathered`.
INLINE void gather(const sonde_numeric *f, double *x, uint32_t block, bool back) {
  const uint32_t *order = f->symbolic->pieces.order;
  for (uint32_t k = 0; k < f->symbolic->node_count; ++k)
    for (uint32_t a = 0; a < block; ++a) {
      double *at = &x[block * (size_t)order[k] + a];
      if (back)
        *at = (double)f->gathered[block * k + a];
      else
        f->gathered[block * k + a] = (float)*at;
    }
}

// Solves with L (forward) or its transpose (backward) piece by piece, on what lies in `gathered`.
INLINE void substitute(const sonde_numeric *f, uint32_t block, bool backward) {
  const sonde_pieces *pieces = &f->symbolic->pieces;
  float *y = f->gathered;
  for (uint32_t n = 0; n < pieces->count; ++n) {
    const sonde_piece *p = &pieces->list[backward ? pieces->count - 1 - n : n];
    const uint32_t *boundary = pieces->boundary + p->boundary;
    uint32_t own = block * p->count, behind = block * p->boundary_count;
    uint32_t width = sonde_front_width(own);
    float *right = f->part, *solved = right + width, *rest = solved + width;
    memcpy(right, y + (size_t)block * p->first, own * sizeof *right);
    memset(right + own, 0, (width - own) * sizeof *right);
    for (uint32_t i = 0; i < behind; ++i)
      rest[i] = y[block * (size_t)boundary[i / block] + i % block];
    if (backward) {
      f->kernels->backward(f->factor + p->factor, own, behind, right, solved, rest);
    } else {
      f->kernels->forward(f->factor + p->factor, own, behind, right, solved, rest);
      for (uint32_t i = 0; i < behind; ++i)
        y[block * (size_t)boundary[i / block] + i % block] = rest[i];
    }
    memcpy(y + (size_t)block * p->first, solved, own * sizeof *y);
  }
}

void sonde_numeric_solve(const sonde_numeric *f, double *x) {
  SONDE_ASSERT(f->symbolic->last_count == 0 && !f->failed);
  if (f->symbolic->block == 1) {
    gather(f, x, 1, false);
    substitute(f, 1, false);
    substitute(f, 1, true);
    gather(f, x, 1, true);
  } else {
    sonde_numeric_reduce(f, x);
    sonde_numeric_expand(f, x);
  }
}

void sonde_numeric_reduce(const sonde_numeric *f, double *x) {
  SONDE_ASSERT(f->symbolic->block == 3 && !f->failed);
  gather(f, x, 3, false);
  substitute(f, 3, false);
  gather(f, x, 3, true);
}

void sonde_numeric_expand(const sonde_numeric *f, double *x) {
  SONDE_ASSERT(f->symbolic->block == 3 && !f->failed);
  gather(f, x, 3, false);
  substitute(f, 3, true);
  gather(f, x, 3, true);
}
