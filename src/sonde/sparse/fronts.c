// Multifrontal factor: analysis, numbers, backward pass.
//
// sonde_fronts_create   neighbours, pieces, elements, memory
// list_neighbours       nodes that share an element
// assign_elements       every element to the piece that is eliminated first
// measure               sizes of factors, working front, stack of updates
// sonde_fronts_step     the current piece: assemble, panels, store, push
// assemble              elements and the children's updates into the working front
// sonde_fronts_steps    how many steps that takes
// sonde_fronts_recover  pieces backward
// sonde_front_kernels_find  of this processor
#include "sparse/fronts.h"

#include "base/base.h"
#include "base/vector.h"
#include "sparse/pieces.h"

#include <string.h>

enum { LEAF = 20, PANEL = 32 }; // nodes of a piece not worth splitting, columns at a time

struct sonde_fronts {
  const sonde_front_kernels *kernels;
  uint32_t node_count, last_count, element_count;
  const uint32_t (*elements)[8];
  sonde_pieces pieces; // behind those of the dissection comes that of the last nodes
  uint32_t *element_of;
  float *factor; // per piece: rows of boundary then own unknowns, each 3*count wide
  size_t factor_size;
  double *work;    // working front, also the condensed matrix at the end
  double *stack;   // updates that wait for their parent
  uint32_t *local; // place -> index in the working front
  size_t stack_size, stack_top, work_order;
  float *gathered;      // own unknowns of a piece in the backward pass
  uint32_t now, column; // state of the factorisation
  bool assembled, failed;
  uint64_t macs; // multiplications of one factorisation
};

// ---- analysis -----------------------------------------------------------------------------

// Nodes that share an element, as often as they do. start [node_count + 2].
static void list_neighbours(const sonde_fronts *f, uint32_t *start, uint32_t *to) {
  for (int pass = 0; pass < 2; ++pass) {
    for (uint32_t e = 0; e < f->element_count; ++e)
      for (int c = 0; c < 64; ++c) {
        uint32_t a = f->elements[e][c / 8], b = f->elements[e][c % 8];
        if (a == b || a == SONDE_FRONT_NONE || b == SONDE_FRONT_NONE) continue;
        if (pass == 0)
          ++start[a + 2];
        else
          to[start[a + 1]++] = b;
      }
    for (uint32_t i = 2; pass == 0 && i < f->node_count + 2; ++i) start[i] += start[i - 1];
  }
}

static sonde_status find_pieces(sonde_fronts *f, const sonde_vec3 *points, sonde_error *error) {
  uint32_t *start = SONDE_NEW(uint32_t, f->node_count + 2);
  uint32_t *to = SONDE_NEW(uint32_t, 56 * (size_t)f->element_count);
  const sonde_pattern pattern = {f->node_count, start, to, points};
  sonde_status status = start && to ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    list_neighbours(f, start, to);
    status = sonde_pieces_find(&pattern, f->node_count - f->last_count, LEAF, &f->pieces, error);
  }
  sonde_free(start);
  sonde_free(to);
  return status;
}

// NULL: all its nodes are held.
static sonde_piece *piece_of(const sonde_fronts *f, uint32_t element) {
  uint32_t least = f->node_count;
  for (int c = 0; c < 8; ++c) {
    uint32_t node = f->elements[element][c];
    if (node != SONDE_FRONT_NONE && f->pieces.rank[node] < least) least = f->pieces.rank[node];
  }
  return least < f->node_count ? &f->pieces.list[f->pieces.piece_of[least]] : NULL;
}

static void assign_elements(sonde_fronts *f) {
  for (uint32_t e = 0; e < f->element_count; ++e) {
    sonde_piece *p = piece_of(f, e);
    if (p) ++p->entry_count;
  }
  uint32_t at = 0;
  for (uint32_t t = 0; t <= f->pieces.count; ++t) {
    sonde_piece *p = &f->pieces.list[t];
    p->entry = at;
    at += p->entry_count;
    p->entry_count = 0;
  }
  for (uint32_t e = 0; e < f->element_count; ++e) {
    sonde_piece *p = piece_of(f, e);
    if (p) f->element_of[p->entry + p->entry_count++] = e;
  }
}

static size_t order_of(const sonde_piece *p) { return 3 * ((size_t)p->count + p->boundary_count); }
static uint32_t update_order(const sonde_piece *p) { return 3 * p->boundary_count; }

static void measure(sonde_fronts *f) {
  f->stack_size = sonde_pieces_stack(&f->pieces, update_order);
  for (uint32_t t = 0; t <= f->pieces.count; ++t) {
    sonde_piece *p = &f->pieces.list[t];
    size_t own = 3 * (size_t)p->count, n = order_of(p);
    if (n > f->work_order) f->work_order = n;
    if (t == f->pieces.count) break;
    p->factor = f->factor_size;
    f->factor_size += own * n;
    for (size_t j = 0; j < own; ++j) f->macs += (n - j) * (n - j) / 2;
  }
}

static sonde_status build(sonde_fronts *f, const sonde_vec3 *points, sonde_error *error) {
  sonde_status status = find_pieces(f, points, error);
  if (status) return status;
  f->element_of = SONDE_NEW(uint32_t, f->element_count);
  f->local = SONDE_NEW(uint32_t, f->node_count);
  if (!f->element_of || !f->local) return sonde_fail_memory(error);
  assign_elements(f);
  measure(f);
  f->factor = SONDE_NEW(float, f->factor_size);
  f->work = SONDE_NEW(double, f->work_order * f->work_order);
  f->stack = SONDE_NEW(double, f->stack_size);
  f->gathered = SONDE_NEW(float, f->work_order);
  return f->factor && f->work && f->stack && f->gathered ? SONDE_OK : sonde_fail_memory(error);
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
  status = build(f, def->points, error);
  if (status == SONDE_OK)
    *fronts = f;
  else
    sonde_fronts_destroy(f);
  return status;
}

void sonde_fronts_destroy(sonde_fronts *f) {
  if (f == NULL) return;
  void *parts[] = {f->element_of, f->factor, f->work, f->stack, f->local, f->gathered};
  sonde_pieces_clear(&f->pieces);
  for (size_t i = 0; i < SONDE_COUNT_OF(parts); ++i) sonde_free(parts[i]);
  sonde_free(f);
}

// ---- numbers ------------------------------------------------------------------------------

void sonde_fronts_begin(sonde_fronts *f) {
  SONDE_ASSERT(f != NULL);
  f->now = f->column = 0;
  f->stack_top = 0;
  f->assembled = f->failed = false;
}

static void add_element(sonde_fronts *f, size_t n, const uint32_t nodes[8], double (*k)[24]) {
  for (int a = 0; a < 8; ++a) {
    if (nodes[a] == SONDE_FRONT_NONE) continue;
    size_t column = 3 * (size_t)f->local[f->pieces.rank[nodes[a]]];
    for (int b = 0; b < 8; ++b) {
      if (nodes[b] == SONDE_FRONT_NONE) continue;
      size_t row = 3 * (size_t)f->local[f->pieces.rank[nodes[b]]];
      if (row < column) continue;
      for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
          f->work[(column + j) * n + row + i] += k[3 * a + (int)j][3 * b + (int)i];
    }
  }
}

// The update of a child; places ascend in both, so the lower triangle stays the lower one.
static void add_update(sonde_fronts *f, size_t n, const sonde_piece *child, const double *update) {
  const uint32_t *places = f->pieces.boundary + child->boundary;
  size_t b = update_order(child);
  for (size_t j = 0; j < b; ++j) {
    double *column = f->work + (3 * (size_t)f->local[places[j / 3]] + j % 3) * n;
    const double *from = update + j * b;
    for (size_t i = j; i < b; ++i) column[3 * (size_t)f->local[places[i / 3]] + i % 3] += from[i];
  }
}

static void assemble(sonde_fronts *f, const sonde_piece *p, sonde_front_matrix *matrix,
                     const void *user) {
  size_t n = order_of(p);
  double k[24][24];
  memset(f->work, 0, n * n * sizeof *f->work);
  for (uint32_t i = 0; i < p->count; ++i) f->local[p->first + i] = i;
  for (uint32_t i = 0; i < p->boundary_count; ++i)
    f->local[f->pieces.boundary[p->boundary + i]] = p->count + i;
  for (uint32_t e = 0; e < p->entry_count; ++e) {
    uint32_t element = f->element_of[p->entry + e];
    matrix(user, element, k);
    add_element(f, n, f->elements[element], k);
  }
  for (uint32_t c = 0, at = f->now - 1; c < p->child_count; ++c, at = f->pieces.list[at].before) {
    const sonde_piece *child = &f->pieces.list[at];
    size_t b = update_order(child);
    f->stack_top -= b * b;
    add_update(f, n, child, f->stack + f->stack_top);
  }
}

// Factor rows to single precision, the rest onto the stack.
static void store(sonde_fronts *f, const sonde_piece *p) {
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
}

// Multiplications, about, of assembling a piece and of a panel of its columns.
static uint64_t assembly_cost(const sonde_piece *p) {
  size_t n = order_of(p);
  return n * n + 20000 * (uint64_t)p->entry_count;
}

static uint64_t panel_cost(size_t n, uint32_t from, uint32_t to) {
  return (to - from) * (n - from) * (n - from) / 2;
}

// The same walk as sonde_fronts_step() without the numbers.
uint32_t sonde_fronts_steps(const sonde_fronts *f, uint64_t budget) {
  SONDE_ASSERT(f != NULL && budget > 0);
  uint32_t steps = 1;
  uint64_t spent = 0;
  for (uint32_t t = 0; t <= f->pieces.count; ++t) {
    const sonde_piece *p = &f->pieces.list[t];
    size_t n = order_of(p), own = 3 * (size_t)p->count;
    if (spent >= budget) spent = 0, ++steps;
    spent += assembly_cost(p);
    for (uint32_t from = 0; from < own && t < f->pieces.count; from += PANEL) {
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
    const sonde_piece *p = &f->pieces.list[f->now];
    size_t n = order_of(p), own = 3 * (size_t)p->count;
    if (!f->assembled) {
      assemble(f, p, matrix, user);
      f->assembled = true, f->column = 0;
      spent += assembly_cost(p);
      continue;
    }
    if (f->now == f->pieces.count) return true; // the condensed matrix stays in the working front
    uint32_t to = f->column + PANEL < own ? f->column + PANEL : (uint32_t)own;
    f->failed = !f->kernels->eliminate(f->work, (uint32_t)n, f->column, to);
    spent += panel_cost(n, f->column, to);
    f->column = to;
    if (to < own) continue;
    store(f, p);
    ++f->now, f->assembled = false;
  }
  return f->failed || (f->now == f->pieces.count && f->assembled);
}

bool sonde_fronts_failed(const sonde_fronts *f) { return f->failed; }

const double *sonde_fronts_condensed(const sonde_fronts *f) {
  SONDE_ASSERT(f != NULL && f->now == f->pieces.count && f->assembled);
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
      &sonde_front_kernels_avx512, &sonde_front_kernels_avx2,
#endif
      &sonde_front_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (sonde_vectors_serve(known[k]->name, name)) return known[k];
  return NULL;
}

// ---- backward pass ------------------------------------------------------------------------

// L11^T x1 = -L21^T x2, row by row.
static void recover_piece(const sonde_fronts *f, const sonde_piece *p, float *x) {
  uint32_t own = 3 * p->count;
  const float *row = f->factor + p->factor;
  float *y = f->gathered;
  for (uint32_t j = 0; j < own; ++j) y[j] = 0;
  for (uint32_t i = 0; i < p->boundary_count; ++i) {
    const float *from = x + 3 * (size_t)f->pieces.order[f->pieces.boundary[p->boundary + i]];
    for (int axis = 0; axis < 3; ++axis, row += own) f->kernels->subtract(y, row, from[axis], own);
  }
  for (uint32_t k = own; k-- > 0;) {
    const float *of = row + (size_t)k * own;
    y[k] *= of[k];
    f->kernels->subtract(y, of, y[k], k);
  }
  for (uint32_t j = 0; j < own; ++j)
    x[3 * (size_t)f->pieces.order[p->first + j / 3] + j % 3] = y[j];
}

// All solutions piece by piece: a piece of the factor comes from memory once.
void sonde_fronts_recover(const sonde_fronts *f, float *const *x, uint32_t count) {
  SONDE_ASSERT(f != NULL && x != NULL);
  for (uint32_t t = f->pieces.count; t-- > 0;)
    for (uint32_t k = 0; k < count; ++k) recover_piece(f, &f->pieces.list[t], x[k]);
}

size_t sonde_fronts_nonzeros(const sonde_fronts *f) { return f->factor_size; }
uint64_t sonde_fronts_work(const sonde_fronts *f) { return f->macs; }
