// Presets: round trip, ranges with file and line, and what they do to a model.
#include "identify_test.h"

#define HEAD "{\n\"format\": \"sonde-preset\",\n\"version\": 1"

static void comes_back_as_written(void **unused) {
  (void)unused;
  sonde_preset out = sonde_preset_default(), in;
  snprintf(out.name, sizeof out.name, "dry \"skin\"");
  out.normal_damping_s = 0.034;
  out.damping_multiplier = 1.5;
  out.stiffness_scale = 0.8;
  out.friction = (sonde_friction){0.5, 0.35, 0.012, 2, 0.04};
  sonde_error error = {0};
  assert_ok(sonde_preset_save(temporary_path(), &out, &error), &error);
  assert_ok(sonde_preset_load(temporary_path(), &in, &error), &error);
  assert_string_equal(in.name, out.name);
  assert_near(in.normal_damping_s, 0.034, 1e-10);
  assert_true(isnan(in.edge_damping_s)); // not set: the model's own
  assert_near(in.damping_multiplier, 1.5, 0);
  assert_near(in.stiffness_scale, 0.8, 0);
  assert_near(in.friction.mu_static, 0.5, 0);
  assert_near(in.friction.mu_kinetic, 0.35, 0);
  assert_near(in.friction.stribeck_speed_m_s, 0.012, 1e-10);
  assert_near(in.friction.gel_film, 2, 0);
  assert_near(in.friction.mu_gel, 0.04, 0);
  unlink(temporary_path());
}

static void refuse(const char *text, sonde_status expected, const char *word) {
  sonde_preset preset;
  sonde_error error = {0};
  sonde_status status = sonde_preset_load(write_temporary(text), &preset, &error);
  assert_int_equal(status, expected);
  assert_says(&error, word);
  assert_says(&error, temporary_path());
  unlink(temporary_path());
}

static void bad_files_are_refused(void **unused) {
  (void)unused;
  refuse("{\n\"format\": \n", SONDE_FORMAT, ":3: the text ends where a value was expected");
  refuse("[]", SONDE_FORMAT, "sonde-preset");
  refuse("{\"format\": \"sonde-preset\", \"version\": 9}", SONDE_VERSION, "\"version\": 1");
  refuse(HEAD ",\n\"mu_static\": 9}", SONDE_FORMAT, ":4: mu_static is 9, expected 0 to 5");
  refuse(HEAD ",\n\"mu_static\": 0.2,\n\"mu_kinetic\": 0.3}", SONDE_FORMAT, ":5: mu_kinetic");
  refuse(HEAD ",\n\"normal_damping_ms\": \"soft\"}", SONDE_FORMAT, ":4: normal_damping_ms");
  refuse(HEAD ",\n\n\"dampening\": 3}", SONDE_FORMAT, ":5: 'dampening'");
}

static double pressed_n(const sonde_model *model) {
  sonde_state *state;
  sonde_probe probe;
  assert_int_equal(sonde_state_create(model, NULL, &state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create("square", &probe, NULL), SONDE_OK);
  for (int k = 1; k <= 5; ++k) sonde_settle(state, &probe, fixture_pose(1e-3 * k), 1e-7, 200);
  double force = sonde_state_contact(state)->force_n.x;
  sonde_probe_clear(&probe);
  sonde_state_destroy(state);
  return force;
}

// All springs twice as stiff: the same shape at twice the force, but for the contact's compliance.
static void stiffness_scales_the_static_force(void **unused) {
  (void)unused;
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 20;
  sonde_model *model = fixture_model(4, &law);
  double before = pressed_n(model);
  sonde_preset preset = sonde_preset_default();
  preset.stiffness_scale = 2;
  assert_int_equal(sonde_preset_apply(&preset, model, NULL, NULL), SONDE_OK);
  assert_near(pressed_n(model), 2 * before, 0.02 * before);
  sonde_model_destroy(model);
}

static void applies_or_keeps(void **unused) {
  (void)unused;
  sonde_model *model = fixture_model(2, NULL);
  sonde_world_def def = sonde_world_def_default();
  sonde_surface_law before = model->law;
  sonde_preset preset = sonde_preset_default();
  preset.damping_multiplier = 2;
  preset.edge_damping_s = 0.005;
  preset.friction.mu_static = 0.4;
  assert_int_equal(sonde_preset_apply(&preset, model, &def, NULL), SONDE_OK);
  assert_near(model->law.normal_damping_s, 2 * before.normal_damping_s, 1e-15);
  assert_near(model->law.edge_damping_s, 0.01, 1e-15);
  assert_near(def.friction.mu_static, 0.4, 0);
  assert_near(model->law.edge_stiffness_n_m, before.edge_stiffness_n_m, 0);
  sonde_error error = {0};
  preset.stiffness_scale = 0;
  assert_int_equal(sonde_preset_apply(&preset, model, &def, &error), SONDE_ARGUMENT);
  assert_says(&error, "stiffness_scale is 0, expected 0.05 to 20");
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(comes_back_as_written), cmocka_unit_test(bad_files_are_refused),
      cmocka_unit_test(stiffness_scales_the_static_force), cmocka_unit_test(applies_or_keeps)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
