// Multifrontal factor: ordering, analysis, numbers, backward pass.
//
// sonde_fronts_create   neighbours, order, pieces, memory
// list_neighbours       nodes that share an element
// dissect               nested dissection; marks where pieces begin
// split                 one piece into lower half, upper half, separator
// analyse               boundary of every piece
// assign_elements       every element to the piece that is eliminated first
// measure               sizes of factors, working front, stack of updates
// sonde_fronts_step     the current piece: assemble, panels, store, push
// assemble              elements and the children's updates into the working front
// sonde_fronts_steps    how many steps that takes
// sonde_fronts_recover  pieces backward
// sonde_front_kernels_find  of this processor
#include "sparse/fronts.h"

#include "base/base.h"
#include "base/maths.h"

#include <stdlib.h>
#include <string.h>

enum { LEAF = 20, PANEL = 32 };

typedef struct piece {
  uint32_t first, count;             // own nodes: places in the order
  uint32_t boundary, boundary_count; // places of later nodes, in `boundary`
  uint32_t parent;                   // NONE at a root
  uint32_t child_count;
  uint32_t element, element_count; // in `element_of`
  size_t factor;                   // in `factor`
} piece;

struct sonde_fronts {
  const sonde_front_kernels *kernels;
  uint32_t node_count, last_count, element_count;
  const uint32_t (*elements)[8];
  uint32_t *order, *rank; // node at a place, place of a node
  uint32_t piece_count;   // without the last nodes' piece, which is pieces[piece_count]
  piece *pieces;
  uint32_t *boundary, *element_of;
  size_t boundary_size;
  float *factor; // per piece: rows of boundary then own unknowns, each 3*count wide
  size_t factor_size;
  double *work;              // working front, also the condensed matrix at the end
  double *stack;             // updates that wait for their parent
  uint32_t *local, *waiting; // place -> index in the working front; pieces on the stack
  size_t stack_size, stack_top, work_order;
  float *gathered;
  uint32_t now, column, waiting_count; // state of the factorisation
  bool assembled, failed;
  uint64_t macs;
};

// ---- ordering -----------------------------------------------------------------------------

typedef struct graph {
  uint32_t *start, *to;
  const sonde_vec3 *points;
} graph;

typedef struct keyed {
  double key;
  uint32_t node;
} keyed;

static int compare_keyed(const void *a, const void *b) {
  const keyed *x = a, *y = b;
  if (x->key != y->key) return x->key < y->key ? -1 : 1;
  return x->node < y->node ? -1 : (x->node > y->node);
}

static int compare_place(const void *a, const void *b) {
  uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
  return x < y ? -1 : (x > y);
}

// Pairs of one element's corners, deduplicated per node afterwards by sorting.
static sonde_status list_neighbours(const sonde_fronts *f, graph *g, sonde_error *error) {
  g->start = SONDE_NEW(uint32_t, f->node_count + 1);
  g->to = SONDE_NEW(uint32_t, 56 * (size_t)f->element_count + 1);
  uint32_t *fill = SONDE_NEW(uint32_t, f->node_count + 1);
  if (!g->start || !g->to || !fill) {
    sonde_free(fill);
    return sonde_fail_memory(error);
  }
  for (int pass = 0; pass < 2; ++pass) {
    for (uint32_t e = 0; e < f->element_count; ++e)
      for (int c = 0; c < 64; ++c) {
        uint32_t a = f->elements[e][c / 8], b = f->elements[e][c % 8];
        if (a == b || a == SONDE_FRONT_NONE || b == SONDE_FRONT_NONE) continue;
        if (pass == 0)
          ++g->start[a + 1];
        else
          g->to[fill[a]++] = b;
      }
    if (pass == 1) break;
    for (uint32_t i = 0; i < f->node_count; ++i) g->start[i + 1] += g->start[i];
    memcpy(fill, g->start, f->node_count * sizeof *fill);
  }
  sonde_free(fill);
  return SONDE_OK;
}

static double coordinate(sonde_vec3 p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

static void sort_widest(const graph *g, uint32_t *list, uint32_t count, keyed *keys) {
  double spread = -1;
  int widest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double low = INFINITY, high = -INFINITY;
    for (uint32_t i = 0; i < count; ++i) {
      double c = coordinate(g->points[list[i]], axis);
      low = fmin(low, c), high = fmax(high, c);
    }
    if (high - low > spread * (1 + 1e-9)) spread = high - low, widest = axis;
  }
  for (uint32_t i = 0; i < count; ++i)
    keys[i] = (keyed){coordinate(g->points[list[i]], widest), list[i]};
  qsort(keys, count, sizeof *keys, compare_keyed);
  for (uint32_t i = 0; i < count; ++i) list[i] = keys[i].node;
}

// Rows of the upper half that touch the lower half go behind the others; returns how many stay.
static uint32_t split(const graph *g, uint32_t *list, uint32_t half, uint32_t count, uint32_t *side,
                      uint32_t mark, uint32_t *scratch) {
  uint32_t keep = half, parted = 0;
  for (uint32_t i = 0; i < half; ++i) side[list[i]] = mark;
  for (uint32_t i = half; i < count; ++i) {
    bool touches = false;
    for (uint32_t p = g->start[list[i]]; p < g->start[list[i] + 1] && !touches; ++p)
      touches = side[g->to[p]] == mark;
    if (touches)
      scratch[parted++] = list[i];
    else
      list[keep++] = list[i];
  }
  memcpy(list + keep, scratch, parted * sizeof *scratch);
  return keep - half;
}

// above[place] becomes the place where the parent of the piece that starts there starts. The tree
// is that of the dissection, so that children directly precede their parent.
static void dissect(sonde_fronts *f, const graph *g, keyed *keys, uint32_t *side, uint32_t *scratch,
                    uint32_t *above) {
  struct {
    uint32_t first, count, above;
  } stack[128];
  uint32_t depth = 0, mark = 0, last = f->node_count - f->last_count;
  for (uint32_t i = 0; i < f->node_count; ++i) f->order[i] = i, above[i] = SONDE_FRONT_NONE;
  stack[depth].first = 0, stack[depth].count = last, stack[depth++].above = last;
  while (depth > 0) {
    --depth;
    uint32_t first = stack[depth].first, count = stack[depth].count, half = count / 2;
    uint32_t up = stack[depth].above;
    if (count <= LEAF) {
      above[first] = up;
      continue;
    }
    sort_widest(g, f->order + first, count, keys);
    uint32_t keep = split(g, f->order + first, half, count, side, ++mark, scratch);
    if (half + keep < count) {
      above[first + half + keep] = up;
      up = first + half + keep;
    }
    SONDE_ASSERT(depth + 2 <= SONDE_COUNT_OF(stack));
    stack[depth].first = first, stack[depth].count = half, stack[depth++].above = up;
    if (keep == 0) continue;
    stack[depth].first = first + half, stack[depth].count = keep, stack[depth++].above = up;
  }
  for (uint32_t k = 0; k < f->node_count; ++k) f->rank[f->order[k]] = k;
}

static sonde_status find_pieces(sonde_fronts *f, const graph *g, sonde_error *error) {
  sonde_status status = SONDE_OK;
  keyed *keys = SONDE_NEW(keyed, f->node_count);
  uint32_t *side = SONDE_NEW(uint32_t, f->node_count),
           *scratch = SONDE_NEW(uint32_t, f->node_count);
  uint32_t *above = SONDE_NEW(uint32_t, f->node_count);
  if (!keys || !side || !scratch || !above) {
    status = sonde_fail_memory(error);
    goto done;
  }
  dissect(f, g, keys, side, scratch, above);
  uint32_t last = f->node_count - f->last_count, count = 0;
  for (uint32_t k = 0; k < last; ++k) count += above[k] != SONDE_FRONT_NONE;
  f->pieces = SONDE_NEW(piece, count + 1);
  if (!f->pieces) {
    status = sonde_fail_memory(error);
    goto done;
  }
  for (uint32_t k = 0; k < last; ++k) {
    if (above[k] != SONDE_FRONT_NONE)
      f->pieces[f->piece_count++] = (piece){.first = k, .parent = above[k]};
    ++f->pieces[f->piece_count - 1].count;
  }
  f->pieces[count] = (piece){.first = last, .count = f->last_count, .parent = SONDE_FRONT_NONE};
done:
  sonde_free(keys);
  sonde_free(side);
  sonde_free(scratch);
  sonde_free(above);
  return status;
}

// ---- analysis -----------------------------------------------------------------------------

static uint32_t piece_at(const sonde_fronts *f, uint32_t place) {
  uint32_t low = 0, high = f->piece_count; // the piece of the last nodes has this number
  while (low < high) {
    uint32_t middle = (low + high + 1) / 2;
    if (f->pieces[middle].first <= place)
      low = middle;
    else
      high = middle - 1;
  }
  return low;
}

static sonde_status reserve_boundary(sonde_fronts *f, size_t used, size_t more,
                                     sonde_error *error) {
  if (used + more <= f->boundary_size) return SONDE_OK;
  size_t size = 2 * (used + more);
  uint32_t *grown = SONDE_NEW(uint32_t, size);
  if (!grown) return sonde_fail_memory(error);
  if (f->boundary) memcpy(grown, f->boundary, used * sizeof *grown);
  sonde_free(f->boundary);
  f->boundary = grown, f->boundary_size = size;
  return SONDE_OK;
}

static void add_place(sonde_fronts *f, piece *p, uint32_t place, uint32_t *seen, uint32_t mark) {
  if (place < p->first + p->count || seen[place] == mark) return;
  seen[place] = mark;
  f->boundary[p->boundary + p->boundary_count++] = place;
}

// Boundary of a piece: later neighbours of its nodes and what its children leave.
static sonde_status analyse(sonde_fronts *f, const graph *g, uint32_t *seen, sonde_error *error) {
  size_t used = 0;
  for (uint32_t t = 0; t < f->piece_count; ++t) {
    piece *p = &f->pieces[t];
    sonde_status status = reserve_boundary(f, used, f->node_count, error);
    if (status != SONDE_OK) return status;
    p->boundary = (uint32_t)used;
    for (uint32_t k = p->first; k < p->first + p->count; ++k)
      for (uint32_t q = g->start[f->order[k]]; q < g->start[f->order[k] + 1]; ++q)
        add_place(f, p, f->rank[g->to[q]], seen, t + 1);
    for (uint32_t c = 0; c < t; ++c) {
      const piece *child = &f->pieces[c];
      if (child->parent != t) continue;
      ++p->child_count;
      for (uint32_t i = 0; i < child->boundary_count; ++i)
        add_place(f, p, f->boundary[child->boundary + i], seen, t + 1);
    }
    qsort(f->boundary + p->boundary, p->boundary_count, sizeof(uint32_t), compare_place);
    p->parent = piece_at(f, p->parent); // was the place
    SONDE_ASSERT(p->parent > t);
    used += p->boundary_count;
  }
  piece *end = &f->pieces[f->piece_count];
  for (uint32_t c = 0; c < f->piece_count; ++c)
    end->child_count += f->pieces[c].parent == f->piece_count;
  return SONDE_OK;
}

static uint32_t first_piece_of(const sonde_fronts *f, uint32_t element) {
  uint32_t least = f->node_count;
  for (int c = 0; c < 8; ++c) {
    uint32_t node = f->elements[element][c];
    if (node != SONDE_FRONT_NONE && f->rank[node] < least) least = f->rank[node];
  }
  return least < f->node_count ? piece_at(f, least) : SONDE_FRONT_NONE;
}

static void assign_elements(sonde_fronts *f, uint32_t *owner) {
  for (uint32_t e = 0; e < f->element_count; ++e) {
    owner[e] = first_piece_of(f, e);
    if (owner[e] != SONDE_FRONT_NONE) ++f->pieces[owner[e]].element_count;
  }
  uint32_t at = 0;
  for (uint32_t t = 0; t <= f->piece_count; ++t) {
    f->pieces[t].element = at;
    at += f->pieces[t].element_count;
    f->pieces[t].element_count = 0;
  }
  for (uint32_t e = 0; e < f->element_count; ++e) {
    if (owner[e] == SONDE_FRONT_NONE) continue;
    piece *p = &f->pieces[owner[e]];
    f->element_of[p->element + p->element_count++] = e;
  }
}

// Replays the stack of updates with sizes only.
static void measure(sonde_fronts *f) {
  size_t top = 0, widest = 0;
  uint32_t *waiting = f->waiting, count = 0;
  for (uint32_t t = 0; t <= f->piece_count; ++t) {
    piece *p = &f->pieces[t];
    size_t own = 3 * (size_t)p->count, left = 3 * (size_t)p->boundary_count, n = own + left;
    if (n > f->work_order) f->work_order = n;
    if (n > widest) widest = n;
    for (uint32_t c = 0; c < p->child_count; ++c) {
      size_t b = 3 * (size_t)f->pieces[waiting[--count]].boundary_count;
      top -= b * b;
    }
    if (t == f->piece_count) break;
    p->factor = f->factor_size;
    f->factor_size += own * n;
    for (size_t j = 0; j < own; ++j) f->macs += (n - j) * (n - j) / 2;
    waiting[count++] = t;
    top += left * left;
    if (top > f->stack_size) f->stack_size = top;
  }
}

static sonde_status build(sonde_fronts *f, const graph *g, sonde_error *error) {
  sonde_status status = find_pieces(f, g, error);
  uint32_t *seen = SONDE_NEW(uint32_t, f->node_count + f->element_count + 1);
  f->element_of = SONDE_NEW(uint32_t, f->element_count + 1);
  f->local = SONDE_NEW(uint32_t, f->node_count);
  if (status == SONDE_OK && (!seen || !f->element_of || !f->local))
    status = sonde_fail_memory(error);
  if (status == SONDE_OK) status = analyse(f, g, seen, error);
  if (status == SONDE_OK) {
    f->waiting = SONDE_NEW(uint32_t, f->piece_count + 1);
    if (!f->waiting) status = sonde_fail_memory(error);
  }
  if (status == SONDE_OK) {
    assign_elements(f, seen);
    measure(f);
    f->factor = SONDE_NEW(float, f->factor_size + 1);
    f->work = SONDE_NEW(double, f->work_order * f->work_order + 1);
    f->stack = SONDE_NEW(double, f->stack_size + 1);
    f->gathered = SONDE_NEW(float, 2 * f->work_order + 1);
    if (!f->factor || !f->work || !f->stack || !f->gathered) status = sonde_fail_memory(error);
  }
  sonde_free(seen);
  return status;
}

static sonde_status check(const sonde_fronts_def *def, sonde_error *error) {
  if (def->node_count <= def->last_count || def->last_count == 0 || def->element_count == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "expected elements, free nodes and last nodes");
  for (uint32_t e = 0; e < def->element_count; ++e)
    for (int c = 0; c < 8; ++c)
      if (def->elements[e][c] != SONDE_FRONT_NONE && def->elements[e][c] >= def->node_count)
        return sonde_fail(error, SONDE_ARGUMENT, "element %u has node %u of %u", e,
                          def->elements[e][c], def->node_count);
  return SONDE_OK;
}

sonde_status sonde_fronts_create(const sonde_fronts_def *def, sonde_fronts **fronts,
                                 sonde_error *error) {
  SONDE_ASSERT(def != NULL && fronts != NULL);
  *fronts = NULL;
  sonde_status status = check(def, error);
  if (status != SONDE_OK) return status;
  sonde_fronts *f = SONDE_NEW(sonde_fronts, 1);
  if (f == NULL) return sonde_fail_memory(error);
  f->node_count = def->node_count, f->last_count = def->last_count;
  f->element_count = def->element_count, f->elements = def->elements;
  f->kernels = sonde_front_kernels_find(NULL);
  f->order = SONDE_NEW(uint32_t, f->node_count);
  f->rank = SONDE_NEW(uint32_t, f->node_count);
  graph g = {.points = def->points};
  status = f->order && f->rank ? list_neighbours(f, &g, error) : sonde_fail_memory(error);
  if (status == SONDE_OK) status = build(f, &g, error);
  sonde_free(g.start);
  sonde_free(g.to);
  if (status == SONDE_OK)
    *fronts = f;
  else
    sonde_fronts_destroy(f);
  return status;
}

void sonde_fronts_destroy(sonde_fronts *f) {
  if (f == NULL) return;
  void *parts[] = {f->order, f->rank,  f->pieces, f->boundary, f->element_of, f->factor,
                   f->work,  f->stack, f->local,  f->waiting,  f->gathered};
  for (size_t i = 0; i < SONDE_COUNT_OF(parts); ++i) sonde_free(parts[i]);
  sonde_free(f);
}

// ---- numbers ------------------------------------------------------------------------------

void sonde_fronts_begin(sonde_fronts *f) {
  SONDE_ASSERT(f != NULL);
  f->now = f->column = f->waiting_count = 0;
  f->stack_top = 0;
  f->assembled = f->failed = false;
}

static size_t order_of(const piece *p) { return 3 * ((size_t)p->count + p->boundary_count); }

static void add_element(sonde_fronts *f, size_t n, const uint32_t nodes[8], double (*k)[24]) {
  for (int a = 0; a < 8; ++a) {
    if (nodes[a] == SONDE_FRONT_NONE) continue;
    size_t column = 3 * (size_t)f->local[f->rank[nodes[a]]];
    for (int b = 0; b < 8; ++b) {
      if (nodes[b] == SONDE_FRONT_NONE) continue;
      size_t row = 3 * (size_t)f->local[f->rank[nodes[b]]];
      if (row < column) continue;
      for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
          f->work[(column + j) * n + row + i] += k[3 * a + (int)j][3 * b + (int)i];
    }
  }
}

// The update of a child; places ascend in both, so the lower triangle stays the lower one.
static void add_update(sonde_fronts *f, size_t n, const piece *child, const double *update) {
  const uint32_t *places = f->boundary + child->boundary;
  size_t b = 3 * (size_t)child->boundary_count;
  for (size_t j = 0; j < b; ++j) {
    double *column = f->work + (3 * (size_t)f->local[places[j / 3]] + j % 3) * n;
    const double *from = update + j * b;
    for (size_t i = j; i < b; ++i) column[3 * (size_t)f->local[places[i / 3]] + i % 3] += from[i];
  }
}

static void assemble(sonde_fronts *f, const piece *p, sonde_front_matrix *matrix,
                     const void *user) {
  size_t n = order_of(p);
  double k[24][24];
  memset(f->work, 0, n * n * sizeof *f->work);
  for (uint32_t i = 0; i < p->count; ++i) f->local[p->first + i] = i;
  for (uint32_t i = 0; i < p->boundary_count; ++i)
    f->local[f->boundary[p->boundary + i]] = p->count + i;
  for (uint32_t e = 0; e < p->element_count; ++e) {
    uint32_t element = f->element_of[p->element + e];
    matrix(user, element, k);
    add_element(f, n, f->elements[element], k);
  }
  for (uint32_t c = 0; c < p->child_count; ++c) {
    const piece *child = &f->pieces[f->waiting[--f->waiting_count]];
    size_t b = 3 * (size_t)child->boundary_count;
    f->stack_top -= b * b;
    add_update(f, n, child, f->stack + f->stack_top);
  }
}

// Factor rows to single precision, the rest onto the stack.
static void store(sonde_fronts *f, const piece *p) {
  size_t own = 3 * (size_t)p->count, n = order_of(p), left = n - own;
  float *to = f->factor + p->factor;
  for (size_t i = 0; i < n; ++i) {
    size_t row = i < left ? own + i : i - left, end = row < own ? row + 1 : own;
    for (size_t j = 0; j < end; ++j) to[i * own + j] = (float)f->work[j * n + row];
    if (row < own) to[i * own + row] = (float)(1 / f->work[row * n + row]);
  }
  double *update = f->stack + f->stack_top;
  for (size_t j = 0; j < left; ++j)
    memcpy(update + j * left + j, f->work + (own + j) * n + own + j, (left - j) * sizeof *update);
  f->stack_top += left * left;
  SONDE_ASSERT(f->stack_top <= f->stack_size);
  f->waiting[f->waiting_count++] = f->now;
}

// Multiplications, about, of assembling a piece and of a panel of its columns.
static uint64_t assembly_cost(const piece *p) {
  size_t n = order_of(p);
  return n * n + 20000 * (uint64_t)p->element_count;
}

static uint64_t panel_cost(size_t n, uint32_t from, uint32_t to) {
  return (to - from) * (n - from) * (n - from) / 2;
}

// The same walk as sonde_fronts_step() without the numbers.
uint32_t sonde_fronts_steps(const sonde_fronts *f, uint64_t budget) {
  SONDE_ASSERT(f != NULL && budget > 0);
  uint32_t steps = 1;
  uint64_t spent = 0;
  for (uint32_t t = 0; t <= f->piece_count; ++t) {
    const piece *p = &f->pieces[t];
    size_t n = order_of(p), own = 3 * (size_t)p->count;
    if (spent >= budget) spent = 0, ++steps;
    spent += assembly_cost(p);
    for (uint32_t from = 0; from < own && t < f->piece_count; from += PANEL) {
      if (spent >= budget) spent = 0, ++steps;
      spent += panel_cost(n, from, from + PANEL < own ? from + PANEL : (uint32_t)own);
    }
  }
  return steps;
}

bool sonde_fronts_step(sonde_fronts *f, sonde_front_matrix *matrix, const void *user,
                       uint64_t budget) {
  SONDE_ASSERT(f != NULL && matrix != NULL);
  for (uint64_t spent = 0; spent < budget && !f->failed;) {
    const piece *p = &f->pieces[f->now];
    size_t n = order_of(p), own = 3 * (size_t)p->count;
    if (!f->assembled) {
      assemble(f, p, matrix, user);
      f->assembled = true, f->column = 0;
      spent += assembly_cost(p);
      continue;
    }
    if (f->now == f->piece_count) return true; // the condensed matrix stays in the working front
    uint32_t to = f->column + PANEL < own ? f->column + PANEL : (uint32_t)own;
    f->failed = !f->kernels->eliminate(f->work, (uint32_t)n, f->column, to);
    spent += panel_cost(n, f->column, to);
    f->column = to;
    if (to < own) continue;
    store(f, p);
    ++f->now, f->assembled = false;
  }
  return f->failed || (f->now == f->piece_count && f->assembled);
}

bool sonde_fronts_failed(const sonde_fronts *f) { return f->failed; }

const double *sonde_fronts_condensed(const sonde_fronts *f) {
  SONDE_ASSERT(f != NULL && f->now == f->piece_count && f->assembled);
  return f->work;
}

bool sonde_fronts_compliance(const sonde_fronts *f, double *inverse, double *scratch) {
  SONDE_ASSERT(f != NULL && inverse != NULL && scratch != NULL);
  uint32_t side = 3 * f->last_count;
  memcpy(scratch, sonde_fronts_condensed(f), (size_t)side * side * sizeof *scratch);
  return f->kernels->invert(scratch, side, inverse);
}

const sonde_front_kernels *sonde_front_kernels_find(const char *name) {
  const sonde_front_kernels *known[] = {
#ifdef __x86_64__
      __builtin_cpu_supports("avx512f") ? &sonde_front_kernels_avx512 : NULL,
      __builtin_cpu_supports("avx2") ? &sonde_front_kernels_avx2 : NULL,
#endif
      &sonde_front_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (known[k] && (!name || strcmp(name, known[k]->name) == 0)) return known[k];
  return NULL;
}

// ---- backward pass ------------------------------------------------------------------------

// L11^T x1 = -L21^T x2, row by row.
static void recover_piece(const sonde_fronts *f, const piece *p, float *x) {
  uint32_t own = 3 * p->count;
  const float *row = f->factor + p->factor;
  float *y = f->gathered;
  for (uint32_t j = 0; j < own; ++j) y[j] = 0;
  for (uint32_t i = 0; i < p->boundary_count; ++i) {
    const float *from = x + 3 * (size_t)f->order[f->boundary[p->boundary + i]];
    for (int axis = 0; axis < 3; ++axis, row += own) f->kernels->subtract(y, row, from[axis], own);
  }
  for (uint32_t k = own; k-- > 0;) {
    const float *of = row + (size_t)k * own;
    y[k] *= of[k];
    f->kernels->subtract(y, of, y[k], k);
  }
  for (uint32_t j = 0; j < own; ++j) x[3 * (size_t)f->order[p->first + j / 3] + j % 3] = y[j];
}

void sonde_fronts_recover(const sonde_fronts *f, float *x) {
  SONDE_ASSERT(f != NULL && x != NULL);
  for (uint32_t t = f->piece_count; t-- > 0;) recover_piece(f, &f->pieces[t], x);
}

size_t sonde_fronts_nonzeros(const sonde_fronts *f) { return f->factor_size; }
uint64_t sonde_fronts_work(const sonde_fronts *f) { return f->macs; }
