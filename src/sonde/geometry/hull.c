// Convex hull of a point cloud: quickhull with exact orientation tests.
//
// Coordinates are snapped to a grid of 2^39 steps across the cloud (0.2 pm on 0.1 m), so that the
// sign of the volume of four points can be decided exactly in 128-bit integers. A face is visible
// from a point only when the point lies strictly outside it; with exact signs the visible faces
// always form one patch and no flat face can arise. Floating point decides the clear cases first.
#include "geometry/internal.h"

#include <string.h>

__extension__ typedef __int128 wide;
typedef struct grid_point {
  int64_t x, y, z;
} grid_point;

typedef struct face {
  uint32_t v[3], beside[3]; // beside[k] across the side k -> k+1
  sonde_vec3 normal;        // unit, outward, in grid steps
  double offset;            // normal . v[0]
  wide exact[3];            // normal, not scaled
  uint32_t first_point, highest;
  double height;
  bool alive, visible;
} face;

typedef struct hull {
  uint32_t point_count;
  grid_point *points;
  uint32_t *next; // list of the points outside each face
  face *faces;
  uint32_t face_count, face_room;
  uint32_t *seen, *rim; // faces visible from a point; sides around them, 3 face + side
  uint32_t seen_count, seen_room, rim_count, rim_room;
  uint32_t *from_vertex; // [point_count] new face whose rim side starts there
  double tolerance;      // in grid steps
} hull;

// ---- grid ---------------------------------------------------------------------------------

static sonde_vec3 as_vector(grid_point p) { return vec3((double)p.x, (double)p.y, (double)p.z); }

// Exact normal (b - a) x (c - a): entries below 2^80.
static void exact_normal(grid_point a, grid_point b, grid_point c, wide n[3]) {
  wide ux = b.x - a.x, uy = b.y - a.y, uz = b.z - a.z;
  wide wx = c.x - a.x, wy = c.y - a.y, wz = c.z - a.z;
  n[0] = uy * wz - uz * wy;
  n[1] = uz * wx - ux * wz;
  n[2] = ux * wy - uy * wx;
}

static double height_above(const hull *h, const face *f, uint32_t point) {
  return v_dot(f->normal, as_vector(h->points[point])) - f->offset;
}

// Whether the point lies strictly outside the face's plane.
static bool outside(const hull *h, const face *f, uint32_t point) {
  double height = height_above(h, f, point);
  if (fabs(height) > 1) return height > 0; // far above the rounding error, about 1e-3 steps
  grid_point p = h->points[point], a = h->points[f->v[0]];
  wide volume = f->exact[0] * (p.x - a.x) + f->exact[1] * (p.y - a.y) + f->exact[2] * (p.z - a.z);
  return volume > 0;
}

// ---- storage ------------------------------------------------------------------------------

// Room for one more item.
static bool reserve(void **items, uint32_t count, uint32_t *room, size_t size) {
  if (count < *room) return true;
  uint32_t wanted = *room ? 2 * *room : 64;
  void *grown = sonde_realloc(*items, *room * size, wanted * size);
  if (!grown) return false;
  *items = grown;
  *room = wanted;
  return true;
}

static bool push(uint32_t **items, uint32_t *count, uint32_t *room, uint32_t value) {
  void *pointer = *items;
  bool ok = reserve(&pointer, *count, room, sizeof **items);
  *items = pointer;
  if (ok) (*items)[(*count)++] = value;
  return ok;
}

// Appends a face; SONDE_NONE when out of memory.
static uint32_t add_face(hull *h, uint32_t a, uint32_t b, uint32_t c) {
  SONDE_ASSERT(a != b && b != c && c != a);
  void *pointer = h->faces;
  bool ok = reserve(&pointer, h->face_count, &h->face_room, sizeof *h->faces);
  h->faces = pointer;
  if (!ok) return SONDE_NONE;
  face f = {.v = {a, b, c}, .first_point = SONDE_NONE, .highest = SONDE_NONE, .alive = true};
  exact_normal(h->points[a], h->points[b], h->points[c], f.exact);
  f.normal =
      v_unit(vec3((double)f.exact[0], (double)f.exact[1], (double)f.exact[2]), vec3(0, 0, 0));
  f.offset = v_dot(f.normal, as_vector(h->points[a]));
  h->faces[h->face_count] = f;
  return h->face_count++;
}

// ---- growth -------------------------------------------------------------------------------

// Gives the point to the face among [from, to) that it is highest above, if it is above any.
static void assign(hull *h, uint32_t point, uint32_t from, uint32_t to) {
  SONDE_ASSERT(from < to && to <= h->face_count);
  uint32_t best = SONDE_NONE;
  double best_height = 0;
  for (uint32_t f = from; f < to; ++f) {
    double height = height_above(h, &h->faces[f], point);
    if ((best == SONDE_NONE || height > best_height) && outside(h, &h->faces[f], point)) {
      best = f;
      best_height = height;
    }
  }
  if (best == SONDE_NONE) return;
  face *owner = &h->faces[best];
  h->next[point] = owner->first_point;
  owner->first_point = point;
  if (owner->highest == SONDE_NONE || best_height > owner->height) {
    owner->height = best_height;
    owner->highest = point;
  }
}

// Tetrahedron of points far from each other: the farthest from the first point, from that one, from
// the line and from the plane of those chosen before. All other points go to its faces.
static sonde_status begin(hull *h, sonde_error *error) {
  uint32_t v[4] = {0};
  sonde_vec3 base[3] = {as_vector(h->points[0])}, none = vec3(0, 0, 0), line = none, plane = none;
  for (int k = 0; k < 4; ++k) {
    double farthest = -1;
    for (uint32_t i = 0; i < h->point_count; ++i) {
      sonde_vec3 from = v_sub(as_vector(h->points[i]), base[0]);
      double distance = k < 2    ? v_norm(from)
                        : k == 2 ? v_norm(v_cross(line, from))
                                 : fabs(v_dot(plane, from));
      if (distance > farthest) farthest = distance, v[k] = i;
    }
    if (k > 0 && farthest < 1e-9 * 0x1p39)
      return sonde_fail(error, SONDE_MESH,
                        "the points lie in one plane, expected points that span a volume");
    if (k < 3) base[k] = as_vector(h->points[v[k]]);
    if (k == 1) line = v_unit(v_sub(base[1], base[0]), none);
    if (k == 2) plane = v_unit(v_cross(v_sub(base[1], base[0]), v_sub(base[2], base[0])), none);
  }
  // The fourth point lies below the face of the others.
  wide n[3];
  grid_point a = h->points[v[0]], p = h->points[v[3]];
  exact_normal(a, h->points[v[1]], h->points[v[2]], n);
  if (n[0] * (p.x - a.x) + n[1] * (p.y - a.y) + n[2] * (p.z - a.z) > 0) {
    uint32_t swap = v[1];
    v[1] = v[2];
    v[2] = swap;
  }
  static const int corners[4][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  static const uint32_t beside[4][3] = {{2, 3, 1}, {0, 3, 2}, {1, 3, 0}, {2, 1, 0}};
  for (int k = 0; k < 4; ++k) {
    uint32_t f = add_face(h, v[corners[k][0]], v[corners[k][1]], v[corners[k][2]]);
    if (f == SONDE_NONE) return sonde_fail_memory(error);
    memcpy(h->faces[f].beside, beside[k], sizeof beside[k]);
  }
  for (uint32_t i = 0; i < h->point_count; ++i) assign(h, i, 0, 4);
  return SONDE_OK;
}

// Replaces the faces visible from the point by a cone from it to the horizon around them; `start`
// is one of them. False: no memory.
static bool add_point(hull *h, uint32_t start, uint32_t point) {
  SONDE_ASSERT(outside(h, &h->faces[start], point));
  h->seen_count = h->rim_count = 0;
  h->faces[start].visible = true;
  if (!push(&h->seen, &h->seen_count, &h->seen_room, start)) return false;
  for (uint32_t i = 0; i < 3 * h->seen_count; ++i) {
    uint32_t side = 3 * h->seen[i / 3] + i % 3, other = h->faces[side / 3].beside[side % 3];
    if (h->faces[other].visible) continue;
    if (outside(h, &h->faces[other], point)) {
      h->faces[other].visible = true;
      if (!push(&h->seen, &h->seen_count, &h->seen_room, other)) return false;
    } else if (!push(&h->rim, &h->rim_count, &h->rim_room, side)) {
      return false;
    }
  }

  // New faces (from, to, point) along the horizon; the face across points at the new one.
  uint32_t first = h->face_count;
  SONDE_ASSERT(h->rim_count >= 3);
  for (uint32_t i = 0; i < h->rim_count; ++i) {
    uint32_t old = h->rim[i] / 3, k = h->rim[i] % 3, across = h->faces[old].beside[k];
    uint32_t from = h->faces[old].v[k], to = h->faces[old].v[(k + 1) % 3];
    uint32_t fresh = add_face(h, from, to, point);
    if (fresh == SONDE_NONE) return false;
    h->faces[fresh].beside[0] = across;
    h->from_vertex[from] = fresh;
    face *other = &h->faces[across];
    uint32_t back = 0;
    while (back < 3 && (other->beside[back] != old || other->v[(back + 1) % 3] != from)) ++back;
    SONDE_ASSERT(back < 3);
    other->beside[back] = fresh;
  }
  for (uint32_t f = first; f < h->face_count; ++f) {
    uint32_t follower = h->from_vertex[h->faces[f].v[1]];
    SONDE_ASSERT(follower >= first && follower < h->face_count);
    h->faces[f].beside[1] = follower;
    h->faces[follower].beside[2] = f;
  }

  // The points of the removed faces go to the new face that they are highest above.
  for (uint32_t i = 0; i < h->seen_count; ++i) {
    face *old = &h->faces[h->seen[i]];
    old->alive = false;
    for (uint32_t p = old->first_point, next; p != SONDE_NONE; p = next) {
      next = h->next[p];
      if (p != point) assign(h, p, first, h->face_count);
    }
    old->first_point = SONDE_NONE;
  }
  return true;
}

sonde_status sonde_hull_mesh(const sonde_vec3 *points, uint32_t count, double tolerance_m,
                             sonde_mesh *mesh, sonde_error *error) {
  *mesh = (sonde_mesh){0};
  if (count < 4)
    return sonde_fail(error, SONDE_MESH, "a hull of %u points, expected at least 4", count);
  for (uint32_t i = 0; i < count; ++i)
    if (!v_finite(points[i]))
      return sonde_fail(error, SONDE_ARGUMENT, "point %u of the hull is not finite", i);
  hull h = {.point_count = count};
  h.points = SONDE_NEW(grid_point, count);
  h.next = SONDE_NEW(uint32_t, count);
  h.from_vertex = SONDE_NEW(uint32_t, count);
  sonde_status status = SONDE_OK;
  if (!h.points || !h.next || !h.from_vertex) status = sonde_fail_memory(error);
  if (!status) {
    // coordinates in grid steps
    sonde_vec3 low = points[0], high = points[0];
    for (uint32_t i = 1; i < count; ++i) {
      low = v_min(low, points[i]);
      high = v_max(high, points[i]);
    }
    sonde_vec3 size = v_sub(high, low);
    double extent = fmax(size.x, fmax(size.y, size.z));
    double steps_per_m = extent > 0 ? 0x1p39 / extent : 1;
    for (uint32_t i = 0; i < count; ++i) {
      sonde_vec3 p = v_scale(v_sub(points[i], low), steps_per_m);
      h.points[i] = (grid_point){llround(p.x), llround(p.y), llround(p.z)};
    }
    h.tolerance = tolerance_m * steps_per_m;
    status = begin(&h, error);
  }
  // The highest point of each face, until no face has one above the tolerance. New faces are
  // appended, so one walk over the growing list visits all.
  for (uint32_t f = 0; f < h.face_count && !status; ++f) {
    if (!h.faces[f].alive || h.faces[f].highest == SONDE_NONE) continue;
    if (h.tolerance > 0 && h.faces[f].height <= h.tolerance) continue;
    if (!add_point(&h, f, h.faces[f].highest)) status = sonde_fail_memory(error);
  }
  // The mesh of the living faces, with the points that they use.
  if (!status) {
    uint32_t faces = 0, vertices = 0;
    uint32_t *index = h.from_vertex;
    memset(index, 0, h.point_count * sizeof *index);
    for (uint32_t f = 0; f < h.face_count; ++f) {
      if (!h.faces[f].alive) continue;
      ++faces;
      for (int k = 0; k < 3; ++k) index[h.faces[f].v[k]] = 1;
    }
    for (uint32_t i = 0; i < h.point_count; ++i)
      if (index[i]) index[i] = ++vertices;
    status = sonde_mesh_create(mesh, vertices, faces, error);
    for (uint32_t i = 0; i < h.point_count && !status; ++i)
      if (index[i]) mesh->vertices[index[i] - 1] = points[i];
    uint32_t at = 0;
    for (uint32_t f = 0; f < h.face_count && !status; ++f) {
      if (!h.faces[f].alive) continue;
      for (int k = 0; k < 3; ++k) mesh->faces[at][k] = index[h.faces[f].v[k]] - 1;
      ++at;
    }
  }
  sonde_free(h.points);
  sonde_free(h.next);
  sonde_free(h.faces);
  sonde_free(h.seen);
  sonde_free(h.rim);
  sonde_free(h.from_vertex);
  return status;
}
