// Sound speeds: depths by travel time, rays by Snell's law, everything drawn in one place.
#include "echo/bench.h"
#include "echo/sound.h"

#include <stdio.h>

static const double skin_m_s = 1624, fat_m_s = 1440, muscle_m_s = 1580, blood_m_s = 1578;
static const double face_m = 3e-3; // of the probe below the skin

static void create(bench *b, double fat_m, bool plain, bool vessels) {
  bench_create(b, leg_radius, 0.014, fat_m, plain, vessels);
  b->settings.depth_m = 0.05;
  b->echo->scanner.sound_speeds = 1;
}

// Depth at which a line draws a true depth, and the line across which its ray is there.
static double drawn(const bench *b, uint32_t line, double depth_m, double *at) {
  const sonde_sound *s = b->echo->sound;
  double row = depth_m / b->echo->frame.reach_m * (SOUND_ROWS - 1), t = row - floor(row);
  const uint32_t j = (uint32_t)row;
  assert_true(j + 1 < SOUND_ROWS);
  double top = (double)s->trace_line[j][line], low = (double)s->trace_line[j + 1][line];
  if (at) *at = top + t * (low - top);
  top = (double)s->trace_shown[j][line], low = (double)s->trace_shown[j + 1][line];
  return top + t * (low - top);
}

// Layers: the drawn depth is the integral of the assumed speed over the tissues'.
static void layers(void **state) {
  (void)state;
  static const double FAT[] = {4e-3, 8e-3, 12.7e-3, 25e-3};
  for (size_t k = 0; k < SONDE_COUNT_OF(FAT); ++k) {
    bench b;
    create(&b, FAT[k], true, false);
    look(&b, NULL);
    const double skin = b.leg.model.fat_depth_m[0];
    double worst = 0;
    for (double z = 1e-3; z < 0.045; z += 0.7e-3) {
      const double deep = z + face_m, in_skin = fmax(skin - face_m, 0);
      const double in_fat = fmax(fmin(deep, FAT[k]) - fmax(face_m, skin), 0);
      const double expected = sonde_sound_m_s * (fmin(in_skin, z) / skin_m_s + in_fat / fat_m_s +
                                                 fmax(deep - FAT[k], 0) / muscle_m_s);
      worst = fmax(worst, fabs(drawn(&b, 96, z, NULL) - expected));
    }
    printf("fat to %.1f mm: %.4f mm off at most\n", 1e3 * FAT[k], 1e3 * worst);
    assert_true(worst < 0.02e-3);
    bench_clear(&b);
  }
}

// Rays through a round vein in fat, whose levels are given by hand, bend as Snell's law has it.
static void snell(void **state) {
  (void)state;
  static const double RADIUS[] = {4e-3, 6e-3};
  for (size_t k = 0; k < SONDE_COUNT_OF(RADIUS); ++k) {
    bench b;
    create(&b, 0.012, true, true);
    const double radius = RADIUS[k], depth = 0.015;
    b.settings.focus_m = 0.02;
    b.echo->scanner.transmit_f = b.echo->scanner.receive_f = 10;
    look(&b, NULL);
    sonde_sound *s = b.echo->sound;
    const frame *f = &b.echo->frame;
    const uint32_t n = b.echo->padded, lines = b.echo->lines;
    const uint32_t end = (uint32_t)((depth + 1.3 * radius) / f->reach_m * (SONDE_MEDIUM_ROWS - 1));
    sonde_sound_begin(b.echo);
    for (uint32_t row = 0; row < end; ++row) {
      float *level = b.echo->level[row % 2];
      for (uint32_t l = 0; l < n; ++l) {
        const double x = ((double)s->line[l] - f->first_line) * f->pitch_m;
        const double z = f->reach_m * row / (SONDE_MEDIUM_ROWS - 1);
        for (uint32_t which = 0; which < b.echo->levels; ++which) level[which * n + l] = 1;
        level[2 * n + l] = -1;
        level[LAYER_LEVELS * n + l] = (float)(hypot(x, z - depth) - radius);
      }
      sonde_sound_step(b.echo, row);
    }
    double worst = 0;
    for (uint32_t l = 0; l < lines; ++l) {
      const double share = ((double)l - f->first_line) * f->pitch_m / radius;
      if (fabs(share) > 0.75 || fabs(share) < 0.1) continue;
      const double due = 2 * (asin(share * blood_m_s / fat_m_s) - asin(share));
      worst = fmax(worst, fabs((double)s->turn[l] / due - 1));
    }
    printf("vein of %.0f mm: %.3f off at most\n", 1e3 * radius, worst);
    assert_true(worst < 0.1);
    bench_clear(&b);
  }
}

// Speckle and sheets of layered tissue are found again at the depths that the rays tell.
static void picture(void **state) {
  (void)state;
  enum { HALF = 40, REACH = 60 };
  bench b;
  create(&b, 0.0127, false, false);
  b.echo->scanner.sound_speeds = 0;
  look(&b, NULL);
  uint32_t lines, samples;
  const float *e = sonde_echo_envelope(b.echo, &lines, &samples);
  float *still = SONDE_NEW(float, (size_t)lines *samples);
  memcpy(still, e, sizeof *still * lines * samples);
  b.echo->scanner.sound_speeds = 1;
  look(&b, NULL);
  e = sonde_echo_envelope(b.echo, &lines, &samples);
  const double step = b.echo->frame.step_m;
  double worst = 0;
  for (double z = 4e-3; z < 0.04; z += 1.2e-3) {
    // The lag at which the two pictures are most alike, over the middle lines.
    const int at = (int)rint(z / step);
    double best = -1, lag = 0;
    for (int k = -REACH; k <= REACH; ++k) {
      double ab = 0, aa = 0, bb = 0;
      for (int n = at - HALF; n <= at + HALF; ++n)
        for (uint32_t l = 80; l < 112; ++l) {
          const double x = log((double)still[(size_t)n * lines + l]),
                       y = log((double)e[(size_t)(n + k) * lines + l]);
          ab += x * y, aa += x * x, bb += y * y;
        }
      if (ab / sqrt(aa * bb) > best) best = ab / sqrt(aa * bb), lag = k;
    }
    const double due = drawn(&b, 96, z, NULL) - z;
    worst = fmax(worst, fabs(lag * step - due));
  }
  printf("speckle %.3f mm off at most\n", 1e3 * worst);
  assert_true(worst < 0.08e-3);
  sonde_free(still);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(layers), cmocka_unit_test(snell),
                                     cmocka_unit_test(picture)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
