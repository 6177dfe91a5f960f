// First stage of the scatterers: the cubes of tissue that the slab around the image plane touches.
//
// Tissue is cut into cubes at rest, each with a pattern of scatterers that its place chooses, so
// that the same tissue always shows the same speckle. The slab is sampled so densely that it meets
// every cube; a bit per cube of the box around the slab takes each once.
#include "base/base.h"
#include "echo/cubes.h"

#include <string.h>

enum { MOST_PIECES = 12 };

// Between samples beside the plane. A grid meets every cube when no point is farther from it than a
// cube's inscribed ball reaches: half the diagonal of its cells.
static const double sampling_m = 1.1e-3;

void sonde_cubes_begin(sonde_echo *echo) {
  sonde_cubes *s = echo->cubes;
  const uint32_t nodes = echo->plane_rows * SONDE_PLANE_COLUMNS;
  const double h = echo->cell_m;
  // Bounds of the slab at rest.
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (uint32_t k = 0; k < nodes; ++k) {
    const plane_node *n = &echo->node[k];
    double half = sonde_echo_elevation(echo, k / SONDE_PLANE_COLUMNS * echo->depth_per_row) + 1e-3;
    for (int c = 0; c < 3; ++c) {
      double at = v_coordinate(n->rest, c), side = half * fabs(v_coordinate(n->beside, c));
      low[c] = fmin(low[c], at - side), high[c] = fmax(high[c], at + side);
    }
  }
  // Box of whole cubes around it, none of them visited.
  double cubes = 1;
  for (int c = 0; c < 3; ++c) {
    echo->box_first[c] = (int32_t)floor(low[c] / h);
    double size = floor(high[c] / h) - echo->box_first[c] + 1, room = SONDE_BOX_CUBES;
    echo->box_size[c] = (uint32_t)clamp(size, 1, floor(room / cubes));
    if (size > echo->box_size[c]) ++echo->lost;
    cubes *= echo->box_size[c];
  }
  memset(echo->seen, 0, ((size_t)cubes + 63) / 64 * sizeof *echo->seen);
  s->slab_count = 0;
  // The coarse plane from the box's corner, in single precision.
  s->corner = vec3(h * echo->box_first[0], h * echo->box_first[1], h * echo->box_first[2]);
  for (uint32_t k = 0; k < nodes; ++k) {
    const plane_node *from = &echo->node[k];
    s->node[k].rest = point_of(v_sub(from->rest, s->corner));
    for (int c = 0; c < 3; ++c) s->node[k].in[c] = point_of(m_column(&from->in, c));
  }
}

// Samples of the slab on a line through the plane; what lies beyond the box is taken for its
// border. The first guess of a cube's image coordinates is a step of Newton's from the plane: from
// image coordinates `at` of the point `rest`, by the derivative of `node`.
static void add_cubes(sonde_echo *echo, const cube_node *node, float_x4 rest, float_x4 at,
                      float_x4 reach, int samples) {
  sonde_cubes *s = echo->cubes;
  const uint32_t *size = echo->box_size;
  const float_x4 most = {(float)size[0] - 0.5f, (float)size[1] - 0.5f, (float)size[2] - 0.5f, 0};
  const float h = (float)echo->cell_m, inverse = (float)(1 / echo->cell_m);
  const float_x4 first = rest * inverse - reach, step = reach * (2 / (float)(samples - 1));
  uint32_t last = UINT32_MAX;
  for (int k = 0; k < samples; ++k) {
    int_x4 cube = vint(vmin(vmax(first + (float)k * step, vset_float_x4(0)), most));
    uint32_t place =
        ((uint32_t)cube[2] * size[1] + (uint32_t)cube[1]) * size[0] + (uint32_t)cube[0];
    if (place == last) continue;
    last = place;
    // Each cube once a frame.
    uint64_t *word = &echo->seen[place / 64], bit = (uint64_t)1 << place % 64;
    if (*word & bit) continue;
    *word |= bit;
    if (s->slab_count == SONDE_MAX_CELLS) {
      ++echo->lost;
      continue;
    }
    float_x4 middle = (vreal(cube) + 0.5f) * h;
    s->slab[s->slab_count++] = (slab_cube){
        middle,
        at + transform_point(node->in, middle - rest),
        {echo->box_first[0] + cube[0], echo->box_first[1] + cube[1], echo->box_first[2] + cube[2]}};
  }
}

static double longer(float_x4 a, float_x4 b) {
  return (double)sqrtf(fmaxf(dot_points(a, a), dot_points(b, b)));
}

// As many samples of a quad of the coarse plane as its sides at rest ask for, as few as may be.
static void sample_quad(sonde_echo *echo, uint32_t i, uint32_t j) {
  const plane_node *n = &echo->node[j * SONDE_PLANE_COLUMNS + i];
  const cube_node *top = &echo->cubes->node[j * SONDE_PLANE_COLUMNS + i];
  const cube_node *low = top + SONDE_PLANE_COLUMNS;
  const float_x4 right = top[1].rest - top[0].rest, below_right = low[1].rest - low[0].rest;
  // In the plane.
  const double wide = longer(right, below_right);
  const double high = longer(low[0].rest - top[0].rest, low[1].rest - top[1].rest);
  const double most = echo->cell_m * echo->cell_m - sampling_m * sampling_m;
  double fewest = INFINITY;
  int across = MOST_PIECES, down = MOST_PIECES;
  for (int a = 1; a <= MOST_PIECES && a < fewest; ++a) {
    double rest = most - wide * wide / (a * a);
    if (!(rest > 0) && a < MOST_PIECES) continue;
    double d = clamp(ceil(high / sqrt(fmax(rest, 1e-9))), 1, MOST_PIECES);
    if (a * d < fewest) fewest = a * d, across = a, down = (int)d;
  }
  // Beside the plane, over the slab's height.
  const double half = sonde_echo_elevation(echo, (j + 0.5) * echo->depth_per_row);
  const sonde_vec3 side = v_lerp(n[0].beside, n[SONDE_PLANE_COLUMNS + 1].beside, 0.5);
  const int samples =
      (int)clamp(ceil(2 * half * v_norm(side) / sampling_m), 2, 4 * MOST_PIECES) + 1;
  const float_x4 reach = point_of(v_scale(side, half / echo->cell_m));
  for (int jj = 0; jj < down; ++jj)
    for (int ii = 0; ii < across; ++ii) {
      const float a = ((float)ii + 0.5f) / (float)across, b = ((float)jj + 0.5f) / (float)down;
      const float_x4 above = top[0].rest + a * right, under = low[0].rest + a * below_right;
      const float_x4 at = {(float)i + a, 0, (float)j + b, 0};
      add_cubes(echo, top, above + b * (under - above), at, reach, samples);
    }
}

void sonde_cubes_find(sonde_echo *echo) {
  sonde_cubes_begin(echo);
  const float *depth = echo->plane + (size_t)PLANE_DEPTH * SONDE_PLANE_NODES;
  SONDE_ASSERT(echo->plane_rows >= 2 && echo->plane_rows <= SONDE_PLANE_ROWS);
  for (uint32_t j = 0; j + 1 < echo->plane_rows; ++j)
    for (uint32_t i = 0; i + 1 < SONDE_PLANE_COLUMNS; ++i) {
      // Outside the leg, where the depth below the skin is negative, nothing scatters.
      const float *top = depth + j * SONDE_PLANE_COLUMNS + i, *low = top + SONDE_PLANE_COLUMNS;
      if (top[0] >= 0 || top[1] >= 0 || low[0] >= 0 || low[1] >= 0) sample_quad(echo, i, j);
    }
}
