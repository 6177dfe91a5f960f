// Cold half of the factor-once solver: ordering, analysis and numbers of P A P^T = L D L^T.
//
// sonde_ldl_create    orders, builds the permuted pattern, analyses, factors
// sonde_ldl_refactor  numbers on the same pattern
// order_by_levels     without places: breadth-first from a far row, reversed
// build_upper         permuted entries above the diagonal, by column, with their source
// analyse             elimination tree and column counts of L
// row_pattern         nonzeros of one row of L: paths in the elimination tree
// factor_row          up-looking: each row solves a triangular system with the rows before it
#include "sparse/ldl.h"

#include "base/base.h"
#include "base/maths.h"
#include "sparse/dissect.h"

#include <string.h>

// Breadth-first numbering of one component from `root`; returns the last node reached.
static uint32_t breadth_first(const sonde_pattern *a, uint32_t root, uint32_t *queue,
                              uint32_t *seen, uint32_t mark, uint32_t *reached) {
  uint32_t head = 0, tail = 0;
  queue[tail++] = root;
  seen[root] = mark;
  while (head < tail) {
    uint32_t row = queue[head++];
    for (uint32_t p = a->start[row]; p < a->start[row + 1]; ++p) {
      uint32_t next = a->column[p];
      if (seen[next] == mark) continue;
      seen[next] = mark;
      queue[tail++] = next;
    }
  }
  *reached = tail;
  return queue[tail - 1];
}

static void order_by_levels(const sonde_pattern *a, uint32_t *order, uint32_t *seen) {
  uint32_t done = 0, mark = 0;
  for (uint32_t i = 0; i < a->n; ++i) seen[i] = 0;
  for (uint32_t i = 0; i < a->n; ++i) {
    if (seen[i] != 0) continue;
    uint32_t reached;
    uint32_t far = breadth_first(a, i, order + done, seen, ++mark, &reached);
    (void)breadth_first(a, far, order + done, seen, ++mark, &reached);
    done += reached;
  }
  SONDE_ASSERT(done == a->n);
  for (uint32_t i = 0; i < done / 2; ++i) {
    uint32_t swap = order[i];
    order[i] = order[done - 1 - i], order[done - 1 - i] = swap;
  }
}

static sonde_status find_order(const sonde_pattern *a, sonde_ldl *ldl, sonde_error *error) {
  sonde_status status = SONDE_OK;
  if (a->points != NULL)
    status = sonde_dissect(a, a->n, SONDE_LEAF, ldl->order, NULL, error);
  else
    order_by_levels(a, ldl->order, ldl->mark);
  for (uint32_t k = 0; k < a->n && !status; ++k) ldl->rank[ldl->order[k]] = k;
  return status;
}

static sonde_status build_upper(const sonde_pattern *a, sonde_ldl *ldl, sonde_error *error) {
  for (uint32_t k = 0; k < a->n; ++k) {
    uint32_t old = ldl->order[k], diagonal = UINT32_MAX;
    ldl->upper_start[k + 1] = ldl->upper_start[k];
    for (uint32_t p = a->start[old]; p < a->start[old + 1]; ++p) {
      uint32_t i = ldl->rank[a->column[p]];
      if (i == k) diagonal = p;
      if (i >= k) continue;
      size_t place = ldl->upper_start[k + 1]++;
      ldl->upper_row[place] = i;
      ldl->upper_source[place] = p;
    }
    if (diagonal == UINT32_MAX)
      return sonde_fail(error, SONDE_ARGUMENT, "row %u of the matrix has no diagonal entry", old);
    ldl->diagonal_source[k] = diagonal;
  }
  return SONDE_OK;
}

// Nonzero columns of row k of L, every one after those it depends on. Returns where the list starts
// in ldl->stack; it ends at n.
static uint32_t row_pattern(sonde_ldl *ldl, uint32_t k) {
  uint32_t top = ldl->n, *path = ldl->stack + ldl->n;
  ldl->mark[k] = k;
  for (size_t p = ldl->upper_start[k]; p < ldl->upper_start[k + 1]; ++p) {
    uint32_t length = 0;
    for (uint32_t i = ldl->upper_row[p]; ldl->mark[i] != k; i = ldl->parent[i]) {
      path[length++] = i;
      ldl->mark[i] = k;
    }
    while (length > 0) ldl->stack[--top] = path[--length];
  }
  return top;
}

// Elimination tree by climbing from every entry; each climbed node gains one entry in its column.
static void analyse(sonde_ldl *ldl) {
  for (uint32_t k = 0; k < ldl->n; ++k) {
    ldl->parent[k] = ldl->n;
    ldl->mark[k] = k;
    for (size_t p = ldl->upper_start[k]; p < ldl->upper_start[k + 1]; ++p) {
      for (uint32_t i = ldl->upper_row[p]; ldl->mark[i] != k; i = ldl->parent[i]) {
        if (ldl->parent[i] == ldl->n) ldl->parent[i] = k;
        ++ldl->start[i + 1];
        ldl->mark[i] = k;
      }
    }
  }
  for (uint32_t k = 0; k < ldl->n; ++k) ldl->start[k + 1] += ldl->start[k];
}

// One row of L: subtracts what the columns before it contribute. Returns the pivot.
static double factor_row(sonde_ldl *ldl, uint32_t k, const double *value) {
  double pivot = value[ldl->diagonal_source[k]];
  uint32_t top = row_pattern(ldl, k);
  for (size_t p = ldl->upper_start[k]; p < ldl->upper_start[k + 1]; ++p)
    ldl->work[ldl->upper_row[p]] = value[ldl->upper_source[p]];
  for (; top < ldl->n; ++top) {
    uint32_t i = ldl->stack[top];
    double y = ldl->work[i];
    ldl->work[i] = 0;
    size_t end = ldl->fill[i];
    for (size_t p = ldl->start[i]; p < end; ++p) ldl->work[ldl->row[p]] -= ldl->lower[p] * y;
    double l = y / ldl->diagonal[i];
    pivot -= l * y;
    ldl->row[end] = k;
    ldl->lower[end] = l;
    ldl->fill[i] = end + 1;
  }
  return pivot;
}

sonde_status sonde_ldl_refactor(sonde_ldl *ldl, const double *value, sonde_error *error) {
  SONDE_ASSERT(ldl != NULL && value != NULL);
  for (uint32_t k = 0; k < ldl->n; ++k) {
    ldl->fill[k] = ldl->start[k];
    ldl->mark[k] = ldl->n;
    ldl->work[k] = 0;
  }
  for (uint32_t k = 0; k < ldl->n; ++k) {
    double pivot = factor_row(ldl, k, value);
    if (!(pivot > 0) || !isfinite(pivot))
      return sonde_fail(error, SONDE_CONVERGENCE,
                        "pivot %g of row %u is not positive: the matrix is not positive definite",
                        pivot, ldl->order[k]);
    ldl->diagonal[k] = pivot;
  }
  return SONDE_OK;
}

static bool allocate_pattern(sonde_ldl *ldl, size_t entries) {
  size_t n = ldl->n;
  ldl->order = SONDE_NEW(uint32_t, n);
  ldl->rank = SONDE_NEW(uint32_t, n);
  ldl->parent = SONDE_NEW(uint32_t, n);
  ldl->upper_start = SONDE_NEW(size_t, n + 1);
  ldl->upper_row = SONDE_NEW(uint32_t, entries);
  ldl->upper_source = SONDE_NEW(uint32_t, entries);
  ldl->diagonal_source = SONDE_NEW(uint32_t, n);
  ldl->start = SONDE_NEW(size_t, n + 1);
  ldl->diagonal = SONDE_NEW(double, n);
  ldl->work = SONDE_NEW(double, n);
  ldl->mark = SONDE_NEW(uint32_t, n);
  ldl->stack = SONDE_NEW(uint32_t, 2 * n);
  ldl->fill = SONDE_NEW(size_t, n);
  return ldl->order && ldl->rank && ldl->parent && ldl->upper_start && ldl->upper_row &&
         ldl->upper_source && ldl->diagonal_source && ldl->start && ldl->diagonal && ldl->work &&
         ldl->mark && ldl->stack && ldl->fill;
}

static sonde_status build(const sonde_pattern *a, sonde_ldl *ldl, const double *value,
                          sonde_error *error) {
  if (!allocate_pattern(ldl, a->start[a->n])) return sonde_fail_memory(error);
  sonde_status status = find_order(a, ldl, error);
  if (status == SONDE_OK) status = build_upper(a, ldl, error);
  if (status != SONDE_OK) return status;
  analyse(ldl);
  ldl->row = SONDE_NEW(uint32_t, ldl->start[a->n]);
  ldl->lower = SONDE_NEW(double, ldl->start[a->n]);
  if (!ldl->row || !ldl->lower) return sonde_fail_memory(error);
  return sonde_ldl_refactor(ldl, value, error);
}

sonde_status sonde_ldl_create(uint32_t n, const uint32_t *row_start, const uint32_t *column,
                              const double *value, const sonde_vec3 *points, sonde_ldl **ldl,
                              sonde_error *error) {
  sonde_pattern a = {n, row_start, column, points};
  SONDE_ASSERT(ldl != NULL);
  *ldl = NULL;
  sonde_status status = sonde_pattern_check(&a, error);
  if (status != SONDE_OK) return status;
  sonde_ldl *made = SONDE_NEW(sonde_ldl, 1);
  if (made == NULL) return sonde_fail_memory(error);
  made->n = n;
  status = build(&a, made, value, error);
  if (status == SONDE_OK)
    *ldl = made;
  else
    sonde_ldl_destroy(made);
  return status;
}

void sonde_ldl_destroy(sonde_ldl *ldl) {
  if (ldl == NULL) return;
  void *parts[] = {ldl->order,
                   ldl->rank,
                   ldl->parent,
                   ldl->upper_start,
                   ldl->upper_row,
                   ldl->upper_source,
                   ldl->diagonal_source,
                   ldl->start,
                   ldl->row,
                   ldl->lower,
                   ldl->diagonal,
                   ldl->work,
                   ldl->mark,
                   ldl->stack,
                   ldl->fill};
  for (size_t i = 0; i < SONDE_COUNT_OF(parts); ++i) sonde_free(parts[i]);
  sonde_free(ldl);
}
