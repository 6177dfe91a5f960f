// Closest point, rays and inside tests against brute force and closed forms.
#include "geometry/shapes.h"
#include "geometry/internal.h"

static sonde_surface_index *make_index(const sonde_mesh *mesh) {
  sonde_surface_index *index = NULL;
  assert_ok(sonde_surface_index_create(mesh, &index, &shape_error));
  return index;
}

// A concave body: a ball whose surface waves.
static sonde_mesh wavy_ball(uint32_t n) {
  sonde_mesh mesh = shape_sphere(n, 1);
  for (uint32_t v = 0; v < mesh.vertex_count; ++v) {
    sonde_vec3 p = mesh.vertices[v];
    double wave = 1 + 0.3 * sin(5 * p.x) * sin(4 * p.y + 1) + 0.2 * sin(7 * p.z);
    mesh.vertices[v] = v_scale(p, wave);
  }
  return mesh;
}

static void test_closest(void **state) {
  (void)state;
  sonde_mesh mesh = wavy_ball(6);
  sonde_surface_index *index = make_index(&mesh);
  uint64_t seed = 1;
  for (int k = 0; k < 3000; ++k) {
    sonde_vec3 q = shape_point(&seed, k % 2 ? 1.6 : 0.5);
    sonde_surface_point hit = sonde_surface_closest(index, q);
    double best = INFINITY;
    for (uint32_t f = 0; f < mesh.face_count; ++f) {
      sonde_vec3 t[3];
      for (int i = 0; i < 3; ++i) t[i] = mesh.vertices[mesh.faces[f][i]];
      best = fmin(best, shape_triangle_distance(q, t));
    }
    assert_near(hit.distance_m, best, 1e-12);
    assert_near(v_distance(hit.point_m, q), hit.distance_m, 1e-12);
    assert_near(hit.weight[0] + hit.weight[1] + hit.weight[2], 1, 1e-12);
    sonde_vec3 p = vec3(0, 0, 0);
    for (int i = 0; i < 3; ++i) {
      assert_true(hit.weight[i] >= 0);
      p = v_madd(p, hit.weight[i], mesh.vertices[mesh.faces[hit.face][i]]);
    }
    assert_near(v_distance(p, hit.point_m), 0, 1e-14);
  }
  sonde_surface_index_destroy(index);
  sonde_mesh_clear(&mesh);
}

// Rays through a box hit where the slabs say; the index keeps its own copy of the mesh.
static void test_raycast(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 2, 3);
  sonde_surface_index *index = make_index(&box);
  sonde_mesh_clear(&box);
  uint64_t seed = 9;
  for (int k = 0; k < 500; ++k) {
    sonde_vec3 from = shape_point(&seed, 0.9), along = shape_direction(&seed);
    double x = (along.x > 0 ? 1 - from.x : -1 - from.x) / along.x;
    double y = (along.y > 0 ? 2 - from.y : -2 - from.y) / along.y;
    double z = (along.z > 0 ? 3 - from.z : -3 - from.z) / along.z;
    double exact = fmin(x, fmin(y, z));
    sonde_surface_point hit;
    assert_true(sonde_surface_raycast(index, from, v_scale(along, 7), 100, &hit));
    assert_near(hit.distance_m, exact, 1e-12);
    assert_near(v_distance(hit.point_m, v_madd(from, exact, along)), 0, 1e-12);
    assert_true(!sonde_surface_raycast(index, from, along, 0.999 * exact, &hit));
    // From outside the same line enters first: never behind, never missed.
    sonde_vec3 outside = v_madd(from, 20, along);
    assert_true(sonde_surface_raycast(index, outside, v_neg(along), 100, &hit));
    assert_near(hit.distance_m, 20 - exact, 1e-11);
    assert_true(!sonde_surface_raycast(index, outside, along, 100, &hit));
  }
  sonde_surface_point hit;
  // Along an edge shared by two faces, and with no direction at all.
  assert_true(sonde_surface_raycast(index, vec3(0, 0, 9), vec3(0, 0, -1), 100, &hit));
  assert_near(hit.distance_m, 6, 1e-12);
  assert_true(!sonde_surface_raycast(index, vec3(0, 0, 9), vec3(0, 0, 0), 100, &hit));
  sonde_surface_index_destroy(index);
}

// Rays from afar aimed at points of edges between faces that look at them: none slips between the
// faces, however small these are beside the distance. Returns how many do.
static uint32_t escapes(const sonde_mesh *mesh, double distance) {
  uint64_t seed = 31;
  uint32_t missed = 0, count = 0;
  sonde_topology topology;
  assert_ok(sonde_topology_build(mesh, &topology, &shape_error));
  sonde_surface_index *index = make_index(mesh);
  for (uint32_t e = 0; e < topology.edge_count; ++e)
    for (int k = 0; k < 40; ++k) {
      sonde_vec3 a = mesh->vertices[topology.edges[e][0]], b = mesh->vertices[topology.edges[e][1]];
      sonde_vec3 aim = v_lerp(a, b, k % 4 ? shape_uniform(&seed, 0, 1) : 0);
      sonde_vec3 way = shape_direction(&seed);
      if (v_dot(way, v_unit(aim, way)) < 0.6) continue;
      sonde_vec3 from = v_madd(aim, distance, way);
      sonde_surface_point hit;
      ++count;
      missed += !sonde_surface_raycast(index, from, v_neg(way), 2 * distance, &hit);
    }
  assert_true(count > 1000);
  sonde_surface_index_destroy(index);
  sonde_topology_clear(&topology);
  return missed;
}

static void test_raycast_edges(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(10, 1);
  for (double distance = 0.5; distance < 1e9; distance *= 30)
    assert_int_equal(escapes(&ball, distance), 0);
  // Along the axes, through corners that end the boxes of the tree.
  sonde_surface_index *index = make_index(&ball);
  for (uint32_t v = 0; v < ball.vertex_count; ++v) {
    sonde_vec3 p = ball.vertices[v];
    const double at[3] = {p.x, p.y, p.z};
    for (int k = 0; k < 3; ++k) {
      if (fabs(at[k]) < 0.3) continue;
      sonde_vec3 way = vec3(k == 0 ? at[k] : 0, k == 1 ? at[k] : 0, k == 2 ? at[k] : 0);
      sonde_surface_point hit;
      assert_true(sonde_surface_raycast(index, v_add(p, way), v_neg(way), 2, &hit));
      assert_near(hit.distance_m, fabs(at[k]), 1e-14);
    }
  }
  sonde_surface_index_destroy(index);
  sonde_mesh_clear(&ball);
}

// Inside, by the solid angle of the surface seen from the point: 4 pi inside, 0 outside.
static double solid_angle(const sonde_mesh *mesh, sonde_vec3 q) {
  double sum = 0;
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    sonde_vec3 r[3];
    double n[3];
    for (int k = 0; k < 3; ++k) {
      r[k] = v_sub(mesh->vertices[mesh->faces[f][k]], q);
      n[k] = v_norm(r[k]);
    }
    double top = v_dot(r[0], v_cross(r[1], r[2]));
    double bottom = n[0] * n[1] * n[2] + v_dot(r[0], r[1]) * n[2] + v_dot(r[1], r[2]) * n[0] +
                    v_dot(r[2], r[0]) * n[1];
    sum += 2 * atan2(top, bottom);
  }
  return sum;
}

static void test_inside(void **state) {
  (void)state;
  sonde_mesh mesh = wavy_ball(8);
  sonde_surface_index *index = make_index(&mesh);
  uint64_t seed = 12;
  int inside = 0;
  for (int k = 0; k < 2000; ++k) {
    sonde_vec3 q = shape_point(&seed, 1.5);
    bool expected = solid_angle(&mesh, q) > 2 * SONDE_PI;
    assert_int_equal(sonde_surface_inside(index, q), expected);
    inside += expected;
  }
  assert_true(inside > 200 && inside < 1800);
  // Close above and below every vertex, where rays and plain face normals fail.
  sonde_vec3 *normals = calloc(mesh.vertex_count, sizeof *normals);
  sonde_mesh_normals(&mesh, normals);
  for (uint32_t v = 0; v < mesh.vertex_count; ++v) {
    sonde_vec3 above = v_madd(mesh.vertices[v], 1e-5, normals[v]);
    sonde_vec3 below = v_madd(mesh.vertices[v], -1e-5, normals[v]);
    assert_int_equal(sonde_surface_inside(index, above), solid_angle(&mesh, above) > 2 * SONDE_PI);
    assert_int_equal(sonde_surface_inside(index, below), solid_angle(&mesh, below) > 2 * SONDE_PI);
  }
  free(normals);
  sonde_surface_index_destroy(index);
  sonde_mesh_clear(&mesh);
}

// Seen from outside a sharp corner, lines through box corners and edges.
static void test_box_symmetry(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 1, 1);
  sonde_surface_index *index = make_index(&box);
  for (int k = 0; k < 27; ++k) {
    sonde_vec3 way = vec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
    assert_true(sonde_surface_inside(index, v_scale(way, 0.999)));
    if (v_norm(way) > 0) assert_true(!sonde_surface_inside(index, v_scale(way, 1.001)));
  }
  sonde_surface_index_destroy(index);
  sonde_mesh_clear(&box);
}

// Needles and blades: beyond a sharp corner or edge a point lies behind the plane of some of the
// faces that it is closest to.
static void test_inside_sharp(void **state) {
  (void)state;
  static const uint32_t faces[6][3] = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4},
                                       {3, 0, 4}, {0, 3, 2}, {0, 2, 1}};
  static const sonde_vec3 points[5] = {
      {-0.3, -0.02, -1}, {0.1, -0.02, -1}, {0.1, 0.02, -1}, {-0.1, 0.02, -1}, {0.5, 0, 0}};
  sonde_mesh mesh;
  assert_ok(sonde_mesh_create(&mesh, 5, 6, &shape_error));
  memcpy(mesh.vertices, points, sizeof points);
  memcpy(mesh.faces, faces, sizeof faces);
  assert_true(shape_report(&mesh).outward);
  sonde_surface_index *index = make_index(&mesh);
  uint64_t seed = 99;
  for (int k = 0; k < 6000; ++k) {
    sonde_vec3 q = v_add(points[k % 5], shape_point(&seed, 0.03));
    assert_int_equal(sonde_surface_inside(index, q), solid_angle(&mesh, q) > 2 * SONDE_PI);
  }
  sonde_surface_index_destroy(index);
  sonde_mesh_clear(&mesh);
}

static void test_faults(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 1, 1);
  sonde_surface_index *index;
  sonde_error error;
  box.faces[3][1] = 99;
  assert_int_equal(sonde_surface_index_create(&box, &index, &error), SONDE_MESH);
  assert_null(index);
  box.face_count = 0;
  assert_int_equal(sonde_surface_index_create(&box, &index, &error), SONDE_MESH);
  sonde_mesh_clear(&box);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_closest),       cmocka_unit_test(test_raycast),
      cmocka_unit_test(test_raycast_edges), cmocka_unit_test(test_inside),
      cmocka_unit_test(test_box_symmetry),  cmocka_unit_test(test_inside_sharp),
      cmocka_unit_test(test_faults),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
