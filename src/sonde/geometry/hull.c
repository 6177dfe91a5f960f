// Convex hull of a point cloud: quickhull with exact orientation tests.
//
// Coordinates are snapped to a grid of 2^39 steps across the cloud (0.2 pm on 0.1 m), so that the
// sign of the volume of four points can be decided exactly in 128-bit integers. A face is visible
// from a point only when the point lies strictly outside it; with exact signs the visible faces
// always form one patch and no flat face can arise. Floating point decides the clear cases first.
//
//   snap             integer coordinates
//   outside          exact side of a point; height is its distance above a face
//   first_simplex    four points that span a volume
//   see              the faces visible from a point, and the horizon around them
//   cone             new faces from the horizon to the point
//   hand_over        points of the removed faces go to the new face that they are highest above
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
  uint32_t *stack, *seen, *rim_face; // scratch
  uint32_t stack_room, seen_count, seen_room, rim_count, rim_room;
  uint32_t *rim_side, rim_side_room;
  uint32_t *from_vertex; // [point_count] new face whose rim side starts there
  double tolerance;      // in grid steps
} hull;

// ---- grid ---------------------------------------------------------------------------------

static sonde_vec3 as_vector(grid_point p) { return vec3((double)p.x, (double)p.y, (double)p.z); }

static double snap(hull *h, const sonde_vec3 *points) {
  SONDE_ASSERT(h->point_count > 0);
  sonde_vec3 low = points[0], high = points[0];
  for (uint32_t i = 1; i < h->point_count; ++i) {
    sonde_vec3 p = points[i];
    low = vec3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
    high = vec3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
  }
  sonde_vec3 size = v_sub(high, low);
  double extent = fmax(size.x, fmax(size.y, size.z));
  double steps_per_m = extent > 0 ? 0x1p39 / extent : 1;
  for (uint32_t i = 0; i < h->point_count; ++i) {
    sonde_vec3 p = v_scale(v_sub(points[i], low), steps_per_m);
    h->points[i] = (grid_point){llround(p.x), llround(p.y), llround(p.z)};
  }
  return steps_per_m;
}

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

static void hull_clear(hull *h) {
  sonde_free(h->points);
  sonde_free(h->next);
  sonde_free(h->faces);
  sonde_free(h->stack);
  sonde_free(h->seen);
  sonde_free(h->rim_face);
  sonde_free(h->rim_side);
  sonde_free(h->from_vertex);
}

// ---- first simplex ------------------------------------------------------------------------

typedef double (*measure_fn)(const sonde_vec3 *base, sonde_vec3 p);

static double from_point(const sonde_vec3 *base, sonde_vec3 p) { return v_distance(base[0], p); }
static double from_line(const sonde_vec3 *base, sonde_vec3 p) {
  sonde_vec3 along = v_unit(v_sub(base[1], base[0]), vec3(0, 0, 0));
  return v_norm(v_cross(along, v_sub(p, base[0])));
}
static double from_plane(const sonde_vec3 *base, sonde_vec3 p) {
  sonde_vec3 n = v_cross(v_sub(base[1], base[0]), v_sub(base[2], base[0]));
  return fabs(v_dot(v_unit(n, vec3(0, 0, 0)), v_sub(p, base[0])));
}

// Point with the largest measure against the points chosen so far.
static uint32_t farthest(const hull *h, measure_fn measure, const uint32_t *chosen, int count,
                         double *value) {
  sonde_vec3 base[3];
  uint32_t best = 0;
  for (int k = 0; k < count; ++k) base[k] = as_vector(h->points[chosen[k]]);
  *value = -1;
  for (uint32_t i = 0; i < h->point_count; ++i) {
    double m = measure(base, as_vector(h->points[i]));
    if (m > *value) {
      *value = m;
      best = i;
    }
  }
  return best;
}

// False when the points lie in one plane, within 1e-9 of their extent.
static bool first_simplex(const hull *h, uint32_t v[4]) {
  static const measure_fn measures[] = {from_point, from_line, from_plane};
  double value;
  v[0] = 0;
  v[0] = farthest(h, from_point, v, 1, &value);
  for (int k = 1; k < 4; ++k) {
    v[k] = farthest(h, measures[k - 1], v, k, &value);
    if (value < 1e-9 * 0x1p39) return false;
  }
  wide n[3];
  grid_point a = h->points[v[0]], p = h->points[v[3]];
  exact_normal(a, h->points[v[1]], h->points[v[2]], n);
  if (n[0] * (p.x - a.x) + n[1] * (p.y - a.y) + n[2] * (p.z - a.z) > 0) {
    uint32_t keep = v[1];
    v[1] = v[2];
    v[2] = keep;
  }
  return true;
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

static sonde_status begin(hull *h, sonde_error *error) {
  uint32_t v[4];
  if (!first_simplex(h, v))
    return sonde_fail(error, SONDE_MESH,
                      "the points lie in one plane, expected points that span a volume");
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

// Collects the faces visible from the point and the sides that border them; false: no memory.
static bool see(hull *h, uint32_t start, uint32_t point) {
  h->seen_count = h->rim_count = 0;
  SONDE_ASSERT(outside(h, &h->faces[start], point));
  h->faces[start].visible = true;
  if (!push(&h->seen, &h->seen_count, &h->seen_room, start)) return false;
  for (uint32_t i = 0; i < h->seen_count; ++i)
    for (uint32_t k = 0; k < 3; ++k) {
      uint32_t other = h->faces[h->seen[i]].beside[k];
      if (h->faces[other].visible) continue;
      if (outside(h, &h->faces[other], point)) {
        h->faces[other].visible = true;
        if (!push(&h->seen, &h->seen_count, &h->seen_room, other)) return false;
        continue;
      }
      uint32_t sides = h->rim_count;
      if (!push(&h->rim_side, &sides, &h->rim_side_room, k)) return false;
      if (!push(&h->rim_face, &h->rim_count, &h->rim_room, h->seen[i])) return false;
    }
  return true;
}

// Points the face across the rim at the new face.
static void connect(hull *h, uint32_t across, uint32_t old, uint32_t start, uint32_t fresh) {
  uint32_t k = 0;
  face *other = &h->faces[across];
  while (k < 3 && (other->beside[k] != old || other->v[(k + 1) % 3] != start)) ++k;
  SONDE_ASSERT(k < 3);
  other->beside[k] = fresh;
}

// New faces (start, end, point) along the rim, connected around the point; false: no memory.
static bool cone(hull *h, uint32_t point) {
  uint32_t first = h->face_count;
  SONDE_ASSERT(h->rim_count >= 3);
  for (uint32_t i = 0; i < h->rim_count; ++i) {
    uint32_t old = h->rim_face[i], k = h->rim_side[i];
    uint32_t start = h->faces[old].v[k], end = h->faces[old].v[(k + 1) % 3];
    uint32_t across = h->faces[old].beside[k];
    uint32_t fresh = add_face(h, start, end, point);
    if (fresh == SONDE_NONE) return false;
    h->faces[fresh].beside[0] = across;
    connect(h, across, old, start, fresh);
    h->from_vertex[start] = fresh;
  }
  for (uint32_t f = first; f < h->face_count; ++f) {
    uint32_t follower = h->from_vertex[h->faces[f].v[1]];
    SONDE_ASSERT(follower >= first && follower < h->face_count);
    h->faces[f].beside[1] = follower;
    h->faces[follower].beside[2] = f;
  }
  return true;
}

static void hand_over(hull *h, uint32_t first_new, uint32_t point) {
  for (uint32_t i = 0; i < h->seen_count; ++i) {
    face *old = &h->faces[h->seen[i]];
    old->alive = false;
    for (uint32_t p = old->first_point, next; p != SONDE_NONE; p = next) {
      next = h->next[p];
      if (p != point) assign(h, p, first_new, h->face_count);
    }
    old->first_point = SONDE_NONE;
  }
}

// Adds the highest point of each face until no face has a point above the tolerance. New faces are
// appended, so one walk over the growing list visits all.
static sonde_status grow(hull *h, sonde_error *error) {
  for (uint32_t f = 0; f < h->face_count; ++f) {
    if (!h->faces[f].alive || h->faces[f].highest == SONDE_NONE) continue;
    if (h->tolerance > 0 && h->faces[f].height <= h->tolerance) continue;
    uint32_t point = h->faces[f].highest, first_new = h->face_count;
    if (!see(h, f, point) || !cone(h, point)) return sonde_fail_memory(error);
    hand_over(h, first_new, point);
  }
  return SONDE_OK;
}

static sonde_status collect(const hull *h, const sonde_vec3 *points, sonde_mesh *mesh,
                            sonde_error *error) {
  uint32_t faces = 0, vertices = 0;
  uint32_t *index = h->from_vertex;
  memset(index, 0, h->point_count * sizeof *index);
  for (uint32_t f = 0; f < h->face_count; ++f) {
    if (!h->faces[f].alive) continue;
    ++faces;
    for (int k = 0; k < 3; ++k) index[h->faces[f].v[k]] = 1;
  }
  for (uint32_t i = 0; i < h->point_count; ++i)
    if (index[i]) index[i] = ++vertices;
  sonde_status status = sonde_mesh_create(mesh, vertices, faces, error);
  if (status) return status;
  for (uint32_t i = 0; i < h->point_count; ++i)
    if (index[i]) mesh->vertices[index[i] - 1] = points[i];
  uint32_t at = 0;
  for (uint32_t f = 0; f < h->face_count; ++f) {
    if (!h->faces[f].alive) continue;
    for (int k = 0; k < 3; ++k) mesh->faces[at][k] = index[h->faces[f].v[k]] - 1;
    ++at;
  }
  return SONDE_OK;
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
  if (h.points && h.next && h.from_vertex)
    h.tolerance = tolerance_m * snap(&h, points);
  else
    status = sonde_fail_memory(error);
  if (!status) status = begin(&h, error);
  if (!status) status = grow(&h, error);
  if (!status) status = collect(&h, points, mesh, error);
  hull_clear(&h);
  return status;
}
