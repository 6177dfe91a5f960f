// Tetrahedral meshes of closed surfaces: they conform, fill the solid, keep their angles, know what
// the inner surface holds, are the same every time, and refuse what cannot be filled.
#include "geometry/shapes.h"
#include "mesh_laws.h"

#include "../barrel_mesh.h"

// A closed cylinder about z from 0 to the length.
static sonde_mesh cylinder(double radius, double length, uint32_t around) {
  enum { RINGS = 2 };
  sonde_mesh mesh;
  assert_ok(sonde_mesh_create(&mesh, 2 + RINGS * around, 2 * around * RINGS, &shape_error));
  mesh.vertices[1] = vec3(0, 0, length);
  for (uint32_t i = 0; i < RINGS; ++i)
    for (uint32_t k = 0; k < around; ++k) {
      double angle = 2 * SONDE_PI * k / around;
      mesh.vertices[2 + i * around + k] =
          vec3(radius * cos(angle), radius * sin(angle), i * length);
    }
  assert_int_equal(barrel_mesh_faces(&mesh, RINGS, around), mesh.face_count);
  return mesh;
}

static void test_ball(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(24, 0.05);
  double volume = volume_of(&ball);
  static const double edge[3] = {0.016, 0.008, 0.004}, share[3] = {0.06, 0.015, 0.004};
  for (int k = 0; k < 3; ++k) {
    const sonde_tetrahedra_def def = {.edge_m = edge[k]};
    const mesh_bounds bounds = {25, 142, 0.2, share[k]};
    sonde_tetrahedra t = make_mesh(&ball, NULL, &def);
    holds_the_laws("ball", &t, &ball, NULL, edge[k], volume, &bounds);
    assert_int_equal(t.held_count, 0);
    assert_int_equal(euler_characteristic(&t), 1);
    sonde_tetrahedra_clear(&t);
  }
  sonde_mesh_clear(&ball);
}

static void test_box(void **state) {
  (void)state;
  sonde_mesh box = shape_box(0.03, 0.05, 0.02);
  const sonde_tetrahedra_def def = {.edge_m = 0.008};
  const mesh_bounds bounds = {28, 146, 0.6, 0.04};
  uint64_t seed = 3;
  for (int turned = 0; turned < 4; ++turned) {
    sonde_tetrahedra t = make_mesh(&box, NULL, &def);
    holds_the_laws("box", &t, &box, NULL, def.edge_m, 8 * 0.03 * 0.05 * 0.02, &bounds);
    assert_int_equal(euler_characteristic(&t), 1);
    sonde_tetrahedra_clear(&t);
    shape_move(&box, (sonde_pose){vec3(0.01, 0, 0), shape_rotation(&seed)});
  }
  sonde_mesh_clear(&box);
}

// A rod from end to end makes a ring, one that ends inside a hollow.
static void test_cylinder_with_rod(void **state) {
  (void)state;
  sonde_mesh limb = cylinder(0.05, 0.15, 96), rod = cylinder(0.015, 0.15, 48);
  for (int inside = 0; inside < 2; ++inside) {
    double length = inside ? 0.09 : 0.15;
    for (uint32_t i = 0; i < rod.vertex_count && inside; ++i)
      rod.vertices[i].z = 0.03 + rod.vertices[i].z * (length / 0.15);
    const sonde_tetrahedra_def def = {.edge_m = 0.008};
    const mesh_bounds bounds = {30, 136, 0.3, 0.008};
    sonde_tetrahedra t = make_mesh(&limb, &rod, &def);
    double volume = volume_of(&limb) - volume_of(&rod);
    holds_the_laws("limb", &t, &limb, &rod, def.edge_m, volume, &bounds);
    assert_int_equal(euler_characteristic(&t), inside ? 2 : 0);
    // What is held lies on the rod, what is free does not.
    for (uint32_t i = 0; i < t.boundary.vertex_count; ++i) {
      sonde_vec3 p = t.node[i];
      bool on_rod = hypot(p.x, p.y) < 0.0151;
      if (inside) on_rod = on_rod && p.z > 0.0299 && p.z < 0.1201;
      assert_true(on_rod == (i >= t.surface_count));
    }
    assert_true(t.held_count > 100);
    assert_true(t.outer_face_count < t.boundary.face_count);
    sonde_tetrahedra_clear(&t);
  }
  sonde_mesh_clear(&limb);
  sonde_mesh_clear(&rod);
}

// Balls with bumps and hollows of every depth, some with a fine place.
static void test_rough_bodies(void **state) {
  (void)state;
  uint64_t seed = 7;
  double least = 180, most = 0;
  for (int round = 0; round < 20; ++round) {
    sonde_mesh body = shape_sphere(8 + (uint32_t)round % 8, 1);
    double high = shape_uniform(&seed, 0, 0.4), b = shape_uniform(&seed, 2, 7);
    double edge = shape_uniform(&seed, 0.1, 0.25);
    for (uint32_t v = 0; v < body.vertex_count; ++v) {
      sonde_vec3 p = body.vertices[v];
      double bump = sin(b * p.x) * sin(4 * p.y + 1) + 0.6 * sin(6 * p.z);
      body.vertices[v] = v_scale(p, 1 + high * bump);
    }
    shape_move(&body, (sonde_pose){vec3(0.3, 0.1, 0), shape_rotation(&seed)});
    const sonde_vec3 place = body.vertices[0];
    sonde_tetrahedra_def def = {.edge_m = edge, .growth = round % 3 ? 0.4 : 1.5};
    if (round % 4 == 0)
      def.fine = &place, def.fine_count = 1, def.fine_edge_m = edge / 4, def.fine_reach_m = edge;
    sonde_tetrahedra t = make_mesh(&body, NULL, &def);
    sonde_tetrahedra_report r;
    assert_ok(sonde_tetrahedra_inspect(&t, &body, NULL, &r, &shape_error));
    least = fmin(least, r.smallest_dihedral_rad * DEGREES);
    most = fmax(most, r.largest_dihedral_rad * DEGREES);
    assert_int_equal(euler_characteristic(&t), 1);
    assert_true(r.off_surface_m < 0.6 * edge);
    assert_near(r.volume_m3 / volume_of(&body), 0.97, 0.03);
    sonde_tetrahedra_clear(&t);
    sonde_mesh_clear(&body);
  }
  print_message("rough bodies: angles %.1f to %.1f degrees\n", least, most);
  assert_true(least > 26 && most < 150);
}

// Edges are short near the points and grow away from them.
static void test_finer_places(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(24, 0.05);
  const sonde_vec3 pole = {0, 0, 0.05};
  const sonde_tetrahedra_def def = {
      .edge_m = 0.008, .fine = &pole, .fine_count = 1, .fine_edge_m = 0.002, .fine_reach_m = 0.01};
  const mesh_bounds bounds = {28, 150, 0.06, 0.012};
  sonde_tetrahedra t = make_mesh(&ball, NULL, &def);
  holds_the_laws("refined ball", &t, &ball, NULL, def.edge_m, volume_of(&ball), &bounds);
  double sum[2] = {0, 0};
  int count[2] = {0, 0};
  for (uint32_t f = 0; f < t.outer_face_count; ++f)
    for (int c = 0; c < 3; ++c) {
      sonde_vec3 a = t.node[t.boundary.faces[f][c]], b = t.node[t.boundary.faces[f][(c + 1) % 3]];
      double from = v_distance(v_lerp(a, b, 0.5), pole);
      int which = from < 0.01 ? 0 : from > 0.06 ? 1 : 2;
      if (which < 2) sum[which] += v_distance(a, b), ++count[which];
    }
  assert_near(sum[0] / count[0], 0.002, 0.0004);
  assert_near(sum[1] / count[1], 0.008, 0.0008);
  sonde_tetrahedra_clear(&t);
  sonde_mesh_clear(&ball);
}

static void test_same_every_time(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(12, 0.05);
  const sonde_tetrahedra_def def = {.edge_m = 0.01};
  uint64_t hash[2];
  for (int k = 0; k < 2; ++k) {
    sonde_tetrahedra t = make_mesh(&ball, NULL, &def);
    hash[k] = sonde_hash(sonde_hash(0, t.node, t.node_count * sizeof *t.node), t.corner,
                         t.count * sizeof *t.corner);
    sonde_tetrahedra_clear(&t);
  }
  assert_true(hash[0] == hash[1]);
  sonde_mesh_clear(&ball);
}

static void is_refused(const sonde_mesh *outer, const sonde_mesh *inner, double edge_m,
                       sonde_status status, const char *why) {
  sonde_tetrahedra t;
  sonde_error error = {0};
  const sonde_tetrahedra_def def = {.edge_m = edge_m};
  assert_int_equal(sonde_tetrahedralise(outer, inner, &def, &t, &error), status);
  if (!strstr(error.message, why)) fail_msg("\"%s\" does not say \"%s\"", error.message, why);
  assert_null(t.node);
}

static void test_refusals(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(10, 0.05), box = shape_box(0.05, 0.05, 0.0008), both;
  is_refused(&ball, NULL, 0, SONDE_ARGUMENT, "positive length");
  is_refused(&ball, NULL, NAN, SONDE_ARGUMENT, "positive length");
  is_refused(&ball, NULL, 1e-4, SONDE_ARGUMENT, "cells");
  is_refused(&ball, &ball, 0.01, SONDE_MESH, "inside");
  // Thinner than an edge; much thinner.
  is_refused(&box, NULL, 0.01, SONDE_MESH, "thinner");
  // Two balls that cross each other, as one surface.
  assert_ok(sonde_mesh_create(&both, 2 * ball.vertex_count, 2 * ball.face_count, &shape_error));
  for (uint32_t i = 0; i < both.vertex_count; ++i) {
    both.vertices[i] = ball.vertices[i % ball.vertex_count];
    if (i >= ball.vertex_count) both.vertices[i].x += 0.04;
  }
  for (uint32_t f = 0; f < both.face_count; ++f)
    for (int c = 0; c < 3; ++c)
      both.faces[f][c] =
          ball.faces[f % ball.face_count][c] + (f < ball.face_count ? 0 : ball.vertex_count);
  is_refused(&both, NULL, 0.008, SONDE_MESH, "crosses itself");
  // Inside out, and open.
  for (uint32_t f = 0; f < ball.face_count; ++f) {
    uint32_t swap = ball.faces[f][0];
    ball.faces[f][0] = ball.faces[f][1], ball.faces[f][1] = swap;
  }
  is_refused(&ball, NULL, 0.01, SONDE_MESH, "clockwise");
  is_refused(&box, &ball, 0.01, SONDE_MESH, "inner");
  --ball.face_count;
  is_refused(&ball, NULL, 0.01, SONDE_MESH, "open");
  sonde_mesh_clear(&ball);
  sonde_mesh_clear(&box);
  sonde_mesh_clear(&both);
}

// A failed allocation leaves nothing behind.
static size_t left, outstanding;
static void *failing_allocate(size_t bytes, void *user) {
  (void)user;
  if (left == 0) return NULL;
  --left, ++outstanding;
  return malloc(bytes);
}
static void counting_release(void *pointer, void *user) {
  (void)user;
  if (pointer) --outstanding;
  free(pointer);
}

static void test_out_of_memory(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(3, 0.05);
  const sonde_tetrahedra_def def = {.edge_m = 0.025};
  const sonde_allocator failing = {failing_allocate, counting_release, NULL};
  sonde_set_allocator(&failing);
  sonde_status status = SONDE_MEMORY;
  for (size_t allowed = 0; status == SONDE_MEMORY; ++allowed) {
    sonde_tetrahedra t;
    left = allowed, outstanding = 0;
    status = sonde_tetrahedralise(&ball, NULL, &def, &t, NULL);
    sonde_tetrahedra_clear(&t);
    assert_int_equal(outstanding, 0);
  }
  sonde_set_allocator(NULL);
  assert_int_equal(status, SONDE_OK);
  sonde_mesh_clear(&ball);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_ball),
      cmocka_unit_test(test_box),
      cmocka_unit_test(test_cylinder_with_rod),
      cmocka_unit_test(test_finer_places),
      cmocka_unit_test(test_rough_bodies),
      cmocka_unit_test(test_same_every_time),
      cmocka_unit_test(test_refusals),
      cmocka_unit_test(test_out_of_memory),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
