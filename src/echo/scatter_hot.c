// Scatterers of the tissue around the image plane, moved with it and laid into the (sample x line)
// grid of the complex baseband field.
//
// Tissue is cut into cubes at rest. A cube's scatterers are a piece of the common pool chosen by
// the cube's key, so that the same tissue always shows the same speckle. Per frame one affine map
// per cube takes them straight to lines and samples; close to a vessel eight maps per cube follow
// its wall. Every point goes where sonde_interior_displacement takes it, walls included. The lumen
// is left to the blood (blood_hot.c).
//
// sonde_echo_scatter  all cubes that the slab touches
// visit_quad, visit, choose_samples  cubes along one coarse quad
// clear_seen, find    each cube once
// locate              image coordinates of a rest point, and the derivative there
// cube_map            map of a cube without vessels
// bound_vessels, find_vessels, carry  what the vessels' walls do to it
// carried, carry_pieces  its map and those of its pieces with them
// find_lumen, in_lumen  places at rest that hold blood
// place_cell, place_pieces  a cube, or its pieces beside a vessel
// sonde_echo_lay, lay_outside  scatterers of one map into the grid; those of the tissue alone
// sonde_echo_scatter_points  given points instead of tissue
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <string.h>

enum { MOST_PIECES = 12, NEWTON = 2, MOST_PER_PIECE = 512 };

// Of the slab when looking for cubes. A grid meets every cube when no point is farther from it than
// a cube's inscribed ball reaches: half the diagonal of its cells.
static const double sampling_m = 1.1e-3; // beside the plane

// ---- from rest to the image ---------------------------------------------------------------

// Coarse column and row with the shares of the four nodes around.
typedef struct spot {
  const plane_node *node; // upper left
  double share[4];
} spot;

static spot spot_at(const sonde_echo *echo, double column, double row) {
  double a = clamp(column, 0, SONDE_PLANE_COLUMNS - 1.0), b = clamp(row, 0, echo->plane_rows - 1.0);
  uint32_t i = (uint32_t)a, j = (uint32_t)b;
  if (i > SONDE_PLANE_COLUMNS - 2) i = SONDE_PLANE_COLUMNS - 2;
  if (j > echo->plane_rows - 2) j = echo->plane_rows - 2;
  a -= i, b -= j;
  return (spot){&echo->node[j * SONDE_PLANE_COLUMNS + i],
                {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b}};
}

static const plane_node *corner(const spot *s, int k) {
  return s->node + (k & 1) + (k >> 1) * SONDE_PLANE_COLUMNS;
}

static sonde_vec3 rest_at(const spot *s) {
  sonde_vec3 rest = vec3(0, 0, 0);
  for (int k = 0; k < 4; ++k) rest = v_madd(rest, s->share[k], corner(s, k)->rest);
  return rest;
}

static sonde_mat3 turn_at(const spot *s) {
  sonde_mat3 in = m_zero();
  for (int k = 0; k < 4; ++k) {
    const sonde_mat3 *n = &corner(s, k)->in;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) in.m[r][c] += s->share[k] * n->m[r][c];
  }
  return in;
}

// Image coordinates of a rest point from a first guess: Newton's steps of the foot in the plane;
// beside it the tissue continues along the derivative.
static sonde_vec3 locate(const sonde_echo *echo, sonde_vec3 rest, sonde_vec3 at, sonde_mat3 *in) {
  for (int step = 0; step < NEWTON; ++step) {
    double a = clamp(at.x, 0, SONDE_PLANE_COLUMNS - 1.0),
           b = clamp(at.z, 0, echo->plane_rows - 1.0);
    spot s = spot_at(echo, a, b);
    *in = step + 1 < NEWTON ? s.node->in : turn_at(&s); // close enough for the first
    sonde_vec3 change = m_mul_v(*in, v_sub(rest, rest_at(&s)));
    at = vec3(a + change.x, change.y, b + change.z);
  }
  return at;
}

// The moved cube around a rest point: image coordinates.
static map cube_map(const sonde_echo *echo, sonde_vec3 centre, sonde_vec3 guess) {
  sonde_mat3 in;
  map m = {.origin = locate(echo, centre, guess, &in)};
  for (int k = 0; k < 3; ++k)
    m.axis[k] =
        vec3(in.m[0][k] * echo->cell_m, in.m[1][k] * echo->cell_m, in.m[2][k] * echo->cell_m);
  return m;
}

// ---- vessels --------------------------------------------------------------------------------

static const double close_m = 10e-3; // rest distance within which a cube goes in pieces
static const double close_radii = 3; // of a branch
static const double reach_radii = 4; // of the vessel, over which a wall moves the tissue

// A cube at rest and the vessels beside it.
typedef struct cube {
  sonde_vec3 centre; // at rest
  uint64_t bits;     // that choose its scatterers
  bool close;
  uint32_t near_count, which[MOST_VESSELS];
  sonde_vessel_state near[MOST_VESSELS];
  bool moving; // any of them
} cube;

sonde_vec3 sonde_echo_to_world(const sonde_echo *echo, sonde_vec3 at) {
  const frame *f = &echo->frame;
  double line = at.x * echo->lines_per_column - f->edge_lines;
  sonde_vec3 local = sonde_echo_place(f, line, at.z * echo->depth_per_row);
  local.y = at.y;
  return pose_apply(f->probe, local);
}

sonde_vec3 sonde_echo_from_world(const sonde_echo *echo, sonde_vec3 p) {
  const frame *f = &echo->frame;
  sonde_vec3 at = sonde_echo_unplace(f, m_mul_v(f->from_world, v_sub(p, f->probe.position)));
  return vec3((at.x + f->edge_lines) / echo->lines_per_column, at.y, at.z / echo->depth_per_row);
}

static bool within(sonde_vec3 p, sonde_vec3 low, sonde_vec3 high) {
  return p.x >= low.x && p.x <= high.x && p.y >= low.y && p.y <= high.y && p.z >= low.z &&
         p.z <= high.z;
}

static void widen_box(sonde_vec3 *low, sonde_vec3 *high, sonde_vec3 p, double by) {
  *low = vec3(fmin(low->x, p.x - by), fmin(low->y, p.y - by), fmin(low->z, p.z - by));
  *high = vec3(fmax(high->x, p.x + by), fmax(high->y, p.y + by), fmax(high->z, p.z + by));
}

// Boxes of the vessels in view and what they reach, along the stretch of the leg that is visited.
static void bound_vessels(sonde_echo *echo) {
  const sonde_interior *interior = echo->interior;
  double first = INFINITY, last = -INFINITY;
  for (int k = 0; k < 8; ++k) {
    sonde_vec3 corner = vec3(echo->box_first[0] + (k & 1 ? echo->box_size[0] : 0.0),
                             echo->box_first[1] + (k & 2 ? echo->box_size[1] : 0.0),
                             echo->box_first[2] + (k & 4 ? echo->box_size[2] : 0.0));
    double s = v_dot(v_sub(v_scale(corner, echo->cell_m), interior->origin), interior->axis);
    first = fmin(first, s), last = fmax(last, s);
  }
  for (uint32_t k = 0; k < echo->shown_count; ++k) {
    const uint32_t which = echo->shown[k], count = interior->station_count[which];
    const sonde_station *station = interior->station[which];
    echo->vessel_low[k] = vec3(INFINITY, INFINITY, INFINITY);
    echo->vessel_high[k] = v_neg(echo->vessel_low[k]);
    for (uint32_t i = 0; i < count; ++i) {
      if (i + 1 < count && station[i + 1].s_m < first) continue;
      if (i > 0 && station[i - 1].s_m > last) break;
      const sonde_vessel_state *v = &interior->state[which][i];
      double reach = fmax(close_m, reach_radii * v->rest_radius_m + echo->cell_m);
      widen_box(&echo->vessel_low[k], &echo->vessel_high[k], v->rest_centre_m, reach);
    }
  }
}

// Whether a cube goes in pieces depends on the tissue at rest alone: its scatterers stay the same
// while the walls move.
static void find_vessels(const sonde_echo *echo, cube *c) {
  const sonde_interior *interior = echo->interior;
  double s = v_dot(v_sub(c->centre, interior->origin), interior->axis);
  for (uint32_t k = 0; k < echo->shown_count; ++k) {
    uint32_t which = echo->shown[k];
    if (!within(c->centre, echo->vessel_low[k], echo->vessel_high[k])) continue;
    sonde_vessel_state *v = &c->near[c->near_count];
    if (!sonde_vessel_at(interior, which, s, v)) continue;
    double distance = v_distance(c->centre, v->rest_centre_m);
    double close = which < 2 ? close_m : fmin(close_m, close_radii * v->rest_radius_m);
    c->close = c->close || distance < close;
    if (!(distance < reach_radii * v->rest_radius_m + echo->cell_m)) continue;
    c->which[c->near_count++] = which;
    c->moving = c->moving || v->area_ratio < 1 || v->area_ratio > 1;
  }
}

// Image coordinates of a rest point whose place without vessels is known.
static sonde_vec3 carry(const sonde_echo *echo, const cube *c, sonde_vec3 rest, sonde_vec3 bare) {
  sonde_vec3 field = v_sub(sonde_echo_to_world(echo, bare), rest);
  sonde_vec3 u = sonde_vessels_move(c->near, c->near_count, rest, field);
  return sonde_echo_from_world(echo, v_add(rest, u));
}

// Offset of a piece's middle from the cube's along an axis, in edges.
static double offset_of(int part, int k) { return part >> k & 1 ? 0.25 : -0.25; }

static sonde_vec3 unit_of(int k) { return vec3(k == 0, k == 1, k == 2); }

// The whole cube, carried by the walls.
static map carried(const sonde_echo *echo, const cube *c, const map *m) {
  map out = *m;
  if (!c->moving) return out;
  out.origin = carry(echo, c, c->centre, m->origin);
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 rest = v_madd(c->centre, 0.5 * echo->cell_m, unit_of(k));
    sonde_vec3 end = carry(echo, c, rest, v_madd(m->origin, 0.5, m->axis[k]));
    out.axis[k] = v_scale(v_sub(end, out.origin), 2);
  }
  return out;
}

// Its eight pieces. The middles of two neighbours are as far apart as a piece is long: one carried
// point per piece gives all the maps.
static void carry_pieces(const sonde_echo *echo, const cube *c, const map *m, map piece[8]) {
  for (int part = 0; part < 8; ++part) {
    map *out = &piece[part];
    sonde_vec3 rest = c->centre;
    out->origin = m->origin;
    for (int k = 0; k < 3; ++k) {
      out->origin = v_madd(out->origin, offset_of(part, k), m->axis[k]);
      rest = v_madd(rest, offset_of(part, k) * echo->cell_m, unit_of(k));
      out->axis[k] = v_scale(m->axis[k], 0.5);
    }
    if (c->moving) out->origin = carry(echo, c, rest, out->origin);
  }
  for (int part = 0; part < 8 && c->moving; ++part)
    for (int k = 0; k < 3; ++k)
      piece[part].axis[k] = v_sub(piece[part | 1 << k].origin, piece[part & ~(1 << k)].origin);
}

// Lumen of a vessel over one piece: forms of the scatterers' coordinates, 1 on the wall at rest.
typedef struct lumen {
  double along[4], across[4];
  double solid; // share of the short axis that clot fills, from the far side
} lumen;

// False when the piece lies beside the lumen or in solid clot, which belongs to the tissue.
static bool find_lumen(const sonde_echo *echo, const cube *c, uint32_t k, int part, lumen *out) {
  const sonde_vessel_state *v = &c->near[k];
  double scale = 1 / v->rest_radius_m, piece = 0.5 * echo->cell_m * scale;
  sonde_vec3 middle = c->centre, side = v_cross(v->axis, v->flat_axis);
  middle = v_add(middle, v_scale(vec3(offset_of(part, 0), offset_of(part, 1), offset_of(part, 2)),
                                 echo->cell_m));
  sonde_vec3 d = v_scale(v_sub(middle, v->rest_centre_m), scale);
  *out = (lumen){{v_dot(d, v->flat_axis), piece * v->flat_axis.x, piece * v->flat_axis.y,
                  piece * v->flat_axis.z},
                 {v_dot(d, side), piece * side.x, piece * side.y, piece * side.z},
                 sonde_echo_solid(echo, c->which[k], v->rest_centre_m.z)};
  return hypot(out->along[0], out->across[0]) < 1 + piece && out->solid < 1;
}

static bool in_lumen(const lumen *l, double x, double y, double z) {
  double a = l->along[0] + l->along[1] * x + l->along[2] * y + l->along[3] * z;
  double b = l->across[0] + l->across[1] * x + l->across[2] * y + l->across[3] * z;
  return a * a + b * b < 1 && !(-a > 1 - 2 * l->solid);
}

static int32_t below(double x) {
  int32_t i = (int32_t)x;
  return i - (x < i);
}

static uint64_t cell_key(const int32_t cell[3]) {
  return (uint64_t)(uint16_t)cell[0] << 32 | (uint64_t)(uint16_t)cell[1] << 16 | (uint16_t)cell[2];
}

// ---- laying ---------------------------------------------------------------------------------

double sonde_echo_elevation(const sonde_echo *echo, double depth_m) {
  double at = clamp(depth_m / echo->frame.depth_m, 0, 1) * SONDE_SLAB_ROWS;
  uint32_t k = at < SONDE_SLAB_ROWS ? (uint32_t)at : SONDE_SLAB_ROWS - 1;
  return echo->slab_m[k] + (at - k) * (echo->slab_m[k + 1] - echo->slab_m[k]);
}

void sonde_echo_lay(sonde_echo *echo, const map *m, const scatter_pool *pool, uint32_t from,
                    uint32_t count) {
  SONDE_ASSERT(count % ECHO_ALIGN == 0);
  const frame *f = &echo->frame;
  double half = sonde_echo_elevation(echo, m->origin.z * echo->depth_per_row);
  const double unit[3] = {echo->lines_per_column * SONDE_FINE, 1 / half,
                          echo->depth_per_row / f->step_m};
  splat_job job = {.x = pool->x + from,
                   .y = pool->y + from,
                   .z = pool->z + from,
                   .sign = pool->sign + from,
                   .count = count,
                   .cube = true,
                   .grid = echo->grid,
                   .stride = echo->grid_stride,
                   .turns = (float)(2 * f->step_m / f->wavelength_m),
                   .right = (float)(echo->grid_lines - 1),
                   .bottom = (float)echo->grid_samples - 1.5f};
  for (int k = 0; k < 4; ++k) {
    sonde_vec3 v = k == 0 ? m->origin : m->axis[k - 1];
    job.m[k][0] = (float)(v.x * unit[0]);
    job.m[k][1] = (float)(v.y * unit[1]);
    job.m[k][2] = (float)(v.z * unit[2]);
  }
  job.m[0][2] += (float)echo->pad_samples;
  float reach = 0.5f * (fabsf(job.m[1][1]) + fabsf(job.m[2][1]) + fabsf(job.m[3][1]));
  if (fabsf(job.m[0][1]) > 1 + reach) return;
  echo->moved += count;
  echo->kernels->splat(&job);
}

// Without the scatterers whose place at rest is in a lumen: blood has its own.
static void lay_outside(sonde_echo *echo, const map *m, const lumen *in, int lumens,
                        uint32_t from) {
  float x[MOST_PER_PIECE], y[MOST_PER_PIECE], z[MOST_PER_PIECE], sign[MOST_PER_PIECE];
  const scatter_pool *pool = &echo->loose;
  uint32_t kept = 0;
  SONDE_ASSERT(echo->per_piece <= MOST_PER_PIECE);
  for (uint32_t i = from; i < from + echo->per_piece; ++i) {
    double at[3] = {(double)pool->x[i], (double)pool->y[i], (double)pool->z[i]};
    bool inside = false;
    for (int k = 0; k < lumens; ++k) inside = inside || in_lumen(&in[k], at[0], at[1], at[2]);
    if (inside) continue;
    x[kept] = pool->x[i], y[kept] = pool->y[i], z[kept] = pool->z[i];
    sign[kept++] = pool->sign[i];
  }
  for (; kept % ECHO_ALIGN; ++kept) x[kept] = y[kept] = z[kept] = sign[kept] = 0;
  scatter_pool some = {x, y, z, sign};
  if (kept > 0) sonde_echo_lay(echo, m, &some, 0, kept);
}

static void place_pieces(sonde_echo *echo, const cube *c, const map *m) {
  uint32_t each = echo->per_piece, shares = SONDE_LOOSE / each;
  map piece[8];
  carry_pieces(echo, c, m, piece);
  for (int part = 0; part < 8; ++part) {
    uint32_t share = (uint32_t)(c->bits >> 32) + (uint32_t)part, from = share % shares * each;
    lumen in[MOST_VESSELS];
    int lumens = 0;
    for (uint32_t k = 0; k < c->near_count; ++k)
      if (find_lumen(echo, c, k, part, &in[lumens])) ++lumens;
    if (lumens > 0)
      lay_outside(echo, &piece[part], in, lumens, from);
    else
      sonde_echo_lay(echo, &piece[part], &echo->loose, from, each);
  }
}

static void place_cell(sonde_echo *echo, const int32_t cell[3], sonde_vec3 guess) {
  double h = echo->cell_m;
  cube c; // the states of vessels that are not near stay unset
  c.centre = vec3((cell[0] + 0.5) * h, (cell[1] + 0.5) * h, (cell[2] + 0.5) * h);
  c.bits = sonde_random_bits(echo->seed + 2, cell_key(cell));
  c.close = c.moving = false, c.near_count = 0;
  map m = cube_map(echo, c.centre, guess);
  if (echo->vessels) find_vessels(echo, &c);
  if (c.close) {
    place_pieces(echo, &c, &m);
    return;
  }
  map whole = carried(echo, &c, &m);
  for (int k = 0; k < 3; ++k) // mirrored patterns look new
    if (c.bits >> (61 + k) & 1) whole.axis[k] = v_neg(whole.axis[k]);
  uint32_t patterns = SONDE_POOL / echo->per_cell;
  sonde_echo_lay(echo, &whole, &echo->pool, (uint32_t)(c.bits % patterns) * echo->per_cell,
                 echo->per_cell);
}

// ---- cubes ----------------------------------------------------------------------------------

// The box of cubes around the slab at rest, none of them visited.
static void clear_seen(sonde_echo *echo) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (uint32_t k = 0; k < echo->plane_rows * SONDE_PLANE_COLUMNS; ++k) {
    const plane_node *n = &echo->node[k];
    double half = sonde_echo_elevation(echo, k / SONDE_PLANE_COLUMNS * echo->depth_per_row) + 1e-3;
    const double at[3] = {n->rest.x, n->rest.y, n->rest.z};
    const double side[3] = {n->beside.x, n->beside.y, n->beside.z};
    for (int c = 0; c < 3; ++c) {
      low[c] = fmin(low[c], at[c] - half * fabs(side[c]));
      high[c] = fmax(high[c], at[c] + half * fabs(side[c]));
    }
  }
  uint32_t cubes = 1;
  for (int c = 0; c < 3; ++c) {
    echo->box_first[c] = below(low[c] / echo->cell_m);
    double size = floor(high[c] / echo->cell_m) - echo->box_first[c] + 1;
    echo->box_size[c] = (uint32_t)clamp(size, 1, SONDE_BOX_SIDE);
    cubes *= echo->box_size[c];
  }
  memset(echo->seen, 0, (cubes + 63) / 64 * sizeof *echo->seen);
}

// True the first time in a frame.
static bool find(sonde_echo *echo, const int32_t cell[3]) {
  uint32_t at[3];
  for (int c = 0; c < 3; ++c) {
    at[c] = (uint32_t)(cell[c] - echo->box_first[c]);
    if (at[c] >= echo->box_size[c]) return false;
  }
  uint32_t bit = (at[2] * echo->box_size[1] + at[1]) * echo->box_size[0] + at[0];
  uint64_t *word = &echo->seen[bit / 64], mask = (uint64_t)1 << bit % 64;
  bool first = !(*word & mask);
  *word |= mask;
  return first;
}

// Samples `first`, `first` + `step`, .. beside the plane, in cubes.
static void visit(sonde_echo *echo, sonde_vec3 first, sonde_vec3 step, int count,
                  sonde_vec3 guess) {
  int32_t last[3] = {INT32_MIN, 0, 0};
  for (int k = 0; k < count; ++k) {
    const int32_t cell[3] = {below(first.x + k * step.x), below(first.y + k * step.y),
                             below(first.z + k * step.z)};
    if (cell[0] == last[0] && cell[1] == last[1] && cell[2] == last[2]) continue;
    memcpy(last, cell, sizeof last);
    if (!find(echo, cell) || echo->cell_count >= SONDE_MAX_CELLS) continue;
    ++echo->cell_count;
    place_cell(echo, cell, guess);
  }
}

// The fewest samples of a quad with these sides at rest.
static void choose_samples(const sonde_echo *echo, double wide, double high, int *across,
                           int *down) {
  double most = echo->cell_m * echo->cell_m - sampling_m * sampling_m, fewest = INFINITY;
  *across = *down = MOST_PIECES;
  for (int a = 1; a <= MOST_PIECES && a < fewest; ++a) {
    double left = most - wide * wide / (a * a);
    if (!(left > 0) && a < MOST_PIECES) continue;
    double d = clamp(ceil(high / sqrt(fmax(left, 1e-9))), 1, MOST_PIECES);
    if (a * d < fewest) fewest = a * d, *across = a, *down = (int)d;
  }
}

// As many samples as the quad's sides in rest coordinates ask for.
static void visit_quad(sonde_echo *echo, uint32_t i, uint32_t j) {
  const plane_node *n = &echo->node[j * SONDE_PLANE_COLUMNS + i], *low = n + SONDE_PLANE_COLUMNS;
  double wide = fmax(v_distance(n[0].rest, n[1].rest), v_distance(low[0].rest, low[1].rest));
  double high = fmax(v_distance(n[0].rest, low[0].rest), v_distance(n[1].rest, low[1].rest));
  int across, down;
  choose_samples(echo, wide, high, &across, &down);
  double half = sonde_echo_elevation(echo, (j + 0.5) * echo->depth_per_row);
  double inverse = 1 / echo->cell_m;
  sonde_vec3 side = v_lerp(n[0].beside, low[1].beside, 0.5);
  int slices = (int)clamp(ceil(2 * half * v_norm(side) / sampling_m), 2, 4 * MOST_PIECES) + 1;
  for (int jj = 0; jj < down; ++jj)
    for (int ii = 0; ii < across; ++ii) {
      double a = (ii + 0.5) / across, b = (jj + 0.5) / down;
      sonde_vec3 rest =
          v_lerp(v_lerp(n[0].rest, n[1].rest, a), v_lerp(low[0].rest, low[1].rest, a), b);
      sonde_vec3 first = v_scale(v_madd(rest, -half, side), inverse);
      visit(echo, first, v_scale(side, 2 * half * inverse / (slices - 1)), slices,
            vec3(i + a, 0, j + b));
    }
}

void sonde_echo_scatter(sonde_echo *echo) {
  SONDE_ASSERT(echo->per_cell % ECHO_ALIGN == 0 && echo->per_cell <= SONDE_POOL);
  clear_seen(echo);
  bound_vessels(echo);
  echo->cell_count = echo->moved = 0;
  for (uint32_t j = 0; j + 1 < echo->plane_rows; ++j)
    for (uint32_t i = 0; i + 1 < SONDE_PLANE_COLUMNS; ++i) visit_quad(echo, i, j);
}

// Points of the probe frame, in blocks of one vector.
void sonde_echo_scatter_points(sonde_echo *echo, const sonde_echo_point *points, uint32_t count) {
  const frame *f = &echo->frame;
  float x[ECHO_ALIGN], y[ECHO_ALIGN], z[ECHO_ALIGN], size[ECHO_ALIGN];
  splat_job job = {.x = x,
                   .y = y,
                   .z = z,
                   .sign = size,
                   .count = ECHO_ALIGN,
                   .grid = echo->grid,
                   .stride = echo->grid_stride,
                   .m = {{0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                   .turns = (float)(2 * f->step_m / f->wavelength_m),
                   .right = (float)(echo->grid_lines - 1),
                   .bottom = (float)echo->grid_samples - 1.5f};
  for (uint32_t i = 0; i < count; ++i) {
    sonde_vec3 at = sonde_echo_unplace(f, vec3(points[i].x_m, points[i].y_m, points[i].z_m));
    uint32_t k = i % ECHO_ALIGN;
    x[k] = (float)(at.x * SONDE_FINE + echo->pad_lines),
    z[k] = (float)(at.z / f->step_m + echo->pad_samples);
    y[k] = (float)(at.y / sonde_echo_elevation(echo, at.z)), size[k] = (float)points[i].amplitude;
    if (k + 1 < ECHO_ALIGN && i + 1 < count) continue;
    for (uint32_t rest = k + 1; rest < ECHO_ALIGN; ++rest) x[rest] = -1, size[rest] = 0;
    echo->kernels->splat(&job);
  }
}
