// The simulated operator against the laws of its arm.
#include "test.h"

#include "sonde/haptics_hand.h"
#include "haptics/devices/hand.h"

static const double dt_s = 1e-3;

static sonde_device hand_with(sonde_hand_def def, double goal_z) {
  const sonde_script_key keys[] = {{0.0, pose_at(0, 0, 0)}, {1e-4, pose_at(0, 0, goal_z)}};
  sonde_device device;
  assert_int_equal(sonde_device_hand(&def, keys, 2, dt_s, &device, NULL), SONDE_OK);
  return device;
}

static sonde_hand_def still(double mass, double damping, double stiffness) {
  sonde_hand_def def = sonde_hand_def_default();
  def.mass_kg = mass;
  def.damping_n_s_m = damping;
  def.stiffness_n_m = stiffness;
  def.delay_s = def.tremor_m = 0.0;
  return def;
}

// A free mass under a constant force: x = f t^2 / 2m, v = f t / m.
static void free_mass_falls(void **state) {
  (void)state;
  sonde_device device = hand_with(still(2.0, 0.0, 0.0), 0.0);
  sonde_device_sample s;
  sonde_vec3 v;
  for (uint64_t tick = 0; tick <= 500; ++tick) {
    device.read(device.self, tick, &s);
    device.write(device.self, vec3(0.4, 0, 0), vec3(0, 0, 0));
  }
  sonde_vec3 x = sonde_hand_position(&device, &v);
  assert_true(fabs(x.x - 0.4 * 0.25 / 4) < 1e-12 && fabs(v.x - 0.1) < 1e-12);
  device.destroy(device.self);
}

// An undamped arm neither gains nor loses energy, and swings with sqrt(k/m).
static void undamped_arm_keeps_its_energy(void **state) {
  (void)state;
  sonde_device device = hand_with(still(0.1, 0.0, 4000.0), -0.01);
  sonde_device_sample s;
  double energy = 0.5 * 4000 * 1e-4, w = sqrt(4000 / 0.1);
  for (uint64_t tick = 0; tick < 20000; ++tick) {
    device.read(device.self, tick, &s);
    if (tick == 0) continue;
    double t = (double)(tick - 1) * dt_s; // the goal jumps after tick 0
    assert_true(fabs(sonde_hand_energy(&device) / energy - 1) < 1e-9);
    assert_true(fabs(s.world_from_probe.position.z + 0.01 * (1 - cos(w * t))) < 1e-9);
  }
  device.destroy(device.self);
}

// At rest the force equals the stretch of the arm.
static void force_stretches_the_arm(void **state) {
  (void)state;
  sonde_device device = hand_with(still(0.5, 30.0, 400.0), -0.03);
  sonde_device_sample s;
  for (uint64_t tick = 0; tick < 5000; ++tick) {
    device.read(device.self, tick, &s);
    device.write(device.self, vec3(0, 0, 6), vec3(0, 0, 0));
  }
  assert_true(fabs(s.world_from_probe.position.z + 0.03 - 6.0 / 400) < 1e-9);
  device.destroy(device.self);
}

static void reaction_is_late(void **state) {
  (void)state;
  sonde_hand_def def = still(0.5, 30.0, 400.0);
  def.delay_s = 0.2;
  sonde_device device = hand_with(def, -0.03);
  sonde_device_sample s;
  for (uint64_t tick = 0; tick < 400; ++tick) {
    device.read(device.self, tick, &s);
    if (tick <= 201) assert_true(fabs(s.world_from_probe.position.z) < 1e-15);
  }
  assert_true(s.world_from_probe.position.z < -0.005);
  device.destroy(device.self);
}

// Tremor: bounded by its amplitude through a stiff arm, different by seed, equal for the same seed.
static void tremor_repeats_by_seed(void **state) {
  (void)state;
  sonde_vec3 end[3];
  double largest = 0.0;
  for (int run = 0; run < 3; ++run) {
    sonde_hand_def def = still(0.1, 20.0, 4000.0);
    def.tremor_m = 1e-4;
    def.seed = run == 2 ? 9 : 4;
    sonde_device device = hand_with(def, 0.0);
    sonde_device_sample s;
    for (uint64_t tick = 0; tick < 1000; ++tick) {
      device.read(device.self, tick, &s);
      largest = fmax(largest, fabs(s.world_from_probe.position.y));
    }
    end[run] = s.world_from_probe.position;
    device.destroy(device.self);
  }
  assert_memory_equal(&end[0], &end[1], sizeof end[0]);
  assert_true(v_distance(end[0], end[2]) > 1e-7);
  assert_true(largest > 3e-5 && largest < 2e-4);
}

static void report_is_rounded_and_force_limited(void **state) {
  (void)state;
  sonde_hand_def def = still(0.5, 30.0, 400.0);
  def.resolution_m = 55e-6;
  def.force_limit_n = 3.3;
  sonde_device device = hand_with(def, -0.03);
  sonde_device_sample s;
  for (uint64_t tick = 0; tick < 4000; ++tick) {
    device.read(device.self, tick, &s);
    double steps = s.world_from_probe.position.z / 55e-6;
    assert_true(fabs(steps - round(steps)) < 1e-6);
    device.write(device.self, vec3(0, 0, 100), vec3(0, 0, 0));
  }
  assert_true(fabs(sonde_hand_position(&device, NULL).z + 0.03 - 3.3 / 400) < 1e-9);
  device.destroy(device.self);
}

static void bad_definitions_are_named(void **state) {
  (void)state;
  sonde_hand_def def = sonde_hand_def_default();
  const sonde_script_key key = {0.0, pose_at(0, 0, 0)};
  sonde_device device;
  sonde_error error;
  def.mass_kg = 0.0;
  assert_int_equal(sonde_device_hand(&def, &key, 1, dt_s, &device, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "mass_kg"));
  def.mass_kg = 1.0;
  def.tremor_hz = (double)NAN;
  assert_int_equal(sonde_device_hand(&def, &key, 1, dt_s, &device, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "tremor_hz"));
  def = sonde_hand_def_default();
  assert_int_equal(sonde_device_hand(&def, &key, 0, dt_s, &device, &error), SONDE_ARGUMENT);
  uint32_t count = 0;
  const sonde_hand_preset *preset = sonde_hand_presets(&count);
  for (uint32_t i = 0; i < count; ++i) {
    assert_true(preset[i].mass_kg >= 0.1 && preset[i].mass_kg <= 2.0);
    assert_true(preset[i].damping_n_s_m >= 0.0 && preset[i].damping_n_s_m <= 5.0);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(free_mass_falls),
      cmocka_unit_test(undamped_arm_keeps_its_energy),
      cmocka_unit_test(force_stretches_the_arm),
      cmocka_unit_test(reaction_is_late),
      cmocka_unit_test(tremor_repeats_by_seed),
      cmocka_unit_test(report_is_rounded_and_force_limited),
      cmocka_unit_test(bad_definitions_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
