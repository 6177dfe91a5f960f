// Repeated presses and unloading, reduced to one curve per site and probe.
#include "fit/repeats.h"

#include "base/maths.h"

#include <string.h>

bool sonde_phase_of(const char *text, bool *loading) {
  SONDE_ASSERT(text && loading);
  *loading = strcmp(text, "loading") == 0 || strcmp(text, "load") == 0;
  return *loading || strcmp(text, "unloading") == 0 || strcmp(text, "unload") == 0;
}

// Force of one repeat, rows [count] by depth, at a depth within them.
static bool force_at(const sonde_repeat_row *row, uint32_t count, double depth_m, double *force_n) {
  SONDE_ASSERT(count > 0);
  if (!(depth_m >= row[0].datum.penetration_m)) return false;
  uint32_t k = 0;
  while (k < count && row[k].datum.penetration_m < depth_m) ++k;
  if (k == count) return false;
  const sonde_datum *b = &row[k].datum, *a = k ? &row[k - 1].datum : b;
  double span = b->penetration_m - a->penetration_m;
  double t = span > 0 ? (depth_m - a->penetration_m) / span : 1;
  *force_n = a->force_n + t * (b->force_n - a->force_n);
  return true;
}

static int compare_rows(const void *a, const void *b) {
  const sonde_repeat_row *p = a, *q = b;
  if (p->datum.site != q->datum.site) return p->datum.site < q->datum.site ? -1 : 1;
  int names = strcmp(p->datum.probe, q->datum.probe);
  if (names) return names;
  if (p->repeat != q->repeat) return p->repeat < q->repeat ? -1 : 1;
  double x = p->datum.penetration_m, y = q->datum.penetration_m;
  return x != y ? (x > y) - (x < y) : (p->line > q->line) - (p->line < q->line);
}

sonde_status sonde_measurements_average(sonde_repeat_row *row, uint32_t count,
                                        sonde_measurements *m, sonde_error *error) {
  SONDE_ASSERT(count > 0 && row && !m->scatter_n);
  m->scatter_n = SONDE_NEW(double, count);
  if (!m->scatter_n) return sonde_fail_memory(error);
  qsort(row, count, sizeof *row, compare_rows);
  m->count = 0;
  for (uint32_t i = 0, end; i < count; i = end) {
    const sonde_datum *one = &row[i].datum;
    for (end = i + 1; end < count && row[end].datum.site == one->site &&
                      strcmp(row[end].datum.probe, one->probe) == 0;)
      ++end;
    // Rows [count] of one site and probe; appends their mean to the measurements.
    const sonde_repeat_row *curve = row + i;
    const uint32_t length = end - i;
    uint32_t first = 1, from = m->count;
    SONDE_ASSERT(length > 0 && curve && m->scatter_n);
    double squares = 0, freedom = 0;
    while (first < length && curve[first].repeat == curve[0].repeat) ++first;
    uint32_t most = 1;
    for (uint32_t k = 0; k < first; ++k) {
      double sum = 0, square = 0;
      uint32_t n = 0;
      for (uint32_t a = 0, b; a < length; a = b) {
        double force_n;
        for (b = a + 1; b < length && curve[b].repeat == curve[a].repeat;) ++b;
        if (!force_at(curve + a, b - a, curve[k].datum.penetration_m, &force_n)) continue;
        sum += force_n, square += force_n * force_n, ++n;
      }
      SONDE_ASSERT(n > 0);
      sonde_datum *to = &m->data[m->count];
      *to = curve[k].datum;
      to->force_n = sum / n;
      m->position_m[m->count] = curve[k].position_m;
      m->normal[m->count] = curve[k].normal;
      m->line[m->count] = curve[k].line;
      m->scatter_n[m->count++] = 1 / sqrt(n);
      if (n > 1) squares += fmax(square - sum * sum / n, 0), freedom += n - 1;
      if (n > most) most = n;
    }
    double sd_n = freedom > 0 ? sqrt(squares / freedom) : 0;
    for (uint32_t k = from; k < m->count; ++k) m->scatter_n[k] *= sd_n;
    if (most > m->repeats) m->repeats = most;
  }
  return SONDE_OK;
}
