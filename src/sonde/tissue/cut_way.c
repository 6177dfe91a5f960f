// The way of a cut: from a path of points on the skin to a chain of nodes joined by edges.
// find_lips:     nodes beside an open edge, sorted by rest position.
// places_find:   copies of a node, made by earlier cuts, share a place.
// skin_closes:   the mesh of places is closed.
// thin_path:     drops points that lie on the straight line between others.
// check_point:   whether the point lies on the skin there.
// push, pop:     binary heap by cost, equal costs by place.
// relax:         a cheaper way to a neighbour; far from the plane of the path is dear.
// search:        Dijkstra from the end of a leg of the path back to its start.
// append_leg:    the leg's places behind those found before, without turning back.
// check_way:     no place twice.
#include "base/base.h"
#include "base/maths.h"
#include "tissue/live_cut.h"

#include <string.h>

enum { NOWHERE = UINT32_MAX, MOST_POINTS = 1024 };
static const double THIN_M = 1e-3;     // half a fine edge is 1.5 mm
static const double OFF_SKIN_M = 3e-3; // beside what the size of the faces explains

/* ---- places ------------------------------------------------------------------------------- */

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

// `is_lip` is scratch. Returns their number.
static uint32_t find_lips(const sonde_model *model, uint32_t *is_lip, lip *lips) {
  const sonde_topology *topology = &model->topology;
  uint32_t count = 0;
  memset(is_lip, 0, topology->vertex_count * sizeof *is_lip);
  for (uint32_t e = 0; e < topology->edge_count; ++e)
    for (int k = 0; k < 2 && topology->edge_faces[e][1] == NOWHERE; ++k)
      is_lip[topology->edges[e][k]] = 1;
  for (uint32_t i = 0; i < topology->vertex_count; ++i)
    if (is_lip[i]) lips[count++] = (lip){model->surface.vertices[i], i};
  qsort(lips, count, sizeof *lips, compare_lips);
  return count;
}

sonde_status sonde_places_find(const sonde_model *model, sonde_places *places, sonde_error *error) {
  uint32_t n = model->surface.vertex_count;
  *places = (sonde_places){SONDE_NEW(uint32_t, n), SONDE_NEW(uint32_t, n)};
  lip *lips = SONDE_NEW(lip, n);
  if (!places->place || !places->next || !lips) {
    sonde_free(lips);
    sonde_places_clear(places);
    return sonde_fail_memory(error);
  }
  uint32_t count = find_lips(model, places->next, lips);
  SONDE_ASSERT(count <= n);
  for (uint32_t i = 0; i < n; ++i) {
    places->place[i] = i;
    places->next[i] = NOWHERE;
  }
  for (uint32_t k = 1; k < count; ++k) {
    if (v_distance(lips[k - 1].at, lips[k].at) > 0) continue;
    SONDE_ASSERT(lips[k - 1].node < lips[k].node);
    places->place[lips[k].node] = places->place[lips[k - 1].node];
    places->next[lips[k - 1].node] = lips[k].node;
  }
  sonde_free(lips);
  return SONDE_OK;
}

void sonde_places_clear(sonde_places *places) {
  sonde_free(places->place);
  sonde_free(places->next);
  *places = (sonde_places){0};
}

sonde_status sonde_skin_closes(const sonde_model *model, bool *closes, sonde_error *error) {
  *closes = false;
  sonde_places places;
  sonde_mesh closed = {0};
  sonde_mesh_report report = {0};
  sonde_status status = sonde_places_find(model, &places, error);
  if (status) return status;
  status = sonde_mesh_copy(&model->surface, &closed, error);
  for (uint32_t f = 0; f < closed.face_count; ++f)
    for (int k = 0; k < 3; ++k) closed.faces[f][k] = places.place[closed.faces[f][k]];
  if (!status) status = sonde_mesh_inspect(&closed, &report, error);
  *closes = report.closed;
  sonde_mesh_clear(&closed);
  sonde_places_clear(&places);
  return status;
}

/* ---- points of the path ------------------------------------------------------------------- */

static double segment_distance(sonde_vec3 p, sonde_vec3 a, sonde_vec3 b) {
  sonde_vec3 d = v_sub(b, a);
  double length2 = v_norm2(d);
  double t = length2 > 0 ? clamp(v_dot(v_sub(p, a), d) / length2, 0, 1) : 0;
  return v_distance(p, v_madd(a, t, d));
}

// Whether all points between two stay within THIN_M of the line that joins them.
static bool is_straight(const sonde_vec3 *path, uint32_t from, uint32_t to) {
  for (uint32_t k = from + 1; k < to; ++k)
    if (segment_distance(path[k], path[from], path[to]) > THIN_M) return false;
  return true;
}

// Indices of the points that stay; returns their number, at least 2.
static uint32_t thin_path(const sonde_vec3 *path, uint32_t count, uint32_t *kept) {
  SONDE_ASSERT(count >= 2);
  uint32_t used = 0, from = 0;
  kept[used++] = 0;
  while (from + 1 < count) {
    uint32_t to = from + 1;
    while (to + 1 < count && is_straight(path, from, to + 1)) ++to;
    kept[used++] = from = to;
  }
  return used;
}

// No point of a face is farther from its nearest corner than 0.58 of its edge when all are equal;
// slim faces get what OFF_SKIN_M leaves.
static sonde_status check_point(const sonde_model *model, const sonde_vec3 *position, uint32_t node,
                                const sonde_vec3 *path, uint32_t k, sonde_error *error) {
  const sonde_topology *topology = &model->topology;
  double longest = 0, away = v_distance(position[node], path[k]);
  for (uint32_t e = topology->start[node]; e < topology->start[node + 1]; ++e)
    longest = fmax(longest, v_distance(position[node], position[topology->neighbour[e]]));
  double limit = OFF_SKIN_M + 0.6 * longest;
  if (away <= limit) return SONDE_OK;
  return sonde_fail(
      error, SONDE_ARGUMENT,
      "point %u of the cut, (%.1f, %.1f, %.1f) mm, lies %.1f mm from the nearest node "
      "of the skin, expected at most %.1f mm",
      k, path[k].x * 1e3, path[k].y * 1e3, path[k].z * 1e3, away * 1e3, limit * 1e3);
}

/* ---- search ------------------------------------------------------------------------------- */

typedef struct heap_entry {
  double cost;
  uint32_t place;
} heap_entry;

typedef struct search {
  const sonde_model *model;
  const sonde_places *places;
  const sonde_vec3 *position;
  sonde_vec3 on_plane, across; // the plane through a leg of the path, upright on the skin
  double *cost;                // [nodes] of places, INFINITY when not reached
  uint32_t *from;              // [nodes] next place towards the end of the leg
  uint32_t *reached;           // [nodes]
  uint32_t reached_count;
  heap_entry *heap; // [2 * edges + 1]: each side of an edge is relaxed once
  uint32_t heap_count;
  sonde_way *way;
} search;

static bool before(const heap_entry *a, const heap_entry *b) {
  return a->cost < b->cost || (a->cost == b->cost && a->place < b->place);
}

static void push(search *s, heap_entry entry) {
  SONDE_ASSERT(s->heap_count <= 2 * s->model->topology.edge_count);
  uint32_t at = s->heap_count++;
  for (; at > 0 && before(&entry, &s->heap[(at - 1) / 2]); at = (at - 1) / 2)
    s->heap[at] = s->heap[(at - 1) / 2];
  s->heap[at] = entry;
}

static heap_entry pop(search *s) {
  SONDE_ASSERT(s->heap_count > 0);
  heap_entry top = s->heap[0], last = s->heap[--s->heap_count];
  uint32_t at = 0;
  for (uint32_t child; (child = 2 * at + 1) < s->heap_count; at = child) {
    if (child + 1 < s->heap_count && before(&s->heap[child + 1], &s->heap[child])) ++child;
    if (!before(&s->heap[child], &last)) break;
    s->heap[at] = s->heap[child];
  }
  s->heap[at] = last;
  return top;
}

static void reach(search *s, uint32_t place, double cost, uint32_t from) {
  if (isinf(s->cost[place])) s->reached[s->reached_count++] = place;
  s->cost[place] = cost;
  s->from[place] = from;
  push(s, (heap_entry){cost, place});
}

// An edge costs its length l times 1 + 2 (d1^2 + d2^2)/l^2 with the distances of its ends from the
// plane: twice its length when both ends are half an edge away.
static void relax(search *s, uint32_t from, uint32_t to) {
  SONDE_ASSERT(from != to); // no edge joins two copies
  sonde_vec3 a = s->position[from], b = s->position[to];
  double length = fmax(v_distance(a, b), 1e-6);
  double d1 = v_dot(s->across, v_sub(a, s->on_plane));
  double d2 = v_dot(s->across, v_sub(b, s->on_plane));
  double cost = s->cost[from] + length + 2 * (d1 * d1 + d2 * d2) / length;
  s->way->work++;
  if (cost < s->cost[to]) reach(s, to, cost, from);
}

// Neighbours of a place are those of all nodes there: a cut may cross an earlier one.
static void visit(search *s, uint32_t place) {
  const sonde_topology *topology = &s->model->topology;
  for (uint32_t i = place; i != NOWHERE; i = s->places->next[i])
    for (uint32_t k = topology->start[i]; k < topology->start[i + 1]; ++k)
      relax(s, place, s->places->place[topology->neighbour[k]]);
}

// Afterwards from[] leads from `start` to `end`.
static bool find_leg(search *s, uint32_t start, uint32_t end) {
  SONDE_ASSERT(s->places->place[start] == start && s->places->place[end] == end);
  for (uint32_t k = 0; k < s->reached_count; ++k) s->cost[s->reached[k]] = INFINITY;
  s->reached_count = s->heap_count = 0;
  reach(s, end, 0, NOWHERE);
  while (s->heap_count > 0) {
    heap_entry at = pop(s);
    if (at.cost > s->cost[at.place]) continue;
    if (at.place == start) return true;
    visit(s, at.place);
  }
  return false;
}

// Room for a leg is made by the caller. A step back along the edge just taken undoes it.
static void append_leg(const search *s, uint32_t start) {
  sonde_way *way = s->way;
  for (uint32_t at = start; at != NOWHERE; at = s->from[at]) {
    if (way->count >= 1 && way->place[way->count - 1] == at) continue;
    if (way->count >= 2 && way->place[way->count - 2] == at)
      way->count--;
    else
      way->place[way->count++] = at;
  }
}

static bool make_room(sonde_way *way, uint32_t *room, uint32_t more) {
  SONDE_ASSERT(way->count <= *room);
  if (way->count + more <= *room) return true;
  uint32_t next = 2 * (way->count + more);
  uint32_t *place =
      sonde_realloc(way->place, *room * sizeof *way->place, next * sizeof *way->place);
  if (!place) return false;
  way->place = place;
  *room = next;
  return true;
}

// A plane through both points and the mean of the normals there.
static sonde_status place_plane(search *s, const sonde_vec3 *path, uint32_t a, uint32_t b,
                                const uint32_t node[2], sonde_error *error) {
  const sonde_vec3 *normal = s->model->normal;
  if (v_dot(normal[node[0]], normal[node[1]]) < 0)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "points %u and %u of the cut lie on different sides of the skin, expected "
                      "more points between them",
                      a, b);
  s->on_plane = path[a];
  s->across = v_unit(v_cross(v_sub(path[b], path[a]), v_add(normal[node[0]], normal[node[1]])),
                     vec3(0, 0, 0));
  return SONDE_OK;
}

static sonde_status follow(search *s, const sonde_vec3 *path, const uint32_t *kept, uint32_t count,
                           sonde_error *error) {
  uint32_t nodes = s->model->surface.vertex_count, room = 0, node[2] = {NOWHERE, NOWHERE};
  for (uint32_t k = 0; k < count; ++k) {
    node[1] = v_nearest(s->position, nodes, path[kept[k]]);
    sonde_status status = check_point(s->model, s->position, node[1], path, kept[k], error);
    if (!status && k > 0) status = place_plane(s, path, kept[k - 1], kept[k], node, error);
    if (status) return status;
    uint32_t end = s->places->place[node[1]];
    uint32_t start = k > 0 ? s->places->place[node[0]] : end;
    if (!find_leg(s, start, end))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "points %u and %u of the cut lie on parts of the skin that do not hang "
                        "together",
                        kept[k - 1], kept[k]);
    if (!make_room(s->way, &room, s->reached_count)) return sonde_fail_memory(error);
    append_leg(s, start);
    node[0] = node[1];
  }
  return SONDE_OK;
}

// Takes the repeated first place off a closed way. `seen` has an entry per node and is zero.
static sonde_status check_way(const sonde_model *model, sonde_way *way, uint8_t *seen,
                              sonde_error *error) {
  way->closed = way->count > 3 && way->place[0] == way->place[way->count - 1];
  way->count -= way->closed;
  if (way->count < 3)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "the cut follows %u edges of the skin, expected a path along 2 or more",
                      way->count ? way->count - 1 : 0);
  for (uint32_t k = 0; k < way->count; ++k) {
    sonde_vec3 x = model->surface.vertices[way->place[k]];
    if (seen[way->place[k]]++)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "the cut crosses or touches itself at (%.1f, %.1f, %.1f) mm, expected a "
                        "simple path",
                        x.x * 1e3, x.y * 1e3, x.z * 1e3);
  }
  return SONDE_OK;
}

static sonde_status check_path(const sonde_vec3 *path, uint32_t count, sonde_error *error) {
  if (count < 2 || count > MOST_POINTS)
    return sonde_fail(error, SONDE_ARGUMENT, "the cut has %u points, expected 2 to %d", count,
                      MOST_POINTS);
  for (uint32_t k = 0; k < count; ++k)
    if (!v_finite(path[k]))
      return sonde_fail(error, SONDE_ARGUMENT, "point %u of the cut is not finite", k);
  return SONDE_OK;
}

sonde_status sonde_way_find(const sonde_model *model, const sonde_places *places,
                            const sonde_vec3 *position, const sonde_vec3 *path, uint32_t count,
                            sonde_way *way, sonde_error *error) {
  *way = (sonde_way){0};
  sonde_status status = check_path(path, count, error);
  if (status) return status;
  uint32_t n = model->surface.vertex_count;
  uint32_t *kept = SONDE_NEW(uint32_t, count);
  uint8_t *seen = SONDE_NEW(uint8_t, n);
  search s = {.model = model, .places = places, .position = position, .way = way};
  s.cost = SONDE_NEW(double, n);
  s.from = SONDE_NEW(uint32_t, n);
  s.reached = SONDE_NEW(uint32_t, n);
  s.heap = SONDE_NEW(heap_entry, 2 * (size_t)model->topology.edge_count + 1);
  if (kept && seen && s.cost && s.from && s.reached && s.heap) {
    for (uint32_t i = 0; i < n; ++i) s.cost[i] = INFINITY;
    status = follow(&s, path, kept, thin_path(path, count, kept), error);
    if (!status) status = check_way(model, way, seen, error);
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
  sonde_free(way->place);
  *way = (sonde_way){0};
  return status;
}
