// Rays and aberration against a wave: the two-dimensional wave equation by finite differences, a
// plane pulse through a vein in fat and through layers that lie aslant, a focused one through a
// wavy face between fat and muscle. Nothing of the picture's beam is in it.
#include "echo/bench.h"
#include "echo/sound.h"

#include <complex.h>
#include <stdio.h>

static const double fat_m_s = 1440, muscle_m_s = 1580, blood_m_s = 1578;
static const double cell_m = 40e-6, step_s = 12e-9, pulse_hz = 2.5e6, pulse_m = 0.4e-3;
static const double depth_m = 0.024; // of the receivers
enum { WIDE = 640, HIGH = 800, TOP = 80, STEPS = 1600, WINDOW = 60, EDGE = 2 };

// Rows have columns of the other side beside them.
static float pressure[3][HIGH][WIDE + 2 * EDGE], square[HIGH][WIDE], heard[STEPS][WIDE];

// What is where: distance to the interface, and the speed beyond it, where it is negative.
typedef double (*shape)(double x, double z);
static double vein(double x, double z) { return hypot(x, z - 0.012) - 4e-3; }
static double slant(double x, double z) {
  const double angle = 12 * SONDE_PI / 180;
  return (0.010 - z) * cos(angle) + x * sin(angle);
}

// Waves of 5 mm, so high; a flat face.
static const double wave_m = 5e-3, face_m = 6e-3;
static double wave_high_m;
static double wavy(double x, double z) {
  return face_m + wave_high_m * sin(2 * SONDE_PI * x / wave_m + 0.7) - z;
}

// The face bends ways from the aperture so that those to here in fat meet at the receivers.
static const double aim_m = 6e-3 + (0.024 - 6e-3) * 1580 / 1440;

// Pressure that receivers at the depth hear of a pulse that is at z = 0 at first: a plane one, or
// one that closes in on them from an aperture.
static void propagate(shape where, double beyond_m_s, double aperture_m) {
  for (int j = 0; j < HIGH; ++j)
    for (int i = 0; i < WIDE; ++i) {
      const double x = (i - WIDE / 2) * cell_m, z = (j - TOP) * cell_m;
      const double share = clamp(0.5 - where(x, z) / cell_m, 0, 1);
      const double c = 1 / ((1 - share) / fat_m_s + share / beyond_m_s), k = c * step_s / cell_m;
      square[j][i] = (float)(k * k);
      for (int t = 0; t < 2; ++t) {
        const double to_focus = aperture_m > 0 ? aim_m - hypot(x, z - aim_m) : z;
        const double at = to_focus + (t ? 0 : fat_m_s * step_s), u = at / pulse_m;
        const double beside = aperture_m > 0 ? (0.5 * aperture_m - fabs(x)) / 0.5e-3 : 1;
        pressure[t][j][EDGE + i] = (float)(clamp(beside, 0, 1) * exp(-0.5 * u * u) *
                                           cos(2 * SONDE_PI * pulse_hz / fat_m_s * at));
      }
    }
  // Fourth order in space, second in time; sides are periodic.
  for (int n = 0; n < STEPS; ++n) {
    float(*now)[WIDE + 2 * EDGE] = pressure[(n + 1) % 3];
    for (int j = 0; j < HIGH; ++j)
      for (int k = 0; k < EDGE; ++k)
        now[j][k] = now[j][WIDE + k], now[j][WIDE + EDGE + k] = now[j][EDGE + k];
    for (int j = 2; j < HIGH - 2; ++j) {
      const float *at = now[j] + EDGE, *up = now[j - 1] + EDGE, *down = now[j + 1] + EDGE;
      const float *above = now[j - 2] + EDGE, *below = now[j + 2] + EDGE;
      const float *restrict old = pressure[n % 3][j] + EDGE;
      float *restrict next = pressure[(n + 2) % 3][j] + EDGE;
      for (int i = 0; i < WIDE; ++i) {
        const float near = at[i - 1] + at[i + 1] + up[i] + down[i];
        const float far = at[i - 2] + at[i + 2] + above[i] + below[i];
        const float laplace = (16 * near - far - 60 * at[i]) * (1.0f / 12);
        next[i] = 2 * at[i] - old[i] + square[j][i] * laplace;
      }
    }
    const int row = TOP + (int)rint(depth_m / cell_m);
    memcpy(heard[n], pressure[(n + 2) % 3][row] + EDGE, sizeof heard[n]);
  }
}

// When a receiver hears most, s, and how much.
static double arrival(double x, double *size) {
  const int i = (int)rint(x / cell_m) + WIDE / 2;
  double level[STEPS] = {0};
  double complex pulse[2 * WINDOW + 1];
  for (int k = -WINDOW; k <= WINDOW; ++k)
    pulse[k + WINDOW] = cexp(-I * 2 * SONDE_PI * pulse_hz * k * step_s) *
                        exp(-0.5 * pow(k * step_s * fat_m_s / pulse_m, 2));
  int top = WINDOW + 1;
  for (int n = WINDOW; n < STEPS - WINDOW; ++n) {
    double complex sum = 0;
    for (int k = -WINDOW; k <= WINDOW; ++k) sum += (double)heard[n + k][i] * pulse[k + WINDOW];
    level[n] = cabs(sum);
    if (level[n] > level[top]) top = n;
  }
  const double a = level[top - 1], b = level[top], c = level[top + 1];
  *size = b;
  return (top + 1 + 0.5 * (a - c) / (a - 2 * b + c)) * step_s;
}

// Rays of a renderer through the same shape, down to the receivers.
static void march(bench *b, shape where, uint32_t which) {
  sonde_sound *s = b->echo->sound;
  const frame *f = &b->echo->frame;
  const uint32_t n = b->echo->padded;
  const double row_m = f->reach_m / (SONDE_MEDIUM_ROWS - 1);
  sonde_sound_begin(b->echo);
  for (uint32_t row = 0; row * row_m < depth_m; ++row) {
    float *level = b->echo->level[row % 2];
    for (uint32_t l = 0; l < n; ++l) {
      const double x = ((double)s->line[l] - f->first_line) * f->pitch_m;
      for (uint32_t k = 0; k < b->echo->levels; ++k) level[k * n + l] = k == 2 ? -1 : 1;
      const double away = where(x, row * row_m);
      level[which * n + l] = (float)(which == 2 ? -away : away);
    }
    sonde_sound_step(b->echo, row);
  }
}

// Times of arrival and pressure of rays against the wave's, up to so far from the middle.
static void compare(shape where, uint32_t which, double beyond_m_s, double reach_m,
                    const char *name, double most_s, double most_db) {
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, true);
  b.settings.depth_m = 0.05, b.settings.focus_m = 0.02;
  b.echo->scanner.sound_speeds = 1;
  b.echo->scanner.transmit_f = b.echo->scanner.receive_f = 10;
  look(&b, NULL);
  // Fat alone tells the pulse's level, and how much too fast the differences make the wave.
  double level, plain;
  propagate(where, fat_m_s, 0);
  const double slower = depth_m / fat_m_s / arrival(0, &plain);
  printf("%s: the wave is %.2f %% fast\n", name, 100 * (slower - 1));
  assert_true(fabs(slower - 1) < 0.01);
  propagate(where, beyond_m_s, 0);
  march(&b, where, which);
  const sonde_sound *s = b.echo->sound;
  const frame *f = &b.echo->frame;
  const double row_m = f->reach_m / (SONDE_MEDIUM_ROWS - 1);
  const double end_m = floor(depth_m / row_m) * row_m; // of the rays
  double worst = 0, square_db = 0;
  uint32_t count = 0;
  for (uint32_t l = 0; l < b.echo->lines; ++l) {
    const double start = ((double)l - f->first_line) * f->pitch_m;
    if (fabs(start) > reach_m) continue;
    const double left = depth_m - end_m,
                 x = ((double)s->line[l] - f->first_line) * f->pitch_m + (double)s->turn[l] * left;
    const double by_ray = ((double)s->shown[l] + left * (1 + (double)s->mean[l])) / sonde_sound_m_s;
    const double by_wave = slower * arrival(x, &level);
    // One way: the root of what both ways leave.
    const double db = 20 * log10(level / plain) - 10 * log10((double)s->spread[l]);
    worst = fmax(worst, fabs(by_ray - by_wave)), square_db += db * db, ++count;
    if (l % 4 == 0)
      printf("%s %5.2f mm: ray %.3f us at %.2f mm, wave %.3f us; %.1f dB, wave %.1f\n", name,
             1e3 * start, 1e6 * by_ray, 1e3 * x, 1e6 * by_wave, 10 * log10((double)s->spread[l]),
             20 * log10(level / plain));
  }
  printf("%s: times %.0f ns off at most, level %.1f dB rms\n", name, 1e9 * worst,
         sqrt(square_db / count));
  assert_true(worst < most_s && sqrt(square_db / count) < most_db);
  bench_clear(&b);
}

static void through_a_vein(void **state) {
  (void)state;
  compare(vein, LAYER_LEVELS, blood_m_s, 1.6e-3, "vein", 50e-9, 1);
}

static void through_a_slant(void **state) {
  (void)state;
  compare(slant, 2, muscle_m_s, 6e-3, "slant", 25e-9, 0.7);
}

// Most that the receivers near the axis hear.
static double peak(void) {
  double most = 0, level;
  for (int k = -12; k <= 12; ++k) arrival(2 * k * cell_m, &level), most = fmax(most, level);
  return most;
}

// Amplitude that the delays behind the wavy face leave at the receivers on the axis, both ways.
static double kept_in_focus(bench *b) {
  march(b, wavy, 2);
  sonde_aberration_find(b->echo);
  const double at = depth_m / b->echo->frame.depth_m * KEPT_DEPTHS;
  const uint32_t row = (uint32_t)at, middle = (b->echo->pad_lines + b->echo->lines) / 2;
  const float(*kept)[KEPT_COLUMNS] = b->echo->sound->kept + row;
  const double above = (double)kept[0][middle], below = (double)kept[1][middle];
  return above + (at - row) * (below - above);
}

// The focus behind a wavy face loses what the delays across the aperture tell, one way.
static void through_a_wavy_face(void **state) {
  (void)state;
  enum { HEIGHTS = 2 };
  const double high_m[HEIGHTS] = {0.5e-3, 1e-3}, most_db[HEIGHTS] = {0.4, 1}, number = 2.4;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, true, true);
  b.settings.depth_m = 0.05, b.settings.focus_m = depth_m, b.settings.frequency_hz = pulse_hz;
  b.echo->scanner.sound_speeds = 1;
  b.echo->scanner.transmit_f = b.echo->scanner.receive_f = number;
  look(&b, NULL);
  wave_high_m = 0;
  propagate(wavy, muscle_m_s, depth_m / number);
  const double flat = peak();
  assert_true(kept_in_focus(&b) > 0.99);
  for (int k = 0; k < HEIGHTS; ++k) {
    wave_high_m = high_m[k];
    propagate(wavy, muscle_m_s, depth_m / number);
    const double by_wave = 20 * log10(peak() / flat), share = kept_in_focus(&b);
    printf("waves of %.1f mm: focus %.2f dB, by the wave %.2f\n", 1e3 * high_m[k],
           10 * log10(share), by_wave);
    assert_true(fabs(by_wave - 10 * log10(share)) < most_db[k]);
  }
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(through_a_vein),
                                     cmocka_unit_test(through_a_slant),
                                     cmocka_unit_test(through_a_wavy_face)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
