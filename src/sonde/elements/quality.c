// Angles of tetrahedra, and better ones by moving nodes.
#include "elements/stuffing.h"
#include "geometry/internal.h"

#include <string.h>

// Area vectors of the faces opposite each corner, outward, doubled.
static void face_vectors(const sonde_vec3 p[4], sonde_vec3 n[4]) {
  sonde_vec3 a = v_sub(p[1], p[0]), b = v_sub(p[2], p[0]), c = v_sub(p[3], p[0]);
  n[1] = v_cross(c, b);
  n[2] = v_cross(a, c);
  n[3] = v_cross(b, a);
  n[0] = v_neg(v_add(v_add(n[1], n[2]), n[3]));
}

double sonde_dihedral_sine(const sonde_vec3 p[4]) {
  sonde_vec3 n[4];
  double length[4], least = 1;
  face_vectors(p, n);
  double volume6 = v_dot(v_sub(p[3], p[0]), v_cross(v_sub(p[1], p[0]), v_sub(p[2], p[0])));
  for (int k = 0; k < 4; ++k) length[k] = v_norm(n[k]);
  if (!(volume6 > 0)) return volume6;
  // The faces opposite i and j meet at the edge of the other two corners: sine = 6 V |edge| over
  // the product of their doubled areas.
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) {
      int k = 0;
      while (k == i || k == j) ++k;
      int m = 6 - i - j - k;
      double sine = volume6 * v_distance(p[k], p[m]) / (length[i] * length[j]);
      if (sine < least) least = sine;
    }
  return least;
}

sonde_status sonde_around_find(const uint32_t (*corner)[4], uint32_t count, uint32_t node_count,
                               sonde_around *a, sonde_error *error) {
  SONDE_ASSERT(corner != NULL && a != NULL);
  a->start = SONDE_NEW(uint32_t, node_count + 2);
  a->list = SONDE_NEW(uint32_t, 4 * (size_t)count);
  if (!a->start || !a->list) return sonde_fail_memory(error);
  for (int pass = 0; pass < 2; ++pass) {
    for (uint32_t k = 0; k < count; ++k)
      for (int c = 0; c < 4; ++c)
        if (pass == 0)
          ++a->start[corner[k][c] + 2];
        else
          a->list[a->start[corner[k][c] + 1]++] = k;
    for (uint32_t i = 2; pass == 0 && i < node_count + 2; ++i) a->start[i] += a->start[i - 1];
  }
  return SONDE_OK;
}

double sonde_worst_sine(const sonde_vec3 *node, const uint32_t (*corner)[4], const sonde_around *a,
                        uint32_t at, uint32_t *which) {
  SONDE_ASSERT(which != NULL);
  double worst = INFINITY;
  for (uint32_t k = a->start[at]; k < a->start[at + 1]; ++k) {
    sonde_vec3 p[4];
    for (int c = 0; c < 4; ++c) p[c] = node[corner[a->list[k]][c]];
    double sine = sonde_dihedral_sine(p);
    if (sine < worst) worst = sine, *which = a->list[k];
  }
  return worst;
}

sonde_status sonde_tetrahedra_inspect(const sonde_tetrahedra *t, const sonde_mesh *outer,
                                      const sonde_mesh *inner, sonde_tetrahedra_report *report,
                                      sonde_error *error) {
  SONDE_ASSERT(t != NULL && report != NULL);
  *report =
      (sonde_tetrahedra_report){.smallest_dihedral_rad = SONDE_PI, .smallest_volume_m3 = INFINITY};
  for (uint32_t k = 0; k < t->count; ++k) {
    sonde_vec3 p[4], n[4];
    for (int c = 0; c < 4; ++c) p[c] = t->node[t->corner[k][c]];
    face_vectors(p, n);
    double volume = -v_dot(v_sub(p[3], p[0]), n[3]) / 6;
    report->volume_m3 += volume;
    report->smallest_volume_m3 = fmin(report->smallest_volume_m3, volume);
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) {
        double angle = atan2(v_norm(v_cross(n[i], n[j])), -v_dot(n[i], n[j]));
        report->smallest_dihedral_rad = fmin(report->smallest_dihedral_rad, angle);
        report->largest_dihedral_rad = fmax(report->largest_dihedral_rad, angle);
      }
  }
  const sonde_mesh *b = &t->boundary;
  for (uint32_t f = 0; f < t->outer_face_count; ++f)
    for (int c = 0; c < 3; ++c)
      report->mean_edge_m +=
          v_distance(b->vertices[b->faces[f][c]], b->vertices[b->faces[f][(c + 1) % 3]]) /
          (3 * t->outer_face_count);
  if (!outer) return SONDE_OK;
  sonde_solid_domain domain = {0};
  sonde_status status = sonde_surface_index_create(outer, &domain.outer, error);
  if (!status && inner) status = sonde_surface_index_create(inner, &domain.inner, error);
  for (uint32_t k = 0; k < b->vertex_count + b->face_count && !status; ++k) {
    bool on_inner;
    sonde_vec3 p = b->vertices[k < b->vertex_count ? k : 0];
    if (k >= b->vertex_count) {
      const uint32_t *v = b->faces[k - b->vertex_count];
      p = v_scale(v_add(v_add(b->vertices[v[0]], b->vertices[v[1]]), b->vertices[v[2]]), 1 / 3.0);
    }
    report->off_surface_m =
        fmax(report->off_surface_m, fabs(sonde_domain_distance(&domain, p, &on_inner)));
  }
  sonde_surface_index_destroy(domain.outer);
  sonde_surface_index_destroy(domain.inner);
  return status;
}

// ---- smoothing ----------------------------------------------------------------------------

enum { PASSES = 8 };
static const double GOOD_SINE = 0.5; // nodes whose tetrahedra have angles of 30 to 150 degrees stay
static const double FIRST_STEP = 0.25; // of the mean edge at a node
static const double NEXT_STEP = 0.7;   // of the step in the pass before

// Moves one node to the best of some places: along the axes, towards the middle of its neighbours,
// and away from the opposite face of its worst tetrahedron.
static void improve_node(sonde_tetrahedra *t, const sonde_around *a, uint32_t node, uint8_t kind,
                         const sonde_solid_domain *domain, double step) {
  uint32_t which = 0, ignored = 0;
  double best = sonde_worst_sine(t->node, (const uint32_t(*)[4])t->corner, a, node, &which);
  if (best >= GOOD_SINE) return;
  sonde_vec3 from = t->node[node], found = from, middle = vec3(0, 0, 0), p[4], n[4];
  double mean = 0;
  uint32_t others = 3 * (a->start[node + 1] - a->start[node]);
  for (uint32_t k = a->start[node]; k < a->start[node + 1]; ++k)
    for (int c = 0; c < 4; ++c) {
      sonde_vec3 q = t->node[t->corner[a->list[k]][c]];
      mean += v_distance(q, from) / others;
      if (t->corner[a->list[k]][c] != node) middle = v_madd(middle, 1.0 / others, q);
    }
  for (int c = 0; c < 4; ++c) p[c] = t->node[t->corner[which][c]];
  face_vectors(p, n);
  int own = 0;
  while (t->corner[which][own] != node) ++own;
  const sonde_vec3 way[8] = {{1, 0, 0},
                             {-1, 0, 0},
                             {0, 1, 0},
                             {0, -1, 0},
                             {0, 0, 1},
                             {0, 0, -1},
                             v_unit(v_sub(middle, from), vec3(1, 0, 0)),
                             v_unit(v_neg(n[own]), vec3(1, 0, 0))};
  for (int k = 0; k < 8; ++k) {
    sonde_vec3 to = v_madd(from, step * mean, way[k]);
    if (kind != SONDE_NODE_INSIDE) to = sonde_domain_nearest(domain, to, kind == SONDE_NODE_INNER);
    t->node[node] = to;
    double sine = sonde_worst_sine(t->node, (const uint32_t(*)[4])t->corner, a, node, &ignored);
    if (sine > best) best = sine, found = to;
  }
  t->node[node] = found;
}

sonde_status sonde_tetrahedra_smooth(sonde_tetrahedra *t, const uint8_t *kind,
                                     const sonde_solid_domain *domain, sonde_error *error) {
  SONDE_ASSERT(t->boundary.faces != NULL && domain->outer != NULL);
  sonde_around a = {0};
  uint8_t *still = SONDE_NEW(uint8_t, t->node_count);
  sonde_status status = still ? SONDE_OK : sonde_fail_memory(error);
  if (!status)
    status = sonde_around_find((const uint32_t(*)[4])t->corner, t->count, t->node_count, &a, error);
  // Nodes where both surfaces meet keep their place.
  for (uint32_t f = 0; f < t->outer_face_count && !status; ++f)
    for (int c = 0; c < 3; ++c)
      if (kind[t->boundary.faces[f][c]] == SONDE_NODE_INNER) still[t->boundary.faces[f][c]] = 1;
  double step = FIRST_STEP;
  for (int pass = 0; pass < PASSES && !status; ++pass, step *= NEXT_STEP)
    for (uint32_t i = 0; i < t->node_count; ++i)
      if (!still[i]) improve_node(t, &a, i, kind[i], domain, step);
  sonde_free(a.start);
  sonde_free(a.list);
  sonde_free(still);
  return status;
}
