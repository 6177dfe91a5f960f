// Moves centre lines apart, away from bones and to their side of the fascia.
//
// Each pass sums for every node what its places lack: distance to another branch's wall, to bone,
// to the deep fascia, for a companion vein also what is too far from its artery. Each branch
// spreads these steps along itself (1 2 1, twice) so that lines stay smooth.
#include "limb/vessels_graph.h"

static const double WALLS_M = 0.0008, BONE_M = 0.0021, FASCIA_M = 0.0008, MATE_MOST_M = 0.0013;
static const double SLAB_M = 0.015; // of the table of places by height
enum { SLABS = 96 };

typedef struct neighbours {
  struct limb_vessels *v;
  double top;
  uint32_t *owner;           // branch of each place
  uint32_t begin[SLABS + 1]; // places by slab, in listed
  uint32_t *listed;
  uint32_t pairs, room;
  uint32_t (*pair)[2]; // a place and the first place of a piece that can come near it
  double *clear;       // least way that each place has to go until bone is too near, m
} neighbours;

static uint32_t slab_of(const neighbours *n, double z) {
  return (uint32_t)clamp((n->top - z) / SLAB_M, 0, SLABS - 1);
}

static sonde_vec3 node_of(const struct limb_vessels *v, uint32_t place) {
  return v->node[v->place[place].node];
}

// Lists the pairs of a place and a piece of another branch that come near each other while both
// move by less than 3 mm. @return false without memory
static bool list_pairs(neighbours *n) {
  const struct limb_vessels *v = n->v;
  // Places by slabs of height.
  n->top = 0.1 * v->limb->scale + 0.02;
  for (uint32_t b = 0; b < v->branches; ++b)
    for (uint32_t k = 0; k < v->branch[b].count; ++k) n->owner[v->branch[b].first + k] = b;
  uint32_t count[SLABS] = {0}, sum = 0;
  for (uint32_t i = 0; i < v->places; ++i) ++count[slab_of(n, node_of(v, i).z)];
  for (uint32_t s = 0; s < SLABS; ++s) n->begin[s] = sum, sum += count[s], count[s] = n->begin[s];
  n->begin[SLABS] = sum;
  for (uint32_t i = 0; i < v->places; ++i) n->listed[count[slab_of(n, node_of(v, i).z)]++] = i;
  n->pairs = 0;
  for (uint32_t i = 0; i < v->places; ++i) {
    sonde_vec3 p = node_of(v, i);
    uint32_t a = n->owner[i], slab = slab_of(n, p.z);
    uint32_t first = n->begin[slab > 0 ? slab - 1 : 0],
             last = n->begin[slab + 2 < SLABS ? slab + 2 : SLABS];
    for (uint32_t k = first; k < last; ++k) {
      uint32_t j = n->listed[k], b = n->owner[j];
      if (a == b || j + 1 == v->branch[b].first + v->branch[b].count) continue;
      double reach = v->place[i].radius + v->place[j].radius + 0.013;
      if (v_norm2(v_sub(p, node_of(v, j))) > reach * reach) continue;
      if (n->pairs == n->room) {
        void *grown = sonde_realloc(n->pair, n->room * sizeof *n->pair,
                                    (2 * n->room + 8192) * sizeof *n->pair);
        if (!grown) return false;
        n->pair = grown, n->room = 2 * n->room + 8192;
      }
      n->pair[n->pairs][0] = i, n->pair[n->pairs++][1] = j;
    }
  }
  return true;
}

// Distance of place i's outer face to that of the piece from place j on; *away: unit, from the
// piece.
static double wall_gap(const struct limb_vessels *v, uint32_t i, uint32_t j, sonde_vec3 *away) {
  const vessel_place *p = &v->place[i], *a = &v->place[j];
  sonde_vec3 at = node_of(v, i), from = node_of(v, j), along = v_sub(node_of(v, j + 1), from);
  double t = clamp(v_dot(v_sub(at, from), along) / most_of(v_norm2(along), 1e-18), 0, 1);
  sonde_vec3 off = v_sub(at, v_madd(from, t, along));
  *away = v_unit(off, vec3(1, 0, 0));
  double other = a->radius + t * (a[1].radius - a->radius) + a->wall;
  return v_norm(off) - p->radius - p->wall - other;
}

// Calls for each pair of a place and a piece of another branch whose outer faces are nearer than 2
// mm.
typedef void (*pair_fn)(void *user, uint32_t i, uint32_t j, double gap, sonde_vec3 away);

static void for_pairs(const neighbours *n, pair_fn each, void *user) {
  const struct limb_vessels *v = n->v;
  for (uint32_t k = 0; k < n->pairs; ++k) {
    uint32_t i = n->pair[k][0], j = n->pair[k][1], a = n->owner[i], b = n->owner[j];
    sonde_vec3 p = node_of(v, i), away;
    double radii = v->place[i].radius + v->place[j].radius, reach = radii + 0.007;
    if (v_norm2(v_sub(p, node_of(v, j))) > reach * reach) continue;
    // Where two branches join, their walls meet.
    bool joined = false;
    for (uint32_t m = 0; m < 2 && v->shared[a][b][m]; ++m)
      joined |= v_distance(p, v->node[v->shared[a][b][m] - 1]) < 2.6 * radii + 0.004;
    if (joined) continue;
    double gap = wall_gap(v, i, j, &away);
    if (gap <= 0.002) each(user, i, j, gap, away);
  }
}

static double mobility(const vessel_branch *b) {
  if (b->kind == SONDE_LIMB_ARTERY) return 0.35;
  return b->kind == SONDE_LIMB_DEEP_VEIN ? 1 : 2.5;
}

typedef struct pushes {
  const neighbours *n;
  sonde_vec3 *step; // of each place
} pushes;

static void push_pair(void *user, uint32_t i, uint32_t j, double gap, sonde_vec3 away) {
  const pushes *s = user;
  const struct limb_vessels *v = s->n->v;
  uint32_t a = s->n->owner[i], b = s->n->owner[j];
  double lack = WALLS_M - gap;
  if (lack <= 0) return;
  double ma = mobility(&v->branch[a]), mb = mobility(&v->branch[b]), share = ma / (ma + mb);
  s->step[i] = v_madd(s->step[i], 0.7 * lack * share, away);
  s->step[j] = v_madd(s->step[j], -0.35 * lack * (1 - share), away);
  s->step[j + 1] = v_madd(s->step[j + 1], -0.35 * lack * (1 - share), away);
}

// Range of signed heights over the deep fascia that a place's centre may have.
typedef struct band {
  double low, high;
} band;

static band allowed(const struct limb_vessels *v, uint32_t b, uint32_t i, double level,
                    double angle) {
  double size = v->place[i].radius + v->place[i].wall;
  if (v->branch[b].layer == LAYER_DEEP) return (band){-INFINITY, -size - FASCIA_M};
  double fat = limb_fat(v->limb, level, angle), deep = limb_deep_fat(v->limb, level, angle);
  if (v->branch[b].layer ==
      LAYER_EYE) // the saphenous fascia bulges over a vein wider than the layer
    return (band){size + 0.0003, most_of(size + 0.0008, deep - size - 0.0003)};
  return (band){least_of(deep + size, fat - size - 0.0005),
                most_of(deep + size, fat - size - 0.0005)};
}

// Places that join another layer: the arch through the fascia.
static bool crosses(const struct limb_vessels *v, uint32_t b, uint32_t k) {
  const vessel_branch *branch = &v->branch[b];
  if (branch->layer == LAYER_ANY) return true;
  if (branch->layer == LAYER_DEEP) return false;
  const vessel_branch *parent = branch->parent == VESSEL_NONE ? NULL : &v->branch[branch->parent];
  // A vein that joins a wider one of its own layer ends in the middle of that, not in its own.
  uint32_t free = !parent                          ? 0
                  : parent->layer == branch->layer ? 2
                  : parent->layer == LAYER_DEEP    ? 10
                                                   : 8;
  uint32_t end = branch->joins == VESSEL_NONE                      ? 0
                 : v->branch[branch->joins].layer == branch->layer ? 2
                                                                   : 8;
  return k < free || k + end >= branch->count;
}

static void push_out(const neighbours *n, sonde_vec3 *step) {
  const struct limb_vessels *v = n->v;
  for (uint32_t i = 0; i < v->places; ++i) {
    uint32_t b = n->owner[i];
    sonde_vec3 p = node_of(v, i);
    const double at[3] = {p.x, p.y, p.z};
    double size = v->place[i].radius + v->place[i].wall, level, angle, f;
    limb_polar(v->limb, at, &level, &angle, &f);
    sonde_vec3 out = vec3(sin(angle), cos(angle), 0);
    if (!crosses(v, b, i - v->branch[b].first)) {
      double height = (f - 1) * limb_fascia_radius(v->limb, level, angle);
      band range = allowed(v, b, i, level, angle);
      double wrong = height > range.high  ? range.high - height
                     : height < range.low ? range.low - height
                                          : 0;
      step[i] = v_madd(step[i], 0.7 * wrong, out);
    }
    // Bone: along the gradient of its distance, by differences.
    double keep = v->branch[b].layer == LAYER_EYE
                      ? 0.0008
                      : BONE_M; // at the malleolus bone is under the fascia
    if (v->branch[b].layer == LAYER_OUTER) continue;
    if (n->clear[i] > 0) continue;
    double lack = size + keep - limb_bone_distance(v->limb, at, NULL);
    n->clear[i] = -0.8 * lack;
    if (lack <= 0) continue;
    sonde_vec3 grow = {0};
    const double h = 2e-4;
    for (int c = 0; c < 3; ++c) {
      double plus[3] = {p.x, p.y, p.z}, minus[3] = {p.x, p.y, p.z};
      plus[c] += h, minus[c] -= h;
      double slope =
          limb_bone_distance(v->limb, plus, NULL) - limb_bone_distance(v->limb, minus, NULL);
      if (c == 0) grow.x = slope;
      if (c == 1) grow.y = slope;
      if (c == 2) grow.z = slope;
    }
    grow.z *= 0.3; // lines go along the bones: mostly sideways
    step[i] = v_madd(step[i], 0.6 * least_of(lack, 0.004), v_unit(grow, out));
  }
}

// Too far from its artery: the vein's steps towards the nearest of the artery's places.
static void pull_mates(const neighbours *n, const pushes *s) {
  const struct limb_vessels *v = n->v;
  for (uint32_t b = 0; b < v->branches; ++b) {
    uint32_t mate = v->branch[b].mate;
    if (mate == VESSEL_NONE || v->branch[b].kind != SONDE_LIMB_DEEP_VEIN) continue;
    uint32_t free = b < 5 || v->branch[b].parent == VESSEL_NONE ? 0 : 12;
    uint32_t near = v->branch[mate].first;
    for (uint32_t k = 0; k < v->branch[b].count; ++k) {
      uint32_t i = v->branch[b].first + k;
      sonde_vec3 p = node_of(v, i), away;
      // Along the artery the nearest place moves on by a few places from one place to the next.
      double least = INFINITY;
      uint32_t low = v->branch[mate].first, high = low + v->branch[mate].count - 1;
      if (k > 0)
        low = near > low + 12 ? near - 12 : low, high = near + 12 < high ? near + 12 : high;
      for (uint32_t j = low; j < high; ++j) {
        double d2 = v_norm2(v_sub(node_of(v, j), p));
        if (d2 < least) least = d2, near = j;
      }
      double gap = wall_gap(v, i, near, &away);
      if (k >= free && gap > MATE_MOST_M && gap < 0.006)
        s->step[i] = v_madd(s->step[i], -0.25 * (gap - MATE_MOST_M), away);
    }
  }
}

static bool begin(neighbours *n, struct limb_vessels *v) {
  *n = (neighbours){.v = v,
                    .owner = SONDE_NEW(uint32_t, v->places),
                    .listed = SONDE_NEW(uint32_t, v->places),
                    .clear = SONDE_NEW(double, v->places)};
  return n->owner && n->listed && n->clear;
}

static void end(neighbours *n) {
  sonde_free(n->owner);
  sonde_free(n->listed);
  sonde_free(n->pair);
  sonde_free(n->clear);
}

sonde_status limb_vessels_relax(struct limb_vessels *v, uint32_t passes, bool close, bool sharp,
                                sonde_error *error) {
  neighbours n;
  sonde_vec3 *step = SONDE_NEW(sonde_vec3, 2 * v->places);
  bool made = begin(&n, v) && step;
  for (uint32_t pass = 0; made && pass < passes; ++pass) {
    if (pass % 8 == 0 && !list_pairs(&n)) made = false;
    pushes s = {&n, step};
    for (uint32_t i = 0; i < v->places; ++i) step[i] = vec3(0, 0, 0);
    for_pairs(&n, push_pair, &s);
    push_out(&n, step);
    if (close) pull_mates(&n, &s);
    // Each branch spreads the steps along itself, unless it may bend sharply; its own bends lose a
    // little.
    sonde_vec3 *spare = step + v->places;
    for (uint32_t b = 0; b < v->branches; ++b) {
      uint32_t first = v->branch[b].first, count = v->branch[b].count;
      for (int twice = 0; twice < 2 && !sharp; ++twice) {
        for (uint32_t k = 0; k < count; ++k) {
          sonde_vec3 before = step[first + (k > 0 ? k - 1 : 0)],
                     after = step[first + (k + 1 < count ? k + 1 : k)];
          spare[k] = v_scale(v_add(v_add(before, after), v_scale(step[first + k], 2)), 0.25);
        }
        for (uint32_t k = 0; k < count; ++k) step[first + k] = spare[k];
      }
      for (uint32_t k = 1; k + 1 < count; ++k) {
        sonde_vec3 middle = v_lerp(node_of(v, first + k - 1), node_of(v, first + k + 1), 0.5);
        step[first + k] = v_madd(step[first + k], 0.03, v_sub(middle, node_of(v, first + k)));
      }
      // Tributaries do not draw the superficial vein that they join out of its place.
      const vessel_branch *branch = &v->branch[b];
      bool inner = branch->layer == LAYER_EYE && v->branch[branch->parent].layer == LAYER_EYE;
      if (branch->layer == LAYER_OUTER || inner) step[first] = vec3(0, 0, 0);
      if (branch->layer == LAYER_OUTER || (inner && branch->joins != VESSEL_NONE))
        step[first + count - 1] = vec3(0, 0, 0);
    }
    for (uint32_t i = 0; i < v->places; ++i) {
      sonde_vec3 *node = &v->node[v->place[i].node];
      double length = v_norm(step[i]);
      n.clear[i] -= least_of(length, 0.002);
      *node = v_madd(*node, length > 0.002 ? 0.002 / length : 1, step[i]);
    }
  }
  end(&n);
  sonde_free(step);
  return made ? SONDE_OK : sonde_fail_memory(error);
}

static void count_pair(void *user, uint32_t i, uint32_t j, double gap, sonde_vec3 away) {
  bool *touching = user;
  (void)j, (void)away;
  if (gap < 0.0003) touching[i] = true;
}

sonde_status limb_vessels_count_faults(struct limb_vessels *v, sonde_error *error) {
  neighbours n;
  bool *touching = SONDE_NEW(bool, v->places), made = begin(&n, v) && touching && list_pairs(&n);
  v->faults = (sonde_limb_vessel_faults){0};
  if (made) for_pairs(&n, count_pair, touching);
  for (uint32_t i = 0; made && i < v->places; ++i) {
    uint32_t b = n.owner[i], k = i - v->branch[b].first;
    sonde_vec3 p = node_of(v, i);
    const double at[3] = {p.x, p.y, p.z};
    double level, angle, f, radius = v->place[i].radius,
                            bone = limb_bone_distance(v->limb, at, NULL);
    limb_polar(v->limb, at, &level, &angle, &f);
    double height = (f - 1) * limb_fascia_radius(v->limb, level, angle);
    v->faults.walls += touching[i];
    v->faults.lumen += bone < radius;
    if (v->branch[b].layer == LAYER_DEEP || v->branch[b].layer == LAYER_ANY)
      v->faults.bone += bone < radius + v->place[i].wall + 0.0015;
    if (crosses(v, b, k)) continue;
    band range = allowed(v, b, i, level, angle);
    if (v->branch[b].layer == LAYER_DEEP)
      v->faults.fascia += height > range.high + FASCIA_M - 0.0003;
    if (v->branch[b].layer == LAYER_EYE)
      v->faults.eye += height < range.low - 3e-4 || height > range.high + 5e-4;
  }
  end(&n);
  sonde_free(touching);
  return made ? SONDE_OK : sonde_fail_memory(error);
}
