// Strain from tracked envelopes: scatterers that are compressed evenly, and a stiff layer between
// soft ones, drawn by the renderer's own beam.
#include "echo/bench.h"
#include "base/random.h"
#include "echo/echo.h"
#include "echo/reference.h"
#include "sonde/sweep_strain.h"

#include <stdio.h>

enum { POINTS = 60000 };
static const double top_m = 0.010, bottom_m = 0.030; // of what is measured
static sonde_echo_point points[POINTS];

typedef double (*path)(double z_m); // displacement of a depth

static double even_strain; // of the block, negative: compressed
static double evenly(double z) { return even_strain * z; }
static double shifted(double z) { return z > 0 ? 63e-6 : 0; }
static double layered(double z) {
  const double stiff = fmin(fmax(z - 0.017, 0), 6e-3); // from 17 to 23 mm
  return -0.01 * (z - stiff) - 0.002 * stiff;
}

static float *draw(bench *b, path moved, uint64_t seed) {
  uint32_t lines, samples;
  for (uint32_t i = 0; i < POINTS; ++i) {
    const double z = 4e-3 + 0.032 * sonde_random_uniform(seed, 3 * i + 1);
    points[i] = (sonde_echo_point){.x_m = 0.04 * (sonde_random_uniform(seed, 3 * i) - 0.5),
                                   .z_m = z + (moved ? moved(z) : 0),
                                   .amplitude = sonde_random_bits(seed, 3 * i + 2) & 1024 ? 1 : -1};
  }
  sonde_echo_render_points(b->echo, 0.04, &b->settings, points, POINTS);
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples);
  float *copy = SONDE_NEW(float, (size_t)lines *samples);
  memcpy(copy, e, sizeof *copy * lines * samples);
  return copy;
}

// Mean and deviation of a field between two depths, over lines that are far apart enough to be
// independent, away from the sides.
static double mean_of(const sonde_strain *s, const float *field, double from, double to,
                      double *deviation) {
  double n = 0, sum = 0, square = 0;
  for (uint32_t r = 0; r < s->rows; ++r)
    for (uint32_t l = 16; l + 16 < s->lines; l += 8) {
      const double z = s->first_m + r * s->hop_m, v = (double)field[(size_t)r * s->lines + l];
      if (z < from || z > to) continue;
      n += 1, sum += v, square += v * v;
    }
  if (deviation) *deviation = sqrt(fmax(square / n - sum / n * sum / n, 0));
  return sum / n;
}

static sonde_strain track(bench *b, path moved, uint64_t seed) {
  float *before = draw(b, NULL, seed), *after = draw(b, moved, seed);
  sonde_strain s;
  assert_int_equal(sonde_strain_track(before, after, b->echo->lines, b->echo->samples,
                                      b->echo->frame.step_m, NULL, &s, NULL),
                   SONDE_OK);
  sonde_free(before), sonde_free(after);
  return s;
}

// An even strain is found, and displacements that follow the scatterers.
static void even(void **state) {
  (void)state;
  static const double STRAIN[] = {-0.003, -0.01, -0.02};
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, false);
  b.settings.depth_m = 0.04;
  for (size_t k = 0; k < SONDE_COUNT_OF(STRAIN); ++k) {
    even_strain = STRAIN[k];
    sonde_strain s = track(&b, evenly, 7 + k);
    double spread, wrong = 0, n = 0;
    const double found = mean_of(&s, s.strain, top_m, bottom_m, &spread);
    const double rho = mean_of(&s, s.likeness, top_m, bottom_m, NULL);
    for (uint32_t r = 0; r < s.rows; ++r)
      for (uint32_t l = 16; l + 16 < s.lines; l += 8) {
        // A window that stood at z holds what moved as its middle did.
        const double z = s.first_m + r * s.hop_m;
        if (z < top_m || z > bottom_m) continue;
        const double off = (double)s.displacement_m[(size_t)r * s.lines + l] - evenly(z);
        wrong += off * off, n += 1;
      }
    wrong = sqrt(wrong / n);
    printf("strain %.4f: %.5f +- %.5f, likeness %.4f; displacement %.2f um off\n", STRAIN[k], found,
           spread, rho, 1e6 * wrong);
    assert_true(fabs(found / STRAIN[k] - 1) < 0.03 && spread < 0.08 * fabs(STRAIN[k]));
    assert_true(wrong < 4e-6 && rho > 0.95);
    sonde_strain_clear(&s);
  }
  bench_clear(&b);
}

// Between two records s of the same shape with noise of deviation d each, no delay is known better
// than to sqrt(2 d^2 / sum s'^2) (Cramer and Rao).
static void noise(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, false);
  b.settings.depth_m = 0.04;
  float *before = draw(&b, NULL, 3), *after = draw(&b, shifted, 3);
  const uint32_t lines = b.echo->lines, samples = b.echo->samples;
  const double step = b.echo->frame.step_m, strength = 0.1;
  double level = 0, count = 0;
  for (uint32_t n = samples / 4; n < samples * 3 / 4; ++n)
    for (uint32_t l = 0; l < lines; ++l) level += (double)before[n * lines + l], count += 1;
  level /= count;
  // Slopes of the envelope without noise, in windows of the default, and noise by twelve uniforms.
  const int half = (int)rint(1e-3 / step);
  double *slope = SONDE_NEW(double, (size_t)lines *samples);
  for (size_t i = lines; i < (size_t)lines * (samples - 1); ++i)
    slope[i] = 0.5 * ((double)before[i + lines] - (double)before[i - lines]);
  for (size_t i = 0; i < (size_t)lines * samples; ++i)
    for (int which = 0; which < 2; ++which) {
      double sum = -6;
      for (uint64_t k = 0; k < 12; ++k)
        sum += sonde_random_uniform(20 + (uint64_t)which, 12 * i + k);
      (which ? after : before)[i] += (float)(strength * level * sum);
    }
  sonde_strain s;
  assert_int_equal(sonde_strain_track(before, after, lines, samples, step, NULL, &s, NULL),
                   SONDE_OK);
  double wrong = 0, bound = 0, places = 0;
  for (uint32_t r = 0; r < s.rows; ++r)
    for (uint32_t l = 16; l + 16 < lines; l += 8) {
      const double z = s.first_m + r * s.hop_m;
      if (z < top_m || z > bottom_m) continue;
      const int middle = (int)rint(z / step);
      double energy = 0;
      for (int n = middle - half; n <= middle + half; ++n)
        for (uint32_t k = l - 3; k <= l + 3; ++k)
          energy += slope[(size_t)n * lines + k] * slope[(size_t)n * lines + k];
      const double off = (double)s.displacement_m[(size_t)r * lines + l] - shifted(z);
      wrong += off * off, places += 1;
      bound += 2 * strength * strength * level * level / energy * step * step;
    }
  wrong = sqrt(wrong / places), bound = sqrt(bound / places);
  printf("noise of a tenth: %.2f um off, no tracking below %.2f um\n", 1e6 * wrong, 1e6 * bound);
  assert_true(wrong > 0.9 * bound && wrong < 1.3 * bound);
  sonde_strain_clear(&s);
  sonde_free(slope), sonde_free(before), sonde_free(after);
  bench_clear(&b);
}

static void stiff_layer(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, false);
  b.settings.depth_m = 0.04;
  sonde_strain s = track(&b, layered, 11);
  const double soft = mean_of(&s, s.strain, 0.008, 0.014, NULL);
  const double stiff = mean_of(&s, s.strain, 0.0195, 0.0205, NULL);
  const double below = mean_of(&s, s.strain, 0.026, 0.031, NULL);
  printf("soft %.5f, stiff %.5f, soft %.5f\n", soft, stiff, below);
  assert_true(fabs(soft / -0.01 - 1) < 0.03 && fabs(below / -0.01 - 1) < 0.03);
  assert_true(fabs(stiff / -0.002 - 1) < 0.15);
  sonde_strain_clear(&s);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(even), cmocka_unit_test(noise),
                                     cmocka_unit_test(stiff_layer)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
