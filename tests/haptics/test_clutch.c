// A clutch: whoever takes hold of the probe does not move it, strokes of a small handle go
// anywhere, and forces reach the handle only while it holds.
#include "test.h"

#include "sonde/haptics_devices.h"

typedef struct handle {
  sonde_device_sample sample;
  sonde_vec3 force_n, torque_n_m;
} handle;

static void read_handle(void *self, uint64_t tick, sonde_device_sample *sample) {
  (void)tick;
  *sample = ((handle *)self)->sample;
}
static void write_handle(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  ((handle *)self)->force_n = force_n;
  ((handle *)self)->torque_n_m = torque_n_m;
}

typedef struct rig {
  handle handle;
  sonde_device device;
  sonde_device_sample sample;
  uint64_t tick;
} rig;

static void set_up(rig *r, sonde_pose start) {
  *r = (rig){.handle.sample = {pose_at(0.01, -0.02, 0.03), 0, true}};
  sonde_device inner = {"handle", &r->handle, read_handle, write_handle, NULL};
  sonde_clutch_def def = {.version = SONDE_DEF_VERSION, .world_from_probe = start, .buttons = 2};
  assert_int_equal(sonde_device_clutch(&def, &inner, &r->device, NULL), SONDE_OK);
  assert_null(inner.self);
}

static void tick(rig *r, sonde_vec3 force_n) {
  r->device.read(r->device.self, r->tick++, &r->sample);
  r->device.write(r->device.self, force_n, vec3(0, 0, 0));
}

// 500 mm away, with a handle that never leaves a ball of 75 mm and a probe that never steps farther
// than the handle's 0.5 mm per tick.
static void strokes_go_anywhere(void **state) {
  (void)state;
  rig r;
  sonde_vec3 goal = vec3(0.3, -0.2, 0.35), at = vec3(0, 0, 0);
  set_up(&r, pose_at(0, 0, 0));
  r.handle.sample.world_from_probe.position = at;
  tick(&r, at);
  sonde_vec3 before = r.sample.world_from_probe.position;
  int strokes = 0;
  for (int k = 0; k < 20000 && v_distance(before, goal) > 1e-3; ++k) {
    bool back = r.handle.sample.buttons != 0;
    sonde_vec3 target = back ? vec3(0, 0, 0) : v_add(at, v_sub(goal, before));
    sonde_vec3 way = v_sub(target, at);
    at = v_madd(at, fmin(0.5e-3, v_norm(way)) / fmax(v_norm(way), 1e-12), way);
    if (!back && v_norm(at) > 0.0745) r.handle.sample.buttons = 2, ++strokes;
    if (back && v_norm(at) < 1e-3) r.handle.sample.buttons = 0;
    assert_true(v_norm(at) <= 0.0751);
    r.handle.sample.world_from_probe.position = at;
    tick(&r, at);
    assert_true(v_distance(r.sample.world_from_probe.position, before) < 0.5e-3 + 1e-12);
    before = r.sample.world_from_probe.position;
  }
  assert_true(v_distance(before, goal) <= 1e-3);
  assert_true(strokes >= 5);
  r.device.destroy(r.device.self);
}

// At the start, after a clutch and after a loss the probe stays although the handle is elsewhere
// and turned; from there a turn of the handle is the same turn of the probe about its own place.
static void taking_hold_moves_nothing(void **state) {
  (void)state;
  rig r;
  sonde_pose start = {vec3(0.1, 0.2, 0.3), quat_about(vec3(1, 1, 0), 1.1)};
  set_up(&r, start);
  r.handle.sample.world_from_probe.rotation = quat_about(vec3(0, 0, 1), 0.7);
  for (int k = 0; k < 3; ++k) {
    tick(&r, vec3(0, 0, 0));
    assert_true(v_distance(r.sample.world_from_probe.position, start.position) < 1e-15);
    sonde_vec3 x = q_rotate(r.sample.world_from_probe.rotation, vec3(1, 0, 0));
    assert_true(v_distance(x, q_rotate(start.rotation, vec3(1, 0, 0))) < 1e-12);
    if (k == 0) r.handle.sample.buttons = 3;
    if (k == 1) r.handle.sample.present = false;
    tick(&r, vec3(0, 0, 0));
    assert_int_equal(r.sample.present, k != 1);
    if (k == 2) break;
    r.handle.sample = (sonde_device_sample){
        {vec3(0.05 * k, 0, 0), quat_about(vec3(0, 1, 0.2), 0.4 * k)}, 1, true};
  }
  tick(&r, vec3(0, 0, 0));
  sonde_quat turn = quat_about(vec3(0, 0, 1), 0.3);
  sonde_pose *pose = &r.handle.sample.world_from_probe;
  sonde_vec3 before = q_rotate(r.sample.world_from_probe.rotation, vec3(1, 0, 0));
  pose->rotation = q_mul(turn, pose->rotation);
  pose->position.y += 0.01;
  tick(&r, vec3(0, 0, 0));
  sonde_vec3 after = q_rotate(r.sample.world_from_probe.rotation, vec3(1, 0, 0));
  assert_true(v_distance(after, q_rotate(turn, before)) < 1e-12);
  sonde_vec3 moved = v_sub(r.sample.world_from_probe.position, start.position);
  assert_true(v_distance(moved, vec3(0, 0.01, 0)) < 1e-12);
  r.device.destroy(r.device.self);
}

static void force_comes_back_slowly(void **state) {
  (void)state;
  rig r;
  set_up(&r, pose_at(0, 0, 0));
  for (int k = 0; k < 200; ++k) tick(&r, vec3(0, 0, 3));
  assert_true(fabs(r.handle.force_n.z - 3) < 1e-12);
  r.handle.sample.buttons = 2;
  tick(&r, vec3(0, 0, 3));
  assert_true(v_norm(r.handle.force_n) < 1e-15);
  r.handle.sample.buttons = 0;
  double before = 0;
  for (int k = 0; k < 120; ++k) {
    tick(&r, vec3(0, 0, 3));
    assert_true(r.handle.force_n.z - before <= 3 * 0.0101 && r.handle.force_n.z >= before);
    before = r.handle.force_n.z;
  }
  assert_true(fabs(before - 3) < 1e-12);
  r.handle.sample.world_from_probe.position.x = (double)NAN;
  tick(&r, vec3(0, 0, 3));
  assert_false(r.sample.present);
  assert_true(v_norm(r.handle.force_n) < 1e-15 && v_finite(r.sample.world_from_probe.position));
  r.device.destroy(r.device.self);
}

// A device on the table: pulling the handle up takes the probe off the skin, to the right moves it
// along its x, whatever axes the maker chose.
static void bases_follow_the_user(void **state) {
  (void)state;
  sonde_pose probe = {vec3(1, 2, 3), quat_about(vec3(1, -2, 0.5), 0.8)};
  const struct {
    const char *name;
    sonde_vec3 right, up, towards; // in the maker's axes
  } device[] = {{"openhaptics", {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                {"forcedimension", {0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
                {"haply", {1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
                {"gamepad", {1, 0, 0}, {0, 0, 1}, {0, -1, 0}}};
  for (size_t k = 0; k < SONDE_COUNT_OF(device); ++k) {
    sonde_pose base = sonde_device_base(device[k].name, probe);
    sonde_vec3 x = q_rotate(probe.rotation, vec3(1, 0, 0)),
               y = q_rotate(probe.rotation, vec3(0, 1, 0));
    sonde_vec3 out = q_rotate(probe.rotation, vec3(0, 0, -1));
    assert_true(v_distance(q_rotate(base.rotation, device[k].right), x) < 1e-12);
    assert_true(v_distance(q_rotate(base.rotation, device[k].up), out) < 1e-12);
    assert_true(v_distance(q_rotate(base.rotation, device[k].towards), y) < 1e-12);
  }
}

static void bad_definitions_are_named(void **state) {
  (void)state;
  handle h = {0};
  sonde_device inner = {0}, device;
  sonde_error error;
  sonde_clutch_def def = {.version = SONDE_DEF_VERSION, .buttons = 1};
  assert_int_equal(sonde_device_clutch(&def, &inner, &device, &error), SONDE_ARGUMENT);
  inner = (sonde_device){"handle", &h, read_handle, write_handle, NULL};
  def.world_from_probe = pose_at((double)NAN, 0, 0);
  assert_int_equal(sonde_device_clutch(&def, &inner, &device, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "finite"));
  assert_ptr_equal(inner.self, &h); // still the caller's
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(strokes_go_anywhere), cmocka_unit_test(taking_hold_moves_nothing),
      cmocka_unit_test(force_comes_back_slowly), cmocka_unit_test(bases_follow_the_user),
      cmocka_unit_test(bad_definitions_are_named)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
