// The texture of fat and muscle: lines along the skin and the fibres, dots across them, carried by
// the tissue, and no repetition of the tiles in view.
#include "echo/bench.h"
#include "sanitized.h"
#include "base/random.h"
#include "echo/echo.h"
#include "echo/gates.h"

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
  NOT_SANITIZED();
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
  NOT_SANITIZED();
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

// Blocks of lines are let off vessels and muscles that are far from them, and off nothing else: a
// round vein of 3 mm radius and seven seeds, of which two make one cell, in a plane of 2 mm by 1.6.
static void gates_let_in_what_matters(void **state) {
  (void)state;
  enum { SEEDS = 7, ROWS = 24 };
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.006, false, true);
  look(&b, NULL);
  sonde_echo *e = b.echo;
  sonde_gates *g = e->gates;
  tissue_job job = {.lines = e->padded, .vessels = 1, .cells = SEEDS};
  job.vessel[0].wall_m = 0.6e-3f, job.vessel[0].sheath_m = 1e-3f;
  for (int k = 0; k < SEEDS; ++k)
    job.cell[k] = (tissue_cell){.x_mm = (float)(48 * sonde_random_uniform(11, (uint64_t)k)),
                                .y_mm = (float)(40 * sonde_random_uniform(12, (uint64_t)k)),
                                .cell = (float)(k > 1 ? k : 1)};
  const uint32_t first = map_field_at(1, 0, 1);
  for (uint32_t node = 0; node < ROWS * SONDE_PLANE_COLUMNS; ++node) {
    const float x = 2 * (float)(node % SONDE_PLANE_COLUMNS);
    const float y = 1.6f * (float)(node / SONDE_PLANE_COLUMNS);
    float *at = e->plane + node, *vein = at + PLANE_LAYERS * SONDE_PLANE_NODES;
    at[PLANE_DEPTH * SONDE_PLANE_NODES] = 1, at[PLANE_MUSCLE * SONDE_PLANE_NODES] = 0;
    vein[VESSEL_SHORT * SONDE_PLANE_NODES] = (y - 20) / 3;
    vein[VESSEL_LONG * SONDE_PLANE_NODES] = (x - 24) / 3;
    vein[VESSEL_HALF_SHORT * SONDE_PLANE_NODES] = 3e-3f;
    vein[VESSEL_HALF_LONG * SONDE_PLANE_NODES] = 3e-3f;
    for (uint32_t k = 0; k < SEEDS; ++k) {
      const float dx = x - job.cell[k].x_mm, dy = y - job.cell[k].y_mm;
      at[(first + k) * SONDE_PLANE_NODES] = dx * dx + dy * dy;
    }
  }
  for (uint32_t l = 0; l < e->padded; ++l)
    g->column[0][l] = g->column[1][l] = (int32_t)(l * 23 / e->padded);
  uint32_t blocks = 0, veins = 0, alone = 0;
  e->plane_rows = ROWS;
  for (uint32_t j = 0; j + 1 < ROWS; ++j) {
    sonde_gates_find(e, &job, j);
    for (uint32_t l = 0; l < e->padded; l += ECHO_ALIGN, ++blocks) {
      const tissue_gate *gate = &g->block[l / ECHO_ALIGN];
      veins += gate->vessels, alone += gate->cells == 1;
      for (uint32_t n = 0; n < 5 * 5 * 9; ++n) { // places by winds of both signs
        const float left = 2 * (float)g->column[0][l];
        const float right = 2 * (float)g->column[0][l + ECHO_ALIGN - 1] + 2;
        const float x = left + (right - left) * (float)(n % 5) / 4;
        const float y = 1.6f * ((float)j + (float)(n / 5 % 5) / 4);
        const float wx = 0.7f * (float)((int)(n / 25 % 3) - 1),
                    wy = 0.7f * (float)((int)(n / 75) - 1);
        if (!gate->vessels) assert_true(hypotf(x - 24, y - 20) > 3 + 1.6f);
        float power[SEEDS];
        uint32_t own = 0, next = SEEDS;
        for (uint32_t k = 0; k < SEEDS; ++k) {
          const tissue_cell *c = &job.cell[k];
          power[k] =
              powf(x - c->x_mm, 2) + powf(y - c->y_mm, 2) - 2 * (wx * c->x_mm + wy * c->y_mm);
          if (power[k] < power[own]) own = k;
        }
        for (uint32_t k = 0; k < SEEDS; ++k)
          if (job.cell[k].cell != job.cell[own].cell && (next == SEEDS || power[k] < power[next]))
            next = k;
        assert_non_null(memchr(gate->cell, (int)own, gate->cells));
        const float apart = hypotf(job.cell[own].x_mm - job.cell[next].x_mm,
                                   job.cell[own].y_mm - job.cell[next].y_mm);
        if (gate->cells == 1)
          assert_true(power[next] - power[own] > 2.1f * apart);
        else
          assert_non_null(memchr(gate->cell, (int)next, gate->cells));
      }
    }
  }
  print_message("of %u blocks %u see the vein, %u one cell\n", blocks, veins, alone);
  assert_true(veins < blocks / 3 && alone > blocks / 10);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(muscle_has_stripes_along_and_dots_across),
      cmocka_unit_test(tiles_do_not_repeat_in_view),
      cmocka_unit_test(texture_stays_in_the_tissue),
      cmocka_unit_test(gates_let_in_what_matters),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
