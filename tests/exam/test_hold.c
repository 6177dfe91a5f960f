// Hold without creep: a hand presses to about 10 N, pulls sideways within what friction holds, and
// waits: for eight seconds, for a minute in a long test. What it drifts stays below a fifth of the
// default tremor of a hand, 50 um.
#include "exam_test.h"
#include "../sanitized.h"
#include "sonde/haptics_hand.h"
#include "haptics/devices/hand.h"

static sonde_device pulling_hand(const sonde_device_limits *limits) {
  sonde_site site = barrel_site();
  sonde_hand_def hand = sonde_hand_def_default();
  hand.tremor_m = 0.0;
  hand.resolution_m = limits->resolution_m;
  hand.force_limit_n = limits->force_peak_n;
  sonde_pose down = sonde_site_pose(&site, 0.0405), aside = down;
  aside.position.z += 0.005;
  const sonde_script_key keys[] = {
      {0.0, sonde_site_pose(&site, -0.003)}, {1.0, down}, {2.0, aside}};
  sonde_device device;
  assert_int_equal(sonde_device_hand(&hand, keys, 3, 1e-3, &device, NULL), SONDE_OK);
  return device;
}

typedef struct moment {
  sonde_vec3 hand_m, probe_m, force_n;
} moment;

static moment look(sonde_session *session) {
  return (moment){sonde_hand_position(&session->device, NULL),
                  session->sample.world_from_probe.position,
                  sonde_state_contact(session->state)->force_n};
}

static void holds_without_creep(void **state) {
  (void)state;
  sonde_model *model = barrel_model();
  const sonde_device_limits *limits = sonde_device_limits_find("omega.3");
  sonde_session_def def = small_def(model);
  def.controls.probe = 3; // a ball
  def.world.friction = (sonde_friction){0.5, 0.4, 0.01, 0, 0.05};
  def.limits = sonde_safety_limits_of(limits);
  def.rendering = sonde_render_def_for(limits, def.world.dt_s, 0.0);
  sonde_session *session = open_session(&def, pulling_hand(limits));
  for (int i = 0; i < 5000; ++i) sonde_session_step(session);
  moment start = look(session), now = start;
  double way_m = 0, force_n = 0;
  const int hold_ms = SAMPLES(60000, 3000);
  for (int i = 0; i < hold_ms; ++i) {
    sonde_session_step(session);
    now = look(session);
    way_m = fmax(way_m, v_distance(now.probe_m, start.probe_m));
    force_n = fmax(force_n, v_distance(now.force_n, start.force_n));
  }
  double normal_n = start.force_n.x, aside_n = fabs(start.force_n.z);
  print_message("normal %.2f N, tangential %.2f N; in %d s the hand drifts %.2f um, the "
                "probe %.2f um (at most %.2f), the force %.4f N (at most %.4f)\n",
                normal_n, aside_n, hold_ms / 1000, 1e6 * v_distance(now.hand_m, start.hand_m),
                1e6 * v_distance(now.probe_m, start.probe_m), 1e6 * way_m,
                v_distance(now.force_n, start.force_n), force_n);
  assert_true(normal_n > 9 && normal_n < 11 && aside_n > 1 && aside_n < 0.4 * normal_n);
  assert_true(way_m < 10e-6 && force_n < 0.1);
  assert_int_equal(session->safety.fault, SONDE_FAULT_NONE);
  close_session(session);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(holds_without_creep)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
