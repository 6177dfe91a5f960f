// Laws of a cut through the skin: what stays (totals, places, rest), what is refused, files.
#include "../fixture.h"
#include "tissue/two_layer/linearise.h"

#include <stdio.h>

enum { LEVELS = 4 }; // 1,026 nodes, edges of about 6 mm

// The fixture with parameters that vary over the skin, so that a mixed-up node shows.
static sonde_model *make_model(const sonde_surface_law *law) {
  sonde_model *model = fixture_model(LEVELS, law);
  uint64_t seed = 5;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    model->k0_n_m3[i] *= 1 + 0.5 * fixture_random(&seed);
    model->xm_m[i] *= 1 + 0.5 * fixture_random(&seed);
  }
  fixture_vary_shear(model);
  return model;
}

static sonde_vec3 on_sphere(double y, double z) {
  return v_scale(v_unit(vec3(1, y, z), vec3(1, 0, 0)), FIXTURE_RADIUS_M);
}

// An open cut of about 50 mm across the +x side.
static const double OPEN[2][2] = {{-0.45, 0.02}, {0.45, 0.05}};

static sonde_model *cut_open(const sonde_model *model, sonde_cut_map *map) {
  const sonde_vec3 path[2] = {on_sphere(OPEN[0][0], OPEN[0][1]), on_sphere(OPEN[1][0], OPEN[1][1])};
  sonde_model *cut = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_model_cut(model, NULL, path, 2, &cut, map, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  return cut;
}

// A closed cut around the +x pole.
static sonde_model *cut_round(const sonde_model *model, double size, sonde_cut_map *map) {
  sonde_vec3 path[13];
  for (int k = 0; k < 13; ++k) {
    double angle = 2 * SONDE_PI * (k % 12) / 12;
    path[k] = on_sphere(size * cos(angle), size * sin(angle));
  }
  sonde_model *cut = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_model_cut(model, NULL, path, 13, &cut, map, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  return cut;
}

typedef struct totals {
  double mass, area, anchor, springs, asymptote;
} totals;

static totals sum(const sonde_model *model) {
  totals t = {0};
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    t.mass += model->mass_kg[i];
    t.area += model->area_m2[i];
    t.anchor += model->k0_n_m3[i] * model->area_m2[i];
    t.asymptote += model->xm_m[i] * model->area_m2[i];
  }
  for (uint32_t e = 0; e < model->topology.edge_count; ++e)
    t.springs += (model->edge_share ? model->edge_share[e] : 1) * model->edge_rest_m[e];
  return t;
}

static void assert_same_totals(const sonde_model *a, const sonde_model *b) {
  totals p = sum(a), q = sum(b);
  assert_near(q.mass / p.mass, 1, 1e-12);
  assert_near(q.area / p.area, 1, 1e-12);
  assert_near(q.anchor / p.anchor, 1, 1e-12);
  assert_near(q.asymptote / p.asymptote, 1, 1e-12);
  assert_near(q.springs / p.springs, 1, 1e-12);
}

static void totals_and_places_stay(void **state) {
  (void)state;
  sonde_model *model = make_model(NULL);
  for (int closed = 0; closed < 2; ++closed) {
    sonde_cut_map map;
    sonde_model *cut = closed ? cut_round(model, 0.4, &map) : cut_open(model, &map);
    assert_int_equal(map.closed, closed);
    assert_true(map.added >= 6 && map.work > 0);
    assert_int_equal(cut->surface.vertex_count, model->surface.vertex_count + map.added);
    assert_int_equal(cut->surface.face_count, model->surface.face_count);
    // Each of an open cut's two tips stays one node, a closed cut has none.
    assert_int_equal(map.added, closed ? map.path_count : map.path_count - 2);
    assert_int_equal(cut->topology.edge_count, model->topology.edge_count + map.split_edges);
    assert_same_totals(model, cut);
    for (uint32_t i = 0; i < cut->surface.vertex_count; ++i) {
      uint32_t from = i < map.node_count ? i : map.origin[i - map.node_count];
      assert_true(v_distance(cut->surface.vertices[i], model->surface.vertices[from]) == 0);
      assert_true(v_distance(cut->normal[i], model->normal[from]) == 0);
      assert_true(cut->k0_n_m3[i] == model->k0_n_m3[from] && cut->xm_m[i] == model->xm_m[from]);
      assert_true(cut->bone_depth_m[i] == model->bone_depth_m[from]);
      assert_true(cut->area_m2[i] > 0);
    }
    for (uint32_t f = 0; f < model->surface.face_count; ++f)
      assert_true(cut->face_area_m2[f] == model->face_area_m2[f]);
    sonde_cut_map_clear(&map);
    sonde_model_destroy(cut);
  }
  sonde_model_destroy(model);
}

// Strokes in all directions: the way keeps to the plane through the ends, within about half an edge
// (edges here have 5 to 8 mm), joins them and is not much longer than the straight line.
static void way_follows_the_path(void **state) {
  (void)state;
  sonde_model *model = make_model(NULL);
  for (int k = 0; k < 12; ++k) {
    double angle = SONDE_PI * (k + 0.5) / 12, y = 0.6 * cos(angle), z = 0.6 * sin(angle);
    const sonde_vec3 path[2] = {on_sphere(y, z), on_sphere(-y, -z)};
    sonde_model *cut;
    sonde_cut_map map;
    assert_int_equal(sonde_model_cut(model, NULL, path, 2, &cut, &map, NULL), SONDE_OK);
    const sonde_vec3 *x = model->surface.vertices;
    sonde_vec3 across = v_unit(v_cross(path[0], path[1]), vec3(0, 0, 1));
    for (uint32_t w = 0; w < map.path_count; ++w)
      assert_near(v_dot(across, x[map.path[w]]), 0, 5e-3);
    assert_true(v_distance(x[map.path[0]], path[0]) < 5e-3);
    assert_true(v_distance(x[map.path[map.path_count - 1]], path[1]) < 5e-3);
    double straight = 2 * FIXTURE_RADIUS_M * atan(0.6);
    assert_true(map.length_m > 0.8 * straight && map.length_m < 1.35 * straight);
    sonde_cut_map_clear(&map);
    sonde_model_destroy(cut);
  }
  sonde_model_destroy(model);
}

// A stroke of many points leaves the same cut as its two ends.
static void dense_stroke_is_a_line(void **state) {
  (void)state;
  sonde_model *model = make_model(NULL), *dense, *sparse;
  sonde_vec3 path[201];
  sonde_cut_map map, other;
  for (int k = 0; k <= 200; ++k) {
    double t = k / 200.0;
    path[k] = on_sphere(-0.15 + 0.3 * t, 0.02 + 0.03 * t);
  }
  const sonde_vec3 ends[2] = {path[0], path[200]};
  assert_int_equal(sonde_model_cut(model, NULL, path, 201, &dense, &map, NULL), SONDE_OK);
  assert_int_equal(sonde_model_cut(model, NULL, ends, 2, &sparse, &other, NULL), SONDE_OK);
  assert_int_equal(map.path_count, other.path_count);
  assert_memory_equal(map.path, other.path, map.path_count * sizeof *map.path);
  sonde_cut_map_clear(&map);
  sonde_cut_map_clear(&other);
  sonde_model_destroy(dense);
  sonde_model_destroy(sparse);
  sonde_model_destroy(model);
}

typedef struct evaluated {
  sonde_vec3 *force, *product;
  sonde_block_matrix *matrix;
  sonde_tissue_node *scratch;
} evaluated;

static evaluated evaluate(const sonde_model *model, const sonde_vec3 *x, const sonde_vec3 *v) {
  uint32_t n = model->surface.vertex_count;
  evaluated at = {SONDE_NEW(sonde_vec3, n), SONDE_NEW(sonde_vec3, n), NULL,
                  SONDE_NEW(sonde_tissue_node, n)};
  sonde_block_matrix_create(n, model->topology.edge_count,
                            (const uint32_t(*)[2])model->topology.edges, &at.matrix, NULL);
  sonde_tissue_linearise(model, NULL, x, v, &(sonde_tissue_scales){1, 1, 1}, at.force, at.product,
                         at.matrix, at.scratch);
  return at;
}

static void release(evaluated *at) {
  sonde_free(at->force);
  sonde_free(at->product);
  sonde_free(at->scratch);
  sonde_block_matrix_destroy(at->matrix);
}

// With every copy where its node was, the copies' forces add up to the node's, for every law.
static void copies_carry_the_forces_of_their_node(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 40;
  law.edge_pretension_n = 0.3;
  sonde_model *model = make_model(&law);
  sonde_cut_map map;
  sonde_model *cut = cut_open(model, &map);
  uint32_t n = model->surface.vertex_count, m = cut->surface.vertex_count;
  sonde_vec3 *x = SONDE_NEW(sonde_vec3, m), *v = SONDE_NEW(sonde_vec3, m);
  uint64_t seed = 9;
  for (uint32_t i = 0; i < n; ++i) {
    x[i] = v_add(model->surface.vertices[i], fixture_vector(&seed, 5e-4));
    v[i] = fixture_vector(&seed, 0.1);
  }
  for (uint32_t k = 0; k < map.added; ++k) {
    x[n + k] = x[map.origin[k]];
    v[n + k] = v[map.origin[k]];
  }
  assert_near(sonde_tissue_energy(cut, x) / sonde_tissue_energy(model, x), 1, 1e-12);
  evaluated whole = evaluate(model, x, v), parts = evaluate(cut, x, v);
  double size = 0;
  for (uint32_t i = 0; i < n; ++i) size = fmax(size, v_norm(whole.force[i]));
  for (uint32_t k = 0; k < map.added; ++k)
    parts.force[map.origin[k]] = v_add(parts.force[map.origin[k]], parts.force[n + k]);
  for (uint32_t i = 0; i < n; ++i)
    assert_true(v_distance(whole.force[i], parts.force[i]) < 1e-12 * size);
  release(&whole);
  release(&parts);
  sonde_free(x);
  sonde_free(v);
  sonde_cut_map_clear(&map);
  sonde_model_destroy(cut);
  sonde_model_destroy(model);
}

// A flap moved as a whole feels its own anchors only, and the skin around it feels nothing.
static void nothing_crosses_a_closed_cut(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 40;
  sonde_model *model = make_model(&law);
  sonde_cut_map map;
  sonde_model *cut = cut_round(model, 0.4, &map);
  uint32_t m = cut->surface.vertex_count, pole = 0, flap = 0;
  uint8_t *inside = SONDE_NEW(uint8_t, m);
  for (uint32_t i = 0; i < m; ++i)
    if (cut->surface.vertices[i].x > cut->surface.vertices[pole].x) pole = i;
  inside[pole] = 1;
  for (bool grows = true; grows;) {
    grows = false;
    for (uint32_t e = 0; e < cut->topology.edge_count; ++e) {
      uint32_t a = cut->topology.edges[e][0], b = cut->topology.edges[e][1];
      if (inside[a] == inside[b]) continue;
      inside[a] = inside[b] = 1;
      grows = true;
    }
  }
  sonde_vec3 *x = SONDE_NEW(sonde_vec3, m), *v = SONDE_NEW(sonde_vec3, m);
  for (uint32_t i = 0; i < m; ++i) {
    x[i] = v_add(cut->surface.vertices[i], vec3(inside[i] ? 2e-3 : 0, 0, 0));
    flap += inside[i];
  }
  assert_true(flap > 20 && flap < m / 2);
  evaluated at = evaluate(cut, x, v);
  for (uint32_t i = 0; i < m; ++i)
    if (!inside[i]) assert_true(v_norm(at.force[i]) < 1e-15);
  release(&at);
  sonde_free(inside);
  sonde_free(x);
  sonde_free(v);
  sonde_cut_map_clear(&map);
  sonde_model_destroy(cut);
  sonde_model_destroy(model);
}

static void rest_stays_rest(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 40;
  sonde_model *model = make_model(&law);
  sonde_cut_map map;
  sonde_model *cut = cut_open(model, &map);
  sonde_vec3 *v = SONDE_NEW(sonde_vec3, cut->surface.vertex_count);
  evaluated at = evaluate(cut, cut->surface.vertices, v);
  for (uint32_t i = 0; i < cut->surface.vertex_count; ++i) assert_true(v_norm(at.force[i]) == 0);
  release(&at);
  sonde_free(v);
  sonde_cut_map_clear(&map);
  sonde_model_destroy(cut);
  sonde_model_destroy(model);
}

// A second cut across the first opens four corners; totals stay.
static void cuts_may_cross(void **state) {
  (void)state;
  sonde_model *model = make_model(NULL);
  sonde_cut_map first, second;
  sonde_model *once = cut_open(model, &first), *twice = NULL;
  const sonde_vec3 path[2] = {on_sphere(0.03, -0.45), on_sphere(0.02, 0.45)};
  assert_int_equal(sonde_model_cut(once, NULL, path, 2, &twice, &second, NULL), SONDE_OK);
  assert_same_totals(model, twice);
  uint32_t corners = 0;
  for (uint32_t i = 0; i < twice->surface.vertex_count; ++i) {
    uint32_t here = 0;
    for (uint32_t j = 0; j < twice->surface.vertex_count; ++j)
      here += v_distance(twice->surface.vertices[i], twice->surface.vertices[j]) == 0;
    corners += here == 4;
  }
  assert_int_equal(corners, 4); // one place, seen from each of its four nodes
  sonde_model *again = NULL;
  sonde_error error = {0};
  const sonde_vec3 old[2] = {on_sphere(OPEN[0][0], OPEN[0][1]), on_sphere(OPEN[1][0], OPEN[1][1])};
  assert_int_equal(sonde_model_cut(once, NULL, old, 2, &again, NULL, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "earlier cut"));
  sonde_cut_map_clear(&first);
  sonde_cut_map_clear(&second);
  sonde_model_destroy(once);
  sonde_model_destroy(twice);
  sonde_model_destroy(model);
}

static void refuses(const sonde_model *model, const sonde_vec3 *path, uint32_t count,
                    const char *word) {
  sonde_model *cut = NULL;
  sonde_cut_map map;
  sonde_error error = {0};
  assert_int_equal(sonde_model_cut(model, NULL, path, count, &cut, &map, &error), SONDE_ARGUMENT);
  assert_null(cut);
  assert_null(map.origin);
  if (!strstr(error.message, word)) fail_msg("'%s' does not say '%s'", error.message, word);
}

static void bad_paths_are_refused(void **state) {
  (void)state;
  sonde_model *model = make_model(NULL);
  sonde_vec3 a = on_sphere(-0.3, 0), b = on_sphere(0.3, 0);
  const sonde_vec3 off[2] = {a, v_scale(b, 1.3)}, odd[2] = {a, vec3(0.06, NAN, 0)};
  const sonde_vec3 point[2] = {a, a}, far[2] = {a, v_neg(a)};
  const sonde_vec3 loop[4] = {a, b, on_sphere(0, 0.3), on_sphere(0, -0.3)};
  refuses(model, off, 1, "1 points");
  refuses(model, off, 2, "point 1");
  refuses(model, odd, 2, "finite");
  refuses(model, point, 2, "2 or more");
  refuses(model, far, 2, "different sides");
  refuses(model, loop, 4, "itself");
  sonde_model_destroy(model);
}

// A saved cut comes back with equal forces; a hole without its lips is still refused.
static void cut_models_are_saved(void **state) {
  (void)state;
  const char *path = "live_cut_test.sonde";
  sonde_model *model = make_model(NULL), *loaded = NULL;
  sonde_cut_map map;
  sonde_model *cut = cut_open(model, &map);
  assert_int_equal(sonde_model_save(cut, path, NULL), SONDE_OK);
  assert_int_equal(sonde_model_load(path, &loaded, NULL), SONDE_OK);
  assert_int_equal(loaded->checksum, cut->checksum);
  uint32_t n = cut->surface.vertex_count;
  assert_int_equal(loaded->surface.vertex_count, n);
  assert_memory_equal(loaded->normal, cut->normal, n * sizeof *cut->normal);
  assert_memory_equal(loaded->area_m2, cut->area_m2, n * sizeof *cut->area_m2);
  assert_memory_equal(loaded->edge_share, cut->edge_share,
                      cut->topology.edge_count * sizeof *cut->edge_share);
  sonde_model_destroy(loaded);
  sonde_error error = {0};
  cut->surface.face_count--;
  assert_int_equal(sonde_model_save(cut, path, NULL), SONDE_OK);
  cut->surface.face_count++;
  assert_int_equal(sonde_model_load(path, &loaded, &error), SONDE_MESH);
  cut->edge_share[0] = 2;
  assert_int_equal(sonde_model_save(cut, path, NULL), SONDE_OK);
  assert_int_equal(sonde_model_load(path, &loaded, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "edge_share[0]"));
  remove(path);
  sonde_cut_map_clear(&map);
  sonde_model_destroy(cut);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(totals_and_places_stay),
      cmocka_unit_test(way_follows_the_path),
      cmocka_unit_test(dense_stroke_is_a_line),
      cmocka_unit_test(copies_carry_the_forces_of_their_node),
      cmocka_unit_test(nothing_crosses_a_closed_cut),
      cmocka_unit_test(rest_stays_rest),
      cmocka_unit_test(cuts_may_cross),
      cmocka_unit_test(bad_paths_are_refused),
      cmocka_unit_test(cut_models_are_saved),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
