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
    out += 1e-3 * flow.flow_m3_s[SONDE_FLOW_COMMON_ILIAC];
  }
  for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) after += flow.volume_m3[k];
  double in = out + after - before;
  print_message("4 s with a squeeze: in %.2f ml, out %.2f ml, stored %.2f ml\n", in * 1e6,
                out * 1e6, (after - before) * 1e6);
  // The capillaries' blood depends a little on the pressure in the veins.
  assert_near(in / (4 * 1.27 * def.inflow_m3_s), 1, 0.03);
}

// Without breath and heart beat the pressure falls along a vein by Poiseuille's law.
static void test_poiseuille(void **unused) {
  (void)unused;
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.breath_pa = 0, def.breath_rate_hz = 0, def.heart_rate_hz = 1.25;
  // The vein above is as wide, so that the blood's motion loses nothing.
  def.area_m2[SONDE_FLOW_COMMON_ILIAC][0] = def.area_m2[SONDE_FLOW_EXTERNAL_ILIAC][0];
  sonde_flow flow = start(&def);
  double fall = 0, q = 0;
  for (int n = 0; n < 19600; ++n) { // 9.6 s are 12 beats
    sonde_flow_step(&flow, 1e-3);
    if (n < 10000) continue;
    fall += (1 / 9600.0) * (sonde_flow_pressure(&flow, SONDE_FLOW_EXTERNAL_ILIAC) -
                            sonde_flow_pressure(&flow, SONDE_FLOW_COMMON_ILIAC));
    q += (1 / 9600.0) * flow.flow_m3_s[SONDE_FLOW_EXTERNAL_ILIAC];
  }
  double a = def.area_m2[SONDE_FLOW_EXTERNAL_ILIAC][0];
  double wanted = 8 * M_PI * 3.5e-3 * def.length_m[SONDE_FLOW_EXTERNAL_ILIAC] * q / (a * a);
  print_message("external iliac vein: pressure falls by %.2f Pa of %.2f\n", fall, wanted);
  assert_near(fall / wanted, 1, 0.02);
}

// Two veins side by side with areas 2:1 have one fall of pressure, and flows and velocities as
// Poiseuille's law gives each alone: 4:1 and 2:1. A clot in the wider one leaves the other.
static void test_two_veins(void **unused) {
  (void)unused;
  sonde_flow_def def = sonde_flow_def_default(NULL);
  const sonde_flow_segment at = SONDE_FLOW_FEMORAL;
  const double area[2] = {30e-6, 15e-6}, length = def.length_m[at];
  def.breath_pa = 0, def.breath_rate_hz = 0, def.heart_rate_hz = 1.25;
  def.area_m2[at][0] = area[0], def.area_m2[at][1] = area[1];
  // What a wider vein above would add to the fall is left out.
  def.area_m2[SONDE_FLOW_COMMON_FEMORAL][0] = area[0] + area[1];
  for (int closed = 0; closed < 2; ++closed) {
    def.closed[at][0] = closed;
    sonde_flow flow = start(&def);
    double fall = 0, through[2] = {0, 0}, whole = 0;
    if (closed) follow(&flow, at, 0, 40);
    for (int n = 0; n < 19600; ++n) { // 9.6 s are 12 beats
      sonde_flow_step(&flow, 1e-3);
      if (n < 10000) continue;
      fall +=
          (sonde_flow_pressure(&flow, at) - sonde_flow_pressure(&flow, SONDE_FLOW_COMMON_FEMORAL)) /
          9600;
      whole += flow.flow_m3_s[at] / 9600;
      for (uint32_t v = 0; v < 2; ++v) through[v] += sonde_flow_through(&flow, at, v) / 9600;
    }
    const double widened = sonde_flow_area(&flow, at, 1) / area[1];
    for (uint32_t v = 0; v < 2; ++v) {
      const double a = area[v] * widened, alone = a * a * fall / (8 * M_PI * 3.5e-3 * length);
      print_message("vein %u%s: %.3f ml/s of %.3f\n", v, closed ? " beside a clot" : "",
                    1e6 * through[v], 1e6 * alone);
      if (v >= (uint32_t)closed) assert_near(through[v] / alone, 1, 0.02);
    }
    if (closed) {
      assert_near(through[0], 0, 1e-15);
      assert_near(sonde_flow_velocity(&flow, at), 0, 1e-15);
    } else {
      assert_near(through[0] / through[1], 4, 1e-9);
      assert_near(through[0] + through[1], whole, 0.005 * whole); // the rest takes ways round
    }
  }
}

// A start is a steady state, with clots as well: nothing moves without breath and beat.
static void test_starts_steady(void **unused) {
  (void)unused;
  for (int clot = -1; clot < SONDE_FLOW_SEGMENTS; ++clot) {
    sonde_flow_def def = sonde_flow_def_default(NULL);
    def.breath_pa = 0, def.breath_rate_hz = 0, def.heart_rate_hz = 5; // the quickest ripple
    if (clot >= 0) def.closed[clot][0] = 1;
    sonde_flow flow = start(&def), first = flow;
    follow(&flow, SONDE_FLOW_CALF, 0, 10);
    for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k)
      assert_near(flow.volume_m3[k] / first.volume_m3[k], 1, 0.01);
  }
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
  course sound = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 4, 10);
  course before = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 10, 13);
  follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 13, 14);
  course pressed = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 14, 17);
  sonde_flow_def iliac = def;
  iliac.closed[SONDE_FLOW_EXTERNAL_ILIAC][0] = 1;
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
  femoral.closed[SONDE_FLOW_FEMORAL][0] = 1;
  flow = start(&femoral);
  course calm = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 10, 13);
  follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 13, 14);
  course below = follow(&flow, SONDE_FLOW_COMMON_FEMORAL, 14, 17);
  // Beyond what the breath does at the same share of it, 4 s before.
  double adds = below.most - calm.most;
  assert_true(adds < 0.4 * (pressed.most - before.most));
  sonde_flow_def leaking = def;
  leaking.leak = 1;
  flow = start(&leaking);
  follow(&flow, SONDE_FLOW_POPLITEAL, 13, 14);
  course reflux = follow(&flow, SONDE_FLOW_POPLITEAL, 14, 20);
  print_message("clot in the thigh: squeeze adds %.1f cm/s; valves that leak: back for %.2f s\n",
                100 * adds, reflux.back_s);
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
  def.area_m2[SONDE_FLOW_FEMORAL][0] = 0;
  assert_int_equal(sonde_flow_start(&def, &flow, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "femoral"));
  def = sonde_flow_def_default(NULL);
  def.leak = 1.5;
  assert_int_equal(sonde_flow_start(&def, &flow, &error), SONDE_ARGUMENT);
}

// A column of blood adds to the pressure, widens and tautens the veins, so that the same breath
// moves less blood more slowly; it drives nothing.
static void test_column(void **unused) {
  (void)unused;
  sonde_flow_def lying = sonde_flow_def_default(NULL), stands = lying;
  for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) stands.column_pa[k] = 22 * SONDE_PA_PER_MMHG;
  stands.column_pa[SONDE_FLOW_CALF] = 60 * SONDE_PA_PER_MMHG;
  sonde_flow a = start(&lying), b = start(&stands);
  const sonde_flow_segment gate = SONDE_FLOW_FEMORAL;
  course low = follow(&a, gate, 4, 16), high = follow(&b, gate, 4, 16);
  const double wider = sonde_flow_area(&b, gate, 0) / sonde_flow_area(&a, gate, 0);
  const double more = sonde_flow_pressure(&b, gate) - sonde_flow_pressure(&a, gate);
  print_message(
      "lying %.1f (%.1f to %.1f) cm/s; standing %.1f (%.1f to %.1f); area %.2f, %.1f mmHg "
      "more\n",
      100 * low.mean, 100 * low.least, 100 * low.most, 100 * high.mean, 100 * high.least,
      100 * high.most, wider, more / SONDE_PA_PER_MMHG);
  assert_near(more / SONDE_PA_PER_MMHG, 22, 1);
  assert_true(wider > 1.3 && wider < 1.8);
  assert_true(high.mean < 0.7 * low.mean);
  assert_true(high.most < 0.8 * low.most);
  // Without breath and beat as much leaves as enters, column or not.
  sonde_flow_def still = stands;
  still.breath_pa = 0;
  b = start(&still);
  const double before = sonde_flow_area(&b, gate, 0);
  follow(&b, gate, 0, 4);
  assert_near(sonde_flow_area(&b, gate, 0) / before, 1, 0.02);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_conserves), cmocka_unit_test(test_poiseuille),
      cmocka_unit_test(test_two_veins), cmocka_unit_test(test_starts_steady),
      cmocka_unit_test(test_sound),     cmocka_unit_test(test_sick),
      cmocka_unit_test(test_column),    cmocka_unit_test(test_refuses)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
