// The exact reference in its analytic limits; the fast beam against it; the inner loops against
// their scalar twins.
#include "echo/echo.h"
#include "interior/tube.h"
#include "sonde/echo_validate.h"

#include "base/random.h"

typedef struct bench {
  tube leg;
  sonde_interior *interior;
  sonde_echo_view view;
} bench;

static void bench_create(bench *b) {
  *b = (bench){.leg = tube_create(0.08, 0.014, 0.3, 0.012, 64, 24)};
  assert_int_equal(sonde_interior_create(&b->leg.model, &b->interior, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_create(b->interior, NULL, &b->view.echo, NULL), SONDE_OK);
  b->view.aperture_m = 0.04;
  b->view.settings = sonde_echo_settings_default();
}

static void bench_clear(bench *b) {
  sonde_echo_destroy(b->view.echo);
  sonde_interior_destroy(b->interior);
  tube_clear(&b->leg);
}

static double size_of_echo(const sonde_array *a, double x, double z, double depth) {
  double e[2];
  sonde_array_echo(a, x, z, depth, e);
  return hypot(e[0], e[1]);
}

// At the focus of a point on the axis every path has the same length: the echo peaks at the
// point's depth with the carrier's phase, and its envelope is the pulse itself.
static void a_point_at_the_focus_echoes_the_pulse(void **state) {
  (void)state;
  sonde_array a = sonde_array_default();
  double z = a.focus_m, wavelength = a.sound_m_s / a.frequency_hz, e[2];
  double top = size_of_echo(&a, 0, z, z);
  double half = 0.5 * a.pulse_wavelengths * wavelength;
  assert_true(fabs(size_of_echo(&a, 0, z, z - half) / top - 0.5) < 0.01);
  assert_true(fabs(size_of_echo(&a, 0, z, z + half) / top - 0.5) < 0.01);
  sonde_array_echo(&a, 0, z, z, e);
  double turns = 2 * z / wavelength;
  double expected = -2 * SONDE_PI * (turns - floor(turns));
  assert_true(fabs(remainder(atan2(e[1], e[0]) - expected, 2 * SONDE_PI)) < 1e-6);
  // The focus is the loudest place of the axis for a far receiver; beside it the beam falls.
  assert_true(size_of_echo(&a, 0.6e-3, z, z) < 0.1 * top);
}

// With equal apertures sender and receiver may change places: the sum over paths stays the same
// when the array is mirrored, and a point seen from the other side.
static void paths_are_reciprocal(void **state) {
  (void)state;
  sonde_array a = sonde_array_default();
  a.receive_f = a.transmit_f; // at the focus the receive aperture is the transmit aperture
  for (int k = 0; k < 5; ++k) {
    double x = 0.2e-3 * k, z = a.focus_m + 0.3e-3 * k, left[2], right[2];
    sonde_array_echo(&a, x, z, a.focus_m, left);
    sonde_array_echo(&a, -x, z, a.focus_m, right);
    assert_true(fabs(left[0] - right[0]) < 1e-12 && fabs(left[1] - right[1]) < 1e-12);
  }
}

static void the_table_equals_the_double_sum(void **state) {
  (void)state;
  sonde_array a = sonde_array_default();
  for (int curved = 0; curved < 2; ++curved) {
    a.radius_m = curved ? 0.05 : 0;
    for (double z = 0.008; z < 0.05; z += 0.012)
      for (double x = 0; x < 1e-3; x += 0.3e-3) {
        double line[2 * 21], peak = 0, off = 0, step = 0.05e-3;
        sonde_array_line(&a, x, z, z - 10 * step, step, 21, line);
        for (int n = 0; n < 21; ++n) {
          double e[2];
          sonde_array_echo(&a, x, z, z + (n - 10) * step, e);
          peak = fmax(peak, hypot(e[0], e[1]));
          off = fmax(off, hypot(e[0] - line[2 * n], e[1] - line[2 * n + 1]));
        }
        assert_true(off < 1e-3 * fmax(peak, size_of_echo(&a, 0, z, z) * 0.05));
      }
  }
}

// Far from a curved face of great radius the flat face is its limit.
static void great_radius_is_flat(void **state) {
  (void)state;
  sonde_array flat = sonde_array_default(), curved = flat;
  curved.radius_m = 1e4;
  double e[2], f[2];
  sonde_array_echo(&flat, 0.3e-3, 0.03, 0.03, e);
  sonde_array_echo(&curved, 0.3e-3, 0.03, 0.03, f);
  assert_true(hypot(e[0] - f[0], e[1] - f[1]) < 1e-3 * hypot(e[0], e[1]));
}

// A focused slit of height H is sinc-shaped at its focus: half values of the two-way amplitude at
// sinc^2 = 1/2, y = 0.4430 wavelength z / H.
static void elevation_is_the_slit_at_its_focus(void **state) {
  (void)state;
  sonde_array a = sonde_array_default();
  double y = 0.44295 * a.sound_m_s / a.frequency_hz * a.lens_m / a.height_m;
  assert_true(fabs(sonde_array_elevation(&a, y, a.lens_m) - 0.5) < 0.01);
  double h = sonde_array_elevation_half(&a, a.lens_m);
  assert_true(fabs(1 - y * y / (h * h) - 0.5) < 0.02);
}

static void speckle_is_that_of_the_reference(void **state) {
  (void)state;
  bench b;
  bench_create(&b);
  const double depths[] = {0.012, 0.018, 0.025, 0.032, 0.045};
  for (int k = 0; k < 5; ++k) {
    double likeness = 0;
    assert_int_equal(sonde_echo_likeness(&b.view, depths[k], 600, 7, &likeness, NULL), 0);
    print_message("%.0f mm: likeness %.4f\n", depths[k] * 1e3, likeness);
    assert_true(likeness >= 0.98);
  }
  bench_clear(&b);
}

static void widths_are_those_of_the_reference(void **state) {
  (void)state;
  bench b;
  bench_create(&b);
  for (double z = 0.012; z < 0.05; z += 0.004) {
    sonde_echo_widths fast, exact;
    assert_int_equal(sonde_echo_point_widths(&b.view, z, &fast, &exact, NULL), 0);
    print_message("%.0f mm: axial %.3f (%.3f) mm, lateral %.3f (%.3f) mm\n", z * 1e3,
                  fast.axial_m * 1e3, exact.axial_m * 1e3, fast.lateral_m * 1e3,
                  exact.lateral_m * 1e3);
    assert_true(fabs(fast.axial_m / exact.axial_m - 1) < 0.03);
    assert_true(fabs(fast.lateral_m / exact.lateral_m - 1) < 0.05);
  }
  bench_clear(&b);
}

static void motion_within_a_sample_does_not_flicker(void **state) {
  (void)state;
  bench b;
  bench_create(&b);
  double flicker = 1;
  assert_int_equal(sonde_echo_flicker(&b.view, 0.025, 2000, 3, &flicker, NULL), 0);
  print_message("flicker %.4f\n", flicker);
  assert_true(flicker < 0.013);
  bench_clear(&b);
}

// Scatterers on the middle ray of a sector appear on its middle line, those on an outer ray on the
// outer line.
static void sector_lines_fan_out(void **state) {
  (void)state;
  bench b;
  bench_create(&b);
  assert_int_equal(sonde_echo_set_radius(b.view.echo, 0.01, NULL), SONDE_ARGUMENT);
  assert_int_equal(sonde_echo_set_radius(b.view.echo, 0.05, NULL), SONDE_OK);
  double angle = 0.5 * (0.04 / 0.05) * (100 - 95.5) / 95.5, r = 0.05 + 0.03;
  sonde_echo_point p = {.x_m = r * sin(angle), .z_m = r * cos(angle) - 0.05, .amplitude = 1};
  sonde_echo_render_points(b.view.echo, 0.04, &b.view.settings, &p, 1);
  uint32_t lines, samples, best = 0;
  const float *e = sonde_echo_envelope(b.view.echo, &lines, &samples);
  for (uint32_t i = 0; i < lines * samples; ++i)
    if (e[i] > e[best]) best = i;
  assert_int_equal(best % lines, 100);
  assert_true(fabs(best / lines * (0.07 / (samples - 1)) - 0.03) < 1e-4);
  double likeness = 0;
  assert_int_equal(sonde_echo_likeness(&b.view, 0.03, 300, 7, &likeness, NULL), 0);
  print_message("curved, 30 mm: likeness %.4f\n", likeness);
  assert_true(likeness >= 0.98);
  bench_clear(&b);
}

// All sets of inner loops give the same bits; the scalar twins agree to single precision.
static void kernels_agree(void **state) {
  (void)state;
  static const char *const names[] = {"base", "sse4", "avx2", "avx512", "plain"};
  bench b;
  bench_create(&b);
  b.view.settings.depth_m = 0.05;
  sonde_pathology healthy;
  sonde_image image[2];
  sonde_pathology_preset("healthy", &healthy, NULL);
  sonde_vec3 *forces = SONDE_NEW(sonde_vec3, b.leg.model.surface.vertex_count);
  sonde_pose pose = tube_pose(0.079, 0.15);
  sonde_interior_update(
      b.interior, &(sonde_interior_input){b.leg.model.surface.vertices, forces, pose, &healthy, -1,
                                          1, INFINITY, INFINITY, 0, SONDE_POSTURE_SUPINE, NULL});
  for (int k = 0; k < 2; ++k) assert_int_equal(sonde_image_create(300, 277, &image[k], NULL), 0);
  for (int curved = 0; curved < 2; ++curved) {
    assert_int_equal(sonde_echo_set_radius(b.view.echo, curved ? 0.06 : 0, NULL), 0);
    assert_int_equal(sonde_echo_set_kernels(b.view.echo, "base", NULL), 0);
    sonde_echo_render(b.view.echo, pose, 0.04, &healthy, &b.view.settings, &image[0]);
    for (int k = 1; k < 5; ++k) {
      if (sonde_echo_set_kernels(b.view.echo, names[k], NULL) != SONDE_OK) continue;
      sonde_echo_render(b.view.echo, pose, 0.04, &healthy, &b.view.settings, &image[1]);
      double most = 0, mean = 0;
      for (int i = 0; i < 300 * 277; ++i) {
        double off = abs(image[0].pixels[i] - image[1].pixels[i]);
        most = fmax(most, off), mean += off / (300 * 277);
      }
      print_message("%s: %.4f grey levels apart, most %.0f\n", names[k], mean, most);
      assert_true(k < 4 ? most == 0 : mean < 0.02);
    }
  }
  assert_int_equal(sonde_echo_set_kernels(b.view.echo, "none", NULL), SONDE_NOT_FOUND);
  for (int k = 0; k < 2; ++k) sonde_image_clear(&image[k]);
  sonde_free(forces);
  bench_clear(&b);
}

static void render(bench *b, const sonde_echo_settings *settings, float *out) {
  uint32_t lines, samples;
  const sonde_echo_point p[2] = {{1e-3, 0, 0.012, 1}, {-4e-3, 0, 0.031, 1}};
  sonde_echo_render_points(b->view.echo, 0.04, settings, p, 2);
  const float *e = sonde_echo_envelope(b->view.echo, &lines, &samples);
  memcpy(out, e, sizeof(float) * lines * samples);
}

// A beam built in slices between frames that use another one is, to the bit, the one that a frame
// builds at once; the frames in between are not disturbed.
static void prepared_beams_are_built_beams(void **state) {
  (void)state;
  enum { COUNT = 192 * 1024 };
  bench b, c;
  bench_create(&b);
  bench_create(&c);
  float *old = SONDE_NEW(float, COUNT), *now = SONDE_NEW(float, COUNT);
  float *wanted = SONDE_NEW(float, COUNT);
  sonde_echo_settings next = b.view.settings;
  next.frequency_hz = 5e6, next.depth_m = 0.055, next.focus_m = 0.03;
  render(&c, &next, wanted);
  render(&b, &b.view.settings, old);
  uint32_t calls = 1;
  for (; !sonde_echo_prepare(b.view.echo, 0.04, &next, 5); ++calls) {
    render(&b, &b.view.settings, now);
    if (calls % 3 == 0) assert_memory_equal(now, old, sizeof(float) * COUNT);
  }
  assert_int_equal(calls, (SONDE_ECHO_PREPARE_STEPS + 4) / 5);
  const beam_psf *ready = b.view.echo->spare;
  render(&b, &next, now);
  assert_ptr_equal(b.view.echo->psf, ready); // taken, not built again
  assert_memory_equal(now, wanted, sizeof(float) * COUNT);
  // the beam before is kept; a half-built one is finished by the render that needs it
  assert_true(sonde_echo_prepare(b.view.echo, 0.04, &b.view.settings, 0));
  sonde_echo_settings third = next;
  third.focus_m = 0.02;
  assert_false(sonde_echo_prepare(b.view.echo, 0.04, &third, 7));
  render(&b, &third, now);
  render(&c, &third, wanted);
  assert_memory_equal(now, wanted, sizeof(float) * COUNT);
  float *buffers[] = {old, now, wanted};
  for (int k = 0; k < 3; ++k) sonde_free(buffers[k]);
  bench_clear(&b);
  bench_clear(&c);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_point_at_the_focus_echoes_the_pulse),
      cmocka_unit_test(paths_are_reciprocal),
      cmocka_unit_test(the_table_equals_the_double_sum),
      cmocka_unit_test(great_radius_is_flat),
      cmocka_unit_test(elevation_is_the_slit_at_its_focus),
      cmocka_unit_test(speckle_is_that_of_the_reference),
      cmocka_unit_test(widths_are_those_of_the_reference),
      cmocka_unit_test(motion_within_a_sample_does_not_flicker),
      cmocka_unit_test(sector_lines_fan_out),
      cmocka_unit_test(kernels_agree),
      cmocka_unit_test(prepared_beams_are_built_beams),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
