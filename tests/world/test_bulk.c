// Laws of volumetric bodies in the engine: Lame's thick shell, one stiffness at small strain,
// single precision beside double, other springs under way, the model file, and what is refused.
#define SONDE_REAL_DOUBLE
#include "../fixture.h"
#include "sanitized.h"

#include "tissue/bulk/bulk.h"
#include "tissue/kinds.h"
#include "world/batches.h"

#include "sonde/world_path.h"

#include <stdio.h>

#define BONE_M 0.02

// A ball of 60 mm around a bone of 20 mm.
static sonde_model *make_ball(sonde_model_kind kind, const sonde_bulk_law *law, double edge_m) {
  sonde_mesh skin = fixture_sphere(4, FIXTURE_RADIUS_M), bone = fixture_sphere(3, BONE_M);
  sonde_site site = fixture_site();
  sonde_model_def def = sonde_model_def_default();
  def.name = "ball";
  def.skin = &skin, def.femur = &bone;
  def.sites = &site, def.site_count = 1;
  const sonde_bulk_mesh mesh = {edge_m, 1e-9, edge_m, 0};
  const sonde_bulk_law fallback = sonde_bulk_law_default(kind);
  sonde_model *model = NULL;
  sonde_error error = {0};
  if (sonde_bulk_build(&def, &mesh, NULL, kind, law ? law : &fallback, &model, NULL, &error))
    fail_msg("%s", error.message);
  sonde_mesh_clear(&skin);
  sonde_mesh_clear(&bone);
  return model;
}

static sonde_state *make_state(const sonde_model *model, sonde_engine engine) {
  sonde_world_def def = fixture_world_def();
  def.engine = engine;
  sonde_state *state = NULL;
  sonde_error error = {0};
  if (sonde_state_create(model, &def, &state, &error)) fail_msg("%s", error.message);
  return state;
}

// Force along -x on the skin within `reach` of the site that is moved by `depth` along -x.
static double press_bonded(sonde_state *state, double depth, double reach) {
  const sonde_model *model = sonde_state_model(state);
  uint32_t *held = calloc(model->surface.vertex_count, sizeof *held), count = 0;
  sonde_vec3 *to = calloc(model->surface.vertex_count, sizeof *to), force;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 x = model->surface.vertices[i];
    if (v_distance(x, vec3(FIXTURE_RADIUS_M, 0, 0)) > reach) continue;
    to[count] = v_sub(x, vec3(depth, 0, 0));
    held[count++] = i;
  }
  assert_true(count > 2);
  sonde_settle_result result = sonde_settle_bonded(state, held, to, count, 1e-7, 200, &force);
  assert_true(result.converged);
  free(held);
  free(to);
  return force.x;
}

// A shell whose outer surface moves inwards by d while the inner one is held: u = A r + B/r^2.
static void shell_moves_as_lame_found(void **unused) {
  (void)unused;
  sonde_bulk_law law = sonde_bulk_law_default(SONDE_LINEAR_SOLID);
  law.young_pa[SONDE_LAYER_FAT] = law.young_pa[SONDE_LAYER_MUSCLE] = 10e3;
  sonde_model *model = make_ball(SONDE_LINEAR_SOLID, &law, 8e-3);
  const sonde_bulk *bulk = model->bulk;
  sonde_state *state = make_state(model, SONDE_ENGINE_DOUBLE);
  uint32_t skin = model->surface.vertex_count;
  uint32_t *held = calloc(skin, sizeof *held);
  sonde_vec3 *to = calloc(skin, sizeof *to);
  const double d = 1e-3, b = FIXTURE_RADIUS_M, a = BONE_M;
  for (uint32_t i = 0; i < skin; ++i) {
    held[i] = i;
    to[i] = v_scale(model->surface.vertices[i], 1 - d / v_norm(model->surface.vertices[i]));
  }
  assert_true(sonde_settle_bonded(state, held, to, skin, 1e-8, 200, NULL).converged);
  // A a + B/a^2 = 0, A b + B/b^2 = -d
  double slope = -d / (b - a * a * a / (b * b)), pole = -slope * a * a * a;
  double off2 = 0, all2 = 0;
  const sonde_vec3 *x = sonde_state_positions(state);
  for (uint32_t i = skin; i < bulk->node_count; ++i) {
    double r = v_norm(bulk->node[i]), exact = slope * r + pole / (r * r);
    sonde_vec3 u = v_sub(x[i], bulk->node[i]);
    off2 += v_norm2(v_sub(u, v_scale(bulk->node[i], exact / r)));
    all2 += exact * exact;
  }
  assert_true(bulk->node_count > skin + 100);
  print_message("displacement of the shell: %.2f %% off Lame's\n", 100 * sqrt(off2 / all2));
  assert_true(sqrt(off2 / all2) < 0.02);
  sonde_state_destroy(state);
  sonde_model_destroy(model);
  free(held);
  free(to);
}

// Energy of a body's forces along a path: what differs between there and back, over what was spent.
static void forces_are_those_of_an_energy(void **unused) {
  (void)unused;
  const sonde_model_kind kinds[] = {SONDE_LATTICE, SONDE_THREE_LAYER, SONDE_LINEAR_SOLID,
                                    SONDE_NEO_HOOKEAN_SOLID};
  for (size_t k = 0; k < SONDE_COUNT_OF(kinds); ++k) {
    sonde_model *model = make_ball(kinds[k], NULL, 12e-3);
    sonde_state *state = make_state(model, SONDE_ENGINE_DOUBLE);
    uint32_t n = model->bulk->node_count;
    sonde_batches *body = sonde_batches_of(state);
    sonde_vec3 *way = calloc(n, sizeof *way), *x = calloc(n, sizeof *x);
    uint64_t random = 7;
    for (uint32_t i = 0; i < n; ++i) {
      way[i] = fixture_vector(&random, 1.0);
      x[i] = v_madd(model->bulk->node[i], 3e-4, fixture_vector(&random, 1.0));
    }
    // dF.w along w by differences against the product of the tangent.
    double slope[2], product = 0;
    const double by = 1e-7;
    for (int side = 0; side < 3; ++side) {
      sonde_vec3 *at = calloc(n, sizeof *at), *v = calloc(n, sizeof *v);
      double step = side == 2 ? 0 : side == 1 ? by : -by;
      for (uint32_t i = 0; i < n; ++i) at[i] = v_madd(x[i], step, way[i]);
      body->common.calls->import(&body->common, model->bulk->node, at, v, true);
      for (uint32_t s = 0; s < body->common.batch_count; ++s)
        body->awake[s] = s, body->is_near[s] = 0;
      body->awake_count = body->part_awake[1] = body->part_awake[2] = body->common.batch_count;
      body->step.reach = body->step.force_scale = body->step.stiffness_scale = 1;
      body->step.damping_scale = 0, body->step.mass_scale = 1e-30;
      sonde_parts_linearise(body, false);
      double sum = 0;
      for (uint32_t i = 0; i < n; ++i)
        sum += v_dot(sonde_batch_vector(body->batch[i / SONDE_BATCH].r, i % SONDE_BATCH), way[i]);
      if (side < 2) {
        slope[side] = sum;
      } else { // way . K way: the diagonal blocks' part is D way, D from the factor of the blocks
        for (uint32_t i = 0; i < n; ++i) {
          sonde_batch *batch = &body->batch[i / SONDE_BATCH];
          uint32_t l = i % SONDE_BATCH;
          const double w[3] = {way[i].x, way[i].y, way[i].z};
          real *direction = body->direction + (size_t)i * SONDE_QUAD;
          for (int c = 0; c < 3; ++c) direction[c] = w[c], batch->z[c][l] = w[c];
          double l21 = batch->factor[0][l], l31 = batch->factor[1][l], l32 = batch->factor[2][l];
          double e[3] = {1 / batch->factor[3][l], 1 / batch->factor[4][l], 1 / batch->factor[5][l]};
          double y[3] = {w[0] + l21 * w[1] + l31 * w[2], w[1] + l32 * w[2], w[2]};
          double z[3] = {e[0] * y[0], e[1] * y[1], e[2] * y[2]};
          batch->r[0][l] = z[0];
          batch->r[1][l] = l21 * z[0] + z[1];
          batch->r[2][l] = l31 * z[0] + l32 * z[1] + z[2];
        }
        product = sonde_parts_multiply(body, true);
      }
      free(at);
      free(v);
    }
    double change = (slope[0] - slope[1]) / (2 * by);
    bool exact = kinds[k] == SONDE_LINEAR_SOLID;
    print_message("%s: tangent %.6g, by differences %.6g\n", sonde_model_kind_name(kinds[k]),
                  product, change);
    // Others leave the negative parts of their stiffness out.
    assert_near(product, change, (exact ? 1e-6 : 0.08) * change);
    sonde_state_destroy(state);
    sonde_model_destroy(model);
    free(way);
    free(x);
  }
}

// K* between the nodes of the skin is the whole solid: the same force, and the same skin.
static void condensed_solid_moves_like_the_whole(void **unused) {
  (void)unused;
  double force[2];
  sonde_vec3 *skin[2] = {NULL, NULL};
  uint32_t count = 0;
  for (int k = 0; k < 2; ++k) {
    sonde_model *model = make_ball(k ? SONDE_CONDENSED_SOLID : SONDE_LINEAR_SOLID, NULL, 10e-3);
    sonde_state *state = make_state(model, SONDE_ENGINE_DOUBLE);
    count = model->surface.vertex_count;
    assert_int_equal(sonde_model_nodes(model).count, k ? count : model->bulk->node_count);
    force[k] = press_bonded(state, 4e-3, 0.02);
    skin[k] = malloc(count * sizeof **skin);
    memcpy(skin[k], sonde_state_positions(state), count * sizeof **skin);
    sonde_state_destroy(state);
    sonde_model_destroy(model);
  }
  double apart = 0;
  for (uint32_t i = 0; i < count; ++i) apart = fmax(apart, v_distance(skin[0][i], skin[1][i]));
  print_message("condensed: force %.1e off, skin %.1e of the depth off\n",
                fabs(force[1] / force[0] - 1), apart / 4e-3);
  assert_true(fabs(force[1] / force[0] - 1) < 1e-6 && apart < 1e-6 * 4e-3);
  free(skin[0]), free(skin[1]);
}

// Steps take a condensed solid where the search for equilibrium finds it, in both precisions, and
// without a probe its dampers let it creep back: u falls by d/(d + h) in a step.
static void condensed_solid_rests_and_creeps_back(void **unused) {
  NOT_SANITIZED();
  (void)unused;
  sonde_model *model = make_ball(SONDE_CONDENSED_SOLID, NULL, 10e-3);
  uint32_t count = model->surface.vertex_count;
  const double depth = 5e-3;
  sonde_error error = {0};
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("linear", &probe, &error), SONDE_OK);
  for (int k = 0; k < 2; ++k) {
    sonde_world_def def = fixture_world_def();
    def.friction.mu_static = def.friction.mu_kinetic = 0; // a search knows none
    sonde_state *state[2];
    for (int j = 0; j < 2; ++j) {
      def.engine = k || j ? SONDE_ENGINE_DOUBLE : SONDE_ENGINE_FAST;
      assert_int_equal(sonde_state_create(model, &def, &state[j], &error), SONDE_OK);
    }
    for (int t = 0; t <= 600; ++t)
      sonde_step(state[0], &probe, fixture_pose(depth * fmin(t / 100.0, 1)));
    for (int t = 1; t <= 10; ++t)
      assert_true(
          sonde_settle(state[1], &probe, fixture_pose(depth * t / 10), 1e-10, 200).converged);
    const sonde_vec3 *x[2] = {sonde_state_positions(state[0]), sonde_state_positions(state[1])};
    double apart = 0, force = sonde_state_contact(state[0])->force_n.x;
    for (uint32_t i = 0; i < count; ++i) apart = fmax(apart, v_distance(x[0][i], x[1][i]));
    double off = fabs(force / sonde_state_contact(state[1])->force_n.x - 1);
    print_message("condensed at rest: force %.3f N, %.1e off, skin %.1e of the depth off\n", force,
                  off, apart / depth);
    assert_true(fabs(force) > 0.1 && off < 2e-6 && apart < 1e-6 * depth);

    double d = model->bulk->law.damping_s, h = fixture_world_def().dt_s, worst = 0;
    sonde_vec3 *before = calloc(count, sizeof *before);
    sonde_step(state[0], NULL, fixture_pose(0));
    memcpy(before, sonde_state_positions(state[0]), count * sizeof *before);
    sonde_step(state[0], NULL, fixture_pose(0));
    const sonde_vec3 *after = sonde_state_positions(state[0]);
    for (uint32_t i = 0; i < count; ++i) {
      sonde_vec3 rest = model->surface.vertices[i];
      sonde_vec3 fallen = v_scale(v_sub(before[i], rest), d / (d + h));
      worst = fmax(worst, v_distance(v_sub(after[i], rest), fallen));
    }
    print_message("creeps back within %.1e of the depth\n", worst / depth);
    assert_true(d > 0 && worst < 1e-7 * depth);
    free(before);
    sonde_state_destroy(state[0]);
    sonde_state_destroy(state[1]);
  }
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
}

// Its file is the solid's; a skin too large for K* is refused where K* is made.
static void condensed_solid_is_rebuilt_from_its_file(void **unused) {
  (void)unused;
  const char *path = "condensed_test.sonde";
  sonde_model *model = make_ball(SONDE_CONDENSED_SOLID, NULL, 12e-3), *read = NULL;
  sonde_error error = {0};
  assert_int_equal(sonde_model_save(model, path, &error), SONDE_OK);
  if (sonde_model_load(path, &read, &error)) fail_msg("%s", error.message);
  remove(path);
  assert_int_equal(read->kind, SONDE_CONDENSED_SOLID);
  sonde_state *state[2] = {make_state(model, SONDE_ENGINE_FAST),
                           make_state(read, SONDE_ENGINE_FAST)};
  assert_true(press_bonded(state[0], 2e-3, 0.02) == press_bonded(state[1], 2e-3, 0.02));
  double mass = 0, inner = 0;
  for (uint32_t i = 0; i < read->bulk->node_count; ++i)
    *(i < read->surface.vertex_count ? &mass : &inner) += read->bulk->mass_kg[i];
  assert_true(mass > 0.8 && inner == 0); // of 0.87 kg between skin and bone
  for (int k = 0; k < 2; ++k) sonde_state_destroy(state[k]);
  sonde_model_destroy(model);
  sonde_model_destroy(read);
}

static void too_fine_a_condensed_solid_is_refused(void **unused) {
  NOT_SANITIZED();
  (void)unused;
  sonde_state *state;
  sonde_error error = {0};
  sonde_model *model = make_ball(SONDE_CONDENSED_SOLID, NULL, 4e-3);
  sonde_world_def def = fixture_world_def();
  assert_int_equal(sonde_state_create(model, &def, &state, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "expected at most 2500"));
  sonde_model_destroy(model);
}

static void neo_hookean_begins_like_the_linear_solid(void **unused) {
  (void)unused;
  double force[2][2];
  for (int kind = 0; kind < 2; ++kind) {
    sonde_model *model =
        make_ball(kind == 0 ? SONDE_LINEAR_SOLID : SONDE_NEO_HOOKEAN_SOLID, NULL, 10e-3);
    sonde_state *state = make_state(model, SONDE_ENGINE_DOUBLE);
    force[kind][0] = press_bonded(state, 5e-5, 0.02);
    force[kind][1] = press_bonded(state, 8e-3, 0.02);
    sonde_state_destroy(state);
    sonde_model_destroy(model);
  }
  assert_near(force[1][0] / force[0][0], 1, 5e-3);
  assert_near(force[0][1] / force[0][0], 160, 160 * 1e-3); // linear
  assert_true(fabs(force[1][1] / force[0][1] - 1) > 0.02);
}

static void single_precision_follows_double(void **unused) {
  NOT_SANITIZED();
  (void)unused;
  const sonde_model_kind kinds[] = {SONDE_LATTICE, SONDE_THREE_LAYER, SONDE_LINEAR_SOLID,
                                    SONDE_NEO_HOOKEAN_SOLID};
  for (size_t k = 0; k < SONDE_COUNT_OF(kinds); ++k) {
    sonde_model *model = make_ball(kinds[k], NULL, 12e-3);
    sonde_probe probe;
    assert_int_equal(sonde_probe_create("square", &probe, NULL), SONDE_OK);
    double force[2];
    for (int engine = 0; engine < 2; ++engine) {
      sonde_state *state = make_state(model, engine ? SONDE_ENGINE_FAST : SONDE_ENGINE_DOUBLE);
      for (int t = 0; t <= 150; ++t) sonde_step(state, &probe, fixture_pose(4e-5 * t - 1e-3));
      assert_int_equal(sonde_state_flags(state) & SONDE_FLAG_NON_FINITE, 0);
      force[engine] = sonde_state_contact(state)->force_n.x;
      sonde_state_destroy(state);
    }
    print_message("%s: %.4f N, in single precision %.4f N\n", sonde_model_kind_name(kinds[k]),
                  force[0], force[1]);
    assert_true(fabs(force[0]) > 0.3);
    assert_near(force[1] / force[0], 1, 0.01);
    sonde_probe_clear(&probe);
    sonde_model_destroy(model);
  }
}

static void twice_the_stiffness_is_twice_the_force(void **unused) {
  (void)unused;
  sonde_model *model = make_ball(SONDE_NEO_HOOKEAN_SOLID, NULL, 12e-3);
  sonde_state *state = make_state(model, SONDE_ENGINE_FAST);
  double plain = press_bonded(state, 3e-3, 0.02);
  sonde_tuning tuning = sonde_tuning_default();
  tuning.stiffness_scale = 2;
  assert_int_equal(sonde_state_tune(state, &tuning, NULL), SONDE_OK);
  assert_near(press_bonded(state, 3e-3, 0.02) / plain, 2, 1e-5);
  sonde_state_destroy(state);
  sonde_model_destroy(model);
}

static void file_keeps_the_body(void **unused) {
  (void)unused;
  const char *path = "bulk_test.sonde";
  sonde_bulk_law law = sonde_bulk_law_default(SONDE_THREE_LAYER);
  law.volume_pa = 12345, law.knee = 0.125;
  sonde_model *model = make_ball(SONDE_THREE_LAYER, &law, 12e-3), *read = NULL;
  sonde_error error = {0};
  assert_int_equal(sonde_model_save(model, path, &error), SONDE_OK);
  if (sonde_model_load(path, &read, &error)) fail_msg("%s", error.message);
  assert_int_equal(read->kind, SONDE_THREE_LAYER);
  assert_int_equal(read->bulk->node_count, model->bulk->node_count);
  assert_int_equal(read->bulk->held_count, model->bulk->held_count);
  assert_memory_equal(&read->bulk->law, &law, sizeof law);
  assert_memory_equal(read->bulk->node, model->bulk->node,
                      model->bulk->node_count * sizeof(sonde_vec3));
  assert_memory_equal(read->bulk->layer, model->bulk->layer,
                      model->bulk->element_count * sizeof(uint32_t));
  assert_memory_equal(read->bulk->mass_kg, model->bulk->mass_kg,
                      model->bulk->node_count * sizeof(double));
  // A tetrahedron that is inside out is refused.
  uint32_t a = read->bulk->element[5][0];
  read->bulk->element[5][0] = read->bulk->element[5][1], read->bulk->element[5][1] = a;
  assert_int_equal(sonde_model_save(read, path, &error), SONDE_OK);
  sonde_model_destroy(read);
  assert_int_equal(sonde_model_load(path, &read, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "tetrahedron 5 is inside out"));
  remove(path);
  sonde_model_destroy(model);
}

// Mass is that of the volume, and the neighbours of a node name it too.
static void inside_is_whole(void **unused) {
  (void)unused;
  sonde_model *model = make_ball(SONDE_LATTICE, NULL, 10e-3);
  const sonde_bulk *bulk = model->bulk;
  double mass = 0, volume = 0;
  for (uint32_t i = 0; i < bulk->node_count; ++i) {
    mass += bulk->mass_kg[i];
    for (uint32_t k = bulk->start[i]; k < bulk->start[i + 1]; ++k) {
      uint32_t j = bulk->neighbour[k], back = bulk->start[j];
      while (back < bulk->start[j + 1] && bulk->neighbour[back] != i) ++back;
      assert_true(back < bulk->start[j + 1]);
    }
  }
  for (uint32_t e = 0; e < bulk->element_count; ++e) {
    sonde_vec3 gradient[4];
    volume += sonde_bulk_gradients(bulk, e, gradient);
  }
  double exact =
      4.0 / 3 * 3.14159265358979 *
      (FIXTURE_RADIUS_M * FIXTURE_RADIUS_M * FIXTURE_RADIUS_M - BONE_M * BONE_M * BONE_M);
  assert_near(volume / exact, 1, 0.02);
  assert_true(mass < volume * 1000 && mass > 0.9 * volume * 1000); // held nodes keep the rest
  sonde_model_destroy(model);
}

static void absurd_laws_are_refused(void **unused) {
  (void)unused;
  sonde_model *model = make_ball(SONDE_LINEAR_SOLID, NULL, 12e-3);
  sonde_bulk_law law = model->bulk->law;
  sonde_error error = {0};
  law.poisson = 0.5;
  assert_int_equal(sonde_model_set_bulk_law(model, &law, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "poisson"));
  law = model->bulk->law, law.young_pa[0] = NAN;
  assert_int_equal(sonde_model_set_bulk_law(model, &law, &error), SONDE_ARGUMENT);
  sonde_model *cut = NULL;
  const sonde_vec3 path[2] = {{FIXTURE_RADIUS_M, 0, 0}, {0, FIXTURE_RADIUS_M, 0}};
  assert_int_equal(sonde_model_cut(model, NULL, path, 2, &cut, NULL, &error), SONDE_ARGUMENT);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(shell_moves_as_lame_found),
      cmocka_unit_test(forces_are_those_of_an_energy),
      cmocka_unit_test(neo_hookean_begins_like_the_linear_solid),
      cmocka_unit_test(condensed_solid_moves_like_the_whole),
      cmocka_unit_test(condensed_solid_rests_and_creeps_back),
      cmocka_unit_test(condensed_solid_is_rebuilt_from_its_file),
      cmocka_unit_test(too_fine_a_condensed_solid_is_refused),
      cmocka_unit_test(single_precision_follows_double),
      cmocka_unit_test(twice_the_stiffness_is_twice_the_force),
      cmocka_unit_test(file_keeps_the_body),
      cmocka_unit_test(inside_is_whole),
      cmocka_unit_test(absurd_laws_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
