// What the bundled measurements show, so that the figures of the experiment can be drawn from them.
#include "fit/fit_thigh.h"

typedef struct curve {
  uint32_t count;
  double force_n[32]; // at 0, 2, 4 ... mm
} curve;

static void take_curves(const sonde_measurements *m, curve curves[2][64]) {
  memset(curves, 0, 2 * 64 * sizeof(curve));
  for (uint32_t i = 0; i < m->count; ++i) {
    const sonde_datum *d = &m->data[i];
    curve *c = &curves[strcmp(d->probe, "point") == 0][d->site];
    assert_near(d->penetration_m, 2e-3 * ++c->count, 1e-12);
    c->force_n[c->count] = d->force_n;
  }
}

// Every curve stiffens with depth: second differences, the untouched skin included.
static void all_curves_are_convex(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 8.0);
  curve curves[2][64];
  take_curves(&b.m, curves);
  uint32_t differences = 0;
  for (int p = 0; p < 2; ++p)
    for (int s = 0; s < 64; ++s)
      for (uint32_t k = 1; k < curves[p][s].count; ++k, ++differences) {
        const double *f = &curves[p][s].force_n[k];
        if (!(f[1] - 2 * f[0] + f[-1] >= -1e-3))
          fail_msg("site %d, step %u: %g %g %g", s, k, f[-1], f[0], f[1]);
      }
  assert_int_equal(differences, 1700);
  bundled_clear(&b);
}

static void wide_probe_needs_more_force_everywhere(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 8.0);
  curve curves[2][64];
  take_curves(&b.m, curves);
  uint32_t pairs = 0;
  double least = INFINITY;
  for (int s = 0; s < 64; ++s)
    for (uint32_t k = 1; k <= curves[0][s].count && k <= curves[1][s].count; ++k, ++pairs)
      least = fmin(least, curves[0][s].force_n[k] / curves[1][s].force_n[k]);
  print_message("linear over point: at least %.3f at %u depths\n", least, pairs);
  assert_int_equal(pairs, 896);
  assert_true(least > 1);
  bundled_clear(&b);
}

static double correlation(const double *a, const double *b, uint32_t n) {
  double ma = 0, mb = 0, ab = 0, aa = 0, bb = 0;
  for (uint32_t i = 0; i < n; ++i) ma += a[i] / n, mb += b[i] / n;
  for (uint32_t i = 0; i < n; ++i) {
    ab += (a[i] - ma) * (b[i] - mb);
    aa += (a[i] - ma) * (a[i] - ma);
    bb += (b[i] - mb) * (b[i] - mb);
  }
  return ab / sqrt(aa * bb);
}

// Thin tissue becomes incompressible early.
static void thin_fat_means_a_near_asymptote(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 8.0);
  sonde_fit_def def = sonde_fit_def_default();
  def.stages = 1;
  sonde_fit_result fit;
  sonde_error error;
  assert_ok(sonde_fit(b.model, &b.sites, &b.m, &def, NULL, &fit, &error), &error);
  double fat_m[2][64], xm_m[2][64];
  uint32_t count[2] = {0};
  for (uint32_t c = 0; c < fit.curve_count; ++c) {
    int p = strcmp(fit.curves[c].probe, "point") == 0;
    fat_m[p][count[p]] = b.sites.fat_depth_m[fit.curves[c].site];
    xm_m[p][count[p]++] = fit.curves[c].xm_m;
  }
  for (int p = 0; p < 2; ++p) {
    double r = correlation(fat_m[p], xm_m[p], count[p]);
    print_message("fat thickness against xm, %s: %+.3f\n", p ? "point" : "linear", r);
    assert_true(r > 0.25); // 64 pairs without connection stay below 0.25 in 95 of 100 draws
  }
  sonde_fit_result_clear(&fit);
  bundled_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(all_curves_are_convex),
      cmocka_unit_test(wide_probe_needs_more_force_everywhere),
      cmocka_unit_test(thin_fat_means_a_near_asymptote),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
