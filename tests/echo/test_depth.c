// Deep and wide pictures: tissue down to the set depth below every face, compensation up to the
// receiver's noise and no further, no white band.
#include "echo/bench.h"

#include <string.h>

typedef struct face {
  double aperture_m, radius_m;
} face;

static void look_with(bench *b, face f) {
  assert_int_equal(sonde_echo_set_radius(b->echo, f.radius_m, NULL), SONDE_OK);
  b->interior->model = &b->leg.model;
  sonde_interior_update(b->interior,
                        &(sonde_interior_input){b->leg.model.surface.vertices, b->forces, b->pose,
                                                &b->pathology, -1, 1, INFINITY, INFINITY, 0,
                                                SONDE_POSTURE_SUPINE, NULL});
  sonde_echo_render(b->echo, b->pose, f.aperture_m, &b->pathology, &b->settings, &b->image);
}

// Mean power of the envelope over some lines from one depth to another.
static double power(const bench *b, uint32_t line0, uint32_t line1, double z0, double z1) {
  uint32_t lines, samples, count = 0;
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples);
  double sum = 0, step = b->settings.depth_m / (samples - 1);
  for (uint32_t n = (uint32_t)ceil(z0 / step); n < samples && n * step < z1; ++n)
    for (uint32_t l = line0; l < line1 && l < lines; ++l, ++count)
      sum += (double)e[(size_t)n * lines + l] * (double)e[(size_t)n * lines + l];
  assert_true(count > 0);
  return sum / count;
}

// In homogeneous muscle each eighth of the face shows speckle of the same power at every depth.
static void speckle_reaches_the_set_depth(void **state) {
  (void)state;
  static const face FACES[] = {{0.04, 0}, {0.1, 0}, {0.06, 0.06}, {0.06, 0.04}, {0.17, 0.1}};
  static const double DEPTHS[] = {0.07, 0.15};
  bench b;
  bench_create(&b, 0.4, 0.014, 2.5e-3, true, false);
  b.settings.frequency_hz = 3e6;
  b.settings.tgc_db_per_m = 2 * 100 * 3 - sonde_echo_default_tgc_db_per_m(3e6);
  for (size_t k = 0; k < SONDE_COUNT_OF(FACES) * SONDE_COUNT_OF(DEPTHS); ++k) {
    face f = FACES[k / 2]; // all of it below the skin
    double sink = f.radius_m > 0 ? f.radius_m * (1 - cos(0.5 * f.aperture_m / f.radius_m)) : 0;
    b.pose = tube_pose(0.4 - 5e-3 - sink, 0.15);
    double worst = 0, depth = b.settings.depth_m = DEPTHS[k % 2], sum = 0;
    look_with(&b, f);
    enum { PARTS = 8 };
    const double top = 0.02, band = 0.01;
    const int bands = (int)((depth - top) / band);
    for (int row = 0; row < bands; ++row)
      sum += power(&b, 24, 168, top + row * band, top + (row + 1) * band) / bands;
    for (int row = 0; row < bands; ++row)
      for (uint32_t part = 0; part < PARTS; ++part) {
        double p = power(&b, 24 * part, 24 * part + 24, top + row * band, top + (row + 1) * band);
        worst = fmax(worst, fabs(10 * log10(fmax(p, 1e-12) / sum)));
      }
    print_message("%.0f mm wide, radius %.0f mm, %.0f mm deep: within %.2f dB\n",
                  1e3 * f.aperture_m, 1e3 * f.radius_m, 1e3 * depth, worst);
    assert_true(worst < 2.5);
  }
  bench_clear(&b);
}

// A view that could not be drawn whole is refused.
static void impossible_views_are_refused(void **state) {
  (void)state;
  sonde_error error;
  assert_int_equal(sonde_echo_check_view(0.04, 0, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_check_view(0.2, 0, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_check_view(0.06, 0.06, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_check_view(0.2, 0.06, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "degrees"));
  assert_int_equal(sonde_echo_check_view(0.21, 0, NULL), SONDE_ARGUMENT);
  assert_int_equal(sonde_echo_check_view((double)NAN, 0, NULL), SONDE_ARGUMENT);
  assert_int_equal(sonde_echo_check_view(0.04, (double)NAN, NULL), SONDE_ARGUMENT);
}

// The widest views fit, however the plane lies in the lattice of the tissue.
static void widest_views_lose_nothing(void **state) {
  (void)state;
  static const face FACES[] = {{0.2, 0}, {0.2, 0.1147}, {0.034, 0.02}};
  bench b;
  bench_create(&b, 0.4, 0.014, 2.5e-3, true, true);
  b.settings.frequency_hz = 1e6;
  b.settings.depth_m = 0.15;
  const sonde_pose straight = b.pose;
  for (size_t k = 0; k < SONDE_COUNT_OF(FACES); ++k)
    for (int turn = 0; turn < 2; ++turn) {
      assert_int_equal(sonde_echo_check_view(FACES[k].aperture_m, FACES[k].radius_m, NULL),
                       SONDE_OK);
      b.pose = straight;
      if (turn)
        b.pose.rotation =
            q_mul(straight.rotation, (sonde_quat){.w = 0.8, .x = 0.36, .y = 0.0, .z = 0.48});
      look_with(&b, FACES[k]);
      sonde_echo_times t = sonde_echo_last_times(b.echo);
      print_message("%.0f mm on %.0f mm: %u scatterers, %u pieces lost\n",
                    1e3 * FACES[k].aperture_m, 1e3 * FACES[k].radius_m, t.scatterers, t.lost);
      assert_int_equal(t.lost, 0);
    }
  bench_clear(&b);
}

// At no depth, frequency or face more than a hundredth of the picture is white.
static void no_view_is_white(void **state) {
  (void)state;
  static const double MHZ[] = {2, 5, 7.5, 12}, DEPTHS[] = {0.04, 0.15};
  static const face FACES[] = {{0.04, 0}, {0.06, 0.06}};
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  double worst = 0;
  for (size_t k = 0; k < 16; ++k) {
    size_t white = 0, pixels = (size_t)b.image.width * b.image.height;
    b.settings.frequency_hz = MHZ[k / 4] * 1e6, b.settings.depth_m = DEPTHS[k / 2 % 2];
    look_with(&b, FACES[k % 2]);
    for (size_t i = 0; i < pixels; ++i) white += b.image.pixels[i] == 255;
    worst = fmax(worst, (double)white / (double)pixels);
  }
  print_message("white: %.3f %% of a picture at most\n", 100 * worst);
  assert_true(worst < 0.01);
  bench_clear(&b);
}

// With the slope of the tissue's own loss a homogeneous leg is evenly bright down to the depth
// where its echo is 6 dB above the receiver's noise, and darker behind it. The noise is measured in
// air.
static void compensation_ends_at_the_noise(void **state) {
  (void)state;
  static const double MHZ[] = {5, 7.5, 10, 12};
  bench b;
  bench_create(&b, 0.4, 0.014, 2.5e-3, true, false);
  for (size_t k = 0; k < SONDE_COUNT_OF(MHZ); ++k) {
    const double hz = MHZ[k] * 1e6, slope = 2 * 100 * MHZ[k], band = 4e-3;
    b.settings.frequency_hz = hz;
    b.settings.depth_m = fmin(0.15, 200 / slope);
    b.pose = tube_pose(0.45, 0.15); // a hand's breadth above the skin
    b.settings.tgc_db_per_m = -sonde_echo_default_tgc_db_per_m(hz);
    look_with(&b, (face){0.04, 0});
    const double noise = power(&b, 0, 192, 0.02, b.settings.depth_m);
    b.pose = tube_pose(0.4 - 3e-3, 0.15);
    look_with(&b, (face){0.04, 0});
    const double muscle = power(&b, 0, 192, 0.01, 0.014) * pow(10, 0.1 * slope * 0.012);
    const double end = 10 * log10(muscle / noise) / slope - 6 / slope;
    b.settings.tgc_db_per_m += slope;
    look_with(&b, (face){0.04, 0});
    double mean = 0, most = 0, behind = 0;
    int bands = (int)((end - 0.01) / band);
    for (int i = 0; i < bands; ++i)
      mean += power(&b, 0, 192, 0.01 + i * band, 0.01 + (i + 1) * band) / bands;
    for (int i = 0; i < bands; ++i)
      most = fmax(
          most, fabs(10 * log10(power(&b, 0, 192, 0.01 + i * band, 0.01 + (i + 1) * band) / mean)));
    behind = 10 * log10(power(&b, 0, 192, end + 0.03, b.settings.depth_m) / mean);
    print_message(
        "%.1f MHz: 6 dB over the noise at %.1f mm, within %.2f dB above, %.1f dB behind\n", MHZ[k],
        1e3 * end, most, behind);
    assert_true(most < 1);
    assert_true(behind < -12);
  }
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(speckle_reaches_the_set_depth),
      cmocka_unit_test(impossible_views_are_refused),
      cmocka_unit_test(widest_views_lose_nothing),
      cmocka_unit_test(no_view_is_white),
      cmocka_unit_test(compensation_ends_at_the_noise),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
