// Every hardware driver against a fake vendor: start, exchange, error, unplug, restart.
#include "test.h"

#include "base/clock.h"
#include "mock_haply.h"
#include "sonde/haptics_devices.h"

#include <dlfcn.h>

typedef struct rig {
  sonde_device device;
  uint64_t tick;
  sonde_vec3 push_n;
  sonde_device_sample sample;
} rig;

static void tick(rig *r) {
  r->device.read(r->device.self, r->tick++, &r->sample);
  r->device.write(r->device.self, r->push_n, vec3(0, 0, 0));
  sonde_clock_sleep_until(sonde_clock_now() + 1e-3);
}

// Ticks until the device is present (or not), at most 10 s on a busy machine.
static bool wait_present(rig *r, bool present) {
  for (int i = 0; i < 10000; ++i) {
    tick(r);
    if (r->sample.present == present) return true;
  }
  return false;
}

static bool wait_force(rig *r, fake_control *fake_, int axis, double force_n) {
  for (int i = 0; i < 10000; ++i) {
    tick(r);
    if (fabs(fake_->force_n[axis] - force_n) < 0.01) return true;
  }
  return false;
}

// Ticks until the driver has exchanged so many times more, however the machine shares its cores.
static bool wait_exchanges(rig *r, uint64_t more) {
  uint64_t before = sonde_device_link_of(&r->device).exchanges;
  for (int i = 0; i < 10000; ++i) {
    tick(r);
    if (sonde_device_link_of(&r->device).exchanges >= before + more) return true;
  }
  return false;
}

static fake_control *hold(const char *path, void **library) {
  *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  assert_non_null(*library);
  fake_control *control = dlsym(*library, "fake");
  assert_non_null(control);
  return control;
}

// Unplugged at first: an error with a sentence. Plugged: poses and forces. Unplugged and plugged
// again: absent, then present, with a force that starts from zero.
static void live(const char *name, fake_control *control, sonde_device_open_def def,
                 bool feels_force, bool steers) {
  rig r = {.push_n = vec3(0, 0, 2)};
  sonde_error error;
  def.silence_s = 10.0; // absent means lost: a driver's thread that waits for a core is not silent
  assert_int_equal(sonde_device_open(name, &def, &r.device, &error), SONDE_DEVICE);
  assert_true(strlen(error.message) > 10 && r.device.self == NULL);
  control->plugged = true;
  control->position_m[0] = 0.02;
  control->position_m[2] = steers ? 0.5 : 0.03;
  assert_int_equal(sonde_device_open(name, &def, &r.device, &error), SONDE_OK);
  assert_string_equal(r.device.name, name);
  for (int cycle = 0; cycle < 2; ++cycle) {
    assert_true(wait_present(&r, true));
    if (feels_force) assert_true(wait_force(&r, control, 2, 2.0));
    assert_true(wait_exchanges(&r, 50));
    assert_true(r.sample.present && v_finite(r.sample.world_from_probe.position));
    if (!steers) {
      assert_true(fabs(r.sample.world_from_probe.position.x - 0.02) < 1e-9);
      sonde_vec3 x = q_rotate(r.sample.world_from_probe.rotation, vec3(1, 0, 0));
      assert_true(v_distance(x, vec3(0, 1, 0)) < 1e-6); // the fakes stand a quarter turn about z
      assert_true(r.sample.buttons & 1u);
    } else {
      assert_true(r.sample.world_from_probe.position.z > 1e-4);
    }
    control->plugged = false;
    assert_true(wait_present(&r, false));
    control->plugged = true;
  }
  assert_true(wait_present(&r, true));
  sonde_device_link link = sonde_device_link_of(&r.device);
  assert_true(link.connected && link.losses == 2 && link.exchanges >= 100);
  r.device.destroy(r.device.self);
  double left_n = control->force_n[2];
  if (feels_force) assert_true(fabs(left_n) < 1e-12);
}

static void library(const char *name, const char *path, bool feels_force, bool steers) {
  void *handle;
  fake_control *control = hold(path, &handle);
  live(name, control, (sonde_device_open_def){.version = SONDE_DEF_VERSION, .library = path},
       feels_force, steers);
  assert_int_equal(control->opened, control->closed);
  dlclose(handle);
}

static void openhaptics_lives(void **state) {
  (void)state;
  library("openhaptics", FAKE_HD, true, false);
}
static void forcedimension_lives(void **state) {
  (void)state;
  library("forcedimension", FAKE_DHD, true, false);
}
static void spacenav_lives(void **state) {
  (void)state;
  library("spacenav", FAKE_SPNAV, false, true);
}
static void gamepad_lives(void **state) {
  (void)state;
  library("gamepad", FAKE_SDL, true, true);
}

static void haply_lives(void **state) {
  (void)state;
  static mock_haply mock;
  assert_true(mock_haply_start(&mock));
  sonde_device_open_def def = {.version = SONDE_DEF_VERSION, .port = mock.port};
  rig r = {.push_n = vec3(0, 0, 2)};
  sonde_error error;
  assert_int_equal(sonde_device_open("haply", &def, &r.device, &error), SONDE_DEVICE);
  assert_non_null(strstr(error.message, "Inverse3"));
  mock.control.plugged = true;
  mock.control.position_m[0] = 0.02;
  assert_int_equal(sonde_device_open("haply", &def, &r.device, &error), SONDE_OK);
  assert_true(wait_present(&r, true));
  assert_true(wait_force(&r, &mock.control, 2, 2.0));
  sonde_vec3 x = q_rotate(r.sample.world_from_probe.rotation, vec3(1, 0, 0));
  assert_true(v_distance(x, vec3(0, 1, 0)) < 1e-6);
  assert_true(fabs(r.sample.world_from_probe.position.x - 0.02) < 1e-9);
  // torn packets: every other state is nonsense, the device stays
  mock.torn = true;
  uint64_t before = sonde_device_link_of(&r.device).exchanges;
  for (int i = 0; i < 300; ++i) tick(&r);
  sonde_device_link link = sonde_device_link_of(&r.device);
  assert_true(link.exchanges > before);
  mock.torn = false;
  // silence: lost; speech: back
  mock.silent = true;
  assert_true(wait_present(&r, false));
  mock.silent = false;
  mock.hang_up = true;
  assert_true(wait_present(&r, true));
  // the connection breaks: lost and back
  mock.hang_up = true;
  uint64_t losses = sonde_device_link_of(&r.device).losses;
  for (int i = 0; i < 10000 && sonde_device_link_of(&r.device).losses == losses; ++i) tick(&r);
  assert_true(wait_present(&r, true));
  r.device.destroy(r.device.self);
  mock_haply_stop(&mock);
}

static void absence_has_reasons(void **state) {
  (void)state;
  sonde_device device;
  sonde_error error;
  assert_int_equal(sonde_device_open("teapot", NULL, &device, &error), SONDE_ARGUMENT);
  sonde_device_open_def def = {.version = SONDE_DEF_VERSION, .library = "/nonexistent/libHD.so"};
  assert_int_equal(sonde_device_open("openhaptics", &def, &device, &error), SONDE_DEVICE);
  assert_non_null(strstr(error.message, "/nonexistent/libHD.so"));
  def.library = FAKE_DHD; // another vendor's
  assert_int_equal(sonde_device_open("openhaptics", &def, &device, &error), SONDE_DEVICE);
  assert_non_null(strstr(error.message, "hdInitDevice"));
  sonde_device_info info[16];
  uint32_t count = sonde_devices_find(false, info, 16);
  assert_int_equal(count, 10);
  assert_int_equal(sonde_devices_find(false, info, 7), 7);
  for (uint32_t i = 0; i < count; ++i) assert_true(strlen(info[i].reason) > 10);
  assert_false(sonde_device_link_of(&(sonde_device){0}).connected);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(openhaptics_lives), cmocka_unit_test(forcedimension_lives),
      cmocka_unit_test(spacenav_lives),    cmocka_unit_test(gamepad_lives),
      cmocka_unit_test(haply_lives),       cmocka_unit_test(absence_has_reasons),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
