// Depth of two convex bodies by displacement.
//
// Translations of B that keep the bodies overlapping form the convex set D = {a - b}; it holds 0
// and the depth is the least distance of 0 from its boundary. With support h(d) = max over D of
// d.x, B moved by y = (h(d) + m) d is clear of A. GJK gives the point p of D closest to y and the
// normal n there; then h(n) = p.n = y.n - |y - p| <= h(d), for |y - p| >= m. So the normal of the
// gap is a better direction until it no longer changes, and every h is an upper bound of the depth.
#include "contact/difference.h"
#include "geometry/internal.h"

enum { MAX_CORRECTIONS = 24, STARTS = 6 };

static sonde_vec3 middle(const sonde_convex *convex) {
  sonde_vec3 sum = vec3(0, 0, 0);
  for (uint32_t v = 0; v < convex->hull.vertex_count; ++v)
    sum = v_add(sum, convex->hull.vertices[v]);
  return v_scale(sum, 1.0 / convex->hull.vertex_count);
}

typedef struct trial {
  sonde_vec3 direction, on_a; // in A's frame
  double depth;
} trial;

static trial try_direction(difference *d, sonde_vec3 direction) {
  SONDE_ASSERT(v_norm2(direction) > 0.99);
  trial t = {.direction = direction};
  t.depth = v_dot(difference_support(d, direction, &t.on_a), direction);
  return t;
}

// A direction through a corner of D is where the corrections stand still although every other is
// shallower: looks around in a cone and keeps the shallowest.
static bool nudge(difference *d, trial *best) {
  sonde_vec3 n = best->direction, least = fabs(n.x) < 0.6 ? vec3(1, 0, 0) : vec3(0, 1, 0);
  sonde_vec3 u = v_unit(v_cross(n, least), least), v = v_cross(n, u);
  trial lowest = *best;
  for (int k = 0; k < 8; ++k) {
    double angle = SONDE_PI * k / 4;
    sonde_vec3 direction = v_madd(v_madd(n, 0.05 * cos(angle), u), 0.05 * sin(angle), v);
    trial t = try_direction(d, v_unit(direction, n));
    if (t.depth < lowest.depth) lowest = t;
  }
  bool better = lowest.depth < best->depth * (1 - 1e-9);
  if (better) *best = lowest;
  return better;
}

// Corrects a trial until it no longer improves; true when it has converged.
static bool follow(difference *d, sonde_pose b_at, trial *best, uint32_t *rounds) {
  // GJK starts at the vertices just found: nothing but the first direction looks at all of them.
  sonde_gjk_cache cache = {.count = 1, .a = {d->last_a}, .b = {d->last_b}};
  for (uint32_t k = 0; k < MAX_CORRECTIONS && best->depth > 0; ++k) {
    ++*rounds;
    // The next direction is that of the gap after the displacement.
    const sonde_pose a_at = {{0, 0, 0}, {1, 0, 0, 0}};
    double clear = 1.05 * best->depth + 1e-6 * (d->a->radius_m + d->b->radius_m);
    sonde_pose moved = {v_madd(b_at.position, clear, best->direction), b_at.rotation};
    sonde_gjk_result gap = sonde_gjk_distance(d->a, a_at, d->b, moved, &cache);
    d->work += gap.support_calls;
    if (gap.overlap || !(gap.distance_m > 0)) return false;
    sonde_vec3 direction = v_sub(gap.point_b_m, gap.point_a_m);
    trial next = try_direction(d, v_unit(direction, best->direction));
    bool stands = !(next.depth < best->depth * (1 - 1e-9));
    if (next.depth < best->depth) *best = next;
    if (stands && !nudge(d, best)) return true;
  }
  return false;
}

sonde_depth_result sonde_convex_displace(const sonde_convex *a, sonde_pose world_from_a,
                                         const sonde_convex *b, sonde_pose world_from_b,
                                         sonde_vec3 direction) {
  SONDE_ASSERT(a->hull.vertex_count > 0 && b->hull.vertex_count > 0);
  difference d = difference_make(a, world_from_a, b, world_from_b);
  sonde_pose b_at = pose_mul(pose_inverse(world_from_a), world_from_b);
  sonde_vec3 first = q_rotate(q_conj(world_from_a.rotation), direction);
  sonde_depth_result r = {0};
  if (v_norm2(first) > 0) {
    first = v_unit(first, first);
  } else { // along the line between the middles of the bodies
    sonde_vec3 middle_b = v_add(m_mul_v(d.a_from_b, middle(b)), d.offset);
    d.work += a->hull.vertex_count + b->hull.vertex_count;
    first = v_unit(v_sub(middle_b, middle(a)), vec3(0, 0, 1));
  }
  // The depth is the least one that the corrections reach from the first direction and from the
  // shallowest of 26 around.
  trial starts[STARTS];
  for (int k = 0; k < STARTS; ++k) starts[k] = (trial){.depth = INFINITY};
  for (int k = 0; k < 27; ++k) {
    sonde_vec3 corner = vec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
    if (!(v_norm2(corner) > 0)) continue;
    trial t = try_direction(&d, v_unit(corner, corner));
    for (int i = 0; i < STARTS; ++i) {
      if (!(t.depth < starts[i].depth)) continue;
      trial swap = starts[i];
      starts[i] = t;
      t = swap;
    }
  }
  trial best = try_direction(&d, first);
  r.converged = follow(&d, b_at, &best, &r.iterations);
  for (int k = 0; k < STARTS && best.depth > 0; ++k) {
    bool done = follow(&d, b_at, &starts[k], &r.iterations);
    if (!(starts[k].depth < best.depth)) continue;
    best = starts[k];
    r.converged = done;
  }
  r.support_calls = d.work;
  if (!(best.depth > 0))
    return (sonde_depth_result){.iterations = r.iterations, .support_calls = d.work};
  r.overlap = true;
  r.depth_m = best.depth;
  r.direction = q_rotate(world_from_a.rotation, best.direction);
  r.point_a_m = pose_apply(world_from_a, best.on_a);
  return r;
}
