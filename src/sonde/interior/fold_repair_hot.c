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
#include "interior/fold_repair.h"

#include "base/base.h"

#include <string.h>

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };
enum { SWEEPS = 400, FAST = 200, STEPS = 12 };

static const double stiff_from = 0.55;   // compressive strain beyond which a layer stiffens
static const double least_column = 0.12; // of a column's height at rest
static const double most_more = 1e3;     // of what layers are shortened by, over the field's
static const double least_volume = 0.06, aim = 0.10; // of a volume at rest
static const double fast = 1.3;                      // relaxation of the first sweeps
static const double most_change = 0.2;               // of an edge at rest
// Least Bernstein coefficient of the columns' field below which the grid takes part, and from which
// it is the field alone.
static const double grid_from = 0.35, grid_alone = 0.15;
static const double quiet_m = 1e-3; // displacement that folds nothing

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

// Heights of a column's layers after stiffening. Under the linear field times `more` the layers
// that are shortened give the column the height it has under the field itself, or the least one.
static bool stiffen_column(sonde_vec3 *now, const sonde_vec3 *rest, const double centre[2]) {
  double height[NL], strain[NL], most = 0, goal = 0, tall = 0, at = 0, slope;
  const double x = rest[0].x - centre[0], y = rest[0].y - centre[1];
  const double r = hypot(x, y), cosine = x / r, sine = y / r;
  for (int l = 0; l + 1 < NL; ++l) {
    sonde_vec3 h = v_sub(rest[l], rest[l + 1]), d = v_sub(now[l], now[l + 1]);
    height[l] = h.x * cosine + h.y * sine;
    double rise = d.x * cosine + d.y * sine;
    strain[l] = 1 - rise / height[l];
    most = fmax(most, strain[l]), goal += rise, tall += height[l];
  }
  if (!(most > stiff_from)) return false;
  goal = fmax(goal, least_column * tall);
  double more = 1;
  for (int n = 0; n < STEPS; ++n) { // Newton's
    double sum = 0, change = 0;
    for (int l = 0; l + 1 < NL; ++l) {
      bool shorter = strain[l] > 0;
      sum += height[l] * stretch_of(shorter ? more * strain[l] : strain[l], &slope);
      if (shorter) change += height[l] * slope * strain[l];
    }
    // Layers that are stretched may be taller than the goal by themselves.
    if (!(change < 0) || more > most_more) break;
    double step = (goal - sum) / change;
    more += step;
    if (fabs(step) < 1e-4 * more) break;
  }
  for (int l = NL - 2; l >= 0; --l) {
    at += height[l] * stretch_of(strain[l] > 0 ? more * strain[l] : strain[l], &slope);
    double is = (now[l].x - now[NL - 1].x) * cosine + (now[l].y - now[NL - 1].y) * sine;
    now[l].x += (at - is) * cosine, now[l].y += (at - is) * sine;
  }
  return true;
}

// ---- elements -----------------------------------------------------------------------------

// A Bernstein coefficient of the determinant of an element's trilinear map, which is quadratic
// along each axis: {a, b, c} are its indices there, 0, 1 or 2. It is the mean of the triple
// products x.(y x z) of edges whose ends along each axis add up to its index. No point's volume is
// smaller than the least coefficient.
typedef struct coefficient {
  uint32_t a, b, c;
} coefficient;

#define FOR_EDGES(q)                                                                               \
  for (uint32_t i = (q).a > 1; i <= ((q).a > 0); ++i)                                              \
    for (uint32_t j = (q).b > 1; j <= ((q).b > 0); ++j)                                            \
      for (uint32_t k = (q).c > 1; k <= ((q).c > 0); ++k)

// An element: its nodes and, for each coefficient, what scales the sum of its triple products to
// a share of the volume at rest there.
typedef struct element {
  uint32_t node[8];
  double scale[27];
} element;

static coefficient coefficient_of(uint32_t k) { return (coefficient){k % 3, k / 3 % 3, k / 9}; }

static double share_in(const sonde_grid_edges *e, coefficient q, double scale) {
  double sum = 0;
  FOR_EDGES(q)
  sum += v_dot(e->x[j][k], v_cross(e->y[i][q.c - k], e->z[q.a - i][q.b - j]));
  return sum * scale;
}

static bool is_free(const sonde_fold_repair *u, uint32_t node) {
  uint32_t level = node % NL;
  return level + 1 < NL && (level > 0 || !u->held[node / NL]);
}

// Moves an element's nodes along the derivative of this coefficient until it is `aim`.
static void raise_coefficient(sonde_fold_repair *u, const element *of, uint32_t which,
                              double relaxation) {
  const coefficient q = coefficient_of(which);
  const double scale = of->scale[which];
  sonde_grid_edges e;
  sonde_vec3 g[8] = {{0, 0, 0}};
  sonde_grid_read_edges(u->now, of->node, &e);
  double share = share_in(&e, q, scale), sum = 0;
  if (share >= aim) return;
  FOR_EDGES(q) {
    const sonde_vec3 *x = &e.x[j][k], *y = &e.y[i][q.c - k], *z = &e.z[q.a - i][q.b - j];
    const sonde_vec3 by[3] = {v_cross(*y, *z), v_cross(*z, *x), v_cross(*x, *y)};
    const uint32_t from[3] = {2 * j + 4 * k, i + 4 * (q.c - k), (q.a - i) + 2 * (q.b - j)};
    for (int axis = 0; axis < 3; ++axis) {
      g[from[axis]] = v_madd(g[from[axis]], -scale, by[axis]);
      g[from[axis] + (1u << axis)] = v_madd(g[from[axis] + (1u << axis)], scale, by[axis]);
    }
  }
  for (int k = 0; k < 8; ++k)
    if (is_free(u, of->node[k])) sum += v_norm2(g[k]);
  double step = sum > 0 ? relaxation * (aim - share) / sum : 0;
  for (int k = 0; k < 8; ++k)
    if (is_free(u, of->node[k])) u->now[of->node[k]] = v_madd(u->now[of->node[k]], step, g[k]);
}

// Reads an element and counts its coefficients below `bound`; *least receives the least so far. An
// element whose edges are nearly what they are at rest can't be small: it is not read.
static uint32_t count_below(const sonde_fold_repair *u, const sonde_grid *grid, uint32_t hex,
                            double bound, element *of, double *least) {
  sonde_grid_edges e, rest;
  sonde_grid_nodes(hex, of->node);
  sonde_grid_read_edges(u->now, of->node, &e);
  sonde_grid_read_edges(grid->node, of->node, &rest);
  const sonde_vec3 *now = (const sonde_vec3 *)&e, *was = (const sonde_vec3 *)&rest;
  bool bent = false;
  for (uint32_t k = 0; k < 12 && !bent; ++k)
    bent = v_norm2(v_sub(now[k], was[k])) > most_change * most_change * v_norm2(was[k]);
  if (!bent) return 0;
  uint32_t count = 0;
  for (uint32_t n = 0; n < 27; ++n) {
    const coefficient q = coefficient_of(n);
    double sum = 0, corners = 0;
    FOR_EDGES(q) sum += grid->per_volume[hex][i + 2 * j + 4 * k], ++corners;
    of->scale[n] = -sum / (corners * corners); // left-handed
    double share = share_in(&e, q, of->scale[n]);
    *least = fmin(*least, share), count += share < bound;
  }
  return count;
}

// An element and those around it are looked at in the next sweeps.
static void mark_pending(sonde_fold_repair *u, uint32_t hex) {
  SONDE_ASSERT(hex < SONDE_GRID_HEXES);
  int l = (int)(hex % (NL - 1)), i = (int)(hex / (NL - 1) % NT), j = (int)(hex / (NL - 1) / NT);
  for (int b = j > 0 ? j - 1 : 0; b <= j + 1 && b < NS - 1; ++b)
    for (int a = i + NT - 1; a <= i + NT + 1; ++a)
      for (int c = l > 0 ? l - 1 : 0; c <= l + 1 && c < NL - 1; ++c)
        u->pending[(b * NT + a % NT) * (NL - 1) + c] = 3;
}

bool sonde_fold_repair_nodes(sonde_fold_repair *u, const sonde_grid *grid) {
  SONDE_ASSERT(u != NULL && grid != NULL);
  bool moved = false, quiet = true, folded = false;
  element of;
  double least = INFINITY;
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES && quiet; ++n)
    quiet = v_distance(u->now[n], grid->node[n]) < quiet_m;
  if (quiet) return false;
  for (uint32_t c = 0; c < NS * NT; ++c)
    if (stiffen_column(u->now + c * NL, grid->node + c * NL, grid->centre[c / NT])) moved = true;
  memset(u->pending, 0, sizeof u->pending);
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h)
    if (count_below(u, grid, h, least_volume, &of, &least) > 0) mark_pending(u, h), folded = true;
  if (!folded) return moved;
  for (uint32_t sweep = 0, small = 1; sweep < SWEEPS && small > 0; ++sweep) {
    small = 0;
    for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h) {
      if (u->pending[h] == 0) continue;
      --u->pending[h], least = INFINITY;
      if (count_below(u, grid, h, aim, &of, &least) == 0) continue;
      for (uint32_t k = 0; k < 27; ++k) raise_coefficient(u, &of, k, sweep < FAST ? fast : 1);
      mark_pending(u, h), small += least < 0.5 * (least_volume + aim);
    }
  }
  return true;
}

// ---- the columns' field -------------------------------------------------------------------

void sonde_column_grid_update(sonde_column_grid *b, const sonde_interior *in,
                              const sonde_interior_input *input) {
  SONDE_ASSERT(b != NULL && in != NULL && input != NULL);
  const sonde_mat3 world_from_leg = m_columns(in->e1, in->e2, in->axis);
  const sonde_mat3 leg_from_world = m_transpose(world_from_leg);
  sonde_footprint footprint;
  bool within;
  b->strength = 0;
  if (!sonde_grid_footprint(in, input, &footprint, &within)) return;
  sonde_grid_begin(&b->grid, in, footprint);
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n) {
    sonde_vec3 rest = v_add(in->origin, m_mul_v(world_from_leg, b->grid.node[n]));
    sonde_vec3 u = m_mul_v(leg_from_world, sonde_interior_column_field(in, rest));
    b->repair.now[n] = v_add(b->grid.node[n], u);
  }
  memset(b->repair.held, 1, sizeof b->repair.held);
  element of;
  double least = INFINITY; // where the field is far from folding it stays as it is
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h)
    (void)count_below(&b->repair, &b->grid, h, 0, &of, &least);
  b->strength = clamp((grid_from - least) / (grid_from - grid_alone), 0, 1);
  if (!(b->strength > 0)) return;
  (void)sonde_fold_repair_nodes(&b->repair, &b->grid);
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n)
    b->move[n] = m_mul_v(world_from_leg, v_sub(b->repair.now[n], b->grid.node[n]));
}

double sonde_column_grid_at(const sonde_column_grid *b, double theta, double s, double r,
                            sonde_vec3 *move) {
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
