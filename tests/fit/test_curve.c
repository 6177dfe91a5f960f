// Stage 1: recovery of known laws, the bundled curves, random starts, bad curves.
#include "fit_test.h"

#include "base/random.h"
#include "fit/fit_inside.h"

enum { POINTS = 14 };
static const double GUARD = 0.999, AREA_M2 = 7.2e-4;

static void make_curve(double k0, double xm, double *depth, double *force) {
  for (int i = 0; i < POINTS; ++i) {
    depth[i] = 0.002 * (i + 1);
    force[i] = AREA_M2 * k0 * depth[i] / (1 - depth[i] / xm);
  }
}

static void recovers_known_laws(void **state) {
  (void)state;
  sonde_fit_def def = sonde_fit_def_default();
  for (int k = 0; k < 200; ++k) {
    double k0 = 1e4 * exp(6 * sonde_random_uniform(1, (uint64_t)k));
    double xm = 0.0285 + 0.1 * sonde_random_uniform(2, (uint64_t)k);
    double depth[POINTS], force[POINTS];
    make_curve(k0, xm, depth, force);
    def.max_iterations = k % 2 ? 400 : 1; // the closed-form start is exact: one step suffices
    const double far[2] = {k0 * 20, xm + 0.3};
    sonde_curve_fit fit;
    assert_ok(
        sonde_fit_curve(depth, force, POINTS, AREA_M2, GUARD, &def, k % 2 ? far : NULL, &fit, NULL),
        NULL);
    assert_true(fit.converged || def.max_iterations == 1);
    assert_near(fit.k0_n_m3 / k0, 1, 1e-6);
    assert_near(fit.xm_m / xm, 1, 1e-6);
  }
}

// A law without asymptote: xm runs to where the curve is straight, k0 stays right.
static void straight_curves_are_fitted(void **state) {
  (void)state;
  double depth[POINTS], force[POINTS];
  for (int i = 0; i < POINTS; ++i) {
    depth[i] = 0.002 * (i + 1);
    force[i] = AREA_M2 * 1e5 * depth[i];
  }
  sonde_fit_def def = sonde_fit_def_default();
  sonde_curve_fit fit;
  assert_ok(sonde_fit_curve(depth, force, POINTS, AREA_M2, GUARD, &def, NULL, &fit, NULL), NULL);
  assert_near(fit.k0_n_m3, 1e5, 1e2);
  assert_true(fit.xm_m > 10);
}

// One gross outlier moves the robust fits far less than the least squares fit.
static void robust_losses_resist_an_outlier(void **state) {
  (void)state;
  double depth[POINTS], force[POINTS], shift[3];
  make_curve(2e5, 0.05, depth, force);
  force[5] += 10;
  for (int loss = 0; loss < 3; ++loss) {
    sonde_fit_def def = sonde_fit_def_default();
    def.loss = (sonde_fit_loss)loss;
    def.loss_scale = 0.2;
    sonde_curve_fit fit;
    assert_ok(sonde_fit_curve(depth, force, POINTS, AREA_M2, GUARD, &def, NULL, &fit, NULL), NULL);
    shift[loss] = fabs(log(fit.k0_n_m3 / 2e5));
  }
  assert_true(shift[SONDE_LOSS_HUBER] < 0.3 * shift[SONDE_LOSS_SQUARES]);
  assert_true(shift[SONDE_LOSS_STUDENT] < 0.1 * shift[SONDE_LOSS_SQUARES]);
}

static void bad_curves_are_refused(void **state) {
  (void)state;
  const double depth[3] = {0, 0, 0}, force[3] = {1, 2, 3};
  sonde_fit_def def = sonde_fit_def_default();
  sonde_curve_fit fit;
  sonde_error error;
  assert_int_equal(sonde_fit_curve(depth, force, 2, AREA_M2, GUARD, &def, NULL, &fit, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "at least 3");
  assert_int_equal(sonde_fit_curve(depth, force, 3, AREA_M2, GUARD, &def, NULL, &fit, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "positive penetration");
}

// One curve of the bundled data.
static uint32_t bundled_curve(const sonde_measurements *m, uint32_t site, const char *probe,
                              double *depth, double *force) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < m->count; ++i) {
    if (m->data[i].site != site || strcmp(m->data[i].probe, probe) != 0) continue;
    depth[count] = m->data[i].penetration_m;
    force[count++] = m->data[i].force_n;
  }
  return count;
}

static sonde_measurements load_bundled(void) {
  sonde_measurements m;
  sonde_error error;
  assert_ok(sonde_measurements_load(DATA_DIR "indentation.csv", NULL, &m, &error), &error);
  return m;
}

// Eq. (1) curve by curve: at most 2 % of the mean force over all, 0.7 % linear, 4.8 % point.
static void bundled_curves_meet_two_percent(void **state) {
  (void)state;
  sonde_measurements m = load_bundled();
  sonde_fit_def def = sonde_fit_def_default();
  const char *probes[2] = {"linear", "point"};
  double misfit[2] = {0}, force_sum[2] = {0}, rows[2] = {0}, depth[64], force[64];
  for (uint32_t site = 0; site < 64; ++site)
    for (int p = 0; p < 2; ++p) {
      uint32_t count = bundled_curve(&m, site, probes[p], depth, force);
      sonde_curve_fit fit;
      assert_ok(sonde_fit_curve(depth, force, count, AREA_M2, GUARD, &def, NULL, &fit, NULL), NULL);
      assert_true(fit.converged);
      misfit[p] += fit.mae_n * count;
      rows[p] += count;
      for (uint32_t i = 0; i < count; ++i) force_sum[p] += force[i];
    }
  double linear = 100 * misfit[0] / force_sum[0], point = 100 * misfit[1] / force_sum[1];
  double pooled = 100 * (misfit[0] + misfit[1]) / (force_sum[0] + force_sum[1]);
  print_message("stage 1 MAE: linear %.2f %%, point %.2f %%, pooled %.2f %% (%g rows)\n", linear,
                point, pooled, rows[0] + rows[1]);
  assert_true(pooled <= 2.0);
  assert_true(linear <= 0.9 && point <= 5.0);
  sonde_measurements_clear(&m);
}

// At least 95 of 100 random starts find the optimum of the closed-form start.
static void random_starts_reach_the_same_optimum(void **state) {
  (void)state;
  sonde_measurements m = load_bundled();
  sonde_fit_def def = sonde_fit_def_default();
  uint32_t same = 0, tried = 0;
  double depth[64], force[64];
  for (uint32_t site = 0; site < 64; site += 3)
    for (int p = 0; p < 2; ++p) {
      uint32_t count = bundled_curve(&m, site, p ? "linear" : "point", depth, force);
      sonde_curve_fit reference, fit;
      sonde_fit_curve(depth, force, count, AREA_M2, GUARD, &def, NULL, &reference, NULL);
      for (uint64_t k = 0; k < 50; ++k, ++tried) {
        uint64_t id = (site * 2u + (uint32_t)p) * 100u + k;
        double above = exp(log(1e-4) + log(1e4) * sonde_random_uniform(3, id)); // 0.1 mm .. 1 m
        double k0 = exp(log(1e3) + log(1e5) * sonde_random_uniform(4, id));     // 1e3 .. 1e8
        const double start[2] = {k0, depth[count - 1] / GUARD + above};
        assert_ok(sonde_fit_curve(depth, force, count, AREA_M2, GUARD, &def, start, &fit, NULL),
                  NULL);
        same += fabs(log(fit.k0_n_m3 / reference.k0_n_m3)) < 1e-5 &&
                fabs(log(fit.xm_m / reference.xm_m)) < 1e-5;
      }
    }
  print_message("random starts: %u of %u at the same optimum\n", same, tried);
  assert_true(same >= 0.95 * tried);
  sonde_measurements_clear(&m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(recovers_known_laws),
      cmocka_unit_test(straight_curves_are_fitted),
      cmocka_unit_test(robust_losses_resist_an_outlier),
      cmocka_unit_test(bad_curves_are_refused),
      cmocka_unit_test(bundled_curves_meet_two_percent),
      cmocka_unit_test(random_starts_reach_the_same_optimum),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
