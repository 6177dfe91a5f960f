// Devices: smooth, bounded, finite, and faithful to what they were given.
#include "test.h"

#include "haptics/motion.h"
#include "sonde/haptics_devices.h"

#include <pthread.h>

static const double dt_s = 1e-3;

static sonde_device_sample read_at(sonde_device *device, uint64_t tick) {
  sonde_device_sample sample;
  device->read(device->self, tick, &sample);
  return sample;
}

static void families_have_sentences(void **state) {
  (void)state;
  static const char *const expected[] = {"null", "hand", "script", "replay", "page"};
  sonde_device_info info[SONDE_COUNT_OF(expected)];
  assert_int_equal(sonde_devices_find(false, info, SONDE_COUNT_OF(expected)),
                   SONDE_COUNT_OF(expected));
  for (uint32_t i = 0; i < SONDE_COUNT_OF(expected); ++i) {
    assert_string_equal(info[i].name, expected[i]);
    assert_true(info[i].available);
    assert_true(strlen(info[i].reason) > 10 && strlen(info[i].description) > 10);
  }
}

static void null_stands_still(void **state) {
  (void)state;
  sonde_device device;
  sonde_pose pose = pose_at(0.1, -0.2, 0.3);
  assert_int_equal(sonde_device_null(pose, &device, NULL), SONDE_OK);
  assert_string_equal(device.name, "null");
  for (uint64_t tick = 0; tick < 3; ++tick) {
    sonde_device_sample s = read_at(&device, tick);
    assert_true(s.present);
    assert_memory_equal(&s.world_from_probe, &pose, sizeof pose);
  }
  device.write(device.self, vec3(1, 2, 3), vec3(0, 0, 0));
  device.destroy(device.self);
  sonde_error error;
  pose.position.y = (double)NAN;
  assert_int_equal(sonde_device_null(pose, &device, &error), SONDE_ARGUMENT);
  assert_null(device.self);
}

static void script_rejects_bad_keys(void **state) {
  (void)state;
  sonde_device device;
  sonde_error error;
  sonde_script_key keys[2] = {{0.0, pose_at(0, 0, 0)}, {0.0, pose_at(1, 0, 0)}};
  assert_int_equal(sonde_device_script(keys, 0, dt_s, &device, &error), SONDE_ARGUMENT);
  assert_int_equal(sonde_device_script(keys, 2, dt_s, &device, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "ascending"));
  keys[1].time_s = 1.0;
  keys[1].world_from_probe.rotation.w = (double)INFINITY;
  assert_int_equal(sonde_device_script(keys, 2, dt_s, &device, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "key 1"));
  assert_int_equal(sonde_device_script(keys, 1, 0.0, &device, &error), SONDE_ARGUMENT);
}

// Down 20 mm, hold, up again: exact at keys, monotone between them, at rest in the hold, no jump in
// velocity.
static void script_passes_keys_without_overshoot(void **state) {
  (void)state;
  sonde_pose down = pose_at(0, 0, -0.02);
  down.rotation = quat_about(vec3(0, 0, 1), 0.4);
  sonde_pose half = pose_at(0, 0, -0.012);
  const sonde_script_key keys[] = {
      {0.1, pose_at(0, 0, 0)}, {0.4, half}, {0.6, down}, {0.9, down}, {1.2, pose_at(0, 0, 0)}};
  sonde_device device;
  assert_int_equal(sonde_device_script(keys, SONDE_COUNT_OF(keys), dt_s, &device, NULL), SONDE_OK);
  double previous = 0.0, velocity = 0.0;
  for (uint64_t tick = 0; tick < 1400; ++tick) {
    double z = read_at(&device, tick).world_from_probe.position.z;
    assert_true(z <= 1e-15 && z >= -0.02 - 1e-15);
    if (tick > 100 && tick <= 600) assert_true(z <= previous + 1e-15);
    if (tick >= 600 && tick <= 900) assert_true(fabs(z + 0.02) < 1e-15);
    if (tick > 900 && tick <= 1200) assert_true(z >= previous - 1e-15);
    double v = tick ? (z - previous) / dt_s : 0.0;
    assert_true(fabs(v - velocity) < 2e-3); // < 2 m/s^2
    previous = z;
    velocity = v;
  }
  sonde_quat at_down = read_at(&device, 600).world_from_probe.rotation;
  assert_true(sonde_quat_angle(at_down, down.rotation) < 1e-12);
  assert_true(fabs(read_at(&device, 400).world_from_probe.position.z + 0.012) < 1e-15);
  // jumps back and far ahead are allowed: a replay may start anywhere
  assert_true(fabs(read_at(&device, 150).world_from_probe.position.z) < 0.012);
  assert_true(fabs(read_at(&device, 99999).world_from_probe.position.z) < 1e-15);
  device.destroy(device.self);
}

static void slerp_is_uniform_and_short(void **state) {
  (void)state;
  sonde_quat a = quat_about(vec3(1, 2, 3), 0.3), b = quat_about(vec3(-2, 1, 0.5), 1.9);
  double whole = sonde_quat_angle(a, b);
  sonde_quat minus_b = {-b.w, -b.x, -b.y, -b.z};
  for (int i = 0; i <= 8; ++i) {
    double t = i / 8.0;
    sonde_quat q = sonde_quat_slerp(a, b, t), r = sonde_quat_slerp(a, minus_b, t);
    assert_true(fabs(sonde_quat_angle(a, q) - t * whole) < 1e-12);
    assert_true(fabs(sonde_quat_angle(q, b) - (1 - t) * whole) < 1e-12);
    assert_true(sonde_quat_angle(q, r) < 1e-12);
  }
  assert_true(whole <= SONDE_PI);
  assert_true(sonde_quat_angle(sonde_quat_slerp(a, a, 0.5), a) < 1e-12);
}

static void replay_gives_back_its_samples(void **state) {
  (void)state;
  sonde_device_sample samples[5];
  for (int i = 0; i < 5; ++i)
    samples[i] = (sonde_device_sample){pose_at(i, 2 * i, 0.1 * i), (uint32_t)i, i != 3};
  sonde_device device;
  assert_int_equal(sonde_device_replay(samples, 5, &device, NULL), SONDE_OK);
  for (uint64_t tick = 0; tick < 5; ++tick) {
    sonde_device_sample s = read_at(&device, tick);
    assert_memory_equal(&s.world_from_probe, &samples[tick].world_from_probe, sizeof(sonde_pose));
    assert_int_equal(s.buttons, tick);
    assert_int_equal(s.present, tick != 3);
  }
  sonde_device_sample after = read_at(&device, 5);
  assert_false(after.present);
  assert_true(v_distance(after.world_from_probe.position, vec3(4, 8, 0.4)) < 1e-15);
  device.destroy(device.self);
  samples[2].world_from_probe.position.x = (double)NAN;
  assert_int_equal(sonde_device_replay(samples, 5, &device, NULL), SONDE_ARGUMENT);
  assert_int_equal(sonde_device_replay(samples, 0, &device, NULL), SONDE_ARGUMENT);
}

// A goal 150 mm and a half turn away, then others before it is reached: bounded speed, bounded
// acceleration (2 w/e times the speed, docs/haptics.md), no overshoot, arrival.
static void page_is_smooth_and_bounded(void **state) {
  (void)state;
  sonde_device device;
  assert_int_equal(sonde_device_page(pose_at(0, 0, 0), dt_s, &device, NULL), SONDE_OK);
  const double speed = 0.25, turn = 3.0, most = 2.0 * 80.0 / 2.718281828 * speed;
  sonde_pose goal = {vec3(0.15, 0, 0), quat_about(vec3(0, 1, 0), 3.0)};
  sonde_pose last = read_at(&device, 0).world_from_probe;
  sonde_vec3 velocity = vec3(0, 0, 0);
  double farthest = 0.0;
  for (uint64_t tick = 1; tick < 4000; ++tick) {
    if (tick == 1) sonde_device_page_goal(&device, goal);
    if (tick == 300) goal.position = vec3(0.02, 0.03, -0.01);
    if (tick == 300 || tick == 1500) sonde_device_page_goal(&device, goal);
    sonde_pose pose = read_at(&device, tick).world_from_probe;
    sonde_vec3 v = v_scale(v_sub(pose.position, last.position), 1.0 / dt_s);
    assert_true(v_norm(v) <= speed * (1.0 + 1e-9));
    assert_true(v_norm(v_sub(v, velocity)) / dt_s <= most * 1.001);
    assert_true(sonde_quat_angle(last.rotation, pose.rotation) <= turn * dt_s * (1.0 + 1e-6));
    farthest = fmax(farthest, pose.position.x);
    last = pose;
    velocity = v;
  }
  assert_true(farthest < 0.15 && farthest > 0.05);
  assert_true(v_distance(last.position, goal.position) < 1e-9);
  assert_true(sonde_quat_angle(last.rotation, goal.rotation) < 1e-6);
  device.destroy(device.self);
}

static void page_ignores_what_is_no_pose(void **state) {
  (void)state;
  sonde_device device, null;
  assert_int_equal(sonde_device_page(pose_at(0, 0, 0), dt_s, &device, NULL), SONDE_OK);
  sonde_device_page_goal(&device, pose_at(0.01, 0, 0));
  sonde_device_page_goal(&device, pose_at((double)NAN, 0, 0));
  sonde_device_page_goal(&device, pose_at(1e300, 0, 0)); // its speed would be no number
  sonde_device_page_goal(&device, (sonde_pose){vec3(1, 1, 1), {0, 0, 0, 0}});
  sonde_device_sample s = {0};
  for (uint64_t tick = 0; tick < 1000; ++tick) s = read_at(&device, tick);
  assert_true(v_distance(s.world_from_probe.position, vec3(0.01, 0, 0)) < 1e-9);
  device.destroy(device.self);
  assert_int_equal(sonde_device_null(pose_at(0, 0, 0), &null, NULL), SONDE_OK);
  sonde_device_page_goal(&null, pose_at(1, 0, 0)); // another family: nothing happens
  null.destroy(null.self);
}

static void *set_goals(void *argument) {
  for (int i = 0; i < 20000; ++i)
    sonde_device_page_goal(argument, pose_at(0.01 * sin(0.01 * i), 0, 0));
  return NULL;
}

static void page_goals_cross_threads(void **state) {
  (void)state;
  sonde_device device;
  assert_int_equal(sonde_device_page(pose_at(0, 0, 0), dt_s, &device, NULL), SONDE_OK);
  pthread_t thread;
  assert_int_equal(pthread_create(&thread, NULL, set_goals, &device), 0);
  for (uint64_t tick = 0; tick < 20000; ++tick)
    assert_true(fabs(read_at(&device, tick).world_from_probe.position.x) <= 0.01);
  pthread_join(thread, NULL);
  device.destroy(device.self);
}

// The n-th allocation fails, for all n: an error, and nothing leaks.
static size_t alive, left;
static void *failing(size_t bytes, void *user) {
  (void)user;
  if (left == 0) return NULL;
  left--;
  alive++;
  return malloc(bytes);
}
static void releasing(void *pointer, void *user) {
  (void)user;
  alive--;
  free(pointer);
}

static sonde_status create_family(int family, sonde_device *device) {
  const sonde_script_key key = {0.0, pose_at(0, 0, 0)};
  const sonde_device_sample sample = {pose_at(0, 0, 0), 0, true};
  if (family == 0) return sonde_device_null(pose_at(0, 0, 0), device, NULL);
  if (family == 1) return sonde_device_script(&key, 1, dt_s, device, NULL);
  if (family == 2) return sonde_device_replay(&sample, 1, device, NULL);
  return sonde_device_page(pose_at(0, 0, 0), dt_s, device, NULL);
}

static void creation_survives_lack_of_memory(void **state) {
  (void)state;
  sonde_set_allocator(&(sonde_allocator){failing, releasing, NULL});
  for (int family = 0; family < 4; ++family) {
    sonde_status status = SONDE_MEMORY;
    for (size_t n = 0; status && n < 10; ++n) {
      sonde_device device;
      left = n;
      status = create_family(family, &device);
      if (!status) device.destroy(device.self);
      assert_int_equal(alive, 0);
      assert_true(n > 0 || status == SONDE_MEMORY);
    }
    assert_int_equal(status, SONDE_OK);
  }
  sonde_set_allocator(NULL);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(families_have_sentences),
      cmocka_unit_test(null_stands_still),
      cmocka_unit_test(script_rejects_bad_keys),
      cmocka_unit_test(script_passes_keys_without_overshoot),
      cmocka_unit_test(slerp_is_uniform_and_short),
      cmocka_unit_test(replay_gives_back_its_samples),
      cmocka_unit_test(page_is_smooth_and_bounded),
      cmocka_unit_test(page_ignores_what_is_no_pose),
      cmocka_unit_test(page_goals_cross_threads),
      cmocka_unit_test(creation_survives_lack_of_memory),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
