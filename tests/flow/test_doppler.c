// Profiles against exact ones, and what the gate's signal says of the velocity: angle, folding,
// direction, reflux.
#include "sonde/flow.h"

#include "fixture.h"

#include <math.h>

// Mean over the round lumen of a profile.
static double mean_of(const double p[SONDE_FLOW_RINGS]) {
  double sum = 0, h = 1.0 / (SONDE_FLOW_RINGS - 1);
  for (int k = 0; k + 1 < SONDE_FLOW_RINGS; ++k) { // exact for velocities that are linear in a ring
    double a = k * h, b = a + h;
    sum += (p[k] * (2 * a + b) + p[k + 1] * (a + 2 * b)) * h / 3;
  }
  return sum;
}

static void test_profiles(void **unused) {
  (void)unused;
  double p[SONDE_FLOW_RINGS], q[SONDE_FLOW_RINGS], mean[64];
  sonde_flow_steady(0.1, p);
  assert_near(p[0], 0.2, 1e-15);
  assert_near(mean_of(p), 0.1, 1e-4);
  assert_near(p[SONDE_FLOW_RINGS - 1], 0, 1e-15);
  // A pulse's profile carries the mean flow at every phase, and is a parabola when it is slow.
  for (int i = 0; i < 64; ++i) mean[i] = 0.1 + 0.2 * cos(2 * M_PI * i / 64.0);
  for (double phase = 0; phase < 1; phase += 0.125) {
    double wanted = 0.1 + 0.2 * cos(2 * M_PI * phase);
    sonde_flow_pulsed(mean, 64, 4e-3, 1.2, phase, p);
    assert_near(mean_of(p), wanted, 5e-4); // of piecewise linear rings
    assert_near(p[SONDE_FLOW_RINGS - 1], 0, 1e-12);
    sonde_flow_pulsed(mean, 64, 1e-4, 1e-2, phase, p);
    sonde_flow_steady(wanted, q);
    for (int k = 0; k < SONDE_FLOW_RINGS; ++k) assert_near(p[k], q[k], 1e-5);
  }
  // A quick pulse is blunt: the core moves as one, its amplitude that of the mean times
  // 1/(1 - 2/(alpha sqrt(i))) to first order in 1/alpha.
  double radius = 0.02, rate = 4, alpha = radius * sqrt(2 * M_PI * rate / (3.5e-3 / 1060));
  for (int i = 0; i < 64; ++i) mean[i] = cos(2 * M_PI * i / 64.0);
  sonde_flow_pulsed(mean, 64, radius, rate, 0, p);
  double half = sqrt(0.5), re = 1 - 2 / alpha * half, im = 2 / alpha * half;
  assert_near(p[0], re / (re * re + im * im), 0.005);
  assert_near(p[16], p[0], 0.01);
}

// Stepped in time, a steady mean becomes the parabola, a pulse after some beats Womersley's
// profile.
static void test_follows(void **unused) {
  (void)unused;
  double p[SONDE_FLOW_RINGS] = {0}, q[SONDE_FLOW_RINGS], mean[64];
  for (int n = 0; n < 20000; ++n) sonde_flow_follow(p, 4e-3, 0.1, 1e-3);
  for (int k = 0; k < SONDE_FLOW_RINGS; ++k) {
    double r = k / (SONDE_FLOW_RINGS - 1.0);
    assert_near(p[k], 0.2 * (1 - r * r), 3e-4);
  }
  const double rate = 1.25, dt = 0.5e-3; // 1600 steps a beat
  double worst = 0;
  for (int i = 0; i < 64; ++i) mean[i] = 0.1 + 0.3 * cos(2 * M_PI * i / 64.0);
  for (int n = 1; n <= 16000; ++n) {
    double phase = n * dt * rate;
    sonde_flow_follow(p, 4e-3, 0.1 + 0.3 * cos(2 * M_PI * phase), dt);
    if (n <= 14400 || n % 200) continue;
    sonde_flow_pulsed(mean, 64, 4e-3, rate, phase, q);
    for (int k = 0; k < SONDE_FLOW_RINGS; ++k) worst = fmax(worst, fabs(p[k] - q[k]));
  }
  print_message("steps in time against Womersley: within %.2f %% of the pulse\n",
                100 * worst / 0.3);
  assert_true(worst < 0.01 * 0.3);
}

// The truth that a gate sees: the profile weighted by the beam and cut by the gate.
static double gate_mean(const sonde_doppler_def *def, double mean) {
  double sum = 0, weight = 0;
  enum { N = 60 };
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j)
      for (int k = 0; k < N; ++k) {
        double u = (2 * (i + 0.5) / N - 1), v = (2 * (j + 0.5) / N - 1);
        double s = 6e-3 * (2 * (k + 0.5) / N - 1), r2 = u * u + v * v;
        double across = u * def->half_short_m, beside = v * def->half_long_m;
        if (r2 > 1) continue;
        double z = s * cos(def->angle_rad) + across * sin(def->angle_rad);
        double x = s * sin(def->angle_rad) - across * cos(def->angle_rad);
        if (fabs(z) > def->gate_m / 2) continue;
        double w = exp(-pow(x / def->beam_m, 2) - pow(beside / (2 * def->beam_m), 2));
        sum += w * 2 * mean * (1 - r2), weight += w;
      }
  return sum / weight;
}

static void measure(const sonde_doppler_def *def, double mean, double *phase, double *spectral) {
  sonde_doppler *d = NULL;
  sonde_error error = {0};
  double profile[SONDE_FLOW_RINGS];
  assert_int_equal(sonde_doppler_create(def, &d, &error), SONDE_OK);
  sonde_flow_steady(mean, profile);
  *phase = *spectral = 0;
  enum { WINDOWS = 150 };
  for (int k = 0; k < SONDE_DOPPLER_WINDOW_S * def->pulse_hz; ++k) sonde_doppler_pulse(d, profile);
  for (int w = 0; w < WINDOWS; ++w) {
    for (int k = 0; k < SONDE_DOPPLER_BINS; ++k) sonde_doppler_pulse(d, profile);
    sonde_doppler_spectrum s;
    sonde_doppler_read(d, &s);
    *phase += sonde_doppler_phase_velocity(d) / WINDOWS;
    *spectral += s.mean_m_s / WINDOWS;
  }
  sonde_doppler_destroy(d);
}

// Slow blood in a gate across the whole lumen: the filter takes what is slower than 1.2 of 4 cm/s,
// and the mean counts it all the same.
static void test_slow(void **unused) {
  (void)unused;
  sonde_doppler_def def = sonde_doppler_def_default();
  def.gate_m = 2 * def.half_short_m, def.pulse_hz = 1000, def.noise_db = -30, def.filter_hz = 40;
  double phase, spectral, wanted = gate_mean(&def, 0.02);
  measure(&def, 0.02, &phase, &spectral);
  print_message("filter at 1.2 cm/s: %.2f of %.2f cm/s\n", 100 * spectral, 100 * wanted);
  assert_near(spectral / wanted, 1, 0.05);
}

// Steady flow: both estimates within 5 % of the gate's mean from 0 to 60 degrees, either direction.
static void test_velocity(void **unused) {
  (void)unused;
  for (int k = 0; k < 6; ++k) {
    static const double CASE[6][2] = {{60, 0.1}, {60, 0.2},  {30, 0.1},
                                      {0, 0.1},  {120, 0.1}, {60, -0.1}};
    sonde_doppler_def def = sonde_doppler_def_default();
    def.angle_rad = CASE[k][0] * M_PI / 180, def.pulse_hz = 4000, def.noise_db = -30;
    double phase, spectral, wanted = gate_mean(&def, CASE[k][1]), profile[SONDE_FLOW_RINGS];
    sonde_doppler *gate = NULL;
    assert_int_equal(sonde_doppler_create(&def, &gate, NULL), SONDE_OK);
    sonde_flow_steady(CASE[k][1], profile);
    assert_near(sonde_doppler_truth(gate, profile) / wanted, 1, 0.01);
    sonde_doppler_destroy(gate);
    measure(&def, CASE[k][1], &phase, &spectral);
    print_message("%3.0f degrees, %5.2f m/s: phase %.4f, spectrum %.4f of %.4f\n", CASE[k][0],
                  CASE[k][1], phase, spectral, wanted);
    assert_near(phase / wanted, 1, 0.05);
    assert_near(spectral / wanted, 1, 0.05);
  }
}

// Beyond c f_p / (4 f cos) velocities are folded by twice the limit.
static void test_folds(void **unused) {
  (void)unused;
  sonde_doppler_def def = sonde_doppler_def_default();
  def.noise_db = -30, def.pulse_hz = 2000;
  double limit = sonde_doppler_limit(&def), phase, spectral;
  assert_near(limit, 1540 * 2000 / (4 * 5e6 * 0.5), 1e-9);
  double mean = 0.2, wanted = gate_mean(&def, mean) - 2 * limit;
  measure(&def, mean, &phase, &spectral);
  print_message("limit %.3f m/s: %.4f of %.4f\n", limit, phase, wanted);
  assert_near(phase, wanted, 0.05 * fabs(wanted));
}

static void test_refuses(void **unused) {
  (void)unused;
  sonde_doppler *d = NULL;
  sonde_error error = {0};
  sonde_doppler_def def = sonde_doppler_def_default();
  def.angle_rad = M_PI / 2;
  assert_int_equal(sonde_doppler_create(&def, &d, &error), SONDE_ARGUMENT);
  def = sonde_doppler_def_default();
  def.pulse_hz = 0;
  assert_int_equal(sonde_doppler_create(&def, &d, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "pulse"));
  sonde_doppler_destroy(NULL);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_profiles), cmocka_unit_test(test_follows),
      cmocka_unit_test(test_velocity), cmocka_unit_test(test_slow),
      cmocka_unit_test(test_folds),    cmocka_unit_test(test_refuses)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
