// Sessions in lockstep: one state behind force, skin and image; the same inputs, the same state;
// faults fade the force.
#include "../sanitized.h"
#include "exam_test.h"
#include "sonde/files_scanner.h"

static int set_up(void **state) {
  *state = barrel_model();
  return 0;
}
static int tear_down(void **state) {
  sonde_model_destroy(*state);
  return 0;
}

static void rejects_bad_definitions(void **state) {
  sonde_session_def good = small_def(*state), bad = good;
  sonde_session *session = (sonde_session *)&good;
  sonde_device device = press_device();
  sonde_error error;
  const char *const unknown[] = {"linear", "banana", NULL};
  bad.model = NULL;
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_ARGUMENT);
  assert_null(session);
  bad = good;
  bad.controls.probe = 99;
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_ARGUMENT);
  bad = good;
  bad.image_width = 0;
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_ARGUMENT);
  bad = good;
  bad.limits.force_n = (double)NAN;
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "limits.force_n"));
  bad = good;
  bad.rendering.force_scale = 5e-4; // would have been rendered as 1
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "rendering.force_scale"));
  bad = good;
  bad.ticks_per_image = 0;
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_ARGUMENT);
  bad = good;
  bad.probe_names = unknown;
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_NOT_FOUND);
  bad = good;
  bad.record_path = "/nonexistent-directory/x.rec";
  assert_int_equal(sonde_session_create(&bad, &device, &session, &error), SONDE_IO);
  assert_int_equal(sonde_session_create(&good, &(sonde_device){0}, &session, &error),
                   SONDE_ARGUMENT);
  device.destroy(device.self); // still ours
  assert_int_equal(sonde_session_destroy(NULL, NULL), SONDE_OK);
}

static void site_pose_looks_into_the_tissue(void **state) {
  (void)state;
  sonde_site site = barrel_site();
  site.normal = v_unit(vec3(1, 0.2, -0.1), site.normal);
  sonde_pose pose = sonde_site_pose(&site, 0.012);
  assert_true(v_distance(q_rotate(pose.rotation, vec3(0, 0, 1)), v_neg(site.normal)) < 1e-12);
  assert_true(v_dot(q_rotate(pose.rotation, vec3(1, 0, 0)), site.u) > 0.9);
  sonde_vec3 moved = v_sub(pose.position, site.position_m);
  assert_true(v_distance(moved, v_scale(site.normal, -0.012)) < 1e-12);
}

// Force, skin and image of a frame belong to one tick, and the skin is that tick's skin exactly;
// the inside is the solid, once it is factored.
static void frame_is_of_one_state(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_session *session = open_session(&def, press_device());
  sonde_interior_set_method(session->interior, SONDE_INTERIOR_SOLID);
  sonde_frame frame;
  assert_false(sonde_session_frame(session, &frame));
  double force_max_n = 0.0;
  uint32_t by_solid = 0;
  for (uint64_t tick = 1; tick <= 600; ++tick) {
    sonde_session_tick(session);
    bool due = tick % def.ticks_per_image == 0;
    assert_int_equal(sonde_session_frame(session, &frame), due);
    if (!due) continue;
    assert_int_equal(frame.snapshot.tick, tick);
    assert_int_equal(sonde_interior_tick(session->interior), tick);
    by_solid += sonde_interior_used_method(session->interior) == SONDE_INTERIOR_SOLID;
    const sonde_vec3 *x = sonde_state_positions(session->state);
    for (size_t i = 0; i < session->nodes; ++i) {
      float expected[3] = {(float)x[i].x, (float)x[i].y, (float)x[i].z};
      assert_memory_equal(&frame.skin_m[3 * i], expected, sizeof expected);
    }
    sonde_vec3 force_n = sonde_state_contact(session->state)->force_n;
    assert_memory_equal(&frame.snapshot.force_n, &force_n, sizeof force_n);
    force_max_n = fmax(force_max_n, frame.snapshot.force_normal_n);
  }
  assert_true(force_max_n > 1.0);
  assert_true(by_solid > 0);
  assert_int_equal(sonde_session_images(session), 600 / def.ticks_per_image);
  assert_true(isnan(sonde_session_latency(session, 0.5))); // of real time only
  close_session(session);
}

// Depth of the scripted face below the rest skin: the script says it, the frame measures it.
static void penetration_follows_the_script(void **state) {
  NOT_SANITIZED();
  sonde_session_def def = small_def(*state);
  sonde_site site = barrel_site();
  const double depths_m[] = {-0.03, -0.004, 0.0, 0.008, 0.02};
  for (size_t i = 0; i < SONDE_COUNT_OF(depths_m); ++i) {
    sonde_device device;
    sonde_pose pose = sonde_site_pose(&site, depths_m[i]);
    assert_int_equal(sonde_device_null(pose, &device, NULL), SONDE_OK);
    sonde_session *session = open_session(&def, device);
    sonde_frame frame;
    for (int tick = 0; tick < 20; ++tick) sonde_session_tick(session);
    assert_true(sonde_session_frame(session, &frame));
    assert_true(fabs(frame.snapshot.penetration_m - depths_m[i]) < 5e-4); // facets of the barrel
    close_session(session);
  }
}

static uint64_t hash_after(const sonde_session_def *def, int ticks) {
  sonde_session *session = open_session(def, press_device());
  for (int i = 0; i < ticks; ++i) sonde_session_tick(session);
  uint64_t hash = sonde_session_hash(session);
  assert_int_equal(sonde_session_ticks(session), ticks);
  close_session(session);
  return hash;
}

static void equal_inputs_give_equal_states(void **state) {
  sonde_session_def def = small_def(*state), other = def;
  other.ticks_per_image = 7; // looking must not change what is looked at
  uint64_t hash = hash_after(&def, 300);
  assert_true(hash == hash_after(&other, 300));
  other.controls.probe = 2;
  assert_true(hash != hash_after(&other, 300));
  assert_true(hash != hash_after(&def, 299));
}

// Two sessions tick by tick in turn are the same two sessions one after the other.
static void sessions_do_not_know_of_each_other(void **state) {
  NOT_SANITIZED();
  sonde_session_def def = small_def(*state), other = def;
  other.controls.probe = 0;
  uint64_t hash_a = hash_after(&def, 200), hash_b = hash_after(&other, 200);
  sonde_session *a = open_session(&def, press_device()), *b = open_session(&other, press_device());
  for (int i = 0; i < 200; ++i) {
    sonde_session_tick(a);
    sonde_session_tick(b);
  }
  assert_true(sonde_session_hash(a) == hash_a && sonde_session_hash(b) == hash_b);
  close_session(a);
  close_session(b);
}

static void controls_are_cleaned(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_session *session = open_session(&def, press_device());
  sonde_session_controls c = sonde_session_controls_now(session);
  assert_int_equal(c.probe, 1);
  c.probe = 77;
  c.pathology.venous_pressure_pa = (double)NAN;
  c.pathology.thrombus_fraction = 7.0;
  c.echo.depth_m = (double)NAN;
  sonde_session_control(session, &c);
  c = sonde_session_controls_now(session);
  assert_int_equal(c.probe, 1);
  assert_true(fabs(c.pathology.venous_pressure_pa - def.controls.pathology.venous_pressure_pa) <
              1e-9);
  assert_true(c.pathology.thrombus_fraction <= 1.0);
  assert_true(isfinite(c.echo.depth_m));
  c.probe = 2;
  sonde_session_control(session, &c);
  assert_int_equal(sonde_session_controls_now(session).probe, 2); // before any tick
  for (int i = 0; i < 20; ++i) sonde_session_tick(session);
  sonde_frame frame;
  assert_true(sonde_session_frame(session, &frame));
  assert_int_equal(frame.snapshot.probe, 2);
  close_session(session);
}

// Another depth is shown once its beam is built; meanwhile images keep coming and show the old one.
// A knob that turns on and on does not stop that.
static void a_new_depth_comes_within_images(void **state) {
  sonde_session_def def = small_def(*state);
  sonde_session *session = open_session(&def, press_device());
  sonde_session_controls c = sonde_session_controls_now(session);
  double first = 0, height = 0;
  uint32_t images = 0;
  for (; images < 40 && (images < 2 || height <= first); ++images) {
    for (uint32_t i = 0; i < def.ticks_per_image; ++i) sonde_session_tick(session);
    sonde_frame frame;
    assert_true(sonde_session_frame(session, &frame));
    assert_int_equal(frame.snapshot.tick / def.ticks_per_image, images + 1);
    height = frame.height_m;
    if (images == 0) first = height;
    c.echo.depth_m += 1e-3;
    sonde_session_control(session, &c);
  }
  print_message("%g mm deep after %u images, before %g mm\n", 1e3 * height, images, 1e3 * first);
  assert_true(images > 2 && images < 20 && height > first);
  close_session(session);
}

// A device that presses, notes what it is told to render, and fails on demand.
typedef struct moody {
  sonde_pose pose;
  sonde_vec3 rendered_n, before_n;
  double largest_n, steepest_n;
  bool absent, broken;
} moody;

static void moody_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  const moody *m = self;
  (void)tick;
  *sample = (sonde_device_sample){m->pose, 0, !m->absent};
  if (m->broken) sample->world_from_probe.position.y = (double)NAN;
}

static void moody_write(void *self, sonde_vec3 force_n, sonde_vec3 torque_n_m) {
  moody *m = self;
  assert_true(v_finite(force_n) && v_finite(torque_n_m));
  m->steepest_n = fmax(m->steepest_n, v_distance(force_n, m->rendered_n));
  m->largest_n = fmax(m->largest_n, v_norm(force_n));
  m->before_n = m->rendered_n;
  m->rendered_n = force_n;
}

static sonde_session *pressed_session(const sonde_session_def *def, moody *m) {
  sonde_site site = barrel_site();
  *m = (moody){.pose = sonde_site_pose(&site, 0.015)};
  sonde_session *session =
      open_session(def, (sonde_device){"moody", m, moody_read, moody_write, NULL});
  for (int i = 0; i < 300; ++i) sonde_session_tick(session);
  assert_true(v_norm(m->rendered_n) > 1.0);
  return session;
}

static void assert_faded(sonde_session *session, const moody *m, sonde_fault fault) {
  for (int i = 0; i < 20; ++i) sonde_session_tick(session);
  assert_int_equal(session->safety.fault, fault);
  assert_true(v_norm(m->rendered_n) <= 0.0);
  assert_true(v_norm(sonde_state_contact(session->state)->force_n) > 1.0); // the tissue goes on
}

static void assert_resumes(sonde_session *session, const moody *m) {
  sonde_session_controls c = sonde_session_controls_now(session);
  c.stop = false;
  c.resume++;
  sonde_session_control(session, &c);
  for (int i = 0; i < 200; ++i) sonde_session_tick(session);
  assert_int_equal(session->safety.fault, SONDE_FAULT_NONE);
  assert_true(v_norm(m->rendered_n) > 1.0);
}

static void faults_fade_and_resume(void **state) {
  sonde_session_def def = small_def(*state);
  moody m;
  sonde_session *session = pressed_session(&def, &m);
  m.absent = true;
  assert_faded(session, &m, SONDE_FAULT_DEVICE_LOST);
  m.absent = false;
  for (int i = 0; i < 50; ++i) sonde_session_tick(session);
  assert_true(v_norm(m.rendered_n) <= 0.0); // latched
  assert_resumes(session, &m);
  m.broken = true;
  assert_faded(session, &m, SONDE_FAULT_DEVICE_LOST);
  m.broken = false;
  assert_resumes(session, &m);
  sonde_session_controls c = sonde_session_controls_now(session);
  c.stop = true;
  sonde_session_control(session, &c);
  assert_faded(session, &m, SONDE_FAULT_STOPPED);
  assert_resumes(session, &m);
  assert_true(m.largest_n <= def.limits.force_n * (1 + 1e-12));
  assert_true(m.steepest_n <= def.limits.slew_n_s * 1e-3 * (1 + 1e-9));
  close_session(session);
}

// A device may send a rotation of another length: the world sees the rotation it stands for.
static void rotations_are_made_unit(void **state) {
  NOT_SANITIZED();
  sonde_session_def def = small_def(*state);
  moody m[2];
  sonde_session *session[2];
  for (int i = 0; i < 2; ++i) session[i] = pressed_session(&def, &m[i]);
  sonde_quat q = m[1].pose.rotation;
  m[1].pose.rotation = (sonde_quat){-4 * q.w, -4 * q.x, -4 * q.y, -4 * q.z};
  for (int tick = 0; tick < 20; ++tick)
    for (int i = 0; i < 2; ++i) sonde_session_tick(session[i]);
  assert_true(v_distance(m[0].rendered_n, m[1].rendered_n) < 1e-6);
  sonde_frame frame;
  for (int i = 0; i < 2; ++i) {
    assert_true(sonde_session_frame(session[i], &frame));
    assert_true(fabs(v_norm(q_rotate(frame.snapshot.world_from_probe.rotation, vec3(1, 0, 0))) -
                     1.0) < 1e-12);
    close_session(session[i]);
  }
}

// Stop and its release between two ticks: the stop must still act.
static void a_short_stop_is_not_missed(void **state) {
  sonde_session_def def = small_def(*state);
  moody m;
  sonde_session *session = pressed_session(&def, &m);
  sonde_session_controls c = sonde_session_controls_now(session);
  c.stop = true;
  sonde_session_control(session, &c);
  c.stop = false;
  sonde_session_control(session, &c);
  assert_faded(session, &m, SONDE_FAULT_STOPPED);
  close_session(session);
}

static void limits_hold_against_a_jump(void **state) {
  sonde_session_def def = small_def(*state);
  def.limits.force_n = 3.0;
  moody m;
  sonde_session *session = pressed_session(&def, &m);
  m.pose.position.x -= 0.02; // a device that jumps 20 mm deeper within one tick
  for (int i = 0; i < 50; ++i) sonde_session_tick(session);
  assert_true(m.largest_n <= 3.0 * (1 + 1e-12));
  assert_true(m.steepest_n <= def.limits.slew_n_s * 1e-3 * (1 + 1e-9));
  close_session(session);
}

// Through a coupling: at rest the device feels scale x tissue, and the metrics the tissue itself.
static void device_force_is_the_scaled_tissue(void **state) {
  NOT_SANITIZED();
  sonde_session_def def = small_def(*state);
  const sonde_device_limits *omega = sonde_device_limits_find("omega.3");
  def.rendering = sonde_render_def_for(omega, def.world.dt_s, 0.0);
  def.limits = sonde_safety_limits_of(omega);
  moody m;
  sonde_session *session = pressed_session(&def, &m);
  for (int i = 0; i < 1000; ++i) sonde_session_tick(session);
  double tissue = v_norm(sonde_state_contact(session->state)->force_n);
  double device = v_norm(session->safety.force_n);
  assert_int_equal(session->safety.fault, SONDE_FAULT_NONE);
  assert_true(tissue > 0.5 && device < 0.5 * tissue);
  assert_true(fabs(device - def.rendering.force_scale * tissue) < 0.02 * device);
  assert_true(session->render.energy_j >= 0.0);
  close_session(session);
}

// Allocations: none on the tick path; a session that lacks memory at any point leaves nothing.
static size_t calls, alive, fail_at;
static void *counting(size_t bytes, void *user) {
  (void)user;
  if (++calls == fail_at) return NULL;
  alive++;
  return malloc(bytes);
}
static void releasing(void *pointer, void *user) {
  (void)user;
  alive--;
  free(pointer);
}

static void ticks_do_not_allocate(void **state) {
  sonde_session_def def = small_def(*state);
  calls = fail_at = 0;
  sonde_device device = press_device(); // before the hook: freed below, after it
  sonde_session *session = open_session(&def, device);
  sonde_set_allocator(&(sonde_allocator){counting, NULL, NULL});
  for (int i = 0; i < 400; ++i) sonde_session_tick(session);
  sonde_set_allocator(NULL);
  assert_int_equal(calls, 0);
  close_session(session);
}

static void creation_survives_lack_of_memory(void **state) {
  sonde_session_def def = small_def(*state);
  def.record_path = "exam_memory.rec";
  sonde_set_allocator(&(sonde_allocator){counting, releasing, NULL});
  sonde_status status = SONDE_MEMORY;
  size_t n = 1;
  for (; status && n < 100000; n += 1 + n / ROUNDS(8, 2)) {
    sonde_session *session = NULL;
    alive = 0;
    sonde_device device = press_device();
    calls = 0;
    fail_at = n;
    status = sonde_session_create(&def, &device, &session, NULL);
    assert_true(status == SONDE_OK || status == SONDE_MEMORY);
    fail_at = 0;
    if (status) device.destroy(device.self);
    sonde_session_destroy(session, NULL);
    assert_int_equal(alive, 0);
  }
  sonde_set_allocator(NULL);
  assert_int_equal(status, SONDE_OK);
  assert_true(n > 20);
  assert_int_not_equal(access("exam_memory.rec", F_OK), 0); // no tick, no file
}

// A scanner with a curved face: the picture is its fan from the first on, as wide and as high as
// the fan, black beside it; colour and gate are on its lines, within them, and do not lean. A face
// that spans too wide an arc is refused.
#define NEAR(a, b) (fabs((a) - (b)) < 1e-12)
static void a_curved_scanner_draws_its_fan(void **state) {
  sonde_scanner scanner = sonde_scanner_plain();
  scanner.radius_m = 0.06, scanner.aperture_m = 0.05;
  sonde_session_def def = small_def(*state);
  def.scanner = &scanner;
  def.controls.duplex.shown = SONDE_DUPLEX_VELOCITY, def.controls.duplex.gated = true;
  def.controls.duplex.box.right_m = 0.08, def.controls.duplex.box.steer_rad = 0.2;
  def.controls.duplex.gate.x_m = 0.09, def.controls.duplex.gate.steer_rad = 0.2;
  sonde_session *session = open_session(&def, press_device());
  const double depth_m = def.controls.echo.depth_m, half_rad = 0.5 * 0.05 / 0.06;
  sonde_frame frame = {0};
  uint32_t bright = 0;
  for (int image = 0; image < 15; ++image) {
    for (uint32_t k = 0; k < def.ticks_per_image; ++k) sonde_session_tick(session);
    assert_true(sonde_session_frame(session, &frame));
    assert_true(NEAR(frame.top_m, 0.06 * (cos(half_rad) - 1)));
    assert_true(NEAR(frame.height_m, depth_m - frame.top_m));
    assert_true(NEAR(frame.radius_m, 0.06));
    const double size = frame.width_m / frame.width;
    for (uint32_t y = 0; y < frame.height; ++y)
      for (uint32_t x = 0; x < frame.width; ++x) {
        const double across = (x + 0.5 - 0.5 * frame.width) * size,
                     down = frame.top_m + (y + 0.5) * size + 0.06;
        const bool fan = fabs(atan2(across, down)) < half_rad + 0.02 &&
                         hypot(across, down) > 0.06 - size &&
                         hypot(across, down) < 0.06 + depth_m + size;
        const uint8_t pixel = frame.pixels[y * frame.width + x];
        if (!fan) assert_int_equal(pixel, 0);
        bright += pixel > 30;
      }
  }
  assert_true(bright > 1000);
  const sonde_colour_box *box = &frame.colour.box;
  assert_int_equal(frame.colour.shown, SONDE_DUPLEX_VELOCITY);
  assert_true(box->radius_m == 0.06 && box->steer_rad == 0);
  assert_true(NEAR(box->right_m, 0.025));
  assert_true(frame.spectrum.on && frame.spectrum.settings.steer_rad == 0);
  assert_true(NEAR(frame.spectrum.settings.x_m, 0.025));
  close_session(session);

  scanner.radius_m = 0.02;
  sonde_device device = press_device();
  sonde_error error;
  assert_int_equal(sonde_session_create(&def, &device, &session, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "degrees"));
  device.destroy(device.self);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(rejects_bad_definitions),
      cmocka_unit_test(site_pose_looks_into_the_tissue),
      cmocka_unit_test(frame_is_of_one_state),
      cmocka_unit_test(penetration_follows_the_script),
      cmocka_unit_test(equal_inputs_give_equal_states),
      cmocka_unit_test(sessions_do_not_know_of_each_other),
      cmocka_unit_test(controls_are_cleaned),
      cmocka_unit_test(a_new_depth_comes_within_images),
      cmocka_unit_test(a_curved_scanner_draws_its_fan),
      cmocka_unit_test(faults_fade_and_resume),
      cmocka_unit_test(rotations_are_made_unit),
      cmocka_unit_test(a_short_stop_is_not_missed),
      cmocka_unit_test(limits_hold_against_a_jump),
      cmocka_unit_test(device_force_is_the_scaled_tissue),
      cmocka_unit_test(ticks_do_not_allocate),
      cmocka_unit_test(creation_survives_lack_of_memory),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
