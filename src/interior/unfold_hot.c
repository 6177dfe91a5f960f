// A displacement that is linear in the load folds the tissue where the load is large: strains add
// up where stretches should be multiplied, and beyond a strain of one a layer lies inside out. Two
// steps bring the grid back.
//
// Columns: a layer that is shortened by more than a bound stiffens, as tissue does: its stretch
// goes on falling but stays above zero, and the layers of the column share what it no longer takes
// as springs in series do. Skin and bone stay where they are.
//
// Corners: where an element's corner spans less than a small share of its volume at rest, its
// nodes move along the derivative of that volume until it does (projected Gauss-Seidel); skin and
// bone are held.
//
// sonde_unfold_nodes  both
// stretch_column, share_out, stretch_of  one column
// widen_corner        one corner
// sonde_bend_update, sonde_bend_at  the same for the columns' field
#include "interior/unfold.h"

#include "base/base.h"

#include <string.h>

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };
enum { SWEEPS = 160, STEPS = 12 };

static const double stiff_from = 0.55;   // compressive strain beyond which a layer stiffens
static const double least_column = 0.12; // of a column's height at rest
static const double least_volume = 0.08, aim = 0.12;  // of a corner's volume at rest
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

// ---- corners ------------------------------------------------------------------------------

static bool is_free(uint32_t node) { return node % NL > 0 && node % NL + 1 < NL; }

// Moves the nodes of a corner apart until it spans `aim`; false when it does already.
static bool widen_corner(sonde_unfold *u, const uint32_t node[4], double per_volume) {
  sonde_vec3 g[4];
  double share = sonde_grid_volume(u->now, node, g + 1) * per_volume, sum = 0;
  if (share >= aim) return false;
  g[0] = v_neg(v_add(g[1], v_add(g[2], g[3])));
  for (int k = 0; k < 4; ++k)
    if (is_free(node[k])) sum += v_norm2(g[k]);
  double step = sum > 0 ? (aim - share) / (sum * per_volume) : 0;
  for (int k = 0; k < 4; ++k)
    if (is_free(node[k])) u->now[node[k]] = v_madd(u->now[node[k]], step, g[k]);
  return share < 0.5 * (least_volume + aim);
}

// Corners that span too little; *least receives the least share so far.
static uint32_t count_small(const sonde_unfold *u, const sonde_grid *grid, uint32_t hex,
                            double *least) {
  uint32_t count = 0;
  for (uint32_t corner = 0; corner < 8; ++corner) {
    uint32_t node[4];
    sonde_vec3 g[3];
    sonde_grid_corner(hex, corner, node);
    double share = sonde_grid_volume(u->now, node, g) * grid->per_volume[hex][corner];
    *least = fmin(*least, share), count += share < least_volume;
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
    bool any = false;
    --u->awake[h];
    for (uint32_t corner = 0; corner < 8; ++corner) {
      uint32_t node[4];
      sonde_grid_corner(h, corner, node);
      any = widen_corner(u, node, grid->per_volume[h][corner]) || any;
    }
    if (any) wake(u, h), ++small;
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
    uint32_t small = count_small(u, grid, h, &least);
    u->folded += small;
    if (small) wake(u, h);
  }
  if (u->folded == 0) return moved;
  while (u->sweeps++ < SWEEPS && sweep(u, grid) > 0) {
  }
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h) u->left += count_small(u, grid, h, &least);
  return true;
}

// ---- the columns' field -------------------------------------------------------------------

// 0 where the field is far from folding, 1 where it is about to.
static double strength_of(const sonde_unfold *u, const sonde_grid *grid) {
  double least = INFINITY;
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h) (void)count_small(u, grid, h, &least);
  return clamp((calm_from - least) / (calm_from - calm_to), 0, 1);
}

void sonde_bend_update(sonde_bend *b, const sonde_interior *in, const sonde_interior_input *input) {
  SONDE_ASSERT(b != NULL && in != NULL && input != NULL);
  const sonde_mat3 world_from_leg = m_columns(in->e1, in->e2, in->axis);
  const sonde_mat3 leg_from_world = m_transpose(world_from_leg);
  sonde_window_place place;
  b->strength = 0;
  if (!sonde_grid_place(in, input, &place)) return;
  sonde_grid_begin(&b->grid, in, place);
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n) {
    sonde_vec3 rest = v_add(in->origin, m_mul_v(world_from_leg, b->grid.node[n]));
    sonde_vec3 u = m_mul_v(leg_from_world, sonde_interior_column_field(in, rest));
    b->unfold.now[n] = v_add(b->grid.node[n], u);
  }
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
