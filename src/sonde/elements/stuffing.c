// Isosurface stuffing (Labelle and Shewchuk 2007): lattice points that lie too near the surface are
// moved onto it, tetrahedra that still cross it are cut, and what lies inside is kept.
#include "elements/stuffing.h"
#include "elements/lattice.h"
#include "geometry/internal.h"

#include <string.h>

// A lattice edge is cut no nearer to its ends than by this share, of edges along an axis and of the
// shorter others: the safe values of the method for its smallest dihedral angle.
static const double NEAR_LONG = 0.24999, NEAR_SHORT = 0.41189;
static const double LEAST_SINE = 0.1;     // of a dihedral angle after such a move
static const double CELL_PER_EDGE = 1.25; // side of a cell over the mean edge that it makes

double sonde_domain_distance(const sonde_solid_domain *domain, sonde_vec3 p, bool *on_inner) {
  double outer = sonde_surface_signed_distance(domain->outer, p);
  double inner = domain->inner ? -sonde_surface_signed_distance(domain->inner, p) : -INFINITY;
  *on_inner = inner >= outer;
  return *on_inner ? inner : outer;
}

sonde_vec3 sonde_domain_nearest(const sonde_solid_domain *domain, sonde_vec3 p, bool on_inner) {
  SONDE_ASSERT(!on_inner || domain->inner != NULL);
  return sonde_surface_closest(on_inner ? domain->inner : domain->outer, p).point_m;
}

// ---- background ---------------------------------------------------------------------------

typedef struct sizing {
  const sonde_tetrahedra_def *def;
  const sonde_solid_domain *domain;
} sizing;

// A cell is split when it is longer than the edges wanted at the nearest of its points, unless it
// lies outside with all its neighbours' centres.
static bool is_too_long(const void *user, sonde_vec3 centre, double side_m) {
  const sizing *s = user;
  bool on_inner;
  double distance = sonde_domain_distance(s->domain, centre, &on_inner), reach = 0.87 * side_m;
  if (distance > reach + side_m) return false;
  double edge = s->def->edge_m + s->def->growth * fmax(0, -distance - reach);
  for (uint32_t k = 0; k < s->def->fine_count; ++k) {
    double beyond = v_distance(s->def->fine[k], centre) - reach - s->def->fine_reach_m;
    edge = fmin(edge, s->def->fine_edge_m + s->def->growth * fmax(0, beyond));
  }
  return side_m > 1.001 * CELL_PER_EDGE * edge;
}

// ---- points on the surface ----------------------------------------------------------------

// Where a lattice edge crosses the surface.
typedef struct crossing {
  uint32_t end[2]; // a point inside, one outside
  uint32_t node;
  double along; // share of the edge from the inside
  sonde_vec3 at;
  bool on_inner;
} crossing;

typedef struct stuffing {
  sonde_lattice lattice;
  const sonde_solid_domain *domain;
  sonde_vec3 *point; // [point_count] lattice points, some moved onto the surface
  double *distance;  // [point_count] 0 for those
  bool *on_inner;    // [point_count]
  uint32_t *node;    // [point_count] number in the mesh
  sonde_index_map edges;
  uint32_t crossing_count, crossing_room;
  crossing *crossing;
  uint32_t room; // for tetrahedra
} stuffing;

static uint64_t edge_key(uint32_t a, uint32_t b) {
  return a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
}

// Regula falsi that halves the weight of an end which stays (Illinois).
static void find_crossing(const stuffing *s, crossing *c) {
  sonde_vec3 a = s->point[c->end[0]], b = s->point[c->end[1]];
  double low = 0, high = 1, at_low = s->distance[c->end[0]], at_high = s->distance[c->end[1]];
  const double close = 1e-7 * v_distance(a, b);
  for (int k = 0, side = 0; k < 30; ++k) {
    c->along = low + (high - low) * at_low / (at_low - at_high);
    c->at = v_lerp(a, b, c->along);
    double here = sonde_domain_distance(s->domain, c->at, &c->on_inner);
    if (fabs(here) < close) return;
    if (here < 0) {
      low = c->along, at_low = here;
      if (side == 1) at_high /= 2;
      side = 1;
    } else {
      high = c->along, at_high = here;
      if (side == 2) at_low /= 2;
      side = 2;
    }
  }
}

static sonde_status find_crossings(stuffing *s, sonde_error *error) {
  for (uint32_t t = 0; t < s->lattice.count; ++t)
    for (int e = 0; e < 6; ++e) {
      static const int ends[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
      uint32_t a = s->lattice.corner[t][ends[e][0]], b = s->lattice.corner[t][ends[e][1]];
      if (!(s->distance[a] * s->distance[b] < 0)) continue;
      bool added = false;
      uint32_t *number = sonde_index_map_add(&s->edges, edge_key(a, b), &added);
      if (!number) return sonde_fail_memory(error);
      if (!added) continue;
      if (s->crossing_count == s->crossing_room) {
        size_t room = s->crossing_room ? 2 * (size_t)s->crossing_room : 1024;
        crossing *more =
            sonde_realloc(s->crossing, s->crossing_room * sizeof *more, room * sizeof *more);
        if (!more) return sonde_fail_memory(error);
        s->crossing = more, s->crossing_room = (uint32_t)room;
      }
      bool forward = s->distance[a] < 0;
      crossing *c = &s->crossing[ *number = s->crossing_count++];
      *c = (crossing){.end = {forward ? a : b, forward ? b : a}, .node = UINT32_MAX};
      find_crossing(s, c);
    }
  return SONDE_OK;
}

// Of a candidate move: crossing and end, nearest first.
typedef struct move {
  double share;
  uint32_t crossing, end;
} move;

static int compare_moves(const void *a, const void *b) {
  const move *x = a, *y = b;
  if (x->share != y->share) return x->share < y->share ? -1 : 1;
  uint64_t p = (uint64_t)x->crossing << 1 | x->end, q = (uint64_t)y->crossing << 1 | y->end;
  return (p > q) - (p < q);
}

// Lattice points too near a crossing move onto it, whereby all their edges lose theirs. Where
// cells of two sizes meet a move may flatten a tetrahedron: it is left out.
static sonde_status move_near_points(stuffing *s, sonde_error *error) {
  const uint32_t(*corner)[4] = (const uint32_t(*)[4])s->lattice.corner;
  sonde_around around = {0};
  move *moves = SONDE_NEW(move, 2 * (size_t)s->crossing_count);
  sonde_status status = moves ? SONDE_OK : sonde_fail_memory(error);
  if (!status)
    status = sonde_around_find(corner, s->lattice.count, s->lattice.point_count, &around, error);
  size_t count = 0;
  for (uint32_t k = 0; k < s->crossing_count && !status; ++k) {
    const crossing *c = &s->crossing[k];
    sonde_vec3 d = v_sub(s->point[c->end[1]], s->point[c->end[0]]);
    double longest = fmax(fmax(fabs(d.x), fabs(d.y)), fabs(d.z));
    double near = longest > 0.99 * v_norm(d) ? NEAR_LONG : NEAR_SHORT;
    for (uint32_t end = 0; end < 2; ++end) {
      double share = end ? 1 - c->along : c->along;
      if (share < near) moves[count++] = (move){share / near, k, end};
    }
  }
  if (!status) qsort(moves, count, sizeof *moves, compare_moves);
  for (size_t k = 0; k < count; ++k) {
    const crossing *c = &s->crossing[moves[k].crossing];
    if (s->distance[c->end[0]] == 0 || s->distance[c->end[1]] == 0) continue;
    uint32_t point = c->end[moves[k].end], which;
    sonde_vec3 from = s->point[point];
    s->point[point] = c->at;
    if (sonde_worst_sine(s->point, corner, &around, point, &which) < LEAST_SINE) {
      s->point[point] = from;
      continue;
    }
    s->distance[point] = 0, s->on_inner[point] = c->on_inner;
  }
  sonde_free(moves);
  sonde_free(around.start);
  sonde_free(around.list);
  return status;
}

// ---- tetrahedra ---------------------------------------------------------------------------

typedef struct output {
  stuffing *s;
  sonde_tetrahedra *t;
  uint8_t *kind; // [node_count]
  bool mirrored; // the points of the lattice tetrahedron at work are listed left-handed
} output;

// Node where the edge from an inside to an outside point crosses the surface.
static uint32_t node_of_edge(output *o, uint32_t inside, uint32_t outside) {
  uint32_t number = sonde_index_map_find(&o->s->edges, edge_key(inside, outside));
  SONDE_ASSERT(number != UINT32_MAX);
  crossing *c = &o->s->crossing[number];
  if (c->node == UINT32_MAX) {
    uint32_t node = c->node = o->t->node_count++;
    o->t->node[node] = c->at;
    o->kind[node] = c->on_inner ? SONDE_NODE_INNER : SONDE_NODE_OUTER;
  }
  return c->node;
}

static void add(output *o, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  SONDE_ASSERT(o->t->count < o->s->room);
  const uint32_t corner[4] = {a, b, o->mirrored ? d : c, o->mirrored ? c : d};
  memcpy(o->t->corner[o->t->count++], corner, sizeof corner);
}

// A pyramid with apex and base a b c d (in turn), split from a to c.
static void add_pyramid(output *o, uint32_t apex, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  add(o, apex, a, b, c);
  add(o, apex, a, c, d);
}

// What is inside of a lattice tetrahedron with `in` points inside, `on` on the surface and the rest
// outside. p: the points in that order; those inside ascend. Every quadrilateral on a face between
// two lattice tetrahedra is split from the lower of its inside points, on either side.
static void add_inside(output *o, const uint32_t p[4], int in, int on) {
  uint32_t n[4];
  for (int k = 0; k < in + on; ++k) {
    uint32_t *node = &o->s->node[p[k]];
    if (*node == UINT32_MAX) {
      *node = o->t->node_count++;
      bool surface = o->s->distance[p[k]] == 0, inner = o->s->on_inner[p[k]];
      o->t->node[*node] = o->s->point[p[k]];
      o->kind[*node] = !surface ? SONDE_NODE_INSIDE : inner ? SONDE_NODE_INNER : SONDE_NODE_OUTER;
    }
    n[k] = *node;
  }
  if (in + on == 4) {
    add(o, n[0], n[1], n[2], n[3]);
  } else if (in == 1) {
    for (int k = 1 + on; k < 4; ++k) n[k] = node_of_edge(o, p[0], p[k]);
    add(o, n[0], n[1], n[2], n[3]);
  } else if (in == 2 && on == 1) {
    uint32_t a = node_of_edge(o, p[0], p[3]), b = node_of_edge(o, p[1], p[3]);
    add_pyramid(o, n[2], n[0], n[1], b, a);
  } else if (in == 2) {
    uint32_t a2 = node_of_edge(o, p[0], p[2]), a3 = node_of_edge(o, p[0], p[3]);
    uint32_t b2 = node_of_edge(o, p[1], p[2]), b3 = node_of_edge(o, p[1], p[3]);
    const sonde_vec3 *x = o->t->node;
    add(o, n[0], n[1], b2, b3);
    // The quadrilateral on the surface is split along its shorter diagonal.
    if (v_distance(x[a2], x[b3]) < v_distance(x[a3], x[b2]))
      add_pyramid(o, n[0], a2, a3, b3, b2);
    else
      add_pyramid(o, n[0], a3, b3, b2, a2);
  } else {
    // Three inside: a prism whose sides are split from n[0], n[0] and n[1].
    uint32_t c[3];
    for (int k = 0; k < 3; ++k) c[k] = node_of_edge(o, p[k], p[3]);
    add(o, n[0], c[0], c[1], c[2]);
    add_pyramid(o, n[0], n[1], n[2], c[2], c[1]);
  }
}

// All tetrahedra with a point inside.
static void add_all(output *o) {
  const sonde_lattice *l = &o->s->lattice;
  for (uint32_t t = 0; t < l->count; ++t) {
    uint32_t p[4];
    int in = 0, on = 0, at = 0;
    for (int k = 0; k < 4; ++k) {
      double distance = o->s->distance[l->corner[t][k]];
      in += distance < 0, on += distance == 0;
    }
    if (in == 0) continue;
    for (int sign = -1; sign <= 1; ++sign)
      for (int k = 0; k < 4; ++k) {
        double distance = o->s->distance[l->corner[t][k]];
        if ((distance > 0) - (distance < 0) == sign) p[at++] = l->corner[t][k];
      }
    for (int i = 0; i < in; ++i)
      for (int j = i + 1; j < in; ++j)
        if (p[j] < p[i]) {
          uint32_t swap = p[i];
          p[i] = p[j], p[j] = swap;
        }
    // Every pair that stands the other way round than in the lattice mirrors once.
    int place[4];
    for (int k = 0; k < 4; ++k)
      for (int c = 0; c < 4; ++c)
        if (l->corner[t][c] == p[k]) place[k] = c;
    o->mirrored = false;
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) o->mirrored ^= place[i] > place[j];
    add_inside(o, p, in, on);
  }
}

// ---- boundary -----------------------------------------------------------------------------

static int compare_keyed_faces(const void *a, const void *b) {
  return memcmp(a, b, 3 * sizeof(uint32_t));
}

// A face with its corners ascending, then as it runs seen from outside.
typedef struct keyed_face {
  uint32_t sorted[3], corner[3];
} keyed_face;

// Faces that one tetrahedron has: outer ones first.
static sonde_status find_boundary(sonde_tetrahedra *t, const uint8_t *kind, sonde_error *error) {
  keyed_face *faces = SONDE_NEW(keyed_face, 4 * (size_t)t->count);
  if (!faces) return sonde_fail_memory(error);
  size_t count = 0, single = 0;
  for (uint32_t k = 0; k < t->count; ++k)
    for (int f = 0; f < 4; ++f) {
      static const int face[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
      keyed_face *to = &faces[count++];
      for (int c = 0; c < 3; ++c) to->sorted[c] = to->corner[c] = t->corner[k][face[f][c]];
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2 - i; ++j)
          if (to->sorted[j] > to->sorted[j + 1]) {
            uint32_t swap = to->sorted[j];
            to->sorted[j] = to->sorted[j + 1], to->sorted[j + 1] = swap;
          }
    }
  qsort(faces, count, sizeof *faces, compare_keyed_faces);
  for (size_t k = 0; k < count; ++k)
    if (k + 1 < count && compare_keyed_faces(&faces[k], &faces[k + 1]) == 0)
      ++k;
    else
      faces[single++] = faces[k];
  sonde_status status = sonde_mesh_create(&t->boundary, 1, (uint32_t)single, error);
  uint32_t at = 0;
  for (int inner = 0; inner < 2 && !status; ++inner) {
    for (size_t k = 0; k < single; ++k) {
      int held = 0;
      for (int c = 0; c < 3; ++c) held += kind[faces[k].corner[c]] == SONDE_NODE_INNER;
      if ((held == 3) == (inner == 1))
        memcpy(t->boundary.faces[at++], faces[k].corner, sizeof faces[k].corner);
    }
    if (!inner) t->outer_face_count = at;
  }
  sonde_free(faces);
  return status;
}

// Numbers the nodes in their three runs and gives the boundary its vertices.
static sonde_status number_nodes(sonde_tetrahedra *t, uint8_t *kind, sonde_error *error) {
  uint32_t *number = SONDE_NEW(uint32_t, t->node_count);
  sonde_vec3 *node = SONDE_NEW(sonde_vec3, t->node_count);
  uint8_t *kinds = SONDE_NEW(uint8_t, t->node_count);
  sonde_status status = number && node && kinds ? SONDE_OK : sonde_fail_memory(error);
  // What the surface crosses twice between two points leaves nodes on it that are inside.
  for (uint32_t f = 0; f < t->boundary.face_count && !status; ++f)
    for (int c = 0; c < 3; ++c) kinds[t->boundary.faces[f][c]] = 1;
  for (uint32_t i = 0; i < t->node_count && !status; ++i)
    if (!kinds[i]) kind[i] = SONDE_NODE_INSIDE;
  static const uint8_t run[3] = {SONDE_NODE_OUTER, SONDE_NODE_INNER, SONDE_NODE_INSIDE};
  uint32_t count = 0;
  for (int r = 0; r < 3 && !status; ++r) {
    for (uint32_t i = 0; i < t->node_count; ++i)
      if (kind[i] == run[r]) number[i] = count, node[count] = t->node[i], kinds[count++] = run[r];
    if (r == 0) t->surface_count = count;
    if (r == 1) t->held_count = count - t->surface_count;
  }
  if (!status) {
    SONDE_ASSERT(count == t->node_count);
    for (uint32_t k = 0; k < t->count; ++k)
      for (int c = 0; c < 4; ++c) t->corner[k][c] = number[t->corner[k][c]];
    for (uint32_t f = 0; f < t->boundary.face_count; ++f)
      for (int c = 0; c < 3; ++c) t->boundary.faces[f][c] = number[t->boundary.faces[f][c]];
    memcpy(t->node, node, t->node_count * sizeof *node);
    memcpy(kind, kinds, t->node_count);
  }
  sonde_free(number);
  sonde_free(node);
  sonde_free(kinds);
  return status;
}

static sonde_status give_vertices(sonde_tetrahedra *t, sonde_error *error) {
  uint32_t count = t->surface_count + t->held_count;
  sonde_vec3 *vertices = SONDE_NEW(sonde_vec3, count);
  if (!vertices) return sonde_fail_memory(error);
  memcpy(vertices, t->node, count * sizeof *vertices);
  sonde_free(t->boundary.vertices);
  t->boundary.vertices = vertices, t->boundary.vertex_count = count;
  return SONDE_OK;
}

// ---- all of it ----------------------------------------------------------------------------

static sonde_status check_surface(const sonde_mesh *mesh, const char *what, double *volume_m3,
                                  sonde_error *error) {
  sonde_mesh_report report;
  if (mesh->face_count == 0)
    return sonde_fail(error, SONDE_MESH, "the %s surface has no faces", what);
  sonde_status status = sonde_mesh_inspect(mesh, &report, error);
  if (status) return status;
  if (!report.closed)
    return sonde_fail(error, SONDE_MESH,
                      "the %s surface is open (%u edges have one face), expected a closed one",
                      what, report.boundary_edges);
  if (!report.outward)
    return sonde_fail(
        error, SONDE_MESH,
        "the faces of the %s surface run clockwise seen from outside: it encloses %g m3", what,
        report.volume_m3);
  *volume_m3 = report.volume_m3;
  return SONDE_OK;
}

static sonde_status check_def(sonde_tetrahedra_def *def, sonde_error *error) {
  if (def->growth == 0) def->growth = 0.4;
  if (!(def->edge_m > 0) || !isfinite(def->edge_m) || !(def->growth >= 0) || !(def->growth <= 2))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "edge %g m, growth %g: expected a positive length and 0 to 2", def->edge_m,
                      def->growth);
  if (def->fine_count && (!(def->fine_edge_m > 0) || !(def->fine_reach_m >= 0)))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "fine edge %g m, reach %g m: expected positive lengths", def->fine_edge_m,
                      def->fine_reach_m);
  return SONDE_OK;
}

// The lattice with the distances of its points, and the crossings of its edges.
static sonde_status prepare(stuffing *s, const sonde_mesh *outer, const sonde_tetrahedra_def *def,
                            sonde_error *error) {
  sonde_vec3 low = outer->vertices[0], high = low;
  for (uint32_t i = 1; i < outer->vertex_count; ++i) {
    low = v_min(low, outer->vertices[i]);
    high = v_max(high, outer->vertices[i]);
  }
  double finest = def->fine_count ? fmin(def->edge_m, def->fine_edge_m) : def->edge_m;
  const sizing how = {def, s->domain};
  sonde_status status = sonde_lattice_create(low, high, CELL_PER_EDGE * finest, is_too_long, &how,
                                             &s->lattice, error);
  if (status) return status;
  uint32_t points = s->lattice.point_count;
  s->point = SONDE_NEW(sonde_vec3, points);
  s->distance = SONDE_NEW(double, points);
  s->on_inner = SONDE_NEW(bool, points);
  s->node = SONDE_NEW(uint32_t, points);
  if (!s->point || !s->distance || !s->on_inner || !s->node) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < points; ++i) {
    s->point[i] = sonde_lattice_point(&s->lattice, i);
    s->distance[i] = sonde_domain_distance(s->domain, s->point[i], &s->on_inner[i]);
    if (fabs(s->distance[i]) < 1e-9 * def->edge_m) s->distance[i] = 0;
    s->node[i] = UINT32_MAX;
  }
  status = find_crossings(s, error);
  return status ? status : move_near_points(s, error);
}

// Whether the mesh fills what it should: not so when the surface folds or is thinner than cells.
static sonde_status check_filled(const sonde_tetrahedra *t, double wanted_m3, double area_m2,
                                 double edge_m, sonde_error *error) {
  sonde_mesh_report report;
  sonde_status status = sonde_mesh_inspect(&t->boundary, &report, error);
  if (status) return status;
  sonde_tetrahedra_report inside;
  status = sonde_tetrahedra_inspect(t, NULL, NULL, &inside, error);
  if (status) return status;
  if (!(inside.smallest_volume_m3 > 0))
    return sonde_fail(
        error, SONDE_MESH,
        "a tetrahedron is inside out: the surface turns too sharply for edges of %g m", edge_m);
  double off = fabs(report.volume_m3 - wanted_m3);
  if (!report.closed || off > 0.06 * edge_m * area_m2 + 1e-3 * wanted_m3)
    return sonde_fail(error, SONDE_MESH,
                      "the tetrahedra fill %.4g of %.4g m3%s: the surface crosses itself or is "
                      "thinner than edges of %g m resolve",
                      report.volume_m3, wanted_m3, report.closed ? "" : " and touch themselves",
                      edge_m);
  return SONDE_OK;
}

sonde_status sonde_tetrahedralise(const sonde_mesh *outer, const sonde_mesh *inner,
                                  const sonde_tetrahedra_def *wanted, sonde_tetrahedra *t,
                                  sonde_error *error) {
  SONDE_ASSERT(outer != NULL && wanted != NULL && t != NULL);
  *t = (sonde_tetrahedra){0};
  sonde_tetrahedra_def def = *wanted;
  sonde_solid_domain domain = {0};
  stuffing s = {.domain = &domain};
  uint8_t *kind = NULL;
  double volume = 0, hollow = 0;
  sonde_status status = check_def(&def, error);
  if (!status) status = check_surface(outer, "outer", &volume, error);
  if (!status && inner) status = check_surface(inner, "inner", &hollow, error);
  if (!status) status = sonde_surface_index_create(outer, &domain.outer, error);
  if (!status && inner) status = sonde_surface_index_create(inner, &domain.inner, error);
  if (!status) status = prepare(&s, outer, &def, error);
  if (!status) {
    // At most three tetrahedra of one of the lattice.
    size_t nodes = (size_t)s.lattice.point_count + s.crossing_count;
    s.room = 0;
    for (uint32_t k = 0; k < s.lattice.count; ++k) {
      int in = 0;
      for (int c = 0; c < 4; ++c) in += s.distance[s.lattice.corner[k][c]] < 0;
      s.room += in == 0 ? 0 : in == 4 ? 1 : 3;
    }
    t->node = SONDE_NEW(sonde_vec3, nodes);
    t->corner = (uint32_t(*)[4])sonde_calloc(s.room, sizeof *t->corner);
    kind = SONDE_NEW(uint8_t, nodes);
    if (!t->node || !t->corner || !kind) status = sonde_fail_memory(error);
  }
  if (!status) {
    output o = {.s = &s, .t = t, .kind = kind};
    add_all(&o);
    if (t->count == 0)
      status = sonde_fail(error, SONDE_MESH,
                          "no point of the lattice lies inside: the surface is "
                          "thinner than edges of %g m resolve",
                          def.edge_m);
  }
  if (!status) status = find_boundary(t, kind, error);
  if (!status) status = number_nodes(t, kind, error);
  if (!status) status = sonde_tetrahedra_smooth(t, kind, &domain, error);
  if (!status) status = give_vertices(t, error);
  if (!status) {
    sonde_mesh_report report;
    status = sonde_mesh_inspect(outer, &report, error);
    if (!status) status = check_filled(t, volume - hollow, report.area_m2, def.edge_m, error);
  }
  sonde_lattice_clear(&s.lattice);
  sonde_index_map_clear(&s.edges);
  void *parts[] = {s.point, s.distance, s.on_inner, s.node, s.crossing};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  sonde_surface_index_destroy(domain.outer);
  sonde_surface_index_destroy(domain.inner);
  sonde_free(kind);
  if (status) sonde_tetrahedra_clear(t);
  return status;
}

void sonde_tetrahedra_clear(sonde_tetrahedra *t) {
  if (!t) return;
  sonde_free(t->node);
  sonde_free(t->corner);
  sonde_mesh_clear(&t->boundary);
  *t = (sonde_tetrahedra){0};
}
