// Damping and friction put into a model come back out of its noisy records.
#include "identify_test.h"

static sonde_motion_record make(const sonde_model *model, const sonde_world_def *def,
                                sonde_protocol p, uint64_t seed) {
  p.site = 0;
  p.noise_force_n = 0.05;
  p.noise_position_m = 5e-5;
  p.seed = seed;
  sonde_motion_record record;
  sonde_error error = {0};
  assert_ok(sonde_protocol_run(model, def, &p, NULL, &record, &error), &error);
  return record;
}

static void damping_comes_back(void **unused) {
  (void)unused;
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    sonde_model *truth = fixture_model(4, NULL), *model = fixture_model(4, NULL);
    sonde_preset preset = sonde_preset_default();
    preset.normal_damping_s = seed == 1 ? 0.05 : 0.012;
    preset.stiffness_scale = 1.2;
    assert_int_equal(sonde_preset_apply(&preset, truth, NULL, NULL), SONDE_OK);
    sonde_protocol p = sonde_protocol_default(SONDE_PROTOCOL_RAMP_HOLD);
    p.depth_m = 6e-3;
    p.speed_m_s[0] = 0.08;
    p.speed_count = 1;
    sonde_motion_record record = make(truth, NULL, p, seed);
    sonde_damping_result found;
    sonde_error error = {0};
    assert_ok(sonde_identify_damping(model, &record, 1, NULL, NULL, &found, &error), &error);
    const sonde_estimate *tau = &found.normal_damping_s;
    assert_near(tau->value, preset.normal_damping_s, 0.1 * preset.normal_damping_s);
    assert_near(found.stiffness_scale.value, 1.2, 0.012);
    assert_true(tau->identified && tau->low < tau->value && tau->value < tau->high);
    assert_near(found.residual_n, 0.05, 0.01); // the noise and no more
    // The sphere's springs between nodes are too soft for their dampers to be felt.
    assert_false(found.edge_damping_s.identified);
    assert_near(found.edge_damping_s.value, model->law.edge_damping_s, 1e-12);
    sonde_motion_record_clear(&record);
    sonde_model_destroy(truth);
    sonde_model_destroy(model);
  }
}

static void friction_comes_back(void **unused) {
  (void)unused;
  const sonde_friction truth[2] = {{0.3, 0.2, 0.03, 0, 0.05}, {0.15, 0.15, 0.01, 0, 0.05}};
  for (int k = SAMPLES(0, 1); k < 2; ++k) {
    sonde_model *model = fixture_model(3, NULL);
    sonde_world_def def = sonde_identify_world();
    def.friction = truth[k];
    sonde_protocol p = sonde_protocol_default(SONDE_PROTOCOL_SLIDE);
    p.depth_m = 6e-3; // deeper, the skin piles up before the ends of the probe
    p.slide_m = 6e-3;
    p.hold_s = 0.05;
    p.speed_m_s[0] = 0.01;
    p.speed_m_s[1] = 0.02;
    p.speed_m_s[2] = 0.06;
    p.speed_count = 3;
    sonde_motion_record record = make(model, &def, p, 5);
    sonde_friction_result found;
    sonde_error error = {0};
    assert_ok(sonde_identify_friction(model, &record, 1, NULL, NULL, &found, &error), &error);
    assert_near(found.mu_kinetic.value, truth[k].mu_kinetic, 0.05 * truth[k].mu_kinetic);
    // Without a fall from mu_s to mu_k the rise towards rest is a guess.
    assert_near(found.mu_static.value, truth[k].mu_static, (k ? 0.1 : 0.05) * truth[k].mu_static);
    assert_true(found.mu_kinetic.identified);
    sonde_motion_record_clear(&record);
    sonde_model_destroy(model);
  }
}

static bool refuse(double fraction, const char *what, void *user) {
  (void)fraction, (void)what, (void)user;
  return false;
}

static void work_can_be_cancelled(void **unused) {
  (void)unused;
  sonde_model *model = fixture_model(4, NULL);
  sonde_protocol p = sonde_protocol_default(SONDE_PROTOCOL_RAMP_HOLD);
  p.depth_m = 4e-3;
  sonde_motion_record record = make(model, NULL, p, 1), none;
  const sonde_progress no = {refuse, NULL};
  sonde_damping_result found;
  assert_int_equal(sonde_identify_damping(model, &record, 1, NULL, &no, &found, NULL),
                   SONDE_CANCELLED);
  assert_int_equal(sonde_protocol_run(model, NULL, &p, &no, &none, NULL), SONDE_CANCELLED);
  assert_null(none.samples);
  sonde_motion_record_clear(&record);
  sonde_model_destroy(model);
}

// The push at the end of a long hold is that of the settled probe.
// What a single simulation of a long record reports; stops at the first share within it, or behind
// its end.
static bool stop_within(double fraction, const char *what, void *user) {
  bool *seen = user, first = strstr(what, "first simulation") != NULL;
  *seen |= first && fraction > 0 && fraction < 1;
  return first && !*seen;
}

static void one_simulation_tells_its_share(void **unused) {
  (void)unused;
  sonde_model *model = fixture_model(4, NULL);
  sonde_protocol p = sonde_protocol_default(SONDE_PROTOCOL_RAMP_HOLD);
  p.depth_m = 2e-3;
  p.speed_m_s[0] = 0.08;
  p.speed_count = 1;
  p.hold_s = 10; // far longer than a report takes
  p.rate_hz = 100;
  sonde_motion_record record = make(model, NULL, p, 1);
  sonde_damping_result found;
  sonde_error error = {0};
  bool seen = false;
  sonde_progress progress = {stop_within, &seen};
  assert_int_equal(sonde_identify_damping(model, &record, 1, NULL, &progress, &found, &error),
                   SONDE_CANCELLED);
  assert_true(seen);
  sonde_motion_record_clear(&record);
  sonde_model_destroy(model);
}

static void presses_to_the_force_asked_for(void **unused) {
  (void)unused;
  sonde_model *model = fixture_model(4, NULL);
  sonde_protocol p = sonde_protocol_default(SONDE_PROTOCOL_RAMP_HOLD);
  p.force_n = 2;
  p.hold_s = 0.5;
  p.speed_count = 1;
  sonde_motion_record record = make(model, NULL, p, 1);
  sonde_relaxation hold[SONDE_HOLDS];
  uint32_t count;
  assert_int_equal(sonde_relaxation_read(&record, hold, &count, NULL), SONDE_OK);
  assert_near(hold->static_n, 2, 0.06);
  p.site = 5;
  sonde_error error = {0};
  sonde_motion_record none;
  assert_int_equal(sonde_protocol_run(model, NULL, &p, NULL, &none, &error), SONDE_NOT_FOUND);
  assert_says(&error, "no site 5");
  sonde_motion_record_clear(&record);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(damping_comes_back), cmocka_unit_test(friction_comes_back),
      cmocka_unit_test(work_can_be_cancelled), cmocka_unit_test(one_simulation_tells_its_share),
      cmocka_unit_test(presses_to_the_force_asked_for)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
