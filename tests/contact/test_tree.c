// Pairs of the face trees and of the sweep against comparing everything with everything.
#include "contact/bodies.h"

static sonde_bounds face_box(const sonde_mesh *mesh, uint32_t f, double grow) {
  sonde_bounds box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 p = mesh->vertices[mesh->faces[f][k]];
    box.low = vec3(fmin(box.low.x, p.x), fmin(box.low.y, p.y), fmin(box.low.z, p.z));
    box.high = vec3(fmax(box.high.x, p.x), fmax(box.high.y, p.y), fmax(box.high.z, p.z));
  }
  sonde_vec3 g = vec3(grow, grow, grow);
  return (sonde_bounds){v_sub(box.low, g), v_add(box.high, g)};
}

static bool meet(sonde_bounds a, sonde_bounds b) {
  return a.low.x <= b.high.x && b.low.x <= a.high.x && a.low.y <= b.high.y && b.low.y <= a.high.y &&
         a.low.z <= b.high.z && b.low.z <= a.high.z;
}

static int compare(const void *a, const void *b) {
  const uint32_t *p = a, *q = b;
  if (p[0] != q[0]) return p[0] < q[0] ? -1 : 1;
  return p[1] < q[1] ? -1 : p[1] > q[1];
}

static void check_pairs(const sonde_mesh *a, sonde_face_tree *ta, const sonde_mesh *b,
                        sonde_face_tree *tb, double margin) {
  enum { ROOM = 200000 };
  uint32_t(*found)[2] = calloc(ROOM, sizeof *found), (*brute)[2] = calloc(ROOM, sizeof *brute);
  uint64_t work = 0;
  uint32_t count = sonde_face_tree_pairs(ta, tb, margin, found, ROOM, &work), expected = 0;
  for (uint32_t i = 0; i < a->face_count; ++i)
    for (uint32_t j = 0; j < b->face_count; ++j) {
      if (!meet(face_box(a, i, margin / 2), face_box(b, j, margin / 2))) continue;
      brute[expected][0] = i;
      brute[expected++][1] = j;
    }
  assert_int_equal(count, expected);
  assert_true(work < (uint64_t)a->face_count * b->face_count);
  qsort(found, count, sizeof *found, compare);
  assert_memory_equal(found, brute, count * sizeof *found);
  // What does not fit is counted all the same.
  assert_int_equal(sonde_face_tree_pairs(ta, tb, margin, found, 3, NULL), expected);
  free(found);
  free(brute);
}

static void test_pairs(void **state) {
  (void)state;
  uint64_t seed = 2;
  sonde_mesh a = body_wavy(7, 0.03), b = body_wavy(5, 0.02);
  sonde_face_tree *ta = body_tree(&a), *tb = body_tree(&b);
  for (int k = 0; k < 6; ++k) {
    shape_move(&b, (sonde_pose){shape_point(&seed, 0.02), shape_rotation(&seed)});
    for (uint32_t v = 0; v < a.vertex_count; ++v)
      a.vertices[v] = v_add(a.vertices[v], shape_point(&seed, 5e-4));
    sonde_face_tree_refit(ta, a.vertices);
    sonde_face_tree_refit(tb, b.vertices);
    check_pairs(&a, ta, &b, tb, k % 2 ? 0 : 2e-3);
    sonde_bounds whole = sonde_face_tree_bounds(ta);
    for (uint32_t f = 0; f < a.face_count; ++f) {
      sonde_bounds box = face_box(&a, f, 0);
      assert_true(box.low.x >= whole.low.x && box.high.x <= whole.high.x);
      assert_true(box.low.z >= whole.low.z && box.high.z <= whole.high.z);
    }
  }
  sonde_face_tree_destroy(ta);
  sonde_face_tree_destroy(tb);
  sonde_mesh_clear(&a);
  sonde_mesh_clear(&b);
}

static void test_sweep(void **state) {
  (void)state;
  enum { BODIES = 60, ROOM = BODIES * BODIES };
  uint64_t seed = 7, work_first = 0, work_later = 0;
  uint32_t pairs[ROOM][2];
  sonde_bounds boxes[BODIES];
  sonde_vec3 at[BODIES];
  sonde_sweep *sweep = NULL;
  assert_ok(sonde_sweep_create(BODIES, &sweep, &shape_error));
  for (int k = 0; k < BODIES; ++k) at[k] = shape_point(&seed, 1);
  for (int step = 0; step < 30; ++step) {
    for (int k = 0; k < BODIES; ++k) {
      at[k] = v_add(at[k], shape_point(&seed, 0.01));
      double half = 0.02 + 0.01 * (k % 20);
      boxes[k] = (sonde_bounds){v_sub(at[k], vec3(half, half, half)),
                                v_add(at[k], vec3(half, half, half))};
    }
    uint32_t expected = 0;
    uint32_t count =
        sonde_sweep_pairs(sweep, boxes, BODIES, pairs, ROOM, step ? &work_later : &work_first);
    for (uint32_t i = 0; i < BODIES; ++i)
      for (uint32_t j = i + 1; j < BODIES; ++j) {
        if (!meet(boxes[i], boxes[j])) continue;
        assert_true(expected < count);
        assert_int_equal(pairs[expected][0], i);
        assert_int_equal(pairs[expected][1], j);
        ++expected;
      }
    assert_int_equal(count, expected);
    assert_int_equal(sonde_sweep_pairs(sweep, boxes, BODIES, pairs, 1, NULL), expected);
  }
  assert_true(work_later / 29 < work_first);
  sonde_sweep_destroy(sweep);
}

static void test_faults(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 1, 1);
  sonde_face_tree *tree;
  sonde_error error;
  box.faces[3][1] = 99;
  assert_int_equal(sonde_face_tree_create(&box, &tree, &error), SONDE_MESH);
  assert_non_null(strstr(error.message, "face 3 names vertex 99"));
  box.face_count = 0;
  assert_int_equal(sonde_face_tree_create(&box, &tree, &error), SONDE_MESH);
  assert_null(tree);
  sonde_mesh_clear(&box);
}

// Every allocation fails once; nothing leaks and nothing crashes.
static int budget, alive;
static void *meagre_allocate(size_t bytes, void *user) {
  (void)user;
  if (budget-- <= 0) return NULL;
  ++alive;
  return malloc(bytes);
}
static void meagre_release(void *pointer, void *user) {
  (void)user;
  --alive;
  free(pointer);
}

static void test_memory(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 1, 1);
  const sonde_allocator meagre = {meagre_allocate, meagre_release, NULL};
  sonde_set_allocator(&meagre);
  bool done = false;
  for (int n = 0; n < 100 && !done; ++n) {
    sonde_face_tree *tree = NULL;
    sonde_overlap *overlap = NULL;
    sonde_sweep *sweep = NULL;
    budget = n;
    alive = 0;
    sonde_status status = sonde_face_tree_create(&box, &tree, NULL);
    if (!status) status = sonde_overlap_create(tree, tree, NULL, &overlap, NULL);
    if (!status) status = sonde_sweep_create(4, &sweep, NULL);
    done = !status;
    assert_true(done || status == SONDE_MEMORY);
    sonde_sweep_destroy(sweep);
    sonde_overlap_destroy(overlap);
    sonde_face_tree_destroy(tree);
    assert_int_equal(alive, 0);
  }
  assert_true(done);
  sonde_set_allocator(NULL);
  sonde_mesh_clear(&box);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_pairs),
      cmocka_unit_test(test_sweep),
      cmocka_unit_test(test_faults),
      cmocka_unit_test(test_memory),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
