// Laws of local refinement.
#include "geometry/shapes.h"
#include "geometry/internal.h"

typedef struct wish {
  sonde_vec3 centre;
  double radius, fine, coarse;
} wish;

static double wanted(sonde_vec3 point, void *user) {
  const wish *w = user;
  return v_distance(point, w->centre) < w->radius ? w->fine : w->coarse;
}

// No edge longer than 1.42 times the wanted length at its middle.
static void check_edges(const sonde_mesh *mesh, double (*target)(sonde_vec3, void *), void *user) {
  sonde_topology topology;
  assert_ok(sonde_topology_build(mesh, &topology, &shape_error));
  for (uint32_t e = 0; e < topology.edge_count; ++e) {
    sonde_vec3 a = mesh->vertices[topology.edges[e][0]], b = mesh->vertices[topology.edges[e][1]];
    assert_true(v_distance(a, b) <= 1.42 * target(v_lerp(a, b, 0.5), user) + 1e-15);
  }
  sonde_topology_clear(&topology);
}

static void check_kept(const sonde_mesh *mesh, const sonde_mesh *refined) {
  assert_true(refined->vertex_count >= mesh->vertex_count);
  assert_memory_equal(mesh->vertices, refined->vertices,
                      mesh->vertex_count * sizeof *mesh->vertices);
}

static void test_sphere(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(6, 1.0), fine;
  wish w = {{0, 0, 1}, 0.6, 0.05, 0.5};
  assert_ok(sonde_mesh_refine(&ball, wanted, &w, &fine, &shape_error));
  sonde_mesh_report before = shape_report(&ball), after = shape_report(&fine);
  assert_true(after.closed && after.outward && after.boundary_edges == 0);
  assert_int_equal(after.duplicate_or_degenerate_faces, 0);
  assert_int_equal(fine.vertex_count - after.edge_count + fine.face_count, 2);
  // Half the smallest angle of the given mesh, less what the curved surface takes.
  assert_true(after.smallest_angle_rad > 0.45 * before.smallest_angle_rad);
  check_kept(&ball, &fine);
  check_edges(&fine, wanted, &w);
  // New vertices lie on the sphere: far closer than the middles of the old chords.
  double chord = 1 - sqrt(1 - before.longest_edge_m * before.longest_edge_m / 4);
  for (uint32_t v = ball.vertex_count; v < fine.vertex_count; ++v)
    assert_near(v_norm(fine.vertices[v]), 1, 0.2 * chord);
  sonde_mesh_clear(&ball);
  sonde_mesh_clear(&fine);
}

// A box has creases only: refining it must leave its faces flat and its volume alone.
static void test_box(void **state) {
  (void)state;
  sonde_mesh box = shape_box(0.02, 0.03, 0.04), fine;
  wish w = {{0.02, 0.03, 0.04}, 0.02, 0.002, 0.02};
  assert_ok(sonde_mesh_refine(&box, wanted, &w, &fine, &shape_error));
  sonde_mesh_report before = shape_report(&box), after = shape_report(&fine);
  assert_true(after.closed && after.outward);
  assert_true(fine.vertex_count > 200);
  assert_near(after.volume_m3, before.volume_m3, 1e-12 * before.volume_m3);
  assert_near(after.area_m2, before.area_m2, 1e-12 * before.area_m2);
  assert_true(after.smallest_angle_rad >= 0.5 * before.smallest_angle_rad - 1e-9);
  check_edges(&fine, wanted, &w);
  sonde_mesh_clear(&box);
  sonde_mesh_clear(&fine);
}

// A cylinder with flat caps made of slivers: the fans give way to sound faces, the shape stays.
static sonde_mesh make_drum(uint32_t sides) {
  sonde_mesh mesh;
  assert_ok(sonde_mesh_create(&mesh, 2 * sides + 2, 4 * sides, &shape_error));
  for (uint32_t k = 0; k < sides; ++k) {
    double a = 2 * SONDE_PI * k / sides;
    mesh.vertices[k] = vec3(cos(a), sin(a), 0);
    mesh.vertices[sides + k] = vec3(cos(a), sin(a), 0.06);
    uint32_t b = (k + 1) % sides, low = 2 * sides, high = low + 1;
    memcpy(mesh.faces[4 * k], (uint32_t[3]){k, b, sides + b}, sizeof mesh.faces[0]);
    memcpy(mesh.faces[4 * k + 1], (uint32_t[3]){k, sides + b, sides + k}, sizeof mesh.faces[0]);
    memcpy(mesh.faces[4 * k + 2], (uint32_t[3]){b, k, low}, sizeof mesh.faces[0]);
    memcpy(mesh.faces[4 * k + 3], (uint32_t[3]){sides + k, sides + b, high}, sizeof mesh.faces[0]);
  }
  mesh.vertices[2 * sides + 1] = vec3(0, 0, 0.06);
  return mesh;
}

// Smallest angle of the drum's wall, which is given and may be halved.
static double wall_angle(uint32_t sides) {
  double width = 2 * sin(SONDE_PI / sides);
  return fmin(atan2(width, 0.06), atan2(0.06, width));
}

static void test_fans(void **state) {
  (void)state;
  static const uint32_t sides[] = {25, 30, 47, 84, 100, 333};
  static const double targets[] = {0.05, 0.1, 10};
  for (size_t s = 0; s < SONDE_COUNT_OF(sides); ++s)
    for (int t = 0; t < 3; ++t) {
      sonde_mesh drum = make_drum(sides[s]), fine;
      wish w = {{0, 0, 0}, 10, targets[t], 10};
      assert_ok(sonde_mesh_refine(&drum, wanted, &w, &fine, &shape_error));
      sonde_mesh_report before = shape_report(&drum), after = shape_report(&fine);
      assert_true(after.closed && after.outward && before.outward);
      assert_int_equal(after.duplicate_or_degenerate_faces, 0);
      assert_int_equal(fine.vertex_count - after.edge_count + fine.face_count, 2);
      assert_true(after.smallest_angle_rad > 15 * SONDE_PI / 180 ||
                  after.smallest_angle_rad > 0.49 * wall_angle(sides[s]));
      check_kept(&drum, &fine);
      check_edges(&fine, wanted, &w);
      // The caps stay flat and whole: only the wall, bulging outwards, may gain volume.
      assert_true(after.volume_m3 > before.volume_m3 * (1 - 1e-12));
      assert_true(after.volume_m3 < SONDE_PI * 0.06 * (1 + 1e-3));
      sonde_mesh_clear(&drum);
      sonde_mesh_clear(&fine);
    }
}

// Nothing to do leaves the mesh as it is; slight excess over the wanted length is left alone.
static void test_overshoot(void **state) {
  (void)state;
  sonde_mesh box = shape_box(0.01, 0.01, 0.01), same;
  wish w = {{0, 0, 0}, 1, 0.02 * sqrt(2.0) / 1.41, 1};
  assert_ok(sonde_mesh_refine(&box, wanted, &w, &same, &shape_error));
  assert_int_equal(same.vertex_count, box.vertex_count);
  sonde_mesh_clear(&same);
  w.fine = 0.02 * sqrt(2.0) / 1.43;
  assert_ok(sonde_mesh_refine(&box, wanted, &w, &same, &shape_error));
  assert_true(same.vertex_count > box.vertex_count);
  sonde_mesh_clear(&same);
  sonde_mesh_clear(&box);
}

static void test_bad_target(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 1, 1), out;
  static const double bad[] = {0, -1, NAN, 1e-9};
  for (size_t k = 0; k < SONDE_COUNT_OF(bad); ++k) {
    wish w = {{0, 0, 0}, 10, bad[k], bad[k]};
    sonde_error error = {0};
    assert_int_equal(sonde_mesh_refine(&box, wanted, &w, &out, &error), SONDE_ARGUMENT);
    assert_null(out.vertices);
    assert_true(strlen(error.message) > 10);
  }
  sonde_mesh_clear(&box);
}

// An open mesh keeps its border: no new gaps, no border vertex off the border.
static void test_open_mesh(void **state) {
  (void)state;
  sonde_mesh sheet, fine;
  assert_ok(sonde_mesh_create(&sheet, 4, 2, &shape_error));
  for (int k = 0; k < 4; ++k) sheet.vertices[k] = vec3(k & 1, k >> 1, 0);
  memcpy(sheet.faces, (uint32_t[2][3]){{0, 1, 3}, {0, 3, 2}}, sizeof(uint32_t[2][3]));
  wish w = {{0, 0, 0}, 0.4, 0.05, 0.6};
  assert_ok(sonde_mesh_refine(&sheet, wanted, &w, &fine, &shape_error));
  sonde_mesh_report after = shape_report(&fine);
  assert_near(after.area_m2, 1, 1e-12);
  assert_int_equal(fine.vertex_count - after.edge_count + fine.face_count, 1);
  sonde_topology topology;
  assert_ok(sonde_topology_build(&fine, &topology, &shape_error));
  for (uint32_t e = 0; e < topology.edge_count; ++e) {
    if (topology.edge_faces[e][1] != UINT32_MAX) continue;
    sonde_vec3 m =
        v_lerp(fine.vertices[topology.edges[e][0]], fine.vertices[topology.edges[e][1]], 0.5);
    assert_near(fmin(fmin(m.x, 1 - m.x), fmin(m.y, 1 - m.y)), 0, 1e-12);
  }
  sonde_topology_clear(&topology);
  sonde_mesh_clear(&sheet);
  sonde_mesh_clear(&fine);
}

// The use it is made for: 3 mm on the antero-medial part of the bundled skin.
static double thigh_target(sonde_vec3 p, void *user) {
  const double *fine = user;
  return p.z > 0.06 && p.z < 0.24 && p.y > -0.02 && p.x > -0.06 ? *fine : 7e-3;
}

static void test_thigh(void **state) {
  (void)state;
  const char *path = SONDE_SOURCE_DIR "/data/thigh/skin.ply";
  sonde_mesh skin, fine;
  assert_ok(sonde_mesh_load(path, 1e-3, &skin, &shape_error));
  sonde_mesh_report before = shape_report(&skin);
  print_message("skin: %u vertices, edges %.2f/%.2f/%.2f mm, smallest angle %.1f deg\n",
                skin.vertex_count, before.shortest_edge_m * 1e3, before.mean_edge_m * 1e3,
                before.longest_edge_m * 1e3, before.smallest_angle_rad * 180 / SONDE_PI);
  static const double sizes[] = {3e-3, 3.5e-3};
  for (int k = 0; k < 2; ++k) {
    double size = sizes[k];
    assert_ok(sonde_mesh_refine(&skin, thigh_target, &size, &fine, &shape_error));
    sonde_mesh_report after = shape_report(&fine);
    print_message("target %.1f mm: %u vertices, edges %.2f/%.2f/%.2f mm, smallest "
                  "angle %.1f deg, volume %+.3f %%\n",
                  size * 1e3, fine.vertex_count, after.shortest_edge_m * 1e3,
                  after.mean_edge_m * 1e3, after.longest_edge_m * 1e3,
                  after.smallest_angle_rad * 180 / SONDE_PI,
                  100 * (after.volume_m3 / before.volume_m3 - 1));
    assert_true(after.closed && after.outward);
    assert_true(after.smallest_angle_rad > 15 * SONDE_PI / 180);
    assert_near(after.volume_m3, before.volume_m3, 2e-3 * before.volume_m3);
    check_edges(&fine, thigh_target, &size);
    check_kept(&skin, &fine);
    sonde_mesh_clear(&fine);
  }
  sonde_mesh_clear(&skin);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sphere),     cmocka_unit_test(test_box),
      cmocka_unit_test(test_fans),       cmocka_unit_test(test_overshoot),
      cmocka_unit_test(test_bad_target), cmocka_unit_test(test_open_mesh),
      cmocka_unit_test(test_thigh),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
