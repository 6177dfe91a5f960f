// Scatterers of the tissue around the image plane, moved with it and laid into the (sample x line)
// grid of the complex baseband field.
//
// Tissue is cut into cubes at rest. A cube's scatterers are a piece of the common pool chosen by
// the cube's key, so that the same tissue always shows the same speckle. Per frame one affine map
// per cube takes them to the probe frame; near a vessel eight maps per cube follow the wall.
//
// sonde_echo_scatter  all cubes that the slab touches
// collect_cells       distinct cubes along the plane, from the coarse rest points
// collect_quad        those of one coarse quad
// base_map, wall_map  affine maps of a cube
// splat               scatterers of one map into the grid
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

#include <string.h>

enum { SLICES = 5, MOST_PIECES = 12 };

static const double sampling_m = 1.2e-3; // of the slab when looking for cubes

// p = origin + axis[0] x + axis[1] y + axis[2] z for x, y, z in +-1/2, probe frame.
typedef struct map {
  sonde_vec3 origin, axis[3];
} map;

// ---- cubes --------------------------------------------------------------------------------

static uint64_t cell_key(int32_t a, int32_t b, int32_t c) {
  return ((uint64_t)(uint32_t)(a + (1 << 20)) << 42) | ((uint64_t)(uint32_t)(b + (1 << 20)) << 21) |
         (uint64_t)(uint32_t)(c + (1 << 20));
}

static void visit_cell(sonde_echo *echo, sonde_vec3 rest) {
  double inverse = 1 / echo->cell_m;
  int32_t a = (int32_t)floor(rest.x * inverse), b = (int32_t)floor(rest.y * inverse),
          c = (int32_t)floor(rest.z * inverse);
  uint64_t key = cell_key(a, b, c);
  uint32_t slot = (uint32_t)((key * 0x9e3779b97f4a7c15u) >> 48) % SONDE_CELL_SET;
  while (echo->cell_set[slot] != 0) {
    if (echo->cell_set[slot] == key) return;
    slot = (slot + 1) % SONDE_CELL_SET;
  }
  if (echo->cell_count >= SONDE_MAX_CELLS) return;
  echo->cell_set[slot] = key;
  int32_t *cell = echo->cells[echo->cell_count++];
  cell[0] = a, cell[1] = b, cell[2] = c;
}

// A quad of the coarse plane in rest coordinates: as many samples as its longest side asks for.
static void collect_quad(sonde_echo *echo, const sonde_vec3 *n, sonde_vec3 side) {
  const sonde_vec3 *low = n + SONDE_PLANE_COLUMNS;
  double longest = fmax(fmax(v_distance(n[0], n[1]), v_distance(low[0], low[1])),
                        fmax(v_distance(n[0], low[0]), v_distance(n[1], low[1])));
  int pieces = (int)clamp(ceil(longest / sampling_m), 1, MOST_PIECES);
  for (int j = 0; j < pieces; ++j)
    for (int i = 0; i < pieces; ++i) {
      double a = (i + 0.5) / pieces, b = (j + 0.5) / pieces;
      sonde_vec3 rest = v_lerp(v_lerp(n[0], n[1], a), v_lerp(low[0], low[1], a), b);
      for (int k = 0; k < SLICES; ++k)
        visit_cell(echo, v_madd(rest, sonde_elevation_half_m * (2.0 * k / (SLICES - 1) - 1), side));
    }
}

static void collect_cells(sonde_echo *echo) {
  memset(echo->cell_set, 0, SONDE_CELL_SET * sizeof *echo->cell_set);
  echo->cell_count = 0;
  sonde_vec3 side = q_rotate(echo->frame.probe.rotation, vec3(0, 1, 0));
  for (uint32_t j = 0; j + 1 < SONDE_PLANE_ROWS; ++j)
    for (uint32_t i = 0; i + 1 < SONDE_PLANE_COLUMNS; ++i)
      collect_quad(echo, echo->rest + j * SONDE_PLANE_COLUMNS + i, side);
}

// ---- maps ---------------------------------------------------------------------------------

static sonde_vec3 moved(const sonde_echo *echo, sonde_vec3 rest) {
  return v_add(rest, sonde_interior_field(echo->interior, rest));
}

// World positions: centre and half-edge differences of the moved cube.
static map base_map(const sonde_echo *echo, sonde_vec3 centre) {
  double h = echo->cell_m;
  map m = {.origin = moved(echo, centre)};
  sonde_vec3 step[3] = {vec3(0.5 * h, 0, 0), vec3(0, 0.5 * h, 0), vec3(0, 0, 0.5 * h)};
  for (int k = 0; k < 3; ++k)
    m.axis[k] = v_scale(v_sub(moved(echo, v_add(centre, step[k])), m.origin), 2);
  return m;
}

// A vessel whose wall moves the tissue of a cube.
typedef struct wall {
  sonde_vessel_state state;
  sonde_vec3 across;
} wall;

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

// Vessels whose moving wall reaches the cube; *close tells whether its edge needs smaller pieces.
static int find_walls(const sonde_echo *echo, sonde_vec3 rest, const map *m, wall *walls,
                      bool *close) {
  sonde_column_point at;
  int count = 0;
  *close = false;
  (void)sonde_interior_locate(echo->interior, rest, &at);
  for (int which = 0; which < 2; ++which) {
    sonde_vessel_state v;
    if (!sonde_vessel_at(echo->interior, which, at.s, &v)) continue;
    bool round = fabs(v.area_ratio - 1) < 0.01;
    double distance = v_distance(m->origin, v.centre_m) / v.rest_radius_m;
    if (round || distance > 4.5) continue;
    if (distance < 1.7) *close = true;
    walls[count].state = v;
    walls[count++].across = v_cross(v.axis, v.flat_axis);
  }
  return count;
}

// Piece `part` (0..7) of a cube, carried by the walls; part < 0: the whole cube.
static map wall_map(const wall *walls, int count, const map *m, int part) {
  double size = part < 0 ? 1 : 0.5;
  sonde_vec3 centre = m->origin;
  for (int k = 0; k < 3 && part >= 0; ++k)
    centre = v_madd(centre, (part >> k & 1) ? 0.25 : -0.25, m->axis[k]);
  map out = {.origin = carry(walls, count, centre)};
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 high = carry(walls, count, v_madd(centre, 0.5 * size, m->axis[k]));
    sonde_vec3 low = carry(walls, count, v_madd(centre, -0.5 * size, m->axis[k]));
    out.axis[k] = v_sub(high, low);
  }
  return out;
}

// ---- splat --------------------------------------------------------------------------------

enum { BATCH = 128 };

// Scatterers in grid units: line, sample, signed weight (0: outside the slab).
typedef struct batch {
  float line[BATCH], sample[BATCH], weight[BATCH];
} batch;

static void transform(const float m[4][3], const sonde_echo *echo, uint32_t from, uint32_t count,
                      batch *out) {
  const float *px = echo->pool_x + from, *py = echo->pool_y + from, *pz = echo->pool_z + from,
              *sign = echo->pool_sign + from;
  for (uint32_t i = 0; i < count; ++i) {
    float y = m[0][1] + px[i] * m[1][1] + py[i] * m[2][1] + pz[i] * m[3][1];
    out->line[i] = m[0][0] + px[i] * m[1][0] + py[i] * m[2][0] + pz[i] * m[3][0];
    out->sample[i] = m[0][2] + px[i] * m[1][2] + py[i] * m[2][2] + pz[i] * m[3][2];
    float inside = 1 - y * y;
    inside = inside > 0 ? inside : 0;
    out->weight[i] = inside * inside * sign[i];
  }
}

// Two taps along and two across; the carrier's phase is that of the exact depth.
static void lay(sonde_echo *echo, const batch *in, uint32_t count, float turns) {
  const float right = (float)(echo->grid_lines - 1), bottom = (float)(echo->grid_samples - 1);
  const size_t stride = 2 * (size_t)echo->grid_lines;
  for (uint32_t i = 0; i < count; ++i) {
    float x = in->line[i], z = in->sample[i], weight = in->weight[i];
    if (weight == 0 || !(x >= 0 && x < right && z >= 0 && z < bottom)) continue;
    int32_t line = (int32_t)x, sample = (int32_t)z;
    float a = x - (float)line, b = z - (float)sample;
    int32_t phase = (int32_t)(z * turns) & (SONDE_PHASES - 1);
    float re = weight * echo->phase[2 * phase], im = weight * echo->phase[2 * phase + 1];
    float *g = echo->grid + (size_t)sample * stride + 2 * (size_t)line;
    float re0 = (1 - b) * re, im0 = (1 - b) * im, re1 = b * re, im1 = b * im;
    g[0] += (1 - a) * re0, g[1] += (1 - a) * im0, g[2] += a * re0, g[3] += a * im0;
    g += stride;
    g[0] += (1 - a) * re1, g[1] += (1 - a) * im1, g[2] += a * re1, g[3] += a * im1;
  }
}

static void splat(sonde_echo *echo, const map *world, uint32_t from, uint32_t count) {
  SONDE_ASSERT(from + count <= SONDE_POOL + echo->per_cell);
  const frame *f = &echo->frame;
  float m[4][3]; // probe frame, in units of lines, elevation halves, samples
  const float unit[3] = {(float)(1 / f->pitch_m), (float)(1 / sonde_elevation_half_m),
                         (float)(1 / f->step_m)};
  for (int k = 0; k < 4; ++k) {
    sonde_vec3 w = k == 0 ? v_sub(world->origin, f->probe.position) : world->axis[k - 1];
    sonde_vec3 p = m_mul_v(f->from_world, w);
    m[k][0] = (float)p.x * unit[0], m[k][1] = (float)p.y * unit[1], m[k][2] = (float)p.z * unit[2];
  }
  m[0][0] += 0.5f * (float)(echo->lines - 1) + SONDE_LINE_PAD;
  m[0][2] += SONDE_SAMPLE_PAD;
  float reach = 0.5f * (fabsf(m[1][1]) + fabsf(m[2][1]) + fabsf(m[3][1]));
  if (fabsf(m[0][1]) > 1 + reach) return;
  const float turns = (float)(2 * f->step_m / f->wavelength_m * SONDE_PHASES);
  for (uint32_t first = 0; first < count; first += BATCH) {
    uint32_t size = count - first < BATCH ? count - first : BATCH;
    batch moved_points;
    transform(m, echo, from + first, size, &moved_points);
    lay(echo, &moved_points, size, turns);
  }
}

static void scatter_cell(sonde_echo *echo, const int32_t cell[3]) {
  double h = echo->cell_m;
  sonde_vec3 centre = vec3((cell[0] + 0.5) * h, (cell[1] + 0.5) * h, (cell[2] + 0.5) * h);
  uint64_t bits = sonde_random_bits(echo->seed + 2, cell_key(cell[0], cell[1], cell[2]));
  uint32_t from = (uint32_t)(bits % SONDE_POOL);
  map m = base_map(echo, centre);
  wall walls[2];
  bool close;
  int count = find_walls(echo, centre, &m, walls, &close);
  if (count == 0) {
    splat(echo, &m, from, echo->per_cell);
  } else if (!close) {
    map moved_map = wall_map(walls, count, &m, -1);
    splat(echo, &moved_map, from, echo->per_cell);
  } else {
    uint32_t each = echo->per_cell / 8;
    for (int part = 0; part < 8; ++part) {
      map piece = wall_map(walls, count, &m, part);
      splat(echo, &piece, from + (uint32_t)part * each, each);
    }
  }
}

void sonde_echo_scatter(sonde_echo *echo) {
  memset(echo->grid, 0, 2 * sizeof(float) * echo->grid_lines * echo->grid_samples);
  collect_cells(echo);
  for (uint32_t i = 0; i < echo->cell_count; ++i) scatter_cell(echo, echo->cells[i]);
}
