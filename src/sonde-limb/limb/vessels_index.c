// Nearest vessel and nerve at a point: a tree of eighths whose leaves list the pieces that can be
// nearest to a point of the leaf, or within the width of a rounded joint of the nearest.
#include "limb/vessels_graph.h"

#include "base/parallel.h"

#include <string.h>

enum { LEAF_PIECES = 24, DEEPEST = 7, COARSE = 6 };
// A cube farther than 50 mm from every piece keeps the one that is nearest to its middle; one with
// few pieces stays whole where they are far for its size.
enum { FAR_PIECES = 64 };
static const double FAR_M = 0.05, FAR = 1;
static const double SLACK_M =
    0.0025; // by which a piece may be farther than the nearest and still count
static const double ROUNDED_M = 2e-6;  // error of a distance in single precision
static const double SHEATH_M = 0.0009; // loose fat around the walls of deep vessels
// More than a wall, its sheath in the groin and the rounding of a joint together: 1.3 + 2.4 + 0.5.
static const double CLEAR_M = 0.006;

// Signed distance of a point to a piece; *t: place between its ends.
static inline double piece_distance(const vessel_piece *p, sonde_vec3 at, double *t) {
  sonde_vec3 off = v_sub(at, p->a);
  double u = v_dot(off, p->along) * p->inverse;
  u = u < 0 ? 0 : u > 1 ? 1 : u;
  off = v_madd(off, -u, p->along);
  if (p->half > 0) {
    double side = v_dot(off, p->side);
    off = v_madd(off, -clamp(side, -p->half, p->half), p->side);
  }
  *t = u;
  return sqrt(v_norm2(off)) - p->radius - u * p->grows;
}

// ---- making -------------------------------------------------------------------------------------

static vessel_piece piece_between(sonde_vec3 a, sonde_vec3 b, double from, double to,
                                  uint32_t owner, uint32_t at) {
  sonde_vec3 along = v_sub(b, a);
  double n2 = v_norm2(along);
  return (vessel_piece){a,     along, n2 > 1e-16 ? 1 / n2 : 0, from, to - from, 0, vec3(0, 0, 0),
                        owner, at};
}

// Pieces as rows of numbers, so that a processor measures several at once.
enum { AX, AY, AZ, LX, LY, LZ, INVERSE, RADIUS, GROWS, HALF, SX, SY, SZ, NUMBERS };
typedef struct rows {
  uint32_t vessels, count; // of vessels, which come first, and with nerves
  uint32_t *piece;         // [count] ascending
  float *number[NUMBERS];  // [count] each
} rows;

// A part of the tree that one thread makes: the whole, or what lies below one of the root's cubes.
typedef struct growing {
  vessel_cell *cell;
  uint32_t *listed; // pieces of the leaves
  uint32_t cells, cell_room, listed_count, list_room, deepest;
  rows level[DEEPEST + 1]; // of the cells on the way down
  float *distance;         // [pieces] of the rows of a cell
  uint32_t *kept;          // [pieces] rows
  void *memory[2];         // what level, distance and kept lie in
  bool failed;
} growing;

static bool reserve(growing *g, void **array, uint32_t *room, uint32_t needed, size_t size) {
  if (needed <= *room) return true;
  uint32_t more = needed + needed / 2 + 256;
  void *grown = sonde_realloc(*array, *room * size, more * size);
  if (!grown) return !(g->failed = true);
  *array = grown, *room = more;
  return true;
}

// As piece_distance(), of all rows, within ROUNDED_M: between 0 and 1 is (|u| - |u - 1| + 1) / 2.
static void measure_rows(const rows *r, sonde_vec3 at, float *restrict distance) {
  const float x = (float)at.x, y = (float)at.y, z = (float)at.z;
  float *const *n = r->number;
  for (uint32_t k = 0; k < r->count; ++k) {
    float ox = x - n[AX][k], oy = y - n[AY][k], oz = z - n[AZ][k];
    float u = (ox * n[LX][k] + oy * n[LY][k] + oz * n[LZ][k]) * n[INVERSE][k];
    u = 0.5F * (fabsf(u) - fabsf(u - 1) + 1);
    ox -= u * n[LX][k], oy -= u * n[LY][k], oz -= u * n[LZ][k];
    const float half = n[HALF][k], side = ox * n[SX][k] + oy * n[SY][k] + oz * n[SZ][k];
    const float aside = 0.5F * (fabsf(side + half) - fabsf(side - half));
    ox -= aside * n[SX][k], oy -= aside * n[SY][k], oz -= aside * n[SZ][k];
    distance[k] = sqrtf(ox * ox + oy * oy + oz * oz) - n[RADIUS][k] - u * n[GROWS][k];
  }
}

// Keeps of the level's pieces those that count in a cube of centre `middle` and half edge `half`:
// in the cell's list, or, for a cube with children, in the next level. @return whether it has them
static bool split(growing *g, uint32_t cell, sonde_vec3 middle, double half, uint32_t depth) {
  const rows *from = &g->level[depth];
  const double reach = half * sqrt(3.0) + ROUNDED_M;
  const float *d = g->distance;
  measure_rows(from, middle, g->distance);
  float least = INFINITY, nearest_vessel;
  for (uint32_t k = 0; k < from->vessels; ++k) least = d[k] < least ? d[k] : least;
  nearest_vessel = least;
  for (uint32_t k = from->vessels; k < from->count; ++k) least = d[k] < least ? d[k] : least;
  // Nerves count where they are nearer than vessels; joints are rounded near them only.
  const double slack = (double)nearest_vessel - reach > SLACK_M ? 0 : SLACK_M;
  uint32_t n = 0, vessels = 0;
  for (int nerves = 0; nerves < 2; ++nerves) {
    const float most = nerves ? least : nearest_vessel;
    const bool far = (double)most - reach > FAR_M;
    const float limit = far ? most : most + (float)(2 * reach + slack);
    const uint32_t end = nerves ? from->count : from->vessels;
    for (uint32_t k = nerves ? from->vessels : 0; k < end; ++k) g->kept[n] = k, n += d[k] <= limit;
    if (!nerves) vessels = n;
  }
  if (depth >= g->deepest || n <= LEAF_PIECES || (n <= FAR_PIECES && (double)least > FAR * reach)) {
    if (!reserve(g, (void **)(void *)&g->listed, &g->list_room, g->listed_count + n,
                 sizeof *g->listed))
      return false;
    g->cell[cell] = (vessel_cell){0, g->listed_count, n, (float)((double)least - reach)};
    for (uint32_t k = 0; k < n; ++k) g->listed[g->listed_count++] = from->piece[g->kept[k]];
    return false;
  }
  if (!reserve(g, (void **)(void *)&g->cell, &g->cell_room, g->cells + 8, sizeof *g->cell))
    return false;
  g->cell[cell] = (vessel_cell){g->cells, 0, 0, 0};
  g->cells += 8;
  rows *to = &g->level[depth + 1];
  to->count = n, to->vessels = vessels;
  for (uint32_t k = 0; k < n; ++k) to->piece[k] = from->piece[g->kept[k]];
  for (int i = 0; i < NUMBERS; ++i)
    for (uint32_t k = 0; k < n; ++k) to->number[i][k] = from->number[i][g->kept[k]];
  return true;
}

// Middle of one of the eight cubes of a cube of centre `middle` and half edge `half`.
static sonde_vec3 middle_of(sonde_vec3 middle, double half, uint32_t k) {
  const double h = 0.5 * half;
  return v_add(middle, vec3(k & 1 ? h : -h, k & 2 ? h : -h, k & 4 ? h : -h));
}

static void grow(growing *g, uint32_t cell, sonde_vec3 middle, double half, uint32_t depth) {
  if (!split(g, cell, middle, half, depth)) return;
  const uint32_t child = g->cell[cell].child;
  for (uint32_t k = 0; k < 8 && !g->failed; ++k)
    grow(g, child + k, middle_of(middle, half, k), 0.5 * half, depth + 1);
}

// Room for `count` rows in the levels from `first` on and a first cell.
static void begin(growing *g, uint32_t first, uint32_t deepest, uint32_t count) {
  const uint32_t levels = deepest + 1 - first;
  uint32_t *piece = SONDE_NEW(uint32_t, (size_t)(levels + 1) * count);
  float *number = SONDE_NEW(float, ((size_t)levels * NUMBERS + 1) * count);
  *g = (growing){.deepest = deepest, .cells = 1, .memory = {piece, number}};
  g->failed = !piece || !number ||
              !reserve(g, (void **)(void *)&g->cell, &g->cell_room, 1, sizeof *g->cell);
  if (g->failed) return;
  for (uint32_t k = 0; k < levels; ++k) {
    g->level[first + k] = (rows){.piece = piece + (size_t)k * count};
    for (uint32_t i = 0; i < NUMBERS; ++i)
      g->level[first + k].number[i] = number + (size_t)(k * NUMBERS + i) * count;
  }
  g->kept = piece + (size_t)levels * count, g->distance = number + (size_t)levels * NUMBERS * count;
}

static void end_levels(growing *g) {
  sonde_free(g->memory[0]);
  sonde_free(g->memory[1]);
  g->memory[0] = g->memory[1] = NULL;
}

static void end(growing *g) {
  end_levels(g);
  sonde_free(g->cell);
  sonde_free(g->listed);
}

// The whole tree: its root and the parts below the root's cubes, one thread a part.
typedef struct tree {
  growing root, part[8];
  sonde_vec3 middle;
  double half;
} tree;

static sonde_status grow_part(void *user, uint32_t worker, uint32_t k, const atomic_bool *stop,
                              sonde_error *error) {
  tree *t = user;
  growing *g = &t->part[k];
  (void)worker, (void)stop;
  begin(g, 2, t->root.deepest, t->root.level[1].count);
  g->level[1] = t->root.level[1];
  if (!g->failed) grow(g, 0, middle_of(t->middle, t->half, k), 0.5 * t->half, 1);
  end_levels(g);
  return g->failed ? sonde_fail_memory(error) : SONDE_OK;
}

// Lays the parts behind the root and its eight children, whose cells are the parts' first ones.
static sonde_status join_parts(struct limb_vessels *v, tree *t, sonde_error *error) {
  uint32_t cells = 1, listed = 0;
  for (uint32_t k = 0; k < 8; ++k) cells += t->part[k].cells, listed += t->part[k].listed_count;
  v->cell = SONDE_NEW(vessel_cell, cells), v->listed = SONDE_NEW(uint32_t, listed);
  if (!v->cell || !v->listed) return sonde_fail_memory(error);
  v->cell[0] = (vessel_cell){.child = 1};
  v->cells = 9, v->listed_count = 0;
  for (uint32_t k = 0; k < 8; ++k) {
    const growing *g = &t->part[k];
    for (uint32_t i = 0; i < g->cells; ++i) {
      vessel_cell cell = g->cell[i];
      if (cell.child)
        cell.child += v->cells - 1;
      else
        cell.first += v->listed_count;
      v->cell[i ? v->cells + i - 1 : 1 + k] = cell;
    }
    for (uint32_t i = 0; i < g->listed_count; ++i) v->listed[v->listed_count + i] = g->listed[i];
    v->cells += g->cells - 1, v->listed_count += g->listed_count;
  }
  return SONDE_OK;
}

sonde_status limb_vessels_index(struct limb_vessels *v, bool fine, sonde_error *error) {
  uint32_t most = v->places + LIMB_NERVES * 160;
  sonde_free(v->piece);
  sonde_free(v->cell);
  sonde_free(v->listed);
  v->cell = NULL, v->listed = NULL, v->cells = v->listed_count = 0;
  v->piece = SONDE_NEW(vessel_piece, most);
  if (!v->piece) return sonde_fail_memory(error);
  v->pieces = 0;
  for (uint32_t b = 0; b < v->branches; ++b)
    for (uint32_t k = 0; k + 1 < v->branch[b].count; ++k) {
      const vessel_place *p = limb_branch_places(v, b) + k;
      v->piece[v->pieces++] = piece_between(v->node[p->node], v->node[p[1].node], p->radius,
                                            p[1].radius, b, v->branch[b].first + k);
    }
  for (uint32_t k = 0; k < LIMB_NERVES; ++k)
    for (uint32_t i = 0; i + 1 < v->nerve[k].count; ++i) {
      const limb_nerve *nerve = &v->nerve[k];
      vessel_piece piece = piece_between(nerve->point[i], nerve->point[i + 1], nerve->radius,
                                         nerve->radius, v->branches + k, i);
      piece.half = nerve->half, piece.side = nerve->side[i];
      v->piece[v->pieces++] = piece;
    }
  sonde_vec3 low = v->piece[0].a, high = low;
  for (uint32_t k = 0; k < v->pieces; ++k)
    low = v_min(low, v->piece[k].a), high = v_max(high, v->piece[k].a);
  double margin = 0.04,
         edge = most_of(high.z - low.z, most_of(high.x - low.x, high.y - low.y)) + 2 * margin;
  v->low = v_sub(v_scale(v_add(low, high), 0.5), vec3(edge / 2, edge / 2, edge / 2));
  v->edge = edge;
  tree *t = SONDE_NEW(tree, 1);
  if (!t) return sonde_fail_memory(error);
  growing *root = &t->root;
  sonde_status status = SONDE_OK;
  t->half = edge / 2, t->middle = v_add(v->low, vec3(t->half, t->half, t->half));
  begin(root, 0, fine ? DEEPEST : COARSE, v->pieces);
  if (!root->failed) {
    rows *all = &root->level[0];
    for (uint32_t k = 0; k < v->pieces; ++k) {
      const vessel_piece *p = &v->piece[k];
      const double of[NUMBERS] = {p->a.x,     p->a.y,     p->a.z,    p->along.x, p->along.y,
                                  p->along.z, p->inverse, p->radius, p->grows,   p->half,
                                  p->side.x,  p->side.y,  p->side.z};
      for (int i = 0; i < NUMBERS; ++i) all->number[i][k] = (float)of[i];
      all->piece[k] = k, all->vessels += p->owner < v->branches;
    }
    all->count = v->pieces;
    const bool parts = split(root, 0, t->middle, t->half, 0);
    SONDE_ASSERT(parts || root->failed); // a limb has more pieces than a leaf
    if (!root->failed)
      status = sonde_parallel_run(8, sonde_parallel_workers(0, 8), grow_part, t, NULL, "", error);
    if (!root->failed && !status) status = join_parts(v, t, error);
    for (uint32_t k = 0; k < 8; ++k) end(&t->part[k]);
  }
  if (root->failed) status = sonde_fail_memory(error);
  end(root);
  sonde_free(t);
  return status;
}

// ---- asking -------------------------------------------------------------------------------------

typedef struct nearest {
  double lumen;        // joints rounded
  uint32_t branch, at; // place before the nearest point
  double t;
  double nerve;
  uint32_t which; // nerve
} nearest;

// Smooth minimum of two tubes around their joint: k = 0.3 radii there, fading within 3.5 radii.
static double rounded(const struct limb_vessels *v, sonde_vec3 p, uint32_t a, double da, uint32_t b,
                      double db) {
  double least = least_of(da, db);
  for (uint32_t k = 0; k < 2; ++k) {
    if (!v->shared[a][b][k]) continue;
    uint32_t node = v->shared[a][b][k] - 1u;
    uint32_t tube = v->branch[a].parent == b ? a : b;
    const vessel_branch *child = &v->branch[tube];
    const vessel_place *end = &v->place[child->first];
    if (end->node != node) end += child->count - 1;
    double radius = end->radius, far = v_distance(p, v->node[node]) / (3.5 * radius + 1e-9);
    double width = 0.3 * radius * clamp(2 - 2 * far, 0, 1), h = most_of(width - fabs(da - db), 0);
    if (width > 0) least = least_of(least, least_of(da, db) - 0.25 * h * h / width);
  }
  return least;
}

// Down to the leaf of a point; a point outside of the cube takes that of its nearest point.
static const vessel_cell *leaf_of(const struct limb_vessels *v, sonde_vec3 p) {
  const vessel_cell *leaf = v->cell;
  sonde_vec3 low = v->low;
  for (double edge = 0.5 * v->edge; leaf->child; edge *= 0.5) {
    uint32_t k = 0;
    if (p.x >= low.x + edge) k |= 1, low.x += edge;
    if (p.y >= low.y + edge) k |= 2, low.y += edge;
    if (p.z >= low.z + edge) k |= 4, low.z += edge;
    leaf = &v->cell[leaf->child + k];
  }
  return leaf;
}

bool limb_vessels_clear(const struct limb_vessels *v, const double xyz[3]) {
  SONDE_ASSERT(v && xyz);
  sonde_vec3 p = vec3(xyz[0], xyz[1], xyz[2]);
  if (leaf_of(v, p)->clear < CLEAR_M) return false;
  for (uint32_t k = 0; k < VESSEL_LYMPH; ++k)
    if (v_distance(p, v->lymph[k].centre) <
        most_of(v->lymph[k].length, v->lymph[k].radius) + CLEAR_M)
      return false;
  return true;
}

static nearest find_nearest(const struct limb_vessels *v, sonde_vec3 p) {
  enum { KEPT = 4 };
  struct {
    uint32_t branch, at;
    double distance, t;
  } best[KEPT];
  uint32_t count = 0;
  nearest out = {INFINITY, VESSEL_NONE, 0, 0, INFINITY, VESSEL_NONE};
  const vessel_cell *leaf = leaf_of(v, p);
  for (uint32_t k = 0; k < leaf->count; ++k) {
    const vessel_piece *piece = &v->piece[v->listed[leaf->first + k]];
    double t, d = piece_distance(piece, p, &t);
    if (piece->owner >= v->branches) {
      if (d < out.nerve) out.nerve = d, out.which = piece->owner - v->branches;
      continue;
    }
    uint32_t i = 0;
    while (i < count && best[i].branch != piece->owner) ++i;
    if (i == count && count < KEPT)
      best[count].branch = piece->owner, best[count++].distance = INFINITY;
    if (i == KEPT) { // another branch that is nearer takes the farthest one's place
      i = 0;
      for (uint32_t j = 1; j < KEPT; ++j)
        if (best[j].distance > best[i].distance) i = j;
      if (d < best[i].distance) best[i].branch = piece->owner, best[i].distance = INFINITY;
    }
    if (d < best[i].distance && best[i].branch == piece->owner)
      best[i].distance = d, best[i].at = piece->at, best[i].t = t;
  }
  uint32_t first = 0;
  for (uint32_t i = 1; i < count; ++i)
    if (best[i].distance < best[first].distance) first = i;
  if (count == 0) return out;
  out.lumen = best[first].distance, out.branch = best[first].branch, out.at = best[first].at,
  out.t = best[first].t;
  for (uint32_t i = 0; i < count; ++i)
    if (i != first && best[i].distance < best[first].distance + SLACK_M)
      out.lumen = least_of(out.lumen, rounded(v, p, best[first].branch, best[first].distance,
                                              best[i].branch, best[i].distance));
  return out;
}

double limb_vessels_lumen(const struct limb_vessels *v, sonde_vec3 p, uint32_t *branch, double *arc,
                          double *wall) {
  nearest n = find_nearest(v, p);
  *branch = n.branch, *arc = 0, *wall = 0;
  if (n.branch == VESSEL_NONE) return n.lumen;
  const vessel_place *a = &v->place[n.at];
  *arc = a->arc + n.t * (a[1].arc - a->arc);
  *wall = a->wall + n.t * (a[1].wall - a->wall);
  return n.lumen;
}

limb_vessel_hit limb_vessels_at(const struct limb_vessels *v, const double xyz[3]) {
  SONDE_ASSERT(xyz);
  limb_vessel_hit hit = {LIMB_PART_NONE, 0, INFINITY};
  if (!v) return hit;
  sonde_vec3 p = vec3(xyz[0], xyz[1], xyz[2]);
  nearest n = find_nearest(v, p);
  double wall = 0, sheath = 0;
  if (n.branch != VESSEL_NONE) {
    const vessel_place *a = &v->place[n.at];
    wall = a->wall + n.t * (a[1].wall - a->wall);
    const vessel_branch *b = &v->branch[n.branch];
    bool deep = b->kind == SONDE_LIMB_ARTERY || b->kind == SONDE_LIMB_DEEP_VEIN;
    sheath = deep ? wall + SHEATH_M : 0;
    // The femoral sheath: a funnel that ends 35 mm below the ligament.
    double down = (v->draws.ligament_z - p.z) / 0.035;
    if (deep && down < 1 && a->radius > 0.003) sheath += 0.0015 * clamp(1 - down, 0, 1);
  }
  if (n.lumen <= 0) return (limb_vessel_hit){LIMB_PART_LUMEN, n.branch, n.lumen};
  if (n.lumen <= wall) return (limb_vessel_hit){LIMB_PART_WALL, n.branch, n.lumen};
  if (n.nerve <= 0) return (limb_vessel_hit){LIMB_PART_NERVE, n.which, n.nerve};
  if (p.z > -0.12)
    for (uint32_t k = 0; k < VESSEL_LYMPH; ++k) {
      // Signed distance to an ellipsoid of revolution, exact to first order at its surface.
      const limb_lymph *node = &v->lymph[k];
      sonde_vec3 off = v_sub(p, node->centre);
      double along = v_dot(off, node->axis), a = node->length, b = node->radius;
      double across = sqrt(most_of(v_norm2(off) - along * along, 0)),
             h = hypot(along / a, across / b);
      double slope = hypot(along / (a * a), across / (b * b)),
             d = slope > 0 ? h * (h - 1) / slope : -b;
      if (d <= 0) return (limb_vessel_hit){LIMB_PART_NODE, k, d};
    }
  if (n.lumen <= sheath) return (limb_vessel_hit){LIMB_PART_SHEATH, n.branch, n.lumen};
  hit.index = n.branch;
  hit.distance_m = least_of(n.lumen, n.nerve);
  return hit;
}

double limb_vessels_bundle(const struct limb_vessels *v, const double xyz[3]) {
  SONDE_ASSERT(xyz);
  if (!v) return INFINITY;
  nearest n = find_nearest(v, vec3(xyz[0], xyz[1], xyz[2]));
  if (n.branch == VESSEL_NONE || v->branch[n.branch].kind >= SONDE_LIMB_PERFORATOR) return n.nerve;
  return least_of(n.lumen - v->place[n.at].wall, n.nerve);
}
