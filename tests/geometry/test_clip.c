// Laws of the clipped interpenetration volume.
#include "base/random.h"
#include "../sanitized.h"
#include "geometry/shapes.h"
#include "geometry/internal.h"

// A skin patch: z = shape(x, y) over a square grid, outward normal +z; tissue below.
typedef double (*shape_fn)(double x, double y);

static sonde_mesh make_patch(uint32_t cells, double half, shape_fn shape) {
  sonde_mesh mesh;
  assert_ok(sonde_mesh_create(&mesh, (cells + 1) * (cells + 1), 2 * cells * cells, &shape_error));
  for (uint32_t j = 0; j <= cells; ++j)
    for (uint32_t i = 0; i <= cells; ++i) {
      double x = half * (2.0 * i / cells - 1), y = half * (2.0 * j / cells - 1);
      mesh.vertices[j * (cells + 1) + i] = vec3(x, y, shape(x, y));
    }
  for (uint32_t j = 0, f = 0; j < cells; ++j)
    for (uint32_t i = 0; i < cells; ++i) {
      uint32_t a = j * (cells + 1) + i, b = a + 1, c = a + cells + 1, d = c + 1;
      memcpy(mesh.faces[f++], (uint32_t[3]){a, b, d}, sizeof mesh.faces[0]);
      memcpy(mesh.faces[f++], (uint32_t[3]){a, d, c}, sizeof mesh.faces[0]);
    }
  return mesh;
}

// The bodies of these tests are probes whose contact end looks along +z of their frame; this pose
// turns them to press down (-z) on a patch.
static sonde_pose pressing(double x, double y, double z, double tilt) {
  sonde_quat down = {0, 1, 0, 0};
  sonde_quat lean = {cos(tilt / 2), 0.6 * sin(tilt / 2), 0.8 * sin(tilt / 2), 0};
  return (sonde_pose){{x, y, z}, q_mul(lean, down)};
}

// The body's beam axis: along it no column can enter through the side of a box.
static sonde_vec3 axis(sonde_pose pose) { return q_rotate(pose.rotation, vec3(0, 0, 1)); }

typedef struct total {
  double volume, area, depth;
  sonde_vec3 area_vector;
} total;

// Sum over all faces, in the body's frame; gradient (world) may be NULL.
static total clip_all(const sonde_mesh *patch, const sonde_convex *body, sonde_pose pose,
                      sonde_vec3 direction, sonde_vec3 *gradient) {
  total sum = {0};
  for (uint32_t v = 0; v < patch->vertex_count && gradient; ++v) gradient[v] = vec3(0, 0, 0);
  for (uint32_t f = 0; f < patch->face_count; ++f) {
    sonde_vec3 corner[3];
    for (int k = 0; k < 3; ++k)
      corner[k] = pose_apply_inverse(pose, patch->vertices[patch->faces[f][k]]);
    sonde_clip_result result;
    bool hit = sonde_clip_triangle(body->plane_normal, body->plane_offset_m, body->plane_count,
                                   corner, q_rotate(q_conj(pose.rotation), direction), &result);
    if (!hit) {
      assert_true(result.volume_m3 == 0 && result.area_m2 == 0);
      continue;
    }
    double shares = result.share_m3[0] + result.share_m3[1] + result.share_m3[2];
    assert_near(shares, result.volume_m3, 1e-12 * fabs(result.volume_m3) + 1e-30);
    sum.volume += result.volume_m3;
    sum.area += result.area_m2;
    sum.depth = fmax(sum.depth, result.depth_max_m);
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 g = q_rotate(pose.rotation, result.gradient[k]);
      sum.area_vector = v_add(sum.area_vector, g);
      if (gradient) {
        uint32_t v = patch->faces[f][k];
        gradient[v] = v_add(gradient[v], g);
      }
    }
  }
  return sum;
}

static double flat(double x, double y) {
  (void)x;
  (void)y;
  return 0;
}

static double bumpy(double x, double y) {
  return 2e-3 * sin(260 * x + 0.4) * cos(310 * y) + 6 * (x * x + y * y) - 1.5e-3;
}

static sonde_convex probe_body(const char *name) {
  sonde_probe probe;
  assert_ok(sonde_probe_create(name, &probe, &shape_error));
  return probe.body;
}

static const sonde_vec3 down = {0, 0, -1};

// A box pressed upright into a half space displaces face area times depth.
static void test_box_upright(void **state) {
  (void)state;
  sonde_mesh patch = make_patch(17, 0.04, flat);
  sonde_convex box = probe_body("square");
  total sum = clip_all(&patch, &box, pressing(1e-3, -2e-3, -5e-3, 0), down, NULL);
  assert_near(sum.volume, 24e-3 * 24e-3 * 5e-3, 1e-15);
  assert_near(sum.area, 24e-3 * 24e-3, 1e-12);
  assert_near(sum.depth, 5e-3, 1e-12);
  sonde_mesh_clear(&patch);
  sonde_convex_clear(&box);
}

// A tilted box enters by an edge: the volume below z = 0 from the convex body itself, cut by a
// plane, is a prism whose size follows from elementary geometry.
static void test_box_tilted(void **state) {
  (void)state;
  // Turn about y by 45 degrees: the edge of half width w at depth h displaces a prism of
  // triangular section with height h and base 2 h, length 2 half_y.
  sonde_mesh patch = make_patch(23, 0.05, flat);
  sonde_convex box = probe_body("square");
  double angle = SONDE_PI / 4, h = 4e-3;
  sonde_quat lean = {cos(angle / 2), 0, sin(angle / 2), 0};
  sonde_pose pose = {{0, 0, 0}, q_mul(lean, (sonde_quat){0, 1, 0, 0})};
  double lowest = 0;
  for (uint32_t v = 0; v < box.hull.vertex_count; ++v)
    lowest = fmin(lowest, pose_apply(pose, box.hull.vertices[v]).z);
  pose.position.z = -h - lowest;
  total sum = clip_all(&patch, &box, pose, down, NULL);
  assert_near(sum.volume, h * h * 24e-3, 1e-14);
  assert_near(sum.depth, h, 1e-6);
  // Columns along another direction fill the same space while none enters through a side.
  sonde_vec3 slanted = v_unit(vec3(0.3, 0, -1), down);
  assert_near(clip_all(&patch, &box, pose, slanted, NULL).volume, h * h * 24e-3, 1e-14);
  sonde_mesh_clear(&patch);
  sonde_convex_clear(&box);
}

// A fine sphere displaces a spherical cap, and never more than the true sphere would.
static void test_sphere_cap(void **state) {
  (void)state;
  const double radius = 0.015, depth = 0.006;
  sonde_mesh ball = shape_sphere(24, radius), patch = make_patch(40, 0.02, flat);
  sonde_convex body = shape_convex(&ball);
  sonde_pose pose = {{1e-4, 2e-4, radius - depth}, {1, 0, 0, 0}};
  double cap = SONDE_PI * depth * depth * (3 * radius - depth) / 3;
  total sum = clip_all(&patch, &body, pose, down, NULL);
  assert_true(sum.volume < cap && sum.volume > 0.98 * cap);
  sonde_mesh_clear(&ball);
  sonde_mesh_clear(&patch);
  sonde_convex_clear(&body);
}

// The volume of a polyhedral body below a plane does not depend on how the skin is cut into faces
// nor on the body's position over them: mesh-independent, hundreds of planes, many pieces per face.
static void test_mesh_independent(void **state) {
  (void)state;
  sonde_mesh coarse = make_patch(3, 0.03, flat), fine = make_patch(61, 0.03, flat);
  sonde_convex body = probe_body("sphere");
  for (int k = 0; k < 6; ++k) {
    sonde_pose pose = pressing(1e-3 * k, -7e-4 * k, -1e-3 * (k + 1), 0.1 * k);
    total a = clip_all(&coarse, &body, pose, down, NULL);
    total b = clip_all(&fine, &body, pose, down, NULL);
    assert_true(b.volume > 0);
    assert_near(a.volume, b.volume, 1e-11 * b.volume);
    assert_near(a.area, b.area, 1e-11 * b.area);
    total slanted = clip_all(&coarse, &body, pose, v_unit(vec3(-0.15, 0.2, -1), down), NULL);
    assert_near(slanted.volume, b.volume, 1e-11 * b.volume);
  }
  sonde_mesh_clear(&coarse);
  sonde_mesh_clear(&fine);
  sonde_convex_clear(&body);
}

static bool inside_body(const sonde_convex *body, sonde_vec3 p) {
  for (uint32_t j = 0; j < body->plane_count; ++j)
    if (v_dot(body->plane_normal[j], p) > body->plane_offset_m[j]) return false;
  return true;
}

// Volume by counting cells below the patch (its own triangles, by a ray) and inside the body.
static double voxel_volume(const sonde_mesh *patch, const sonde_convex *body, sonde_pose pose,
                           double half, uint32_t cells) {
  sonde_surface_index *index = NULL;
  assert_ok(sonde_surface_index_create(patch, &index, &shape_error));
  double step = 2 * half / cells, depth_step = 5e-5, volume = 0;
  for (uint32_t j = 0; j < cells; ++j)
    for (uint32_t i = 0; i < cells; ++i) {
      double x = -half + (i + 0.5) * step, y = -half + (j + 0.5) * step;
      sonde_surface_point hit;
      if (!sonde_surface_raycast(index, vec3(x, y, 1), down, 2, &hit)) continue;
      for (double z = hit.point_m.z - depth_step / 2; z > -0.03; z -= depth_step)
        if (inside_body(body, pose_apply_inverse(pose, vec3(x, y, z))))
          volume += step * step * depth_step;
    }
  sonde_surface_index_destroy(index);
  return volume;
}

static void test_bumpy_against_voxels(void **state) {
  (void)state;
  sonde_mesh patch = make_patch(20, 0.03, bumpy);
  static const char *const names[] = {"square", "sphere", "point"};
  for (int k = 0; k < 3; ++k) {
    sonde_convex body = probe_body(names[k]);
    sonde_pose pose = pressing(1.3e-3, -0.7e-3, -5e-3, 0.13);
    double volume = clip_all(&patch, &body, pose, axis(pose), NULL).volume;
    double counted = voxel_volume(&patch, &body, pose, 0.03, 240);
    assert_true(volume > 1e-8);
    assert_near(volume, counted, 0.01 * counted);
    sonde_convex_clear(&body);
  }
  sonde_mesh_clear(&patch);
}

// The gradient is the derivative of the total volume with respect to every vertex.
static void check_gradient(sonde_mesh *patch, const sonde_convex *body, sonde_pose pose) {
  sonde_vec3 *gradient = calloc(patch->vertex_count, sizeof *gradient);
  clip_all(patch, body, pose, axis(pose), gradient);
  double largest = 0, worst = 0, step = 2e-7;
  for (uint32_t v = 0; v < patch->vertex_count; ++v) largest = fmax(largest, v_norm(gradient[v]));
  assert_true(largest > 0);
  for (uint32_t v = 0; v < patch->vertex_count; v += 3) {
    sonde_vec3 keep = patch->vertices[v];
    double *x[3] = {&patch->vertices[v].x, &patch->vertices[v].y, &patch->vertices[v].z};
    double exact[3] = {gradient[v].x, gradient[v].y, gradient[v].z};
    for (int k = 0; k < 3; ++k) {
      double at = *x[k];
      *x[k] = at + step;
      double more = clip_all(patch, body, pose, axis(pose), NULL).volume;
      *x[k] = at - step;
      double less = clip_all(patch, body, pose, axis(pose), NULL).volume;
      worst = fmax(worst, fabs((more - less) / (2 * step) - exact[k]));
      *x[k] = at;
    }
    patch->vertices[v] = keep;
  }
  assert_near(worst / largest, 0, 1e-6);
  free(gradient);
}

static void test_gradient(void **state) {
  (void)state;
  sonde_mesh patch = make_patch(14, 0.03, bumpy);
  static const char *const names[] = {"square", "sphere"};
  for (int k = 0; k < 2; ++k) {
    sonde_convex body = probe_body(names[k]);
    check_gradient(&patch, &body, pressing(1.3e-3, -0.7e-3, -4e-3, 0.1));
    sonde_convex_clear(&body);
  }
  sonde_mesh_clear(&patch);
}

// Moving the body changes the volume by minus the sum of the vertex gradients.
static void test_body_motion(void **state) {
  (void)state;
  sonde_mesh patch = make_patch(16, 0.03, bumpy);
  sonde_convex body = probe_body("square");
  sonde_pose pose = pressing(1.3e-3, -0.7e-3, -4e-3, 0.1);
  total at = clip_all(&patch, &body, pose, axis(pose), NULL);
  double step = 1e-7;
  sonde_vec3 moves[3] = {{step, 0, 0}, {0, step, 0}, {0, 0, step}};
  double expected[3] = {-at.area_vector.x, -at.area_vector.y, -at.area_vector.z};
  for (int k = 0; k < 3; ++k) {
    sonde_pose more = pose, less = pose;
    more.position = v_add(pose.position, moves[k]);
    less.position = v_sub(pose.position, moves[k]);
    double slope = (clip_all(&patch, &body, more, axis(more), NULL).volume -
                    clip_all(&patch, &body, less, axis(less), NULL).volume) /
                   (2 * step);
    assert_near(slope, expected[k], 1e-6 * v_norm(at.area_vector));
  }
  sonde_mesh_clear(&patch);
  sonde_convex_clear(&body);
}

// A triangle deep inside the body: shape function integrals are exactly a third of the area.
static void test_submerged(void **state) {
  (void)state;
  sonde_convex body = probe_body("square");
  sonde_vec3 corner[3] = {{0, 0, -0.01}, {2e-3, 0, -0.012}, {0, 3e-3, -0.011}};
  // The probe looks along +z: tissue lies beyond, so the outward normal points to -z.
  sonde_vec3 flipped[3] = {corner[0], corner[2], corner[1]};
  sonde_clip_result result;
  assert_true(sonde_clip_triangle(body.plane_normal, body.plane_offset_m, body.plane_count, flipped,
                                  vec3(0, 0, 1), &result));
  sonde_vec3 area =
      v_scale(v_cross(v_sub(flipped[1], flipped[0]), v_sub(flipped[2], flipped[0])), 0.5);
  for (int k = 0; k < 3; ++k)
    assert_near(v_distance(result.gradient[k], v_scale(area, 1.0 / 3)), 0, 1e-18);
  assert_near(result.volume_m3, 3e-6 * 0.011, 1e-17);
  assert_near(result.depth_max_m, 0.012, 1e-15);
  // Vertex shares follow depth: the deepest corner has the largest share.
  assert_true(result.share_m3[2] > result.share_m3[1] && result.share_m3[1] > result.share_m3[0]);
  sonde_convex_clear(&body);
}

// Steep faces beside a body of many planes, where columns end on nearly equal planes: every clip
// ends, its volume is finite and its shares add up.
static void test_steep_faces_end(void **state) {
  (void)state;
  sonde_convex body = probe_body("sphere");
  uint64_t count = 0;
  for (uint64_t k = 0; k < ROUNDS(300000, 20000); ++k) {
    sonde_vec3 corner[3], middle = {0, 0, -0.015};
    double angle = 6.2831853 * sonde_random_uniform(1, 8 * k);
    double height = -0.001 - 0.028 * sonde_random_uniform(2, 8 * k);
    double reach = sqrt(fmax(0, 0.015 * 0.015 - (height + 0.015) * (height + 0.015)));
    for (uint64_t c = 0; c < 3; ++c) {
      double r = reach * (0.9 + 0.15 * sonde_random_uniform(3, 8 * k + c));
      double turn = angle + 0.2 * (sonde_random_uniform(4, 8 * k + c) - 0.5);
      double z = height + 0.006 * (sonde_random_uniform(5, 8 * k + c) - 0.5);
      corner[c] = vec3(r * cos(turn), r * sin(turn), z);
    }
    assert_true(v_distance(corner[0], middle) < 0.03);
    sonde_clip_result r;
    count += sonde_clip_triangle(body.plane_normal, body.plane_offset_m, body.plane_count, corner,
                                 vec3(0, 0, 1), &r);
    assert_true(isfinite(r.volume_m3) && isfinite(r.depth_max_m));
    double sum = r.share_m3[0] + r.share_m3[1] + r.share_m3[2];
    assert_near(sum, r.volume_m3, 1e-6 * fabs(r.volume_m3) + 1e-20);
  }
  assert_true(count > ROUNDS(50000, 3000));
  sonde_convex_clear(&body);
}

// A face for which two columns' ends are equal within rounding: the search for the lower one must
// end.
static void test_equal_planes_end(void **state) {
  (void)state;
  static const sonde_pose pose = {
      {0x1.5c5ddb7b491c2p-5, 0x1.4a082543a6ea2p-5, 0x1.1c3bf74f5c052p-3},
      {-0x1.1eb830cdd6442p-2, 0x1.3a30b5809e893p-2, 0x1.5806001b1d75ap-1, -0x1.39f1b8902d3a5p-1}};
  static const sonde_vec3 corner[3] = {
      {0x1.c6c2a58c1d0e9p-5, 0x1.3fa7bab1eeda6p-5, 0x1.34a731152707fp-3},
      {0x1.c607d73eaf65ep-5, 0x1.3190f3dc2b903p-5, 0x1.2fb4db623edeep-3},
      {0x1.b411ea34728efp-5, 0x1.4a06079a21338p-5, 0x1.367e97b1a05ep-3}};
  sonde_convex body = probe_body("sphere");
  sonde_mat3 r = q_matrix(pose.rotation);
  for (uint32_t k = 0; k < body.plane_count; ++k) {
    body.plane_normal[k] = m_mul_v(r, body.plane_normal[k]);
    body.plane_offset_m[k] += v_dot(body.plane_normal[k], pose.position);
  }
  sonde_clip_result result;
  assert_true(sonde_clip_triangle(body.plane_normal, body.plane_offset_m, body.plane_count, corner,
                                  m_mul_v(r, vec3(0, 0, 1)), &result));
  assert_true(isfinite(result.volume_m3));
  sonde_convex_clear(&body);
}

// Columns of a face beside the ball that end on several planes which meet within rounding: pieces
// so thin that a cut changes its sign more than twice around them. The volume is that of a fine
// grid of columns.
static void test_thin_pieces(void **state) {
  (void)state;
  static const sonde_vec3 direction = {-0x1.fea5ffe958f8fp-1, 0x1.c3b4fcd23116p-7,
                                       -0x1.240318e1cd3ap-4};
  static const sonde_vec3 corner[3] = {
      {0x1.ee2f5a6778d42p-5, 0x1.194285c4135c1p-7, 0x1.6fb4626246d45p-4},
      {0x1.ef3a24cc4a9c1p-5, 0x1.49e82c0b26c6p-12, 0x1.8148f5436211ap-4},
      {0x1.d99b6155b8296p-5, -0x1.d697a4ed336e6p-10, 0x1.8e4429a2133a3p-4}};
  static const sonde_vec3 normal[] = {
      {-0x1.631475eedb251p-1, 0x1.3779e5c38c3adp-1, 0x1.8b3204981737p-2},
      {-0x1.b5a5ba269febap-2, -0x1.210e9bd23cf69p-2, 0x1.b7bd90b232dcap-1},
      {-0x1.72bf1d88ad9cep-1, -0x1.bfe5d7c800e95p-3, 0x1.4ee460e628f19p-1},
      {-0x1.971b515046976p-1, 0x1.302aee2d9a2e6p-2, 0x1.0eb34429d8da9p-1},
      {-0x1.9a668454d2171p-1, 0x1.f8761bb9f832p-4, 0x1.2b90a4833022ep-1},
      {-0x1.5aa8f5cfc0f15p-1, 0x1.9cb880aa83b68p-2, 0x1.3b417efaf8a37p-1},
      {-0x1.60c4536b451c5p-1, 0x1.4a6248e638974p-4, 0x1.70c60cc0f2abp-1},
      {-0x1.37b52d2369fdp-1, 0x1.6a55ba3a61af9p-3, 0x1.8bf35b51cf47bp-1},
      {-0x1.3468b83bb9187p-1, 0x1.677c3cd7ca275p-2, 0x1.6f0af61c8e7dap-1}};
  static const double offset[] = {-0x1.278b72b738c7p-9, 0x1.c5e9b6fd88359p-5, 0x1.1fd9bdb25e962p-6,
                                  0x1.2e5b11c84097ap-9, 0x1.a850eb005a87dp-8, 0x1.24671d35cd8b7p-6,
                                  0x1.a30223d5cd75p-6,  0x1.2429847a30a92p-5, 0x1.01f80f9954698p-5};
  enum { PLANES = SONDE_COUNT_OF(offset), CELLS = 600 };
  sonde_clip_result result;
  assert_true(sonde_clip_triangle(normal, offset, PLANES, corner, direction, &result));
  double sum = 0;
  for (int cell = 0; cell < CELLS * CELLS; ++cell) {
    // Middles of the upright cells of the triangle's grid and of the turned ones between them.
    double u = (cell / CELLS + 1 / 3.0) / CELLS, v = (cell % CELLS + 1 / 3.0) / CELLS;
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    sonde_vec3 p = v_madd(v_scale(corner[0], 1 - u - v), u, corner[1]);
    double length = INFINITY;
    p = v_madd(p, v, corner[2]);
    for (int k = 0; k < PLANES; ++k) {
      double depth = offset[k] - v_dot(normal[k], p), along = v_dot(normal[k], direction);
      if (along > 1e-9 || depth <= 0) length = fmin(length, depth <= 0 ? 0 : depth / along);
    }
    sum += length / (CELLS * CELLS);
  }
  sonde_vec3 area = v_cross(v_sub(corner[1], corner[0]), v_sub(corner[2], corner[0]));
  double volume = -0.5 * v_dot(area, direction) * sum;
  assert_near(result.volume_m3, volume, 0.01 * fabs(volume));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_box_upright),          cmocka_unit_test(test_box_tilted),
      cmocka_unit_test(test_sphere_cap),           cmocka_unit_test(test_mesh_independent),
      cmocka_unit_test(test_bumpy_against_voxels), cmocka_unit_test(test_gradient),
      cmocka_unit_test(test_body_motion),          cmocka_unit_test(test_submerged),
      cmocka_unit_test(test_steep_faces_end),      cmocka_unit_test(test_equal_planes_end),
      cmocka_unit_test(test_thin_pieces),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
