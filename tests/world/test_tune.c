// Springs changed under way: a tuned state is a state of the model with those springs, friction
// changes without letting go.
#include "../fixture.h"
#include "world/state.h"

typedef struct bench {
  sonde_model *model;
  sonde_state *state;
  sonde_probe probe;
} bench;

static sonde_world_def def_of(sonde_engine engine) {
  sonde_world_def def = fixture_world_def();
  def.engine = engine;
  def.sleep_displacement_m = 0;
  def.pcg.relative_residual = 1e-6;
  return def;
}

static bench make(const sonde_world_def *def) {
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 15;
  law.edge_pretension_n = 0.1;
  bench b = {.model = fixture_model(3, &law)};
  fixture_vary_shear(b.model);
  assert_int_equal(sonde_state_create(b.model, def, &b.state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create("sphere", &b.probe, NULL), SONDE_OK);
  return b;
}

static void clear(bench *b) {
  sonde_state_destroy(b->state);
  sonde_model_destroy(b->model);
  sonde_probe_clear(&b->probe);
}

static void press(bench *b, int from, int to) {
  for (int k = from; k < to; ++k) sonde_step(b->state, &b->probe, fixture_pose(1e-4 * k - 0.001));
}

// A model whose springs are half as stiff, with longer damping times.
static void soften(sonde_model *model) {
  model->law.edge_stiffness_n_m *= 0.5;
  model->law.edge_pretension_n *= 0.5;
  model->law.tangential_stiffness_n_m3 *= 0.5;
  model->law.shear_stiffness_n_m *= 0.5;
  model->law.normal_damping_s = 0.03;
  model->law.edge_damping_s *= 4;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) model->k0_n_m3[i] *= 0.5;
}

static void tuned_is_the_other_model(void **state) {
  (void)state;
  for (int engine = SONDE_ENGINE_DOUBLE; engine <= SONDE_ENGINE_FAST; ++engine) {
    sonde_world_def def = def_of((sonde_engine)engine);
    bench a = make(&def), b = make(&def);
    soften(b.model);
    sonde_state_destroy(b.state);
    assert_int_equal(sonde_state_create(b.model, &def, &b.state, NULL), SONDE_OK);
    sonde_tuning tuning = {0.5, 4, 0.03 / 4, NAN};
    uint64_t checksum = sonde_hash(0, a.model->k0_n_m3, 8);
    assert_int_equal(sonde_state_tune(a.state, &tuning, NULL), SONDE_OK);
    press(&a, 0, 90);
    press(&b, 0, 90);
    assert_true(v_norm(sonde_state_contact(a.state)->force_n) > 0.3);
    assert_true(sonde_state_hash(a.state) == sonde_state_hash(b.state));
    assert_true(checksum == sonde_hash(0, a.model->k0_n_m3, 8)); // the model is as it was
    clear(&a);
    clear(&b);
  }
}

// Held still, the skin answers to stiffer springs although it slept; back again, it is as before.
static void changes_under_the_probe(void **state) {
  (void)state;
  sonde_world_def def = def_of(SONDE_ENGINE_FAST);
  def.sleep_displacement_m = 5e-6;
  bench b = make(&def);
  press(&b, 0, 90);
  for (int k = 0; k < 500; ++k) sonde_step(b.state, &b.probe, fixture_pose(0.0079));
  double before = v_norm(sonde_state_contact(b.state)->force_n);
  assert_true(sonde_state_awake(b.state) < b.model->surface.vertex_count / 2);
  sonde_tuning stiff = sonde_tuning_default();
  stiff.stiffness_scale = 1.5;
  assert_int_equal(sonde_state_tune(b.state, &stiff, NULL), SONDE_OK);
  press(&b, 89, 90);
  assert_int_equal(sonde_state_awake(b.state), b.model->surface.vertex_count);
  for (int k = 0; k < 500; ++k) sonde_step(b.state, &b.probe, fixture_pose(0.0079));
  double stiffer = v_norm(sonde_state_contact(b.state)->force_n);
  assert_true(stiffer > 1.3 * before && stiffer < 1.5 * before); // the contact yields as well
  sonde_tuning plain = sonde_tuning_default();
  assert_int_equal(sonde_state_tune(b.state, &plain, NULL), SONDE_OK);
  for (int k = 0; k < 500; ++k) sonde_step(b.state, &b.probe, fixture_pose(0.0079));
  assert_near(v_norm(sonde_state_contact(b.state)->force_n), before, 0.01 * before);
  clear(&b);
}

static void rejects_what_is_no_spring(void **state) {
  (void)state;
  sonde_world_def def = def_of(SONDE_ENGINE_FAST);
  bench b = make(&def);
  sonde_error error;
  const sonde_tuning bad[] = {{0, 1, NAN, NAN}, {1, -1, NAN, NAN}, {1, 1, -1, NAN}, {NAN, 1, 0, 0}};
  const char *const named[] = {"stiffness_scale", "damping_scale", "normal_damping_s",
                               "stiffness_scale"};
  for (size_t i = 0; i < SONDE_COUNT_OF(bad); ++i) {
    assert_int_equal(sonde_state_tune(b.state, &bad[i], &error), SONDE_ARGUMENT);
    assert_non_null(strstr(error.message, named[i]));
  }
  clear(&b);
}

// A film that comes while the probe slips leaves it slipping: the tangential force falls to the new
// coefficient's, never above it.
static void friction_changes_in_a_slide(void **state) {
  (void)state;
  sonde_world_def def = def_of(SONDE_ENGINE_FAST);
  def.friction = (sonde_friction){0.5, 0.4, 0.01, 0, 0.05};
  bench b = make(&def);
  press(&b, 0, 60);
  sonde_pose pose = fixture_pose(0.0049);
  for (int k = 0; k < 150; ++k) {
    pose.position.z += 5e-5;
    if (k == 100) {
      sonde_friction wet = def.friction;
      wet.gel_film = 5;
      sonde_state_rub(b.state, &wet);
    }
    sonde_step(b.state, &b.probe, pose);
    sonde_vec3 f = sonde_state_contact(b.state)->force_n;
    const sonde_friction *now = &sonde_state_def(b.state)->friction;
    assert_true(b.state->mu <= sonde_friction_coefficient(now, 0) * (1 + 1e-12));
    if (k == 99) assert_true(-f.z > 0.25 * f.x);
    if (k > 103) assert_true(-f.z < 0.25 * f.x);
  }
  clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(tuned_is_the_other_model), cmocka_unit_test(changes_under_the_probe),
      cmocka_unit_test(rejects_what_is_no_spring), cmocka_unit_test(friction_changes_in_a_slide)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
