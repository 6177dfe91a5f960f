// Rendering: passive and quiet with every operator, equal to the tissue at rest, and red without
// it.
#include "test.h"

#include "sonde/haptics_hand.h"
#include "sonde/haptics_render.h"
#include "haptics/devices/hand.h"
#include "haptics/bounds.h"

static const double dt_s = 1e-3;

// A tissue as stiffening as eq. (1) of the two-layer model, with a damper: stiffness 500 N/m at the
// skin, 2,000 N/m at 30 mm.
typedef struct soft {
  double depth_m, damping;
} soft;

static sonde_vec3 push_soft(soft *tissue, sonde_vec3 at) {
  double depth = -at.z, rate = (depth - tissue->depth_m) / dt_s;
  tissue->depth_m = depth;
  if (depth <= 0.0) return vec3(0, 0, 0);
  double force = 500.0 * depth / (1.0 - fmin(depth, 0.055) / 0.06) + tissue->damping * rate;
  return vec3(0, 0, fmax(force, 0.0));
}

typedef struct outcome {
  double early_m, late_m; // swing of the hand 1.3 s and 2.8 s after the press
  double end_m, end_n, tissue_n;
  sonde_render render;
} outcome;

typedef struct setup {
  const char *device;
  double mass_kg, damping;
  bool coupled, controlled, coarse;
  double tissue_damping, press_m;
  uint32_t latency;
} setup;

static sonde_device hand_of(const setup *s, const sonde_device_limits *limits) {
  sonde_hand_def def = sonde_hand_def_default();
  def.mass_kg = s->mass_kg;
  def.damping_n_s_m = s->damping;
  def.tremor_m = 0.0;
  def.latency_ticks = s->latency;
  if (s->coarse) def.resolution_m = limits->resolution_m;
  // the arm has to stretch to hold the force at the depth
  double goal = -s->press_m - 0.8 * limits->force_peak_n / def.stiffness_n_m;
  const sonde_script_key keys[] = {
      {0.2, pose_at(0, 0, 0.005)}, {0.7, pose_at(0, 0, goal)}, {3.0, pose_at(0, 0, goal)}};
  sonde_device device;
  assert_int_equal(sonde_device_hand(&def, keys, 3, dt_s, &device, NULL), SONDE_OK);
  return device;
}

static void widen(double *low, double *high, double x) {
  *low = fmin(*low, x);
  *high = fmax(*high, x);
}

static outcome press(setup s) {
  const sonde_device_limits *limits = sonde_device_limits_find(s.device);
  sonde_render_def def = sonde_render_def_for(limits, dt_s, 0.0);
  if (!s.coupled) def.stiffness_n_m = 0.0;
  def.controller = s.controlled;
  outcome out;
  sonde_render_init(&out.render, &def);
  sonde_safety_limits bounds = sonde_safety_limits_of(limits);
  bounds.velocity_m_s = bounds.impulse_n_s = bounds.continuous_n = 0.0; // faults would hide it
  sonde_safety safety;
  sonde_safety_init(&safety, &bounds);
  sonde_device device = hand_of(&s, limits);
  soft tissue = {-0.005, s.tissue_damping};
  sonde_vec3 felt = vec3(0, 0, 0);
  double low[2] = {1, 1}, high[2] = {-1, -1};
  for (uint64_t tick = 0; tick < 4000; ++tick) {
    sonde_device_sample sample;
    device.read(device.self, tick, &sample);
    sonde_pose probe =
        sonde_render_probe(&out.render, sample.world_from_probe, felt, safety.force_n);
    felt = push_soft(&tissue, probe.position);
    sonde_render_force(&out.render, felt);
    sonde_safety_apply(&safety, out.render.force_n, vec3(0, 0, 0), dt_s);
    device.write(device.self, safety.force_n, vec3(0, 0, 0));
    double z = sonde_hand_position(&device, NULL).z;
    if (tick >= 2000 && tick < 2500) widen(&low[0], &high[0], z);
    if (tick >= 3500) widen(&low[1], &high[1], z);
    out.end_m = z;
  }
  out.early_m = high[0] - low[0];
  out.late_m = high[1] - low[1];
  out.end_n = safety.force_n.z;
  out.tissue_n = felt.z;
  device.destroy(device.self);
  return out;
}

// An undamped operator swings on for a while; a limit cycle does not decay.
static bool cycles(const outcome *out) {
  return out->late_m > 1e-4 && out->late_m > 0.9 * out->early_m;
}

typedef struct tally {
  int cases, cycles;
  double energy_min_j;
} tally;

static tally sweep(setup s) {
  static const char *const devices[] = {"touch", "premium_1.5", "omega.3"};
  static const double masses[] = {0.1, 0.2, 0.5, 1.0, 2.0}, dampings[] = {0.0, 0.5, 1.0, 2.0, 5.0};
  tally total = {0, 0, 0.0};
  s.press_m = 0.03;
  for (size_t i = 0; i < 75; ++i) {
    s.device = devices[i / 25];
    s.mass_kg = masses[i / 5 % 5];
    s.damping = dampings[i % 5];
    outcome out = press(s);
    total.cases++;
    total.cycles += cycles(&out);
    total.energy_min_j = fmin(total.energy_min_j, out.render.energy_min_j);
  }
  return total;
}

static void every_operator_is_safe(void **state) {
  (void)state;
  tally total = sweep((setup){.coupled = true, .controlled = true, .tissue_damping = 5.0});
  assert_int_equal(total.cycles, 0);
  assert_true(total.energy_min_j >= -1e-12); // rounding only
}

// With encoders and a tick of latency the books are coarse: what a step of the encoder is worth.
static void encoders_and_latency_are_borne(void **state) {
  (void)state;
  tally total = sweep((setup){
      .coupled = true, .controlled = true, .coarse = true, .latency = 1, .tissue_damping = 5.0});
  assert_int_equal(total.cycles, 0);
  assert_true(total.energy_min_j >= -1e-5);
}

// The same sweep without the rendering's control finds the unstable cases.
static void direct_rendering_is_unstable(void **state) {
  (void)state;
  tally total = sweep((setup){.tissue_damping = 5.0});
  print_message("direct rendering: %d of %d unstable\n", total.cycles, total.cases);
  assert_true(total.cycles >= 10);
}

// A stretch of the coupling is a stretch of the force: at rest device force = scale x tissue force.
static void rest_shows_the_scaled_tissue(void **state) {
  (void)state;
  outcome out = press((setup){.device = "touch",
                              .mass_kg = 0.5,
                              .damping = 5.0,
                              .coupled = true,
                              .controlled = true,
                              .tissue_damping = 5.0,
                              .press_m = 0.01});
  double scale = out.render.def.force_scale;
  assert_true(out.tissue_n > 4.0);
  assert_true(fabs(out.end_n - scale * out.tissue_n) < 1e-4 * out.end_n);
  double stretch = fabs(out.render.probe_m.z - out.render.device_m.z);
  assert_true(fabs(stretch * out.render.def.stiffness_n_m - out.end_n) < 1e-3 * out.end_n);
}

// A wall met by an undamped hand: a held spring pumps energy in, the controller takes it out.
static double bounce(bool controller, uint64_t *acted) {
  sonde_render_def def = sonde_render_def_default();
  def.stiffness_n_m = 2000.0;
  def.controller = controller;
  def.filter_rad_s = 3000.0;
  sonde_render render;
  sonde_render_init(&render, &def);
  sonde_hand_def hand = sonde_hand_def_default();
  hand.mass_kg = 0.2;
  hand.damping_n_s_m = hand.tremor_m = hand.stiffness_n_m = 0.0;
  const sonde_script_key key = {0.0, pose_at(0, 0, 0)};
  sonde_device device;
  assert_int_equal(sonde_device_hand(&hand, &key, 1, dt_s, &device, NULL), SONDE_OK);
  sonde_vec3 force = vec3(0, 0, 0.5), velocity;
  for (uint64_t tick = 0; tick < 1000; ++tick) {
    sonde_device_sample sample;
    device.read(device.self, tick, &sample);
    // a tissue that cannot be moved: the probe is put back
    sonde_render_probe(&render, sample.world_from_probe, vec3(0, 0, 0), force);
    render.probe_m = render.probe_m_s = render.probe_moved_m = vec3(0, 0, 0);
    force = v_madd(v_scale(render.device_m, -2000.0), -render.damping_n_s_m, render.velocity_m_s);
    device.write(device.self, tick ? force : vec3(0, 0, 20), vec3(0, 0, 0));
  }
  sonde_vec3 x = sonde_hand_position(&device, &velocity);
  *acted = render.controlled_ticks;
  device.destroy(device.self);
  return 0.1 * v_norm2(velocity) + 1000.0 * v_norm2(x);
}

static void controller_takes_out_what_holding_puts_in(void **state) {
  (void)state;
  uint64_t acted;
  double start = 0.1 * 0.1 * 0.1, with = bounce(true, &acted); // 20 N for 1 ms on 0.2 kg: 0.1 m/s
  assert_true(acted > 100);
  double without = bounce(false, &acted);
  assert_int_equal(acted, 0);
  assert_true(without > 10.0 * start);
  assert_true(with < 1.05 * start);
}

// Largest stable stiffness of an undamped-coupling loop found by margins and by simulation agree.
static void margins_agree_with_colgate(void **state) {
  (void)state;
  sonde_render_def def = sonde_render_def_default();
  def.stiffness_n_m = 500.0;
  def.controller = false;
  sonde_render_margins m = sonde_render_margins_of(&def, 0.5, 0.25, 0.0);
  assert_true(fabs(m.damping_needed_n_s_m - 0.25) < 1e-12 && fabs(m.passivity - 1.0) < 1e-12);
  // b = K T / 2 is the limit for a free mass, too, when T is short beside its period
  assert_true(m.stiffness > 0.98 && m.stiffness < 1.05);
  assert_true(fabs(m.phase_rad) < 0.01);
  m = sonde_render_margins_of(&def, 0.5, 0.5, 0.0);
  assert_true(m.stiffness > 1.9 && m.stiffness < 2.2 && m.phase_rad > 0.0);
  m = sonde_render_margins_of(&def, 0.5, 0.5, 2e-3);
  assert_true(m.stiffness < 0.5 && m.phase_rad < 0.0);
  def.damping_n_s_m = 4.0;
  assert_true(sonde_render_margins_of(&def, 0.5, 0.5, 0.0).phase_rad > 0.1);
}

static void limits_have_sources(void **state) {
  (void)state;
  uint32_t count = 0;
  const sonde_device_limits *row = sonde_device_limits_list(&count);
  assert_true(count >= 6);
  for (uint32_t i = 0; i < count; ++i) {
    assert_ptr_equal(sonde_device_limits_find(row[i].name), &row[i]);
    assert_true(strlen(row[i].source) > 10);
    assert_true(row[i].force_continuous_n <= row[i].force_peak_n);
    sonde_safety_limits limits = sonde_safety_limits_of(&row[i]);
    assert_true(limits.force_n > 0.0 && limits.continuous_n > 0.0);
    assert_true(limits.continuous_n <= limits.force_n);
    if (row[i].force_peak_n > 0.0) assert_true(limits.force_n <= row[i].force_peak_n);
    sonde_render_def def = sonde_render_def_for(&row[i], dt_s, 0.0);
    if (row[i].stiffness_n_m > 0.0) assert_true(def.stiffness_n_m <= row[i].stiffness_n_m);
    assert_true(sonde_render_margins_of(&def, 0.1, 0.0, 1e-3).phase_rad > 0.0);
  }
  assert_null(sonde_device_limits_find("teapot"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_operator_is_safe),
      cmocka_unit_test(encoders_and_latency_are_borne),
      cmocka_unit_test(direct_rendering_is_unstable),
      cmocka_unit_test(rest_shows_the_scaled_tissue),
      cmocka_unit_test(controller_takes_out_what_holding_puts_in),
      cmocka_unit_test(margins_agree_with_colgate),
      cmocka_unit_test(limits_have_sources),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
