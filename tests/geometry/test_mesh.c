// Measures of meshes against closed forms, topology, and behaviour without memory.
#include "geometry/shapes.h"
#include "geometry/internal.h"

static const double tau = 2 * SONDE_PI;

static void test_inspect(void **state) {
  (void)state;
  sonde_mesh box = shape_box(0.5, 1, 1.5);
  sonde_mesh_report r = shape_report(&box);
  assert_true(r.closed && r.outward);
  assert_int_equal(r.edge_count, 18);
  assert_int_equal(r.boundary_edges, 0);
  assert_int_equal(r.duplicate_or_degenerate_faces, 0);
  assert_near(r.area_m2, 2 * (1 * 2 + 2 * 3 + 1 * 3), 1e-14);
  assert_near(r.volume_m3, 6, 1e-14);
  assert_near(r.shortest_edge_m, 1, 1e-15);
  assert_near(r.longest_edge_m, sqrt(13), 1e-15);
  assert_near(r.smallest_angle_rad, atan(1.0 / 3), 1e-14);
  // Turned inside out it stays closed but encloses a negative volume.
  for (uint32_t f = 0; f < box.face_count; ++f) {
    uint32_t keep = box.faces[f][0];
    box.faces[f][0] = box.faces[f][1];
    box.faces[f][1] = keep;
  }
  r = shape_report(&box);
  assert_true(r.closed && !r.outward);
  assert_near(r.volume_m3, -6, 1e-14);
  sonde_mesh_clear(&box);
}

static void test_inspect_faults(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 1, 1);
  box.face_count = 11;
  sonde_mesh_report r = shape_report(&box);
  assert_true(!r.closed && !r.outward);
  assert_int_equal(r.boundary_edges, 3);
  box.face_count = 12;
  uint32_t keep[3];
  memcpy(keep, box.faces[11], sizeof keep);
  memcpy(box.faces[11], (uint32_t[3]){7, 7, 5}, sizeof keep);
  r = shape_report(&box);
  assert_true(!r.closed);
  assert_int_equal(r.duplicate_or_degenerate_faces, 1);
  memcpy(box.faces[11], (uint32_t[3]){box.faces[3][2], box.faces[3][0], box.faces[3][1]},
         sizeof keep);
  r = shape_report(&box);
  assert_true(!r.closed);
  assert_int_equal(r.duplicate_or_degenerate_faces, 1);
  // One face turned round: every edge has two faces, yet the surface is not closed.
  memcpy(box.faces[11], (uint32_t[3]){keep[0], keep[2], keep[1]}, sizeof keep);
  r = shape_report(&box);
  assert_true(!r.closed && r.boundary_edges == 0);
  box.faces[11][0] = 8;
  sonde_error error;
  assert_int_equal(sonde_mesh_inspect(&box, &r, &error), SONDE_MESH);
  assert_non_null(strstr(error.message, "face 11"));
  sonde_mesh_clear(&box);
}

// A box anywhere, turned anyhow: mass, centre and inertia follow the parallel and turned laws.
static void test_mass(void **state) {
  (void)state;
  uint64_t seed = 2;
  sonde_mesh box = shape_box(0.5, 1, 1.5);
  sonde_pose pose = {shape_point(&seed, 3), shape_rotation(&seed)};
  shape_move(&box, pose);
  sonde_mass m;
  assert_ok(sonde_mesh_mass(&box, 1000, &m, &shape_error));
  const double none[] = {-1, (double)NAN, (double)INFINITY};
  for (int k = 0; k < 3; ++k) {
    sonde_mass other;
    assert_int_equal(sonde_mesh_mass(&box, none[k], &other, NULL), SONDE_ARGUMENT);
  }
  assert_near(m.mass_kg, 6000, 1e-9);
  assert_near(v_distance(m.centre_m, pose.position), 0, 1e-13);
  double principal[3] = {6000 * (4 + 9) / 12.0, 6000 * (1 + 9) / 12.0, 6000 * (1 + 4) / 12.0};
  sonde_mat3 r = q_matrix(pose.rotation), d = m_zero();
  for (int k = 0; k < 3; ++k) d.m[k][k] = principal[k];
  sonde_mat3 expected = m_mul(r, m_mul(d, m_transpose(r)));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) assert_near(m.inertia_kg_m2.m[i][j], expected.m[i][j], 1e-9);
  box.face_count = 11;
  assert_int_equal(sonde_mesh_mass(&box, 1000, &m, NULL), SONDE_MESH);
  sonde_mesh_clear(&box);
}

static void test_sphere_measures(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(40, 0.5);
  sonde_mass m;
  assert_ok(sonde_mesh_mass(&ball, 1, &m, &shape_error));
  assert_near(m.mass_kg, 2 * tau / 3 * 0.125, 2e-3 * m.mass_kg);
  assert_near(m.inertia_kg_m2.m[1][1], 0.4 * m.mass_kg * 0.25, 2e-3 * m.inertia_kg_m2.m[1][1]);
  sonde_vec3 *normals = calloc(ball.vertex_count, sizeof *normals);
  double *areas = calloc(ball.vertex_count, sizeof *areas), sum = 0;
  sonde_mesh_normals(&ball, normals);
  sonde_mesh_areas(&ball, areas);
  for (uint32_t v = 0; v < ball.vertex_count; ++v) {
    assert_near(v_norm(normals[v]), 1, 1e-14);
    assert_near(v_dot(normals[v], v_scale(ball.vertices[v], 2)), 1, 1e-3);
    sum += areas[v];
  }
  assert_near(sum, shape_report(&ball).area_m2, 1e-12);
  free(normals);
  free(areas);
  sonde_mesh_clear(&ball);
}

static void test_topology(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(5, 1);
  sonde_topology t;
  assert_ok(sonde_topology_build(&ball, &t, &shape_error));
  assert_int_equal(ball.vertex_count - t.edge_count + ball.face_count, 2);
  assert_int_equal(t.start[t.vertex_count], 2 * t.edge_count);
  assert_int_equal(t.face_start[t.vertex_count], 3 * ball.face_count);
  for (uint32_t e = 0; e < t.edge_count; ++e) {
    assert_true(t.edges[e][0] < t.edges[e][1]);
    if (e) // lexicographic, without repetition
      assert_true(t.edges[e - 1][0] < t.edges[e][0] ||
                  (t.edges[e - 1][0] == t.edges[e][0] && t.edges[e - 1][1] < t.edges[e][1]));
    for (int side = 0; side < 2; ++side) {
      const uint32_t *f = ball.faces[t.edge_faces[e][side]];
      int shared = 0;
      for (int k = 0; k < 3; ++k) shared += f[k] == t.edges[e][0] || f[k] == t.edges[e][1];
      assert_int_equal(shared, 2);
    }
    assert_int_not_equal(t.edge_faces[e][0], t.edge_faces[e][1]);
  }
  for (uint32_t v = 0; v < t.vertex_count; ++v) {
    // Around a vertex of a closed surface there are as many faces as neighbours.
    assert_int_equal(t.start[v + 1] - t.start[v], t.face_start[v + 1] - t.face_start[v]);
    for (uint32_t i = t.start[v]; i < t.start[v + 1]; ++i) {
      if (i > t.start[v]) assert_true(t.neighbour[i - 1] < t.neighbour[i]);
      const uint32_t *e = t.edges[t.neighbour_edge[i]];
      assert_true((e[0] == v && e[1] == t.neighbour[i]) || (e[1] == v && e[0] == t.neighbour[i]));
    }
    for (uint32_t i = t.face_start[v]; i < t.face_start[v + 1]; ++i) {
      const uint32_t *f = ball.faces[t.face_list[i]];
      assert_true(f[0] == v || f[1] == v || f[2] == v);
    }
  }
  sonde_topology_clear(&t);
  sonde_mesh_clear(&ball);
}

static void test_topology_faults(void **state) {
  (void)state;
  sonde_mesh fan;
  sonde_topology t;
  sonde_error error;
  assert_ok(sonde_mesh_create(&fan, 5, 3, &shape_error));
  memcpy(fan.faces, (uint32_t[3][3]){{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}, sizeof(uint32_t[3][3]));
  assert_int_equal(sonde_topology_build(&fan, &t, &error), SONDE_MESH);
  assert_non_null(strstr(error.message, "more than two faces"));
  memcpy(fan.faces[2], (uint32_t[3]){4, 4, 1}, sizeof fan.faces[2]);
  assert_int_equal(sonde_topology_build(&fan, &t, &error), SONDE_MESH);
  assert_null(t.edges);
  sonde_mesh_clear(&fan);
}

// ---- footprint ----------------------------------------------------------------------------

static double footprint_sum(const sonde_mesh *mesh, sonde_vec3 centre, sonde_vec3 n, sonde_vec3 u,
                            sonde_vec3 v, double hu, double hv, double *each) {
  double *covered = each ? each : calloc(mesh->vertex_count, sizeof *covered), sum = 0;
  sonde_mesh_footprint(mesh, centre, n, u, v, hu, hv, 0.02, covered);
  for (uint32_t k = 0; k < mesh->vertex_count; ++k) sum += covered[k];
  if (!each) free(covered);
  return sum;
}

// On a flat face the covered area is the rectangle, wherever it lies and however it is turned.
static void test_footprint_flat(void **state) {
  (void)state;
  sonde_mesh box = shape_box(0.05, 0.05, 0.05), fine;
  double *areas = calloc(4000, sizeof *areas), *covered = calloc(4000, sizeof *covered);
  assert_ok(sonde_mesh_copy(&box, &fine, &shape_error));
  for (int k = 0; k < 8; ++k) {
    double turn = 0.4 * k, c = cos(turn), s = sin(turn);
    sonde_vec3 at = vec3(0.01 * c, 0.008 * s, 0.05);
    double sum = footprint_sum(&fine, at, vec3(0, 0, 1), vec3(c, s, 0), vec3(-s, c, 0), 0.03, 0.006,
                               covered);
    assert_near(sum, 0.06 * 0.012, 1e-15);
  }
  // The whole face: every vertex is covered with its cells on that face.
  footprint_sum(&fine, vec3(0, 0, 0.05), vec3(0, 0, 1), vec3(1, 0, 0), vec3(0, 1, 0), 1, 1,
                covered);
  for (uint32_t v = 0; v < fine.vertex_count; ++v) areas[v] = 0;
  for (uint32_t f = 0; f < fine.face_count; ++f) {
    const uint32_t *v = fine.faces[f];
    if (fine.vertices[v[0]].z < 0 || fine.vertices[v[1]].z < 0 || fine.vertices[v[2]].z < 0)
      continue;
    for (int k = 0; k < 3; ++k) areas[v[k]] += 0.5 * 0.1 * 0.1 / 3;
  }
  for (uint32_t v = 0; v < fine.vertex_count; ++v) assert_near(covered[v], areas[v], 1e-15);
  free(areas);
  free(covered);
  sonde_mesh_clear(&fine);
  sonde_mesh_clear(&box);
}

// Seen obliquely a plane shows more skin than the rectangle: area / cosine.
static void test_footprint_oblique(void **state) {
  (void)state;
  sonde_mesh box = shape_box(0.05, 0.05, 0.05);
  double lean = 0.5;
  sonde_vec3 n = vec3(sin(lean), 0, cos(lean)), u = vec3(cos(lean), 0, -sin(lean));
  double sum = footprint_sum(&box, vec3(0, 0, 0.05), n, u, vec3(0, 1, 0), 0.006, 0.008, NULL);
  assert_near(sum, 0.012 * 0.016 / cos(lean), 1e-15);
  // Axes of any length give the same rectangle.
  double same = footprint_sum(&box, vec3(0, 0, 0.05), v_scale(n, 3), v_scale(u, 2), vec3(0, 0.1, 0),
                              0.006, 0.008, NULL);
  assert_near(same, sum, 1e-15);
  // So do axes that lean along the line of sight.
  same = footprint_sum(&box, vec3(0, 0, 0.05), n, v_madd(u, 0.4, n), v_madd(vec3(0, 1, 0), -0.3, n),
                       0.006, 0.008, NULL);
  assert_near(same, sum, 1e-15);
  // The far side of the box looks away and does not count.
  assert_near(footprint_sum(&box, vec3(0, 0, -0.05), n, u, vec3(0, 1, 0), 0.006, 0.008, NULL), 0,
              0);
  sonde_mesh_clear(&box);
}

// Adjacent rectangles share nothing and miss nothing, on a curved surface too.
static void test_footprint_additive(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(15, 0.08);
  uint64_t seed = 6;
  for (int k = 0; k < 10; ++k) {
    sonde_vec3 n = shape_direction(&seed), u = v_unit(v_cross(n, shape_direction(&seed)), n);
    sonde_vec3 v = v_cross(n, u), at = v_scale(n, 0.08);
    double whole = footprint_sum(&ball, at, n, u, v, 0.02, 0.006, NULL);
    double left = footprint_sum(&ball, v_madd(at, -0.01, u), n, u, v, 0.01, 0.006, NULL);
    double right = footprint_sum(&ball, v_madd(at, 0.01, u), n, u, v, 0.01, 0.006, NULL);
    assert_near(left + right, whole, 1e-14);
    assert_true(whole > 0.04 * 0.012 && whole < 1.05 * 0.04 * 0.012);
  }
  sonde_mesh_clear(&ball);
}

// ---- memory -------------------------------------------------------------------------------

// The allocation with this number fails, all others succeed.
static long failing, count, live;

static void *count_down(size_t size, void *user) {
  (void)user;
  if (count++ == failing) return NULL;
  ++live;
  return malloc(size);
}

static void release(void *pointer, void *user) {
  (void)user;
  --live;
  free(pointer);
}

static double coarse(sonde_vec3 point, void *user) {
  (void)point;
  (void)user;
  return 0.5;
}

// Two pointed caps of slivers.
static sonde_mesh make_spindle(void) {
  enum { SIDES = 30 };
  sonde_mesh mesh;
  assert_ok(sonde_mesh_create(&mesh, SIDES + 2, 2 * SIDES, &shape_error));
  for (uint32_t k = 0; k < SIDES; ++k) {
    uint32_t next = (k + 1) % SIDES;
    mesh.vertices[k] = vec3(cos(tau * k / SIDES), sin(tau * k / SIDES), 0);
    memcpy(mesh.faces[2 * k], (uint32_t[3]){k, next, SIDES}, sizeof mesh.faces[0]);
    memcpy(mesh.faces[2 * k + 1], (uint32_t[3]){next, k, SIDES + 1}, sizeof mesh.faces[0]);
  }
  mesh.vertices[SIDES] = vec3(0, 0, 1);
  mesh.vertices[SIDES + 1] = vec3(0, 0, -1);
  return mesh;
}

// Everything in the room that allocates.
static sonde_status build_all(const sonde_mesh *spindle, const char *const files[2],
                              sonde_error *error) {
  sonde_mesh refined = {0}, loaded[2] = {{0}};
  sonde_convex convex = {0};
  sonde_surface_index *index = NULL;
  sonde_probe probe = {0};
  sonde_mass mass;
  sonde_status status = sonde_mesh_refine(spindle, coarse, NULL, &refined, error);
  if (!status) status = sonde_convex_create(spindle, &convex, error);
  if (!status) status = sonde_surface_index_create(&refined, &index, error);
  if (!status) status = sonde_mesh_mass(&refined, 1, &mass, error);
  if (!status) status = sonde_probe_create("sphere", &probe, error);
  for (int k = 0; k < 2; ++k)
    if (!status) status = sonde_mesh_load(files[k], 1, &loaded[k], error);
  sonde_probe_clear(&probe);
  if (!status) status = sonde_probe_create(files[1], &probe, error);
  sonde_mesh_clear(&refined);
  sonde_mesh_clear(&loaded[0]);
  sonde_mesh_clear(&loaded[1]);
  sonde_convex_clear(&convex);
  sonde_surface_index_destroy(index);
  sonde_probe_clear(&probe);
  return status;
}

// Whichever allocation fails, the answer is SONDE_MEMORY and nothing leaks.
static void test_no_memory(void **state) {
  (void)state;
  sonde_mesh spindle = make_spindle();
  char ply[] = "/tmp/sonde_mesh_XXXXXX.ply", stl[] = "/tmp/sonde_mesh_XXXXXX.stl";
  close(mkstemps(ply, 4));
  close(mkstemps(stl, 4));
  assert_ok(sonde_mesh_save(ply, 1, &spindle, &shape_error));
  assert_ok(sonde_mesh_save(stl, 1, &spindle, &shape_error));
  sonde_set_allocator(&(sonde_allocator){count_down, release, NULL});
  bool failed = true;
  for (failing = 0; failed; ++failing) {
    sonde_error error = {0};
    live = count = 0;
    sonde_status status = build_all(&spindle, (const char *const[2]){ply, stl}, &error);
    failed = failing < count;
    if (status != (failed ? SONDE_MEMORY : SONDE_OK))
      fail_msg("allocation %ld: %s %s", failing, sonde_status_text(status), error.message);
    assert_int_equal(live, 0);
  }
  sonde_set_allocator(NULL);
  assert_true(failing > 60);
  unlink(ply);
  unlink(stl);
  sonde_mesh_clear(&spindle);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_inspect),
      cmocka_unit_test(test_inspect_faults),
      cmocka_unit_test(test_mass),
      cmocka_unit_test(test_sphere_measures),
      cmocka_unit_test(test_topology),
      cmocka_unit_test(test_topology_faults),
      cmocka_unit_test(test_footprint_flat),
      cmocka_unit_test(test_footprint_oblique),
      cmocka_unit_test(test_footprint_additive),
      cmocka_unit_test(test_no_memory),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
