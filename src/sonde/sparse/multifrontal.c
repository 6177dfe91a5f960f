// Symbolic analysis of the multifrontal factor: order, pieces, where the matrix and the updates of
// the fronts below add to a front, sizes; and the memory of its numbers.
#include "base/base.h"
#include "sparse/multifrontal.h"

#include <string.h>

enum { LEAF = 20 }; // nodes of a piece that is not worth splitting

static sonde_status check(const sonde_symbolic_def *def, sonde_error *error) {
  if (def->node_count <= def->last_count || (def->block != 1 && def->block != 3))
    return sonde_fail(error, SONDE_ARGUMENT, "expected free nodes with 1 or 3 unknowns each");
  if (def->row_start) {
    const sonde_pattern pattern = {def->node_count, def->row_start, def->column, def->points};
    return sonde_pattern_check(&pattern, error);
  }
  if (def->element_count == 0 || def->block != 3)
    return sonde_fail(error, SONDE_ARGUMENT, "expected a pattern or elements with 3 unknowns");
  for (uint32_t e = 0; e < def->element_count; ++e)
    for (int c = 0; c < 8; ++c)
      if (def->elements[e][c] != SONDE_HELD_CORNER && def->elements[e][c] >= def->node_count)
        return sonde_fail(error, SONDE_ARGUMENT, "element %u has node %u of %u", e,
                          def->elements[e][c], def->node_count);
  return SONDE_OK;
}

// Nodes that share an element are neighbours, listed as often as they do.
static sonde_status dissect_elements(sonde_symbolic *s, const sonde_symbolic_def *def,
                                     sonde_error *error) {
  uint32_t *start = SONDE_NEW(uint32_t, s->node_count + 2);
  uint32_t *to = SONDE_NEW(uint32_t, 56 * (size_t)def->element_count);
  sonde_status status = start && to ? SONDE_OK : sonde_fail_memory(error);
  for (int pass = 0; pass < 2 && !status; ++pass) {
    for (uint32_t e = 0; e < def->element_count; ++e)
      for (int c = 0; c < 64; ++c) {
        uint32_t a = def->elements[e][c / 8], b = def->elements[e][c % 8];
        if (a == b || a == SONDE_HELD_CORNER || b == SONDE_HELD_CORNER) continue;
        if (pass == 0)
          ++start[a + 2];
        else
          to[start[a + 1]++] = b;
      }
    for (uint32_t i = 2; pass == 0 && i < s->node_count + 2; ++i) start[i] += start[i - 1];
  }
  const sonde_pattern pattern = {s->node_count, start, to, def->points};
  if (!status)
    status = sonde_pieces_find(&pattern, s->node_count - s->last_count, LEAF, &s->pieces, error);
  sonde_free(start);
  sonde_free(to);
  return status;
}

// The piece that eliminates the first of an element's nodes; NULL: all of them are held.
static sonde_piece *piece_of_element(const sonde_symbolic *s, uint32_t element) {
  uint32_t least = s->node_count;
  for (int c = 0; c < 8; ++c) {
    uint32_t node = s->elements[element][c];
    if (node != SONDE_HELD_CORNER && s->pieces.rank[node] < least) least = s->pieces.rank[node];
  }
  return least < s->node_count ? &s->pieces.list[s->pieces.piece_of[least]] : NULL;
}

// Indices of nodes in the front of each piece: of what its children leave, and of the pattern's
// entries in its own rows. index [node_count] is scratch.
static void relate_fronts(sonde_symbolic *s, const sonde_symbolic_def *def, uint32_t *index) {
  const sonde_pieces *pieces = &s->pieces;
  uint32_t used = 0;
  for (uint32_t t = 0; t <= pieces->count; ++t) {
    sonde_piece *p = &pieces->list[t];
    for (uint32_t k = 0; k < p->count; ++k) index[p->first + k] = k;
    for (uint32_t i = 0; i < p->boundary_count; ++i)
      index[pieces->boundary[p->boundary + i]] = p->count + i;
    for (uint32_t c = 0, at = t - 1; c < p->child_count; ++c, at = pieces->list[at].before) {
      const sonde_piece *child = &pieces->list[at];
      for (uint32_t i = 0; i < child->boundary_count; ++i)
        s->related[child->boundary + i] = index[pieces->boundary[child->boundary + i]];
    }
    if (s->elements) continue;
    p->entry = used;
    for (uint32_t k = 0; k < p->count; ++k) {
      uint32_t row = pieces->order[p->first + k];
      for (uint32_t q = def->row_start[row]; q < def->row_start[row + 1]; ++q) {
        uint32_t place = pieces->rank[def->column[q]];
        if (place >= p->first + k) s->entries[used++] = (sonde_front_entry){q, index[place], k};
      }
    }
    p->entry_count = used - p->entry;
  }
}

sonde_status sonde_symbolic_create(const sonde_symbolic_def *def, sonde_symbolic **symbolic,
                                   sonde_error *error) {
  SONDE_ASSERT(def != NULL && symbolic != NULL && def->points != NULL);
  *symbolic = NULL;
  sonde_status status = check(def, error);
  if (status) return status;
  sonde_symbolic *s = SONDE_NEW(sonde_symbolic, 1);
  if (!s) return sonde_fail_memory(error);
  *s = (sonde_symbolic){.node_count = def->node_count,
                        .last_count = def->last_count,
                        .block = def->block,
                        .elements = def->row_start ? NULL : def->elements};
  const sonde_pattern pattern = {s->node_count, def->row_start, def->column, def->points};
  uint32_t *index = NULL;
  status = s->elements ? dissect_elements(s, def, error)
                       : sonde_pieces_find(&pattern, s->node_count - s->last_count, LEAF,
                                           &s->pieces, error);
  if (status) goto done;
  index = SONDE_NEW(uint32_t, s->node_count);
  s->related = SONDE_NEW(uint32_t, s->pieces.boundary_total);
  if (s->elements)
    s->element_of = SONDE_NEW(uint32_t, def->element_count);
  else
    s->entries = SONDE_NEW(sonde_front_entry, def->row_start[s->node_count]);
  if (!index || !s->related || (!s->element_of && !s->entries)) {
    status = sonde_fail_memory(error);
    goto done;
  }
  // Elements go to their pieces: counted, placed, listed.
  for (uint32_t e = 0; e < def->element_count && s->elements; ++e) {
    sonde_piece *p = piece_of_element(s, e);
    if (p) ++p->entry_count;
  }
  for (uint32_t t = 0, at = 0; t <= s->pieces.count && s->elements; ++t) {
    sonde_piece *p = &s->pieces.list[t];
    p->entry = at;
    at += p->entry_count;
    p->entry_count = 0;
  }
  for (uint32_t e = 0; e < def->element_count && s->elements; ++e) {
    sonde_piece *p = piece_of_element(s, e);
    if (p) s->element_of[p->entry + p->entry_count++] = e;
  }
  relate_fronts(s, def, index);
  // The updates of a piece's children leave the stack before that of the piece arrives.
  size_t top = 0, block = s->block;
  for (uint32_t t = 0; t <= s->pieces.count; ++t) {
    sonde_piece *p = &s->pieces.list[t];
    size_t own = block * p->count, behind = block * p->boundary_count, n = own + behind;
    if (n > s->front_order) s->front_order = n;
    if (t == s->pieces.count) break;
    p->factor = s->factor_size;
    s->factor_size += sonde_front_width((uint32_t)own) * (n + 1);
    for (size_t j = 0; j < own; ++j) s->macs += (n - j) * (n - j) / 2;
    for (uint32_t c = 0, at = t - 1; c < p->child_count; ++c, at = s->pieces.list[at].before) {
      size_t taken = block * s->pieces.list[at].boundary_count;
      top -= taken * taken;
    }
    top += behind * behind;
    if (top > s->stack_size) s->stack_size = top;
  }
done:
  sonde_free(index);
  if (status)
    sonde_symbolic_destroy(s);
  else
    *symbolic = s;
  return status;
}

void sonde_symbolic_destroy(sonde_symbolic *s) {
  if (!s) return;
  sonde_pieces_clear(&s->pieces);
  sonde_free(s->related);
  sonde_free(s->element_of);
  sonde_free(s->entries);
  sonde_free(s);
}

// ---- memory of the numbers ----------------------------------------------------------------

sonde_status sonde_numeric_reserve(sonde_numeric *f, const sonde_symbolic *s, sonde_error *error) {
  SONDE_ASSERT(f != NULL && s != NULL);
  const size_t number = f->single ? sizeof(float) : sizeof(double);
  const struct {
    void **array;
    size_t *room, wanted, size;
  } parts[] = {
      {(void **)&f->factor, &f->factor_room, s->factor_size, sizeof *f->factor},
      {(void **)&f->front, &f->front_room,
       s->front_order * sonde_front_stride((uint32_t)s->front_order), number},
      {(void **)&f->stack, &f->stack_room, s->stack_size, number},
      {(void **)&f->local, &f->local_room, s->node_count, sizeof *f->local},
      {(void **)&f->gathered, &f->gathered_room, s->block * (size_t)s->node_count,
       sizeof *f->gathered},
      {(void **)&f->part, &f->part_room,
       2 * sonde_front_width((uint32_t)s->front_order) + s->front_order, sizeof *f->part},
  };
  if (!f->kernels) f->kernels = sonde_dense_kernels_find(NULL);
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) {
    if (*parts[k].array && *parts[k].room >= parts[k].wanted) continue;
    const size_t room = parts[k].wanted + (size_t)(f->slack * (double)parts[k].wanted);
    sonde_free(*parts[k].array);
    *parts[k].array = sonde_calloc(room, parts[k].size);
    *parts[k].room = *parts[k].array ? room : 0;
    if (!*parts[k].array) return sonde_fail_memory(error);
  }
  return SONDE_OK;
}

void sonde_numeric_clear(sonde_numeric *f) {
  void *parts[] = {f->factor, f->front, f->stack, f->local, f->gathered, f->part};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  *f = (sonde_numeric){0};
}
