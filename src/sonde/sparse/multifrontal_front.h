// Assembly and storage of fronts whose numbers are NUMBER; multifrontal_hot.c includes this file
// for double and for float.
#define PASTE(name, type) name##_##type
#define NAME(name, type) PASTE(name, type)
#define OF(name) NAME(name, NUMBER)

// Adds the update of a child to the lower triangle of the front. Nodes ascend in both.
INLINE void OF(add_update)(NUMBER *front, size_t stride, const uint32_t *related, uint32_t count,
                           const NUMBER *update, size_t block) {
  for (size_t j = 0; j < block * count; ++j, update += block * count) {
    const size_t node = j / block, axis = j % block;
    NUMBER *column = front + (block * related[node] + axis) * stride;
    for (size_t b = axis; b < block; ++b)
      column[block * related[node] + b] += update[block * node + b];
    for (size_t i = node + 1; i < count; ++i)
      for (size_t b = 0; b < block; ++b) column[block * related[i] + b] += update[block * i + b];
  }
}

// Adds the entries of the pattern in the piece's own rows, whose blocks lie transposed in columns.
INLINE void OF(add_entries)(NUMBER *front, size_t stride, const sonde_front_entry *entries,
                            uint32_t count, const double *value, size_t block) {
  for (uint32_t k = 0; k < count; ++k) {
    const sonde_front_entry *e = &entries[k];
    const double *from = value + e->source * block * block;
    for (size_t j = 0; j < block; ++j)
      for (size_t i = e->row == e->column ? j : 0; i < block; ++i)
        front[(block * e->column + j) * stride + block * e->row + i] += (NUMBER)from[block * j + i];
  }
}

static void OF(assemble)(sonde_numeric *f, const sonde_piece *p) {
  const sonde_symbolic *s = f->symbolic;
  const sonde_piece *list = s->pieces.list;
  size_t n = order_of(s, p), stride = stride_of(f, n);
  NUMBER *front = f->front, *stack = f->stack;
  for (size_t j = 0; j < n; ++j) memset(front + j * stride + j, 0, (stride - j) * sizeof *front);
  // The matrix.
  if (s->elements) {
    for (uint32_t i = 0; i < p->count; ++i) f->local[p->first + i] = i;
    for (uint32_t i = 0; i < p->boundary_count; ++i)
      f->local[s->pieces.boundary[p->boundary + i]] = p->count + i;
    for (uint32_t e = 0; e < p->entry_count; ++e) {
      // Adds the matrix of one element to the lower triangle.
      const uint32_t element = s->element_of[p->entry + e];
      const uint32_t *nodes = f->symbolic->elements[element], *rank = f->symbolic->pieces.rank;
      double k[24][24];
      f->source.element(f->source.user, element, k);
      for (int a = 0; a < 8; ++a) {
        if (nodes[a] == SONDE_HELD_CORNER) continue;
        size_t column = 3 * (size_t)f->local[rank[nodes[a]]];
        for (int b = 0; b < 8; ++b) {
          if (nodes[b] == SONDE_HELD_CORNER) continue;
          size_t row = 3 * (size_t)f->local[rank[nodes[b]]];
          if (row < column) continue;
          for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 3; ++j)
              front[(column + j) * stride + row + i] += (NUMBER)k[3 * a + (int)j][3 * b + (int)i];
        }
      }
    }
  } else if (s->block == 1)
    OF(add_entries)(front, stride, s->entries + p->entry, p->entry_count, f->source.value, 1);
  else
    OF(add_entries)(front, stride, s->entries + p->entry, p->entry_count, f->source.value, 3);
  // What the children left, latest first.
  for (uint32_t c = 0, at = f->now - 1; c < p->child_count; ++c, at = list[at].before) {
    size_t order = (size_t)s->block * list[at].boundary_count;
    const uint32_t *related = s->related + list[at].boundary;
    f->top -= order * order;
    if (s->block == 1)
      OF(add_update)(front, stride, related, list[at].boundary_count, stack + f->top, 1);
    else
      OF(add_update)(front, stride, related, list[at].boundary_count, stack + f->top, 3);
  }
}

// The factor of the front to single precision, what lies behind onto the stack.
static void OF(store)(sonde_numeric *f, const sonde_piece *p) {
  const size_t own = (size_t)f->symbolic->block * p->count, n = order_of(f->symbolic, p);
  const size_t behind = n - own, width = sonde_front_width((uint32_t)own), stride = stride_of(f, n);
  const NUMBER *front = f->front;
  float *to = f->factor + p->factor, *l11 = to + behind * width, *inverse = l11 + own * width;
  memset(l11, 0, (own + 1) * width * sizeof *to);
  for (size_t j = 0; j < own; ++j) {
    const NUMBER *column = front + j * stride;
    inverse[j] = (float)(1 / column[j]);
    for (size_t i = j + 1; i < own; ++i) l11[i * width + j] = l11[j * width + i] = (float)column[i];
  }
  for (size_t j = 0; j < width; j += 8) // by strips of eight columns
    for (size_t i = 0; i < behind; ++i) {
      const NUMBER *row = front + j * stride + own + i;
      for (size_t c = 0; c < 8; ++c)
        to[i * width + j + c] = j + c < own ? (float)row[c * stride] : 0;
    }
  NUMBER *update = (NUMBER *)f->stack + f->top;
  for (size_t j = 0; j < behind; ++j)
    memcpy(update + j * behind + j, front + (own + j) * stride + own + j,
           (behind - j) * sizeof *update);
  f->top += behind * behind;
  SONDE_ASSERT(f->top <= f->stack_room);
}

#undef PASTE
#undef NAME
#undef OF
#undef NUMBER
