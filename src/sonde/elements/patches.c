// Disjoint patches grow from tetrahedron to neighbour, first those that add no node.
#include "elements/patches.h"
#include "elements/index_map.h"
#include "base/maths.h"

#include <string.h>

enum { PATCH = 8 }; // tetrahedra in a patch that could grow freely

void sonde_patches_clear(sonde_patches *p) {
  void *parts[] = {p->start, p->list, p->of_start, p->of, p->volume};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  *p = (sonde_patches){0};
}

// beside[t][c]: the tetrahedron at the face opposite corner c; UINT32_MAX at the boundary.
static sonde_status find_beside(const sonde_tetrahedra *m, uint32_t (*beside)[4],
                                sonde_error *error) {
  sonde_index_map faces = {0};
  sonde_status status = m->node_count < 1u << 21 ? SONDE_OK
                                                 : sonde_fail(error, SONDE_ARGUMENT,
                                                              "expected fewer than 2097152 nodes");
  for (uint32_t t = 0; t < m->count && !status; ++t)
    for (int c = 0; c < 4 && !status; ++c) {
      uint32_t n[3];
      for (int k = 0; k < 3; ++k) n[k] = m->corner[t][(c + 1 + k) % 4];
      for (int k = 0; k < 3; ++k)
        if (n[k % 2] > n[k % 2 + 1]) {
          uint32_t swap = n[k % 2];
          n[k % 2] = n[k % 2 + 1], n[k % 2 + 1] = swap;
        }
      bool added = false;
      uint32_t *first =
          sonde_index_map_add(&faces, (uint64_t)n[0] << 42 | (uint64_t)n[1] << 21 | n[2], &added);
      beside[t][c] = UINT32_MAX;
      if (!first) {
        status = sonde_fail_memory(error);
      } else if (added) {
        *first = 4 * t + (uint32_t)c;
      } else {
        beside[t][c] = *first / 4;
        beside[*first / 4][*first % 4] = t;
      }
    }
  sonde_index_map_clear(&faces);
  return status;
}

// Grows a patch from a tetrahedron that has none; members[PATCH]. Returns how many it has.
static uint32_t grow(const sonde_tetrahedra *m, const uint32_t (*beside)[4], const uint32_t *patch,
                     uint32_t from, uint32_t *members) {
  uint32_t count = 1;
  members[0] = from;
  while (count < PATCH) {
    uint32_t best = UINT32_MAX, best_score = 0;
    for (uint32_t k = 0; k < count; ++k)
      for (int c = 0; c < 4; ++c) {
        uint32_t t = beside[members[k]][c], score = 1;
        if (t == UINT32_MAX || patch[t] != UINT32_MAX) continue;
        for (uint32_t q = 0; q < count; ++q) {
          if (members[q] == t) score = 0;
          for (int d = 0; d < 4 && score; ++d) score += beside[t][d] == members[q];
          if (score == 0) break;
        }
        if (score > best_score) best = t, best_score = score;
      }
    if (best == UINT32_MAX) break;
    members[count++] = best;
  }
  SONDE_ASSERT(count >= 1 && m->count > from);
  return count;
}

// patch[t] of every tetrahedron; returns the number of patches. A patch that could not grow to half
// its size joins the patch at one of its faces.
static uint32_t join(const sonde_tetrahedra *m, const uint32_t (*beside)[4], uint32_t *patch) {
  uint32_t count = 0;
  for (uint32_t t = 0; t < m->count; ++t) patch[t] = UINT32_MAX;
  for (uint32_t t = 0; t < m->count; ++t) {
    if (patch[t] != UINT32_MAX) continue;
    uint32_t members[PATCH], size = grow(m, beside, patch, t, members), to = count;
    for (uint32_t k = 0; k < size && size < PATCH / 2 && to == count; ++k)
      for (int c = 0; c < 4; ++c) {
        uint32_t other = beside[members[k]][c];
        if (other != UINT32_MAX && patch[other] != UINT32_MAX) to = patch[other];
      }
    for (uint32_t k = 0; k < size; ++k) patch[members[k]] = to;
    count += to == count;
  }
  return count;
}

sonde_status sonde_patches_find(const sonde_tetrahedra *m, sonde_dilatation kind,
                                const double *volume, sonde_patches *p, sonde_error *error) {
  SONDE_ASSERT(m != NULL && volume != NULL && p != NULL);
  *p = (sonde_patches){.count = m->node_count, .share = 0.25};
  uint32_t(*beside)[4] = (uint32_t(*)[4])sonde_calloc(m->count, sizeof *beside);
  uint32_t *patch = SONDE_NEW(uint32_t, m->count), each = kind == SONDE_DILATATION_NODE ? 4 : 1;
  sonde_status status = beside && patch ? SONDE_OK : sonde_fail_memory(error);
  if (!status && kind == SONDE_DILATATION_PATCH) status = find_beside(m, beside, error);
  if (!status && kind == SONDE_DILATATION_PATCH)
    p->count = join(m, (const uint32_t(*)[4])beside, patch), p->share = 1;
  if (kind == SONDE_DILATATION_ELEMENT) p->count = m->count, p->share = 1;
  p->start = SONDE_NEW(uint32_t, p->count + 2);
  p->list = SONDE_NEW(uint32_t, each * (size_t)m->count);
  p->of_start = SONDE_NEW(uint32_t, m->count + 1);
  p->of = SONDE_NEW(uint32_t, each * (size_t)m->count);
  p->volume = SONDE_NEW(double, p->count);
  if (!p->start || !p->list || !p->of_start || !p->of || !p->volume)
    status = sonde_fail_memory(error);
  for (uint32_t t = 0; t < m->count && !status; ++t) {
    p->of_start[t + 1] = each * (t + 1);
    for (uint32_t c = 0; c < each; ++c) {
      uint32_t to = each == 4 ? m->corner[t][c] : kind == SONDE_DILATATION_ELEMENT ? t : patch[t];
      p->of[each * t + c] = to;
      p->volume[to] += p->share * volume[t];
      ++p->start[to + 2];
    }
  }
  for (uint32_t i = 2; !status && i < p->count + 2; ++i) p->start[i] += p->start[i - 1];
  for (uint32_t k = 0; !status && k < each * m->count; ++k)
    p->list[p->start[p->of[k] + 1]++] = k / each;
  sonde_free(beside);
  sonde_free(patch);
  return status;
}

double sonde_tetrahedron_gradients(const sonde_tetrahedra *m, uint32_t t, double gradient[4][3]) {
  sonde_vec3 p[4], g[4];
  for (int c = 0; c < 4; ++c) p[c] = m->node[m->corner[t][c]];
  sonde_vec3 a = v_sub(p[1], p[0]), b = v_sub(p[2], p[0]), c = v_sub(p[3], p[0]);
  double six = v_dot(v_cross(a, b), c);
  SONDE_ASSERT(six > 0);
  g[1] = v_scale(v_cross(b, c), 1 / six);
  g[2] = v_scale(v_cross(c, a), 1 / six);
  g[3] = v_scale(v_cross(a, b), 1 / six);
  g[0] = v_neg(v_add(v_add(g[1], g[2]), g[3]));
  for (int k = 0; k < 4; ++k)
    gradient[k][0] = g[k].x, gradient[k][1] = g[k].y, gradient[k][2] = g[k].z;
  return six / 6;
}

void sonde_patches_lambda(const sonde_patches *p, const double *volume, const double *young_pa,
                          double poisson, double *lambda) {
  SONDE_ASSERT(p != NULL && volume != NULL && lambda != NULL);
  for (uint32_t i = 0; i < p->count; ++i) {
    double soft = 0;
    for (uint32_t k = p->start[i]; k < p->start[i + 1]; ++k) {
      uint32_t t = p->list[k];
      double stiff = sonde_lame_lambda(young_pa[t], poisson);
      if (stiff > 0) soft += p->share * volume[t] / p->volume[i] / stiff;
    }
    lambda[i] = soft > 0 ? 1 / soft : 0;
  }
}
