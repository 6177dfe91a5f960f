// Depth and first touch of convex bodies: closed forms, enumeration of all axes, libccd.
#include "contact/bodies.h"
#include "contact/expand.h"
#include "geometry/internal.h"

#ifdef SONDE_TEST_CCD
#include <ccd/ccd.h>
#endif

static const sonde_vec3 nowhere = {0, 0, 0};

static sonde_convex random_hull(uint64_t *seed, uint32_t count, sonde_vec3 reach) {
  sonde_vec3 points[64];
  for (uint32_t k = 0; k < count; ++k) {
    sonde_vec3 p = shape_direction(seed);
    points[k] = vec3(p.x * reach.x, p.y * reach.y, p.z * reach.z);
  }
  sonde_convex convex;
  assert_ok(sonde_convex_hull(points, count, &convex, &shape_error));
  return convex;
}

// ---- enumeration --------------------------------------------------------------------------

static double overlap_along(const sonde_convex *a, sonde_pose pa, const sonde_convex *b,
                            sonde_pose pb, sonde_vec3 n) {
  double high = -INFINITY, low = INFINITY;
  for (uint32_t v = 0; v < a->hull.vertex_count; ++v)
    high = fmax(high, v_dot(n, pose_apply(pa, a->hull.vertices[v])));
  for (uint32_t v = 0; v < b->hull.vertex_count; ++v)
    low = fmin(low, v_dot(n, pose_apply(pb, b->hull.vertices[v])));
  return high - low;
}

static sonde_vec3 edge_of(const sonde_convex *c, sonde_pose pose, uint32_t e) {
  const uint32_t *v = c->topology.edges[e];
  return q_rotate(pose.rotation, v_sub(c->hull.vertices[v[1]], c->hull.vertices[v[0]]));
}

// Least overlap over the axes that decide for polyhedra; negative when they are apart.
static double exact_depth(const sonde_convex *a, sonde_pose pa, const sonde_convex *b,
                          sonde_pose pb) {
  double best = INFINITY;
  for (uint32_t k = 0; k < a->plane_count; ++k)
    best = fmin(best, overlap_along(a, pa, b, pb, q_rotate(pa.rotation, a->plane_normal[k])));
  for (uint32_t k = 0; k < b->plane_count; ++k)
    best =
        fmin(best, overlap_along(a, pa, b, pb, v_neg(q_rotate(pb.rotation, b->plane_normal[k]))));
  for (uint32_t e = 0; e < a->topology.edge_count; ++e)
    for (uint32_t f = 0; f < b->topology.edge_count; ++f) {
      sonde_vec3 n = v_cross(edge_of(a, pa, e), edge_of(b, pb, f));
      if (v_norm(n) < 1e-12) continue;
      n = v_unit(n, n);
      best = fmin(best, overlap_along(a, pa, b, pb, n));
      best = fmin(best, overlap_along(a, pa, b, pb, v_neg(n)));
    }
  return best;
}

// Puts two bodies `depth` into each other along the normal of their gap; returns the normal.
static sonde_vec3 press(const sonde_convex *a, sonde_pose pa, const sonde_convex *b, sonde_pose *pb,
                        double depth) {
  sonde_gjk_result g = sonde_gjk_distance(a, pa, b, *pb, NULL);
  assert_true(g.distance_m > 0);
  sonde_vec3 n = v_unit(v_sub(g.point_b_m, g.point_a_m), nowhere);
  pb->position = v_madd(pb->position, -(g.distance_m + depth), n);
  return n;
}

// The result's own promise: moved out by the depth the bodies just touch.
static void check_parted(const sonde_convex *a, sonde_pose pa, const sonde_convex *b, sonde_pose pb,
                         sonde_depth_result r) {
  assert_true(r.overlap);
  assert_near(v_norm(r.direction), 1, 1e-12);
  sonde_pose out = pb;
  out.position = v_madd(pb.position, r.depth_m + 1e-8, r.direction);
  assert_false(sonde_gjk_distance(a, pa, b, out, NULL).overlap);
  out.position = v_madd(pb.position, r.depth_m - 1e-7, r.direction);
  assert_true(sonde_gjk_distance(a, pa, b, out, NULL).distance_m < 2e-7);
  assert_near(overlap_along(a, pa, b, pb, r.direction), r.depth_m, 1e-9);
}

static void test_random_depth(void **state) {
  (void)state;
  uint64_t seed = 19;
  double worst[2][2] = {{0}}, mean[2][2] = {{0}}, worst_expand = 0;
  int over[2][2] = {{0}}, number[2][2] = {{0}};
  int compared = 0;
  for (int k = 0; k < 400; ++k) {
    uint32_t na = 6 + (uint32_t)shape_uniform(&seed, 0, 20);
    uint32_t nb = 6 + (uint32_t)shape_uniform(&seed, 0, 20);
    sonde_convex a = random_hull(&seed, na, vec3(0.03, 0.03, k % 2 ? 0.03 : 0.015));
    sonde_convex b = random_hull(&seed, nb, vec3(0.04, 0.02, 0.02));
    sonde_pose pa = {shape_point(&seed, 0.1), shape_rotation(&seed)};
    sonde_pose pb = {v_madd(pa.position, 0.2, shape_direction(&seed)), shape_rotation(&seed)};
    // The smallest width of either is about 0.03 m: shallow is up to a tenth of that.
    bool shallow = k % 4 != 0;
    sonde_vec3 last = press(&a, pa, &b, &pb, shape_uniform(&seed, 1e-4, shallow ? 0.003 : 0.03));
    double exact = exact_depth(&a, pa, &b, pb);
    sonde_depth_result r = convex_expand(&a, pa, &b, pb, 1e-9);
    // Two corners pushed past each other may miss.
    assert_int_equal(r.overlap, exact > 0);
    if (!r.overlap) {
      assert_false(sonde_convex_displace(&a, pa, &b, pb, nowhere).overlap);
      sonde_convex_clear(&a);
      sonde_convex_clear(&b);
      continue;
    }
    ++compared;
    assert_true(r.converged);
    check_parted(&a, pa, &b, pb, r);
    worst_expand = fmax(worst_expand, fabs(r.depth_m - exact));
    for (int given = 0; given < 2; ++given) {
      sonde_depth_result j = sonde_convex_displace(&a, pa, &b, pb, given ? last : nowhere);
      check_parted(&a, pa, &b, pb, j);
      assert_true(j.depth_m >= exact - 1e-9);
      double excess = j.depth_m / exact - 1;
      worst[given][shallow] = fmax(worst[given][shallow], excess);
      mean[given][shallow] += excess;
      over[given][shallow] += excess > 0.05;
      ++number[given][shallow];
    }
    // From the right direction it stays there.
    sonde_depth_result warm = sonde_convex_displace(&a, pa, &b, pb, r.direction);
    assert_near(warm.depth_m, exact, 2e-9);
    sonde_convex_clear(&a);
    sonde_convex_clear(&b);
  }
  print_message("expanded: %.2g m from exact\n", worst_expand);
  for (int k = 0; k < 4; ++k)
    print_message("displaced %s, %s: mean excess %.2g, worst %.2g, %d of %d above 5 %%\n",
                  k / 2 ? "from the last separation" : "without a direction",
                  k % 2 ? "shallow" : "deep", mean[k / 2][k % 2] / number[k / 2][k % 2],
                  worst[k / 2][k % 2], over[k / 2][k % 2], number[k / 2][k % 2]);
  assert_true(compared > 200);
  assert_true(worst_expand < 2e-9);
  assert_true(worst[1][1] < 0.05);
}

// Balls, boxes in line, and bodies apart.
static void test_analytic_depth(void **state) {
  (void)state;
  uint64_t seed = 5;
  sonde_mesh ball = shape_sphere(30, 0.02), cube = shape_box(0.03, 0.02, 0.01);
  sonde_convex round = shape_convex(&ball), box = shape_convex(&cube);
  for (int k = 0; k < 30; ++k) {
    sonde_pose pa = {shape_point(&seed, 0.1), shape_rotation(&seed)};
    sonde_vec3 way = shape_direction(&seed);
    double depth = shape_uniform(&seed, 2e-4, 0.01);
    sonde_pose pb = {v_madd(pa.position, 0.04 - depth, way), shape_rotation(&seed)};
    sonde_depth_result e = convex_expand(&round, pa, &round, pb, 1e-7);
    sonde_depth_result j = sonde_convex_displace(&round, pa, &round, pb, nowhere);
    // The meshes lie up to 2 x 1.1e-5 m inside the balls.
    assert_near(e.depth_m, depth, 4e-5);
    assert_near(j.depth_m, depth, 4e-5);
    assert_true(v_dot(e.direction, way) > 0.98 && v_dot(j.direction, way) > 0.98);
    pb.position = v_madd(pa.position, 0.0401, way);
    assert_false(convex_expand(&round, pa, &round, pb, 1e-7).overlap);
    assert_false(sonde_convex_displace(&round, pa, &round, pb, nowhere).overlap);
    sonde_vec3 shift = q_rotate(pa.rotation, vec3(0.01, 0.005, 0.02 - 0.1 * depth));
    pb = (sonde_pose){v_add(pa.position, shift), pa.rotation};
    e = convex_expand(&box, pa, &box, pb, 1e-9);
    assert_near(e.depth_m, 0.1 * depth, 1e-9);
    assert_near(v_distance(e.direction, q_rotate(pa.rotation, vec3(0, 0, 1))), 0, 1e-6);
    assert_near(pose_apply_inverse(pa, e.point_a_m).z, 0.01, 1e-9);
    assert_near(sonde_convex_displace(&box, pa, &box, pb, nowhere).depth_m, 0.1 * depth, 1e-9);
  }
  sonde_convex_clear(&round);
  sonde_convex_clear(&box);
  sonde_mesh_clear(&ball);
  sonde_mesh_clear(&cube);
}

#ifdef SONDE_TEST_CCD
typedef struct placed_body {
  const sonde_convex *convex;
  sonde_pose pose;
} placed_body;

static void ccd_support(const void *object, const ccd_vec3_t *way, ccd_vec3_t *out) {
  const placed_body *body = object;
  sonde_vec3 local =
      q_rotate(q_conj(body->pose.rotation), vec3(ccdVec3X(way), ccdVec3Y(way), ccdVec3Z(way)));
  uint32_t best = 0;
  for (uint32_t v = 1; v < body->convex->hull.vertex_count; ++v)
    if (v_dot(local, body->convex->hull.vertices[v]) >
        v_dot(local, body->convex->hull.vertices[best]))
      best = v;
  sonde_vec3 p = pose_apply(body->pose, body->convex->hull.vertices[best]);
  ccdVec3Set(out, p.x, p.y, p.z);
}
#endif

// libccd's polytope, on the same bodies. It works in steps of its own tolerance, in metres scaled
// up so that this is small beside the bodies.
static void test_libccd(void **state) {
  (void)state;
#ifndef SONDE_TEST_CCD
  print_message("libccd (Debian package libccd-dev) was not found at configuration: skipped\n");
  skip();
#else
  uint64_t seed = 23;
  double worst = 0, worst_other = 0, mean_other = 0;
  int compared = 0, other_gave_up = 0;
  for (int k = 0; k < 300; ++k) {
    // Sizes of about 1.
    sonde_convex a = random_hull(&seed, 20, vec3(1, 1, 0.6)),
                 b = random_hull(&seed, 14, vec3(1.2, 0.7, 0.7));
    sonde_pose pa = {shape_point(&seed, 1), shape_rotation(&seed)};
    sonde_pose pb = {v_madd(pa.position, 6, shape_direction(&seed)), shape_rotation(&seed)};
    press(&a, pa, &b, &pb, shape_uniform(&seed, 0.01, 0.4));
    placed_body first = {&a, pa}, second = {&b, pb};
    ccd_t ccd;
    CCD_INIT(&ccd);
    ccd.support1 = ccd.support2 = ccd_support;
    ccd.max_iterations = 500;
    ccd.epa_tolerance = 1e-6;
    ccd_real_t depth;
    ccd_vec3_t way, at;
    int failed = ccdGJKPenetration(&first, &second, &ccd, &depth, &way, &at);
    sonde_depth_result r = convex_expand(&a, pa, &b, pb, 1e-8);
    if (failed) {
      ++other_gave_up;
    } else {
      ++compared;
      double exact = exact_depth(&a, pa, &b, pb);
      worst = fmax(worst, fabs(r.depth_m - exact));
      worst_other = fmax(worst_other, fabs((double)depth - exact));
      mean_other += fabs((double)depth - exact);
    }
    sonde_convex_clear(&a);
    sonde_convex_clear(&b);
  }
  print_message("%d pairs of size 1: off by %.2g, libccd by %.2g (mean %.2g); it gave up on %d\n",
                compared, worst, worst_other, mean_other / compared, other_gave_up);
  assert_true(compared > 250);
  assert_true(worst < 1e-4);
#endif
}

// Work of the depths over the vertices of the bodies: cold linear for the displacement (its first
// direction looks at each vertex), far below for both when a direction is known.
static void test_depth_cost(void **state) {
  (void)state;
  enum { SIZES = 5, POSES = 20 };
  double vertices[SIZES], cold[SIZES] = {0}, warm[SIZES] = {0}, expand[SIZES] = {0};
  for (int s = 0; s < SIZES; ++s) {
    uint64_t seed = 33;
    sonde_mesh ball = shape_sphere((uint32_t)lrint(8 * pow(1.6, s)), 0.02);
    sonde_convex body = shape_convex(&ball);
    vertices[s] = body.hull.vertex_count;
    for (int k = 0; k < POSES; ++k) {
      sonde_pose pa = {{0, 0, 0}, shape_rotation(&seed)};
      sonde_pose pb = {v_scale(shape_direction(&seed), 0.039), shape_rotation(&seed)};
      sonde_depth_result r = sonde_convex_displace(&body, pa, &body, pb, nowhere);
      cold[s] += r.support_calls / (double)POSES;
      r = sonde_convex_displace(&body, pa, &body, pb, r.direction);
      warm[s] += r.support_calls / (double)POSES;
      expand[s] += convex_expand(&body, pa, &body, pb, 1e-7).support_calls / (double)POSES;
    }
    print_message(
        "%6.0f vertices: displaced %7.0f dot products, from a direction %7.0f; expanded %6.0f\n",
        vertices[s], cold[s], warm[s], expand[s]);
    sonde_convex_clear(&body);
    sonde_mesh_clear(&ball);
  }
  print_message("slopes %.3f, %.3f, %.3f\n", shape_slope(vertices, cold, SIZES),
                shape_slope(vertices, warm, SIZES), shape_slope(vertices, expand, SIZES));
  assert_true(shape_slope(vertices, cold, SIZES) < 1.1);
  assert_true(shape_slope(vertices, expand, SIZES) < 1.1);
}

// ---- casts --------------------------------------------------------------------------------

static const sonde_quat upright = {1, 0, 0, 0};

// A box that flies at a thin plate, much farther in a step than both are thick.
static void test_no_tunnel(void **state) {
  (void)state;
  sonde_mesh cube = shape_box(0.01, 0.01, 0.001), sheet = shape_box(0.1, 0.1, 5e-5);
  sonde_convex a = shape_convex(&cube), b = shape_convex(&sheet);
  static const double speeds[] = {1, 30, 1000};
  for (int k = 0; k < 3; ++k) {
    sonde_motion fly = {{{0.01, 0.02, 0.031}, upright}, {0, 0, -speeds[k]}, {0, 0, 0}};
    sonde_motion rest = {{{0, 0, 0}, upright}, {0, 0, 0}, {0, 0, 0}};
    double gap = 0.031 - 0.001 - 5e-5, margin = 1e-5;
    sonde_cast_result r = sonde_convex_cast(&a, &fly, &b, &rest, 1, margin);
    assert_true(r.hit);
    assert_true(r.time_s * speeds[k] < gap && r.time_s * speeds[k] >= gap - margin);
    assert_near(r.direction.z, -1, 1e-6);
    // Both moving alike never touch; nor does what ends before.
    sonde_motion along = {rest.start, fly.velocity_m_s, {0, 0, 0}};
    assert_false(sonde_convex_cast(&a, &fly, &b, &along, 1, margin).hit);
    assert_false(
        sonde_convex_cast(&a, &fly, &b, &rest, (gap - 2 * margin) / speeds[k], margin).hit);
    // The sheet comes to the box.
    sonde_motion come = {{{0, 0, 0}, upright}, {0, 0, speeds[k]}, {0, 0, 0}};
    sonde_motion stay = {fly.start, {0, 0, 0}, {0, 0, 0}};
    assert_near(sonde_convex_cast(&a, &stay, &b, &come, 1, margin).time_s, r.time_s, 1e-12);
    // As a mesh.
    sonde_face_tree *tree = body_tree(&sheet);
    sonde_cast_result m = sonde_convex_cast_faces(&a, &fly, tree, 1, margin);
    assert_true(m.hit && m.time_s * speeds[k] < gap && m.time_s * speeds[k] >= gap - margin);
    assert_near(m.direction.z, -1, 1e-6);
    sonde_motion off = {{{0.2, 0, 0.031}, upright}, {0, 0, -speeds[k]}, {0, 0, 0}};
    assert_false(sonde_convex_cast_faces(&a, &off, tree, 1, margin).hit);
    sonde_face_tree_destroy(tree);
  }
  // Overlapping from the start.
  sonde_motion in = {{{0, 0, 0}, upright}, {0, 0, -1}, {0, 0, 0}};
  sonde_cast_result r = sonde_convex_cast(&a, &in, &b, &in, 1, 1e-6);
  assert_true(r.hit && r.time_s == 0 && r.distance_m == 0);
  sonde_convex_clear(&a);
  sonde_convex_clear(&b);
  sonde_mesh_clear(&cube);
  sonde_mesh_clear(&sheet);
}

// Tumbling bodies: never nearer than half the margin before the reported time, within the margin at
// it, by looking at many moments.
static void test_tumbling(void **state) {
  (void)state;
  uint64_t seed = 41;
  uint32_t hits = 0, misses = 0, most = 0;
  const double margin = 1e-5;
  for (int k = 0; k < 120; ++k) {
    sonde_convex a = random_hull(&seed, 14, vec3(0.05, 0.01, 0.01));
    sonde_convex b = random_hull(&seed, 14, vec3(0.03, 0.03, 0.01));
    sonde_motion ma = {{shape_point(&seed, 0.02), shape_rotation(&seed)},
                       shape_point(&seed, 1),
                       shape_point(&seed, 40)};
    sonde_vec3 way = shape_direction(&seed);
    sonde_motion mb = {{v_madd(ma.start.position, 0.12, way), shape_rotation(&seed)},
                       shape_point(&seed, 1),
                       shape_point(&seed, 40)};
    ma.velocity_m_s = v_madd(ma.velocity_m_s, 1.5, way);
    sonde_cast_result r = sonde_convex_cast(&a, &ma, &b, &mb, 0.1, margin);
    most = r.iterations > most ? r.iterations : most;
    for (int i = 0; i <= 400; ++i) {
      double t = r.time_s * i / 400;
      sonde_gjk_result g =
          sonde_gjk_distance(&a, sonde_motion_pose(&ma, t), &b, sonde_motion_pose(&mb, t), NULL);
      assert_true(g.distance_m >= 0.49 * margin);
      if (i == 400 && r.hit) assert_true(g.distance_m <= margin * 1.001);
    }
    hits += r.hit;
    misses += !r.hit;
    // The hull's faces say the same as the hull.
    sonde_mesh skin;
    assert_ok(sonde_mesh_copy(&b.hull, &skin, &shape_error));
    shape_move(&skin, mb.start);
    sonde_face_tree *tree = body_tree(&skin);
    sonde_motion rest = {mb.start, nowhere, nowhere};
    sonde_cast_result whole = sonde_convex_cast(&a, &ma, &b, &rest, 0.1, margin);
    sonde_cast_result faces = sonde_convex_cast_faces(&a, &ma, tree, 0.1, margin);
    assert_int_equal(whole.hit, faces.hit);
    if (whole.hit) assert_near(whole.time_s, faces.time_s, 1e-4 * whole.time_s + 1e-5);
    sonde_face_tree_destroy(tree);
    sonde_mesh_clear(&skin);
    sonde_convex_clear(&a);
    sonde_convex_clear(&b);
  }
  print_message("%u touches, %u passes, at most %u rounds\n", hits, misses, most);
  assert_true(hits > 20 && misses > 20);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_random_depth), cmocka_unit_test(test_analytic_depth),
      cmocka_unit_test(test_libccd),       cmocka_unit_test(test_depth_cost),
      cmocka_unit_test(test_no_tunnel),    cmocka_unit_test(test_tumbling),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
