// The level surface of a grid is closed whatever the values are, and lies where the values say.
#include "geometry/isosurface.h"
#include "geometry/shapes.h"

static float *grid(const uint32_t n[3]) {
  float *value = calloc((size_t)n[0] * n[1] * n[2], sizeof *value);
  assert_non_null(value);
  return value;
}

// Random values, so that every pattern of corners above and below occurs.
static void any_values_give_a_closed_surface(void **state) {
  (void)state;
  const uint32_t n[3] = {9, 7, 11};
  float *value = grid(n);
  uint64_t random = 3;
  for (int trial = 0; trial < 40; ++trial) {
    double cut = shape_uniform(&random, 0.05, 0.95);
    for (uint32_t k = 0; k < n[0] * n[1] * n[2]; ++k) {
      value[k] = (float)shape_uniform(&random, 0, 1);
      // Whole values that equal the level, too.
      if (trial % 2) value[k] = value[k] > cut ? 1 : trial % 4 == 1 ? 0.5F : 0;
    }
    sonde_mesh mesh;
    assert_ok(sonde_isosurface_create(value, n, 0.5F, &mesh, &shape_error));
    sonde_mesh_report r = shape_report(&mesh);
    assert_true(r.closed && r.outward);
    assert_int_equal(r.duplicate_or_degenerate_faces, 0);
    // No point lies farther out than the points beyond the grid.
    for (uint32_t v = 0; v < mesh.vertex_count; ++v) {
      sonde_vec3 p = mesh.vertices[v];
      assert_true(p.x > -1 && p.y > -1 && p.z > -1 && p.x < n[0] && p.y < n[1] && p.z < n[2]);
    }
    sonde_mesh_clear(&mesh);
  }
  free(value);
}

// A linear field's level is a plane, which the surface meets to the rounding of the values.
static void planes_are_exact(void **state) {
  (void)state;
  const uint32_t n[3] = {12, 10, 14};
  float *value = grid(n);
  const sonde_vec3 normal = v_unit(vec3(0.3, -0.5, 0.81), vec3(0, 0, 1));
  for (uint32_t k = 0; k < n[0] * n[1] * n[2]; ++k) {
    sonde_vec3 p = vec3(k % n[0], k / n[0] % n[1], k / n[0] / n[1]);
    value[k] = (float)(40 + 4.03 - v_dot(normal, p));
  }
  sonde_mesh mesh;
  assert_ok(sonde_isosurface_create(value, n, 40, &mesh, &shape_error));
  uint32_t inner = 0;
  for (uint32_t v = 0; v < mesh.vertex_count; ++v) {
    sonde_vec3 p = mesh.vertices[v];
    if (p.x < 0 || p.y < 0 || p.z < 0 || p.x > n[0] - 1 || p.y > n[1] - 1 || p.z > n[2] - 1)
      continue;
    // An edge that the plane meets near its end keeps its vertex a 64th away from the end.
    assert_near(v_dot(normal, p), 4.03, 1.0 / 64);
    ++inner;
  }
  assert_true(inner > 150);
  sonde_mesh_clear(&mesh);
  free(value);
}

// A ball by its distance: one sphere, volume and area as the radius says, second order in the step.
static void balls_have_their_volume(void **state) {
  (void)state;
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const uint32_t side = k ? 42 : 22, n[3] = {side, side, side};
    const double radius = k ? 16.2 : 8.1, middle = 0.5 * (side - 1) + 0.13;
    float *value = grid(n);
    for (uint32_t at = 0; at < side * side * side; ++at) {
      sonde_vec3 p = vec3(at % side, at / side % side, at / side / side);
      double r = v_distance(p, vec3(middle, middle, middle));
      value[at] = (float)fmax(0, 100 + radius - r);
    }
    sonde_mesh mesh;
    assert_ok(sonde_isosurface_create(value, n, 100, &mesh, &shape_error));
    sonde_mesh_report r = shape_report(&mesh);
    assert_true(r.closed && r.outward);
    assert_int_equal(mesh.vertex_count - r.edge_count + mesh.face_count, 2);
    error[k] = fabs(r.volume_m3 / (4.0 / 3 * SONDE_PI * radius * radius * radius) - 1);
    assert_near(r.area_m2 / (4 * SONDE_PI * radius * radius), 1, k ? 0.005 : 0.02);
    sonde_mesh_clear(&mesh);
    free(value);
  }
  print_message("volume of a ball of 8 and 16 steps: %.2g, %.2g off\n", error[0], error[1]);
  assert_true(error[0] < 0.012 && error[1] < 0.3 * error[0]);
}

// One voxel, and voxels at the border of the grid, are closed; nothing above the level is refused.
static void borders_are_closed(void **state) {
  (void)state;
  const uint32_t n[3] = {3, 1, 2};
  float *value = grid(n);
  sonde_mesh mesh;
  assert_int_equal(sonde_isosurface_create(value, n, 0.5F, &mesh, &shape_error), SONDE_MESH);
  assert_true(mesh.vertex_count == 0 && strstr(shape_error.message, "exceeds"));
  value[0] = 1;
  assert_ok(sonde_isosurface_create(value, n, 0.5F, &mesh, &shape_error));
  sonde_mesh_report r = shape_report(&mesh);
  assert_true(r.closed && r.outward && r.volume_m3 > 0.2 && r.volume_m3 < 1);
  sonde_mesh_clear(&mesh);
  for (int k = 0; k < 6; ++k) value[k] = 1;
  assert_ok(sonde_isosurface_create(value, n, 0.5F, &mesh, &shape_error));
  r = shape_report(&mesh);
  assert_true(r.closed && r.outward && r.volume_m3 > 4 && r.volume_m3 < 6); // a box of 3 x 1 x 2
  sonde_mesh_clear(&mesh);
  free(value);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(any_values_give_a_closed_surface),
      cmocka_unit_test(planes_are_exact),
      cmocka_unit_test(balls_have_their_volume),
      cmocka_unit_test(borders_are_closed),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
