// Bodies of springs or tetrahedra through their volume in scenes: forces are those of their energy,
// a ball comes to rest on each of them with its weight, no energy comes from nowhere, and what is
// no such body is refused.
#include "scene_fixture.h"
#include "../sanitized.h"

#include "sparse/block.h"
#include "tissue/bulk/blocks.h"
#include "tissue/bulk/bulk.h"
#include "tissue/kinds.h"

#include <stdlib.h>
#include <unistd.h>

static const sonde_model_kind KINDS[] = {SONDE_LATTICE, SONDE_THREE_LAYER, SONDE_LINEAR_SOLID,
                                         SONDE_NEO_HOOKEAN_SOLID, SONDE_CONDENSED_SOLID};

// A block of 120 x 120 x 60 mm about the origin that a flat bone in its middle holds.
static sonde_model *make_block(sonde_model_kind kind) {
  sonde_mesh skin = {0}, bone = {0};
  sonde_error error = {0};
  assert_int_equal(sonde_shape_box(vec3(0.12, 0.12, 0.06), 0.012, &skin, &error), SONDE_OK);
  assert_int_equal(sonde_shape_box(vec3(0.07, 0.07, 0.012), 0.012, &bone, &error), SONDE_OK);
  sonde_site site = {.id = 1,
                     .position_m = {0, 0, 0.03},
                     .normal = {0, 0, 1},
                     .u = {1, 0, 0},
                     .v = {0, 1, 0},
                     .k0_n_m3 = 1e5,
                     .xm_m = 0.03};
  sonde_model_def def = sonde_model_def_default();
  def.name = "block";
  def.skin = &skin, def.femur = &bone;
  def.sites = &site, def.site_count = 1;
  const sonde_bulk_mesh mesh = {12e-3, 1e-9, 12e-3, 0};
  const sonde_bulk_law law = sonde_bulk_law_default(kind);
  sonde_model *model = NULL;
  if (sonde_bulk_build(&def, &mesh, NULL, kind, &law, &model, NULL, &error))
    fail_msg("%s", error.message);
  sonde_mesh_clear(&skin);
  sonde_mesh_clear(&bone);
  return model;
}

// A file with such a block; its name is the caller's.
static void save_block(sonde_model_kind kind, char path[]) {
  sonde_model *model = make_block(kind);
  int descriptor = mkstemp(path);
  assert_true(descriptor >= 0);
  close(descriptor);
  assert_int_equal(sonde_model_save(model, path, NULL), SONDE_OK);
  sonde_model_destroy(model);
}

static const char *const HEAD = "sonde_scene: 1\nmaterials:\n- {name: m, contact_stiffness_n_m3: "
                                "4e6, contact_damping_s: 2e-3, friction_static: 0.5}\n";

// The force along a way is the fall of the energy, and K w its change along w.
static void test_forces(void **unused) {
  (void)unused;
  for (size_t k = 0; k < SONDE_COUNT_OF(KINDS); ++k) {
    sonde_model *model = make_block(KINDS[k]);
    const sonde_nodes nodes = sonde_model_nodes(model);
    uint32_t n = nodes.count, pair_count = sonde_node_pairs(&nodes, NULL);
    uint32_t(*pairs)[2] = calloc(pair_count, sizeof *pairs);
    sonde_node_pairs(&nodes, pairs);
    sonde_block_matrix *matrix = NULL;
    sonde_bulk_blocks *blocks = NULL;
    assert_int_equal(
        sonde_block_matrix_create(n, pair_count, (const uint32_t(*)[2])pairs, &matrix, NULL),
        SONDE_OK);
    assert_int_equal(sonde_bulk_blocks_create(model, &blocks, NULL), SONDE_OK);
    sonde_vec3 *x = calloc(n, sizeof *x), *way = calloc(n, sizeof *way), *at = calloc(n, sizeof *x),
               *none = calloc(n, sizeof *x), *force = calloc(n, sizeof *x),
               *kv = calloc(n, sizeof *x), *product = calloc(n, sizeof *x);
    uint32_t *rows = calloc(n, sizeof *rows), *edges = calloc(pair_count, sizeof *edges);
    for (uint32_t e = 0; e < pair_count; ++e) edges[e] = e;
    uint64_t random = 5;
    for (uint32_t i = 0; i < n; ++i) {
      rows[i] = i;
      way[i] = fixture_vector(&random, 1.0);
      x[i] = v_madd(model->bulk->node[i], 2e-4, fixture_vector(&random, 1.0));
    }
    const sonde_tissue_scales stiffness = {0, 0, 1};
    const double by = 1e-7;
    double energy[2], along[2];
    for (int side = 0; side < 2; ++side) {
      for (uint32_t i = 0; i < n; ++i) at[i] = v_madd(x[i], side ? by : -by, way[i]);
      sonde_bulk_linearise(blocks, at, none, &stiffness, force, kv, matrix);
      energy[side] = sonde_bulk_energy(blocks, at), along[side] = 0;
      for (uint32_t i = 0; i < n; ++i) along[side] += v_dot(force[i], way[i]);
    }
    // At x with velocity `way`: dampers pull by damping_s K way.
    sonde_bulk_linearise(blocks, x, way, &stiffness, force, kv, matrix);
    const sonde_active_set all = {rows, n, edges, pair_count};
    sonde_block_multiply(matrix, &all, NULL, 0, way, product);
    double work = 0, length = 0, bend = 0, apart = 0, size = 0, drag = 0;
    for (uint32_t i = 0; i < n; ++i) {
      bend += v_dot(way[i], product[i]), drag += v_dot(way[i], force[i]);
      length += v_norm(force[i]);
      apart += v_norm2(v_sub(product[i], kv[i])), size += v_norm2(kv[i]);
    }
    work = (along[0] + along[1]) / 2;
    double fall = -(energy[1] - energy[0]) / (2 * by), slope = -(along[1] - along[0]) / (2 * by);
    print_message("%s: force %.1e off the energy's slope, K %.2f %% off the force's, matrix and "
                  "K v %.1e apart, dampers %.1e\n",
                  sonde_model_kind_name(KINDS[k]), fabs(work / fall - 1),
                  100 * fabs(bend / slope - 1), sqrt(apart / size),
                  fabs((work - drag) / (model->bulk->law.damping_s * bend) - 1));
    assert_true(fabs(work - fall) < 1e-7 * length);
    assert_true(
        fabs(bend / slope - 1) <
        (KINDS[k] == SONDE_LINEAR_SOLID || KINDS[k] == SONDE_CONDENSED_SOLID ? 1e-6 : 0.02));
    assert_true(sqrt(apart / size) < 1e-12);
    assert_true(fabs((work - drag) / (model->bulk->law.damping_s * bend) - 1) < 1e-5);
    sonde_bulk_blocks_destroy(blocks);
    sonde_block_matrix_destroy(matrix);
    sonde_model_destroy(model);
    free(rows), free(edges), free(pairs), free(x), free(way), free(at), free(none), free(force),
        free(kv), free(product);
  }
}

// A ball dropped by 15 mm on the block comes to rest with its weight on it. With contact that has
// an energy, and without friction, no step gains more than what its last iterations left.
static void test_ball(void **unused) {
  (void)unused;
  static const char *const contacts[] = {
      "all", "[{between: [block, ball], law: energy, stiffness_n_m5: 1e10, friction_static: 0}]"};
  for (size_t k = 0; k < 2 * SONDE_COUNT_OF(KINDS); ++k) {
    char path[] = "/tmp/sonde_model_XXXXXX", text[1024];
    sonde_model_kind kind = KINDS[k / 2];
    bool conserves = k % 2;
    // The two laws that are farthest apart come to rest in every test, all of them in a long one.
    if (!conserves && !SAMPLES(true, kind == SONDE_LATTICE || kind == SONDE_NEO_HOOKEAN_SOLID))
      continue;
    save_block(kind, path);
    snprintf(text, sizeof text,
             "%sgravity_m_s2: [0, 0, -9.81]\nstep: {dt_s: %s, newton: %d, sleep_mm: 0}\nbodies:\n"
             "- {name: block, kind: volumetric, model: %s, material: m}\n"
             "- {name: ball, shape: {sphere_mm: 20, edge_mm: 8}, mass_kg: 0.04, material: m,\n"
             "   position_mm: [0, 0, 65]}\ncontacts: %s\n",
             HEAD, conserves ? "1e-3" : "4e-3", conserves ? 10 : 2, path, contacts[k % 2]);
    world w = world_of(text);
    unlink(path);
    double before = total_energy(&w), gained = 0, first = before, weight = 0.04 * 9.81;
    int rounds = conserves ? ROUNDS(SAMPLES(160, 40), 20) : ROUNDS(400, 20);
    for (int step = 0; step < rounds; ++step) {
      steps(&w, 1);
      double now = total_energy(&w);
      gained = fmax(gained, now - before), before = now;
    }
    double force = sonde_scene_pair_measure(w.state, 0).normal_n / weight;
    double fast = v_norm(measure(&w, "ball").velocity_m_s);
    print_message("%s: ball at %.2f mm, %.1e m/s, force %.4f of its weight, largest gain %.1e of "
                  "%.2e J\n",
                  sonde_model_kind_name(kind), 1e3 * measure(&w, "ball").centre_m.z, fast, force,
                  gained, first - before);
    assert_unflagged(&w);
    if (conserves) assert_true(gained <= 1e-12 * (first - before));
    if (!conserves && rounds == 400) assert_true(fabs(force - 1) < 1e-3 && fast < 1e-4);
    world_end(&w);
  }
}

// A block that is turned and moved, with gravity turned alike, sags by the same; without `sags` its
// shape is the one under its weight.
static void test_place(void **unused) {
  (void)unused;
  double deep[3] = {0};
  for (int turned = 0; turned < 3; ++turned) {
    char path[] = "/tmp/sonde_model_XXXXXX", text[1024];
    save_block(SONDE_NEO_HOOKEAN_SOLID, path);
    snprintf(
        text, sizeof text,
        "%sgravity_m_s2: %s\nstep: {dt_s: 1e-2, newton: 3}\nbodies:\n"
        "- {name: block, kind: volumetric, model: %s, material: m, sags: %s%s}\n",
        HEAD, turned == 1 ? "[-9.81, 0, 0]" : "[0, 0, -9.81]", path, turned < 2 ? "true" : "false",
        turned == 1 ? ", position_mm: [100, 50, -20], rotation: {axis: [0, 1, 0], angle_deg: 90}"
                    : "");
    world w = world_of(text);
    unlink(path);
    sonde_vec3 start = measure(&w, "block").centre_m;
    steps(&w, 60);
    sonde_vec3 moved = v_sub(measure(&w, "block").centre_m, start);
    deep[turned] = -v_dot(moved, turned == 1 ? vec3(1, 0, 0) : vec3(0, 0, 1));
    assert_unflagged(&w);
    world_end(&w);
  }
  print_message("sags by %.4f mm, turned by %.4f mm, as scanned by %.1e mm\n", 1e3 * deep[0],
                1e3 * deep[1], 1e3 * deep[2]);
  assert_true(deep[0] > 1e-4);
  assert_true(fabs(deep[1] / deep[0] - 1) < 1e-6);
  assert_true(deep[2] == 0);
}

// Each kind of tissue takes its own models, and says which kind the other one wants.
static void test_refused(void **unused) {
  (void)unused;
  char path[] = "/tmp/sonde_model_XXXXXX", text[1024];
  save_block(SONDE_LINEAR_SOLID, path);
  const char *const kinds[] = {"two_layer", "volumetric"};
  const char *const wanted[] = {"expected kind: volumetric", "expected kind: two_layer"};
  for (int k = 0; k < 2; ++k) {
    if (k == 1) {
      sonde_surface_law law = sonde_surface_law_default();
      sonde_model *model = fixture_model(1, &law);
      assert_int_equal(sonde_model_save(model, path, NULL), SONDE_OK);
      sonde_model_destroy(model);
    }
    snprintf(text, sizeof text, "%sbodies:\n- {name: b, kind: %s, model: %s}\n", HEAD, kinds[k],
             path);
    sonde_scene *scene = NULL;
    sonde_error error = {0};
    assert_int_equal(sonde_scene_parse(text, "test.yaml", NULL, &scene, &error), SONDE_ARGUMENT);
    assert_non_null(strstr(error.message, wanted[k]));
    assert_non_null(strstr(error.message, "test.yaml:5: "));
  }
  unlink(path);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_forces), cmocka_unit_test(test_ball),
                                     cmocka_unit_test(test_place), cmocka_unit_test(test_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
