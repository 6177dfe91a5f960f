// Convex bodies, hulls and probes.
#include "geometry/shapes.h"
#include "geometry/internal.h"

// All points behind all planes; every plane touched by at least three hull vertices.
static void check_hull(const sonde_convex *c, const sonde_vec3 *points, uint32_t count,
                       double slack) {
  sonde_mesh_report r = shape_report(&c->hull);
  assert_true(r.closed && r.outward);
  assert_int_equal(c->hull.vertex_count - r.edge_count + c->hull.face_count, 2);
  for (uint32_t k = 0; k < c->plane_count; ++k) {
    assert_near(v_norm(c->plane_normal[k]), 1, 1e-12);
    for (uint32_t i = 0; i < count; ++i)
      assert_true(v_dot(c->plane_normal[k], points[i]) <= c->plane_offset_m[k] + slack);
    int touching = 0;
    for (uint32_t v = 0; v < c->hull.vertex_count; ++v)
      touching += v_dot(c->plane_normal[k], c->hull.vertices[v]) > c->plane_offset_m[k] - slack;
    assert_true(touching >= 3);
  }
}

static void test_random_hulls(void **state) {
  (void)state;
  uint64_t seed = 31;
  sonde_vec3 points[300];
  for (int trial = 0; trial < 60; ++trial) {
    uint32_t count = 4 + (uint32_t)shape_uniform(&seed, 0, 296);
    double thin = trial % 4 == 0 ? 1e-4 : 1;
    sonde_pose pose = {shape_point(&seed, 10), shape_rotation(&seed)};
    for (uint32_t k = 0; k < count; ++k) {
      sonde_vec3 p = shape_point(&seed, 1);
      p.z *= thin;
      points[k] = pose_apply(pose, p);
    }
    sonde_convex c;
    assert_ok(sonde_convex_hull(points, count, &c, &shape_error));
    check_hull(&c, points, count, 1e-8);
    // Every hull vertex is one of the points.
    for (uint32_t v = 0; v < c.hull.vertex_count; ++v) {
      bool found = false;
      for (uint32_t k = 0; k < count && !found; ++k)
        found = !memcmp(&points[k], &c.hull.vertices[v], sizeof points[k]);
      assert_true(found);
    }
    sonde_convex_clear(&c);
  }
}

// Grids are the worst case: most points lie in faces and edges of the hull, many coincide.
static void test_grid_hulls(void **state) {
  (void)state;
  uint64_t seed = 17;
  sonde_vec3 points[2 * 6 * 6 * 6];
  for (int trial = 0; trial < 40; ++trial) {
    sonde_pose pose = {shape_point(&seed, 1), shape_rotation(&seed)};
    if (trial == 0) pose = (sonde_pose){{0, 0, 0}, {1, 0, 0, 0}};
    uint32_t count = 0;
    for (int k = 0; k < 6 * 6 * 6; ++k) {
      sonde_vec3 p = pose_apply(pose, vec3(0.1 * (k % 6), 0.2 * (k / 6 % 6), 0.3 * (k / 36)));
      points[count++] = p;
      points[count++] = p;
    }
    sonde_convex c;
    assert_ok(sonde_convex_hull(points, count, &c, &shape_error));
    check_hull(&c, points, count, 1e-8);
    assert_int_equal(c.plane_count, 6);
    assert_near(shape_report(&c.hull).volume_m3, 0.5 * 1.0 * 1.5, 1e-9);
    if (trial == 0) assert_int_equal(c.hull.vertex_count, 8);
    sonde_convex_clear(&c);
  }
}

static void test_flat_points(void **state) {
  (void)state;
  uint64_t seed = 23;
  sonde_vec3 points[20];
  sonde_pose pose = {shape_point(&seed, 1), shape_rotation(&seed)};
  sonde_convex c;
  sonde_error error = {0};
  for (int k = 0; k < 20; ++k) {
    points[k] = shape_point(&seed, 1);
    points[k].z = 0;
    points[k] = pose_apply(pose, points[k]);
  }
  assert_int_equal(sonde_convex_hull(points, 20, &c, &error), SONDE_MESH);
  assert_non_null(strstr(error.message, "one plane"));
  assert_int_equal(sonde_convex_hull(points, 3, &c, &error), SONDE_MESH);
  for (int k = 0; k < 20; ++k) points[k] = vec3(1, 2, 3);
  assert_int_equal(sonde_convex_hull(points, 20, &c, &error), SONDE_MESH);
  points[7].x = NAN;
  assert_int_equal(sonde_convex_hull(points, 20, &c, &error), SONDE_ARGUMENT);
  assert_null(c.hull.vertices);
}

static void test_not_convex(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(5, 1);
  sonde_convex c;
  sonde_error error = {0};
  ball.face_count--;
  assert_int_equal(sonde_convex_create(&ball, &c, &error), SONDE_MESH);
  assert_non_null(strstr(error.message, "closed"));
  ball.face_count++;
  ball.vertices[10] = v_scale(ball.vertices[10], 0.9);
  assert_int_equal(sonde_convex_create(&ball, &c, &error), SONDE_MESH);
  assert_non_null(strstr(error.message, "not convex"));
  assert_null(c.plane_normal);
  sonde_mesh_clear(&ball);
}

// Hill climbing finds what a look at every vertex finds, from any start.
static void test_support(void **state) {
  (void)state;
  uint64_t seed = 41;
  sonde_mesh meshes[2] = {shape_sphere(12, 0.1), shape_box(0.1, 0.2, 0.05)};
  for (int m = 0; m < 2; ++m) {
    sonde_convex c = shape_convex(&meshes[m]);
    for (int k = 0; k < 500; ++k) {
      sonde_vec3 d = shape_direction(&seed);
      if (k < 27) d = vec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      uint32_t start = (uint32_t)shape_uniform(&seed, 0, c.hull.vertex_count);
      uint32_t found = sonde_convex_support(&c, d, start);
      double best = -INFINITY;
      for (uint32_t v = 0; v < c.hull.vertex_count; ++v)
        best = fmax(best, v_dot(d, c.hull.vertices[v]));
      assert_true(v_dot(d, c.hull.vertices[found]) >= best - 1e-15);
    }
    sonde_convex_clear(&c);
    sonde_mesh_clear(&meshes[m]);
  }
}

// ---- probes -------------------------------------------------------------------------------

static sonde_probe make_probe(const char *name) {
  sonde_probe probe;
  assert_ok(sonde_probe_create(name, &probe, &shape_error));
  return probe;
}

static double top(const sonde_convex *c) {
  return c->hull.vertices[sonde_convex_support(c, vec3(0, 0, 1), 0)].z;
}

static void test_probes(void **state) {
  (void)state;
  static const double size[3][3] = {
      {6e-3, 6e-3, 60e-3}, {60e-3, 12e-3, 80e-3}, {24e-3, 24e-3, 60e-3}};
  for (int k = 0; k < 3; ++k) {
    const char *name = sonde_probe_names()[k];
    sonde_probe p = make_probe(name);
    assert_string_equal(p.name, name);
    assert_true(p.rectangular);
    assert_near(2 * p.half_x_m, size[k][0], 1e-15);
    assert_near(2 * p.half_y_m, size[k][1], 1e-15);
    assert_near(shape_report(&p.body.hull).volume_m3, size[k][0] * size[k][1] * size[k][2], 1e-15);
    assert_near(top(&p.body), 0, 0);
    assert_int_equal(p.body.plane_count, 6);
    sonde_probe_clear(&p);
  }
  assert_string_equal(sonde_probe_names()[3], "sphere");
  assert_null(sonde_probe_names()[4]);
}

// rect:AxB is a box of those sides; the built-in square is one of them.
static void test_rectangle_probe(void **state) {
  (void)state;
  sonde_probe square = make_probe("square"), same = make_probe("rect:24x24");
  assert_true(same.rectangular);
  assert_near(same.half_x_m, square.half_x_m, 1e-15);
  assert_near(same.half_y_m, square.half_y_m, 1e-15);
  sonde_mass big, small;
  assert_ok(sonde_mesh_mass(&square.body.hull, 1, &big, &shape_error));
  assert_ok(sonde_mesh_mass(&same.body.hull, 1, &small, &shape_error));
  assert_near(small.mass_kg / big.mass_kg, 1, 1e-12);
  sonde_probe odd = make_probe("rect:40x7.5");
  assert_near(odd.half_x_m, 20e-3, 1e-15);
  assert_near(odd.half_y_m, 3.75e-3, 1e-15);
  assert_string_equal(odd.name, "rect:40x7.5");
  sonde_probe_clear(&square);
  sonde_probe_clear(&same);
  sonde_probe_clear(&odd);
  const char *const bad[] = {"rect:",      "rect:24",      "rect:24x",    "rect:0x24",
                             "rect:24x-1", "rect:24x24mm", "rect:24x1e9", "rect:nanx3"};
  for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) {
    sonde_error error;
    assert_int_equal(sonde_probe_create(bad[k], &same, &error), SONDE_NOT_FOUND);
    assert_non_null(strstr(error.message, "rect:24x24"));
  }
}

static void test_sphere_probe(void **state) {
  (void)state;
  sonde_probe p = make_probe("sphere");
  sonde_mass m;
  assert_ok(sonde_mesh_mass(&p.body.hull, 1, &m, &shape_error));
  double exact = 4 * SONDE_PI / 3 * 15e-3 * 15e-3 * 15e-3;
  assert_near(m.mass_kg, exact, 0.01 * exact);
  assert_near(m.centre_m.z, -15e-3, 0.2e-3);
  assert_near(hypot(m.centre_m.x, m.centre_m.y), 0, 1e-9);
  assert_near(top(&p.body), 0, 1e-15);
  assert_true(p.body.hull.face_count >= 320);
  for (uint32_t v = 0; v < p.body.hull.vertex_count; ++v)
    assert_near(v_distance(p.body.hull.vertices[v], m.centre_m), 15e-3, 0.25e-3);
  sonde_probe_clear(&p);
}

static void test_unknown_probe(void **state) {
  (void)state;
  sonde_probe p;
  sonde_error error = {0};
  assert_int_equal(sonde_probe_create("banana", &p, &error), SONDE_NOT_FOUND);
  for (int k = 0; sonde_probe_names()[k]; ++k)
    assert_non_null(strstr(error.message, sonde_probe_names()[k]));
  assert_non_null(strstr(error.message, "banana"));
  assert_int_equal(sonde_probe_create("/no/such.stl", &p, &error), SONDE_IO);
  assert_null(p.body.hull.vertices);
}

// A file in mm, anywhere: it is seated with its contact end at the origin.
static void test_file_probe(void **state) {
  (void)state;
  sonde_mesh box = shape_box(0.01, 0.004, 0.03);
  shape_move(&box, (sonde_pose){{0.5, -0.2, 0.7}, {1, 0, 0, 0}});
  char path[] = "/tmp/sonde_probe_XXXXXX.stl";
  int descriptor = mkstemps(path, 4);
  assert_true(descriptor >= 0);
  close(descriptor);
  assert_ok(sonde_mesh_save(path, 1e-3, &box, &shape_error));
  sonde_probe p = make_probe(path);
  unlink(path);
  assert_near(p.half_x_m, 0.01, 1e-6);
  assert_near(p.half_y_m, 0.004, 1e-6);
  assert_true(!p.rectangular);
  assert_near(top(&p.body), 0, 1e-12);
  assert_near(shape_report(&p.body.hull).volume_m3, 0.02 * 0.008 * 0.06, 1e-10);
  assert_memory_equal(p.name, "sonde_probe_", 12);
  assert_null(strchr(p.name, '.'));
  sonde_probe_clear(&p);
  sonde_mesh_clear(&box);
}

static void test_real_probe(void **state) {
  (void)state;
  const char *path = SHAPE_DATA "probe_l14_5_38/Probe_L14-5_38_lowres.stl";
  if (access(path, R_OK)) skip();
  sonde_mesh mesh;
  assert_ok(sonde_mesh_load(path, 1e-3, &mesh, &shape_error));
  sonde_probe p = make_probe(path);
  sonde_vec3 low = mesh.vertices[0], high = low;
  for (uint32_t v = 0; v < mesh.vertex_count; ++v) {
    sonde_vec3 x = mesh.vertices[v];
    low = vec3(fmin(low.x, x.x), fmin(low.y, x.y), fmin(low.z, x.z));
    high = vec3(fmax(high.x, x.x), fmax(high.y, x.y), fmax(high.z, x.z));
  }
  print_message("%u faces, box %.1f x %.1f x %.1f mm: hull of %u faces, %u planes, "
                "contact face %.1f x %.1f mm\n",
                mesh.face_count, (high.x - low.x) * 1e3, (high.y - low.y) * 1e3,
                (high.z - low.z) * 1e3, p.body.hull.face_count, p.body.plane_count,
                p.half_x_m * 2e3, p.half_y_m * 2e3);
  assert_near(top(&p.body), 0, 1e-12);
  // In every direction the hull is as wide as the file's points, within what it may leave out.
  uint64_t seed = 3;
  for (int k = 0; k < 200; ++k) {
    sonde_vec3 d = shape_direction(&seed);
    double file_high = -INFINITY, file_low = INFINITY;
    for (uint32_t v = 0; v < mesh.vertex_count; ++v) {
      file_high = fmax(file_high, v_dot(d, mesh.vertices[v]));
      file_low = fmin(file_low, v_dot(d, mesh.vertices[v]));
    }
    const sonde_vec3 *x = p.body.hull.vertices;
    double hull_high = v_dot(d, x[sonde_convex_support(&p.body, d, 0)]);
    double hull_low = v_dot(d, x[sonde_convex_support(&p.body, v_neg(d), 0)]);
    assert_near(hull_high - hull_low, file_high - file_low, 0.2e-3);
    assert_true(hull_high - hull_low <= file_high - file_low + 1e-9);
  }
  sonde_mesh_clear(&mesh);
  sonde_probe_clear(&p);
}

// A tip and an edge have a face: the body's section 1 mm above them, by similar triangles. Upright
// and leaning the apex over one side.
static void test_pointed_probes(void **state) {
  (void)state;
  const double apex_x_mm[] = {0, 0, 15}, apex_y_mm[] = {0, 12, 12}; // half lengths of a top edge
  const char *path = "pointed_probe.obj";
  for (int k = 0; k < 3; ++k) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    double y = apex_y_mm[k], x = apex_x_mm[k];
    fprintf(file, "v -15 -12 -40\nv 15 -12 -40\nv 15 12 -40\nv -15 12 -40\n");
    fprintf(file, "v %g %g 0\nv %g %g 0\nf 1 2 5\nf 2 3 6\nf 3 4 6\nf 4 1 5\n", x, -y, x, y + 1e-3);
    fprintf(file, "f 1 4 3\nf 1 3 2\nf 2 6 5\nf 4 5 6\n");
    assert_int_equal(fclose(file), 0);
    sonde_probe p = make_probe(path);
    assert_near(p.half_x_m, 15e-3 / 40, 2e-6);
    assert_near(p.half_y_m, y * 1e-3 + (12 - y) * 1e-3 / 40, 2e-6);
    sonde_probe_clear(&p);
    assert_int_equal(remove(path), 0);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_random_hulls),  cmocka_unit_test(test_grid_hulls),
      cmocka_unit_test(test_flat_points),   cmocka_unit_test(test_not_convex),
      cmocka_unit_test(test_support),       cmocka_unit_test(test_probes),
      cmocka_unit_test(test_sphere_probe),  cmocka_unit_test(test_rectangle_probe),
      cmocka_unit_test(test_unknown_probe), cmocka_unit_test(test_file_probe),
      cmocka_unit_test(test_real_probe),    cmocka_unit_test(test_pointed_probes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
