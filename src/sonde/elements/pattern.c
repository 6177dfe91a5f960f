// Which nodes of an elastic solid act on each other, and what stays the same for all moduli.
#include "elements/elastic.h"
#include "elements/stuffing.h"
#include "base/base.h"
#include "base/maths.h"

#include <stdlib.h>
#include <string.h>

static int compare_numbers(const void *a, const void *b) {
  uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
  return (x > y) - (x < y);
}

// Numbers the nodes that are not wholly held, those to condense on last.
static sonde_status number_nodes(sonde_elastic *e, const sonde_elastic_def *def,
                                 sonde_error *error) {
  const sonde_tetrahedra *m = e->mesh;
  uint32_t held = 0;
  for (uint32_t i = 0; i < m->node_count; ++i) {
    bool bone = i >= m->surface_count && i < m->surface_count + m->held_count;
    e->held[i] = def->held ? def->held[i] & 7 : bone ? 7 : 0;
    e->unknown[i] = UINT32_MAX;
    held += e->held[i] != 0;
  }
  if (held < 1 || held == m->node_count)
    return sonde_fail(error, SONDE_ARGUMENT, "%u of %u nodes are held, expected some and not all",
                      held, m->node_count);
  for (uint32_t k = 0; k < def->last_count; ++k) {
    uint32_t i = def->last[k];
    if (i >= m->node_count || e->held[i] == 7 || e->unknown[i] != UINT32_MAX)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "node %u is missing, held or listed twice, expected nodes that can move",
                        i);
    e->unknown[i] = k;
  }
  for (uint32_t i = 0; i < m->node_count; ++i)
    if (e->held[i] != 7 && e->unknown[i] == UINT32_MAX) e->node[e->count++] = i;
  for (uint32_t k = 0; k < def->last_count; ++k) e->node[e->count++] = def->last[k];
  for (uint32_t k = 0; k < e->count; ++k) {
    e->unknown[e->node[k]] = k;
    e->point[k] = m->node[e->node[k]];
  }
  e->last_count = def->last_count;
  if (e->last_count == e->count)
    return sonde_fail(error, SONDE_ARGUMENT, "all nodes are to be condensed on");
  return SONDE_OK;
}

// Neighbours of a node, itself included: the nodes of all patches of the tetrahedra around it.
// marked[node]: the last node that listed it; seen [patches] likewise.
static uint32_t find_neighbours(const sonde_elastic *e, const sonde_around *around, uint32_t node,
                                uint32_t *marked, uint32_t *seen, uint32_t *list) {
  const sonde_tetrahedra *m = e->mesh;
  const sonde_patches *p = &e->patches;
  uint32_t count = 0;
  for (uint32_t k = around->start[node]; k < around->start[node + 1]; ++k) {
    uint32_t t = around->list[k];
    for (uint32_t q = p->of_start[t]; q < p->of_start[t + 1]; ++q) {
      if (seen[p->of[q]] == node + 1) continue;
      seen[p->of[q]] = node + 1;
      for (uint32_t i = 4 * p->start[p->of[q]]; i < 4 * p->start[p->of[q] + 1]; ++i) {
        uint32_t other = m->corner[p->list[i / 4]][i % 4];
        if (marked[other] == node + 1 || e->unknown[other] == UINT32_MAX) continue;
        marked[other] = node + 1;
        list[count++] = e->unknown[other];
      }
    }
  }
  qsort(list, count, sizeof *list, compare_numbers);
  return count;
}

static sonde_status find_pattern(sonde_elastic *e, sonde_error *error) {
  uint32_t *marked = SONDE_NEW(uint32_t, e->mesh->node_count);
  uint32_t *seen = SONDE_NEW(uint32_t, e->patches.count);
  uint32_t *list = SONDE_NEW(uint32_t, e->count);
  sonde_around around = {0};
  sonde_status status = marked && seen && list ? SONDE_OK : sonde_fail_memory(error);
  if (!status)
    status = sonde_around_find((const uint32_t(*)[4])e->mesh->corner, e->mesh->count,
                               e->mesh->node_count, &around, error);
  uint32_t room = 0;
  for (uint32_t i = 0; i < e->count && !status; ++i) {
    uint32_t found = find_neighbours(e, &around, e->node[i], marked, seen, list),
             at = e->row_start[i];
    if (at + found > room) {
      uint32_t more = 2 * room + 64 * e->count;
      uint32_t *column = sonde_realloc(e->column, room * sizeof *column, more * sizeof *column);
      if (!column) {
        status = sonde_fail_memory(error);
        break;
      }
      e->column = column, room = more;
    }
    memcpy(e->column + at, list, found * sizeof *list);
    e->row_start[i + 1] = at + found;
  }
  sonde_free(marked);
  sonde_free(seen);
  sonde_free(around.start);
  sonde_free(around.list);
  sonde_free(list);
  return status;
}

sonde_status sonde_elastic_create(const sonde_elastic_def *def, sonde_elastic **elastic,
                                  sonde_error *error) {
  SONDE_ASSERT(def != NULL && def->mesh != NULL && elastic != NULL);
  const sonde_tetrahedra *m = def->mesh;
  *elastic = NULL;
  sonde_elastic *e = SONDE_NEW(sonde_elastic, 1);
  if (!e) return sonde_fail_memory(error);
  e->mesh = m, e->accuracy = 1e-13;
  e->unknown = SONDE_NEW(uint32_t, m->node_count);
  e->node = SONDE_NEW(uint32_t, m->node_count);
  e->held = SONDE_NEW(uint8_t, m->node_count);
  e->gradient = (double(*)[4][3])sonde_calloc(m->count, sizeof *e->gradient);
  e->volume = SONDE_NEW(double, m->count);
  e->young_pa = SONDE_NEW(double, m->count);
  e->row_start = SONDE_NEW(uint32_t, m->node_count + 1);
  e->point = SONDE_NEW(sonde_vec3, m->node_count);
  bool all = e->unknown && e->node && e->held && e->gradient && e->volume && e->young_pa &&
             e->row_start && e->point;
  sonde_status status = all ? number_nodes(e, def, error) : sonde_fail_memory(error);
  for (uint32_t t = 0; t < m->count && !status; ++t)
    e->volume[t] = sonde_tetrahedron_gradients(m, t, e->gradient[t]);
  if (!status) status = sonde_patches_find(m, def->dilatation, e->volume, &e->patches, error);
  if (!status) status = find_pattern(e, error);
  if (!status) {
    e->value = SONDE_NEW(double, 9 * (size_t)e->row_start[e->count]);
    e->patch_lambda = SONDE_NEW(double, e->patches.count);
    if (!e->value || !e->patch_lambda) status = sonde_fail_memory(error);
  }
  const sonde_symbolic_def symbolic = {.node_count = e->count,
                                       .block = 3,
                                       .points = e->point,
                                       .row_start = e->row_start,
                                       .column = e->column};
  if (!status) status = sonde_symbolic_create(&symbolic, &e->symbolic, error);
  if (!status) status = sonde_numeric_reserve(&e->numeric, e->symbolic, error);
  if (status)
    sonde_elastic_destroy(e);
  else
    *elastic = e;
  return status;
}

void sonde_elastic_destroy(sonde_elastic *e) {
  if (!e) return;
  void *parts[] = {e->unknown,   e->node,   e->held,  e->gradient, e->volume,      e->young_pa,
                   e->row_start, e->column, e->value, e->point,    e->patch_lambda};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  sonde_patches_clear(&e->patches);
  sonde_numeric_clear(&e->numeric);
  sonde_symbolic_destroy(e->symbolic);
  sonde_free(e);
}
