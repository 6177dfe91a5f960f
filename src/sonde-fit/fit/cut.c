// The skin around a footprint, cut along its sides and its rim.
#include "fit/cut_split.h"

#include "base/maths.h"
#include "tissue/model.h"

#include <string.h>

static const double BEHIND_M = 0.03;    // skin farther along the normal is another side of the leg
static const double FACING = 0.2;       // least cosine between a node's normal and the footprint's
static const double SNAP_M = 5e-5;      // nodes this close to a side lie on it
static const double LONGEST_M = 2.1e-3; // edge near a side
static const double OUTSIDE_M = 4.5e-3, WITHIN_M = 1.5e-3; // what is near
enum { HALVINGS = 6 };
enum { NOWHERE = UINT32_MAX, LONE = UINT32_MAX - 1, KEPT = UINT32_MAX - 2 };

typedef struct cutter {
  const sonde_model *model;
  const sonde_site *site;
  double half_u_m, half_v_m, reach_m;
  uint32_t *vertex_of; // [nodes] vertex of a node, NOWHERE when not kept
  bool *inside;        // [nodes]
  uint32_t inside_count;
  sonde_cut *cut;
} cutter;

// On a round skin of radius R the chord R sin(angle) seen along the normal spans the arc R angle.
static double along_skin(double chord_m, double sine, double cosine) {
  double angle = atan2(sine, cosine);
  return fabs(angle) < 1e-3 ? chord_m : chord_m * angle / sin(angle);
}

static bool wrapped(const cutter *c, uint32_t node, sonde_pad_place *p) {
  const sonde_site *site = c->site;
  sonde_vec3 d = v_sub(c->model->surface.vertices[node], site->position_m);
  sonde_vec3 normal = c->model->normal[node];
  double facing = v_dot(normal, site->normal);
  if (facing < FACING || fabs(v_dot(d, site->normal)) > BEHIND_M) return false;
  p->u_m = along_skin(v_dot(d, site->u), v_dot(normal, site->u), facing);
  p->v_m = along_skin(v_dot(d, site->v), v_dot(normal, site->v), facing);
  return true;
}

static bool is_kept(const cutter *c, uint32_t face) {
  const uint32_t *v = c->model->surface.faces[face];
  return c->vertex_of[v[0]] != NOWHERE && c->vertex_of[v[1]] != NOWHERE &&
         c->vertex_of[v[2]] != NOWHERE;
}

// Distance to the footprint's sides, negative under it.
static double beyond(const sonde_cutter *c, uint32_t vertex) {
  const sonde_pad_place *p = &c->place[vertex];
  return fmax(fabs(p->u_m) - c->half_u_m, fabs(p->v_m) - c->half_v_m);
}

static bool is_near(const sonde_cutter *c, uint32_t vertex) {
  double distance = beyond(c, vertex);
  return distance < OUTSIDE_M && distance > -WITHIN_M;
}

static double too_long(const sonde_cutter *c, int which, uint32_t a, uint32_t b) {
  (void)which;
  double side = beyond(c, a) * beyond(c, b);
  if (!is_near(c, a) && !is_near(c, b) && !(side < 0)) return 0;
  sonde_vec3 x = sonde_cut_point(c->model, c->cut, a), y = sonde_cut_point(c->model, c->cut, b);
  return v_distance(x, y) > LONGEST_M ? 0.5 : 0;
}

// Side `which`: +u, -u, +v, -v. It runs on beyond the corners, so that the next one meets it there.
static double crossing(const sonde_cutter *c, int which, uint32_t a, uint32_t b) {
  sonde_pad_place p = c->place[a], q = c->place[b];
  double sign = which & 1 ? -1 : 1, half = which < 2 ? c->half_u_m : c->half_v_m;
  double from = sign * (which < 2 ? p.u_m : p.v_m) - half;
  double to = sign * (which < 2 ? q.u_m : q.v_m) - half;
  bool crosses = fmin(from, to) < -SNAP_M && fmax(from, to) > SNAP_M;
  if (!crosses) return 0;
  double share = from / (from - to);
  double along = which < 2 ? p.v_m + share * (q.v_m - p.v_m) : p.u_m + share * (q.u_m - p.u_m);
  return fabs(along) <= (which < 2 ? c->half_v_m : c->half_u_m) + LONGEST_M ? share : 0;
}

static sonde_status fill(cutter *c, sonde_error *error) {
  sonde_cut *cut = c->cut;
  const sonde_mesh *skin = &c->model->surface;
  const sonde_topology *t = &c->model->topology;
  sonde_cutter at = {c->model, c->half_u_m, c->half_v_m, NULL, cut};
  cut->parent = sonde_calloc(cut->node_count, sizeof *cut->parent);
  cut->share = sonde_calloc(cut->node_count, sizeof *cut->share);
  cut->rim_m = SONDE_NEW(double, cut->node_count);
  cut->face = sonde_calloc(skin->face_count, sizeof *cut->face);
  at.place = SONDE_NEW(sonde_pad_place, cut->node_count);
  if (!cut->parent || !cut->share || !cut->rim_m || !cut->face || !at.place) {
    sonde_free(at.place);
    return sonde_fail_memory(error);
  }
  // The kept skin as it is.
  cut->vertex_count = cut->node_count;
  for (uint32_t i = 0; i < skin->vertex_count; ++i) {
    uint32_t v = c->vertex_of[i];
    if (v == NOWHERE) continue;
    for (int k = 0; k < 3; ++k) cut->parent[v][k] = i;
    cut->share[v][0] = 1;
    if (!wrapped(c, i, &at.place[v])) at.place[v] = (sonde_pad_place){NAN, NAN};
  }
  for (uint32_t f = 0; f < skin->face_count; ++f) {
    if (!is_kept(c, f)) continue;
    for (int k = 0; k < 3; ++k) cut->face[cut->face_count][k] = c->vertex_of[skin->faces[f][k]];
    ++cut->face_count;
  }
  // The length of rim at each vertex, and the mean length of the edges under the footprint.
  double sum = 0, count = 0;
  for (uint32_t e = 0; e < t->edge_count; ++e) {
    const uint32_t *end = t->edges[e], *of = t->edge_faces[e];
    double rest_m = c->model->edge_rest_m[e];
    if (c->inside[end[0]] || c->inside[end[1]]) sum += rest_m, ++count;
    if (of[0] == UINT32_MAX || of[1] == UINT32_MAX || is_kept(c, of[0]) == is_kept(c, of[1]))
      continue;
    for (int k = 0; k < 2; ++k) cut->rim_m[c->vertex_of[end[k]]] += 0.5 * rest_m;
  }
  cut->coarse = sum > 0.75 * 2 * fmin(c->half_u_m, c->half_v_m) * count;
  // Long edges near the sides are halved first, then the four sides are cut.
  uint32_t added = 1;
  sonde_status status = SONDE_OK;
  for (int k = 0; k < HALVINGS && added && !status; ++k)
    status = sonde_cut_split(&at, too_long, k, &added, error);
  for (int side = 0; side < 4 && !status; ++side)
    status = sonde_cut_split(&at, crossing, side, &added, error);
  if (!status && !(cut->held = SONDE_NEW(bool, cut->vertex_count)))
    status = sonde_fail_memory(error);
  for (uint32_t v = 0; v < cut->vertex_count && !status; ++v) {
    cut->held[v] = beyond(&at, v) <= 1.001 * SNAP_M;
    cut->held_count += cut->held[v];
  }
  sonde_free(at.place);
  return status;
}

sonde_status sonde_cut_create(const sonde_model *model, const sonde_site *site, double half_u_m,
                              double half_v_m, double reach_m, sonde_cut *cut, sonde_error *error) {
  SONDE_ASSERT(half_u_m > 0 && half_v_m > 0 && reach_m > 0);
  *cut = (sonde_cut){0};
  uint32_t nodes = model->surface.vertex_count;
  cutter c = {.model = model,
              .site = site,
              .half_u_m = half_u_m,
              .half_v_m = half_v_m,
              .reach_m = reach_m,
              .vertex_of = SONDE_NEW(uint32_t, nodes),
              .inside = SONDE_NEW(bool, nodes),
              .cut = cut};
  sonde_status status = c.vertex_of && c.inside ? SONDE_OK : sonde_fail_memory(error);
  // Nodes under the footprint; the nearest one when there is none.
  uint32_t nearest = NOWHERE;
  double least = INFINITY;
  for (uint32_t i = 0; i < nodes && !status; ++i) {
    sonde_pad_place p;
    if (!wrapped(&c, i, &p)) continue;
    c.inside[i] = fmax(fabs(p.u_m) - half_u_m, fabs(p.v_m) - half_v_m) <= SNAP_M;
    c.inside_count += c.inside[i];
    double distance = hypot(p.u_m, p.v_m);
    if (distance < least) {
      least = distance;
      nearest = i;
    }
  }
  if (!c.inside_count && nearest != NOWHERE) {
    c.inside[nearest] = true;
    c.inside_count = 1;
  }
  if (!status && !c.inside_count)
    status = sonde_fail(error, SONDE_MISMATCH,
                        "site %u: no skin within %.0f mm under its footprint: sites and surface do "
                        "not belong together",
                        site->id, BEHIND_M * 1e3);
  if (!status) {
    uint32_t total = c.model->surface.vertex_count, count = 0;
    const sonde_vec3 *x = c.model->surface.vertices;
    sonde_vec3 *pad = SONDE_NEW(sonde_vec3, c.inside_count);
    if (!pad)
      status = sonde_fail_memory(error);
    else {
      for (uint32_t i = 0; i < total; ++i)
        if (c.inside[i]) pad[count++] = x[i];
      SONDE_ASSERT(count == c.inside_count);
      double reach2 = c.reach_m * c.reach_m;
      double far = c.reach_m + 2 * (c.half_u_m + c.half_v_m);
      for (uint32_t i = 0; i < total; ++i) {
        bool near = c.inside[i] || !isfinite(c.reach_m);
        bool worth = !near && v_norm2(v_sub(x[i], c.site->position_m)) <= far * far;
        for (uint32_t k = 0; k < count && worth && !near; ++k)
          near = v_norm2(v_sub(x[i], pad[k])) <= reach2;
        c.vertex_of[i] = near ? LONE : NOWHERE;
      }
      sonde_free(pad);
      // Nodes of faces that are kept whole, in order; others would hang free.
      const sonde_mesh *skin = &c.model->surface;
      for (uint32_t f = 0; f < skin->face_count; ++f)
        for (int k = 0; k < 3 && is_kept(&c, f); ++k) c.vertex_of[skin->faces[f][k]] = KEPT;
      for (uint32_t i = 0; i < total; ++i)
        c.vertex_of[i] = c.vertex_of[i] == KEPT ? c.cut->node_count++ : NOWHERE;
    }
  }
  if (!status) status = fill(&c, error);
  sonde_free(c.vertex_of);
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

static sonde_vec3 mean_of(const sonde_vec3 *x, const sonde_cut *cut, uint32_t vertex) {
  sonde_vec3 sum = vec3(0, 0, 0);
  for (int k = 0; k < 3; ++k) sum = v_madd(sum, cut->share[vertex][k], x[cut->parent[vertex][k]]);
  return sum;
}

sonde_vec3 sonde_cut_point(const sonde_model *model, const sonde_cut *cut, uint32_t vertex) {
  SONDE_ASSERT(vertex < cut->vertex_count || vertex >= cut->node_count);
  return mean_of(model->surface.vertices, cut, vertex);
}

sonde_vec3 sonde_cut_normal(const sonde_model *model, const sonde_cut *cut, uint32_t vertex) {
  sonde_vec3 first = model->normal[cut->parent[vertex][0]];
  if (vertex < cut->node_count) return first;
  return v_unit(mean_of(model->normal, cut, vertex), first);
}
