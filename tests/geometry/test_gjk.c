// Distance of convex bodies against enumeration of all features, and its cost.
#include "../sanitized.h"
#include "geometry/shapes.h"
#include "geometry/internal.h"

// ---- oracle -------------------------------------------------------------------------------

static double edge_edge(sonde_vec3 p, sonde_vec3 q, sonde_vec3 r, sonde_vec3 s) {
  // Interior stationary point of two lines; the ends are covered by point-triangle distances.
  sonde_vec3 u = v_sub(q, p), w = v_sub(s, r), d = v_sub(p, r);
  double a = v_dot(u, u), b = v_dot(u, w), c = v_dot(w, w), e = v_dot(u, d), f = v_dot(w, d);
  double det = a * c - b * b;
  if (det <= 1e-12 * a * c) return INFINITY;
  double t = (b * f - c * e) / det, k = (a * f - b * e) / det;
  if (t < 0 || t > 1 || k < 0 || k > 1) return INFINITY;
  return v_norm(v_sub(v_madd(d, t, u), v_scale(w, k)));
}

static void face_points(const sonde_mesh *mesh, uint32_t f, sonde_vec3 t[3]) {
  for (int k = 0; k < 3; ++k) t[k] = mesh->vertices[mesh->faces[f][k]];
}

// Smallest distance of any two features of two surfaces that do not intersect.
static double feature_distance(const sonde_mesh *a, const sonde_mesh *b) {
  double best = INFINITY;
  sonde_vec3 s[3], t[3];
  for (uint32_t f = 0; f < a->face_count; ++f)
    for (uint32_t g = 0; g < b->face_count; ++g) {
      face_points(a, f, s);
      face_points(b, g, t);
      for (int i = 0; i < 3; ++i) {
        best = fmin(best, fmin(shape_triangle_distance(s[i], t), shape_triangle_distance(t[i], s)));
        for (int j = 0; j < 3; ++j)
          best = fmin(best, edge_edge(s[i], s[(i + 1) % 3], t[j], t[(j + 1) % 3]));
      }
    }
  return best;
}

static double gap_along(const sonde_mesh *a, const sonde_mesh *b, sonde_vec3 n) {
  double high = -INFINITY, low = INFINITY;
  for (uint32_t v = 0; v < a->vertex_count; ++v) high = fmax(high, v_dot(n, a->vertices[v]));
  for (uint32_t v = 0; v < b->vertex_count; ++v) low = fmin(low, v_dot(n, b->vertices[v]));
  return low - high;
}

static sonde_vec3 edge_direction(const sonde_convex *c, const sonde_mesh *placed, uint32_t e) {
  const uint32_t *v = c->topology.edges[e];
  return v_sub(placed->vertices[v[1]], placed->vertices[v[0]]);
}

// Largest gap over the axes that decide for polyhedra: face normals and products of edges.
static double largest_gap(const sonde_convex *ca, const sonde_mesh *a, const sonde_convex *cb,
                          const sonde_mesh *b) {
  double best = -INFINITY;
  sonde_vec3 t[3], none = vec3(0, 0, 0);
  for (uint32_t f = 0; f < a->face_count; ++f) {
    face_points(a, f, t);
    sonde_vec3 n = v_unit(v_cross(v_sub(t[1], t[0]), v_sub(t[2], t[0])), none);
    best = fmax(best, gap_along(a, b, n));
  }
  for (uint32_t f = 0; f < b->face_count; ++f) {
    face_points(b, f, t);
    sonde_vec3 n = v_unit(v_cross(v_sub(t[1], t[0]), v_sub(t[2], t[0])), none);
    best = fmax(best, gap_along(a, b, v_neg(n)));
  }
  for (uint32_t e = 0; e < ca->topology.edge_count; ++e)
    for (uint32_t g = 0; g < cb->topology.edge_count; ++g) {
      sonde_vec3 n = v_cross(edge_direction(ca, a, e), edge_direction(cb, b, g));
      if (v_norm(n) < 1e-12) continue;
      n = v_unit(n, none);
      best = fmax(best, fmax(gap_along(a, b, n), gap_along(a, b, v_neg(n))));
    }
  return best;
}

static sonde_mesh placed(const sonde_convex *convex, sonde_pose pose) {
  sonde_mesh mesh;
  assert_ok(sonde_mesh_copy(&convex->hull, &mesh, &shape_error));
  shape_move(&mesh, pose);
  return mesh;
}

// Compares GJK, cold and through the cache, with the enumeration; returns the exact distance.
static double check_pair(const sonde_convex *a, sonde_pose pa, const sonde_convex *b, sonde_pose pb,
                         sonde_gjk_cache *cache) {
  sonde_mesh ma = placed(a, pa), mb = placed(b, pb);
  double gap = largest_gap(a, &ma, b, &mb);
  double exact = gap <= 0 ? 0 : feature_distance(&ma, &mb);
  sonde_gjk_cache fresh = {0};
  sonde_gjk_result cold = sonde_gjk_distance(a, pa, b, pb, &fresh);
  sonde_gjk_result warm = sonde_gjk_distance(a, pa, b, pb, cache);
  sonde_gjk_result plain = sonde_gjk_distance(a, pa, b, pb, NULL);
  assert_near(cold.distance_m, exact, 1e-9);
  assert_near(warm.distance_m, exact, 1e-9);
  assert_true(plain.distance_m == cold.distance_m);
  if (fabs(gap) > 1e-9) assert_int_equal(cold.overlap, gap < 0);
  if (gap > 1e-9) {
    assert_near(v_distance(cold.point_a_m, cold.point_b_m), exact, 1e-9);
    sonde_vec3 n = v_unit(v_sub(cold.point_b_m, cold.point_a_m), vec3(0, 0, 0));
    // The points lie on the bodies: between them nothing of either body.
    assert_near(gap_along(&ma, &mb, n), exact, 1e-9 + 1e-10 / exact);
  }
  sonde_mesh_clear(&ma);
  sonde_mesh_clear(&mb);
  return exact;
}

static sonde_convex random_hull(uint64_t *seed, uint32_t count, sonde_vec3 reach) {
  sonde_vec3 points[64];
  for (uint32_t k = 0; k < count; ++k) {
    sonde_vec3 p = shape_point(seed, 1);
    points[k] = vec3(p.x * reach.x, p.y * reach.y, p.z * reach.z);
  }
  sonde_convex convex;
  assert_ok(sonde_convex_hull(points, count, &convex, &shape_error));
  return convex;
}

// ---- tests --------------------------------------------------------------------------------

static void test_random_pairs(void **state) {
  (void)state;
  uint64_t seed = 11;
  uint32_t apart = 0, overlapping = 0;
  for (int pair = 0; pair < 300; ++pair) {
    uint32_t na = 4 + (uint32_t)shape_uniform(&seed, 0, 12);
    uint32_t nb = 4 + (uint32_t)shape_uniform(&seed, 0, 12);
    // Thin and long bodies too, at the scale of a probe.
    double thin = pair % 3 ? 1 : 0.01;
    sonde_convex a = random_hull(&seed, na, vec3(0.03, 0.03, 0.03 * thin));
    sonde_convex b = random_hull(&seed, nb, vec3(0.05, 0.02 * thin, 0.02));
    sonde_gjk_cache cache = {0};
    for (int k = 0; k < 3; ++k) {
      sonde_pose pa = {shape_point(&seed, 0.03), shape_rotation(&seed)};
      sonde_pose pb = {shape_point(&seed, 0.04), shape_rotation(&seed)};
      if (check_pair(&a, pa, &b, pb, &cache) > 0)
        ++apart;
      else
        ++overlapping;
    }
    sonde_convex_clear(&a);
    sonde_convex_clear(&b);
  }
  assert_true(apart > 200 && overlapping > 200);
}

// Boxes face to face, edge to edge and corner to corner, at gaps down to nothing.
static void test_parallel_and_touching(void **state) {
  (void)state;
  uint64_t seed = 5;
  sonde_mesh box = shape_box(0.03, 0.006, 0.04);
  sonde_convex a = shape_convex(&box);
  static const double gaps[] = {0.05, 1e-3, 1e-6, 1e-8, 1e-9, 0, -1e-8, -1e-6, -1e-3};
  static const sonde_vec3 ways[] = {
      {0, 0, 0.08}, {0.06, 0, 0}, {0, 0.012, 0.08}, {0.06, 0.012, 0.08}, {0.06, 0.003, 0.02}};
  for (size_t g = 0; g < SONDE_COUNT_OF(gaps); ++g)
    for (size_t w = 0; w < SONDE_COUNT_OF(ways); ++w) {
      sonde_quat turn = shape_rotation(&seed);
      // Every coordinate in which the boxes are apart grows by the gap.
      sonde_vec3 way = ways[w], shift = way;
      shift.x += way.x >= 0.06 ? gaps[g] : 0;
      shift.y += way.y >= 0.012 ? gaps[g] : 0;
      shift.z += way.z >= 0.08 ? gaps[g] : 0;
      double exact = gaps[g] > 0 ? v_distance(shift, way) : 0;
      sonde_pose pa = {shape_point(&seed, 0.1), turn};
      sonde_pose pb = {v_add(pa.position, q_rotate(turn, shift)), turn};
      sonde_gjk_cache cache = {0};
      for (int repeat = 0; repeat < 2; ++repeat) {
        sonde_gjk_result r = sonde_gjk_distance(&a, pa, &a, pb, &cache);
        assert_near(r.distance_m, exact, 1e-9);
        if (fabs(gaps[g]) > 2e-9) assert_int_equal(r.overlap, gaps[g] < 0);
      }
    }
  sonde_convex_clear(&a);
  sonde_mesh_clear(&box);
}

// Bodies round enough that the search does not end by itself: every answer carries its proof, a
// direction along which the bodies are as far apart as the points.
static void test_round_bodies(void **state) {
  (void)state;
  uint64_t seed = 77;
  sonde_mesh ball = shape_sphere(48, 0.02);
  sonde_convex body = shape_convex(&ball);
  double worst = 0;
  for (int k = 0; k < 200; ++k) {
    sonde_pose pa = {shape_point(&seed, 0.01), shape_rotation(&seed)};
    sonde_vec3 way = v_scale(shape_direction(&seed), shape_uniform(&seed, 0.041, 0.1));
    sonde_pose pb = {v_add(pa.position, way), shape_rotation(&seed)};
    sonde_gjk_result r = sonde_gjk_distance(&body, pa, &body, pb, NULL);
    sonde_mesh ma = placed(&body, pa), mb = placed(&body, pb);
    sonde_vec3 n = v_unit(v_sub(r.point_b_m, r.point_a_m), vec3(0, 0, 0));
    worst = fmax(worst, r.distance_m - gap_along(&ma, &mb, n));
    sonde_mesh_clear(&ma);
    sonde_mesh_clear(&mb);
  }
  print_message("largest distance minus proven lower bound: %.2g m\n", worst);
  assert_true(worst < 1e-9);
  sonde_convex_clear(&body);
  sonde_mesh_clear(&ball);
}

// Swapping the bodies mirrors the answer; moving both together does not change it.
static void test_symmetry(void **state) {
  (void)state;
  uint64_t seed = 3;
  for (int pair = 0; pair < 50; ++pair) {
    sonde_convex a = random_hull(&seed, 20, vec3(0.03, 0.03, 0.03));
    sonde_convex b = random_hull(&seed, 20, vec3(0.02, 0.05, 0.03));
    sonde_pose pa = {shape_point(&seed, 0.01), shape_rotation(&seed)};
    sonde_pose pb = {v_add(pa.position, v_scale(shape_direction(&seed), 0.12)),
                     shape_rotation(&seed)};
    sonde_pose move = {shape_point(&seed, 1), shape_rotation(&seed)};
    sonde_gjk_result r = sonde_gjk_distance(&a, pa, &b, pb, NULL);
    sonde_gjk_result swapped = sonde_gjk_distance(&b, pb, &a, pa, NULL);
    sonde_gjk_result moved =
        sonde_gjk_distance(&a, pose_mul(move, pa), &b, pose_mul(move, pb), NULL);
    assert_true(r.distance_m > 0);
    assert_near(swapped.distance_m, r.distance_m, 1e-9);
    assert_near(moved.distance_m, r.distance_m, 1e-9);
    assert_near(v_distance(moved.point_a_m, pose_apply(move, r.point_a_m)), 0, 1e-5);
    sonde_convex_clear(&a);
    sonde_convex_clear(&b);
  }
}

// A cache of other bodies, or garbage, must not change the answer.
static void test_foreign_cache(void **state) {
  (void)state;
  uint64_t seed = 8;
  sonde_convex a = random_hull(&seed, 20, vec3(0.03, 0.03, 0.03));
  sonde_convex b = random_hull(&seed, 20, vec3(0.03, 0.03, 0.03));
  sonde_pose pa = {{0, 0, 0}, {1, 0, 0, 0}}, pb = {{0.08, 0.02, 0}, {1, 0, 0, 0}};
  double exact = sonde_gjk_distance(&a, pa, &b, pb, NULL).distance_m;
  sonde_gjk_cache caches[] = {{4, {1, 1, 1, 1}, {2, 2, 2, 2}},
                              {3, {0, 1, 2, 0}, {0, 0, 0, 0}},
                              {2, {900, 1, 0, 0}, {0, 1, 0, 0}},
                              {77, {0}, {0}}};
  for (size_t k = 0; k < SONDE_COUNT_OF(caches); ++k)
    assert_near(sonde_gjk_distance(&a, pa, &b, pb, &caches[k]).distance_m, exact, 1e-9);
  sonde_convex_clear(&a);
  sonde_convex_clear(&b);
}

enum { SIZES = 6, POSES = ROUNDS(40, 10) };

// Mean cost without cache, and of following a slow motion with it.
static void measure(const sonde_convex *body, double *cold, double *warm) {
  uint64_t seed = 21;
  double cold_sum = 0, warm_sum = 0;
  for (int k = 0; k < POSES; ++k) {
    sonde_pose pa = {{0, 0, 0}, shape_rotation(&seed)};
    sonde_pose pb = {v_scale(shape_direction(&seed), 0.05), shape_rotation(&seed)};
    sonde_gjk_cache cache = {0};
    cold_sum += sonde_gjk_distance(body, pa, body, pb, &cache).support_calls;
    for (int tick = 0; tick < 20; ++tick) {
      // 1 mm in 20 ticks of 1 ms: a fast hand.
      pb.position = v_add(pb.position, v_scale(vec3(1, 0.5, -0.5), 4e-5));
      warm_sum += sonde_gjk_distance(body, pa, body, pb, &cache).support_calls / 20.0;
    }
  }
  *cold = cold_sum / POSES;
  *warm = warm_sum / POSES;
}

static void test_cost(void **state) {
  (void)state;
  static const uint32_t cuts[SIZES] = {8, 12, 18, 27, 40, 60};
  double vertices[SIZES], cold[SIZES], warm[SIZES];
  for (int k = 0; k < SIZES; ++k) {
    sonde_mesh ball = shape_sphere(cuts[k], 0.02);
    sonde_convex body = shape_convex(&ball);
    vertices[k] = body.hull.vertex_count;
    measure(&body, &cold[k], &warm[k]);
    print_message("%6.0f vertices: %8.0f dot products cold, %6.1f warm\n", vertices[k], cold[k],
                  warm[k]);
    sonde_convex_clear(&body);
    sonde_mesh_clear(&ball);
  }
  double cold_slope = shape_slope(vertices, cold, SIZES),
         warm_slope = shape_slope(vertices, warm, SIZES);
  print_message("slope cold %.3f, warm %.3f\n", cold_slope, warm_slope);
  assert_near(cold_slope, 1, 0.1);
  assert_near(warm_slope, 0, 0.15);
  assert_true(warm[SIZES - 1] < 0.05 * cold[SIZES - 1]);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_random_pairs),  cmocka_unit_test(test_parallel_and_touching),
      cmocka_unit_test(test_round_bodies),  cmocka_unit_test(test_symmetry),
      cmocka_unit_test(test_foreign_cache), cmocka_unit_test(test_cost),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
