// Friction of the probe on the skin: Coulomb's bound, static hold, no work out of a closed way.
#include "identify_test.h"

static sonde_motion_record slide(double mu_static, double mu_kinetic, uint32_t newton) {
  sonde_model *model = fixture_model(4, NULL);
  sonde_world_def def = sonde_identify_world();
  def.newton_iterations = newton;
  def.friction.mu_static = mu_static;
  def.friction.mu_kinetic = mu_kinetic;
  sonde_protocol p = sonde_protocol_default(SONDE_PROTOCOL_SLIDE);
  p.site = 0;
  p.depth_m = 8e-3;
  p.slide_m = 12e-3;
  p.speed_m_s[0] = 0.03;
  p.speed_count = 1;
  p.hold_s = 0.4;
  sonde_motion_record record;
  sonde_error error = {0};
  assert_ok(sonde_protocol_run(model, &def, &p, NULL, &record, &error), &error);
  sonde_model_destroy(model);
  return record;
}

// The probe comes from 1 mm above at 50 mm/s after 0.1 s, rests 0.4 s and slides for 0.4 s: from
// 0.6 s to 1.0 s.
static const double STOP_S = 1.0, BACK_S = 1.4;

static const sonde_motion_sample *at(const sonde_motion_record *r, double t) {
  return &r->samples[(uint32_t)(t * 1000 + 0.5)];
}

static void slides_at_the_coefficient(void **unused) {
  (void)unused;
  for (uint32_t newton = 2; newton <= 5; newton += 3) {
    sonde_motion_record with = slide(0.2, 0.2, newton), without = slide(0, 0, newton);
    const sonde_motion_sample *a = at(&with, STOP_S - 0.01), *b = at(&without, STOP_S - 0.01);
    assert_true(a->normal_n > 0.5);
    // What is left without friction is the skin in front of the probe's side.
    assert_near((a->tangential_n - b->tangential_n) / a->normal_n, 0.2, 0.01);
    sonde_motion_record_clear(&with);
    sonde_motion_record_clear(&without);
  }
}

static void holds_while_standing(void **unused) {
  (void)unused;
  sonde_motion_record with = slide(0.2, 0.2, 5), without = slide(0, 0, 5);
  const sonde_motion_sample *early = at(&with, STOP_S + 0.1), *late = at(&with, BACK_S - 0.01);
  assert_true(early->tangential_n > 0.1 * early->normal_n);
  assert_near(late->tangential_n, early->tangential_n, 0.02 * early->tangential_n);
  assert_true(fabs(at(&without, BACK_S - 0.01)->tangential_n) < 0.05 * late->normal_n);
  sonde_motion_record_clear(&with);
  sonde_motion_record_clear(&without);
}

// The probe ends where it began: friction has taken work and given none.
static void a_closed_way_costs_work(void **unused) {
  (void)unused;
  double work[3];
  const double mu[3] = {0, 0.1, 0.2};
  for (int k = 0; k < 3; ++k) {
    sonde_motion_record r = slide(mu[k], mu[k], 5);
    work[k] = 0;
    for (uint32_t i = 1; i < r.count; ++i) {
      double way = r.samples[i].slide_m - r.samples[i - 1].slide_m;
      work[k] += way * r.samples[i].tangential_n;
    }
    sonde_motion_record_clear(&r);
  }
  assert_true(work[0] > -1e-4 && work[1] > work[0] && work[2] > work[1]);
}

static void the_coefficient_has_its_limits(void **unused) {
  (void)unused;
  sonde_friction f = {0.5, 0.3, 0.01, 0, 0.05};
  assert_near(sonde_friction_coefficient(&f, 0), 0.5, 1e-15);
  assert_near(sonde_friction_coefficient(&f, 1), 0.3, 1e-15);
  double last = 1;
  for (double film = 0; film <= 4; film += 0.5) {
    f.gel_film = film;
    double mu = sonde_friction_coefficient(&f, 0.005);
    assert_true(mu < last && mu > f.mu_gel);
    last = mu;
  }
  f.gel_film = 50;
  assert_near(sonde_friction_coefficient(&f, 0), 0.05, 1e-12);
  f.mu_static = 0;
  assert_near(sonde_friction_coefficient(&f, 0), 0, 0);
}

static void friction_can_change_between_steps(void **unused) {
  (void)unused;
  sonde_model *model = fixture_model(4, NULL);
  sonde_state *state;
  sonde_probe probe;
  sonde_error error = {0};
  assert_int_equal(sonde_state_create(model, NULL, &state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create("square", &probe, NULL), SONDE_OK);
  sonde_friction f = {0.3, 0.3, 0.01, 0, 0.05};
  double across[2];
  for (int k = 0; k < 600; ++k) {
    if (k == 300) assert_ok(sonde_state_set_friction(state, &f, &error), &error);
    sonde_pose pose = fixture_pose(fmin(4e-3, 4e-5 * k - 1e-3));
    pose.position.y = k < 300 ? 0 : 1e-5 * (k - 300);
    sonde_step(state, &probe, pose);
    across[k / 300] = -sonde_state_contact(state)->force_n.y;
  }
  assert_true(fabs(across[0]) < 0.02 && across[1] > 0.1);
  f.mu_kinetic = 0.4;
  assert_int_equal(sonde_state_set_friction(state, &f, &error), SONDE_ARGUMENT);
  assert_says(&error, "friction.mu_kinetic is 0.4, expected 0 to 0.3");
  sonde_probe_clear(&probe);
  sonde_state_destroy(state);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(slides_at_the_coefficient), cmocka_unit_test(holds_while_standing),
      cmocka_unit_test(a_closed_way_costs_work), cmocka_unit_test(the_coefficient_has_its_limits),
      cmocka_unit_test(friction_can_change_between_steps)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
