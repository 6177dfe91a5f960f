// Both gates in a row under injected faults, and the limits that heat, speed and impulse set.
#include "test.h"

#include "base/random.h"
#include "sonde/haptics_devices.h"
#include "sonde/haptics_render.h"

static const double dt_s = 1e-3;

enum { FAULTS = 1500, NOTHING = 0, STALL, NOT_A_POSE, JUMP, UNPLUG, HUGE_FORCE, TORN, KINDS };

// A simulation before a device: the session's order of calls, then the mailbox, then the gate.
typedef struct chain {
  sonde_safety safety;
  sonde_render render;
  sonde_gate gate;
  double tissue_n;
  uint64_t silent, seed; // ticks since the last command; random stream
  double worst_n, worst_slew_n, worst_late_n;
} chain;

static double draw(chain *c) { return sonde_random_uniform(7, c->seed++); }

static void simulate(chain *c, int fault, double z) {
  sonde_vec3 at = vec3(0, 0, z);
  if (fault == JUMP) at.x = 0.02 + 0.1 * draw(c);
  if (fault == UNPLUG) sonde_safety_trip(&c->safety, SONDE_FAULT_DEVICE_LOST);
  if (fault == NOT_A_POSE) { // what a session does with it: absent, at the last place
    sonde_safety_trip(&c->safety, SONDE_FAULT_DEVICE_LOST);
    at = c->render.device_m;
  }
  sonde_safety_motion(&c->safety, at, dt_s);
  sonde_vec3 tissue = vec3(0, 0, fmax(0.0, -1000.0 * c->render.probe_m.z));
  if (fault == HUGE_FORCE) tissue.y = draw(c) < 0.5 ? 1e9 : (double)NAN;
  sonde_vec3 fed = v_finite(tissue) && v_norm(tissue) < 1e6 ? tissue : vec3(0, 0, 0);
  sonde_render_probe(&c->render, (sonde_pose){at, quat_identity()}, fed, c->safety.force_n);
  sonde_vec3 wanted = fault == HUGE_FORCE ? tissue : c->render.force_n;
  sonde_safety_apply(&c->safety, wanted, vec3(0, 0, 0), dt_s);
}

// One millisecond of the device, with or without a command.
static void exchange(chain *c, bool fresh, int fault) {
  sonde_vec3 before = c->gate.force_n, sent = c->safety.force_n;
  if (fault == TORN) sent.y = (double)NAN; // a command that arrives in pieces
  sonde_gate_apply(&c->gate, fresh, sent, vec3(0, 0, 0), dt_s);
  c->silent = fresh && fault != TORN ? 0 : c->silent + 1;
  c->worst_n = fmax(c->worst_n, v_norm(c->gate.force_n));
  c->worst_slew_n = fmax(c->worst_slew_n, v_distance(c->gate.force_n, before));
  if (c->silent > 50) c->worst_late_n = fmax(c->worst_late_n, v_norm(c->gate.force_n));
}

static void faults_never_pass(void **state) {
  (void)state;
  static const char *const names[] = {"touch", "premium_1.5", "omega.3"};
  for (size_t d = 0; d < 3; ++d) {
    const sonde_device_limits *limits = sonde_device_limits_find(names[d]);
    sonde_safety_limits bounds = sonde_safety_limits_of(limits);
    sonde_render_def def = sonde_render_def_for(limits, dt_s, 0.0);
    chain c = {.seed = 1000 * d};
    sonde_safety_init(&c.safety, &bounds);
    sonde_gate_init(&c.gate, &bounds);
    sonde_render_init(&c.render, &def);
    int injected = 0, resumed = 0;
    for (uint64_t tick = 0; injected < FAULTS; ++tick) {
      int fault = draw(&c) < 0.02 ? 1 + (int)(draw(&c) * (KINDS - 1)) : NOTHING;
      injected += fault != NOTHING;
      if (fault == STALL) {
        int gap = 1 + (int)(200 * draw(&c));
        for (int i = 0; i < gap; ++i) exchange(&c, false, NOTHING);
        if (gap * dt_s > bounds.stale_s) sonde_safety_trip(&c.safety, SONDE_FAULT_STALE);
      }
      simulate(&c, fault, -0.01 + 0.005 * sin(0.01 * (double)tick));
      exchange(&c, true, fault);
      if (c.safety.fault == SONDE_FAULT_NONE || draw(&c) > 0.05) continue;
      sonde_safety_resume(&c.safety);
      resumed++;
    }
    assert_true(resumed > 100);
    assert_true(c.worst_n > 0.1 * bounds.force_n); // there was something to cut
    assert_true(c.worst_n <= bounds.force_n * (1 + 1e-12));
    assert_true(c.worst_n <= limits->force_peak_n);
    assert_true(c.worst_slew_n <= bounds.slew_n_s * dt_s * (1 + 1e-9));
    assert_true(c.worst_late_n <= 0.0);
    sonde_safety_resume(&c.safety);
    for (int i = 0; i < 300; ++i) {
      simulate(&c, NOTHING, -0.01);
      exchange(&c, true, NOTHING);
    }
    assert_int_equal(c.safety.fault, SONDE_FAULT_NONE);
    assert_true(c.gate.force_n.z > 0.2);
  }
}

static void silence_fades_within_50_ms(void **state) {
  (void)state;
  sonde_gate gate;
  sonde_gate_init(&gate, NULL);
  for (int i = 0; i < 100; ++i) sonde_gate_apply(&gate, true, vec3(0, 0, 40), vec3(0, 1, 0), dt_s);
  assert_true(fabs(gate.force_n.z - 40) < 1e-9 && fabs(gate.torque_n_m.y - 1) < 1e-9);
  double last = 40;
  for (int i = 1; i <= 50; ++i) {
    sonde_gate_apply(&gate, false, vec3(0, 0, 40), vec3(0, 0, 0), dt_s);
    assert_true(gate.force_n.z <= last + 1e-12);
    if (i <= 14) assert_true(fabs(gate.force_n.z - 40) < 1e-9); // a late tick is not felt
    last = gate.force_n.z;
  }
  assert_true(v_norm(gate.force_n) <= 0.0 && v_norm(gate.torque_n_m) <= 0.0);
  sonde_gate_apply(&gate, true, vec3(0, 0, 40), vec3(0, 0, 0), dt_s);
  assert_true(gate.force_n.z > 0 && gate.force_n.z <= 2.0 + 1e-9); // back at the slew limit
}

static sonde_safety hot(double continuous_n, double wanted_n, double seconds) {
  sonde_safety_limits limits = sonde_safety_limits_default();
  limits.force_n = 3.0;
  limits.continuous_n = continuous_n;
  limits.thermal_s = 2.0;
  sonde_safety safety;
  sonde_safety_init(&safety, &limits);
  double before = 0.0;
  for (int i = 0; i < (int)(seconds / dt_s); ++i) {
    sonde_safety_apply(&safety, vec3(0, 0, wanted_n), vec3(0, 0, 0), dt_s);
    assert_true(fabs(safety.force_n.z - before) <= limits.slew_n_s * dt_s * (1 + 1e-9));
    before = safety.force_n.z;
  }
  return safety;
}

// Peak for a moment, the continuous force for ever; a force below it is left alone.
static void motors_stay_cool(void **state) {
  (void)state;
  assert_true(fabs(hot(0.9, 3.0, 0.15).force_n.z - 3.0) < 1e-9);
  assert_true(hot(0.9, 3.0, 0.5).force_n.z < 2.0); // heat 1 after 2 s ln(11.1/10.1)
  sonde_safety safety = hot(0.9, 3.0, 30.0);
  assert_true(safety.force_n.z < 1.05 * 0.9 && safety.force_n.z > 0.95 * 0.9);
  assert_true(safety.heat <= 1.0 + 1e-3);
  assert_true(fabs(hot(0.9, 0.7, 30.0).force_n.z - 0.7) < 1e-9);
  assert_true(fabs(hot(0.0, 3.0, 30.0).force_n.z - 3.0) < 1e-9); // no such limit
}

static void fast_devices_trip(void **state) {
  (void)state;
  sonde_safety_limits limits = sonde_safety_limits_default();
  limits.velocity_m_s = 1.0;
  sonde_safety safety;
  sonde_safety_init(&safety, &limits);
  for (int i = 0; i < 100; ++i) sonde_safety_motion(&safety, vec3(0.9e-3 * i, 0, 0), dt_s);
  assert_int_equal(safety.fault, SONDE_FAULT_NONE);
  sonde_safety_motion(&safety, vec3(0.2, 0, 0), dt_s);
  assert_int_equal(safety.fault, SONDE_FAULT_VELOCITY);
  sonde_safety_resume(&safety);
  sonde_safety_motion(&safety, vec3(0.5, 0, 0), dt_s); // where it went meanwhile is no motion
  assert_int_equal(safety.fault, SONDE_FAULT_NONE);
}

// A force that carries the hand off trips; one that the hand works against does not.
static void pushing_away_trips(void **state) {
  (void)state;
  for (int with = 0; with <= 1; ++with) {
    sonde_safety_limits limits = sonde_safety_limits_default();
    limits.impulse_n_s = 0.5;
    sonde_safety safety;
    sonde_safety_init(&safety, &limits);
    for (int i = 0; i < 400; ++i) {
      sonde_safety_motion(&safety, vec3(0, 0, (with ? 1e-4 : -1e-4) * i), dt_s);
      sonde_safety_apply(&safety, vec3(0, 0, 8), vec3(0, 0, 0), dt_s);
    }
    assert_int_equal(safety.fault, with ? SONDE_FAULT_IMPULSE : SONDE_FAULT_NONE);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(faults_never_pass),  cmocka_unit_test(silence_fades_within_50_ms),
      cmocka_unit_test(motors_stay_cool),   cmocka_unit_test(fast_devices_trip),
      cmocka_unit_test(pushing_away_trips),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
