// Scatterers of the tissue around the image plane, moved with it and laid into the (sample x line)
// grid of the complex baseband field.
//
// Tissue is cut into cubes at rest. A cube's scatterers are a piece of the common pool chosen by
// the cube's key, so that the same tissue always shows the same speckle. Per frame one affine map
// per cube takes them straight to lines and samples; near a vessel whose wall has moved eight maps
// per cube follow it.
//
// sonde_echo_scatter  all cubes that the slab touches
// visit_quad, visit   cubes along one coarse quad
// find                each cube once
// locate              image coordinates of a rest point, and the derivative there
// cube_map            map of a cube without vessels
// find_walls, carry   what the vessels' walls do to it
// place_cell, place_pieces  a cube, or its pieces beside a vessel
// lay                 scatterers of one map into the grid
// sonde_echo_scatter_points  given points instead of tissue
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <string.h>

enum { MOST_PIECES = 12, NEWTON = 3 };

static const double sampling_m = 1.1e-3; // of the slab when looking for cubes
static const double reach_radii = 4.0;   // over which a wall moves the tissue around it
static const double piece_radii = 2.5;   // within which a cube needs smaller pieces

// p = origin + axis[0] x + axis[1] y + axis[2] z for x, y, z in +-1/2; image coordinates (columns,
// metres beside the plane, rows) or world.
typedef struct map {
  sonde_vec3 origin, axis[3];
} map;

// ---- from rest to the image ---------------------------------------------------------------

// Coarse column and row with the shares of the four nodes around.
typedef struct spot {
  const plane_node *node; // upper left
  double share[4];
} spot;

static spot spot_at(const sonde_echo *echo, double column, double row) {
  double a = clamp(column, 0, SONDE_PLANE_COLUMNS - 1.0), b = clamp(row, 0, SONDE_PLANE_ROWS - 1.0);
  uint32_t i = (uint32_t)a, j = (uint32_t)b;
  if (i > SONDE_PLANE_COLUMNS - 2) i = SONDE_PLANE_COLUMNS - 2;
  if (j > SONDE_PLANE_ROWS - 2) j = SONDE_PLANE_ROWS - 2;
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
           b = clamp(at.z, 0, SONDE_PLANE_ROWS - 1.0);
    spot s = spot_at(echo, a, b);
    *in = turn_at(&s);
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

// A vessel whose wall moves the tissue of a cube.
typedef struct wall {
  sonde_vessel_state state;
  sonde_vec3 across;
} wall;

static sonde_vec3 to_world(const sonde_echo *echo, sonde_vec3 at) {
  const frame *f = &echo->frame;
  double line = at.x * echo->lines_per_column - f->edge_lines;
  sonde_vec3 local = sonde_echo_place(f, line, at.z * echo->depth_per_row);
  local.y = at.y;
  return pose_apply(f->probe, local);
}

static sonde_vec3 from_world(const sonde_echo *echo, sonde_vec3 p) {
  const frame *f = &echo->frame;
  sonde_vec3 at = sonde_echo_unplace(f, m_mul_v(f->from_world, v_sub(p, f->probe.position)));
  return vec3((at.x + f->edge_lines) / echo->lines_per_column, at.y, at.z / echo->depth_per_row);
}

// World point of the undisturbed cross-section -> where the walls take it.
static sonde_vec3 carry(const wall *walls, int count, sonde_vec3 p) {
  for (int w = 0; w < count; ++w) {
    const sonde_vessel_state *v = &walls[w].state;
    sonde_vec3 d = v_sub(p, v->centre_m);
    double a = v_dot(d, v->flat_axis), b = v_dot(d, walls[w].across), a1 = a, b1 = b;
    sonde_vessel_carry(v, &a1, &b1);
    p = v_madd(v_madd(p, a1 - a, v->flat_axis), b1 - b, walls[w].across);
  }
  return p;
}

// Vessels whose moving wall reaches the cube; *close tells whether it needs smaller pieces.
static int find_walls(const sonde_echo *echo, sonde_vec3 rest, sonde_vec3 moved, wall *walls,
                      bool *close) {
  const sonde_interior *interior = echo->interior;
  double s = v_dot(v_sub(rest, interior->origin), interior->axis);
  int count = 0;
  *close = false;
  for (int which = 0; which < 2; ++which) {
    sonde_vessel_state v;
    if (!sonde_vessel_at(interior, which, s, &v)) continue;
    double distance = v_distance(moved, v.centre_m) / v.rest_radius_m;
    if (distance < piece_radii) *close = true;
    if (fabs(v.area_ratio - 1) < 0.01 || distance > reach_radii) continue;
    walls[count].state = v;
    walls[count++].across = v_cross(v.axis, v.flat_axis);
  }
  return count;
}

// Piece `part` (0..7) of a cube, carried by the walls; part < 0: the whole cube.
static map carried(const sonde_echo *echo, const wall *walls, int count, const map *m, int part) {
  double size = part < 0 ? 1 : 0.5;
  map out = {.origin = m->origin};
  for (int k = 0; k < 3 && part >= 0; ++k)
    out.origin = v_madd(out.origin, (part >> k & 1) ? 0.25 : -0.25, m->axis[k]);
  for (int k = 0; k < 3; ++k) out.axis[k] = v_scale(m->axis[k], size);
  if (count == 0) return out;
  sonde_vec3 centre = out.origin;
  out.origin = from_world(echo, carry(walls, count, to_world(echo, centre)));
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 end = to_world(echo, v_madd(centre, 0.5, out.axis[k]));
    out.axis[k] = v_scale(v_sub(from_world(echo, carry(walls, count, end)), out.origin), 2);
  }
  return out;
}

// ---- laying ---------------------------------------------------------------------------------

static double elevation_at(const sonde_echo *echo, double depth_m) {
  int band;
  double t = sonde_psf_band(echo->psf, depth_m, &band);
  const double *half = echo->psf->elevation_m + band;
  return half[0] + t * (half[1] - half[0]);
}

static void lay(sonde_echo *echo, const map *m, const scatter_pool *pool, uint32_t from,
                uint32_t count) {
  const frame *f = &echo->frame;
  double half = elevation_at(echo, m->origin.z * echo->depth_per_row);
  const double unit[3] = {echo->lines_per_column * SONDE_FINE, 1 / half,
                          echo->depth_per_row / f->step_m};
  splat_job job = {.x = pool->x + from,
                   .y = pool->y + from,
                   .z = pool->z + from,
                   .sign = pool->sign + from,
                   .count = count,
                   .cube = true,
                   .grid = echo->grid + 4,
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

static void place_pieces(sonde_echo *echo, const wall *walls, int count, const map *m,
                         uint64_t bits) {
  uint32_t each = echo->per_piece, shares = SONDE_LOOSE / each;
  for (int part = 0; part < 8; ++part) {
    map piece = carried(echo, walls, count, m, part);
    uint32_t share = (uint32_t)(bits >> 32) + (uint32_t)part;
    lay(echo, &piece, &echo->loose, share % shares * each, each);
  }
}

static void place_cell(sonde_echo *echo, const int32_t cell[3], uint64_t key, sonde_vec3 guess) {
  double h = echo->cell_m;
  sonde_vec3 centre = vec3((cell[0] + 0.5) * h, (cell[1] + 0.5) * h, (cell[2] + 0.5) * h);
  uint64_t bits = sonde_random_bits(echo->seed + 2, key);
  map m = cube_map(echo, centre, guess);
  wall walls[2];
  bool close = false;
  int count = 0;
  if (echo->vessels) count = find_walls(echo, centre, to_world(echo, m.origin), walls, &close);
  if (close && count > 0) {
    place_pieces(echo, walls, count, &m, bits);
  } else {
    map whole = carried(echo, walls, count, &m, -1);
    for (int k = 0; k < 3; ++k) // mirrored patterns look new
      if (bits >> (61 + k) & 1) whole.axis[k] = v_neg(whole.axis[k]);
    uint32_t patterns = SONDE_POOL / echo->per_cell;
    lay(echo, &whole, &echo->pool, (uint32_t)(bits % patterns) * echo->per_cell, echo->per_cell);
  }
}

// ---- cubes ----------------------------------------------------------------------------------

static uint64_t cell_key(const int32_t cell[3]) {
  return (uint64_t)(uint16_t)cell[0] << 32 | (uint64_t)(uint16_t)cell[1] << 16 | (uint16_t)cell[2];
}

// True the first time in a frame.
static bool find(sonde_echo *echo, uint64_t key) {
  uint64_t stamped = key << 16 | echo->stamp;
  uint32_t slot = (uint32_t)((key * 0x9e3779b97f4a7c15u) >> 40) % SONDE_CELL_SET;
  while ((uint16_t)echo->cell_set[slot] == echo->stamp) {
    if (echo->cell_set[slot] == stamped) return false;
    slot = (slot + 1) % SONDE_CELL_SET;
  }
  echo->cell_set[slot] = stamped;
  return true;
}

static void visit(sonde_echo *echo, sonde_vec3 rest, sonde_vec3 guess) {
  double inverse = 1 / echo->cell_m;
  const int32_t cell[3] = {(int32_t)floor(rest.x * inverse), (int32_t)floor(rest.y * inverse),
                           (int32_t)floor(rest.z * inverse)};
  uint64_t key = cell_key(cell);
  if (echo->cell_count >= SONDE_MAX_CELLS || !find(echo, key)) return;
  ++echo->cell_count;
  place_cell(echo, cell, key, guess);
}

// As many samples as the quad's sides in rest coordinates ask for.
static void visit_quad(sonde_echo *echo, uint32_t i, uint32_t j) {
  const plane_node *n = &echo->node[j * SONDE_PLANE_COLUMNS + i], *low = n + SONDE_PLANE_COLUMNS;
  double wide = fmax(v_distance(n[0].rest, n[1].rest), v_distance(low[0].rest, low[1].rest));
  double high = fmax(v_distance(n[0].rest, low[0].rest), v_distance(n[1].rest, low[1].rest));
  int across = (int)clamp(ceil(wide / sampling_m), 1, MOST_PIECES);
  int down = (int)clamp(ceil(high / sampling_m), 1, MOST_PIECES);
  double half = elevation_at(echo, (j + 0.5) * echo->depth_per_row);
  sonde_vec3 side = v_lerp(n[0].beside, low[1].beside, 0.5);
  int slices = (int)clamp(ceil(2 * half * v_norm(side) / sampling_m), 2, 4 * MOST_PIECES) + 1;
  for (int jj = 0; jj < down; ++jj)
    for (int ii = 0; ii < across; ++ii) {
      double a = (ii + 0.5) / across, b = (jj + 0.5) / down;
      sonde_vec3 rest =
          v_lerp(v_lerp(n[0].rest, n[1].rest, a), v_lerp(low[0].rest, low[1].rest, a), b);
      for (int k = 0; k < slices; ++k)
        visit(echo, v_madd(rest, half * (2.0 * k / (slices - 1) - 1), side), vec3(i + a, 0, j + b));
    }
}

void sonde_echo_scatter(sonde_echo *echo) {
  SONDE_ASSERT(echo->per_cell % ECHO_ALIGN == 0 && echo->per_cell <= SONDE_POOL);
  if (++echo->stamp == 0) {
    memset(echo->cell_set, 0, SONDE_CELL_SET * sizeof *echo->cell_set);
    echo->stamp = 1;
  }
  echo->cell_count = echo->moved = 0;
  for (uint32_t j = 0; j + 1 < SONDE_PLANE_ROWS; ++j)
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
                   .grid = echo->grid + 4,
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
    y[k] = (float)(at.y / elevation_at(echo, at.z)), size[k] = (float)points[i].amplitude;
    if (k + 1 < ECHO_ALIGN && i + 1 < count) continue;
    for (uint32_t rest = k + 1; rest < ECHO_ALIGN; ++rest) x[rest] = -1, size[rest] = 0;
    echo->kernels->splat(&job);
  }
}
