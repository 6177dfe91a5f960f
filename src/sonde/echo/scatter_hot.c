// The tissue around the image plane, cut into cubes at rest, and single points, into the (sample x
// line) grid of the complex baseband field.
//
// A cube's scatterers are a piece of the common pool chosen by the cube's key, so that the same
// tissue always shows the same speckle. Where they go: cube_hot.c.
//
// sonde_echo_scatter  all cubes that the slab touches
// visit_quad, visit, choose_samples  cubes along one coarse quad
// clear_seen, find    each cube once
// sonde_echo_to_world, sonde_echo_from_world  image coordinates
// sonde_echo_elevation  half height of the slab
// sonde_echo_scatter_points  given points instead of tissue
#include "base/base.h"
#include "echo/cubes.h"
#include "echo/tiers.h"

#include <string.h>

enum { MOST_PIECES = 12 };

// Of the slab when looking for cubes. A grid meets every cube when no point is farther from it than
// a cube's inscribed ball reaches: half the diagonal of its cells.
static const double sampling_m = 1.1e-3; // beside the plane

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

// ---- the slab -------------------------------------------------------------------------------

double sonde_echo_elevation(const sonde_echo *echo, double depth_m) {
  double at = clamp(depth_m / echo->frame.depth_m, 0, 1) * SONDE_SLAB_ROWS;
  uint32_t k = at < SONDE_SLAB_ROWS ? (uint32_t)at : SONDE_SLAB_ROWS - 1;
  return echo->slab_m[k] + (at - k) * (echo->slab_m[k + 1] - echo->slab_m[k]);
}

// ---- cubes ----------------------------------------------------------------------------------

static int32_t below(double x) {
  int32_t i = (int32_t)x;
  return i - (x < i);
}

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
  double cubes = 1;
  for (int c = 0; c < 3; ++c) {
    echo->box_first[c] = below(low[c] / echo->cell_m);
    double size = floor(high[c] / echo->cell_m) - echo->box_first[c] + 1, room = SONDE_BOX_CUBES;
    echo->box_size[c] = (uint32_t)clamp(size, 1, floor(room / cubes));
    if (size > echo->box_size[c]) ++echo->lost;
    cubes *= echo->box_size[c];
  }
  memset(echo->seen, 0, ((size_t)cubes + 63) / 64 * sizeof *echo->seen);
}

// True the first time in a frame; `place` counts along the box, x fastest.
static bool find(sonde_echo *echo, uint32_t place) {
  uint64_t *word = &echo->seen[place / 64], mask = (uint64_t)1 << place % 64;
  bool first = !(*word & mask);
  *word |= mask;
  return first;
}

// Samples of the slab in one place: `rest` in the plane, and its image coordinates.
typedef struct probe {
  float_x4 rest, at, in[3];
} probe;

// Samples `first`, `first` + `step`, .. beside the plane, in cubes from the corner of the box; what
// lies beyond it is taken for its border. The first guess of a cube's image coordinates is a step
// of Newton's from the plane.
static void visit(sonde_echo *echo, const probe *p, float_x4 first, float_x4 step, int count) {
  const uint32_t *size = echo->box_size;
  const float_x4 most = {(float)size[0] - 0.5f, (float)size[1] - 0.5f, (float)size[2] - 0.5f, 0};
  const float h = (float)echo->cell_m;
  uint32_t last = UINT32_MAX;
  for (int k = 0; k < count; ++k) {
    int_x4 at = vint(vmin(vmax(first + (float)k * step, vset_float_x4(0)), most));
    uint32_t place = ((uint32_t)at[2] * size[1] + (uint32_t)at[1]) * size[0] + (uint32_t)at[0];
    if (place == last) continue;
    last = place;
    if (!find(echo, place)) continue;
    if (echo->cell_count == SONDE_MAX_CELLS) {
      ++echo->lost;
      continue;
    }
    ++echo->cell_count;
    const int32_t *corner = echo->box_first;
    const int32_t cell[3] = {corner[0] + at[0], corner[1] + at[1], corner[2] + at[2]};
    float_x4 rest = (__builtin_convertvector(at, float_x4) + 0.5f) * h;
    sonde_cubes_add(echo, cell, rest, p->at + transform_point(p->in, rest - p->rest));
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

static double longer(float_x4 a, float_x4 b) {
  return (double)sqrtf(fmaxf(dot_points(a, a), dot_points(b, b)));
}

// As many samples as the quad's sides in rest coordinates ask for.
static void visit_quad(sonde_echo *echo, uint32_t i, uint32_t j) {
  const plane_node *n = &echo->node[j * SONDE_PLANE_COLUMNS + i];
  const cube_node *top = &echo->cubes->node[j * SONDE_PLANE_COLUMNS + i];
  const cube_node *low = top + SONDE_PLANE_COLUMNS;
  const float_x4 right = top[1].rest - top[0].rest, below_right = low[1].rest - low[0].rest;
  int across, down;
  choose_samples(echo, longer(right, below_right),
                 longer(low[0].rest - top[0].rest, low[1].rest - top[1].rest), &across, &down);
  double half = sonde_echo_elevation(echo, (j + 0.5) * echo->depth_per_row);
  sonde_vec3 side = v_lerp(n[0].beside, n[SONDE_PLANE_COLUMNS + 1].beside, 0.5);
  int slices = (int)clamp(ceil(2 * half * v_norm(side) / sampling_m), 2, 4 * MOST_PIECES) + 1;
  const float_x4 reach = point_of(v_scale(side, half / echo->cell_m));
  const float_x4 step = reach * (2 / (float)(slices - 1));
  const float inverse = (float)(1 / echo->cell_m);
  probe p = {.in = {top->in[0], top->in[1], top->in[2]}};
  for (int jj = 0; jj < down; ++jj)
    for (int ii = 0; ii < across; ++ii) {
      const float a = ((float)ii + 0.5f) / (float)across, b = ((float)jj + 0.5f) / (float)down;
      const float_x4 above = top[0].rest + a * right, under = low[0].rest + a * below_right;
      p.rest = above + b * (under - above);
      p.at = (float_x4){(float)i + a, 0, (float)j + b, 0};
      visit(echo, &p, p.rest * inverse - reach, step, slices);
    }
}

// Outside the leg nothing scatters: its depth there is negative.
static bool has_tissue(const sonde_echo *echo, uint32_t i, uint32_t j) {
  SONDE_ASSERT(i + 1 < SONDE_PLANE_COLUMNS && j + 1 < echo->plane_rows);
  const float *depth = echo->plane + (size_t)PLANE_DEPTH * SONDE_PLANE_NODES;
  const float *top = depth + j * SONDE_PLANE_COLUMNS + i, *low = top + SONDE_PLANE_COLUMNS;
  return top[0] >= 0 || top[1] >= 0 || low[0] >= 0 || low[1] >= 0;
}

void sonde_echo_scatter(sonde_echo *echo) {
  SONDE_ASSERT(echo->per_cell % ECHO_ALIGN == 0 && echo->per_cell <= SONDE_POOL);
  SONDE_ASSERT(echo->per_piece % ECHO_ALIGN == 0 && echo->per_piece <= SONDE_LOOSE);
  echo->cell_count = echo->moved = 0;
  clear_seen(echo);
  sonde_cubes_begin(echo);
  for (uint32_t j = 0; j + 1 < echo->plane_rows; ++j)
    for (uint32_t i = 0; i + 1 < SONDE_PLANE_COLUMNS; ++i)
      if (has_tissue(echo, i, j)) visit_quad(echo, i, j);
  sonde_cubes_end(echo);
}

// Points of the probe frame, in blocks of one vector.
void sonde_echo_scatter_points(sonde_echo *echo, const sonde_echo_point *points, uint32_t count,
                               uint32_t tier) {
  const frame *f = &echo->frame;
  float x[ECHO_ALIGN], y[ECHO_ALIGN], z[ECHO_ALIGN], size[ECHO_ALIGN];
  const splat_map one = {.m = {{0, 0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .count = ECHO_ALIGN};
  splat_job job = sonde_echo_splat_job(echo);
  job.x = x, job.y = y, job.z = z, job.sign = size, job.map = &one, job.maps = 1;
  job.rows = sonde_tiers_limits(echo, tier);
  uint32_t k = 0;
  for (uint32_t i = 0; i < count; ++i) {
    sonde_vec3 at = sonde_echo_unplace(f, vec3(points[i].x_m, points[i].y_m, points[i].z_m));
    x[k] = (float)(at.x * SONDE_FINE + echo->pad_lines),
    z[k] = (float)(at.z / f->step_m + echo->pad_samples);
    y[k] = (float)(at.y / sonde_echo_elevation(echo, at.z)), size[k] = (float)points[i].amplitude;
    if (z[k] >= job.rows.first - 1 && z[k] < job.rows.last + 1) ++k;
    if (k == ECHO_ALIGN) echo->kernels->splat(&job), k = 0;
  }
  for (uint32_t rest = k; rest < ECHO_ALIGN; ++rest)
    x[rest] = -1, y[rest] = z[rest] = size[rest] = 0;
  if (k > 0) echo->kernels->splat(&job);
}
