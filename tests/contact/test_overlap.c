// Laws of the common volume of two meshes.
#include "contact/bodies.h"

static const sonde_vec3 nowhere = {0, 0, 0};

// Two boxes side by side overlap in a box; turned together they still do.
static void test_boxes(void **state) {
  (void)state;
  uint64_t seed = 4;
  for (int k = 0; k < 40; ++k) {
    sonde_mesh a = shape_box(0.03, 0.02, 0.01), b = shape_box(0.02, 0.025, 0.04);
    sonde_vec3 shift = k ? vec3(shape_uniform(&seed, 0.02, 0.045), shape_uniform(&seed, 0, 0.03),
                                shape_uniform(&seed, 0, 0.03))
                         : vec3(0.04, 0.02, 0.03);
    body_shift(&b, shift.x, shift.y, shift.z);
    double x = fmin(0.03, shift.x + 0.02) - fmax(-0.03, shift.x - 0.02);
    double y = fmin(0.02, shift.y + 0.025) - fmax(-0.02, shift.y - 0.025);
    double z = fmin(0.01, shift.z + 0.04) - fmax(-0.01, shift.z - 0.04);
    sonde_pose pose = {shape_point(&seed, 0.2), k < 2 ? quat_identity() : shape_rotation(&seed)};
    shape_move(&a, pose);
    shape_move(&b, pose);
    body_pair pair = body_pair_make(&a, &b);
    double volume = body_volume(&pair, nowhere);
    assert_near(volume, x * y * z, 1e-12 * volume);
    assert_int_equal(pair.result->region_count, 1);
    assert_near(pair.result->regions[0].volume_m3, volume, 1e-11 * volume);
    // The same, seen from elsewhere, and with the bodies exchanged.
    for (int i = 0; i < 5; ++i)
      assert_near(body_volume(&pair, shape_direction(&seed)), volume, 1e-11 * volume);
    body_pair_clear(&pair);
    pair = body_pair_make(&b, &a);
    assert_near(body_volume(&pair, nowhere), volume, 1e-12 * volume);
    body_pair_clear(&pair);
    sonde_mesh_clear(&a);
    sonde_mesh_clear(&b);
  }
}

// Two balls overlap in a lens; the error of the meshes falls with the square of their edges.
static void test_lens(void **state) {
  (void)state;
  const double r = 0.03, d = 0.045;
  double lens = SONDE_PI * (4 * r + d) * (2 * r - d) * (2 * r - d) / 12, error[3];
  for (int k = 0; k < 3; ++k) {
    sonde_mesh a = shape_sphere(8u << k, r), b = shape_sphere(8u << k, r);
    sonde_vec3 way = v_scale(v_unit(vec3(0.3, 0.5, 0.8), nowhere), d);
    body_shift(&b, way.x, way.y, way.z);
    body_pair pair = body_pair_make(&a, &b);
    error[k] = lens - body_volume(&pair, nowhere);
    const sonde_overlap_region *region = pair.result->regions;
    assert_int_equal(pair.result->region_count, 1);
    assert_near(v_dot(region->direction, v_unit(way, nowhere)), 1, 1e-4);
    assert_near(v_distance(region->centre_m, v_scale(way, 0.5)), 0, 1e-3);
    // Seen along the way the lens is a disc, 2 r - d deep.
    assert_near(region->area_m2, SONDE_PI * (r * r - d * d / 4), 0.05 * region->area_m2);
    assert_near(region->depth_m, 2 * r - d, 0.05 * (2 * r - d));
    body_pair_clear(&pair);
    sonde_mesh_clear(&a);
    sonde_mesh_clear(&b);
  }
  print_message("lens %.4g m^3, missing %.2g, %.2g, %.2g\n", lens, error[0], error[1], error[2]);
  assert_near(error[0] / error[1], 4, 0.7);
  assert_near(error[1] / error[2], 4, 0.4);
  assert_near(error[2] / lens, 0, 0.02);
}

// ---- concave bodies -----------------------------------------------------------------------

static bool keep_comb(int x, int y, int z) {
  (void)y;
  return z == 0 || x % 2 == 0;
}

static bool keep_frame(int x, int y, int z) {
  return !(x > 0 && x < 4 && y > 0 && y < 4) && !(z == 1 && x == 0 && y == 2);
}

static bool keep_all(int x, int y, int z) {
  (void)x;
  (void)y;
  (void)z;
  return true;
}

static sonde_mesh concave(int kind) {
  if (kind == 0) return body_wavy(10, 0.03);
  if (kind == 1) return body_cells(7, 4, 3, 0.01, keep_comb);
  return body_cells(5, 5, 3, 0.01, keep_frame);
}

// Against counted points, on concave bodies that pierce and enclose each other; every column law at
// once: the gradients of all vertices and the moments about any point cancel.
static void test_concave(void **state) {
  (void)state;
  uint64_t seed = 90;
  double worst = 0, worst_force = 0, worst_torque = 0, worst_hint = 0;
  uint32_t regions = 0;
  for (int trial = 0; trial < 9; ++trial) {
    sonde_mesh a = concave(trial % 3), b = concave(trial / 3 % 3);
    shape_move(&b, (sonde_pose){shape_point(&seed, 0.02), shape_rotation(&seed)});
    assert_true(shape_report(&a).outward && shape_report(&b).outward);
    body_pair pair = body_pair_make(&a, &b);
    double volume = body_volume(&pair, nowhere), counted = body_counted(&a, &b, 48);
    assert_true(volume > 1e-7);
    worst = fmax(worst, fabs(volume / counted - 1));
    const sonde_overlap_result *r = pair.result;
    double sum_regions = 0, size = 0, arm = 0;
    for (uint32_t i = 0; i < r->region_count; ++i) sum_regions += r->regions[i].volume_m3;
    assert_near(sum_regions, volume, 1e-10 * volume);
    regions += r->region_count;
    sonde_vec3 force = nowhere, torque = nowhere;
    for (int side = 0; side < 2; ++side)
      for (uint32_t i = 0; i < r->entry_count[side]; ++i) {
        const sonde_overlap_entry *e = &r->entries[side][i];
        sonde_vec3 x = (side ? &b : &a)->vertices[e->vertex];
        force = v_add(force, e->gradient_m2);
        torque = v_add(torque, v_cross(x, e->gradient_m2));
        size += v_norm(e->gradient_m2);
        arm += v_norm(x) * v_norm(e->gradient_m2);
      }
    worst_force = fmax(worst_force, v_norm(force) / size);
    worst_torque = fmax(worst_torque, v_norm(torque) / arm);
    for (int i = 0; i < 4; ++i) {
      double other = body_volume(&pair, shape_direction(&seed));
      worst_hint = fmax(worst_hint, fabs(other / volume - 1));
    }
    body_pair_clear(&pair);
    sonde_mesh_clear(&a);
    sonde_mesh_clear(&b);
  }
  print_message(
      "against counting %.2g; force %.2g, torque %.2g, other directions %.2g; %u regions\n", worst,
      worst_force, worst_torque, worst_hint, regions);
  assert_true(worst < 0.01);
  assert_true(worst_force < 1e-12 && worst_torque < 1e-12);
  assert_true(worst_hint < 1e-10);
}

// The gradient is the derivative of the volume by every vertex of both bodies.
static void test_gradient(void **state) {
  (void)state;
  uint64_t seed = 8;
  double worst = 0;
  for (int trial = 0; trial < 4; ++trial) {
    sonde_mesh a = concave(trial % 3), b = concave((trial + 1) % 3);
    shape_move(&b, (sonde_pose){shape_point(&seed, 0.02), shape_rotation(&seed)});
    body_pair pair = body_pair_make(&a, &b);
    body_volume(&pair, nowhere);
    for (int side = 0; side < 2; ++side) {
      sonde_mesh *mesh = side ? &b : &a;
      sonde_vec3 *gradient = calloc(mesh->vertex_count, sizeof *gradient);
      double largest = 0, step = 2e-7;
      for (uint32_t i = 0; i < pair.result->entry_count[side]; ++i) {
        const sonde_overlap_entry *e = &pair.result->entries[side][i];
        gradient[e->vertex] = v_add(gradient[e->vertex], e->gradient_m2);
        largest = fmax(largest, v_norm(e->gradient_m2));
      }
      for (uint32_t v = 0; v < mesh->vertex_count; v += 11) {
        double *x[3] = {&mesh->vertices[v].x, &mesh->vertices[v].y, &mesh->vertices[v].z};
        const double exact[3] = {gradient[v].x, gradient[v].y, gradient[v].z};
        for (int k = 0; k < 3; ++k) {
          double at = *x[k];
          *x[k] = at + step;
          double more = body_volume(&pair, vec3(0.1, 0.2, 1));
          *x[k] = at - step;
          double less = body_volume(&pair, vec3(0.1, 0.2, 1));
          *x[k] = at;
          worst = fmax(worst, fabs((more - less) / (2 * step) - exact[k]) / largest);
        }
      }
      body_volume(&pair, nowhere);
      free(gradient);
    }
    body_pair_clear(&pair);
    sonde_mesh_clear(&a);
    sonde_mesh_clear(&b);
  }
  print_message("gradient against differences: %.2g of the largest\n", worst);
  assert_true(worst < 1e-6);
}

// Both bodies moved together: the same volume, turned gradients.
static void test_rigid_motion(void **state) {
  (void)state;
  uint64_t seed = 61;
  sonde_mesh a = concave(0), b = concave(2);
  body_shift(&b, 0.012, -0.004, 0.02);
  body_pair pair = body_pair_make(&a, &b);
  double volume = body_volume(&pair, nowhere);
  sonde_overlap_region before = pair.result->regions[0];
  for (int k = 0; k < 10; ++k) {
    sonde_pose pose = {shape_point(&seed, 0.3), shape_rotation(&seed)};
    sonde_mesh ma, mb;
    assert_ok(sonde_mesh_copy(&a, &ma, &shape_error));
    assert_ok(sonde_mesh_copy(&b, &mb, &shape_error));
    shape_move(&ma, pose);
    shape_move(&mb, pose);
    body_pair moved = body_pair_make(&ma, &mb);
    assert_near(body_volume(&moved, nowhere), volume, 1e-11 * volume);
    sonde_overlap_region after = moved.result->regions[0];
    assert_near(v_distance(after.direction, q_rotate(pose.rotation, before.direction)), 0, 1e-9);
    assert_near(v_distance(after.centre_m, pose_apply(pose, before.centre_m)), 0, 1e-11);
    // Sampled where columns have gaps.
    assert_near(after.depth_m, before.depth_m, 0.05 * before.depth_m);
    body_pair_clear(&moved);
    sonde_mesh_clear(&ma);
    sonde_mesh_clear(&mb);
  }
  body_pair_clear(&pair);
  sonde_mesh_clear(&a);
  sonde_mesh_clear(&b);
}

// ---- regions ------------------------------------------------------------------------------

// A comb pressed on a ball, a plate and a plate of two large faces: a region per tooth.
static void test_regions(void **state) {
  (void)state;
  for (int fine = 0; fine < 2; ++fine) {
    sonde_mesh comb = body_cells(7, 4, 3, 0.01, keep_comb);
    sonde_mesh plate = fine ? body_cells(9, 6, 2, 0.01, keep_all) : shape_box(0.045, 0.03, 0.01);
    // Teeth reach z = 0.015, leaning so that three of the four are in: 1.7, 0.9 and 0.1 mm deep.
    shape_move(&comb, (sonde_pose){{0, 0, 0}, {cos(0.02), 0, sin(0.02), 0}});
    body_shift(&plate, 0.0007, 0.0004, 0.0245);
    body_pair pair = body_pair_make(&comb, &plate);
    double volume = body_volume(&pair, nowhere), sum = 0;
    const sonde_overlap_result *r = pair.result;
    assert_int_equal(r->region_count, 3);
    double points = 0;
    for (uint32_t k = 0; k < r->region_count; ++k) {
      const sonde_overlap_region *region = &r->regions[k];
      sum += region->volume_m3;
      assert_true(region->volume_m3 > 0);
      // A lone tooth: the box of its vertices is a tooth's.
      for (uint32_t i = 0; i < region->entry_count[0]; ++i) {
        const sonde_overlap_entry *e = &r->entries[0][region->first_entry[0] + i];
        assert_int_equal(e->region, k);
        assert_true(fabs(comb.vertices[e->vertex].x - region->centre_m.x) < 0.011);
      }
      for (uint32_t i = 0; i < region->point_count; ++i) {
        const sonde_overlap_point *p = &r->points[region->first_point + i];
        assert_int_equal(p->region, k);
        points += p->area_m2 * p->depth_m;
      }
    }
    assert_near(sum, volume, 1e-11 * volume);
    assert_near(points, volume, 0.01 * volume);
    body_pair_clear(&pair);
    sonde_mesh_clear(&comb);
    sonde_mesh_clear(&plate);
  }
}

// Tongs around a bar: one region from below, one from above, with opposite directions.
static bool keep_tongs(int x, int y, int z) {
  (void)y;
  return x == 0 || z == 0 || z == 5;
}

static void test_tongs(void **state) {
  (void)state;
  sonde_mesh tongs = body_cells(4, 3, 6, 0.01, keep_tongs),
             bar = body_cells(2, 2, 4, 0.0101, keep_all);
  body_shift(&bar, 0.0051, 0.0003, 0.0001);
  body_pair pair = body_pair_make(&tongs, &bar);
  double volume = body_volume(&pair, vec3(0.1, 0, 1));
  const sonde_overlap_result *r = pair.result;
  assert_int_equal(r->region_count, 2);
  assert_near(v_dot(r->regions[0].direction, r->regions[1].direction), -1, 1e-9);
  assert_near(r->regions[0].volume_m3 + r->regions[1].volume_m3, volume, 1e-11 * volume);
  double depth[2] = {0.0202 + 0.0001 - 0.02, 0.0202 - 0.0001 - 0.02};
  for (int k = 0; k < 2; ++k) {
    bool upper = r->regions[k].centre_m.z > 0;
    assert_near(r->regions[k].volume_m3, depth[!upper] * 0.0202 * 0.0202, 1e-14);
    assert_near(r->regions[k].depth_m, depth[!upper], 1e-9);
  }
  body_pair_clear(&pair);
  sonde_mesh_clear(&tongs);
  sonde_mesh_clear(&bar);
}

// ---- columns ------------------------------------------------------------------------------

// The points of a ball on a ball: volume, and every moment that products of two linear functions
// give, against a fine rule; forces along the direction balance in force and torque.
static void test_columns(void **state) {
  (void)state;
  sonde_mesh a = shape_sphere(9, 0.04), b = shape_sphere(5, 0.03);
  sonde_vec3 way = v_scale(v_unit(vec3(0.2, -0.4, 0.9), nowhere), 0.063);
  body_shift(&b, way.x, way.y, way.z);
  body_pair pair = body_pair_make(&a, &b);
  double volume = body_volume(&pair, nowhere), sum = 0;
  const sonde_overlap_result *r = pair.result;
  const sonde_overlap_region *region = r->regions;
  sonde_vec3 force = nowhere, torque = nowhere, drive = nowhere;
  double area = 0;
  for (uint32_t i = 0; i < r->point_count; ++i) {
    const sonde_overlap_point *p = &r->points[i];
    sonde_vec3 on_a = nowhere, on_b = nowhere;
    for (int k = 0; k < 3; ++k) {
      assert_true(p->weight_a[k] > -1e-9 && p->weight_b[k] > -1e-9);
      on_a = v_madd(on_a, p->weight_a[k], a.vertices[a.faces[p->face_a][k]]);
      on_b = v_madd(on_b, p->weight_b[k], b.vertices[b.faces[p->face_b][k]]);
    }
    assert_near(v_distance(on_a, v_madd(on_b, p->depth_m, region->direction)), 0, 1e-13);
    assert_true(p->depth_m >= 0 && p->depth_m <= region->depth_m * (1 + 1e-12));
    sonde_vec3 push = v_scale(region->direction, p->area_m2 * p->depth_m);
    force = v_add(force, push);
    torque = v_add(torque, v_cross(v_sub(on_b, on_a), push));
    drive = v_add(drive, v_cross(on_a, push));
    sum += p->area_m2 * p->depth_m;
    area += p->area_m2;
  }
  assert_near(sum, volume, 1e-10 * volume);
  assert_near(area, region->area_m2, 1e-3 * area);
  assert_near(v_norm(torque), 0, 1e-14 * volume);
  // The line of force runs through both centres.
  assert_near(v_norm(drive), 0, 0.01 * volume * 0.04);
  // One point per piece has the same volume.
  sonde_overlap *single = NULL;
  sonde_overlap_config config = {.points_per_piece = 1};
  assert_ok(sonde_overlap_create(pair.tree_a, pair.tree_b, &config, &single, &shape_error));
  sonde_overlap_compute(single, pair.tree_a, pair.tree_b, nowhere);
  const sonde_overlap_result *s = sonde_overlap_get(single);
  assert_int_equal(3 * s->point_count, r->point_count);
  double single_sum = 0;
  for (uint32_t i = 0; i < s->point_count; ++i)
    single_sum += s->points[i].area_m2 * s->points[i].depth_m;
  assert_near(single_sum, volume, 1e-10 * volume);
  sonde_overlap_destroy(single);
  body_pair_clear(&pair);
  sonde_mesh_clear(&a);
  sonde_mesh_clear(&b);
}

// A body with a slot, pressed from above beyond it: columns end at the slot and do not run on
// through the gap into the part above.
static void test_gap(void **state) {
  (void)state;
  sonde_mesh slotted = body_cells(4, 3, 6, 0.01, keep_tongs), block = shape_box(0.05, 0.05, 0.05);
  body_shift(&block, 0.001, 0.002, 0.025);
  body_pair pair = body_pair_make(&slotted, &block);
  double volume = body_volume(&pair, nowhere), sum = 0;
  const sonde_overlap_result *r = pair.result;
  // Below the slot 5 mm of the lower jaw, 10 mm of the upper one; 55 mm of the back.
  assert_near(volume, 0.03 * 0.03 * 0.015 + 0.01 * 0.03 * 0.055, 1e-16);
  assert_int_equal(r->region_count, 1);
  assert_near(r->regions[0].direction.z, 1, 1e-12);
  for (uint32_t i = 0; i < r->point_count; ++i) sum += r->points[i].area_m2 * r->points[i].depth_m;
  assert_near(sum, 0.03 * 0.03 * 0.005 + 0.01 * 0.03 * 0.055, 1e-12);
  body_pair_clear(&pair);
  sonde_mesh_clear(&slotted);
  sonde_mesh_clear(&block);
}

// The rate is the difference quotient of the volume.
static void test_rate(void **state) {
  (void)state;
  uint64_t seed = 14;
  sonde_mesh a = concave(0), b = concave(1);
  body_shift(&b, 0.01, 0.004, 0.018);
  body_pair pair = body_pair_make(&a, &b);
  sonde_mesh *mesh[2] = {&a, &b};
  sonde_vec3 *velocity[2];
  body_volume(&pair, nowhere);
  for (int side = 0; side < 2; ++side) {
    velocity[side] = calloc(mesh[side]->vertex_count, sizeof *velocity[side]);
    for (uint32_t v = 0; v < mesh[side]->vertex_count; ++v)
      velocity[side][v] = shape_point(&seed, 1);
  }
  double rate = 0, volume[2], step = 1e-7;
  for (uint32_t r = 0; r < pair.result->region_count; ++r)
    for (int side = 0; side < 2; ++side) {
      const sonde_overlap_region *region = &pair.result->regions[r];
      const sonde_overlap_entry *entry = pair.result->entries[side] + region->first_entry[side];
      for (uint32_t k = 0; k < region->entry_count[side]; ++k)
        rate += v_dot(entry[k].gradient_m2, velocity[side][entry[k].vertex]);
    }
  for (int way = 0; way < 2; ++way) {
    for (int side = 0; side < 2; ++side)
      for (uint32_t v = 0; v < mesh[side]->vertex_count; ++v)
        mesh[side]->vertices[v] =
            v_madd(mesh[side]->vertices[v], way ? -2 * step : step, velocity[side][v]);
    volume[way] = body_volume(&pair, nowhere);
  }
  double quotient = (volume[0] - volume[1]) / (2 * step);
  assert_near(rate, quotient, 1e-5 * fabs(quotient));
  for (int side = 0; side < 2; ++side) free(velocity[side]);
  body_pair_clear(&pair);
  sonde_mesh_clear(&a);
  sonde_mesh_clear(&b);
}

// Apart, boxes apart, one body inside the other, and no room.
static void test_edges(void **state) {
  (void)state;
  sonde_mesh a = shape_sphere(8, 0.03), b = shape_sphere(6, 0.01);
  body_pair pair = body_pair_make(&a, &b);
  double whole = shape_report(&b).volume_m3;
  assert_near(body_volume(&pair, nowhere), whole, 1e-11 * whole);
  assert_int_equal(pair.result->region_count, 1);
  assert_int_equal(pair.result->entry_count[0], 0);
  assert_near(pair.result->regions[0].volume_m3, whole, 1e-11 * whole);
  body_shift(&b, 0.027, 0.027, 0.027);
  assert_true(body_volume(&pair, nowhere) == 0 && pair.result->region_count == 0);
  body_shift(&b, 1, 0, 0);
  assert_true(body_volume(&pair, nowhere) == 0);
  body_shift(&b, -1.007, -0.007, -0.007);
  sonde_overlap *small = NULL;
  sonde_overlap_config config = {.max_pieces = 3, .max_points = 2};
  assert_ok(sonde_overlap_create(pair.tree_a, pair.tree_b, &config, &small, &shape_error));
  body_volume(&pair, nowhere);
  assert_true(sonde_overlap_compute(small, pair.tree_a, pair.tree_b, nowhere));
  uint32_t flags = sonde_overlap_get(small)->flags;
  assert_int_equal(flags & SONDE_OVERLAP_PIECES_FULL, SONDE_OVERLAP_PIECES_FULL);
  assert_int_equal(flags & SONDE_OVERLAP_POINTS_FULL, SONDE_OVERLAP_POINTS_FULL);
  sonde_overlap_destroy(small);
  config = (sonde_overlap_config){.points_per_piece = 2};
  sonde_error error;
  assert_int_equal(sonde_overlap_create(pair.tree_a, pair.tree_b, &config, &small, &error),
                   SONDE_ARGUMENT);
  body_pair_clear(&pair);
  sonde_mesh_clear(&a);
  sonde_mesh_clear(&b);
}

// Work of an overlap over the faces of both bodies as the meshes get finer: linear.
static void test_cost(void **state) {
  (void)state;
  enum { SIZES = 5 };
  double faces[SIZES], pairs[SIZES], boxes[SIZES];
  for (int k = 0; k < SIZES; ++k) {
    uint32_t n = (uint32_t)lrint(8 * pow(1.6, k));
    sonde_mesh a = body_wavy(n, 0.03), b = body_wavy(n, 0.03);
    shape_move(&b, (sonde_pose){{0.03, 0.01, 0.02}, {0.8, 0.36, 0.48, 0}});
    body_pair pair = body_pair_make(&a, &b);
    body_volume(&pair, nowhere);
    faces[k] = a.face_count + b.face_count;
    pairs[k] = (double)pair.result->face_pairs;
    boxes[k] = (double)pair.result->box_tests;
    print_message("%6.0f faces: %7.0f face pairs, %8.0f boxes compared, %5u points\n", faces[k],
                  pairs[k], boxes[k], pair.result->point_count);
    body_pair_clear(&pair);
    sonde_mesh_clear(&a);
    sonde_mesh_clear(&b);
  }
  double slope_pairs = shape_slope(faces, pairs, SIZES),
         slope_boxes = shape_slope(faces, boxes, SIZES);
  print_message("slope of face pairs %.3f, of boxes %.3f\n", slope_pairs, slope_boxes);
  assert_near(slope_pairs, 1, 0.15);
  assert_near(slope_boxes, 1, 0.15);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_boxes),        cmocka_unit_test(test_lens),
      cmocka_unit_test(test_concave),      cmocka_unit_test(test_gradient),
      cmocka_unit_test(test_rigid_motion), cmocka_unit_test(test_regions),
      cmocka_unit_test(test_tongs),        cmocka_unit_test(test_columns),
      cmocka_unit_test(test_rate),         cmocka_unit_test(test_gap),
      cmocka_unit_test(test_edges),        cmocka_unit_test(test_cost),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
