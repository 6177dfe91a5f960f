// Pieces of a nested dissection from its marks, and their boundaries: later rows that a piece
// touches or its children leave.
#include "sparse/pieces.h"

#include "base/base.h"

#include <string.h>

static int compare(const void *a, const void *b) {
  uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
  return (x > y) - (x < y);
}

// seen[place] is the number of the last piece, from 1, that has it in its boundary.
static void add_place(sonde_pieces *s, uint32_t t, uint32_t place, uint32_t *seen) {
  sonde_piece *p = &s->list[t];
  if (place < p->first + p->count || seen[place] == t + 1) return;
  seen[place] = t + 1;
  s->boundary[p->boundary + p->boundary_count++] = place;
}

static sonde_status find_boundaries(sonde_pieces *s, const sonde_pattern *a, uint32_t *seen,
                                    sonde_error *error) {
  size_t room = 0;
  for (uint32_t t = 0; t < s->count; ++t) {
    sonde_piece *p = &s->list[t];
    if (s->boundary_total + a->n > room) {
      size_t wanted = 2 * (s->boundary_total + a->n);
      uint32_t *grown = sonde_realloc(s->boundary, room * sizeof *grown, wanted * sizeof *grown);
      if (!grown) return sonde_fail_memory(error);
      s->boundary = grown;
      room = wanted;
    }
    p->boundary = (uint32_t)s->boundary_total;
    for (uint32_t k = p->first; k < p->first + p->count; ++k)
      for (uint32_t q = a->start[s->order[k]]; q < a->start[s->order[k] + 1]; ++q)
        add_place(s, t, s->rank[a->column[q]], seen);
    p->before = t - 1;
    for (uint32_t c = 0; c < p->child_count; ++c) {
      const sonde_piece *child = &s->list[p->before];
      SONDE_ASSERT(child->parent == t);
      for (uint32_t i = 0; i < child->boundary_count; ++i)
        add_place(s, t, s->boundary[child->boundary + i], seen);
      p->before = child->before;
    }
    qsort(s->boundary + p->boundary, p->boundary_count, sizeof *s->boundary, compare);
    s->boundary_total += p->boundary_count;
  }
  return SONDE_OK;
}

sonde_status sonde_pieces_find(const sonde_pattern *pattern, uint32_t rows, uint32_t leaf,
                               sonde_pieces *s, sonde_error *error) {
  uint32_t n = pattern->n, *scratch = SONDE_NEW(uint32_t, n);
  *s = (sonde_pieces){.order = SONDE_NEW(uint32_t, n),
                      .rank = SONDE_NEW(uint32_t, n),
                      .piece_of = SONDE_NEW(uint32_t, n + 1)};
  sonde_status status = scratch && s->order && s->rank && s->piece_of
                            ? sonde_dissect(pattern, rows, leaf, s->order, scratch, error)
                            : sonde_fail_memory(error);
  for (uint32_t k = 0; !status && k < rows; ++k) s->count += scratch[k] != UINT32_MAX;
  if (!status) s->list = SONDE_NEW(sonde_piece, s->count + 1);
  if (!status && !s->list) status = sonde_fail_memory(error);
  if (!status) {
    // A mark begins a piece and names a row of its parent.
    uint32_t t = 0;
    for (uint32_t k = 0; k < rows; ++k) {
      if (scratch[k] != UINT32_MAX) s->list[t++].first = k;
      s->piece_of[k] = t - 1;
      ++s->list[t - 1].count;
    }
    SONDE_ASSERT(t == s->count);
    s->list[t].first = rows, s->list[t].count = n - rows;
    for (uint32_t k = rows; k <= n; ++k) s->piece_of[k] = t;
    for (sonde_piece *p = s->list; p < s->list + t; ++p) {
      p->parent = s->piece_of[scratch[p->first]];
      ++s->list[p->parent].child_count;
    }
    for (uint32_t k = 0; k < n; ++k) s->rank[s->order[k]] = k;
    memset(scratch, 0, n * sizeof *scratch);
    status = find_boundaries(s, pattern, scratch, error);
  }
  sonde_free(scratch);
  return status;
}

void sonde_pieces_clear(sonde_pieces *s) {
  void *parts[] = {s->list, s->order, s->rank, s->piece_of, s->boundary};
  for (size_t i = 0; i < SONDE_COUNT_OF(parts); ++i) sonde_free(parts[i]);
  *s = (sonde_pieces){0};
}
