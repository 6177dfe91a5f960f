// The picture: speckle statistics, attenuation, contrast, shadow, motion with the tissue, air,
// determinism.
#include "echo/bench.h"
#include "echo/echo.h"
#include "sanitized.h"

// Mean and deviation of the envelope over a block of lines and samples.
static double block(const bench *b, double depth0, double depth1, double *deviation) {
  uint32_t lines, samples, count = 0;
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples);
  uint32_t n0 = (uint32_t)(depth0 / b->settings.depth_m * samples);
  uint32_t n1 = (uint32_t)(depth1 / b->settings.depth_m * samples);
  double sum = 0, square = 0;
  for (uint32_t n = n0; n < n1; ++n)
    for (uint32_t l = 8; l + 8 < lines; ++l) {
      double v = e[n * lines + l];
      sum += v, square += v * v, ++count;
    }
  sum /= count;
  if (deviation) *deviation = sqrt(fmax(0, square / count - sum * sum));
  return sum;
}

// Fully developed speckle has a Rayleigh envelope: mean over deviation sqrt(pi/(4 - pi)) = 1.913.
static void speckle_is_fully_developed(void **state) {
  (void)state;
  bench b;
  bench_create(&b, 0.2, 0.014, 2.5e-3, true, false);
  b.settings.tgc_db_per_m =
      2 * 100 * 7.5 - sonde_echo_default_tgc_db_per_m(7.5e6); // exactly the muscle's loss
  double snr = 0;
  int rois = 0;
  for (int k = 0; k < ROUNDS(3, 1); ++k) {
    b.pose.position.z = 0.12 + 0.02 * k;
    look(&b, NULL);
    for (double d = 0.012; d < 0.045; d += 0.004, ++rois) {
      double deviation, mean = block(&b, d, d + 0.004, &deviation);
      snr += mean / deviation;
    }
  }
  print_message("speckle SNR %.3f over %d regions\n", snr / rois, rois);
  assert_true(fabs(snr / rois - 1.913) < 0.1);
  bench_clear(&b);
}

// Without compensation the echo falls by 2 alpha f z: the depth of -40 dB follows the frequency.
static void attenuation_follows_the_frequency(void **state) {
  (void)state;
  bench b;
  bench_create(&b, 0.4, 0.014, 2.5e-3, true, false);
  b.settings.depth_m = 0.15;
  for (double mhz = 2; mhz <= 10; mhz += 2) {
    b.settings.frequency_hz = mhz * 1e6;
    b.settings.depth_m = fmin(0.15, 0.30 / mhz);
    b.settings.tgc_db_per_m = -sonde_echo_default_tgc_db_per_m(mhz * 1e6);
    look(&b, NULL);
    double alpha = 100, expected = 40 / (2 * alpha * mhz); // m, beyond the start
    // Straight line through the logarithm of the mean envelope between 8 mm and the noise.
    double start = 0.008, step = 0.15 * expected, sx = 0, sy = 0, sxx = 0, sxy = 0;
    int count = 0;
    for (double d = start; d + step < b.settings.depth_m && count < 6; d += step, ++count) {
      double x = d + step / 2, y = 20 * log10(block(&b, d, d + step, NULL));
      sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    double slope = (count * sxy - sx * sy) / (count * sxx - sx * sx);
    print_message("%g MHz: -40 dB after %.1f mm, expected %.1f mm\n", mhz, -40e3 / slope,
                  1e3 * expected);
    assert_true(count >= 3);
    assert_true(fabs(-40 / slope / expected - 1) < 0.1);
  }
  bench_clear(&b);
}

static double grey(const bench *b, double x_m, double z_m, double half_m) {
  double pixel = b->image.height_m / b->image.height, sum = 0;
  int count = 0;
  for (double z = z_m - half_m; z <= z_m + half_m; z += pixel)
    for (double x = x_m - half_m; x <= x_m + half_m; x += pixel, ++count) {
      int column = (int)(x / pixel + 0.5 * b->image.width), row = (int)(z / pixel);
      sum += b->image.pixels[row * (int)b->image.width + column];
    }
  return sum / count;
}

static void lumen_is_dark_bone_shadows(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  b.settings.depth_m = 0.08;
  // Without the receiver's noise, 11 dB below muscle at the shadow's depth: late echoes are left.
  b.echo->scanner.noise_db = -150;
  look(&b, NULL);
  double muscle = grey(&b, -0.014, 0.027, 0.006), vein = grey(&b, 0, 0.015, 0.0025);
  double artery = grey(&b, 0.011, 0.015, 0.002), shadow = grey(&b, 0, 0.073, 0.003);
  print_message("muscle %.0f vein %.1f artery %.1f shadow %.1f\n", muscle, vein, artery, shadow);
  assert_true(muscle > 55 && muscle < 95);
  assert_true(vein < 0.5 * muscle && artery < 0.5 * muscle);
  assert_true(shadow < 0.25 * muscle);
  // The cortex is the brightest thing below the fascia: at 80 - 14 - 3 = 63 mm.
  double cortex = 0;
  for (double z = 0.0615; z < 0.0645; z += 1e-4) cortex = fmax(cortex, grey(&b, 0, z, 2e-4));
  assert_true(cortex > 150);
  sonde_pathology_preset("chronic_occlusive", &b.pathology, NULL);
  look(&b, NULL);
  double clot = grey(&b, 0, 0.015, 0.002);
  print_message("chronic clot %.0f\n", clot);
  assert_true(clot > 0.5 * muscle);
  bench_clear(&b);
}

// Probe and leg moved together by any rigid step show the same picture up to the table's grid;
// tissue moved under a resting probe by whole samples shifts the picture by as many.
static void speckle_belongs_to_the_tissue(void **state) {
  (void)state;
  bench b;
  bench_create(&b, 0.2, 0.014, 2.5e-3, true, false);
  look(&b, NULL);
  uint32_t lines, samples;
  const float *e = sonde_echo_envelope(b.echo, &lines, &samples);
  float *before = SONDE_NEW(float, (size_t)lines *samples);
  memcpy(before, e, sizeof(float) * lines * samples);
  double step = b.settings.depth_m / (samples - 1);
  b.pose.position.y -= 8 * step; // towards the tissue: everything comes 8 samples nearer
  look(&b, NULL);
  double ab = 0, aa = 0, bb = 0, sa = 0, sb = 0;
  uint32_t count = 0;
  for (uint32_t n = 200; n < 500; ++n)
    for (uint32_t l = 20; l + 20 < lines; ++l, ++count) {
      double u = log(1e-9 + before[(n + 8) * lines + l]), v = log(1e-9 + e[n * lines + l]);
      sa += u, sb += v, ab += u * v, aa += u * u, bb += v * v;
    }
  double cov = ab - sa * sb / count, va = aa - sa * sa / count, vb = bb - sb * sb / count;
  double likeness = cov / sqrt(va * vb);
  print_message("likeness after a shift by 8 samples: %.4f\n", likeness);
  assert_true(likeness > 0.98);
  sonde_free(before);
  bench_clear(&b);
}

// Displacement of the picture between two states by the peak of the block's correlation, samples.
static double track(const float *a, const float *b, uint32_t lines, uint32_t n0, uint32_t l0) {
  double best[64];
  int top = 0;
  for (int shift = -20; shift <= 20; ++shift) {
    double ab = 0, aa = 0, bb = 0;
    for (uint32_t n = n0; n < n0 + 60; ++n)
      for (uint32_t l = l0; l < l0 + 20; ++l) {
        double u = a[n * lines + l], v = b[((int)n + shift) * (int)lines + (int)l];
        ab += u * v, aa += u * u, bb += v * v;
      }
    best[shift + 20] = ab / sqrt(aa * bb);
    if (best[shift + 20] > best[top]) top = shift + 20;
  }
  double left = best[top > 0 ? top - 1 : 0], right = best[top < 40 ? top + 1 : 40];
  return top - 20 + 0.5 * (left - right) / (left - 2 * best[top] + right);
}

static void tracked_motion_is_the_field(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 2.5e-3, true, false);
  b.settings.depth_m = 0.06;
  look(&b, NULL);
  uint32_t lines, samples, n = b.leg.model.surface.vertex_count;
  const float *e = sonde_echo_envelope(b.echo, &lines, &samples);
  float *before = SONDE_NEW(float, (size_t)lines *samples);
  memcpy(before, e, sizeof(float) * lines * samples);
  sonde_vec3 *moved = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i) { // wide shallow dent: strains below 2 %
    sonde_vec3 q = b.leg.model.surface.vertices[i];
    double w = q.y > 0 ? 0.4e-3 * exp(-(q.x * q.x + (q.z - 0.15) * (q.z - 0.15)) / 2 / 0.0016) : 0;
    moved[i] = v_madd(q, -w, vec3(0, 1, 0));
  }
  look(&b, moved);
  double step = b.settings.depth_m / (samples - 1), error[64];
  int count = 0;
  for (uint32_t n0 = 200; n0 < 700; n0 += 100)
    for (uint32_t l0 = 30; l0 + 50 < lines; l0 += 30, ++count) {
      double x = ((l0 + 9.5) / (lines - 1) - 0.5) * 0.04;
      sonde_vec3 rest = pose_apply(b.pose, vec3(x, 0, (n0 + 29.5) * step));
      double truth = -sonde_interior_displacement(b.interior, rest).y / step;
      error[count] = fabs(track(before, e, lines, n0, l0) - truth);
    }
  for (int i = 0; i < count; ++i)
    for (int j = i; j > 0 && error[j] < error[j - 1]; --j) {
      double swap = error[j];
      error[j] = error[j - 1], error[j - 1] = swap;
    }
  double pixel = b.image.height_m / b.image.height;
  print_message("tracked motion: median error %.3f px of %d blocks\n",
                error[count / 2] * step / pixel, count);
  assert_true(error[count / 2] * step / pixel < 0.1);
  sonde_free(before);
  sonde_free(moved);
  bench_clear(&b);
}

// How far from the middle of four nodes the field takes the middle of their places at rest, m.
static double off_middle(const bench *b, uint32_t i, uint32_t j) {
  const plane_node *n = &b->echo->node[j * SONDE_PLANE_COLUMNS + i], *low = n + SONDE_PLANE_COLUMNS;
  sonde_vec3 rest =
      v_lerp(v_lerp(n[0].rest, n[1].rest, 0.5), v_lerp(low[0].rest, low[1].rest, 0.5), 0.5);
  sonde_vec3 moved = v_add(rest, sonde_interior_field(b->interior, rest));
  return v_distance(moved, sonde_echo_to_world(b->echo, vec3(i + 0.5, 0, j + 0.5)));
}

// Between the nodes the picture is off by a small part of a wavelength (0.2 mm) nearly everywhere.
// The lines of a curved face draw apart with depth.
static void the_plane_is_dense_enough(const bench *b, double most_m, double share) {
  uint32_t count = 0, far = 0;
  double sum = 0;
  for (uint32_t j = 0; j + 1 < b->echo->plane_rows; ++j)
    for (uint32_t i = 0; i + 1 < SONDE_PLANE_COLUMNS; ++i, ++count) {
      double off = off_middle(b, i, j);
      sum += off, far += off > 50e-6;
    }
  print_message("  %u rows: %.2g um off between them, %.2g %% more than 50\n", b->echo->plane_rows,
                sum / count * 1e6, 100.0 * far / count);
  assert_true(sum / count < most_m && far < share * count);
}

// Every node of the coarse plane lies where the field takes its place at rest.
static void the_plane_is_inverted(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.012, 0.012, true, true);
  uint32_t n = b.leg.model.surface.vertex_count;
  sonde_vec3 *now = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i) { // as steep as a hard press
    sonde_vec3 v = b.leg.model.surface.vertices[i];
    double away = (v.x * v.x + (v.z - 0.15) * (v.z - 0.15)) / (0.025 * 0.025);
    now[i] = v_madd(v, v.y > 0 ? -12e-3 * exp(-away) : 0, vec3(0, 1, 0));
  }
  for (int curved = 0; curved < 2; ++curved) {
    double worst = 0;
    assert_int_equal(sonde_echo_set_radius(b.echo, curved ? 0.05 : 0, NULL), SONDE_OK);
    b.pose = tube_pose(leg_radius - 12e-3, 0.15);
    look(&b, now);
    for (uint32_t k = 0; k < b.echo->plane_rows * SONDE_PLANE_COLUMNS; ++k) {
      const plane_node *node = &b.echo->node[k];
      uint32_t i = k % SONDE_PLANE_COLUMNS, j = k / SONDE_PLANE_COLUMNS;
      sonde_vec3 moved = v_add(node->rest, sonde_interior_field(b.interior, node->rest));
      sonde_vec3 at = sonde_echo_to_world(b.echo, vec3(i, 0, j));
      worst = fmax(worst, v_distance(moved, at));
    }
    print_message("%s: %.2g um off\n", curved ? "curved" : "flat", worst * 1e6);
    assert_true(worst < 1e-6);
    the_plane_is_dense_enough(&b, curved ? 35e-6 : 15e-6, curved ? 0.15 : 0.05);
  }
  sonde_free(now);
  bench_clear(&b);
}

static void air_stays_dark(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  b.pose = tube_pose(leg_radius + 0.01, 0.15);
  look(&b, NULL);
  assert_true(grey(&b, 0, 0.04, 0.01) < 2);
  assert_true(grey(&b, 0, 0.06, 0.008) < 2);
  double bands = 0;
  for (double z = 5e-4; z < 6e-3; z += 1e-4) bands = fmax(bands, grey(&b, 0, z, 1.5e-4));
  assert_true(bands > 100); // reverberation at the face
  bench_clear(&b);
}

// Without gel under one side that side's columns go dark below the face, the other side's stay;
// half the amplitude is 6 dB less.
static void dry_columns_are_dark(void **state) {
  (void)state;
  bench b;
  bench_create(&b, 0.2, 0.014, 2.5e-3, true, false);
  uint32_t lines, samples;
  float gel[192], mean[3][2] = {{0}};
  const float left[3] = {1, 0.5f, 0};
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l < 192; ++l) gel[l] = l < 96 ? left[k] : 1;
    sonde_echo_set_coupling(b.echo, k == 0 ? NULL : gel);
    look(&b, NULL);
    const float *e = sonde_echo_envelope(b.echo, &lines, &samples);
    for (uint32_t n = 300; n < 500; ++n)
      for (uint32_t l = 0; l < 60; ++l)
        mean[k][0] += e[n * lines + 10 + l], mean[k][1] += e[n * lines + 122 + l];
  }
  print_message("half %.3f, none %.5f\n", (double)(mean[1][0] / mean[0][0]),
                (double)(mean[2][0] / mean[0][0]));
  assert_true(fabsf(mean[1][0] / mean[0][0] - 0.5f) < 0.01f);
  assert_true(mean[2][0] < 0.01f * mean[0][0]);
  assert_true(mean[1][1] == mean[0][1] && mean[2][1] == mean[0][1]);
  assert_true(grey(&b, -0.012, 1.7e-3, 2e-4) > grey(&b, -0.012, 0.02, 1e-3));
  bench_clear(&b);
}

static void same_state_same_pixels(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  bench c;
  bench_create(&c, leg_radius, 0.014, 0.012, false, true);
  look(&b, NULL);
  look(&c, NULL);
  assert_memory_equal(b.image.pixels, c.image.pixels, 512 * 512);
  assert_int_equal(b.image.tick, 1);
  bench_clear(&b);
  bench_clear(&c);
}

static void settings_are_clamped(void **state) {
  (void)state;
  sonde_echo_settings s = {NAN, 1, -99, 5, NAN, INFINITY};
  s = sonde_echo_settings_clamp(s);
  sonde_echo_settings d = sonde_echo_settings_default();
  assert_true(s.frequency_hz == d.frequency_hz && s.depth_m == 0.15 && s.gain_db == -30);
  assert_true(s.dynamic_range_db == 30 && s.focus_m == d.focus_m && isfinite(s.tgc_db_per_m));
  sonde_image image;
  assert_int_equal(sonde_image_create(0, 5, &image, NULL), SONDE_ARGUMENT);
}

// Where a line meets the bone: in the probe frame the leg's axis is `axis_z` below the face.
static double bone_depth(const bench *b, uint32_t line, double axis_z, double radius) {
  double low = 0, high = 0;
  for (double d = 0; d < b->settings.depth_m && high <= 0; d += 1e-4) {
    sonde_vec3 at = sonde_echo_place(&b->echo->frame, line, d);
    if (hypot(at.x, at.z - axis_z) < radius) low = d - 1e-4, high = d;
  }
  for (int i = 0; i < 30 && high > 0; ++i) {
    sonde_vec3 at = sonde_echo_place(&b->echo->frame, line, 0.5 * (low + high));
    if (hypot(at.x, at.z - axis_z) < radius)
      high = 0.5 * (low + high);
    else
      low = 0.5 * (low + high);
  }
  return high;
}

// The cortex is a circle, not a polygon, although the coarse plane's columns are 3 mm apart there.
static void bone_is_round(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, false);
  assert_int_equal(sonde_echo_set_radius(b.echo, 0.06, NULL), SONDE_OK);
  b.settings.frequency_hz = 3e6;
  look(&b, NULL);
  double worst = 0;
  uint32_t lines = 0;
  for (uint32_t l = 0; l < b.echo->lines; ++l) {
    double due = bone_depth(&b, l, leg_radius - 3e-3, 0.014), least = 1;
    if (!(due > 0) || due > 0.0643) continue; // beyond, the columns cannot hold the cortex's slope
    for (uint32_t n = 0; n < b.echo->grid_samples; ++n)
      for (int32_t k = b.echo->first_sheet[n]; k >= 0; k = b.echo->sheet[k].next) {
        if (b.echo->sheet[k].column != b.echo->pad_lines + SONDE_FINE * l) continue;
        double row = n + (double)b.echo->sheet[k].beyond - b.echo->pad_samples;
        least = fmin(least, fabs(row * b.echo->frame.step_m - due));
      }
    worst = fmax(worst, least), ++lines;
  }
  print_message("%u lines meet the bone, %.3f mm off at most\n", lines, worst * 1e3);
  assert_true(lines > 20 && worst < 0.05e-3);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bone_is_round),
      cmocka_unit_test(speckle_is_fully_developed),
      cmocka_unit_test(attenuation_follows_the_frequency),
      cmocka_unit_test(lumen_is_dark_bone_shadows),
      cmocka_unit_test(speckle_belongs_to_the_tissue),
      cmocka_unit_test(tracked_motion_is_the_field),
      cmocka_unit_test(the_plane_is_inverted),
      cmocka_unit_test(air_stays_dark),
      cmocka_unit_test(dry_columns_are_dark),
      cmocka_unit_test(same_state_same_pixels),
      cmocka_unit_test(settings_are_clamped),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
