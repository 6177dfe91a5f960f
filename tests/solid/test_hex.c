// Laws and element: forces are the gradient of the energy and the stiffness that of the forces, for
// every law; small strains meet Hooke, neo-Hookean is Ogden's exponent 2 and Fung's limit; turning
// costs nothing; one volume per element does not lock where eight do.
#include "fixture.h"
#include "solid/hex.h"

#include <string.h>

static const char *const NAMES[] = {SONDE_STRAIN_ENERGY_NAMES};

// A crooked element, moved: `amount` of shear, squeeze and unevenness.
static void crooked(double amount, sonde_vec3 rest[8], sonde_vec3 now[8]) {
  static const int at[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                               {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  uint64_t random = 7;
  for (int n = 0; n < 8; ++n) {
    double x[3], u[3];
    for (int k = 0; k < 3; ++k) {
      random = random * 6364136223846793005u + 1442695040888963407u;
      double r = (double)(random >> 11) / 9007199254740992.0 - 0.5;
      x[k] = 0.01 * (at[n][k] + 0.2 * r);
      random = random * 6364136223846793005u + 1442695040888963407u;
      u[k] = 0.01 * amount * 0.3 * ((double)(random >> 11) / 9007199254740992.0 - 0.5);
    }
    rest[n] = vec3(x[0], x[1], x[2]);
    now[n] = vec3(x[0] + amount * (0.3 * x[2] + 0.2 * x[0]) + u[0],
                  x[1] - amount * 0.25 * x[1] + u[1], x[2] + amount * 0.1 * x[1] + u[2]);
  }
}

static sonde_hyperelastic law(int kind) {
  return (sonde_hyperelastic){(sonde_strain_energy)kind, 3000, kind == 0 ? 9 : 3, 72000};
}

static double *coordinate(sonde_vec3 *p, int k) {
  return k % 3 == 0 ? &p[k / 3].x : k % 3 == 1 ? &p[k / 3].y : &p[k / 3].z;
}

static void gradient_and_stiffness_match_differences(void **state) {
  (void)state;
  for (int kind = 0; kind < 3; ++kind)
    for (int strained = 0; strained < 2; ++strained) {
      const sonde_hyperelastic m = law(kind);
      sonde_vec3 rest[8], now[8];
      double e, ep, em, f[24], fp[24], fm[24], k[24][24], worst_f = 0, worst_k = 0, most_f = 0,
                                                          most_k = 0;
      crooked(strained ? 1 : 0.001, rest, now);
      assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &e, f, k));
      for (int j = 0; j < 24; ++j) {
        const double h = 1e-7;
        double *x = coordinate(now, j), keep = *x;
        *x = keep + h;
        assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &ep, fp, NULL));
        *x = keep - h;
        assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &em, fm, NULL));
        *x = keep;
        worst_f = fmax(worst_f, fabs((ep - em) / (2 * h) - f[j]));
        most_f = fmax(most_f, fabs(f[j]));
        for (int i = 0; i < 24; ++i) {
          worst_k = fmax(worst_k, fabs((fp[i] - fm[i]) / (2 * h) - k[i][j]));
          most_k = fmax(most_k, fabs(k[i][j]));
          assert_near(k[i][j], k[j][i], 1e-12 * most_k);
        }
      }
      print_message("%s %s: force off by %.1e, stiffness by %.1e\n", NAMES[kind],
                    strained ? "strained" : "near rest", worst_f / most_f, worst_k / most_k);
      assert_true(worst_f <= 1e-6 * most_f);
      assert_true(worst_k <= 1e-6 * most_k);
    }
}

// The change of the forces with the exponent is theirs between two exponents.
static void change_with_the_exponent_matches_differences(void **state) {
  (void)state;
  for (int kind = 0; kind < 3; ++kind) {
    sonde_hyperelastic m = law(kind);
    const double a = m.exponent, h = 1e-5;
    sonde_vec3 rest[8], now[8];
    double e, change[24], high[24], low[24], worst = 0, most = 0;
    crooked(1, rest, now);
    assert_true(sonde_hex_kernels_find(NULL)->by_exponent(&m, rest, now, change));
    m.exponent = a + h;
    assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &e, high, NULL));
    m.exponent = a - h;
    assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &e, low, NULL));
    for (int k = 0; k < 24; ++k) {
      worst = fmax(worst, fabs((high[k] - low[k]) / (2 * h) - change[k]));
      most = fmax(most, fabs(change[k]));
    }
    print_message("%s: change with the exponent %.2e N, off by %.1e N\n", NAMES[kind], most, worst);
    assert_true(worst <= 1e-8 * most);
    assert_true((most > 0) == (kind != SONDE_ENERGY_NEO_HOOKEAN));
  }
}

// Uniaxial and shear moduli at rest are Hooke's with mu and K.
static void small_strains_meet_hooke(void **state) {
  (void)state;
  for (int kind = 0; kind < 3; ++kind) {
    const sonde_hyperelastic m = law(kind);
    const double t = 1e-5, volume = 1e-6;
    sonde_vec3 rest[8], now[8];
    double e, f[24];
    for (int n = 0; n < 8; ++n)
      rest[n] = vec3(0.01 * (n % 4 == 1 || n % 4 == 2), 0.01 * (n % 4 > 1), 0.01 * (n / 4));
    for (int n = 0; n < 8; ++n) now[n] = vec3(rest[n].x + t * rest[n].y, rest[n].y, rest[n].z);
    assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &e, f, NULL));
    assert_near(e / (0.5 * m.shear_pa * t * t * volume), 1, 1e-4);
    for (int n = 0; n < 8; ++n) now[n] = vec3(rest[n].x * (1 + t), rest[n].y, rest[n].z);
    assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &e, f, NULL));
    assert_near(e / (0.5 * (m.bulk_pa + 4 * m.shear_pa / 3) * t * t * volume), 1, 1e-4);
  }
}

static void laws_meet_in_their_limits(void **state) {
  (void)state;
  const double stretch2[3] = {1.9, 0.7, 0.8};
  const sonde_hyperelastic neo = {SONDE_ENERGY_NEO_HOOKEAN, 2000, 0, 5e4};
  const sonde_hyperelastic ogden = {SONDE_ENERGY_OGDEN, 2000, 2, 5e4};
  const sonde_hyperelastic fung = {SONDE_ENERGY_FUNG, 2000, 1e-9, 5e4};
  sonde_shape_energy a, b, c;
  sonde_hex_kernels_find(NULL)->shape(&neo, stretch2, &a);
  sonde_hex_kernels_find(NULL)->shape(&ogden, stretch2, &b);
  sonde_hex_kernels_find(NULL)->shape(&fung, stretch2, &c);
  assert_near(a.w_pa, b.w_pa, 1e-12 * a.w_pa);
  assert_near(c.w_pa, a.w_pa, 1e-6 * a.w_pa);
  assert_near(a.first_pa[0] + a.first_pa[1] + a.first_pa[2], 0, 1e-9);
  // Simple tension of an incompressible body: mu (l^2 - 1/l) against Ogden's 2 mu/a (l^a -
  // l^(-a/2)).
  const double l = 1.3, free2 = 1 / l, tension2[3] = {l * l, free2, free2};
  const sonde_hyperelastic stiff = {SONDE_ENERGY_OGDEN, 2000, 9, 5e4};
  sonde_hex_kernels_find(NULL)->shape(&neo, tension2, &a);
  sonde_hex_kernels_find(NULL)->shape(&stiff, tension2, &b);
  assert_near(a.first_pa[0] - a.first_pa[1], 2000 * (l * l - 1 / l), 1e-9);
  assert_near(b.first_pa[0] - b.first_pa[1], 4000.0 / 9 * (pow(l, 9) - pow(l, -4.5)), 1e-8);
}

static void turning_costs_nothing(void **state) {
  (void)state;
  const sonde_hyperelastic m = law(0);
  sonde_vec3 rest[8], now[8];
  double e, turned_e, f[24], turned_f[24];
  const sonde_quat q = q_unit((sonde_quat){0.8, 0.3, -0.4, 0.2});
  crooked(0.7, rest, now);
  assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &e, f, NULL));
  for (int n = 0; n < 8; ++n) now[n] = v_add(q_rotate(q, now[n]), vec3(0.1, -0.2, 0.3));
  assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &turned_e, turned_f, NULL));
  assert_near(turned_e, e, 1e-11 * e);
  for (int n = 0; n < 8; ++n) {
    sonde_vec3 a = q_rotate(q, vec3(f[3 * n], f[3 * n + 1], f[3 * n + 2]));
    assert_near(v_distance(a, vec3(turned_f[3 * n], turned_f[3 * n + 1], turned_f[3 * n + 2])), 0,
                1e-10 * v_norm(a));
  }
  // Turned inside out.
  for (int n = 0; n < 8; ++n) now[n].z = -now[n].z;
  for (int n = 0; n < 4; ++n) {
    sonde_vec3 swap = now[n];
    now[n] = rest[n + 4], now[n + 4] = swap;
  }
  assert_false(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &e, f, NULL));
}

// A volume change that is zero on average costs shape alone: bending of a nearly incompressible
// element. With eight volume conditions it would cost K.
static void bending_does_not_lock(void **state) {
  (void)state;
  sonde_vec3 rest[8], now[8];
  double energy[2], f[24];
  for (int n = 0; n < 8; ++n) {
    rest[n] = vec3(0.01 * (n % 4 == 1 || n % 4 == 2) - 0.005, 0.01 * (n % 4 > 1) - 0.005,
                   0.01 * (n / 4) - 0.005);
    now[n] = vec3(rest[n].x + 0.2 * rest[n].x * rest[n].y, rest[n].y, rest[n].z);
  }
  for (int stiff = 0; stiff < 2; ++stiff) {
    const sonde_hyperelastic m = {SONDE_ENERGY_NEO_HOOKEAN, 3000, 0, stiff ? 3e9 : 72e3};
    assert_true(sonde_hex_kernels_find(NULL)->evaluate(&m, rest, now, &energy[stiff], f, NULL));
  }
  assert_near(energy[1] / energy[0], 1, 1e-9);
}

static void principal_axes_rebuild_the_matrix(void **state) {
  (void)state;
  const sonde_mat3 a = {{{3, -1, 0.5}, {-1, 2, 0.25}, {0.5, 0.25, 1}}};
  double value[3], q[3][3];
  sonde_hex_kernels_find(NULL)->principal(a, value, q);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double sum = 0;
      for (int m = 0; m < 3; ++m) sum += q[i][m] * value[m] * q[j][m];
      assert_near(sum, a.m[i][j], 1e-14);
    }
}

static void all_sets_give_the_same_bits(void **state) {
  (void)state;
  static const char *const SETS[] = {"avx2", "avx512"};
  for (int kind = 0; kind < 3; ++kind)
    for (int n = 0; n < 2 * (int)SONDE_COUNT_OF(SETS); ++n) {
      const sonde_hex_kernels *plain = sonde_hex_kernels_find("base"),
                              *wide = sonde_hex_kernels_find(SETS[n / 2]);
      const sonde_hyperelastic m = law(kind);
      sonde_vec3 rest[8], now[8];
      double e[2], f[2][24], change[2][24], k[2][24][24];
      if (!wide) continue; // this processor has it not
      crooked(n % 2 ? 0.9 : 1e-3, rest, now);
      assert_true(plain->evaluate(&m, rest, now, &e[0], f[0], k[0]));
      assert_true(wide->evaluate(&m, rest, now, &e[1], f[1], k[1]));
      assert_true(plain->by_exponent(&m, rest, now, change[0]));
      assert_true(wide->by_exponent(&m, rest, now, change[1]));
      assert_memory_equal(&e[0], &e[1], sizeof e[0]);
      assert_memory_equal(f[0], f[1], sizeof f[0]);
      assert_memory_equal(k[0], k[1], sizeof k[0]);
      assert_memory_equal(change[0], change[1], sizeof change[0]);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(gradient_and_stiffness_match_differences),
      cmocka_unit_test(change_with_the_exponent_matches_differences),
      cmocka_unit_test(small_strains_meet_hooke),
      cmocka_unit_test(laws_meet_in_their_limits),
      cmocka_unit_test(turning_costs_nothing),
      cmocka_unit_test(bending_does_not_lock),
      cmocka_unit_test(principal_axes_rebuild_the_matrix),
      cmocka_unit_test(all_sets_give_the_same_bits),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
