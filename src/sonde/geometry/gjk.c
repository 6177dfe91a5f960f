// Distance of two convex bodies (Gilbert, Johnson and Keerthi 1988), in the frame of body A.
//
// The set of differences D = {a - b} is convex and holds the origin exactly when the bodies
// overlap; its point closest to the origin is the wanted separation. Each round takes the support
// point w of D towards the origin and finds the closest point v of the simplex with w. |v| bounds
// the distance from above and v.w/|v| from below: the loop ends when they meet. The closest point
// of a simplex follows from signed lengths, areas and volumes (Montanari, Petrinic and Barbieri
// 2017).
#include "geometry/internal.h"

enum { MAX_ROUNDS = 128 };
// The loop ends when the bounds differ by less than this; shorter distances count as touching.
#define GAP_M 1e-11
#define TOUCH_M 1e-10

// ---- support ------------------------------------------------------------------------------

// On a convex body a local maximum is a global one.
uint32_t sonde_convex_climb(const sonde_convex *convex, sonde_vec3 direction, uint32_t start,
                            uint32_t *work) {
  SONDE_ASSERT(start < convex->hull.vertex_count);
  const sonde_topology *t = &convex->topology;
  const sonde_vec3 *x = convex->hull.vertices;
  uint32_t best = start, next = start;
  double height = v_dot(direction, x[start]);
  ++*work;
  do {
    best = next;
    *work += t->start[best + 1] - t->start[best];
    for (uint32_t i = t->start[best]; i < t->start[best + 1]; ++i) {
      double h = v_dot(direction, x[t->neighbour[i]]);
      if (h > height) {
        height = h;
        next = t->neighbour[i];
      }
    }
  } while (next != best);
  return best;
}

uint32_t sonde_convex_support(const sonde_convex *convex, sonde_vec3 direction, uint32_t start) {
  uint32_t work = 0;
  return sonde_convex_climb(convex, direction, start, &work);
}

// Support by looking at every vertex, for the first call without a cache.
static uint32_t scan(const sonde_convex *convex, sonde_vec3 direction, uint32_t *work) {
  uint32_t best = 0;
  double height = -INFINITY;
  for (uint32_t v = 0; v < convex->hull.vertex_count; ++v) {
    double h = v_dot(direction, convex->hull.vertices[v]);
    if (h > height) {
      height = h;
      best = v;
    }
  }
  *work += convex->hull.vertex_count;
  return best;
}

// ---- closest point of a simplex -----------------------------------------------------------

typedef struct simplex {
  uint32_t count;
  sonde_vec3 w[4]; // a - b
  uint32_t a[4], b[4];
  double weight[4];
} simplex;

// A point of the simplex by the weights of its corners.
typedef struct nearest {
  double weight[4];
  sonde_vec3 point;
  double norm2;
} nearest;

static nearest weigh(const simplex *s, const double weight[4]) {
  SONDE_ASSERT(s->count >= 1 && s->count <= 4);
  nearest n = {.point = {0, 0, 0}};
  for (uint32_t k = 0; k < s->count; ++k) {
    n.weight[k] = weight[k];
    n.point = v_madd(n.point, weight[k], s->w[k]);
  }
  n.norm2 = v_norm2(n.point);
  return n;
}

static void keep_closer(nearest *best, nearest trial) {
  if (trial.norm2 < best->norm2) *best = trial;
}

static nearest on_edge(const simplex *s, int i, int j) {
  sonde_vec3 along = v_sub(s->w[j], s->w[i]);
  double length2 = v_norm2(along);
  double t = length2 > 0 ? clamp(-v_dot(s->w[i], along) / length2, 0, 1) : 0;
  double weight[4] = {0};
  weight[i] = 1 - t;
  weight[j] = t;
  return weigh(s, weight);
}

// Twice the area of (p, q, r) seen along the axis.
static double seen_area(sonde_vec3 p, sonde_vec3 q, sonde_vec3 r, int axis) {
  sonde_vec3 n = v_cross(v_sub(q, p), v_sub(r, p));
  return axis == 0 ? n.x : axis == 1 ? n.y : n.z;
}

static bool same_sign(double a, double b) { return (a > 0 && b > 0) || (a < 0 && b < 0); }

static nearest on_triangle(const simplex *s, int i, int j, int k) {
  sonde_vec3 a = s->w[i], b = s->w[j], c = s->w[k];
  sonde_vec3 n = v_cross(v_sub(b, a), v_sub(c, a));
  double n2 = v_norm2(n), x = fabs(n.x), y = fabs(n.y), z = fabs(n.z);
  nearest best = {.norm2 = INFINITY};
  sonde_vec3 foot = n2 > 0 ? v_scale(n, v_dot(a, n) / n2) : vec3(0, 0, 0);
  int axis = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
  double whole = seen_area(a, b, c, axis);
  double part_a = seen_area(foot, b, c, axis), part_b = seen_area(a, foot, c, axis);
  double part_c = whole - part_a - part_b;
  if (same_sign(whole, part_a) && same_sign(whole, part_b) && same_sign(whole, part_c)) {
    double weight[4] = {0};
    weight[j] = part_b / whole;
    weight[k] = part_c / whole;
    weight[i] = 1 - weight[j] - weight[k];
    if (weight[i] >= 0) return weigh(s, weight);
  }
  if (!same_sign(whole, part_a)) keep_closer(&best, on_edge(s, j, k));
  if (!same_sign(whole, part_b)) keep_closer(&best, on_edge(s, i, k));
  if (!same_sign(whole, part_c)) keep_closer(&best, on_edge(s, i, j));
  if (best.norm2 == INFINITY) keep_closer(&best, on_edge(s, i, j));
  return best;
}

// The faces of a tetrahedron, opposite to corner 0..3.
static const int tetrahedron_face[4][3] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};

// *inside when the origin lies in the tetrahedron: on the side of the opposite corner for every
// face. Then all four weights are positive.
static nearest on_tetrahedron(const simplex *s, bool *inside) {
  nearest best = {.norm2 = INFINITY};
  double weight[4], sum = 0;
  *inside = true;
  for (int k = 0; k < 4; ++k) {
    const int *f = tetrahedron_face[k];
    sonde_vec3 p = s->w[f[0]];
    sonde_vec3 n = v_cross(v_sub(s->w[f[1]], p), v_sub(s->w[f[2]], p));
    double origin_side = -v_dot(n, p), corner_side = v_dot(n, v_sub(s->w[k], p));
    bool same = same_sign(origin_side, corner_side);
    weight[k] = same ? origin_side / corner_side : 0;
    sum += weight[k];
    if (same) continue;
    *inside = false;
    keep_closer(&best, on_triangle(s, f[0], f[1], f[2]));
  }
  if (!*inside) return best;
  for (int k = 0; k < 4; ++k) weight[k] /= sum;
  return weigh(s, weight);
}

// ---- rounds -------------------------------------------------------------------------------

typedef struct search {
  const sonde_convex *a, *b;
  sonde_mat3 a_from_b;
  sonde_vec3 offset; // of b's origin in a's frame
  simplex s;
  sonde_vec3 v; // closest point so far
  double norm2;
  uint32_t last_a, last_b, rounds, work;
  bool cold, overlap;
} search;

static sonde_vec3 difference(const search *g, uint32_t a, uint32_t b) {
  sonde_vec3 from_b = v_add(m_mul_v(g->a_from_b, g->b->hull.vertices[b]), g->offset);
  return v_sub(g->a->hull.vertices[a], from_b);
}

// Appends the support point of D along -v.
static void append_support(search *g) {
  sonde_vec3 towards = v_neg(g->v), along_b = m_mul_v(m_transpose(g->a_from_b), g->v);
  if (g->cold) {
    g->last_a = scan(g->a, towards, &g->work);
    g->last_b = scan(g->b, along_b, &g->work);
  } else {
    g->last_a = sonde_convex_climb(g->a, towards, g->last_a, &g->work);
    g->last_b = sonde_convex_climb(g->b, along_b, g->last_b, &g->work);
  }
  g->cold = false;
  SONDE_ASSERT(g->s.count < 4);
  uint32_t k = g->s.count++;
  g->s.a[k] = g->last_a;
  g->s.b[k] = g->last_b;
  g->s.w[k] = difference(g, g->last_a, g->last_b);
}

// Takes over the closest point of the simplex and drops the corners that it does not need; false
// when that is no progress.
static bool settle(search *g) {
  simplex *s = &g->s;
  SONDE_ASSERT(s->count >= 1 && s->count <= 4);
  const double corner[4] = {1, 0, 0, 0};
  bool inside = false;
  nearest n;
  switch (s->count) {
  case 1: n = weigh(s, corner); break;
  case 2: n = on_edge(s, 0, 1); break;
  case 3: n = on_triangle(s, 0, 1, 2); break;
  default: n = on_tetrahedron(s, &inside); break;
  }
  // When rounding misled the signs, the best over all edges and triangles counts.
  if (!inside && !(n.norm2 < g->norm2) && s->count > 1) {
    n.norm2 = INFINITY;
    for (int i = 0; i < (int)s->count; ++i)
      for (int j = i + 1; j < (int)s->count; ++j) {
        keep_closer(&n, on_edge(s, i, j));
        for (int k = j + 1; k < (int)s->count; ++k) keep_closer(&n, on_triangle(s, i, j, k));
      }
  }
  if (!inside && !(n.norm2 < g->norm2)) return false;

  uint32_t kept = 0;
  for (uint32_t k = 0; k < s->count; ++k) {
    if (!(n.weight[k] > 0)) continue;
    s->w[kept] = s->w[k];
    s->a[kept] = s->a[k];
    s->b[kept] = s->b[k];
    s->weight[kept++] = n.weight[k];
  }
  s->count = kept;
  g->v = n.point;
  g->norm2 = n.norm2;
  g->overlap = inside || n.norm2 <= TOUCH_M * TOUCH_M;
  return true;
}

sonde_gjk_result sonde_gjk_distance(const sonde_convex *a, sonde_pose world_from_a,
                                    const sonde_convex *b, sonde_pose world_from_b,
                                    sonde_gjk_cache *cache) {
  SONDE_ASSERT(a->hull.vertex_count > 0 && b->hull.vertex_count > 0);
  sonde_pose relative = pose_mul(pose_inverse(world_from_a), world_from_b);
  search g = {.a = a, .b = b, .offset = relative.position, .norm2 = INFINITY};
  g.a_from_b = q_matrix(relative.rotation);
  simplex *s = &g.s;

  // The last call's simplex, when the cache has one of these bodies; else one support point.
  bool warm = cache && cache->count >= 1 && cache->count <= 4;
  for (uint32_t k = 0; warm && k < cache->count; ++k)
    warm = cache->a[k] < a->hull.vertex_count && cache->b[k] < b->hull.vertex_count;
  for (uint32_t k = 0; warm && k < cache->count; ++k) {
    s->a[k] = cache->a[k];
    s->b[k] = cache->b[k];
    s->w[k] = difference(&g, cache->a[k], cache->b[k]);
  }
  if (warm) {
    s->count = cache->count;
    g.last_a = cache->a[0];
    g.last_b = cache->b[0];
  } else {
    g.cold = true;
    g.v = v_neg(g.offset);
    if (!(v_norm2(g.v) > 0)) g.v = vec3(1, 0, 0);
    append_support(&g);
    ++g.rounds;
  }

  bool going = settle(&g) && !g.overlap;
  while (going && g.rounds < MAX_ROUNDS) {
    simplex before = *s;
    append_support(&g);
    ++g.rounds;
    // The bounds have met, or the support point is already a corner of the simplex.
    uint32_t last = s->count - 1;
    double gap = g.norm2 - v_dot(g.v, s->w[last]);
    bool ended = gap <= GAP_M * sqrt(g.norm2);
    for (uint32_t k = 0; k < last; ++k)
      ended = ended || (s->a[k] == s->a[last] && s->b[k] == s->b[last]);
    if (ended || !settle(&g)) {
      *s = before;
      break;
    }
    going = !g.overlap;
  }

  if (cache) {
    *cache = (sonde_gjk_cache){.count = s->count};
    for (uint32_t k = 0; k < s->count; ++k) {
      cache->a[k] = s->a[k];
      cache->b[k] = s->b[k];
    }
  }
  sonde_vec3 on_a = vec3(0, 0, 0), on_b = vec3(0, 0, 0);
  for (uint32_t k = 0; k < s->count; ++k) {
    on_a = v_madd(on_a, s->weight[k], a->hull.vertices[s->a[k]]);
    on_b = v_madd(on_b, s->weight[k], b->hull.vertices[s->b[k]]);
  }
  return (sonde_gjk_result){.distance_m = g.overlap ? 0 : sqrt(g.norm2),
                            .point_a_m = pose_apply(world_from_a, on_a),
                            .point_b_m = pose_apply(world_from_b, on_b),
                            .iterations = g.rounds,
                            .support_calls = g.work,
                            .overlap = g.overlap};
}
