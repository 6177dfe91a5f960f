// wrapped:       coordinates of a node in the footprint's axes, measured along the skin.
// mark_inside:   nodes under the footprint, or the nearest one on a coarse mesh.
// keep_nodes:    nodes within reach of them, with whole faces.
// cut_vertex:    the point where a side crosses an edge, made once per edge.
// add_face:      a face whole, or its parts inside and outside.
// is_coarse:     whether the mesh can carry the footprint.
// add_rim:       lengths of the border beyond which the skin is left out.
#include "fit/cut.h"

#include "base/maths.h"
#include "tissue/model.h"

#include <string.h>

static const double BEHIND_M = 0.03; // skin farther along the normal is another side of the leg
static const double FACING = 0.2;    // least cosine between a node's normal and the footprint's
static const double SNAP_M = 5e-5;   // nodes this close to a side lie on it
static const double LEAST_SHARE = 0.02, MOST_SHARE = 0.98;
enum { NOWHERE = UINT32_MAX, LONE = UINT32_MAX - 1, KEPT = UINT32_MAX - 2 };

typedef struct plane_point {
  double u, v;
} plane_point;

typedef struct cutter {
  const sonde_model *model;
  const sonde_site *site;
  double half_u_m, half_v_m, reach_m;
  uint32_t *vertex_of; // [nodes] vertex of a node, NOWHERE when not kept
  uint32_t *on_edge;   // [edges] vertex on an edge, NOWHERE when none yet
  bool *inside;        // [nodes]
  uint32_t inside_count;
  sonde_cut *cut;
} cutter;

// On a round skin of radius R the chord R sin(angle) seen along the normal spans the arc R angle.
static double along_skin(double chord_m, double sine, double cosine) {
  double angle = atan2(sine, cosine);
  return fabs(angle) < 1e-3 ? chord_m : chord_m * angle / sin(angle);
}

static bool wrapped(const cutter *c, uint32_t node, plane_point *p) {
  const sonde_site *site = c->site;
  sonde_vec3 d = v_sub(c->model->surface.vertices[node], site->position_m);
  sonde_vec3 normal = c->model->normal[node];
  double facing = v_dot(normal, site->normal);
  if (facing < FACING || fabs(v_dot(d, site->normal)) > BEHIND_M) return false;
  p->u = along_skin(v_dot(d, site->u), v_dot(normal, site->u), facing);
  p->v = along_skin(v_dot(d, site->v), v_dot(normal, site->v), facing);
  return true;
}

static void mark_inside(cutter *c) {
  uint32_t nearest = NOWHERE;
  double least = INFINITY;
  for (uint32_t i = 0; i < c->model->surface.vertex_count; ++i) {
    plane_point p;
    if (!wrapped(c, i, &p)) continue;
    double beyond = fmax(fabs(p.u) - c->half_u_m, fabs(p.v) - c->half_v_m);
    c->inside[i] = beyond <= SNAP_M;
    c->inside_count += c->inside[i];
    double distance = hypot(p.u, p.v);
    if (distance < least) {
      least = distance;
      nearest = i;
    }
  }
  c->cut->single = c->inside_count == 0;
  if (!c->cut->single || nearest == NOWHERE) return;
  c->inside[nearest] = true;
  c->inside_count = 1;
}

static bool is_kept(const cutter *c, uint32_t face) {
  const uint32_t *v = c->model->surface.faces[face];
  return c->vertex_of[v[0]] != NOWHERE && c->vertex_of[v[1]] != NOWHERE &&
         c->vertex_of[v[2]] != NOWHERE;
}

// Nodes of faces that are kept whole, in order; others would hang free.
static void number_nodes(cutter *c) {
  const sonde_mesh *skin = &c->model->surface;
  for (uint32_t f = 0; f < skin->face_count; ++f)
    for (int k = 0; k < 3 && is_kept(c, f); ++k) c->vertex_of[skin->faces[f][k]] = KEPT;
  for (uint32_t i = 0; i < skin->vertex_count; ++i)
    c->vertex_of[i] = c->vertex_of[i] == KEPT ? c->cut->node_count++ : NOWHERE;
}

static sonde_status keep_nodes(cutter *c, sonde_error *error) {
  uint32_t nodes = c->model->surface.vertex_count, count = 0;
  const sonde_vec3 *x = c->model->surface.vertices;
  sonde_vec3 *pad = SONDE_NEW(sonde_vec3, c->inside_count);
  if (!pad) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < nodes; ++i)
    if (c->inside[i]) pad[count++] = x[i];
  SONDE_ASSERT(count == c->inside_count);
  double reach2 = c->reach_m * c->reach_m;
  double far = c->reach_m + 2 * (c->half_u_m + c->half_v_m);
  for (uint32_t i = 0; i < nodes; ++i) {
    bool near = c->inside[i] || !isfinite(c->reach_m);
    bool worth = !near && v_norm2(v_sub(x[i], c->site->position_m)) <= far * far;
    for (uint32_t k = 0; k < count && worth && !near; ++k)
      near = v_norm2(v_sub(x[i], pad[k])) <= reach2;
    c->vertex_of[i] = near ? LONE : NOWHERE;
  }
  sonde_free(pad);
  number_nodes(c);
  return SONDE_OK;
}

// Where the straight line between the coordinates of both ends leaves the footprint.
static double leaving_share(const cutter *c, uint32_t in, uint32_t out) {
  plane_point a = {0, 0}, b = {0, 0};
  double share = 1;
  if (!wrapped(c, in, &a) || !wrapped(c, out, &b)) return MOST_SHARE;
  if (fabs(b.u) > c->half_u_m)
    share = fmin(share, (copysign(c->half_u_m, b.u) - a.u) / (b.u - a.u));
  if (fabs(b.v) > c->half_v_m)
    share = fmin(share, (copysign(c->half_v_m, b.v) - a.v) / (b.v - a.v));
  return clamp(share, LEAST_SHARE, MOST_SHARE);
}

static uint32_t cut_vertex(cutter *c, uint32_t edge) {
  const uint32_t *end = c->model->topology.edges[edge];
  uint32_t in = c->inside[end[0]] ? end[0] : end[1], out = c->inside[end[0]] ? end[1] : end[0];
  SONDE_ASSERT(c->inside[in] && !c->inside[out]);
  if (c->on_edge[edge] != NOWHERE) return c->on_edge[edge];
  sonde_cut *cut = c->cut;
  uint32_t at = cut->vertex_count++;
  cut->parent[at][0] = in;
  cut->parent[at][1] = out;
  cut->share[at] = leaving_share(c, in, out);
  cut->held[at] = true;
  return c->on_edge[edge] = at;
}

static void put_face(sonde_cut *cut, uint32_t a, uint32_t b, uint32_t d) {
  SONDE_ASSERT(a != b && b != d && d != a);
  cut->face[cut->face_count][0] = a;
  cut->face[cut->face_count][1] = b;
  cut->face[cut->face_count++][2] = d;
}

// The quadrilateral (p, b, d, q) halved along its shorter diagonal.
static void put_quadrilateral(const cutter *c, uint32_t p, uint32_t b, uint32_t d, uint32_t q) {
  sonde_vec3 x[4] = {sonde_cut_point(c->model, c->cut, p), sonde_cut_point(c->model, c->cut, b),
                     sonde_cut_point(c->model, c->cut, d), sonde_cut_point(c->model, c->cut, q)};
  bool by_pd = v_distance(x[0], x[2]) <= v_distance(x[1], x[3]);
  put_face(c->cut, p, b, by_pd ? d : q);
  if (by_pd)
    put_face(c->cut, p, d, q);
  else
    put_face(c->cut, b, d, q);
}

static void add_face(cutter *c, uint32_t face) {
  const uint32_t *node = c->model->surface.faces[face], *edge = c->model->face_edge[face];
  uint32_t v[3], within = 0, first = 0;
  if (!is_kept(c, face)) return;
  for (int k = 0; k < 3; ++k) {
    v[k] = c->vertex_of[node[k]];
    within += c->inside[node[k]];
  }
  if (within == 0 || within == 3 || c->cut->single) {
    put_face(c->cut, v[0], v[1], v[2]);
    return;
  }
  // first: the corner that is alone on its side; the others follow in order.
  while (c->inside[node[first]] != (within == 1)) ++first;
  uint32_t a = first, b = (first + 1) % 3, d = (first + 2) % 3;
  uint32_t p = cut_vertex(c, edge[d]), q = cut_vertex(c, edge[b]); // edges ab and ad
  put_face(c->cut, v[a], p, q);
  put_quadrilateral(c, p, v[b], v[d], q);
}

static bool is_coarse(const cutter *c) {
  const sonde_topology *t = &c->model->topology;
  double sum = 0, count = 0;
  for (uint32_t e = 0; e < t->edge_count; ++e) {
    if (!c->inside[t->edges[e][0]] && !c->inside[t->edges[e][1]]) continue;
    sum += c->model->edge_rest_m[e];
    ++count;
  }
  return sum > 0.75 * 2 * fmin(c->half_u_m, c->half_v_m) * count;
}

static void add_rim(cutter *c) {
  const sonde_topology *t = &c->model->topology;
  for (uint32_t e = 0; e < t->edge_count; ++e) {
    uint32_t left = t->edge_faces[e][0], right = t->edge_faces[e][1];
    if (left == UINT32_MAX || right == UINT32_MAX || is_kept(c, left) == is_kept(c, right))
      continue;
    for (int k = 0; k < 2; ++k)
      c->cut->rim_m[c->vertex_of[t->edges[e][k]]] += 0.5 * c->model->edge_rest_m[e];
  }
}

static bool allocate(cutter *c) {
  const sonde_model *m = c->model;
  uint32_t crossing = 0;
  for (uint32_t e = 0; e < m->topology.edge_count; ++e)
    crossing += c->inside[m->topology.edges[e][0]] != c->inside[m->topology.edges[e][1]];
  size_t room = (size_t)c->cut->node_count + crossing;
  c->on_edge = SONDE_NEW(uint32_t, m->topology.edge_count);
  c->cut->parent = sonde_calloc(room, sizeof *c->cut->parent);
  c->cut->share = SONDE_NEW(double, room);
  c->cut->held = SONDE_NEW(bool, room);
  c->cut->rim_m = SONDE_NEW(double, room);
  c->cut->face =
      sonde_calloc((size_t)m->surface.face_count + 2 * (size_t)crossing, sizeof *c->cut->face);
  return c->on_edge && c->cut->parent && c->cut->share && c->cut->held && c->cut->rim_m &&
         c->cut->face;
}

static void fill(cutter *c) {
  sonde_cut *cut = c->cut;
  const sonde_mesh *skin = &c->model->surface;
  for (uint32_t e = 0; e < c->model->topology.edge_count; ++e) c->on_edge[e] = NOWHERE;
  cut->vertex_count = cut->node_count;
  for (uint32_t i = 0; i < skin->vertex_count; ++i) {
    uint32_t v = c->vertex_of[i];
    if (v == NOWHERE) continue;
    cut->parent[v][0] = cut->parent[v][1] = i;
    cut->held[v] = c->inside[i];
  }
  for (uint32_t f = 0; f < skin->face_count; ++f) add_face(c, f);
  for (uint32_t v = 0; v < cut->vertex_count; ++v) cut->held_count += cut->held[v];
  add_rim(c);
  cut->coarse = is_coarse(c);
}

sonde_status sonde_cut_create(const sonde_model *model, const sonde_site *site, double half_u_m,
                              double half_v_m, double reach_m, sonde_cut *cut, sonde_error *error) {
  SONDE_ASSERT(half_u_m > 0 && half_v_m > 0 && reach_m > 0);
  *cut = (sonde_cut){0};
  uint32_t nodes = model->surface.vertex_count;
  cutter c = {model,    site,
              half_u_m, half_v_m,
              reach_m,  SONDE_NEW(uint32_t, nodes),
              NULL,     SONDE_NEW(bool, nodes),
              0,        cut};
  sonde_status status = c.vertex_of && c.inside ? SONDE_OK : sonde_fail_memory(error);
  if (!status) mark_inside(&c);
  if (!status && !c.inside_count)
    status = sonde_fail(error, SONDE_MISMATCH,
                        "site %u: no skin within %.0f mm under its footprint: sites and surface do "
                        "not belong together",
                        site->id, BEHIND_M * 1e3);
  if (!status) status = keep_nodes(&c, error);
  if (!status && !allocate(&c)) status = sonde_fail_memory(error);
  if (!status) fill(&c);
  sonde_free(c.vertex_of);
  sonde_free(c.on_edge);
  sonde_free(c.inside);
  if (status) sonde_cut_clear(cut);
  return status;
}

void sonde_cut_clear(sonde_cut *cut) {
  sonde_free(cut->parent);
  sonde_free(cut->share);
  sonde_free(cut->held);
  sonde_free(cut->rim_m);
  sonde_free(cut->face);
  *cut = (sonde_cut){0};
}

sonde_vec3 sonde_cut_point(const sonde_model *model, const sonde_cut *cut, uint32_t vertex) {
  const sonde_vec3 *x = model->surface.vertices;
  return v_lerp(x[cut->parent[vertex][0]], x[cut->parent[vertex][1]], cut->share[vertex]);
}

sonde_vec3 sonde_cut_normal(const sonde_model *model, const sonde_cut *cut, uint32_t vertex) {
  const uint32_t *parent = cut->parent[vertex];
  sonde_vec3 first = model->normal[parent[0]];
  if (parent[0] == parent[1]) return first;
  return v_unit(v_lerp(first, model->normal[parent[1]], cut->share[vertex]), first);
}
