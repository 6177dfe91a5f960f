// The scanner's chain: looks, display, live pictures.
#include "base/random.h"
#include "echo/bench.h"
#include "echo/echo.h"
#include "echo/live.h"

#include <string.h>

static void assert_within(double value, double low, double high) {
  if (!(value >= low && value <= high)) fail_msg("%.9g, expected %.9g to %.9g", value, low, high);
}

// A scanner that uses every part of the chain.
static sonde_scanner full_scanner(void) {
  uint32_t count;
  const sonde_scanner_number *n = sonde_scanner_numbers(&count);
  sonde_scanner s = {0};
  for (uint32_t k = 0; k < count; ++k)
    *(double *)(void *)((char *)&s + n[k].offset) = n[k].plain * n[k].si;
  s.transmit_f = 5, s.receive_f = 4, s.looks = 3, s.look_rad = 9 * SONDE_PI / 180;
  return s;
}

static void set_scanner(bench *b, const sonde_scanner *scanner, bool plain, bool rolling) {
  sonde_echo_destroy(b->echo);
  sonde_echo_def def = {.version = SONDE_DEF_VERSION,
                        .plain = plain,
                        .seed = 5,
                        .scanner = scanner,
                        .rolling = rolling};
  assert_int_equal(sonde_echo_create(b->interior, &def, &b->echo, NULL), SONDE_OK);
}

// Mean over deviation of the envelope in tissue without structure, between depths of even muscle.
static double speckle_ratio(const bench *b) {
  uint32_t lines, samples;
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples);
  double sum = 0, square = 0, n = 0;
  for (uint32_t s = samples * 45 / 100; s < samples * 65 / 100; ++s) {
    // Depths differ by a little: each row is taken by its own mean.
    double mean = 0;
    for (uint32_t l = 10; l < lines - 10; ++l) mean += (double)e[s * lines + l];
    mean /= lines - 20;
    for (uint32_t l = 10; l < lines - 10; ++l) {
      double x = (double)e[s * lines + l] / mean;
      sum += x, square += x * x, n += 1;
    }
  }
  return sum / n / sqrt(square / n - sum * sum / n / n);
}

// The mean of looks has less speckle by K / sqrt(sum of the envelopes' correlations), where that of
// two looks is the square of the overlap of their pass bands, the beam's intensity seen through
// the difference of their ramps.
static void looks_average_speckle_as_their_overlap_says(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 0, true, false);
  sonde_scanner s = full_scanner();
  s.looks = 1, s.look_rad = 0, s.haze_db = -89;
  double ratio[2] = {0}, theory = 0;
  for (int k = 0; k < 2; ++k) {
    if (k) s.looks = 3, s.look_rad = 9 * SONDE_PI / 180;
    set_scanner(&b, &s, true, false);
    for (int place = 0; place < 6; ++place) {
      b.pose = tube_pose(leg_radius - 3e-3, 0.10 + 0.015 * place);
      look(&b, NULL);
      ratio[k] += speckle_ratio(&b) / 6;
    }
  }
  // The overlap, from the kernels at the middle of the measured depths.
  int above;
  const beam_psf *psf = b.echo->psf;
  sonde_psf_depth(psf, 0.55 * b.settings.depth_m, &above);
  double correlations = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double turn = 4 * SONDE_PI / b.echo->frame.wavelength_m *
                          (sin((i - 1) * s.look_rad) - sin((j - 1) * s.look_rad)) *
                          b.echo->frame.pitch_m / SONDE_FINE;
      double over = 0, all = 0;
      for (int l = 0; l <= psf->half[above]; ++l)
        for (int k = 0; k < SONDE_RANK; ++k) {
          const float *tap = psf->lateral[above][l][k];
          const double re = (double)tap[0], im = (double)tap[2] - re;
          const double power = (l ? 2 : 1) * (re * re + im * im);
          over += power * cos(turn * l), all += power;
        }
      correlations += over / all * over / all;
    }
  theory = 3 / sqrt(correlations);
  print_message("ratio of speckle: one look %.3f, three %.3f; gain %.3f, by the overlap %.3f\n",
                ratio[0], ratio[1], ratio[1] / ratio[0], theory);
  assert_within(ratio[0], 1.91 * 0.95, 1.91 * 1.05);
  assert_within(ratio[1] / ratio[0], 0.95 * theory, 1.05 * theory);
  bench_clear(&b);
}

// Depth of the brightest echo of the lumen's middle line within a millimetre of a depth, between
// samples.
static double wall_at(const bench *b, uint32_t line, double depth_m) {
  uint32_t lines, samples;
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples) + line;
  const double step = b->echo->frame.step_m;
  const uint32_t first = (uint32_t)((depth_m - 1e-3) / step);
  uint32_t top = first;
  for (uint32_t n = first; n < (uint32_t)((depth_m + 1e-3) / step); ++n)
    if (e[n * lines] > e[top * lines]) top = n;
  const double x = (double)e[(top - 1) * lines], y = (double)e[top * lines],
               z = (double)e[(top + 1) * lines];
  return step * (top + 0.5 * (x - z) / (x - 2 * y + z));
}

// Walls stay where they are: from the near wall of the vein to the far one it is as far by one look
// as by three.
static void looks_leave_lumina_as_wide(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 4e-3, true, true);
  sonde_scanner s = full_scanner();
  s.haze_db = -89;
  double wide[2] = {0}, true_m = 0;
  for (int k = 0; k < 2; ++k) {
    s.looks = k ? 3 : 1;
    set_scanner(&b, &s, true, false);
    // The beam looks at the vein's centre.
    sonde_vessel_state vein = {0};
    look(&b, NULL);
    assert_true(sonde_interior_vessel_at_plane(b.interior, 0, b.pose, &vein));
    if (k == 0) {
      sonde_vec3 at = pose_apply_inverse(b.pose, vein.centre_m);
      b.pose.position = v_madd(b.pose.position, at.x, q_rotate(b.pose.rotation, vec3(1, 0, 0)));
      look(&b, NULL);
      assert_true(sonde_interior_vessel_at_plane(b.interior, 0, b.pose, &vein));
    }
    sonde_vec3 at = pose_apply_inverse(b.pose, vein.centre_m);
    true_m = 2 * vein.half_short_m;
    const uint32_t line = (uint32_t)(b.echo->frame.first_line + at.x / b.echo->frame.pitch_m);
    wide[k] =
        wall_at(&b, line, at.z + vein.half_short_m) - wall_at(&b, line, at.z - vein.half_short_m);
  }
  print_message("vein of %.3f mm: %.3f mm by one look, %.3f by three\n", 1e3 * true_m,
                1e3 * wide[0], 1e3 * wide[1]);
  assert_within(wide[0] - true_m, -0.4e-3, 0.4e-3);
  assert_within(wide[1] - wide[0], -0.05e-3, 0.05e-3);
  bench_clear(&b);
}

// A live picture draws one look after the other: of still tissue it is the still picture, which
// does not change from frame to frame.
static void live_picture_of_still_tissue_is_the_still(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 4e-3, false, true);
  sonde_scanner s = full_scanner();
  s.haze_db = -30, s.filter = 0.5, s.map_gamma = 1.5, s.cubic = 1, s.persistence = 0.5;
  set_scanner(&b, &s, false, false);
  look(&b, NULL);
  const size_t pixels = (size_t)b.image.width * b.image.height;
  uint8_t *still = SONDE_NEW(uint8_t, pixels);
  memcpy(still, b.image.pixels, pixels);
  set_scanner(&b, &s, false, true);
  for (int k = 0; k < 5; ++k) {
    look(&b, NULL);
    assert_memory_equal(b.image.pixels, still, pixels);
  }
  // Moved by a millimetre it shows what it saw before, and forgets it with the third picture.
  s.persistence = 0;
  set_scanner(&b, &s, false, true);
  look(&b, NULL);
  b.pose.position = v_madd(b.pose.position, 1e-3, q_rotate(b.pose.rotation, vec3(1, 0, 0)));
  for (int k = 0; k < 3; ++k) look(&b, NULL);
  memcpy(still, b.image.pixels, pixels);
  set_scanner(&b, &s, false, false);
  look(&b, NULL);
  assert_memory_equal(b.image.pixels, still, pixels);
  sonde_free(still);
  bench_clear(&b);
}

// Begun anew, a live picture shows nothing of those before: it is the first one of a new renderer.
static void a_live_picture_begun_anew_forgets(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 4e-3, false, true);
  sonde_scanner s = full_scanner();
  s.haze_db = -30, s.filter = 0.5, s.persistence = 0.5;
  set_scanner(&b, &s, false, true);
  look(&b, NULL);
  const size_t pixels = (size_t)b.image.width * b.image.height;
  uint8_t *first = SONDE_NEW(uint8_t, pixels);
  memcpy(first, b.image.pixels, pixels);
  const sonde_pose here = b.pose;
  for (int k = 0; k < 4; ++k) {
    b.pose.position = v_madd(here.position, 4e-3 * (k + 1), vec3(k % 2, -0.5, 1));
    look(&b, NULL);
    b.pose = here;
    sonde_echo_begin_looks(b.echo);
    look(&b, NULL);
    uint32_t differ = 0, most = 0;
    for (size_t i = 0; i < pixels; ++i) {
      const uint32_t off = (uint32_t)abs(b.image.pixels[i] - first[i]);
      differ += off > 0, most = off > most ? off : most;
    }
    if (differ) fail_msg("%u of %zu pixels differ, by %u at most", differ, pixels, most);
  }
  sonde_free(first);
  bench_clear(&b);
}

// All kernels draw the same bits, those without vectors the same grey values within rounding.
static void kernels_agree_on_a_full_scanner(void **state) {
  (void)state;
  static const char *const names[] = {"sse4", "avx2", "avx512", "plain"};
  static bench b;
  bench_create(&b, 0.08, 0.01, 4e-3, false, true);
  sonde_scanner s = full_scanner();
  s.haze_db = -30, s.ghost_db = -14, s.filter = 0.5, s.map_gamma = 1.5, s.cubic = 1;
  s.sharpening = 0.5, s.noise_db = -80, s.sound_speeds = 1;
  const size_t pixels = (size_t)b.image.width * b.image.height;
  uint8_t *base = SONDE_NEW(uint8_t, pixels);
  for (int curved = 0; curved < 2; ++curved) {
    set_scanner(&b, &s, false, false);
    assert_int_equal(sonde_echo_set_radius(b.echo, curved ? 0.06 : 0, NULL), SONDE_OK);
    assert_int_equal(sonde_echo_set_kernels(b.echo, "base", NULL), SONDE_OK);
    look(&b, NULL);
    memcpy(base, b.image.pixels, pixels);
    for (size_t k = 0; k < SONDE_COUNT_OF(names); ++k) {
      if (sonde_echo_set_kernels(b.echo, names[k], NULL)) continue;
      look(&b, NULL);
      if (strcmp(names[k], "plain") != 0) {
        assert_memory_equal(b.image.pixels, base, pixels);
        continue;
      }
      uint32_t off = 0;
      for (size_t i = 0; i < pixels; ++i) off += abs(b.image.pixels[i] - base[i]) > 1;
      assert_true(off <= pixels / 1000);
    }
  }
  sonde_free(base);
  bench_clear(&b);
}

// The compensation ends at the scanner's ceiling; sliders are met where they stand, and between
// two the gain stays between them.
static void sliders_and_ceiling_shape_the_compensation(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 0, true, false);
  sonde_scanner s = full_scanner();
  const double sliders[SONDE_SCANNER_SLIDERS] = {-6, 3, 3, 12, -12, 0, 4, 5};
  s.compensation_db = 45;
  memcpy(s.slider_db, sliders, sizeof sliders);
  set_scanner(&b, &s, true, false);
  look(&b, NULL);
  const frame *f = &b.echo->frame;
  for (int k = 0; k < SONDE_SCANNER_SLIDERS; ++k) {
    const double z = f->depth_m * k / (SONDE_SCANNER_SLIDERS - 1);
    const double slope = fmin(f->tgc_db_per_m * z, 45);
    assert_within(sonde_echo_compensation_db(f, z) - slope, sliders[k] - 1e-9, sliders[k] + 1e-9);
    for (int i = 1; i < 10 && k + 1 < SONDE_SCANNER_SLIDERS; ++i) {
      const double at = z + f->depth_m * i / 10 / (SONDE_SCANNER_SLIDERS - 1);
      const double gain = sonde_echo_compensation_db(f, at) - fmin(f->tgc_db_per_m * at, 45);
      assert_within(gain, fmin(sliders[k], sliders[k + 1]) - 1e-9,
                    fmax(sliders[k], sliders[k + 1]) + 1e-9);
    }
  }
  bench_clear(&b);
}

// Grey values that the display makes of an envelope: brightness by a function of place.
static void display(bench *b, float (*of)(double x, double z, uint32_t number)) {
  const uint32_t stride = b->echo->padded;
  for (uint32_t n = 0; n < b->echo->samples; ++n)
    for (uint32_t l = 0; l < stride; ++l)
      for (uint32_t k = 0; k < b->echo->looks; ++k)
        b->echo->look[k][n * stride + l] = of((l - 0.5 * b->echo->lines) * b->echo->frame.pitch_m,
                                              n * b->echo->frame.step_m, n * stride + l);
  sonde_echo_display(b->echo);
}

// A slanted edge of 20 dB at 40 mm.
static float edge(double x, double z, uint32_t number) {
  (void)number;
  return z - 0.3 * x > 0.04 ? 10 : 1;
}

// Smoothing keeps edges: along lines of tissue, not across.
static void filter_keeps_an_edge(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 0, true, false);
  sonde_scanner s = full_scanner();
  double step[2], place[2];
  for (int k = 0; k < 2; ++k) {
    s.looks = 1, s.filter = k, s.haze_db = -89;
    set_scanner(&b, &s, true, false);
    look(&b, NULL);
    display(&b, edge);
    const uint32_t l = b.echo->lines / 2, near = (uint32_t)(0.04 / b.echo->frame.step_m);
    const float *g = b.echo->grey + l;
    const float above = g[(near - 20) * b.echo->padded], below = g[(near + 20) * b.echo->padded];
    step[k] = (double)(g[(near + 5) * b.echo->padded] - g[(near - 5) * b.echo->padded]);
    place[k] = 0;
    for (uint32_t n = near - 20; n < near + 20; ++n)
      place[k] += (double)((below - g[n * b.echo->padded]) / (below - above));
  }
  print_message("edge of %.1f grey levels, smoothed %.1f; moved by %.2f samples\n", step[0],
                step[1], place[1] - place[0]);
  assert_true(step[1] >= 0.9 * step[0]);
  assert_within(place[1] - place[0], -1, 1);
  bench_clear(&b);
}

// Slanted lines of 12 dB every 2 mm under speckle.
static float slanted_lines(double x, double z, uint32_t number) {
  const double phase = (z - 0.2 * x) / 2e-3 - floor((z - 0.2 * x) / 2e-3);
  const double speckle = sqrt(-2 * log(sonde_random_uniform(7, number) + 1e-9));
  return (float)(pow(10, (phase < 0.3 ? 12 : 0) / 20.0) * speckle);
}

// Smoothing follows the lines: grey values along one differ less, lines and what lies between them
// stay as far apart.
static void filter_smooths_along_lines(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 0, true, false);
  sonde_scanner s = full_scanner();
  double rough[2], contrast[2];
  for (int k = 0; k < 2; ++k) {
    s.looks = 1, s.filter = k ? 0.8 : 0, s.haze_db = -89, s.white_db = 30;
    set_scanner(&b, &s, true, false);
    look(&b, NULL);
    display(&b, slanted_lines);
    double sum[2] = {0}, square[2] = {0}, n[2] = {0};
    for (uint32_t i = 300; i < 700; ++i)
      for (uint32_t l = 20; l < b.echo->lines - 20; ++l) {
        const double x = (l - 0.5 * b.echo->lines) * b.echo->frame.pitch_m;
        const double line = (i * b.echo->frame.step_m - 0.2 * x) / 2e-3, at = line - floor(line);
        const int which = at > 0.05 && at < 0.25 ? 1 : at > 0.5 && at < 0.8 ? 0 : -1;
        if (which < 0) continue;
        const double grey = (double)b.echo->grey[(size_t)i * b.echo->padded + l];
        sum[which] += grey, square[which] += grey * grey, n[which] += 1;
      }
    contrast[k] = sum[1] / n[1] - sum[0] / n[0];
    rough[k] = sqrt(square[1] / n[1] - sum[1] / n[1] * sum[1] / n[1]);
  }
  print_message("lines %.1f grey levels over what lies between, smoothed %.1f; deviation along "
                "them %.1f, smoothed %.1f\n",
                contrast[0], contrast[1], rough[0], rough[1]);
  assert_within(contrast[1] / contrast[0], 0.95, 1.05);
  assert_within(rough[1] / rough[0], 0.4, 0.65);
  bench_clear(&b);
}

static float even_decibels;

static float even(double x, double z, uint32_t number) {
  (void)x, (void)z, (void)number;
  return (float)pow(10, even_decibels / 20);
}

// A live picture keeps its share of what was before where little changes, and follows at once where
// much does.
static void persistence_keeps_small_changes(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 0, true, false);
  sonde_scanner s = full_scanner();
  s.looks = 1, s.persistence = 0.6, s.white_db = 40;
  set_scanner(&b, &s, true, true);
  look(&b, NULL);
  const double per_db = 255 / b.settings.dynamic_range_db;
  const float *grey = b.echo->grey + (size_t)500 * b.echo->padded + 90;
  double shown[4];
  for (int k = 0; k < 3; ++k) {
    // Fresh, 10 grey levels brighter, then the same once more.
    b.echo->is_held = k > 0;
    even_decibels = (float)(k ? 10 / per_db : 0);
    display(&b, even);
    shown[k] = (double)*grey;
  }
  even_decibels = (float)(100 / per_db);
  display(&b, even);
  shown[3] = (double)*grey;
  print_message("grey %.1f, %.1f, %.1f, %.1f\n", shown[0], shown[1], shown[2], shown[3]);
  assert_within(shown[1] - shown[0], 3.9, 4.1);
  assert_within(shown[2] - shown[0], 6.3, 6.5);
  assert_within(shown[3] - shown[0], 99.8, 100.2);
  bench_clear(&b);
}

// Sum of the sheets on a column within half a sample of a depth, without the carrier's phase there.
static void sheet_at(const bench *b, uint32_t column, double depth_m, double *re, double *im) {
  const frame *f = &b->echo->frame;
  const double row = depth_m / f->step_m + b->echo->pad_samples;
  const double angle = 4 * SONDE_PI / f->wavelength_m * depth_m;
  double sum[2] = {0};
  for (int side = -1; side <= 1; ++side) {
    const uint32_t n = (uint32_t)(row + 0.5) + (uint32_t)(side + 1) - 1;
    for (int32_t k = b->echo->first_sheet[n]; k >= 0; k = b->echo->sheet[k].next) {
      const sheet_point *p = &b->echo->sheet[k];
      if (p->column != column || fabs(n + (double)p->beyond - row) > 0.01) continue;
      sum[0] += (double)p->re, sum[1] += (double)p->im;
    }
  }
  *re = sum[0] * cos(angle) - sum[1] * sin(angle);
  *im = sum[0] * sin(angle) + sum[1] * cos(angle);
}

// The face sends an interface's echo back once more: it appears again at twice its depth, by the
// face's level times its own, in phase with its way; also behind interfaces that lie where others
// have their ghosts.
static void interfaces_have_ghosts(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 0, true, false);
  sonde_scanner s = full_scanner();
  s.looks = 1, s.ghost_db = -14;
  set_scanner(&b, &s, true, false);
  look(&b, NULL);
  const double depth[3] = {8e-3, 16e-3, 24.3e-3}, level_db[3] = {30, 24, 36}, mirror_db = 50;
  const uint32_t line = 90, column = b.echo->pad_lines + SONDE_FINE * line;
  // The deepest comes first into its list.
  sonde_sheet_begin(b.echo);
  for (int k = 2; k >= 0; --k)
    sonde_sheet_add(b.echo, line, (float)depth[k], 0, amplitude_of_db((float)level_db[k]));
  sonde_echo_ghosts(b.echo);
  for (int k = 0; k < 3; ++k) {
    double re, im;
    sheet_at(&b, column, 2 * depth[k], &re, &im);
    // What lies at 16 mm itself is no ghost.
    if (k == 0) re -= pow(10, level_db[1] / 20);
    const double expected = pow(10, (2 * level_db[k] + s.ghost_db - mirror_db) / 20);
    print_message("ghost of %.1f mm: %.3f + %.3f i, expected %.3f\n", 1e3 * depth[k], re, im,
                  expected);
    assert_within(hypot(re, im), 0.95 * expected, 1.05 * expected);
    assert_true(re > 0.9 * expected);
  }
  // None without a face that reflects.
  s.ghost_db = -90;
  set_scanner(&b, &s, true, false);
  look(&b, NULL);
  sonde_sheet_begin(b.echo);
  sonde_sheet_add(b.echo, line, 8e-3f, 0, 30);
  const uint32_t count = b.echo->sheet_count;
  sonde_echo_ghosts(b.echo);
  assert_int_equal(b.echo->sheet_count, count);
  bench_clear(&b);
}

// What no scanner can be is refused by name.
static void absurd_scanners_are_refused(void **state) {
  (void)state;
  static bench b;
  bench_create(&b, 0.08, 0.01, 0, true, false);
  sonde_error error;
  sonde_echo *echo;
  sonde_scanner s = full_scanner();
  sonde_echo_def def = {.version = SONDE_DEF_VERSION, .scanner = &s};
  s.map_gamma = (double)NAN;
  assert_int_equal(sonde_echo_create(b.interior, &def, &echo, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "map_gamma"));
  s = full_scanner(), s.looks = 9;
  assert_int_equal(sonde_echo_create(b.interior, &def, &echo, &error), SONDE_ARGUMENT);
  s = full_scanner(), s.slider_db[3] = 13;
  assert_int_equal(sonde_echo_create(b.interior, &def, &echo, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "slider 4"));
  bench_clear(&b);
}

// Aberration takes of a column what it gives to those beside it: a point keeps its share, its power
// stays, and that of a row of many columns as well.
static void aberration_moves_power(void **state) {
  (void)state;
  enum { COUNT = 512, WHOLE = COUNT + 2 * HAZE_REACH };
  static float in[2][WHOLE], ramp[2][COUNT], out[2][COUNT], kept[COUNT];
  const halo_taps halo = {{-5, -2, 2, 5}};
  look_job job = {.kept = kept, .kept_low = kept, .halo = &halo, .count = COUNT};
  for (int k = 0; k < SONDE_FINE; ++k) {
    job.re[k] = in[0] + HAZE_REACH, job.im[k] = in[1] + HAZE_REACH;
    job.ramp_re[k] = ramp[0], job.ramp_im[k] = ramp[1];
    job.out_re[k] = out[0], job.out_im[k] = out[1];
  }
  for (int l = 0; l < COUNT; ++l) ramp[0][l] = 1, kept[l] = 0.6f;
  for (int point = 0; point < 2; ++point) {
    double before = 0, after = 0;
    for (int l = 0; l < COUNT; ++l) {
      const bool empty = point ? l != COUNT / 2 : l < HAZE_REACH || l >= COUNT - HAZE_REACH;
      for (int c = 0; c < 2; ++c) {
        const double at = sonde_random_uniform(7, (uint64_t)(2 * l + c)) - 0.5;
        in[c][HAZE_REACH + l] = empty ? 0 : (float)at;
        before += empty ? 0 : at * at;
      }
    }
    sonde_echo_kernels_find("base")->look(&job);
    for (int l = 0; l < COUNT; ++l) after += pow((double)out[0][l], 2) + pow((double)out[1][l], 2);
    print_message("power %.3f of it\n", after / before);
    assert_within(after / before - 1, point ? -1e-3 : -0.1, point ? 1e-3 : 0.1);
    if (point)
      assert_within((double)out[0][COUNT / 2] / (double)in[0][HAZE_REACH + COUNT / 2], 0.599,
                    0.601);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(looks_average_speckle_as_their_overlap_says),
      cmocka_unit_test(looks_leave_lumina_as_wide),
      cmocka_unit_test(live_picture_of_still_tissue_is_the_still),
      cmocka_unit_test(a_live_picture_begun_anew_forgets),
      cmocka_unit_test(kernels_agree_on_a_full_scanner),
      cmocka_unit_test(aberration_moves_power),
      cmocka_unit_test(sliders_and_ceiling_shape_the_compensation),
      cmocka_unit_test(filter_keeps_an_edge),
      cmocka_unit_test(filter_smooths_along_lines),
      cmocka_unit_test(persistence_keeps_small_changes),
      cmocka_unit_test(interfaces_have_ghosts),
      cmocka_unit_test(absurd_scanners_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
