// The nodes that a cut runs through: from a path of points on the skin to a chain of nodes joined
// by edges (docs/cutting.md).
//
// Points close to the line between others are dropped, the others go to their nearest nodes.
// Between two of them Dijkstra's search finds the cheapest chain of edges, where it is dear to go
// far from the plane of the path. Nodes that earlier cuts made out of one count as one for the
// search.
#include "base/base.h"
#include "base/maths.h"
#include "tissue/live_cut.h"

#include <string.h>

enum { NONE = UINT32_MAX, MOST_POINTS = 1024 };
static const double THIN_M = 1e-3;     // half a fine edge is 1.5 mm
static const double OFF_SKIN_M = 3e-3; // beside what the size of the faces explains

/* ---- coincident nodes --------------------------------------------------------------------- */

typedef struct lip {
  sonde_vec3 at;
  uint32_t node;
} lip;

static int compare_lips(const void *a, const void *b) {
  const lip *p = a, *q = b;
  if (p->at.x != q->at.x) return p->at.x < q->at.x ? -1 : 1;
  if (p->at.y != q->at.y) return p->at.y < q->at.y ? -1 : 1;
  if (p->at.z != q->at.z) return p->at.z < q->at.z ? -1 : 1;
  return p->node < q->node ? -1 : p->node > q->node;
}

sonde_status sonde_copies_find(const sonde_model *model, sonde_copies *copies, sonde_error *error) {
  const sonde_topology *topology = &model->topology;
  uint32_t n = model->surface.vertex_count, count = 0;
  *copies = (sonde_copies){SONDE_NEW(uint32_t, n), SONDE_NEW(uint32_t, n)};
  lip *lips = SONDE_NEW(lip, n);
  uint8_t *is_lip = SONDE_NEW(uint8_t, n);
  if (!copies->first || !copies->next || !lips || !is_lip) {
    sonde_free(lips);
    sonde_free(is_lip);
    sonde_copies_clear(copies);
    return sonde_fail_memory(error);
  }
  // Nodes beside an edge with one face, sorted by rest position.
  for (uint32_t e = 0; e < topology->edge_count; ++e)
    for (int k = 0; k < 2 && topology->edge_faces[e][1] == NONE; ++k)
      is_lip[topology->edges[e][k]] = 1;
  for (uint32_t i = 0; i < n; ++i) {
    if (is_lip[i]) lips[count++] = (lip){model->surface.vertices[i], i};
    copies->first[i] = i;
    copies->next[i] = NONE;
  }
  qsort(lips, count, sizeof *lips, compare_lips);
  for (uint32_t k = 1; k < count; ++k) {
    if (v_distance(lips[k - 1].at, lips[k].at) > 0) continue;
    SONDE_ASSERT(lips[k - 1].node < lips[k].node);
    copies->first[lips[k].node] = copies->first[lips[k - 1].node];
    copies->next[lips[k - 1].node] = lips[k].node;
  }
  sonde_free(lips);
  sonde_free(is_lip);
  return SONDE_OK;
}

void sonde_copies_clear(sonde_copies *copies) {
  sonde_free(copies->first);
  sonde_free(copies->next);
  *copies = (sonde_copies){0};
}

sonde_status sonde_skin_closes(const sonde_model *model, bool *closes, sonde_error *error) {
  *closes = false;
  sonde_copies copies;
  sonde_mesh closed = {0};
  sonde_mesh_report report = {0};
  sonde_status status = sonde_copies_find(model, &copies, error);
  if (status) return status;
  status = sonde_mesh_copy(&model->surface, &closed, error);
  for (uint32_t f = 0; f < closed.face_count; ++f)
    for (int k = 0; k < 3; ++k) closed.faces[f][k] = copies.first[closed.faces[f][k]];
  if (!status) status = sonde_mesh_inspect(&closed, &report, error);
  *closes = report.closed;
  sonde_mesh_clear(&closed);
  sonde_copies_clear(&copies);
  return status;
}

/* ---- search ------------------------------------------------------------------------------- */

typedef struct heap_entry {
  double cost;
  uint32_t node;
} heap_entry;

// Nodes are the first ones of their copies.
typedef struct search {
  const sonde_model *model;
  const sonde_copies *copies;
  const sonde_vec3 *position;
  sonde_vec3 on_plane, across; // the plane through a leg of the path, upright on the skin
  double *cost;                // [nodes] INFINITY when not reached
  uint32_t *from;              // [nodes] next node towards the end of the leg
  uint32_t *reached;           // [nodes]
  uint32_t reached_count;
  heap_entry *heap; // [2 * edges + 1]: each side of an edge is relaxed once
  uint32_t heap_count;
  sonde_cut_path *path;
} search;

// Binary heap by cost, equal costs by node.
static bool before(const heap_entry *a, const heap_entry *b) {
  return a->cost < b->cost || (a->cost == b->cost && a->node < b->node);
}

static void reach(search *s, uint32_t node, double cost, uint32_t from) {
  SONDE_ASSERT(s->heap_count <= 2 * s->model->topology.edge_count && cost >= 0);
  if (isinf(s->cost[node])) s->reached[s->reached_count++] = node;
  s->cost[node] = cost;
  s->from[node] = from;
  heap_entry entry = {cost, node};
  uint32_t at = s->heap_count++;
  for (; at > 0 && before(&entry, &s->heap[(at - 1) / 2]); at = (at - 1) / 2)
    s->heap[at] = s->heap[(at - 1) / 2];
  s->heap[at] = entry;
}

// Dijkstra's search from the end of a leg back to its start: afterwards from[] leads from `start`
// to `end`. False when they do not hang together.
static bool find_leg(search *s, uint32_t start, uint32_t end) {
  SONDE_ASSERT(s->copies->first[start] == start && s->copies->first[end] == end);
  const sonde_topology *topology = &s->model->topology;
  for (uint32_t k = 0; k < s->reached_count; ++k) s->cost[s->reached[k]] = INFINITY;
  s->reached_count = s->heap_count = 0;
  reach(s, end, 0, NONE);
  while (s->heap_count > 0) {
    heap_entry at = s->heap[0], last = s->heap[--s->heap_count];
    uint32_t hole = 0;
    for (uint32_t child; (child = 2 * hole + 1) < s->heap_count; hole = child) {
      if (child + 1 < s->heap_count && before(&s->heap[child + 1], &s->heap[child])) ++child;
      if (!before(&s->heap[child], &last)) break;
      s->heap[hole] = s->heap[child];
    }
    s->heap[hole] = last;
    if (at.cost > s->cost[at.node]) continue;
    if (at.node == start) return true;
    // Neighbours are those of all copies: a cut may cross an earlier one. An edge costs its length
    // l times 1 + 2 (d1^2 + d2^2)/l^2 with the distances of its ends from the plane: twice its
    // length when both ends are half an edge away.
    sonde_vec3 a = s->position[at.node];
    double d1 = v_dot(s->across, v_sub(a, s->on_plane));
    for (uint32_t i = at.node; i != NONE; i = s->copies->next[i])
      for (uint32_t k = topology->start[i]; k < topology->start[i + 1]; ++k) {
        uint32_t to = s->copies->first[topology->neighbour[k]];
        SONDE_ASSERT(to != at.node); // no edge joins two copies
        double length = fmax(v_distance(a, s->position[to]), 1e-6);
        double d2 = v_dot(s->across, v_sub(s->position[to], s->on_plane));
        double cost = s->cost[at.node] + length + 2 * (d1 * d1 + d2 * d2) / length;
        s->path->work++;
        if (cost < s->cost[to]) reach(s, to, cost, at.node);
      }
  }
  return false;
}

// Chain of nodes from point to point, the point after the other.
static sonde_status follow(search *s, const sonde_vec3 *point, const uint32_t *kept, uint32_t count,
                           sonde_error *error) {
  const sonde_topology *topology = &s->model->topology;
  sonde_cut_path *path = s->path;
  uint32_t room = 0, last = NONE;
  for (uint32_t k = 0; k < count; ++k) {
    // No point of a face is farther from its nearest corner than 0.58 of its edge when all are
    // equal; slim faces get what OFF_SKIN_M leaves.
    sonde_vec3 p = point[kept[k]];
    uint32_t node = v_nearest(s->position, topology->vertex_count, p);
    double longest = 0, away = v_distance(s->position[node], p);
    for (uint32_t e = topology->start[node]; e < topology->start[node + 1]; ++e)
      longest = fmax(longest, v_distance(s->position[node], s->position[topology->neighbour[e]]));
    double limit = OFF_SKIN_M + 0.6 * longest;
    if (away > limit)
      return sonde_fail(
          error, SONDE_ARGUMENT,
          "point %u of the cut, (%.1f, %.1f, %.1f) mm, lies %.1f mm from the nearest node "
          "of the skin, expected at most %.1f mm",
          kept[k], p.x * 1e3, p.y * 1e3, p.z * 1e3, away * 1e3, limit * 1e3);

    // The plane of a leg goes through both points and the mean of the normals there.
    if (k > 0) {
      sonde_vec3 n1 = s->model->normal[last], n2 = s->model->normal[node];
      if (v_dot(n1, n2) < 0)
        return sonde_fail(
            error, SONDE_ARGUMENT,
            "points %u and %u of the cut lie on different sides of the skin, expected "
            "more points between them",
            kept[k - 1], kept[k]);
      s->on_plane = point[kept[k - 1]];
      s->across = v_unit(v_cross(v_sub(p, s->on_plane), v_add(n1, n2)), vec3(0, 0, 0));
    }
    uint32_t end = s->copies->first[node], start = k > 0 ? s->copies->first[last] : end;
    if (!find_leg(s, start, end))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "points %u and %u of the cut lie on parts of the skin that do not hang "
                        "together",
                        kept[k - 1], kept[k]);

    // The leg's nodes behind those found before; a step back along the edge just taken undoes it.
    if (path->count + s->reached_count > room) {
      uint32_t next = 2 * (path->count + s->reached_count);
      uint32_t *list =
          sonde_realloc(path->node, room * sizeof *path->node, next * sizeof *path->node);
      if (!list) return sonde_fail_memory(error);
      path->node = list;
      room = next;
    }
    for (uint32_t at = start; at != NONE; at = s->from[at]) {
      if (path->count >= 1 && path->node[path->count - 1] == at) continue;
      if (path->count >= 2 && path->node[path->count - 2] == at)
        path->count--;
      else
        path->node[path->count++] = at;
    }
    last = node;
  }
  return SONDE_OK;
}

// Whether all points between two stay within THIN_M of the segment that joins them.
static bool is_straight(const sonde_vec3 *path, uint32_t from, uint32_t to) {
  SONDE_ASSERT(from < to);
  sonde_vec3 a = path[from], d = v_sub(path[to], a);
  double length2 = v_norm2(d);
  for (uint32_t k = from + 1; k < to; ++k) {
    double t = length2 > 0 ? clamp(v_dot(v_sub(path[k], a), d) / length2, 0, 1) : 0;
    if (v_distance(path[k], v_madd(a, t, d)) > THIN_M) return false;
  }
  return true;
}

sonde_status sonde_cut_path_find(const sonde_model *model, const sonde_copies *copies,
                                 const sonde_vec3 *position, const sonde_vec3 *point,
                                 uint32_t count, sonde_cut_path *path, sonde_error *error) {
  *path = (sonde_cut_path){0};
  if (count < 2 || count > MOST_POINTS)
    return sonde_fail(error, SONDE_ARGUMENT, "the cut has %u points, expected 2 to %d", count,
                      MOST_POINTS);
  for (uint32_t k = 0; k < count; ++k)
    if (!v_finite(point[k]))
      return sonde_fail(error, SONDE_ARGUMENT, "point %u of the cut is not finite", k);
  uint32_t n = model->surface.vertex_count;
  uint32_t *kept = SONDE_NEW(uint32_t, count);
  uint8_t *seen = SONDE_NEW(uint8_t, n);
  search s = {.model = model, .copies = copies, .position = position, .path = path};
  s.cost = SONDE_NEW(double, n);
  s.from = SONDE_NEW(uint32_t, n);
  s.reached = SONDE_NEW(uint32_t, n);
  s.heap = SONDE_NEW(heap_entry, 2 * (size_t)model->topology.edge_count + 1);
  sonde_status status = SONDE_OK;
  if (kept && seen && s.cost && s.from && s.reached && s.heap) {
    for (uint32_t i = 0; i < n; ++i) s.cost[i] = INFINITY;
    // indices of the points that do not lie on the straight line between others
    uint32_t used = 1;
    for (uint32_t from = 0, to; from + 1 < count; from = kept[used++] = to)
      for (to = from + 1; to + 1 < count && is_straight(point, from, to + 1);) ++to;
    status = follow(&s, point, kept, used, error);

    // The repeated first node goes off a closed path; no node may come twice.
    if (!status) {
      path->closed = path->count > 3 && path->node[0] == path->node[path->count - 1];
      path->count -= path->closed;
      if (path->count < 3)
        status = sonde_fail(error, SONDE_ARGUMENT,
                            "the cut follows %u edges of the skin, expected a path along 2 or more",
                            path->count ? path->count - 1 : 0);
    }
    for (uint32_t k = 0; !status && k < path->count; ++k) {
      sonde_vec3 x = model->surface.vertices[path->node[k]];
      if (seen[path->node[k]]++)
        status =
            sonde_fail(error, SONDE_ARGUMENT,
                       "the cut crosses or touches itself at (%.1f, %.1f, %.1f) mm, expected a "
                       "simple path",
                       x.x * 1e3, x.y * 1e3, x.z * 1e3);
    }
  } else {
    status = sonde_fail_memory(error);
  }
  sonde_free(kept);
  sonde_free(seen);
  sonde_free(s.cost);
  sonde_free(s.from);
  sonde_free(s.reached);
  sonde_free(s.heap);
  if (!status) return SONDE_OK;
  sonde_free(path->node);
  *path = (sonde_cut_path){0};
  return status;
}
