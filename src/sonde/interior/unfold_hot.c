// A displacement that is linear in the load folds the tissue where the load is large: strains add
// up where stretches should be multiplied, and beyond a strain of one a layer lies inside out. Two
// steps bring the grid back.
//
// Columns: a layer that is shortened by more than a bound stiffens, as tissue does: its stretch
// goes on falling but stays above zero, and the layers of the column share what it no longer takes
// as springs in series do. Skin and bone stay where they are.
//
// Elements: where a Bernstein coefficient of an element's volume is a small share of the volume at
// rest, the element's nodes move along its derivative until it is not (projected Gauss-Seidel);
// bone and the skin under the face are held.
#include "interior/unfold.h"

#include "base/base.h"

#include <string.h>

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };
enum { SWEEPS = 400, FAST = 200, STEPS = 12 };

static const double stiff_from = 0.55;   // compressive strain beyond which a layer stiffens
static const double least_column = 0.12; // of a column's height at rest
static const double least_volume = 0.06, aim = 0.10;  // of a volume at rest
static const double fast = 1.3;                       // relaxation of the first sweeps
static const double most_change = 0.2;                // of an edge at rest
static const double calm_from = 0.35, calm_to = 0.15; // least corner of the columns' field
static const double quiet_m = 1e-3;                   // displacement that folds nothing

// ---- columns ------------------------------------------------------------------------------

// Stretch of a layer that the linear field would shorten by `strain`, and its slope.
static double stretch_of(double strain, double *slope) {
  const double left = 1 - stiff_from;
  *slope = -1;
  if (strain <= stiff_from) return 1 - strain;
  double share = 1 / (1 + (strain - stiff_from) / left);
  *slope = -share * share;
  return left * share;
}

// How much more than under the linear field the layers that are shortened have to be, so that the
// column's height is `goal`.
static double share_out(const double height[NL], const double strain[NL], double goal) {
  double more = 1;
  for (int n = 0; n < STEPS; ++n) {
    double sum = 0, change = 0, slope;
    for (int l = 0; l + 1 < NL; ++l) {
      bool shorter = strain[l] > 0;
      sum += height[l] * stretch_of(shorter ? more * strain[l] : strain[l], &slope);
      if (shorter) change += height[l] * slope * strain[l];
    }
    double step = (goal - sum) / change;
    more += step;
    if (fabs(step) < 1e-4 * more) break;
  }
  return more;
}

static bool stretch_column(sonde_vec3 *now, const sonde_vec3 *rest) {
  double height[NL], strain[NL], most = 0, goal = 0, tall = 0, at = 0, slope;
  double r = hypot(rest[0].x, rest[0].y), cosine = rest[0].x / r, sine = rest[0].y / r;
  for (int l = 0; l + 1 < NL; ++l) {
    sonde_vec3 h = v_sub(rest[l], rest[l + 1]), d = v_sub(now[l], now[l + 1]);
    height[l] = h.x * cosine + h.y * sine;
    double rise = d.x * cosine + d.y * sine;
    strain[l] = 1 - rise / height[l];
    most = fmax(most, strain[l]), goal += rise, tall += height[l];
  }
  if (!(most > stiff_from)) return false;
  double more = share_out(height, strain, fmax(goal, least_column * tall));
  for (int l = NL - 2; l >= 0; --l) {
    at += height[l] * stretch_of(strain[l] > 0 ? more * strain[l] : strain[l], &slope);
    double is = (now[l].x - now[NL - 1].x) * cosine + (now[l].y - now[NL - 1].y) * sine;
    now[l].x += (at - is) * cosine, now[l].y += (at - is) * sine;
  }
  return true;
}

// ---- elements -----------------------------------------------------------------------------

// Edges of an element along its three axes: around, along the leg, inwards.
typedef struct edges {
  sonde_vec3 x[2][2], y[2][2], z[2][2]; // of the other two axes' places, in the axes' order
} edges;

static void read_edges(const sonde_vec3 *p, const uint32_t node[8], edges *e) {
  for (uint32_t i = 0; i < 2; ++i)
    for (uint32_t j = 0; j < 2; ++j) {
      e->x[i][j] = v_sub(p[node[1 + 2 * i + 4 * j]], p[node[2 * i + 4 * j]]);
      e->y[i][j] = v_sub(p[node[2 + i + 4 * j]], p[node[i + 4 * j]]);
      e->z[i][j] = v_sub(p[node[4 + i + 2 * j]], p[node[i + 2 * j]]);
    }
}

// One Bernstein coefficient of an element's volume, {a, b, c} each 0, 1 or 2: the mean of what
// edges span whose places along each axis add up to it.
typedef struct coefficient {
  uint32_t a, b, c;
} coefficient;

#define FOR_EDGES(q)                                                                               \
  for (uint32_t i = (q).a > 1; i <= ((q).a > 0); ++i)                                              \
    for (uint32_t j = (q).b > 1; j <= ((q).b > 0); ++j)                                            \
      for (uint32_t k = (q).c > 1; k <= ((q).c > 0); ++k)

// Over the element's volume at rest there.
static double scale_of(const sonde_grid *grid, uint32_t hex, coefficient q) {
  double sum = 0, count = 0;
  FOR_EDGES(q) sum += fabs(grid->per_volume[hex][i + 2 * j + 4 * k]), ++count;
  return -sum / (count * count);
}

static double share_in(const edges *e, coefficient q, double scale) {
  double sum = 0;
  FOR_EDGES(q)
  sum += v_dot(e->x[j][k], v_cross(e->y[i][q.c - k], e->z[q.a - i][q.b - j]));
  return sum * scale;
}

// Derivative of share_in by the element's nodes.
static void slope_of(const edges *e, coefficient q, double scale, sonde_vec3 g[8]) {
  for (int n = 0; n < 8; ++n) g[n] = vec3(0, 0, 0);
  FOR_EDGES(q) {
    const sonde_vec3 *x = &e->x[j][k], *y = &e->y[i][q.c - k], *z = &e->z[q.a - i][q.b - j];
    const sonde_vec3 by[3] = {v_cross(*y, *z), v_cross(*z, *x), v_cross(*x, *y)};
    const uint32_t from[3] = {2 * j + 4 * k, i + 4 * (q.c - k), (q.a - i) + 2 * (q.b - j)};
    for (int axis = 0; axis < 3; ++axis) {
      g[from[axis]] = v_madd(g[from[axis]], -scale, by[axis]);
      g[from[axis] + (1u << axis)] = v_madd(g[from[axis] + (1u << axis)], scale, by[axis]);
    }
  }
}

static bool is_free(const sonde_unfold *u, uint32_t node) {
  uint32_t level = node % NL;
  return level + 1 < NL && (level > 0 || !u->held[node / NL]);
}

// Moves an element's nodes until this coefficient is `aim`.
static void widen(sonde_unfold *u, const uint32_t node[8], coefficient q, double scale) {
  edges e;
  sonde_vec3 g[8];
  read_edges(u->now, node, &e);
  double share = share_in(&e, q, scale), sum = 0;
  if (share >= aim) return;
  slope_of(&e, q, scale, g);
  for (int k = 0; k < 8; ++k)
    if (is_free(u, node[k])) sum += v_norm2(g[k]);
  double step = sum > 0 ? u->relaxation * (aim - share) / sum : 0;
  for (int k = 0; k < 8; ++k)
    if (is_free(u, node[k])) u->now[node[k]] = v_madd(u->now[node[k]], step, g[k]);
}

static void list_nodes(uint32_t hex, uint32_t node[8]) {
  uint32_t corner[4];
  for (uint32_t k = 0; k < 8; ++k) sonde_grid_corner(hex, k, corner), node[k] = corner[0];
}

// Whether an element's edges are so near what they are at rest that it can't be small.
static bool is_little_bent(const sonde_unfold *u, const sonde_grid *grid, const uint32_t node[8]) {
  for (uint32_t axis = 0; axis < 3; ++axis)
    for (uint32_t k = 0; k < 8; ++k) {
      if (k >> axis & 1) continue;
      uint32_t from = node[k], to = node[k + (1u << axis)];
      sonde_vec3 rest = v_sub(grid->node[to], grid->node[from]);
      sonde_vec3 change = v_sub(v_sub(u->now[to], u->now[from]), rest);
      if (v_norm2(change) > most_change * most_change * v_norm2(rest)) return false;
    }
  return true;
}

// The element's coefficients that are below `bound`; *least receives the least so far.
static uint32_t count_below(const sonde_unfold *u, const sonde_grid *grid, uint32_t hex,
                            double bound, double *least) {
  uint32_t node[8], count = 0;
  edges e;
  list_nodes(hex, node);
  if (is_little_bent(u, grid, node)) return 0;
  read_edges(u->now, node, &e);
  for (uint32_t k = 0; k < 27; ++k) {
    const coefficient q = {k % 3, k / 3 % 3, k / 9};
    double share = share_in(&e, q, scale_of(grid, hex, q));
    *least = fmin(*least, share), count += share < bound;
  }
  return count;
}

// An element and those around it are looked at in the next sweeps.
static void wake(sonde_unfold *u, uint32_t hex) {
  SONDE_ASSERT(hex < SONDE_GRID_HEXES);
  int l = (int)(hex % (NL - 1)), i = (int)(hex / (NL - 1) % NT), j = (int)(hex / (NL - 1) / NT);
  for (int b = j > 0 ? j - 1 : 0; b <= j + 1 && b < NS - 1; ++b)
    for (int a = i + NT - 1; a <= i + NT + 1; ++a)
      for (int c = l > 0 ? l - 1 : 0; c <= l + 1 && c < NL - 1; ++c)
        u->awake[(b * NT + a % NT) * (NL - 1) + c] = 3;
}

static uint32_t sweep(sonde_unfold *u, const sonde_grid *grid) {
  uint32_t small = 0;
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h) {
    if (u->awake[h] == 0) continue;
    uint32_t node[8];
    double least = INFINITY;
    --u->awake[h];
    if (count_below(u, grid, h, aim, &least) == 0) continue;
    list_nodes(h, node);
    for (uint32_t k = 0; k < 27; ++k) {
      const coefficient q = {k % 3, k / 3 % 3, k / 9};
      widen(u, node, q, scale_of(grid, h, q));
    }
    wake(u, h), small += least < 0.5 * (least_volume + aim);
  }
  return small;
}

bool sonde_unfold_nodes(sonde_unfold *u, const sonde_grid *grid) {
  SONDE_ASSERT(u != NULL && grid != NULL);
  bool moved = false, quiet = true;
  double least = INFINITY;
  u->sweeps = u->folded = u->left = 0;
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES && quiet; ++n)
    quiet = v_distance(u->now[n], grid->node[n]) < quiet_m;
  if (quiet) return false;
  for (uint32_t c = 0; c < NS * NT; ++c)
    if (stretch_column(u->now + c * NL, grid->node + c * NL)) moved = true;
  memset(u->awake, 0, sizeof u->awake);
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h) {
    uint32_t small = count_below(u, grid, h, least_volume, &least);
    u->folded += small;
    if (small) wake(u, h);
  }
  if (u->folded == 0) return moved;
  for (; u->sweeps < SWEEPS; ++u->sweeps) {
    u->relaxation = u->sweeps < FAST ? fast : 1;
    if (sweep(u, grid) == 0) break;
  }
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h)
    u->left += count_below(u, grid, h, least_volume, &least);
  return true;
}

// ---- the columns' field -------------------------------------------------------------------

// 0 where the field is far from folding, 1 where it is about to.
static double strength_of(const sonde_unfold *u, const sonde_grid *grid) {
  double least = INFINITY;
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h) (void)count_below(u, grid, h, 0, &least);
  return clamp((calm_from - least) / (calm_from - calm_to), 0, 1);
}

void sonde_bend_update(sonde_bend *b, const sonde_interior *in, const sonde_interior_input *input) {
  SONDE_ASSERT(b != NULL && in != NULL && input != NULL);
  const sonde_mat3 world_from_leg = m_columns(in->e1, in->e2, in->axis);
  const sonde_mat3 leg_from_world = m_transpose(world_from_leg);
  sonde_window_place place;
  bool within;
  b->strength = 0;
  if (!sonde_grid_place(in, input, &place, &within)) return;
  sonde_grid_begin(&b->grid, in, place);
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n) {
    sonde_vec3 rest = v_add(in->origin, m_mul_v(world_from_leg, b->grid.node[n]));
    sonde_vec3 u = m_mul_v(leg_from_world, sonde_interior_column_field(in, rest));
    b->unfold.now[n] = v_add(b->grid.node[n], u);
  }
  memset(b->unfold.held, 1, sizeof b->unfold.held);
  b->strength = strength_of(&b->unfold, &b->grid);
  if (!(b->strength > 0)) return;
  (void)sonde_unfold_nodes(&b->unfold, &b->grid);
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n)
    b->move[n] = m_mul_v(world_from_leg, v_sub(b->unfold.now[n], b->grid.node[n]));
}

double sonde_bend_at(const sonde_bend *b, double theta, double s, double r, sonde_vec3 *move) {
  SONDE_ASSERT(b != NULL && move != NULL);
  sonde_grid_cell c;
  *move = vec3(0, 0, 0);
  if (!(b->strength > 0) || !sonde_grid_find(&b->grid, theta, s, r, &c)) return 0;
  for (int k = 0; k < 4; ++k) {
    const sonde_vec3 *node = &b->move[c.column[k] * NL + c.level];
    *move = v_madd(v_madd(*move, c.weight[k] * (1 - c.t), node[0]), c.weight[k] * c.t, node[1]);
  }
  double end = c.j == 0 ? c.b : c.j + 2 == NS ? 1 - c.b : 1; // at the ends the columns go on
  return b->strength * end;
}
