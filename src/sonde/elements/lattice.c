// The octree and its tetrahedra. Two cells of one size share a face: four body-centred tetrahedra
// stand about the line between their centres, one on each side of the face. Where a face meets four
// smaller ones, each small face carries half a pyramid to either centre, split by the diagonal
// through the middle of the large face.
#include "elements/lattice.h"

#include <string.h>

void sonde_lattice_clear(sonde_lattice *l) {
  sonde_free(l->cell);
  sonde_free(l->point);
  sonde_free(l->corner);
  *l = (sonde_lattice){0};
}

// ---- octree -------------------------------------------------------------------------------

// The cell of that side, or the leaf above it, that contains a place; UINT32_MAX beyond the root.
static uint32_t find_cell(const sonde_lattice *l, int64_t x, int64_t y, int64_t z, uint32_t side) {
  if (x < 0 || y < 0 || z < 0 || x >= l->side || y >= l->side || z >= l->side) return UINT32_MAX;
  uint32_t at = 0;
  while (l->cell[at].side > side && l->cell[at].child) {
    uint32_t half = l->cell[at].side / 2;
    at = l->cell[at].child + (x >= l->cell[at].x + half) + 2u * (y >= l->cell[at].y + half) +
         4u * (z >= l->cell[at].z + half);
  }
  return at;
}

// Splits a leaf after all larger cells around it.
static sonde_status split(sonde_lattice *l, uint32_t at, sonde_error *error) {
  const sonde_cell c = l->cell[at];
  SONDE_ASSERT(c.child == 0 && c.side > 2);
  for (int k = 0; k < 27; ++k) {
    const int64_t x = c.x + (k % 3 - 1) * (int64_t)c.side,
                  y = c.y + (k / 3 % 3 - 1) * (int64_t)c.side,
                  z = c.z + (k / 9 - 1) * (int64_t)c.side;
    uint32_t other = find_cell(l, x, y, z, c.side);
    if (other == UINT32_MAX || l->cell[other].side <= c.side) continue;
    sonde_status status = split(l, other, error);
    if (status) return status;
  }
  if (l->cell_count + 8 > l->cell_room) {
    if (l->cell_room >= SONDE_LATTICE_CELLS)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "the edges ask for more than %d cells, expected longer ones",
                        SONDE_LATTICE_CELLS);
    sonde_cell *more = sonde_realloc(l->cell, l->cell_room * sizeof *more,
                                     2 * (size_t)l->cell_room * sizeof *more);
    if (!more) return sonde_fail_memory(error);
    l->cell = more, l->cell_room *= 2;
  }
  const uint32_t half = c.side / 2;
  l->cell[at].child = l->cell_count;
  for (uint32_t k = 0; k < 8; ++k)
    l->cell[l->cell_count++] = (sonde_cell){.x = c.x + (k & 1) * half,
                                            .y = c.y + (k >> 1 & 1) * half,
                                            .z = c.z + (k >> 2) * half,
                                            .side = half};
  return SONDE_OK;
}

// ---- tetrahedra ---------------------------------------------------------------------------

// Places of lattice points.
typedef struct place {
  uint32_t at[3];
} place;

static uint64_t key_of(place p) {
  return (uint64_t)p.at[0] << 42 | (uint64_t)p.at[1] << 21 | p.at[2];
}

static place middle_of(place a, place b) {
  return (place){{(a.at[0] + b.at[0]) / 2, (a.at[1] + b.at[1]) / 2, (a.at[2] + b.at[2]) / 2}};
}

typedef struct builder {
  sonde_lattice *lattice;
  sonde_index_map map; // packed place -> point
  bool failed;
} builder;

static uint32_t add_point(builder *b, place p) {
  sonde_lattice *l = b->lattice;
  bool added = false;
  uint32_t *number = sonde_index_map_add(&b->map, key_of(p), &added);
  if (number && added && l->point_count == l->point_room) {
    size_t room = l->point_room ? 2 * (size_t)l->point_room : 1024;
    uint64_t *more = sonde_realloc(l->point, l->point_room * sizeof *more, room * sizeof *more);
    if (more) l->point = more, l->point_room = (uint32_t)room;
    b->failed |= !more;
  }
  b->failed |= !number;
  if (b->failed) return 0;
  if (added) l->point[ *number = l->point_count++] = key_of(p);
  return *number;
}

static void add_tetrahedron(builder *b, place p, place q, place r, place s) {
  sonde_lattice *l = b->lattice;
  if (l->count == l->room) {
    size_t room = l->room ? 2 * (size_t)l->room : 1024;
    uint32_t(*more)[4] = sonde_realloc(l->corner, l->room * sizeof *more, room * sizeof *more);
    if (more) l->corner = more, l->room = (uint32_t)room;
    b->failed |= !more;
  }
  uint32_t corner[4] = {add_point(b, p), add_point(b, q), add_point(b, r), add_point(b, s)};
  if (b->failed) return;
  double d[3][3];
  const place *other[3] = {&q, &r, &s};
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) d[i][k] = (double)other[i]->at[k] - p.at[k];
  double volume = d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) -
                  d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                  d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
  SONDE_ASSERT(volume != 0);
  if (volume < 0) {
    uint32_t swap = corner[2];
    corner[2] = corner[3], corner[3] = swap;
  }
  memcpy(l->corner[l->count++], corner, sizeof corner);
}

static place centre_of(const sonde_cell *c) {
  return (place){{c->x + c->side / 2, c->y + c->side / 2, c->z + c->side / 2}};
}

// Corners of a cell's face towards +axis or -axis, in turn.
static void face_corners(const sonde_cell *c, int axis, bool positive, place corner[4]) {
  static const uint32_t turn[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  for (int k = 0; k < 4; ++k) {
    corner[k] = (place){{c->x, c->y, c->z}};
    corner[k].at[axis] += positive ? c->side : 0;
    corner[k].at[(axis + 1) % 3] += turn[k][0] * c->side;
    corner[k].at[(axis + 2) % 3] += turn[k][1] * c->side;
  }
}

// What a leaf adds at one of its faces: between two equal cells the lower one adds it.
static void add_face(builder *b, uint32_t at, int axis, bool positive) {
  const sonde_lattice *l = b->lattice;
  const sonde_cell *c = &l->cell[at];
  int64_t low[3] = {c->x, c->y, c->z};
  low[axis] += positive ? c->side : -(int64_t)c->side;
  uint32_t other = find_cell(l, low[0], low[1], low[2], c->side);
  if (other == UINT32_MAX) return;
  const sonde_cell *o = &l->cell[other];
  place centre = centre_of(c), corner[4];
  face_corners(c, axis, positive, corner);
  if (o->side == c->side && o->child == 0) {
    place opposite = centre_of(o);
    for (int k = 0; positive && k < 4; ++k) {
      // One tetrahedron, or two where smaller cells halve the side.
      place from = corner[k], to = corner[(k + 1) % 4], middle = middle_of(from, to);
      bool halved = sonde_index_map_find(&b->map, key_of(middle)) != UINT32_MAX;
      add_tetrahedron(b, centre, opposite, from, halved ? middle : to);
      if (halved) add_tetrahedron(b, centre, opposite, middle, to);
    }
  } else if (o->side == c->side) {
    // Four smaller faces on the other side.
    place middle = middle_of(corner[0], corner[2]);
    for (int k = 0; k < 4; ++k) {
      add_tetrahedron(b, centre, middle, corner[k], middle_of(corner[k], corner[(k + 1) % 4]));
      add_tetrahedron(b, centre, middle, corner[k], middle_of(corner[k], corner[(k + 3) % 4]));
    }
  } else {
    // A larger face, whose middle is the corner that is an odd number of sides from the origin.
    int first = 0;
    while (corner[first].at[(axis + 1) % 3] / c->side % 2 == 0 ||
           corner[first].at[(axis + 2) % 3] / c->side % 2 == 0)
      ++first;
    SONDE_ASSERT(first < 4);
    add_tetrahedron(b, centre, corner[first], corner[(first + 2) % 4], corner[(first + 1) % 4]);
    add_tetrahedron(b, centre, corner[first], corner[(first + 2) % 4], corner[(first + 3) % 4]);
  }
}

sonde_status sonde_lattice_create(sonde_vec3 low, sonde_vec3 high, double smallest_m,
                                  bool (*wanted)(const void *user, sonde_vec3 centre,
                                                 double side_m),
                                  const void *user, sonde_lattice *l, sonde_error *error) {
  SONDE_ASSERT(smallest_m > 0 && wanted != NULL);
  // The root is a cube about the middle of the box with a cell to spare on every side.
  sonde_vec3 size = v_sub(high, low), middle = v_lerp(low, high, 0.5);
  double longest = fmax(fmax(size.x, size.y), size.z) + 4 * smallest_m;
  *l = (sonde_lattice){.unit_m = smallest_m / 2, .side = 4, .cell_count = 1, .cell_room = 1024};
  while (l->side < 1u << 20 && l->side * l->unit_m < longest) l->side *= 2;
  if (l->side * l->unit_m < longest)
    return sonde_fail(error, SONDE_ARGUMENT, "expected edges longer than %g m for a body of %g m",
                      longest / 5e5, longest);
  double half = l->side * l->unit_m / 2;
  l->origin = v_sub(middle, vec3(half, half, half));
  l->cell = SONDE_NEW(sonde_cell, l->cell_room);
  if (!l->cell) return sonde_fail_memory(error);
  l->cell[0].side = l->side;
  sonde_status status = SONDE_OK;
  for (uint32_t at = 0; at < l->cell_count && !status; ++at) {
    const sonde_cell c = l->cell[at];
    double middle_of_side = c.side / 2.0;
    sonde_vec3 centre =
        sonde_lattice_at(l, c.x + middle_of_side, c.y + middle_of_side, c.z + middle_of_side);
    if (c.child == 0 && c.side > 2 && wanted(user, centre, c.side * l->unit_m))
      status = split(l, at, error);
  }
  if (status) return status;

  // All corners first: they tell which sides are halved.
  builder b = {.lattice = l};
  for (uint32_t at = 0; at < l->cell_count; ++at)
    for (int k = 0; k < 8 && l->cell[at].child == 0; ++k) {
      place corner[4];
      face_corners(&l->cell[at], 2, k > 3, corner);
      (void)add_point(&b, corner[k % 4]);
    }
  for (uint32_t at = 0; at < l->cell_count && !b.failed; ++at)
    for (int face = 0; face < 6 && l->cell[at].child == 0; ++face)
      add_face(&b, at, face / 2, face % 2 == 0);
  sonde_index_map_clear(&b.map);
  return b.failed ? sonde_fail_memory(error) : SONDE_OK;
}
