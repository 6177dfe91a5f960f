// Faces that a cut crosses are split at the points where it meets their edges.
#include "fit/cut_split.h"

#include "base/maths.h"

#include <stdlib.h>
#include <string.h>

enum { NOWHERE = UINT32_MAX };

typedef struct split_point {
  uint64_t edge; // lower vertex << 32 | higher vertex
  double share;
} split_point;

static int compare(const void *a, const void *b) {
  uint64_t x = ((const split_point *)a)->edge, y = ((const split_point *)b)->edge;
  return (x > y) - (x < y);
}

static uint64_t edge_of(uint32_t a, uint32_t b) {
  return a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
}

static uint32_t find(const split_point *point, uint32_t count, uint32_t first, uint32_t a,
                     uint32_t b) {
  const split_point key = {edge_of(a, b), 0};
  const split_point *at = bsearch(&key, point, count, sizeof *point, compare);
  return at ? first + (uint32_t)(at - point) : NOWHERE;
}

static void add_parent(uint32_t parent, double share, uint32_t *parents, double *shares) {
  if (!(share > 0)) return;
  int k = 0;
  while (k < 3 && shares[k] > 0 && parents[k] != parent) ++k;
  SONDE_ASSERT(k < 3); // both ends lie in one face of the model
  parents[k] = parent;
  shares[k] += share;
}

static bool grow(sonde_cutter *c, uint32_t vertices, uint32_t faces) {
  sonde_cut *cut = c->cut;
  size_t old = cut->vertex_count, new = old + vertices;
  void *parent = sonde_realloc(cut->parent, old * sizeof *cut->parent, new * sizeof *cut->parent);
  if (parent) cut->parent = parent;
  void *share = sonde_realloc(cut->share, old * sizeof *cut->share, new * sizeof *cut->share);
  if (share) cut->share = share;
  void *place = sonde_realloc(c->place, old * sizeof *c->place, new * sizeof *c->place);
  if (place) c->place = place;
  size_t had = cut->face_count;
  void *face = sonde_realloc(cut->face, had * sizeof *cut->face, (had + faces) * sizeof *cut->face);
  if (face) cut->face = face;
  if (!parent || !share || !place || !face) return false;
  memset(cut->parent + old, 0, vertices * sizeof *cut->parent);
  memset(cut->share + old, 0, vertices * sizeof *cut->share);
  return true;
}

static void set_face(sonde_cut *cut, uint32_t at, uint32_t a, uint32_t b, uint32_t d) {
  SONDE_ASSERT(a != b && b != d && d != a);
  cut->face[at][0] = a;
  cut->face[at][1] = b;
  cut->face[at][2] = d;
}

static void put_face(sonde_cut *cut, uint32_t a, uint32_t b, uint32_t d) {
  set_face(cut, cut->face_count++, a, b, d);
}

// on: the point on the edge from each corner to the next, or NOWHERE.
static void split_face(const sonde_cutter *c, uint32_t face, const uint32_t on[3]) {
  uint32_t v[3], points = 0, k = 0;
  memcpy(v, c->cut->face[face], sizeof v);
  for (int i = 0; i < 3; ++i) points += on[i] != NOWHERE;
  if (points == 0) return;
  if (points == 3) {
    set_face(c->cut, face, on[0], on[1], on[2]);
    for (int i = 0; i < 3; ++i) put_face(c->cut, v[i], on[i], on[(i + 2) % 3]);
    return;
  }
  // k: the corner between both points, or the one where the edge with the point begins.
  while (on[k] == NOWHERE || (points == 2 && on[(k + 2) % 3] == NOWHERE)) ++k;
  uint32_t a = v[k], b = v[(k + 1) % 3], d = v[(k + 2) % 3], p = on[k];
  if (points == 1) {
    set_face(c->cut, face, a, p, d);
    put_face(c->cut, p, b, d);
    return;
  }
  // Points p on ab and q on da: the corner at a replaces the face; the quadrilateral (p, b, d, q)
  // is halved along its shorter diagonal.
  const sonde_model *m = c->model;
  uint32_t q = on[(k + 2) % 3];
  sonde_vec3 x[4] = {sonde_cut_point(m, c->cut, p), sonde_cut_point(m, c->cut, b),
                     sonde_cut_point(m, c->cut, d), sonde_cut_point(m, c->cut, q)};
  bool by_pd = v_distance(x[0], x[2]) <= v_distance(x[1], x[3]);
  set_face(c->cut, face, a, p, q);
  put_face(c->cut, p, b, by_pd ? d : q);
  if (by_pd)
    put_face(c->cut, p, d, q);
  else
    put_face(c->cut, b, d, q);
}

sonde_status sonde_cut_split(sonde_cutter *c, sonde_split_where *where, int which, uint32_t *added,
                             sonde_error *error) {
  sonde_cut *cut = c->cut;
  uint32_t first = cut->vertex_count, faces = cut->face_count;
  split_point *point = SONDE_NEW(split_point, 3 * (size_t)faces);
  uint32_t found = 0, count = 0;
  sonde_status status = point ? SONDE_OK : sonde_fail_memory(error);
  // The points on the edges of all faces, each once.
  for (uint32_t f = 0; f < faces && !status; ++f)
    for (int k = 0; k < 3; ++k) {
      uint64_t edge = edge_of(cut->face[f][k], cut->face[f][(k + 1) % 3]);
      double share = where(c, which, (uint32_t)(edge >> 32), (uint32_t)edge);
      SONDE_ASSERT(share >= 0 && share < 1);
      if (share > 0) point[found++] = (split_point){edge, share};
    }
  if (!status) qsort(point, found, sizeof *point, compare);
  for (uint32_t k = 0; k < found; ++k)
    if (!k || point[k].edge != point[k - 1].edge) point[count++] = point[k];
  // A point adds a face on each of its two sides.
  if (!status && count && !grow(c, count, 2 * count)) status = sonde_fail_memory(error);
  // A point mixes the parents of its edge's ends and lies between their places.
  for (uint32_t n = 0; n < count && !status; ++n) {
    uint32_t a = (uint32_t)(point[n].edge >> 32), b = (uint32_t)point[n].edge, to = first + n;
    double t = point[n].share;
    for (int k = 0; k < 3; ++k)
      add_parent(cut->parent[a][k], (1 - t) * cut->share[a][k], cut->parent[to], cut->share[to]);
    for (int k = 0; k < 3; ++k)
      add_parent(cut->parent[b][k], t * cut->share[b][k], cut->parent[to], cut->share[to]);
    for (int k = 1; k < 3; ++k)
      if (!(cut->share[to][k] > 0)) cut->parent[to][k] = cut->parent[to][0];
    const sonde_pad_place *p = &c->place[a], *q = &c->place[b];
    c->place[to] =
        (sonde_pad_place){p->u_m + t * (q->u_m - p->u_m), p->v_m + t * (q->v_m - p->v_m)};
  }
  if (!status) cut->vertex_count += count;
  for (uint32_t f = 0; f < faces && !status && count; ++f) {
    const uint32_t *v = cut->face[f];
    uint32_t on[3] = {find(point, count, first, v[0], v[1]), find(point, count, first, v[1], v[2]),
                      find(point, count, first, v[2], v[0])};
    split_face(c, f, on);
  }
  sonde_free(point);
  *added = count;
  return status;
}
