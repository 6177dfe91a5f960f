// The bordered Levenberg-Marquardt against a dense oracle, and its losses.
#include "fit_test.h"

#include "base/random.h"
#include "fit/bordered.h"

enum { BLOCKS = 5, ROWS = 8, SIZE = 2 * BLOCKS + 2 };

// Gaussian elimination with pivoting, in place; the oracle.
static void dense_solve(double a[SIZE][SIZE], double *x, int n) {
  for (int c = 0; c < n; ++c) {
    int best = c;
    for (int r = c + 1; r < n; ++r)
      if (fabs(a[r][c]) > fabs(a[best][c])) best = r;
    for (int k = 0; k < n; ++k) {
      double t = a[c][k];
      a[c][k] = a[best][k];
      a[best][k] = t;
    }
    double t = x[c];
    x[c] = x[best];
    x[best] = t;
    for (int r = 0; r < n; ++r) {
      if (r == c) continue;
      double f = a[r][c] / a[c][c];
      for (int k = c; k < n; ++k) a[r][k] -= f * a[c][k];
      x[r] -= f * x[c];
    }
  }
  for (int c = 0; c < n; ++c) x[c] /= a[c][c];
}

// y = exp(t0) x + t1 x^2 + exp(b0) sin x + b1 x^3, a smooth test family.
typedef struct family {
  double x[BLOCKS * ROWS], y[BLOCKS * ROWS];
} family;

static void family_row(const void *user, uint32_t block, uint32_t row, const double theta[2],
                       const double *border, double *residual, double jacobian[4]) {
  (void)block;
  const family *f = user;
  double x = f->x[row];
  jacobian[0] = exp(theta[0]) * x;
  jacobian[1] = x * x;
  jacobian[2] = exp(border[0]) * sin(x);
  jacobian[3] = x * x * x;
  *residual = jacobian[0] + theta[1] * x * x + jacobian[2] + border[1] * x * x * x - f->y[row];
}

static const uint32_t STARTS[BLOCKS + 1] = {0, 8, 16, 24, 32, 40};

static sonde_bordered_problem family_problem(const family *f) {
  return (sonde_bordered_problem){.block_count = BLOCKS,
                                  .border_count = 2,
                                  .row_start = STARTS,
                                  .row = family_row,
                                  .user = f,
                                  .low = {-20, -20},
                                  .high = {20, 20},
                                  .border_low = {-20, -20},
                                  .border_high = {20, 20},
                                  .loss_scale = 1,
                                  .max_iterations = 500};
}

static void fill_family(family *f, double (*theta)[2], double *border, double noise) {
  for (uint32_t r = 0; r < BLOCKS * ROWS; ++r) {
    f->x[r] = 0.2 + 0.3 * (r % ROWS);
    f->y[r] = 0;
  }
  border[0] = 0.4;
  border[1] = -0.3;
  for (uint32_t b = 0; b < BLOCKS; ++b) {
    theta[b][0] = 0.1 * b;
    theta[b][1] = 1 - 0.4 * b;
    for (uint32_t r = STARTS[b]; r < STARTS[b + 1]; ++r) {
      double residual, jacobian[4];
      family_row(f, b, r, theta[b], border, &residual, jacobian);
      f->y[r] = residual + noise * sonde_random_normal(9, r);
    }
  }
}

// The dense normal equations with damping on the diagonal, from the same rows.
static void dense_step(const family *f, const double (*theta)[2], const double *border,
                       double damping, double *step) {
  double a[SIZE][SIZE] = {{0}};
  for (int i = 0; i < SIZE; ++i) step[i] = 0;
  for (uint32_t b = 0; b < BLOCKS; ++b)
    for (uint32_t r = STARTS[b]; r < STARTS[b + 1]; ++r) {
      double residual, j[4], full[SIZE] = {0};
      family_row(f, b, r, theta[b], border, &residual, j);
      full[2 * b] = j[0];
      full[2 * b + 1] = j[1];
      full[SIZE - 2] = j[2];
      full[SIZE - 1] = j[3];
      for (int p = 0; p < SIZE; ++p) {
        step[p] -= full[p] * residual;
        for (int q = 0; q < SIZE; ++q) a[p][q] += full[p] * full[q];
      }
    }
  for (int i = 0; i < SIZE; ++i) a[i][i] *= 1 + damping;
  dense_solve(a, step, SIZE);
}

static void step_equals_dense_step(void **state) {
  (void)state;
  family f;
  double theta[BLOCKS][2], border[2], dense[SIZE], step[BLOCKS][2], border_step[2];
  fill_family(&f, theta, border, 0.1);
  sonde_bordered_problem problem = family_problem(&f);
  sonde_bordered_block blocks[BLOCKS];
  sonde_bordered_border normal;
  for (double damping = 1; damping > 1e-5; damping *= 0.1) {
    theta[1][0] += 0.1;
    sonde_bordered_assemble(&problem, (const double(*)[2])theta, border, blocks, &normal);
    assert_true(sonde_bordered_solve(blocks, BLOCKS, &normal, 2, damping, step, border_step));
    dense_step(&f, (const double(*)[2])theta, border, damping, dense);
    double scale = 0;
    for (int i = 0; i < SIZE; ++i) scale = fmax(scale, fabs(dense[i]));
    for (int b = 0; b < BLOCKS; ++b)
      for (int i = 0; i < 2; ++i) assert_near(step[b][i], dense[2 * b + i], 1e-9 * scale);
    for (int i = 0; i < 2; ++i) assert_near(border_step[i], dense[SIZE - 2 + i], 1e-9 * scale);
  }
}

// The optimum has a vanishing dense Gauss-Newton step, and noiseless data give back the parameters.
static void optimum_equals_dense_optimum(void **state) {
  (void)state;
  family f;
  double truth[BLOCKS][2], true_border[2], theta[BLOCKS][2] = {{0}}, border[2] = {0}, step[SIZE];
  fill_family(&f, truth, true_border, 0.05);
  sonde_bordered_problem problem = family_problem(&f);
  sonde_bordered_result result;
  assert_ok(sonde_bordered_minimise(&problem, theta, border, &result, NULL), NULL);
  assert_true(result.converged);
  dense_step(&f, (const double(*)[2])theta, border, 0, step);
  for (int i = 0; i < SIZE; ++i) assert_near(step[i], 0, 1e-6);
  fill_family(&f, truth, true_border, 0);
  assert_ok(sonde_bordered_minimise(&problem, theta, border, &result, NULL), NULL);
  for (int b = 0; b < BLOCKS; ++b)
    for (int i = 0; i < 2; ++i) assert_near(theta[b][i], truth[b][i], 1e-6);
  assert_near(border[0], true_border[0], 1e-6);
}

// The reported variance is the diagonal of the inverse of the full normal matrix.
static void border_variance_equals_dense_inverse(void **state) {
  (void)state;
  family f;
  double theta[BLOCKS][2], border[2];
  fill_family(&f, theta, border, 0.05);
  sonde_bordered_problem problem = family_problem(&f);
  sonde_bordered_result result;
  assert_ok(sonde_bordered_minimise(&problem, theta, border, &result, NULL), NULL);
  for (int column = 0; column < 2; ++column) {
    // inverse(c,c) = d x_c / d rhs_c: perturb the right-hand side through the dense solver.
    double a[SIZE][SIZE] = {{0}}, x[SIZE] = {0};
    for (uint32_t b = 0; b < BLOCKS; ++b)
      for (uint32_t r = STARTS[b]; r < STARTS[b + 1]; ++r) {
        double residual, j[4];
        family_row(&f, b, r, theta[b], border, &residual, j);
        const int at[4] = {(int)(2 * b), (int)(2 * b + 1), SIZE - 2, SIZE - 1};
        for (int p = 0; p < 4; ++p)
          for (int q = 0; q < 4; ++q) a[at[p]][at[q]] += j[p] * j[q];
      }
    x[SIZE - 2 + column] = 1;
    dense_solve(a, x, SIZE);
    assert_near(result.border_variance[column] / x[SIZE - 2 + column], 1, 1e-6);
  }
}

static void bounds_hold(void **state) {
  (void)state;
  family f;
  double theta[BLOCKS][2], border[2];
  fill_family(&f, theta, border, 0);
  sonde_bordered_problem problem = family_problem(&f);
  problem.high[0] = 0.15; // the truth of blocks 2..4 lies above
  for (int b = 0; b < BLOCKS; ++b) theta[b][0] = theta[b][1] = 0;
  sonde_bordered_result result;
  assert_ok(sonde_bordered_minimise(&problem, theta, border, &result, NULL), NULL);
  assert_true(result.converged);
  assert_near(theta[4][0], 0.15, 0);
  assert_true(theta[0][0] < 0.15);
}

// weight * r is the derivative of the loss, and every loss is half r^2 times a constant near 0.
static void losses_have_their_weights(void **state) {
  (void)state;
  const double curvature[3] = {1, 1, 4.0 / 3.0};
  for (int loss = 0; loss < 3; ++loss)
    for (double r = -5; r <= 5; r += 0.37) {
      double weight, up, unused, h = 1e-6;
      double down = sonde_loss((sonde_fit_loss)loss, 0.7, r - h, &unused);
      up = sonde_loss((sonde_fit_loss)loss, 0.7, r + h, &unused);
      sonde_loss((sonde_fit_loss)loss, 0.7, r, &weight);
      assert_near((up - down) / (2 * h), weight * r, 1e-6);
      double small = sonde_loss((sonde_fit_loss)loss, 0.7, 1e-4, &unused);
      assert_near(small / 0.5e-8, curvature[loss], 1e-5);
    }
}

static bool stop_at_once(double fraction, const char *what, void *user) {
  (void)fraction;
  (void)what;
  (void)user;
  return false;
}

static void progress_cancels(void **state) {
  (void)state;
  family f;
  double theta[BLOCKS][2] = {{0}}, border[2] = {0}, truth[BLOCKS][2];
  fill_family(&f, truth, border, 0);
  border[0] = 2;
  sonde_bordered_problem problem = family_problem(&f);
  const sonde_progress progress = {stop_at_once, NULL};
  problem.progress = &progress;
  sonde_bordered_result result;
  assert_ok(sonde_bordered_minimise(&problem, theta, border, &result, NULL), NULL);
  assert_true(result.cancelled);
  assert_int_equal(result.iterations, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(step_equals_dense_step),
      cmocka_unit_test(optimum_equals_dense_optimum),
      cmocka_unit_test(border_variance_equals_dense_inverse),
      cmocka_unit_test(bounds_hold),
      cmocka_unit_test(losses_have_their_weights),
      cmocka_unit_test(progress_cancels),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
