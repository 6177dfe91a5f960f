// The safety limiter under fault injection: whatever it is fed, no tick breaks a limit.
#include "test.h"

#include "sonde/haptics.h"

static const double dt_s = 1e-3;

// One tick, checked against the limits that hold always.
static void apply(sonde_safety *safety, sonde_vec3 force, sonde_vec3 torque) {
  sonde_vec3 before = safety->force_n, turn = safety->torque_n_m;
  sonde_safety_apply(safety, force, torque, dt_s);
  const sonde_safety_limits *limits = &safety->limits;
  double slew_n = limits->slew_n_s * dt_s, share = limits->torque_n_m / limits->force_n;
  assert_true(v_finite(safety->force_n) && v_finite(safety->torque_n_m));
  assert_true(v_norm(safety->force_n) <= limits->force_n * (1 + 1e-12));
  assert_true(v_norm(safety->torque_n_m) <= limits->torque_n_m * (1 + 1e-12));
  assert_true(v_distance(safety->force_n, before) <= slew_n * (1 + 1e-9));
  assert_true(v_distance(safety->torque_n_m, turn) <= slew_n * share * (1 + 1e-9));
  assert_true(safety->gain >= 0.0 && safety->gain <= 1.0);
}

static sonde_safety warm(sonde_vec3 force) {
  sonde_safety safety;
  sonde_safety_init(&safety, NULL);
  for (int i = 0; i < 200; ++i) apply(&safety, force, vec3(0, 0, 0.1));
  return safety;
}

static void faults_have_sentences(void **state) {
  (void)state;
  for (int i = 0; i < SONDE_FAULT_COUNT; ++i)
    assert_true(strlen(sonde_fault_text((sonde_fault)i)) > 5);
  assert_non_null(sonde_fault_text((sonde_fault)99));
}

static void small_force_passes_unchanged(void **state) {
  (void)state;
  sonde_safety safety = warm(vec3(3, -4, 12));
  assert_true(v_distance(safety.force_n, vec3(3, -4, 12)) < 1e-12);
  assert_true(v_distance(safety.torque_n_m, vec3(0, 0, 0.1)) < 1e-12);
  uint64_t before = safety.limited_ticks;
  apply(&safety, vec3(3, -4, 12.5), vec3(0, 0, 0.1));
  assert_true(v_distance(safety.force_n, vec3(3, -4, 12.5)) < 1e-12);
  assert_int_equal(safety.limited_ticks, before);
}

static void large_force_keeps_its_direction(void **state) {
  (void)state;
  sonde_safety safety = warm(vec3(300, -400, 0));
  assert_true(v_distance(safety.force_n, vec3(24, -32, 0)) < 1e-9);
  assert_true(safety.limited_ticks > 0);
  for (int i = 0; i < 100; ++i) apply(&safety, vec3(1e200, 0, 0), vec3(0, 0, 1e200));
  assert_true(v_distance(safety.force_n, vec3(40, 0, 0)) < 1e-9);
  assert_true(v_distance(safety.torque_n_m, vec3(0, 0, 2)) < 1e-9);
}

static void start_is_soft(void **state) {
  (void)state;
  sonde_safety safety;
  sonde_safety_init(&safety, NULL);
  double last = 0.0;
  for (int i = 0; i < 100; ++i) {
    apply(&safety, vec3(0, 0, 20), vec3(0, 0, 0));
    double share = (i + 1) * dt_s / safety.limits.soft_start_s;
    assert_true(safety.force_n.z <= 20 * share + 1e-9 && safety.force_n.z >= last);
    last = safety.force_n.z;
  }
  assert_true(fabs(last - 20) < 1e-6);
}

static void fade_ends_in_time_and_is_latched(void **state) {
  (void)state;
  for (int fault = SONDE_FAULT_NON_FINITE; fault < SONDE_FAULT_COUNT; ++fault) {
    sonde_safety safety = warm(vec3(100, 0, 0)); // at the limit: the hardest fade
    sonde_safety_trip(&safety, (sonde_fault)fault);
    sonde_safety_trip(&safety, SONDE_FAULT_STOPPED); // the first one stays
    for (int i = 0; i < 20; ++i) apply(&safety, vec3(100, 0, 0), vec3(0, 0, 0.1));
    assert_int_equal(safety.fault, fault);
    assert_true(v_norm(safety.force_n) <= 0.0 && v_norm(safety.torque_n_m) <= 0.0);
    for (int i = 0; i < 500; ++i) apply(&safety, vec3(10, 0, 0), vec3(0, 0, 0));
    assert_true(v_norm(safety.force_n) <= 0.0);
    sonde_safety_resume(&safety);
    apply(&safety, vec3(10, 0, 0), vec3(0, 0, 0));
    assert_int_equal(safety.fault, SONDE_FAULT_NONE);
    assert_true(safety.force_n.x > 0 && safety.force_n.x < 0.2); // softly
    for (int i = 0; i < 200; ++i) apply(&safety, vec3(10, 0, 0), vec3(0, 0, 0));
    assert_true(fabs(safety.force_n.x - 10) < 1e-9);
  }
}

static void not_a_number_trips(void **state) {
  (void)state;
  const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
  for (size_t i = 0; i < SONDE_COUNT_OF(bad); ++i) {
    sonde_safety safety = warm(vec3(0, 7, 0)), twin = safety;
    apply(&safety, vec3(0, bad[i], 0), vec3(0, 0, 0));
    apply(&twin, vec3(0, 7, 0), vec3(bad[i], 0, 0));
    assert_int_equal(safety.fault, SONDE_FAULT_NON_FINITE);
    assert_int_equal(twin.fault, SONDE_FAULT_NON_FINITE);
    assert_true(safety.force_n.y < 7 && safety.force_n.y > 0); // fades from what was felt
  }
}

// Random forces over many magnitudes with faults, resumes and NaN in between.
static void injection_never_breaks_a_limit(void **state) {
  (void)state;
  sonde_safety safety;
  sonde_safety_init(&safety, NULL);
  unsigned seed = 12345;
  for (int i = 0; i < 200000; ++i) {
    double r[6];
    for (int k = 0; k < 6; ++k) r[k] = 2.0 * rand_r(&seed) / RAND_MAX - 1.0;
    double size = pow(10.0, 6.0 * r[3]);
    sonde_vec3 force = vec3(size * r[0], size * r[1], size * r[2]);
    int event = rand_r(&seed) % 1000;
    if (event == 0) force.x = (double)NAN;
    if (event == 1) sonde_safety_trip(&safety, SONDE_FAULT_DEVICE_LOST);
    if (event == 2) sonde_safety_trip(&safety, SONDE_FAULT_STALE);
    if (event >= 990) sonde_safety_resume(&safety);
    apply(&safety, force, vec3(r[4] * size, r[5], 0));
  }
}

static void bad_limits_become_defaults(void **state) {
  (void)state;
  sonde_safety_limits limits = sonde_safety_limits_default(), d = limits;
  limits.force_n = (double)NAN;
  limits.slew_n_s = -1;
  limits.fade_s = 0.01;
  sonde_safety safety;
  sonde_safety_init(&safety, &limits);
  assert_true(fabs(safety.limits.force_n - d.force_n) < 1e-12);
  assert_true(fabs(safety.limits.slew_n_s - d.slew_n_s) < 1e-12);
  assert_true(fabs(safety.limits.fade_s - 0.01) < 1e-12);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(faults_have_sentences),
      cmocka_unit_test(small_force_passes_unchanged),
      cmocka_unit_test(large_force_keeps_its_direction),
      cmocka_unit_test(start_is_soft),
      cmocka_unit_test(fade_ends_in_time_and_is_latched),
      cmocka_unit_test(not_a_number_trips),
      cmocka_unit_test(injection_never_breaks_a_limit),
      cmocka_unit_test(bad_limits_become_defaults),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
