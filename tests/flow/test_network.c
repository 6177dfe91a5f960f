// The network of veins: conservation, Poiseuille's resistance, and what breath, squeeze, strain,
// clots and leaking valves do to the flow.
#include "sonde/flow.h"

#include "fixture.h"

#include <math.h>

static sonde_flow start(const sonde_flow_def *def) {
  sonde_flow flow;
  sonde_error error = {0};
  sonde_status status = sonde_flow_start(def, &flow, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  return flow;
}

// Least, greatest and mean velocity of a segment from one time to another; time of blood that falls
// back by more than 1 cm/s.
typedef struct course {
  double least, most, mean, back_s;
} course;

static course follow(sonde_flow *flow, sonde_flow_segment segment, double from, double to) {
  course c = {INFINITY, -INFINITY, 0, 0};
  uint32_t count = 0;
  while (flow->time_s < to - 1e-9) {
    sonde_flow_step(flow, 1e-3);
    if (flow->time_s < from) continue;
    double v = sonde_flow_velocity(flow, segment);
    c.least = fmin(c.least, v), c.most = fmax(c.most, v), c.mean += v, ++count;
    c.back_s += v < -0.01 ? 1e-3 : 0;
  }
  c.mean /= count;
  return c;
}

// No blood is made or lost: what enters and what leaves change the volumes.
static void test_conserves(void **unused) {
  (void)unused;
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.squeeze_from_s = 2;
  sonde_flow flow = start(&def);
  double before = 0, out = 0, after = 0;
  follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 0, 1.5);
  for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) before += flow.volume_m3[k];
  for (int n = 0; n < 4000; ++n) {
    sonde_flow_step(&flow, 1e-3);
    out += 1e-3 * flow.flow_m3_s[SONDE_FLOW_SEGMENTS - 1];
  }
  for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) after += flow.volume_m3[k];
  double in = out + after - before;
  print_message("4 s with a squeeze: in %.2f ml, out %.2f ml, stored %.2f ml\n", in * 1e6,
                out * 1e6, (after - before) * 1e6);
  // The capillaries' blood depends a little on the pressure in the veins.
  assert_near(in / (4 * def.inflow_m3_s), 1, 0.03);
}

// Without breath and heart beat the pressure falls along a vein by Poiseuille's law.
static void test_poiseuille(void **unused) {
  (void)unused;
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.breath_pa = 0, def.breath_rate_hz = 0, def.heart_rate_hz = 1.25;
  sonde_flow flow = start(&def);
  double fall = 0, q = 0;
  for (int n = 0; n < 19600; ++n) { // 9.6 s are 12 beats
    sonde_flow_step(&flow, 1e-3);
    if (n < 10000) continue;
    fall += (1 / 9600.0) * (sonde_flow_pressure(&flow, SONDE_FLOW_EXTERNAL_ILIAC) -
                            sonde_flow_pressure(&flow, SONDE_FLOW_COMMON_ILIAC));
    q += (1 / 9600.0) * flow.flow_m3_s[SONDE_FLOW_EXTERNAL_ILIAC];
  }
  double a = def.area_m2[SONDE_FLOW_EXTERNAL_ILIAC];
  double wanted = 8 * M_PI * 3.5e-3 * def.length_m[SONDE_FLOW_EXTERNAL_ILIAC] * q / (a * a);
  print_message("external iliac vein: pressure falls by %.2f Pa of %.2f\n", fall, wanted);
  assert_near(fall / wanted, 1, 0.02);
}

// Published ranges (docs/flow.md): at rest 9 to 15 cm/s in the common femoral vein with the breath,
// a squeeze of the calf several times that, valves shut within half a second.
static void test_sound(void **unused) {
  (void)unused;
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.squeeze_from_s = 14;
  sonde_flow flow = start(&def);
  course rest = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 4, 14);
  course squeeze = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 14, 17);
  flow = start(&def);
  follow(&flow, SONDE_FLOW_POPLITEAL, 13, 14);
  course behind = follow(&flow, SONDE_FLOW_POPLITEAL, 14, 20);
  print_message(
      "sound: %.1f cm/s (%.1f to %.1f), squeeze %.0f; behind the knee squeeze %.0f, back for "
      "%.2f s\n",
      100 * rest.mean, 100 * rest.least, 100 * rest.most, 100 * squeeze.most, 100 * behind.most,
      behind.back_s);
  assert_true(rest.mean > 0.06 && rest.mean < 0.15);
  assert_true((rest.most - rest.least) / rest.mean > 0.5);
  assert_true(squeeze.most / rest.mean > 3 && squeeze.most < 1.2);
  assert_true(behind.back_s < 0.5);
}

// A clot above takes the breath's waves and most of the squeeze away; valves that leak let blood
// fall back for longer than the half second that counts as reflux; straining stops the flow.
static void test_sick(void **unused) {
  (void)unused;
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.squeeze_from_s = 14;
  sonde_flow flow = start(&def);
  course sound = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 4, 14);
  course pressed = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 14, 17);
  sonde_flow_def iliac = def;
  iliac.closed[SONDE_FLOW_EXTERNAL_ILIAC] = 1;
  flow = start(&iliac);
  course above = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 8, 14);
  double pressure = sonde_flow_pressure(&flow, SONDE_FLOW_COMMON_FEMORAL) / 133.322;
  course squeezed = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 14, 17);
  print_message("clot in the pelvis: swing %.2f of %.2f cm/s, squeeze %.1f of %.1f, %.1f mmHg\n",
                100 * (above.most - above.least), 100 * (sound.most - sound.least),
                100 * squeezed.most, 100 * pressed.most, pressure);
  assert_true(above.most - above.least < 0.25 * (sound.most - sound.least));
  assert_true(squeezed.most < 0.5 * pressed.most && pressure > 8);
  sonde_flow_def femoral = def;
  femoral.closed[SONDE_FLOW_FEMORAL] = 1;
  flow = start(&femoral);
  follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 13, 14);
  course below = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 14, 17);
  assert_true(below.most < 0.4 * pressed.most);
  sonde_flow_def leaking = def;
  leaking.leak = 1;
  flow = start(&leaking);
  follow(&flow, SONDE_FLOW_POPLITEAL, 13, 14);
  course reflux = follow(&flow, SONDE_FLOW_POPLITEAL, 14, 20);
  print_message("clot in the thigh: squeeze %.1f cm/s; valves that leak: back for %.2f s\n",
                100 * below.most, reflux.back_s);
  assert_true(reflux.back_s > 0.5);
  sonde_flow_def strain = sonde_flow_def_default(NULL);
  strain.valsalva_from_s = 12, strain.valsalva_to_s = 18;
  flow = start(&strain);
  follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 11, 12.8);
  course still = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 12.8, 14);
  print_message("strain: %.1f cm/s, %.1f at least\n", 100 * still.mean, 100 * still.least);
  assert_true(still.mean < 0.3 * sound.mean);
}

static void test_refuses(void **unused) {
  (void)unused;
  sonde_flow flow;
  sonde_error error = {0};
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.area_m2[SONDE_FLOW_FEMORAL] = 0;
  assert_int_equal(sonde_flow_start(&def, &flow, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "femoral"));
  def = sonde_flow_def_default(NULL);
  def.leak = 1.5;
  assert_int_equal(sonde_flow_start(&def, &flow, &error), SONDE_ARGUMENT);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_conserves), cmocka_unit_test(test_poiseuille),
      cmocka_unit_test(test_sound), cmocka_unit_test(test_sick), cmocka_unit_test(test_refuses)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
