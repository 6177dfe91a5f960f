// The texture of fat and muscle: lines along the skin and the fibres, dots across them, carried by
// the tissue, and no repetition of the tiles in view.
#include "echo/bench.h"
#include "echo/echo.h"

// The probe above muscle, across the leg or along it.
static void aim(bench *b, bool along, double shift_m) {
  b->settings.depth_m = 0.05;
  b->pose = tube_pose(leg_radius - 1e-3, 0.15 + shift_m);
  if (along)
    b->pose.rotation = q_mul(b->pose.rotation, (sonde_quat){.w = sqrt(0.5), .z = sqrt(0.5)});
  look(b, NULL);
}

// Logarithm of the gain over its mean in the row, which losses change.
static double level(const sonde_echo *e, uint32_t row, uint32_t line) {
  const float *gain = e->gain + (size_t)row * e->gain_stride;
  double mean = 0;
  for (uint32_t l = 8; l + 8 < e->lines; ++l) mean += log((double)gain[l] + 1e-12);
  return log((double)gain[line] + 1e-12) - mean / (e->lines - 16);
}

// Likeness of the gains of some rows at a shift across the lines and down.
static double alike(const bench *b, uint32_t row, uint32_t rows, uint32_t lines, uint32_t down) {
  const sonde_echo *e = b->echo;
  double aa = 0, bb = 0, ab = 0;
  for (uint32_t r = row; r + down < row + rows; r += 2)
    for (uint32_t l = 8; l + 8 + lines < e->lines; l += 2) {
      const double x = level(e, r, l), y = level(e, r + down, l + lines);
      aa += x * x, bb += y * y, ab += x * y;
    }
  return ab / sqrt(aa * bb);
}

static void muscle_has_stripes_along_and_dots_across(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.006, false, false);
  const double line_m = 0.04 / (b.echo->lines - 1);
  const uint32_t far = (uint32_t)(1.5e-3 / line_m);
  double like[2];
  for (int along = 0; along < 2; ++along) {
    aim(&b, along, 0);
    like[along] = alike(&b, 60, 100, far, 0);
  }
  print_message("1.5 mm beside: %.2f along the fibres, %.2f across\n", like[1], like[0]);
  assert_true(like[1] > like[0] + 0.15);
  assert_true(like[0] < 0.35);
  bench_clear(&b);
}

static void tiles_do_not_repeat_in_view(void **state) {
  (void)state;
  bench b;
  bench_create(&b, 0.1, 0.014, 0.045, false, false);
  b.settings.depth_m = 0.05;
  b.pose = tube_pose(0.1 - 1e-3, 0.15);
  look(&b, NULL);
  const double row_m = 0.05 / (SONDE_MEDIUM_ROWS - 1);
  const uint32_t period = (uint32_t)(0.016 / row_m + 0.5);
  double fat = alike(&b, 20, 190, 0, period);
  bench_clear(&b);
  bench_create(&b, 0.1, 0.014, 0.004, false, false);
  b.settings.depth_m = 0.05;
  b.pose = tube_pose(0.1 - 1e-3, 0.15);
  look(&b, NULL);
  double muscle = alike(&b, 40, 200, 0, period);
  print_message("a tile deeper: fat %.3f, muscle %.3f alike\n", fat, muscle);
  assert_true(fabs(fat) < 0.1 && fabs(muscle) < 0.1);
  bench_clear(&b);
}

// What a probe sees after it moved by whole lines along the leg is what it saw there before.
static void texture_stays_in_the_tissue(void **state) {
  (void)state;
  bench b;
  enum { SHIFT = 12 };
  bench_create(&b, leg_radius, 0.014, 0.008, false, false);
  const double line_m = 0.04 / (b.echo->lines - 1);
  aim(&b, true, 0);
  float *before = SONDE_NEW(float, (size_t)SONDE_MEDIUM_ROWS *b.echo->gain_stride);
  memcpy(before, b.echo->gain, sizeof *before * SONDE_MEDIUM_ROWS * b.echo->gain_stride);
  double best = 0;
  for (int sign = -1; sign <= 1; sign += 2) {
    aim(&b, true, sign * SHIFT * line_m);
    double sum = 0, worst = 0, n = 0;
    for (uint32_t r = 20; r < 180; ++r)
      for (uint32_t l = 30; l + 30 < b.echo->lines; ++l, ++n) {
        const size_t at = (size_t)r * b.echo->gain_stride + l;
        const double ratio = log((double)b.echo->gain[at] / (double)before[at + SHIFT]);
        sum += fabs(ratio) < 0.1, worst = fmax(worst, fabs(ratio));
      }
    best = fmax(best, sum / n);
  }
  print_message("%.1f %% of the gains stay within 0.9 dB\n", 100 * best);
  assert_true(best > 0.9);
  sonde_free(before);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(muscle_has_stripes_along_and_dots_across),
                                     cmocka_unit_test(tiles_do_not_repeat_in_view),
                                     cmocka_unit_test(texture_stays_in_the_tissue)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
