// Analysis and walk of the multifrontal solver.
//
// relate            where a piece's boundary lies in its parent
// list_entries      where the matrix adds to a piece
// measure           sizes of the factor and of the updates that wait
// sonde_frontal_factor  pieces upward: assemble, eliminate, keep the update
// sonde_frontal_solve   pieces upward and downward
#include "sparse/frontal.h"

#include "base/base.h"
#include "sparse/pieces.h"

#include <string.h>

// A number of the matrix and its place in the piece's columns.
typedef struct entry {
  uint32_t source, target;
} entry;

struct sonde_frontal {
  uint32_t n;
  sonde_pieces pieces;
  uint32_t *related; // [as boundary] index among the rows of the parent's columns
  entry *entries;
  size_t factor_size, update_size, most_update, most_columns;
  uint32_t most_rows;
  const sonde_dense_kernels *kernels;
};

static uint32_t rounded(uint32_t count, uint32_t to) { return (count + to - 1) / to * to; }

// Order of a piece's update, and rows of its columns, with what is rounded up.
static uint32_t size_of(const sonde_piece *p) { return rounded(p->boundary_count, 4); }
static uint32_t rows_of(const sonde_piece *p) { return rounded(p->count + size_of(p), 8); }

// index[place] becomes the place's index among the rows of the piece.
static void number_rows(const sonde_frontal *f, const sonde_piece *p, uint32_t *index) {
  for (uint32_t k = 0; k < p->count; ++k) index[p->first + k] = k;
  for (uint32_t i = 0; i < p->boundary_count; ++i)
    index[f->pieces.boundary[p->boundary + i]] = p->count + i;
}

static void relate(sonde_frontal *f, uint32_t *index) {
  const sonde_piece *list = f->pieces.list;
  for (uint32_t t = 0; t < f->pieces.count; ++t) {
    number_rows(f, &list[t], index);
    for (uint32_t c = 0, at = t - 1; c < list[t].child_count; ++c, at = list[at].before)
      for (uint32_t i = 0; i < list[at].boundary_count; ++i)
        f->related[list[at].boundary + i] = index[f->pieces.boundary[list[at].boundary + i]];
  }
}

static void list_entries(sonde_frontal *f, const sonde_pattern *m, uint32_t *index) {
  uint32_t used = 0;
  for (uint32_t t = 0; t < f->pieces.count; ++t) {
    sonde_piece *p = &f->pieces.list[t];
    p->entry = used;
    number_rows(f, p, index);
    for (uint32_t k = 0; k < p->count; ++k) {
      uint32_t row = f->pieces.order[p->first + k];
      for (uint32_t q = m->start[row]; q < m->start[row + 1]; ++q) {
        uint32_t place = f->pieces.rank[m->column[q]];
        if (place >= p->first + k) f->entries[used++] = (entry){q, k * rows_of(p) + index[place]};
      }
    }
    p->entry_count = used - p->entry;
  }
}

static void measure(sonde_frontal *f) {
  f->update_size = sonde_pieces_stack(&f->pieces, size_of);
  for (uint32_t t = 0; t < f->pieces.count; ++t) {
    sonde_piece *p = &f->pieces.list[t];
    size_t columns = (size_t)p->count * rows_of(p), update = (size_t)size_of(p) * size_of(p);
    p->factor = f->factor_size;
    f->factor_size += columns;
    if (columns > f->most_columns) f->most_columns = columns;
    if (update > f->most_update) f->most_update = update;
    if (rows_of(p) > f->most_rows) f->most_rows = rows_of(p);
  }
}

static sonde_status analyse(sonde_frontal *f, const sonde_pattern *pattern, sonde_error *error) {
  sonde_status status = sonde_pieces_find(pattern, f->n, SONDE_LEAF, &f->pieces, error);
  if (status) return status;
  uint32_t *index = SONDE_NEW(uint32_t, f->n);
  f->related = SONDE_NEW(uint32_t, f->pieces.boundary_total);
  f->entries = SONDE_NEW(entry, pattern->start[f->n]);
  if (!index || !f->related || !f->entries) status = sonde_fail_memory(error);
  if (!status) {
    measure(f);
    relate(f, index);
    list_entries(f, pattern, index);
  }
  sonde_free(index);
  return status;
}

sonde_status sonde_frontal_create(const sonde_pattern *pattern, sonde_frontal **frontal,
                                  sonde_error *error) {
  SONDE_ASSERT(frontal != NULL && pattern->points != NULL);
  *frontal = NULL;
  sonde_status status = sonde_pattern_check(pattern, error);
  if (status) return status;
  sonde_frontal *f = SONDE_NEW(sonde_frontal, 1);
  if (!f) return sonde_fail_memory(error);
  *f = (sonde_frontal){.n = pattern->n, .kernels = sonde_dense_kernels_find(NULL)};
  status = analyse(f, pattern, error);
  if (status)
    sonde_frontal_destroy(f);
  else
    *frontal = f;
  return status;
}

void sonde_frontal_destroy(sonde_frontal *f) {
  if (!f) return;
  sonde_pieces_clear(&f->pieces);
  sonde_free(f->related);
  sonde_free(f->entries);
  sonde_free(f);
}

size_t sonde_frontal_factor_size(const sonde_frontal *f) { return f->factor_size; }

size_t sonde_frontal_work_size(const sonde_frontal *f) {
  return f->most_columns + f->most_update + f->update_size;
}

size_t sonde_frontal_scratch_size(const sonde_frontal *f) { return (size_t)f->n + f->most_rows; }

void sonde_frontal_use(sonde_frontal *f, const sonde_dense_kernels *kernels) {
  SONDE_ASSERT(kernels != NULL);
  f->kernels = kernels;
}

// ---- numbers ------------------------------------------------------------------------------

// A child's update into the columns of its parent and into what these leave.
static void add_update(const uint32_t *related, const sonde_piece *child, const double *from,
                       const sonde_piece *p, double *columns, double *update) {
  uint32_t rows = rows_of(p), size = size_of(p), step = size_of(child);
  for (uint32_t j = 0; j < child->boundary_count; ++j, from += step) {
    uint32_t column = related[j];
    double *to = column < p->count ? columns + (size_t)column * rows
                                   : update + (size_t)(column - p->count) * size;
    uint32_t shift = column < p->count ? 0 : p->count;
    for (uint32_t i = j; i < child->boundary_count; ++i) to[related[i] - shift] += from[i];
  }
}

bool sonde_frontal_factor(const sonde_frontal *f, const double *value, float *factor,
                          double *work) {
  const sonde_piece *list = f->pieces.list;
  double *columns = work, *update = columns + f->most_columns, *stack = update + f->most_update;
  size_t top = 0;
  SONDE_ASSERT(f->pieces.count > 0);
  for (uint32_t t = 0; t < f->pieces.count; ++t) {
    const sonde_piece *p = &list[t];
    uint32_t rows = rows_of(p), side = size_of(p);
    size_t size = (size_t)side * side, numbers = (size_t)p->count * rows;
    memset(columns, 0, numbers * sizeof *columns);
    memset(update, 0, size * sizeof *update);
    for (uint32_t k = p->entry; k < p->entry + p->entry_count; ++k)
      columns[f->entries[k].target] = value[f->entries[k].source];
    for (uint32_t c = 0, at = t - 1; c < p->child_count; ++c, at = list[at].before) {
      top -= (size_t)size_of(&list[at]) * size_of(&list[at]);
      add_update(f->related + list[at].boundary, &list[at], stack + top, p, columns, update);
    }
    if (!f->kernels->eliminate(columns, p->count, rows, update, side)) return false;
    for (size_t k = 0; k < numbers; ++k) factor[p->factor + k] = (float)columns[k];
    memcpy(stack + top, update, size * sizeof *stack);
    top += size;
  }
  return true;
}

void sonde_frontal_solve(const sonde_frontal *f, const float *factor, double *x, float *scratch) {
  const uint32_t *order = f->pieces.order;
  float *y = scratch, *part = scratch + f->n;
  for (uint32_t k = 0; k < f->n; ++k) y[k] = (float)x[order[k]];
  for (uint32_t t = 0; t < f->pieces.count; ++t) {
    const sonde_piece *p = &f->pieces.list[t];
    const uint32_t *boundary = f->pieces.boundary + p->boundary;
    uint32_t rows = rows_of(p);
    memcpy(part, y + p->first, p->count * sizeof *part);
    memset(part + p->count, 0, (rows - p->count) * sizeof *part);
    f->kernels->forward(factor + p->factor, p->count, rows, part);
    memcpy(y + p->first, part, p->count * sizeof *part);
    for (uint32_t i = 0; i < p->boundary_count; ++i) y[boundary[i]] += part[p->count + i];
  }
  for (uint32_t t = f->pieces.count; t-- > 0;) {
    const sonde_piece *p = &f->pieces.list[t];
    const uint32_t *boundary = f->pieces.boundary + p->boundary;
    uint32_t rows = rows_of(p);
    memcpy(part, y + p->first, p->count * sizeof *part);
    memset(part + p->count, 0, (rows - p->count) * sizeof *part);
    for (uint32_t i = 0; i < p->boundary_count; ++i) part[p->count + i] = y[boundary[i]];
    f->kernels->backward(factor + p->factor, p->count, rows, part);
    memcpy(y + p->first, part, p->count * sizeof *part);
  }
  for (uint32_t k = 0; k < f->n; ++k) x[order[k]] = (double)y[k];
}
