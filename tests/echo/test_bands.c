// The window of the grid: whatever the bands' height, the field is the same, and nothing is left in
// the window.
#include "echo/bench.h"
#include "echo/bands.h"

#include <string.h>

// Rows per band, 0: as measured; the last fits no cube into the window at once.
static float *draw(bench *b, uint32_t rows, uint32_t *moved) {
  sonde_echo *echo = b->echo;
  echo->frame.pathology = &b->pathology;
  sonde_echo_frame(echo, b->pose, 0.04, &b->settings);
  if (rows > 0) echo->band_rows = rows < echo->window_rows ? rows : echo->window_rows - 2;
  sonde_bands_begin(echo);
  sonde_echo_plane(echo);
  sonde_echo_medium(echo);
  sonde_echo_scatter(echo);
  sonde_echo_blood(echo);
  for (uint32_t band = 0; band < echo->band_count; ++band) {
    sonde_bands_lay(echo, band);
    sonde_echo_beam(echo, band, true);
  }
  sonde_echo_beam_end(echo);
  *moved = echo->moved;
  uint32_t lines, samples;
  const float *envelope = sonde_echo_envelope(echo, &lines, &samples);
  float *copy = SONDE_NEW(float, (size_t)lines *samples);
  memcpy(copy, envelope, sizeof(float) * lines * samples);
  return copy;
}

// Largest difference of a row over its largest value.
static double apart(const bench *b, const float *x, const float *y) {
  double worst = 0;
  for (uint32_t n = 0; n < b->echo->samples; ++n) {
    double size = 1e-30, most = 0;
    for (uint32_t l = 0; l < b->echo->lines; ++l) {
      size_t i = (size_t)n * b->echo->lines + l;
      size = fmax(size, (double)fabsf(x[i])), most = fmax(most, (double)fabsf(x[i] - y[i]));
    }
    worst = fmax(worst, most / size);
  }
  return worst;
}

static void check_view(bench *b) {
  static const uint32_t heights[] = {8, 33, 61, UINT32_MAX};
  uint32_t moved, again;
  float *one = draw(b, 0, &moved);
  const sonde_echo *echo = b->echo;
  print_message("%u rows, window %u, bands of %u\n", echo->grid_samples, echo->window_rows,
                echo->band_rows);
  assert_true(echo->band_count > 3);
  for (size_t k = 0; k < SONDE_COUNT_OF(heights); ++k) {
    float *other = draw(b, heights[k], &again);
    double off = apart(b, one, other);
    print_message("  of %u: %.2g\n", echo->band_rows, off);
    assert_true(off < 1e-5 && again == moved);
    sonde_free(other);
  }
  for (uint32_t i = 0; i < (echo->window_rows + 2) * echo->grid_stride; ++i)
    assert_true(echo->grid[i] >= 0 && echo->grid[i] <= 0);
  sonde_free(one);
}

// Across the leg and along the vein, where segments of blood are longer than the window is high.
static void height_does_not_matter(void **state) {
  (void)state;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  look(&b, NULL);
  assert_true(sonde_echo_last_times(b.echo).blood > 1000);
  static const double depths_m[] = {0.02, 0.05, 0.07, 0.15};
  for (size_t k = 0; k < SONDE_COUNT_OF(depths_m); ++k) {
    b.settings.depth_m = depths_m[k];
    check_view(&b);
  }
  sonde_mat3 along = m_columns(vec3(0, 0, 1), vec3(-1, 0, 0), vec3(0, -1, 0));
  b.pose.rotation = q_from_matrix(along);
  b.settings.depth_m = 0.05;
  check_view(&b);
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(height_does_not_matter)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
