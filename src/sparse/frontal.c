// Analysis and walk of the multifrontal solver.
//
// find_pieces       pieces of the dissection
// find_boundaries   later rows that a piece touches or its children leave
// relate            where a piece's boundary lies in its parent
// list_entries      where the matrix adds to a piece
// measure           sizes of the factor and of the updates that wait
// sonde_frontal_factor  pieces upward: assemble, eliminate, keep the update
// sonde_frontal_solve   pieces upward and downward
#include "sparse/frontal.h"

#include "base/base.h"
#include "base/maths.h"

#include <stdlib.h>
#include <string.h>

typedef struct piece {
  uint32_t first, count;             // own rows: places in the order
  uint32_t boundary, boundary_count; // later places, in `boundary`
  uint32_t parent, child_count;      // parent: piece_count at a root
  uint32_t before;                   // the sibling that waits below it, when there is one
  uint32_t entry, entry_count;       // in `entries`
  uint32_t rows, size;               // of its columns and of its update, with what is rounded up
  size_t factor;                     // its columns
} piece;

// A number of the matrix and its place in the piece's columns.
typedef struct entry {
  uint32_t source, target;
} entry;

struct sonde_frontal {
  uint32_t n, piece_count;
  uint32_t *order; // [n] row at a place
  piece *pieces;
  uint32_t *boundary; // places, ascending per piece
  uint32_t *related;  // [as boundary] index among the rows of the parent's columns
  entry *entries;
  size_t boundary_total, factor_size, update_size, most_update, most_columns;
  uint32_t most_rows;
  const sonde_frontal_kernels *kernels;
};

// What the analysis needs besides.
typedef struct analysis {
  const sonde_pattern *pattern;
  uint32_t *rank, *above, *seen, *piece_of, *waiting; // [n]
} analysis;

static int compare(const void *a, const void *b) {
  uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
  return x < y ? -1 : x > y;
}

static uint32_t rounded(uint32_t count, uint32_t to) { return (count + to - 1) / to * to; }

static sonde_status find_pieces(sonde_frontal *f, analysis *a, sonde_error *error) {
  for (uint32_t k = 0; k < f->n; ++k) f->piece_count += a->above[k] != UINT32_MAX;
  f->pieces = SONDE_NEW(piece, f->piece_count);
  if (!f->pieces) return sonde_fail_memory(error);
  uint32_t t = 0;
  for (uint32_t k = 0; k < f->n; ++k) {
    if (a->above[k] != UINT32_MAX) f->pieces[t++].first = k;
    a->piece_of[k] = t - 1;
    ++f->pieces[t - 1].count;
  }
  SONDE_ASSERT(t == f->piece_count);
  for (t = 0; t < f->piece_count; ++t) {
    uint32_t up = a->above[f->pieces[t].first];
    f->pieces[t].parent = up < f->n ? a->piece_of[up] : f->piece_count;
    if (up < f->n) ++f->pieces[f->pieces[t].parent].child_count;
  }
  return SONDE_OK;
}

static sonde_status reserve(sonde_frontal *f, size_t used, size_t *room, sonde_error *error) {
  if (used + f->n <= *room) return SONDE_OK;
  size_t wanted = 2 * (used + f->n);
  uint32_t *grown = sonde_realloc(f->boundary, *room * sizeof *grown, wanted * sizeof *grown);
  if (!grown) return sonde_fail_memory(error);
  f->boundary = grown;
  *room = wanted;
  return SONDE_OK;
}

static void add_place(sonde_frontal *f, analysis *a, uint32_t t, uint32_t place) {
  piece *p = &f->pieces[t];
  if (place < p->first + p->count || a->seen[place] == t + 1) return;
  a->seen[place] = t + 1;
  f->boundary[p->boundary + p->boundary_count++] = place;
}

// Children wait on a stack: they directly precede their parent.
static sonde_status find_boundaries(sonde_frontal *f, analysis *a, sonde_error *error) {
  size_t room = 0;
  uint32_t waiting = 0;
  for (uint32_t t = 0; t < f->piece_count; ++t) {
    piece *p = &f->pieces[t];
    sonde_status status = reserve(f, f->boundary_total, &room, error);
    if (status) return status;
    p->boundary = (uint32_t)f->boundary_total;
    for (uint32_t k = p->first; k < p->first + p->count; ++k) {
      uint32_t row = f->order[k];
      for (uint32_t q = a->pattern->start[row]; q < a->pattern->start[row + 1]; ++q)
        add_place(f, a, t, a->rank[a->pattern->column[q]]);
    }
    for (uint32_t c = 0; c < p->child_count; ++c) {
      const piece *child = &f->pieces[a->waiting[--waiting]];
      SONDE_ASSERT(child->parent == t);
      for (uint32_t i = 0; i < child->boundary_count; ++i)
        add_place(f, a, t, f->boundary[child->boundary + i]);
    }
    p->before = waiting ? a->waiting[waiting - 1] : 0;
    a->waiting[waiting++] = t;
    qsort(f->boundary + p->boundary, p->boundary_count, sizeof *f->boundary, compare);
    f->boundary_total += p->boundary_count;
  }
  return SONDE_OK;
}

// seen[place] becomes the place's index among the rows of piece t.
static void number_rows(const sonde_frontal *f, uint32_t t, uint32_t *index) {
  const piece *p = &f->pieces[t];
  for (uint32_t k = 0; k < p->count; ++k) index[p->first + k] = k;
  for (uint32_t i = 0; i < p->boundary_count; ++i)
    index[f->boundary[p->boundary + i]] = p->count + i;
}

static sonde_status relate(sonde_frontal *f, analysis *a, sonde_error *error) {
  f->related = SONDE_NEW(uint32_t, f->boundary_total + 1);
  if (!f->related) return sonde_fail_memory(error);
  uint32_t waiting = 0;
  for (uint32_t t = 0; t < f->piece_count; ++t) {
    number_rows(f, t, a->seen);
    for (uint32_t c = 0; c < f->pieces[t].child_count; ++c) {
      const piece *child = &f->pieces[a->waiting[--waiting]];
      for (uint32_t i = child->boundary; i < child->boundary + child->boundary_count; ++i)
        f->related[i] = a->seen[f->boundary[i]];
    }
    a->waiting[waiting++] = t;
  }
  return SONDE_OK;
}

static sonde_status list_entries(sonde_frontal *f, analysis *a, sonde_error *error) {
  const sonde_pattern *m = a->pattern;
  f->entries = SONDE_NEW(entry, m->start[m->n]);
  if (!f->entries) return sonde_fail_memory(error);
  uint32_t used = 0;
  for (uint32_t t = 0; t < f->piece_count; ++t) {
    piece *p = &f->pieces[t];
    p->entry = used;
    number_rows(f, t, a->seen);
    for (uint32_t k = 0; k < p->count; ++k) {
      uint32_t row = f->order[p->first + k];
      for (uint32_t q = m->start[row]; q < m->start[row + 1]; ++q) {
        uint32_t place = a->rank[m->column[q]];
        if (place >= p->first + k) f->entries[used++] = (entry){q, k * p->rows + a->seen[place]};
      }
    }
    p->entry_count = used - p->entry;
  }
  return SONDE_OK;
}

static sonde_status measure(sonde_frontal *f, sonde_error *error) {
  size_t top = 0;
  uint32_t waiting = 0;
  uint32_t *stack = SONDE_NEW(uint32_t, f->piece_count);
  if (!stack) return sonde_fail_memory(error);
  for (uint32_t t = 0; t < f->piece_count; ++t) {
    piece *p = &f->pieces[t];
    p->size = rounded(p->boundary_count, 4);
    p->rows = rounded(p->count + p->size, 8);
    p->factor = f->factor_size;
    size_t columns = (size_t)p->count * p->rows;
    f->factor_size += columns;
    if (columns > f->most_columns) f->most_columns = columns;
    size_t update = (size_t)p->size * p->size;
    if (update > f->most_update) f->most_update = update;
    if (p->rows > f->most_rows) f->most_rows = p->rows;
    for (uint32_t c = 0; c < p->child_count; ++c) {
      size_t side = f->pieces[stack[--waiting]].size;
      top -= side * side;
    }
    stack[waiting++] = t;
    top += update;
    if (top > f->update_size) f->update_size = top;
  }
  sonde_free(stack);
  return SONDE_OK;
}

static sonde_status analyse(sonde_frontal *f, analysis *a, sonde_error *error) {
  uint32_t n = f->n;
  f->order = SONDE_NEW(uint32_t, n);
  a->rank = SONDE_NEW(uint32_t, n);
  a->above = SONDE_NEW(uint32_t, n);
  a->seen = SONDE_NEW(uint32_t, n);
  a->piece_of = SONDE_NEW(uint32_t, n);
  a->waiting = SONDE_NEW(uint32_t, n);
  if (!f->order || !a->rank || !a->above || !a->seen || !a->piece_of || !a->waiting)
    return sonde_fail_memory(error);
  sonde_status status = sonde_dissect(a->pattern, f->order, a->above, error);
  if (status) return status;
  for (uint32_t k = 0; k < n; ++k) a->rank[f->order[k]] = k;
  status = find_pieces(f, a, error);
  if (!status) status = find_boundaries(f, a, error);
  if (!status) status = measure(f, error);
  if (!status) status = relate(f, a, error);
  if (!status) status = list_entries(f, a, error);
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
  *f = (sonde_frontal){.n = pattern->n, .kernels = sonde_frontal_kernels_named(NULL)};
  analysis a = {.pattern = pattern};
  status = analyse(f, &a, error);
  sonde_free(a.rank);
  sonde_free(a.above);
  sonde_free(a.seen);
  sonde_free(a.piece_of);
  sonde_free(a.waiting);
  if (status)
    sonde_frontal_destroy(f);
  else
    *frontal = f;
  return status;
}

void sonde_frontal_destroy(sonde_frontal *f) {
  if (!f) return;
  sonde_free(f->order);
  sonde_free(f->pieces);
  sonde_free(f->boundary);
  sonde_free(f->related);
  sonde_free(f->entries);
  sonde_free(f);
}

size_t sonde_frontal_factor_size(const sonde_frontal *f) { return f->factor_size; }

size_t sonde_frontal_work_size(const sonde_frontal *f) {
  return f->most_columns + f->most_update + f->update_size;
}

size_t sonde_frontal_scratch_size(const sonde_frontal *f) { return (size_t)f->n + f->most_rows; }

const sonde_frontal_kernels *sonde_frontal_kernels_named(const char *name) {
  const sonde_frontal_kernels *known[] = {
#ifdef __x86_64__
      __builtin_cpu_supports("avx2") ? &sonde_frontal_kernels_avx2 : NULL,
#endif
      &sonde_frontal_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (known[k] && (!name || strcmp(name, known[k]->name) == 0)) return known[k];
  return NULL;
}

void sonde_frontal_use(sonde_frontal *f, const sonde_frontal_kernels *kernels) {
  SONDE_ASSERT(kernels != NULL);
  f->kernels = kernels;
}

// ---- numbers ------------------------------------------------------------------------------

// A child's update into the columns of its parent and into what these leave.
static void add_update(const uint32_t *related, const piece *child, const double *from,
                       const piece *p, double *columns, double *update) {
  for (uint32_t j = 0; j < child->boundary_count; ++j, from += child->size) {
    uint32_t column = related[j];
    double *to = column < p->count ? columns + (size_t)column * p->rows
                                   : update + (size_t)(column - p->count) * p->size;
    uint32_t shift = column < p->count ? 0 : p->count;
    for (uint32_t i = j; i < child->boundary_count; ++i) to[related[i] - shift] += from[i];
  }
}

bool sonde_frontal_factor(const sonde_frontal *f, const double *value, float *factor,
                          double *work) {
  double *columns = work, *update = columns + f->most_columns, *stack = update + f->most_update;
  size_t top = 0;
  SONDE_ASSERT(f->piece_count > 0);
  for (uint32_t t = 0; t < f->piece_count; ++t) {
    const piece *p = &f->pieces[t];
    size_t size = (size_t)p->size * p->size, numbers = (size_t)p->count * p->rows;
    memset(columns, 0, numbers * sizeof *columns);
    memset(update, 0, size * sizeof *update);
    for (uint32_t k = p->entry; k < p->entry + p->entry_count; ++k)
      columns[f->entries[k].target] = value[f->entries[k].source];
    for (uint32_t c = 0, at = t; c < p->child_count; ++c) {
      at = c ? f->pieces[at].before : t - 1;
      const piece *child = &f->pieces[at];
      top -= (size_t)child->size * child->size;
      add_update(f->related + child->boundary, child, stack + top, p, columns, update);
    }
    if (!f->kernels->eliminate(columns, p->count, p->rows, update, p->size)) return false;
    for (size_t k = 0; k < numbers; ++k) factor[p->factor + k] = (float)columns[k];
    memcpy(stack + top, update, size * sizeof *stack);
    top += size;
  }
  return true;
}

void sonde_frontal_solve(const sonde_frontal *f, const float *factor, double *x, float *scratch) {
  float *y = scratch, *part = scratch + f->n;
  for (uint32_t k = 0; k < f->n; ++k) y[k] = (float)x[f->order[k]];
  for (uint32_t t = 0; t < f->piece_count; ++t) {
    const piece *p = &f->pieces[t];
    const uint32_t *boundary = f->boundary + p->boundary;
    memcpy(part, y + p->first, p->count * sizeof *part);
    memset(part + p->count, 0, (p->rows - p->count) * sizeof *part);
    f->kernels->forward(factor + p->factor, p->count, p->rows, part);
    memcpy(y + p->first, part, p->count * sizeof *part);
    for (uint32_t i = 0; i < p->boundary_count; ++i) y[boundary[i]] += part[p->count + i];
  }
  for (uint32_t t = f->piece_count; t-- > 0;) {
    const piece *p = &f->pieces[t];
    const uint32_t *boundary = f->boundary + p->boundary;
    memcpy(part, y + p->first, p->count * sizeof *part);
    memset(part + p->count, 0, (p->rows - p->count) * sizeof *part);
    for (uint32_t i = 0; i < p->boundary_count; ++i) part[p->count + i] = y[boundary[i]];
    f->kernels->backward(factor + p->factor, p->count, p->rows, part);
    memcpy(y + p->first, part, p->count * sizeof *part);
  }
  for (uint32_t k = 0; k < f->n; ++k) x[f->order[k]] = (double)y[k];
}
