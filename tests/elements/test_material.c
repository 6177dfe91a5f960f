// Materials: stress is the derivative of the energy and the tangent that of the stress, both laws
// start with the same moduli, turning costs the neo-Hookean one nothing, a stretched bar has
// Young's modulus and Poisson's ratio, batches of eight doubles and sixteen floats do the same.
#define SONDE_REAL_SCALAR
#include "geometry/shapes.h"
#include "elements/material.h"

void material_batch_double(sonde_elastic_material law, double mu, double lambda, const double *f,
                           const double *df, double *out);
void material_batch_float(sonde_elastic_material law, double mu, double lambda, const double *f,
                          const double *df, double *out);

static const double MU = 2e3, LAMBDA = 9e4;

static void random_gradient(uint64_t *seed, double size, double f[9]) {
  for (int k = 0; k < 9; ++k) f[k] = (k % 4 == 0) + shape_uniform(seed, -size, size);
}

static void test_derivatives(void **state) {
  (void)state;
  const double h = 1e-5;
  uint64_t seed = 1;
  for (int round = 0; round < 200; ++round) {
    sonde_elastic_material law = round % 2 ? SONDE_NEO_HOOKEAN : SONDE_LINEAR;
    double f[9], p[9], df[9], dp[9], up[9], down[9];
    random_gradient(&seed, 0.4, f);
    material_stress(law, MU, LAMBDA, f, p);
    for (int k = 0; k < 9; ++k) {
      double x[9], y[9];
      memcpy(x, f, sizeof f);
      memcpy(y, f, sizeof f);
      x[k] += h, y[k] -= h;
      double slope =
          (material_energy(law, MU, LAMBDA, x) - material_energy(law, MU, LAMBDA, y)) / (2 * h);
      assert_near(p[k], slope, 1e-6 * LAMBDA);
    }
    random_gradient(&seed, 1, df);
    for (int k = 0; k < 9; ++k) up[k] = f[k] + h * df[k], down[k] = f[k] - h * df[k];
    double high[9], low[9];
    material_stress(law, MU, LAMBDA, up, high);
    material_stress(law, MU, LAMBDA, down, low);
    material_tangent(law, MU, LAMBDA, f, df, dp);
    for (int k = 0; k < 9; ++k) assert_near(dp[k], (high[k] - low[k]) / (2 * h), 1e-6 * LAMBDA);
  }
}

static void test_same_at_rest(void **state) {
  (void)state;
  static const double rest[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  uint64_t seed = 2;
  double p[9], a[9], b[9], df[9];
  for (int law = 0; law < 2; ++law) {
    assert_near(material_energy((sonde_elastic_material)law, MU, LAMBDA, rest), 0, 1e-12);
    material_stress((sonde_elastic_material)law, MU, LAMBDA, rest, p);
    for (int k = 0; k < 9; ++k) assert_near(p[k], 0, 1e-9);
  }
  random_gradient(&seed, 1, df);
  material_tangent(SONDE_LINEAR, MU, LAMBDA, rest, df, a);
  material_tangent(SONDE_NEO_HOOKEAN, MU, LAMBDA, rest, df, b);
  for (int k = 0; k < 9; ++k) assert_near(a[k], b[k], 1e-9 * LAMBDA);
}

// A bar of Young's modulus 3 and Poisson's ratio 0.3 under a strain of 1 %.
static void test_bar(void **state) {
  (void)state;
  const double young = 3, poisson = 0.3, strain = 0.01;
  double mu = young / (2 * (1 + poisson)), p[9];
  double lambda = young * poisson / ((1 + poisson) * (1 - 2 * poisson));
  const double side = 1 - poisson * strain, f[9] = {1 + strain, 0, 0, 0, side, 0, 0, 0, side};
  material_stress(SONDE_LINEAR, mu, lambda, f, p);
  assert_near(p[0], young * strain, 1e-12);
  for (int k = 1; k < 9; ++k) assert_near(p[k], 0, 1e-12);
}

static void test_turning(void **state) {
  (void)state;
  uint64_t seed = 3;
  for (int round = 0; round < 50; ++round) {
    sonde_mat3 q = q_matrix(q_unit(shape_rotation(&seed)));
    double f[9], turned[9];
    random_gradient(&seed, 0.3, f);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        turned[3 * i + j] = q.m[i][0] * f[j] + q.m[i][1] * f[3 + j] + q.m[i][2] * f[6 + j];
    double energy = material_energy(SONDE_NEO_HOOKEAN, MU, LAMBDA, f);
    assert_near(material_energy(SONDE_NEO_HOOKEAN, MU, LAMBDA, turned), energy, 1e-11 * LAMBDA);
    assert_true(energy >= 0);
  }
}

static void test_batches(void **state) {
  (void)state;
  enum { MOST = 16 };
  uint64_t seed = 4;
  double f[MOST][9], df[MOST][9], out[MOST][19];
  for (int law = 0; law < 2; ++law)
    for (int width = 8; width <= MOST; width += 8) {
      for (int i = 0; i < MOST; ++i)
        random_gradient(&seed, 0.3, f[i]), random_gradient(&seed, 1, df[i]);
      if (width == 8)
        material_batch_double((sonde_elastic_material)law, MU, LAMBDA, f[0], df[0], out[0]);
      else
        material_batch_float((sonde_elastic_material)law, MU, LAMBDA, f[0], df[0], out[0]);
      for (int i = 0; i < width; ++i) {
        double p[9], dp[9], near = width == 8 ? 0 : 3e-6 * LAMBDA;
        material_stress((sonde_elastic_material)law, MU, LAMBDA, f[i], p);
        material_tangent((sonde_elastic_material)law, MU, LAMBDA, f[i], df[i], dp);
        assert_near(out[i][0], material_energy((sonde_elastic_material)law, MU, LAMBDA, f[i]),
                    near);
        for (int k = 0; k < 9; ++k) {
          assert_near(out[i][1 + k], p[k], near);
          assert_near(out[i][10 + k], dp[k], near);
        }
      }
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_derivatives), cmocka_unit_test(test_same_at_rest),
      cmocka_unit_test(test_bar),         cmocka_unit_test(test_turning),
      cmocka_unit_test(test_batches),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
