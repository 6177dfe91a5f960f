// Vessels in the picture: blood that flows and whose amount follows the lumen, walls that take the
// speckle along.
#include "echo/bench.h"

#include <stdlib.h>

static const double aperture = 0.04;

static float *copy_of(const bench *b) {
  uint32_t lines, samples;
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples);
  float *copy = SONDE_NEW(float, (size_t)lines *samples);
  memcpy(copy, e, sizeof(float) * lines * samples);
  return copy;
}

static void look_at(bench *b, double t_s) {
  sonde_echo_flow flow = sonde_echo_flow_default();
  flow.t_s = t_s;
  sonde_echo_set_flow(b->echo, &flow);
  look(b, NULL);
}

// Correlation of a block about (x, z) of the picture before with the same block now, moved.
static double likeness(const bench *b, const float *before, double x, double z, double half_x,
                       double half_z, int line_shift, int sample_shift) {
  uint32_t lines, samples;
  const float *now = sonde_echo_envelope(b->echo, &lines, &samples);
  double pitch = aperture / (lines - 1), step = b->settings.depth_m / (samples - 1);
  int l0 = (int)((x - half_x) / pitch + 0.5 * (lines - 1)), l1 = l0 + (int)(2 * half_x / pitch);
  int n0 = (int)((z - half_z) / step), n1 = n0 + (int)(2 * half_z / step), count = 0;
  double su = 0, sv = 0, uu = 0, vv = 0, uv = 0;
  for (int n = n0; n <= n1; ++n)
    for (int l = l0; l <= l1; ++l, ++count) {
      double u = before[n * (int)lines + l];
      double v = now[(n + sample_shift) * (int)lines + l + line_shift];
      su += u, sv += v, uu += u * u, vv += v * v, uv += u * v;
    }
  double cu = uu - su * su / count, cv = vv - sv * sv / count;
  return (uv - su * sv / count) / sqrt(cu * cv);
}

static const double vein_z = 0.015; // the face is 3 mm below the skin

// From one frame to the next at 30 Hz nothing of the blood's speckle is left, of that in the lumen
// the clutter, everything of the muscle's; the same time gives the same picture.
static void blood_moves_muscle_stays(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  look_at(&b, 1);
  float *before = copy_of(&b);
  look_at(&b, 1);
  double vein = 0, artery = 0;
  const double same = likeness(&b, before, 0, vein_z, 1.2e-3, 1.2e-3, 0, 0);
  for (int k = 1; k <= 8; ++k) {
    look_at(&b, 1 + k / 30.0);
    vein += likeness(&b, before, 0, vein_z, 1.2e-3, 1.2e-3, 0, 0) / 8;
    artery += likeness(&b, before, 0.011, vein_z, 1e-3, 1e-3, 0, 0) / 8;
    assert_true(likeness(&b, before, -0.014, 0.025, 3e-3, 3e-3, 0, 0) > 0.999999);
  }
  print_message("vein %.3f, artery %.3f alike after a frame\n", vein, artery);
  assert_true(same == 1 || fabs(same - 1) < 1e-12);
  assert_true(vein < 0.4 && artery < 0.4); // clutter is half of the power
  sonde_free(before);
  bench_clear(&b);
}

// Along the vessel the speckle in its middle goes twice as fast as the mean, the one half-way to
// the wall three quarters of that.
static void profile_is_parabolic(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, true); // blood without clutter
  b.settings.focus_m = vein_z;
  sonde_mat3 along = m_columns(vec3(0, 0, 1), vec3(-1, 0, 0), vec3(0, -1, 0));
  b.pose.rotation = q_from_matrix(along);
  look_at(&b, 0);
  float *before = copy_of(&b);
  double t = 10e-3, shift[2];
  look_at(&b, t);
  sonde_vessel_state v;
  assert_true(sonde_interior_vessel_at_plane(b.interior, 0, tube_pose(leg_radius, 0.15), &v));
  for (int k = 0; k < 2; ++k) {
    double best = -1, off = k * 0.5 * v.half_short_m;
    for (int s = -15; s <= 15; ++s) {
      double c = likeness(&b, before, 0, vein_z - off, 0.012, 0.12e-3, s, 0);
      if (c > best) best = c, shift[k] = s * aperture / 191;
    }
    print_message("%.2f mm from the axis: %.2f mm, alike %.3f\n", 1e3 * off, 1e3 * shift[k], best);
  }
  // Along +x of this picture is along +z of the leg: away from the heart.
  double mean = -sonde_echo_flow_default().vein_m_s * t, line = aperture / 191;
  assert_true(fabs(shift[0] - 2 * mean) < 0.6 * line);
  assert_true(fabs(shift[1] - 1.5 * mean) < 0.6 * line);
  sonde_free(before);
  bench_clear(&b);
}

static void a_plug_stands_still(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  sonde_pathology_preset("acute_occlusive", &b.pathology, NULL);
  look_at(&b, 1);
  float *before = copy_of(&b);
  look_at(&b, 1.3);
  assert_true(likeness(&b, before, 0, vein_z, 1.2e-3, 1.2e-3, 0, 0) > 0.999999);
  assert_true(likeness(&b, before, 0.011, vein_z, 1e-3, 1e-3, 0, 0) < 0.6);
  sonde_free(before);
  bench_clear(&b);
}

// On a long face, so that the vein closes evenly around the plane.
static void push(bench *b, double push_n) {
  uint32_t n = b->leg.model.surface.vertex_count, touched = 0;
  for (int pass = 0; pass < 2; ++pass)
    for (uint32_t i = 0; i < n; ++i) {
      sonde_vec3 q = pose_apply_inverse(b->pose, b->leg.model.surface.vertices[i]);
      bool under = fabs(q.x) < 0.02 && fabs(q.y) < 0.04 && fabs(q.z) < 0.01;
      if (pass == 0) touched += under;
      b->forces[i] = pass && under ? vec3(0, -push_n / touched, 0) : vec3(0, 0, 0);
    }
}

// Scatterers of the blood are as dense in a nearly closed vein as in an open one.
static void amount_follows_the_area(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  b.leg.model.artery.count = 0;
  b.interior->course[1].count = 0;
  double full = 0, area = 0, least = 1;
  for (double n = 0; n < 30; n += 6) {
    push(&b, n);
    look(&b, NULL);
    sonde_vessel_state v;
    assert_true(sonde_interior_vessel_at_plane(b.interior, 0, b.pose, &v));
    double now = v.half_short_m * v.half_long_m, count = sonde_echo_last_times(b.echo).blood;
    if (n == 0) full = count, area = now;
    print_message("%g N: area %.3f, blood %.3f\n", n, now / area, count / full);
    assert_true(full > 1000 && fabs(count / full - now / area) < 0.03);
    least = fmin(least, count / full);
  }
  assert_true(least < 0.2);
  bench_clear(&b);
}

// Peak of the correlation over shifts down the lines, samples.
static double track(const bench *b, const float *before, double x, double z) {
  double best[81];
  int top = 1;
  for (int s = 0; s < 81; ++s) {
    best[s] = likeness(b, before, x, z, 0.8e-3, 0.5e-3, 0, s - 40);
    if (s > 0 && s < 80 && best[s] > best[top]) top = s;
  }
  double left = best[top - 1], right = best[top + 1];
  return top - 40 + 0.5 * (left - right) / (left - 2 * best[top] + right);
}

// Beside a vein that is pressed flatter the speckle goes where the interior says the tissue goes:
// the field's squeeze and the walls' are not added up.
static void speckle_follows_the_walls(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 2.5e-3, true, true);
  b.settings.depth_m = 0.03;
  look(&b, NULL);
  float *before = copy_of(&b);
  uint32_t n = b.leg.model.surface.vertex_count;
  sonde_vec3 *moved = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i) {
    sonde_vec3 q = b.leg.model.surface.vertices[i];
    double w = q.y > 0 ? 0.8e-3 * exp(-(q.x * q.x + (q.z - 0.15) * (q.z - 0.15)) / 2 / 4e-4) : 0;
    moved[i] = v_madd(q, -w, vec3(0, 1, 0));
  }
  push(&b, 1.2);
  look(&b, moved);
  sonde_vessel_state v;
  assert_true(sonde_interior_vessel_at_plane(b.interior, 0, b.pose, &v));
  double step = b.settings.depth_m / 1023, worst = 0;
  print_message("area %.3f\n", v.area_ratio);
  for (int k = 0; k < 6; ++k) {
    double away = (k < 3 ? -1 : 1) * (v.rest_radius_m + 1.6e-3 + 1.2e-3 * (k % 3));
    sonde_vec3 rest = pose_apply(b.pose, vec3(0, 0, vein_z + away));
    double truth = -sonde_interior_displacement(b.interior, rest).y;
    double bare = -sonde_interior_field(b.interior, rest).y;
    double seen = track(&b, before, 0, vein_z + away) * step;
    print_message("%+.1f mm: %.3f mm, of the interior %.3f, without walls %.3f\n", 1e3 * away,
                  1e3 * seen, 1e3 * truth, 1e3 * bare);
    worst = fmax(worst, fabs(seen - truth));
  }
  assert_true(worst < 0.05e-3);
  sonde_free(before);
  sonde_free(moved);
  bench_clear(&b);
}

// Mean power of the lumen's middle, and how much that of blocks of 0.6 mm differs over their mean.
static void lumen_power(const bench *b, double *mean, double *uneven) {
  uint32_t lines, samples;
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples);
  const double pitch = aperture / (lines - 1), step = b->settings.depth_m / (samples - 1);
  double sum = 0, squares = 0;
  int count = 0;
  for (double x = -8e-3; x < 8e-3; x += 0.6e-3)
    for (double z = vein_z - 2e-3; z < vein_z + 2e-3; z += 0.6e-3) {
      const int l0 = (int)(x / pitch + 0.5 * (lines - 1)), n0 = (int)(z / step);
      const int l1 = l0 + (int)(0.6e-3 / pitch), n1 = n0 + (int)(0.6e-3 / step);
      double power = 0;
      for (int n = n0; n < n1; ++n)
        for (int l = l0; l < l1; ++l) power += pow((double)e[n * (int)lines + l], 2);
      power /= (double)(n1 - n0) * (l1 - l0);
      sum += power, squares += power * power, ++count;
    }
  *mean = sum / count, *uneven = sqrt(squares / count - *mean * *mean) / *mean;
}

// Blood whose red cells stick together is 12 dB brighter in the mean, in streaks that go with it.
static void rouleaux_are_bright_streaks(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, true); // blood without clutter
  b.settings.focus_m = vein_z;
  b.pose.rotation = q_from_matrix(m_columns(vec3(0, 0, 1), vec3(-1, 0, 0), vec3(0, -1, 0)));
  sonde_echo_flow flow = sonde_echo_flow_default();
  double mean[2] = {0}, uneven[2] = {0}, best = -1;
  enum { TIMES = 6 };
  for (int k = 0; k < 2 * TIMES; ++k) {
    const sonde_vessel_blood blood[2] = {{.path_m = 0.01 * k, .rouleaux = k % 2}, {.path_m = 0}};
    double one, differs;
    flow.blood = blood;
    sonde_echo_set_flow(b.echo, &flow);
    look(&b, NULL);
    lumen_power(&b, &one, &differs);
    mean[k % 2] += one / TIMES, uneven[k % 2] += differs / TIMES;
  }
  const sonde_vessel_blood still[2] = {{.rouleaux = 1}, {.path_m = 0}},
                           moved[2] = {{.path_m = 0.6e-3, .rouleaux = 1}, {.path_m = 0}};
  flow.blood = still, sonde_echo_set_flow(b.echo, &flow), look(&b, NULL);
  float *before = copy_of(&b);
  flow.blood = moved, sonde_echo_set_flow(b.echo, &flow), look(&b, NULL);
  int shift = 0;
  for (int s = -15; s <= 15; ++s) {
    const double c = likeness(&b, before, 0, vein_z, 0.012, 0.12e-3, s, 0);
    if (c > best) best = c, shift = s;
  }
  print_message("%.2f dB brighter, blocks differ by %.2f instead of %.2f; moved %.2f of 1.20 mm\n",
                10 * log10(mean[1] / mean[0]), uneven[1], uneven[0], 1e3 * shift * aperture / 191);
  assert_true(fabs(10 * log10(mean[1] / mean[0]) - 12) < 0.4);
  assert_true(uneven[1] > 1.08 * uneven[0]);
  assert_true(fabs(shift * aperture / 191 - 1.2e-3) < 0.6 * aperture / 191);
  sonde_free(before);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(blood_moves_muscle_stays),  cmocka_unit_test(profile_is_parabolic),
      cmocka_unit_test(a_plug_stands_still),       cmocka_unit_test(amount_follows_the_area),
      cmocka_unit_test(speckle_follows_the_walls), cmocka_unit_test(rouleaux_are_bright_streaks),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
